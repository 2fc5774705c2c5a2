"""Runs without projection complete on the motion of their start, or say that they left it."""

import numpy as np
import pytest

from crosscheck.judge.metrics import error_series, measure
from crosscheck.judge.truth import closed_form
from mbref.scenes.five_bar import five_bar_gravity
from mbref.scenes.four_bar import four_bar_gravity
from mbref.scenes.planar_slider_crank import slider_crank
from mbref.simulation.simulate import Limits, simulate
from tests.helpers.measured import relative_error

SCENES = {  # angle from flat at the start (rad), or lengths of crank and rod (m); duration (s)
    "four_bar": (four_bar_gravity(0.3, "four_bar"), 1.5),
    "five_bar": (five_bar_gravity(0.3, "five_bar"), 1.5),
    "turning": (four_bar_gravity(-1e-5, "turning"), 1.5),
    "gap": (slider_crank(0.308, 0.308 + 1e-6, 0.3, "gap", rate=30.0), 0.25),
    "equal": (slider_crank(0.308, 0.308, 0.3, "equal", rate=30.0), 0.25),
}
METHODS = [
    f"{formulation}+{stabilisation}"
    for formulation in ("alf-dual", "mpi-svd", "mpi-gs", "mpi-qr")
    for stabilisation in ("none", "baumgarte", "partitioning")
]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", SCENES)
def test_methods_without_projection_do_not_complete_on_another_motion(name, method):
    """METHODS are 4 formulations with each stabilisation except projection; SCENES cross, turn back from or
    miss a singular position. A run that completes is within the larger of 2000 rtol and 2e-6 of the judge's
    closed form; half of this is the difference from a projected run above which it ends LEFT_MOTION."""
    scene, end = SCENES[name]
    for rtol in (1e-5, 1e-9):
        run = simulate(scene, method, np.linspace(0.0, end, 9), Limits(rtol=rtol, most_steps=5_000))
        error = measure(scene, run, closed_form(scene))["error"]
        assert run.outcome.label != "COMPLETED" or error <= max(2000 * rtol, 2e-6), f"{rtol:g}: {error:.1e}"


def test_run_that_left_its_motion_ends_at_the_first_wrong_sample():
    """A sample is wrong if it differs from the closed form by more than 1000 rtol. The run without comparison
    goes on, and has the first such sample where the other run ends."""
    scene, end = SCENES["four_bar"]
    times, rtol = np.linspace(0.0, end, 31), 1e-6
    run = simulate(scene, "mpi-gs+none", times, Limits(rtol=rtol))
    whole = simulate(scene, "mpi-gs+none", times, Limits(rtol=rtol, compared=False))
    left = np.argmax(error_series(scene, whole, closed_form(scene).poses(times)) > 1000 * rtol)
    assert left > 0 and run.outcome.label == "LEFT_MOTION" and run.t_end == times[left]
    assert np.array_equal(run.times, times[:left]), "samples end where the run left its motion"
    assert f"by t = {run.t_end:.6g} s; " in run.message


def test_rank_tolerance_that_drops_independent_rows_ends_as_left_motion():
    """A singular value below rank_tolerance times the largest counts as zero. With 0.1 independent rows are
    dropped, and the motion is wrong, though it keeps the other rows; with 1e-3 it is right, to ten rtol."""
    scene = slider_crank(0.304, 0.4048, 0.3, "coarse", rate=30.0).with_(gravity=(0.0, -9.81, 0.0))
    times = np.linspace(0.0, 0.5, 21)
    run = simulate(scene, "mpi-svd+projection", times, Limits(rank_tolerance=0.1))
    assert run.outcome.label == "LEFT_MOTION"
    sound = simulate(scene, "mpi-svd+projection", times, Limits(rank_tolerance=1e-3))
    assert relative_error(sound, scene) < 10 * 1e-9


def test_inaccurate_run_in_fixed_steps_completes_on_its_motion_and_obeys_the_largest_step():
    """With steps of 0.02 s the error against the closed form is above 1e-6, a thousand times rtol, and below
    a tenth of the mechanism's length: the run remains on its branch. If 0.01 s are allowed, 1 s takes 100."""
    scene = slider_crank(0.1, 0.3, 0.3, "crank", rate=3.0)
    run = simulate(scene, "mpi-svd+none/rk4[step=2e-2]", [0.5, 1.0])
    assert run.outcome.label == "COMPLETED" and 1e-6 < relative_error(run, scene) < 0.1
    bounded = simulate(scene, "mpi-svd+none/rk4[step=2e-2]", [0.5, 1.0], Limits(largest_step=1e-2))
    assert bounded.outcome.label == "COMPLETED" and bounded.cost.steps == 100
