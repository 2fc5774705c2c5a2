"""The runs of the README's animated picture: a slider-crank through singular positions in two engines."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from crosscheck.engine import Setting
from crosscheck.judge.truth import truth_for
from crosscheck.paper.singular import rank, scaled_singular_values
from crosscheck.study.grid import Case, Record, study
from crosscheck.study.search.offers import settings
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene
from mbref.scenes import SCENES

SCENE, SAMPLES = "planar_slider_crank_equal", 161
FINE = 1001  # equally spaced times at which the constraint Jacobian is evaluated
# smallest singular value of the scaled Jacobian: a local minimum below it counts as a singular position
NEAR = 0.05


class MovingPicture(NamedTuple):
    """Contents of the README's animated picture: scene, exact motion, times (s) of singular positions, and
    records."""

    scene: Scene
    exact: Trajectory
    singular: list[float]
    records: list[Record]


def moving_picture() -> MovingPicture:
    """Return runs of mbref's default method and of MuJoCo with default settings and the smallest step of the
    sweep."""
    scene = SCENES[SCENE]()
    truth, times = truth_for(scene), np.linspace(0.0, scene.duration, SAMPLES)
    assert truth is not None
    finest = [s for s in settings("mujoco", scene) if s.family == "defaults"][-1]
    chosen = (("mbref", Setting("taylor", {"rtol": 1e-9})), ("mujoco", finest))
    records = study([Case(scene, times, engine, setting) for engine, setting in chosen])
    return MovingPicture(scene, truth.poses(times), singular_instants(scene), records)


def singular_instants(scene: Scene) -> list[float]:
    """Return the times (s) at which the constraint Jacobian loses rank along the exact motion."""
    times = np.linspace(0.0, scene.duration, FINE)
    values = scaled_singular_values(scene, times)
    smallest = values[:, rank(np.median(values, axis=0)) - 1]
    inner = smallest[1:-1]
    least = (inner < NEAR) & (inner <= smallest[:-2]) & (inner < smallest[2:])
    return times[1:-1][least].tolist()
