"""Inline joint: a point of the second body stays on a line of the first, two rows."""

from mbref.equations.joints.base import Primitive, frame, in_plane
from mbref.scene import Inline


def primitives(joint: Inline) -> list[Primitive]:
    """Return the rows that allow displacement along the axis and free rotation."""
    x, y, _ = frame(joint.axis)
    return [in_plane(joint.anchor, x), in_plane(joint.anchor, y)]
