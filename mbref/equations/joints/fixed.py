"""Fixed joint: a point and three directions, six rows."""

import numpy as np

from mbref.equations.joints.base import Primitive, coincident, perpendicular
from mbref.scene import Fixed


def primitives(joint: Fixed) -> list[Primitive]:
    """No relative motion."""
    x, y, z = np.eye(3)
    return [coincident(joint.anchor), perpendicular(x, y), perpendicular(y, z), perpendicular(z, x)]
