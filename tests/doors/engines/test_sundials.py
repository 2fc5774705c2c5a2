"""Runs of SUNDIALS IDA against truths, and positions that it cannot pass."""

import math

import numpy as np
import pytest

from crosscheck.engine import Setting, engine
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Scene
from mbref.scenes import SCENES
from tests.helpers.measured import MARGIN, completed_error, error_of_samples

pytest.importorskip("sksundae", reason="the optional engine SUNDIALS needs scikit-sundae")


def simulate(scene: Scene, duration: float, rtol: float, samples: int = 6) -> Trajectory:
    return engine("sundials").run(scene, np.linspace(0, duration, samples), Setting("ggl", {"rtol": rtol}))


@pytest.mark.parametrize(
    ("name", "duration", "measured"),  # s without a singular position, error (m, rad)
    [
        ("planar_slider_crank_gravity", 0.15, 1.5e-6),
        ("spatial_slider_crank", 0.01, 1.2e-7),
        ("four_bar", 0.012, 1.4e-8),
        ("four_bar_gravity", 0.15, 7.9e-8),
    ],
)
def test_ida_stays_within_its_measured_error_of_the_truth(name, duration, measured) -> None:
    """The error from the judge's truth is at most ten times the measured one. The tolerance of 1e-8 holds for
    a step: over a thousand steps errors grow by orders."""
    scene = SCENES[name]()
    assert completed_error(simulate(scene, duration, 1e-8), scene) < MARGIN * measured


def test_tolerance_of_a_hundredth_reduces_ida_s_error_fivefold() -> None:
    """A tolerance without effect would leave the error, a proportional one a hundredth; 1/5 is between."""
    scene = SCENES["spatial_slider_crank"]()
    errors = [completed_error(simulate(scene, 0.01, rtol), scene) for rtol in (1e-4, 1e-6, 1e-8)]
    assert errors[1] < errors[0] / 5 and errors[2] < errors[1] / 5


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


@pytest.mark.slow
def test_ida_turns_a_redundant_crank_by_more_than_a_turn() -> None:
    """Rows of the planar slider-crank are chosen at the start and replaced where they become dependent. The
    error from the judge's truth is at most ten times the measured 1.5e-3 m or rad."""
    scene = SCENES["planar_slider_crank"]()
    run = simulate(scene, 0.25, 1e-6, 26)
    assert run.angular_velocity[:, 0, 2].mean() * 0.25 > 2 * math.pi
    assert completed_error(run, scene) < MARGIN * 1.5e-3
