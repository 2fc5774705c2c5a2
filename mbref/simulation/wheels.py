"""Wheels that fall flat on their plane, where their lowest point is not determined and a run ends."""

from __future__ import annotations

import numpy as np

from mbref import rotations
from mbref.kernels.scene_layout import CONTACT
from mbref.stepping.run import Run

LYING_FLAT = 1e-2  # sine of the angle between axis and normal, below which it explains the end of a run
FRAME_AT_REST = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)


def lying_wheel(run: Run) -> str:
    """Return the joint of a wheel that lies flat at the last accepted state; empty if none does."""
    q = np.append(run.memory.previous.coordinates, FRAME_AT_REST).reshape(-1, 7)
    table, structure = run.model.data.primitives, run.model.structure
    for p in np.flatnonzero(structure.kind == CONTACT).tolist():
        normal = rotations.rotate(q[table.first[p], 3:], table.turning_first[p])
        axis = rotations.rotate(q[table.second[p], 3:], table.direction_second[p])
        if np.linalg.norm(rotations.cross(normal, axis)) < LYING_FLAT:
            return structure.row_joint[table.row[p]]
    return ""
