"""Exudyn's item for every joint type, and the frames and sensors of its markers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from crosscheck.engines.shared.everything import EVERYTHING
from crosscheck.engines.shared.geometry import joint_frame
from mbref.rotations import unit
from mbref.scene import Joint

X, Y, Z = 0, 1, 2
LOCAL = {"ForceLocal": 3, "TorqueLocal": 3}


@dataclass(frozen=True)
class Item:
    """An Exudyn joint: its class in ``exudyn.itemInterface``, and what its sensors record.

    ``constrained`` are the translations and rotations of a generic joint; ``along`` is the axis of the marker
    frames that is along the joint's axis; ``outputs`` are names and sizes of the output variables that make
    up the reaction.  A component of TorqueLocal is the multiplier of a·b = 0 between an axis a of the first
    marker's frame and an axis b of the second's: ``torques`` has (a, b), or None for a component at zero.
    """

    name: str
    constrained: tuple[int, ...] = ()
    along: int = Z
    outputs: Mapping[str, int] = field(default_factory=lambda: LOCAL)
    torques: tuple[tuple[int, int] | None, ...] = ()


ALL, ACROSS = ((Z, Y), (Z, X), (X, Y)), ((Z, X), (Z, Y))
JOINTS = {
    "fixed": Item("ObjectJointGeneric", (1, 1, 1, 1, 1, 1), torques=ALL),
    "revolute": Item("ObjectJointRevoluteZ", torques=ACROSS),
    "universal": Item("ObjectJointGeneric", (1, 1, 1, 0, 0, 1), torques=(None, None, (X, Y))),
    "spherical": Item("ObjectJointSpherical", outputs={"Force": 3}),
    "translational": Item("ObjectJointPrismaticX", along=X, torques=ALL),
    "cylindrical": Item("ObjectJointGeneric", (1, 1, 0, 1, 1, 0), torques=ACROSS),
    "planar": Item("ObjectJointGeneric", (0, 0, 1, 1, 1, 0), torques=ACROSS),
    "inline": Item("ObjectJointGeneric", (1, 1, 0, 0, 0, 0), torques=(None, None, None)),
    "distance": Item("ObjectConnectorDistance", outputs={"Force": 1}),
}
SUPPORTS = replace(EVERYTHING, joints=tuple(JOINTS), massless_links=True)


def marker_frame(joint: Joint) -> np.ndarray:
    """Return the world axes (columns) at t = 0 of a joint's markers, one of them along the joint's axis.

    A universal joint has x along the axis on the first body and y along the axis on the second.
    """
    if not joint.directions:
        return np.eye(3)
    if len(joint.directions) == 2:
        x, y = (unit(axis) for axis in joint.directions)
        return np.column_stack([x, y, np.cross(x, y)])
    return np.roll(joint_frame(joint.directions[0]), JOINTS[joint.type].along - Z, axis=1)
