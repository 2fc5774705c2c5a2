"""Crossings in a few high-accuracy steps, of motions whose speed bounds their sensitivity."""

import numpy as np
import pytest

from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import closed_form
from mbref.scene import Body, Revolute, TorsionSpring
from mbref.scenes import find_scene
from mbref.scenes.four_bar import four_bar_gravity
from mbref.simulation.simulate import Limits, simulate
from tests.helpers.measured import relative_error

RTOL = 1e-9


def test_heavy_crank_passes_a_singular_position_every_half_turn_as_its_closed_form():
    """The crank, a flywheel, turns by 191.65 rad, which contains π/2 + k π for k = 0 to 60. The judge's
    closed form has its angle by the energy, met to ten rtol."""
    scene = find_scene("planar_slider_crank_heavy")
    run = simulate(scene, "taylor", np.linspace(0.0, scene.duration, 9), Limits(rtol=RTOL))
    assert relative_error(run, scene) < 10 * RTOL and len(run.crossings) == 61


def test_parallelogram_moves_by_its_closed_form_through_three_crossings_beside_a_free_pendulum():
    """With the pendulum, which nothing connects with the rest, the scene has two degrees of freedom. Released
    at 0.3 rad, the parallelogram swings through 0, -π and, on its way back, -π in 1 s; the judge has its
    closed form, met to ten rtol (m)."""
    scene, times = four_bar_gravity(), np.linspace(0.0, 1.0, 9)
    bob = Body(name="bob", mass=1.0, inertia=(1e-2,) * 3, position=(2.0, -0.5, 0.0))
    joint = Revolute(name="P", bodies=("ground", "bob"), anchor=(2.1, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    both = scene.with_(body=(*scene.body, bob), joint=(*scene.joint, joint))
    run = simulate(both, "taylor", times, Limits(rtol=RTOL))
    assert run.outcome.label == "COMPLETED" and len(run.crossings) == 3
    assert np.abs(run.position[:, :3] - closed_form(scene).poses(times).position).max() < 10 * RTOL  # m


def test_samples_just_after_a_crossing_meet_the_closed_form_at_a_loose_tolerance():
    """For 50 ms poses are off by less than rtol / 10, accelerations by less than 10 rtol of the largest."""
    scene = four_bar_gravity()
    first, loose = simulate(scene, "taylor", [1.0], Limits(rtol=RTOL)).crossings[0].time, 1e-4
    times = first + np.geomspace(1e-6, 5e-2, 40)
    run = simulate(scene, "taylor", times, Limits(rtol=loose))
    exact = closed_form(scene).poses(times).acceleration
    assert relative_error(run, scene) < loose / 10
    assert np.abs(run.acceleration - exact).max() < 10 * loose * np.abs(exact).max()


@pytest.mark.parametrize("rtol", [1e-3, 1e-4, 3e-5])
def test_torsion_spring_on_a_crossing_parallelogram_moves_as_its_closed_form(rtol):
    """The closed form is the judge's: in 3 s the bars pass five flat positions. The spring's angle continues
    through them, where steps have a higher order. Poses are met to two rtol."""
    scene = four_bar_gravity().with_(load=(TorsionSpring(joint="A", stiffness=1.0),))
    run = simulate(scene, "taylor", np.linspace(0.0, 3.0, 31), Limits(rtol=rtol))
    assert relative_error(run, scene) < 2 * rtol and len(run.crossings) == 5, run.message


@pytest.mark.parametrize("name", ("four_bar_gravity", "five_bar_gravity"))
def test_swing_through_three_flat_positions_takes_at_most_18_steps_and_meets_the_closed_form(name):
    """At the times of the crossings the judge's closed form has all bodies on the x axis. Rounding adds a
    pole to the series there, which must shorten no step: 18 are taken, with rejected ones. Errors are below
    ten rtol."""
    scene, rtol = find_scene(name), 1e-8
    times = np.linspace(0.0, scene.duration, 11)
    run = simulate(scene, "taylor[order=22]", times, Limits(rtol=rtol, code="generic"))
    flat = closed_form(scene).poses(np.array([passed.time for passed in run.crossings])).position
    assert len(flat) == 3 and np.abs(flat[..., 1]).max() < 10 * rtol  # m
    assert relative_error(run, scene) < 10 * rtol and run.cost.steps + run.cost.rejected <= 18


@pytest.mark.parametrize("name", ("four_bar", "five_bar"))
def test_driven_loop_takes_at_most_14_steps_and_samples_at_and_near_a_crossing_are_exact(name):
    """The crank turns by 12.5 rad over four singular positions, each in one high-accuracy step; 14 steps are
    taken, rejected ones included. Samples are at the first position, 10 µs from it, and elsewhere; poses and
    velocities meet the judge's closed form to rounding."""
    scene = find_scene(name)
    first = simulate(scene, "taylor", [scene.duration]).crossings[0].time
    times = np.sort(np.append(np.linspace(0.0, scene.duration, 11), first + np.array([-1e-5, 0.0, 1e-5])))
    run = simulate(scene, "taylor", times, Limits(code="generic"))
    assert len(run.crossings) == 4 and run.cost.steps + run.cost.rejected <= 14
    found, rounding = measure(scene, run, closed_form(scene)), 1e-12  # relative, or rad
    assert found["error"] < rounding and found["velocity_error"] < rounding, found
