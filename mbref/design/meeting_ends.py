"""Springs whose ends meet in a pose, where a force along the line of the ends has no direction."""

from __future__ import annotations

import numpy as np

from mbref import rotations
from mbref.equations.model import Model, all_displaced
from mbref.kernels.scene_layout import SPRING
from mbref.scene import SceneError

MEETING = 1e-11  # distance of the ends / length of the mechanism, up to which they meet
PROBE = 1e-6  # displacement, lengths or rad, that shows the directions in which the ends part
ONE_LINE = 1e-4  # smaller / larger extent of these directions, up to which they are on one line


def spring_gaps(model: Model, q: np.ndarray) -> np.ndarray:
    """Return the vectors (k, s, 3), m, between the ends of the s springs at q (k, 7 nb)."""
    loads, count = model.data.loads, len(q)
    springs = np.flatnonzero(loads.kind == SPRING)
    ground = np.broadcast_to([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (count, 1, 7))
    poses = np.concatenate([q.reshape(count, model.nb, 7), ground], axis=1)
    first, second = (
        poses[:, bodies, :3] + rotations.rotate(poses[:, bodies, 3:], points[None])
        for bodies, points in (
            (loads.first[springs], loads.point_first[springs]),
            (loads.second[springs], loads.point_second[springs]),
        )
    )
    return np.asarray(second - first)


def refuse_meeting_ends(model: Model, q: np.ndarray, displacements: np.ndarray, consequence: str) -> None:
    """Raise SceneError if the force of a spring changes abruptly along displacements from a pose q (7 nb,).

    The ``displacements`` (n, k) are in lengths of the mechanism or rad. Where the ends of a spring meet, its
    damping force is linear only if they part along one line, and the force of a natural length never is.
    """
    loads = model.data.loads
    springs = np.flatnonzero(loads.kind == SPRING)
    here = spring_gaps(model, q[None])[0] / model.length
    meeting = np.linalg.norm(here, axis=1) <= MEETING
    if not meeting.any():
        return
    moved = all_displaced(q, PROBE * (model.units[:, None] * displacements).T)
    parting = (spring_gaps(model, moved) / model.length - here) / PROBE
    for place in np.flatnonzero(meeting):
        k, apart = springs[place], parting[:, place]
        largest = np.linalg.norm(apart, axis=1).max(initial=0.0)
        if largest <= ONE_LINE:
            continue
        has_length = loads.stiffness[k] > 0.0 and loads.natural[k] > 0.0
        line = here[place] / (np.linalg.norm(here[place]) or 1.0)
        extents = np.linalg.svd(np.vstack([apart / largest, line]), compute_uv=False)
        if has_length or (loads.damping[k] > 0.0 and extents[1] > ONE_LINE * extents[0]):
            part = "force of its natural length" if has_length else "damping force"
            fault = f"load[{k}]: the ends of the spring meet, where its {part} has no direction"
            raise SceneError([f"{fault}; {consequence}"])
