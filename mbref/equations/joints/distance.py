"""Distance joint: two points keep their distance, one row."""

import math

from mbref.equations.joints.base import Primitive
from mbref.kernels.scene_layout import DISTANCE
from mbref.scene import Distance


def primitives(joint: Distance) -> list[Primitive]:
    """Return the row of a massless link with a spherical joint at each end."""
    first, second = joint.anchors
    return [Primitive(DISTANCE, point_first=first, point_second=second, length=math.dist(first, second))]
