"""Universal joint: a point and one perpendicularity, four rows."""

from mbref.equations.joints.base import Primitive, coincident, perpendicular, unit
from mbref.scene import Universal


def primitives(joint: Universal) -> list[Primitive]:
    """The axis of each body stay perpendicular at a common point."""
    first, second = joint.axes
    return [coincident(joint.anchor), perpendicular(unit(first), unit(second))]
