"""Translational joint: a cylindrical joint that does not turn, five rows."""

from mbref.equations.joints.base import Primitive, frame, in_plane, perpendicular
from mbref.scene import Translational


def primitives(joint: Translational) -> list[Primitive]:
    """Return the rows that allow displacement along the axis."""
    x, y, z = frame(joint.axis)
    return [
        perpendicular(x, z), perpendicular(y, z), perpendicular(x, y),
        in_plane(joint.anchor, x), in_plane(joint.anchor, y),
    ]  # fmt: skip
