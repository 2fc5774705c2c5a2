"""Starts at rest on a singular position: the motion leaves along the branch that the forces push most."""

import numpy as np

from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import closed_form
from mbref import Limits, simulate
from mbref.scene import Moment, Scene
from tests.helpers.measured import relative_error
from tests.helpers.statics import hinge, rod

TIMES = np.linspace(0.0, 1.0, 11)
ROUNDING = 1e-11  # relative; the motion of constant moment and no weight has polynomial angles


def flat_parallelogram(moment: float) -> Scene:
    """Two cranks of 1 m, 2 m apart, and their coupler, all on one line; a moment (N m) on a crank."""
    centres = (("left", 0.5), ("right", 2.5), ("coupler", 2.0))
    pairs = (("ground", "left"), ("ground", "right"), ("left", "coupler"), ("right", "coupler"))
    places = zip("ADBC", pairs, (0.0, 2.0, 1.0, 3.0), strict=True)
    pins = [hinge(n, pair, (x, 0.0, 0.0)) for n, pair, x in places]
    push = Moment(body="left", moment=(0.0, 0.0, moment))
    bodies = [rod(name, (x, 0.0, 0.0), 1.0, 0.1) for name, x in centres]
    return Scene(name="flat", duration=1.0, body=bodies, joint=pins, load=(push,))


def test_flat_parallelogram_at_rest_turns_as_its_crank_is_pushed():
    """The branch of the parallelogram has less inertia than the other: 2 (0.1 + 0.5² kg m²) of the cranks and
    1 kg m² of the coupler, so that 5 N m give 5 / 1.7 rad/s². Later samples are the judge's closed form, to
    rounding. The message states the choice."""
    scene = flat_parallelogram(5.0)
    run = simulate(scene, "taylor", TIMES)
    assert relative_error(run, scene) < ROUNDING and len(run.times) == len(TIMES)
    assert np.allclose(run.angular_acceleration[0, :2, 2], 5.0 / 1.7, rtol=ROUNDING, atol=0)
    choice = "begins at rest on a singular position and takes, of the 2 branches that meet there"
    assert choice in run.message, run.message


def test_start_at_rest_on_a_singular_position_needs_no_sample_at_the_start():
    """The branch is chosen at 0 s also if the first sample is at 10 µs. By the closed form, as in the test
    above, the moment of 5 N m turns the cranks by 5 / 1.7 · t² / 2 rad."""
    scene = flat_parallelogram(5.0)
    assert relative_error(simulate(scene, times=[1e-5, 0.5]), scene) < ROUNDING


def test_flat_parallelogram_without_forces_stays_and_no_branch_is_chosen():
    """Nothing pushes the bodies, so that they move by rounding alone; the message states no choice."""
    run = simulate(flat_parallelogram(moment=0.0).with_(load=()), times=TIMES)
    assert run.outcome.label == "COMPLETED" and np.ptp(run.position, axis=0).max() < ROUNDING
    assert "begins at rest" not in run.message


def test_method_that_cannot_choose_the_branch_does_not_complete_on_a_wrong_one():
    """The judge's closed form follows the parallelogram; a run completes only within 1000 rtol of it."""
    scene, rtol = flat_parallelogram(5.0), 1e-9
    for method in ("mpi-svd+none", "alf+baumgarte"):
        run = simulate(scene, method, TIMES, Limits(rtol=rtol))
        error = measure(scene, run, closed_form(scene))["error"]
        assert run.outcome.label != "COMPLETED" or error < 1000 * rtol, (method, error)


def test_run_with_steps_too_short_for_its_end_is_given_up():
    """10¹² steps are needed, 5 million allowed: the run ends after fewer than 30 000."""
    run = simulate("planar_slider_crank", times=[1.0], limits=Limits(largest_step=1e-12))
    assert run.outcome.label == "STEP_FAILED" and run.cost.steps < 30_000
    assert "too short to reach the end" in run.message
