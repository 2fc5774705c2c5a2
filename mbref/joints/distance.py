"""Distance joint: two points keep their distance, one row."""

import math

from mbref.joints.base import Primitive
from mbref.scene import Distance
from mbref.tables import DISTANCE


def primitives(joint: Distance) -> list[Primitive]:
    """A massless link with a spherical joint at each end."""
    first, second = joint.anchors
    return [Primitive(DISTANCE, point_first=first, point_second=second, length=math.dist(first, second))]
