"""Starts at rest on a singular position: the motion leaves along the branch that the forces push most."""

import numpy as np

from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import closed_form
from mbref import Limits, simulate
from mbref.scene import GROUND, Body, Moment, Revolute, Scene

TIMES = np.linspace(0.0, 1.0, 11)


def flat_parallelogram(moment: float) -> Scene:
    """Two cranks of 1 m, 2 m apart, and their coupler, all on one line; a moment (N m) on a crank."""
    bodies = tuple(
        Body(name=name, mass=1.0, inertia=(0.1, 0.1, 0.1), position=(x, 0.0, 0.0))
        for name, x in (("left", 0.5), ("right", 2.5), ("coupler", 2.0))
    )
    hinges = tuple(
        Revolute(name=name, bodies=pair, anchor=(x, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
        for name, pair, x in (
            ("A", (GROUND, "left"), 0.0),
            ("D", (GROUND, "right"), 2.0),
            ("B", ("left", "coupler"), 1.0),
            ("C", ("right", "coupler"), 3.0),
        )
    )
    push = Moment(body="left", moment=(0.0, 0.0, moment))
    return Scene(name="flat", duration=1.0, body=bodies, joint=hinges, load=(push,))


def test_a_flat_parallelogram_turns_as_its_crank_is_pushed():
    """The parallelogram's branch has less inertia than the other; pseudo-inverses were 7e-5 off."""
    scene = flat_parallelogram(5.0)
    run = simulate(scene, "taylor", TIMES)
    assert run.outcome.label == "COMPLETED" and len(run.times) == len(TIMES)
    assert measure(scene, run, closed_form(scene))["error"] < 1e-11
    assert np.allclose(run.angular_acceleration[0, :2, 2], 5.0 / 1.7, rtol=1e-12, atol=0)
    choice = "begins at rest on a singular position and takes, of the 2 branches that meet there"
    assert choice in run.message, run.message


def test_first_sample_behind_the_start():
    scene = flat_parallelogram(5.0)
    run = simulate(scene, times=[1e-5, 0.5])
    assert run.outcome.label == "COMPLETED" and measure(scene, run, closed_form(scene))["error"] < 1e-11


def test_a_flat_parallelogram_without_a_push_stays():
    run = simulate(flat_parallelogram(5.0).with_(load=()), times=TIMES)
    assert run.outcome.label == "COMPLETED" and np.ptp(run.position, axis=0).max() < 1e-14
    assert "begins at rest" not in run.message, "nothing is chosen where nothing pushes"


def test_other_methods_do_not_complete_on_another_motion():
    scene = flat_parallelogram(5.0)
    for method in ("mpi-svd+none", "alf+baumgarte"):
        run = simulate(scene, method, TIMES)
        assert run.outcome.label != "COMPLETED" or measure(scene, run, closed_form(scene))["error"] < 1e-6


def test_a_run_whose_end_is_out_of_reach_ends():
    """Steps of 1e-12 s would take 200 000 times as many as are allowed."""
    run = simulate("planar_slider_crank", times=[1.0], limits=Limits(largest_step=1e-12))
    assert (
        run.outcome.label == "STEP_FAILED"
        and "too short to reach the end" in run.message
        and run.cost.steps < 30_000
    )
