"""Planar joint: parallel normals and a point that stays in a plane, three rows."""

from mbref.equations.joints.base import Primitive, frame, in_plane, perpendicular
from mbref.scene import Planar


def primitives(joint: Planar) -> list[Primitive]:
    """Return the rows that allow displacement in the plane and rotation about its normal."""
    x, y, z = frame(joint.axis)
    return [perpendicular(x, z), perpendicular(y, z), in_plane(joint.anchor, z)]
