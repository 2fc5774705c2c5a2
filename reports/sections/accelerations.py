"""Section: initial accelerations of the engines compared with Gauss's principle, and the distance to
singularity."""

from __future__ import annotations

import numpy as np

from crosscheck.judge.gauss_principle import gauss, singular_values, stacked
from crosscheck.judge.tolerances import RANK

from ..blocks import Block, Heading, Table
from ..runs import SceneRuns, beyond_rounding

HEADER = ("Engine", "Family", "Difference")


def render(scene_runs: SceneRuns) -> list[Block]:
    """Return the comparison of accelerations at t = 0 of each family's best run with Gauss's principle; empty
    for a scene without masses."""
    if not scene_runs.scene.has_mass():
        return []
    exact = gauss(scene_runs.scene)
    scale = np.linalg.norm(exact, axis=-1).max() or 1.0
    rows = []
    for curve, run in scene_runs.best().items():
        motion = run.trajectory
        if motion.acceleration is not None and len(motion.times) and motion.times[0] == 0:
            off = np.linalg.norm(stacked(scene_runs.scene, motion, 0) - exact, axis=-1).max() / scale
            rows.append((*curve, beyond_rounding(float(off))))
    caption = (
        "Largest difference of an initial acceleration (angular ones times the mechanism's length) from "
        "Gauss's principle with the judge's own joint equations, relative to the largest acceleration. "
        f"{_distance(scene_runs) if scene_runs.scene.joint else ''}"
    )
    heading = Heading("Initial accelerations")
    return [heading, Table(caption, HEADER, rows, right=frozenset({2}), folded=True)] if rows else []


def _distance(scene_runs: SceneRuns) -> str:
    values = singular_values(scene_runs.scene)
    above = values[values > RANK * values[0]]
    return (
        f"Distance to singularity (smallest nonzero singular value of the scaled Jacobian): {above[-1]:.1e}."
    )
