"""Cylindrical joint: parallel axes on a common line, four rows."""

from mbref.equations.joints.base import Primitive, frame, in_plane, perpendicular
from mbref.scene import Cylindrical


def primitives(joint: Cylindrical) -> list[Primitive]:
    """Return the rows that allow rotation about and displacement along the axis."""
    x, y, z = frame(joint.axis)
    return [
        perpendicular(x, z), perpendicular(y, z), in_plane(joint.anchor, x), in_plane(joint.anchor, y),
    ]  # fmt: skip
