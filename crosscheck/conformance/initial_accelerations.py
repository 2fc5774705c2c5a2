"""Initial accelerations of engines on one scene, compared with mbref's and with Gauss's principle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from crosscheck.engine import engine
from crosscheck.judge.constraints import initial_poses, jacobian
from crosscheck.judge.gauss_principle import gauss, rank_of, singular_values, stacked
from mbref.motions.trajectory import Outcome
from mbref.scene import Scene

REFERENCE, PRINCIPLE = "mbref", "Gauss's principle"


@dataclass(frozen=True)
class Comparison:
    """Comparison on one mechanism: its redundant rows, its ``distance`` to singularity, and the error of each
    engine.

    ``distance`` is the smallest nonzero singular value of the Jacobian, with rows of unit length and lengths
    relative to the scene's.
    """

    scene: Scene
    redundant: int
    distance: float
    errors: dict[str, float]  # largest relative difference of an acceleration from mbref's; inf if none


def compare(scene: Scene, engines: Sequence[str]) -> Comparison:
    """Compare initial accelerations with mbref's: of each engine at the finest setting of its best family,
    and by Gauss's principle with the judge's equations.

    All runs are in this process.
    """
    reference = initial_accelerations(scene, REFERENCE)
    values = singular_values(scene)
    rank = rank_of(values)
    if reference is None:
        raise RuntimeError(f"{scene.name}: mbref gives no initial acceleration")
    scale = np.linalg.norm(reference, axis=-1).max()
    others = {name: initial_accelerations(scene, name) for name in engines}
    others[PRINCIPLE] = gauss(scene)
    errors = {name: _apart(found, reference) / scale for name, found in others.items()}
    rows, _ = jacobian(scene, 0.0, *initial_poses(scene))
    return Comparison(scene, len(rows) - rank, float(values[rank - 1]), errors)


def initial_accelerations(scene: Scene, name: str) -> np.ndarray | None:
    """Return an engine's own output of the accelerations at t = 0, and of the angular accelerations times the
    scene's length (2 nb, 3), m/s², world axes.

    None if the run fails or contains no accelerations.
    """
    simulator = engine(name)
    setting = simulator.best_settings(scene)[-1]
    run = simulator.run(scene, np.array([0.0, scene.duration / 100]), setting)
    if run.outcome is not Outcome.COMPLETED or run.acceleration is None:
        return None
    return stacked(scene, run, 0)


def _apart(found: np.ndarray | None, reference: np.ndarray) -> float:
    return np.inf if found is None else float(np.linalg.norm(found - reference, axis=-1).max())
