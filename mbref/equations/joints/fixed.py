"""Fixed joint: a point and three directions, six rows."""

from mbref.equations.joints.base import AXES, Primitive, coincident, perpendicular
from mbref.scene import Fixed


def primitives(joint: Fixed) -> list[Primitive]:
    """Return the rows that allow no relative motion."""
    x, y, z = AXES
    return [coincident(joint.anchor), perpendicular(x, y), perpendicular(y, z), perpendicular(z, x)]
