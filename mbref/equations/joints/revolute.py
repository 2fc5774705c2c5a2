"""Revolute joint: a point and two directions perpendicular to the axis, five rows."""

from mbref.equations.joints.base import Primitive, coincident, frame, perpendicular
from mbref.scene import Revolute


def primitives(joint: Revolute) -> list[Primitive]:
    """Return the rows that allow rotation about the axis."""
    x, y, z = frame(joint.axis)
    return [coincident(joint.anchor), perpendicular(x, z), perpendicular(y, z)]
