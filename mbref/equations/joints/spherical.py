"""Spherical joint: a point, three rows."""

from mbref.equations.joints.base import Primitive, coincident
from mbref.scene import Spherical


def primitives(joint: Spherical) -> list[Primitive]:
    """Return the rows that allow free rotation about a common point."""
    return [coincident(joint.anchor)]
