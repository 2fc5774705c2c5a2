"""Bricard's linkage, overconstrained in every position: the engines / the reference. No row is redundant by
itself, and away from closed poses none is redundant at all: whoever resolves the rank of poses that are not
quite closed follows rounding."""

import numpy as np
import pytest

from crosscheck.engine import Setting, engine
from crosscheck.judge.metrics import error_series
from crosscheck.judge.truth import truth_for
from mbref.motions.trajectory import Outcome
from mbref.scenes import SCENES
from tests.crosscheck.measured import MARGIN

FINE = {"rtol": 1e-10, "min_step": 0.01}


@pytest.mark.parametrize(
    ("name", "setting", "measured"),  # difference from the reference, of the length, or in rad
    [
        ("mujoco", Setting("forward", {**FINE, "beta": 10.0, "hard": 1e-7}), 5.4e-10),
        ("pinocchio", Setting("proximal", {"step": 1e-3}), 2.7e-13),
        ("pinocchio", Setting("tuned", FINE), 4.8e-11),
        ("exudyn", Setting("alpha", {"step": 1e-4}), 3e-9),
    ],
    ids=["mujoco forward", "pinocchio proximal", "pinocchio tuned", "exudyn alpha"],
)
def test_engine_moves_bricard_s_linkage_as_the_reference(name: str, setting: Setting, measured: float):
    """Six hinges about y, z, x, y, z, x on the edges of a cube of 1 m, let go at rest, over 0.6 s. The
    judge's reference is accurate to 1e-14; ten times the measured difference is allowed."""
    scene, times = SCENES["bricard"](), np.linspace(0.0, 0.6, 7)
    found = engine(name).run(scene, times, setting)
    assert found.outcome is Outcome.COMPLETED, found.message
    assert error_series(scene, found, truth_for(scene).poses(times)).max() < MARGIN * measured
