"""Numbers of steps over singular positions, near which rounding adds a pole to the series that must shorten
no step."""

import numpy as np
import pytest

from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import truth_for
from mbref.method import Method
from mbref.scenes import SCENES
from mbref.simulation.simulate import Limits, simulate


@pytest.mark.parametrize("name", ("four_bar_gravity", "five_bar_gravity"))
def test_swing_through_three_flat_positions_takes_at_most_18_steps_and_meets_the_closed_form(name):
    """At the times of the crossings the judge's closed form has all bodies on the x axis. Errors are below
    ten times rtol; 18 steps were found."""
    scene = SCENES[name]()
    times = np.linspace(0.0, scene.duration, 11)
    run = simulate(scene, Method.parse("taylor[order=22]"), times, Limits(rtol=1e-8, code="generic"))
    assert run.outcome.label == "COMPLETED" and run.cost.steps + run.cost.rejected <= 18
    truth = truth_for(scene)
    flat = truth.poses(np.array([passed.time for passed in run.crossings])).position
    assert len(flat) == 3 and np.abs(flat[..., 1]).max() < 10 * 1e-8  # m
    assert measure(scene, run, truth)["error"] < 10 * 1e-8


@pytest.mark.parametrize("name", ("four_bar", "five_bar"))
def test_driven_loop_takes_at_most_14_steps_and_samples_at_and_near_a_crossing_are_exact(name):
    """12.5 rad and four singular positions, each crossed by one high-accuracy step. Samples are at the first
    one, 10 µs from it, and elsewhere; poses and velocities meet the closed form to rounding."""
    scene = SCENES[name]()
    first = simulate(scene, Method.parse("taylor"), [scene.duration]).crossings[0].time
    times = np.sort(np.append(np.linspace(0.0, scene.duration, 11), first + np.array([-1e-5, 0.0, 1e-5])))
    run = simulate(scene, Method.parse("taylor"), times, Limits(code="generic"))
    assert len(run.crossings) == 4 and run.cost.steps + run.cost.rejected <= 14
    error = measure(scene, run, truth_for(scene))
    assert error["error"] < 1e-12 and error["velocity_error"] < 1e-12, error
