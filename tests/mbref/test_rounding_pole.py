"""Steps that crossings of singular positions take: a pole of the series by rounding shortens none."""

import numpy as np
import pytest

from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import truth_for
from mbref.method import Method
from mbref.scenes import SCENES
from mbref.simulation.simulate import Limits, simulate


@pytest.mark.parametrize("name", ("four_bar_gravity", "five_bar_gravity"))
def test_crossings_of_swinging_parallelograms_take_few_steps_and_are_exact(name):
    """The closed form has all bodies on the x axis at the times of the three crossings; 18 steps suffice for
    the motion with rtol 1e-8."""
    scene = SCENES[name]()
    times = np.linspace(0.0, scene.duration, 11)
    run = simulate(scene, Method.parse("taylor[order=22]"), times, Limits(rtol=1e-8, code="generic"))
    assert run.outcome.label == "COMPLETED" and run.cost.steps + run.cost.rejected <= 18
    truth = truth_for(scene)
    flat = truth.poses(np.array([passed.time for passed in run.crossings])).position
    assert len(flat) == 3 and np.abs(flat[..., 1]).max() < 1e-7
    assert measure(scene, run, truth)["error"] < 1e-7


@pytest.mark.parametrize("name", ("four_bar", "five_bar"))
def test_driven_crossings_take_few_steps_and_samples_at_and_near_one_are_exact(name):
    """At most 14 steps for 12.5 rad and four singular positions, each crossed by one high-accuracy step. The
    samples are at the first one and 10 µs from it."""
    scene = SCENES[name]()
    first = simulate(scene, Method.parse("taylor"), [scene.duration]).crossings[0].time
    times = np.sort(np.append(np.linspace(0.0, scene.duration, 11), first + np.array([-1e-5, 0.0, 1e-5])))
    run = simulate(scene, Method.parse("taylor"), times, Limits(code="generic"))
    assert len(run.crossings) == 4 and run.cost.steps + run.cost.rejected <= 14
    error = measure(scene, run, truth_for(scene))
    assert error["error"] < 1e-12 and error["velocity_error"] < 1e-12, error
