"""Runs of SUNDIALS IDA against truths, and positions that it cannot pass."""

import math

import numpy as np
import pytest

from crosscheck.engine import Setting, engine
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Scene
from mbref.scenes import SCENES
from tests.helpers.measured import MARGIN, error_of_samples

pytest.importorskip("sksundae", reason="the optional engine SUNDIALS needs scikit-sundae")


def simulate(scene: Scene, duration: float, rtol: float, samples: int = 6) -> Trajectory:
    return engine("sundials").run(scene, np.linspace(0, duration, samples), Setting("ggl", {"rtol": rtol}))


def test_ida_stops_at_the_singular_position_of_a_driven_four_bar() -> None:
    """After a quarter turn at 124.8 rad/s, at 12.6 ms, its crank lies on the ground line; samples are 1 ms
    apart. At most ten times the measured: the run ends 2.6e-6 s off this time, and its 13 samples are off the
    truth by 2.9e-6 m or rad. Rounding decides whether IDA's iteration or its error test fails there."""
    scene = SCENES["four_bar"]()
    run = simulate(scene, 0.02, 1e-6, 21)
    singular = math.pi / 2 / 124.8
    assert run.outcome in (Outcome.NOT_CONVERGED, Outcome.STEP_FAILED), run.message
    assert abs(run.t_end - singular) < MARGIN * 2.6e-6
    assert len(run.times) == 13 and error_of_samples(run, scene) < MARGIN * 2.9e-6


def test_row_redundant_only_at_the_start_ends_the_run_with_a_violation() -> None:
    """The straight four-bar starts flat, with one more dependent row: IDA gets too few, and joints open."""
    run = simulate(SCENES["four_bar_straight"](), 0.02, 1e-6)
    assert run.outcome is Outcome.VIOLATION, f"{run.outcome.label}: {run.message}"
