"""Universal joint: a point and one perpendicularity, four rows."""

from mbref.equations.joints.base import Primitive, coincident, perpendicular, unit
from mbref.scene import Universal


def primitives(joint: Universal) -> list[Primitive]:
    """Return the rows for a common point and two axes, one of each body, that stay perpendicular."""
    first, second = joint.axes
    return [coincident(joint.anchor), perpendicular(unit(first), unit(second))]
