"""Short crossings judge motions whose speed bounds the sensitivity; a perturbed run judges all others."""

import numpy as np
import pytest

from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import closed_form
from mbref.scene import Body, Revolute, Scene, TorsionSpring
from mbref.scenes import find_scene
from mbref.scenes.four_bar import four_bar_gravity, parallelogram
from mbref.simulation.simulate import Limits, simulate

METHODS = ["taylor"]


def with_pendulum(scene: Scene) -> Scene:
    """A scene and a pendulum beside it that nothing connects with the rest."""
    bob = Body(name="bob", mass=1.0, inertia=(1e-2,) * 3, position=(2.0, -0.5, 0.0))
    joint = Revolute(name="P", bodies=("ground", "bob"), anchor=(2.1, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    return scene.with_(body=(*scene.body, bob), joint=(*scene.joint, joint))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    "name", ["four_bar", "four_bar_gravity", "five_bar_gravity", "planar_slider_crank_heavy"]
)
def test_a_fast_motion_of_one_freedom_passes_all_singular_positions(name, method):
    """All 61 singular positions of the heavy crank, too, of which a call of the kernel passes 16."""
    scene = find_scene(name)
    run = simulate(scene, method, np.linspace(0.0, scene.duration, 9), Limits(rtol=1e-9))
    assert run.outcome.label == "COMPLETED", run.message
    assert measure(scene, run, closed_form(scene))["error"] < 1e-8
    assert len(run.crossings) == {"four_bar": 4, "planar_slider_crank_heavy": 61}.get(name, 3)


@pytest.mark.parametrize("method", METHODS)
def test_two_freedoms_go_on_as_each_does_alone(method):
    times = np.linspace(0.0, 1.0, 9)
    both = simulate(with_pendulum(four_bar_gravity()), method, times, Limits(rtol=1e-9))
    alone = simulate(four_bar_gravity(), method, times, Limits(rtol=1e-9))
    assert both.outcome.label == "COMPLETED" and len(both.crossings) == len(alone.crossings) == 3
    assert np.abs(both.position[:, :3] - alone.position).max() < 1e-8


@pytest.mark.parametrize("method", METHODS)
def test_samples_beside_crossings_are_right_at_a_loose_tolerance(method):
    """Steps leave a singular position with the tolerance of the run: samples lie between its distance and
    that where steps watch for it."""
    scene = four_bar_gravity()
    first = simulate(scene, method, [1.0], Limits(rtol=1e-9)).crossings[0].time
    times = first + np.geomspace(1e-6, 5e-2, 40)
    run = simulate(scene, method, times, Limits(rtol=1e-4))
    exact = simulate(scene, method, times, Limits(rtol=1e-12))
    assert run.outcome.label == exact.outcome.label == "COMPLETED"
    off = np.abs(run.acceleration - exact.acceleration).max() / np.abs(exact.acceleration).max()
    assert measure(scene, run, closed_form(scene))["error"] < 1e-5 and off < 1e-3


@pytest.mark.parametrize("rtol", [1e-3, 1e-4, 3e-5])
def test_angles_of_torsion_springs_continue_behind_short_crossings(rtol):
    """High-accuracy steps leave terms of higher orders than the regular steps behind them have."""
    scene = four_bar_gravity().with_(load=(TorsionSpring(joint="A", stiffness=1.0),))
    times = np.linspace(0.0, 3.0, 31)
    run = simulate(scene, "taylor", times, Limits(rtol=rtol))
    exact = simulate(scene, "taylor[order=26]", times, Limits(rtol=1e-12))
    assert run.outcome.label == exact.outcome.label == "COMPLETED", run.message
    assert len(run.crossings) == len(exact.crossings) == 5
    assert np.abs(run.position - exact.position).max() < rtol


def swung(rate: float) -> Scene:
    """A rhombus under gravity whose crank begins with an angular velocity (rad/s)."""
    scene = parallelogram(0.6, "swung").with_(gravity=(0.0, -9.81, 0.0))
    turning = {"crank": -rate, "rocker": -rate}
    body = tuple(
        b.model_copy(update={"angular_velocity": (0.0, 0.0, turning.get(b.name, 0.0))}) for b in scene.body
    )
    return scene.with_(body=body)


@pytest.mark.parametrize("rate", [1.0, 5.0, 20.0])
def test_a_faster_start_is_ahead_by_no_more_than_the_bound(rate):
    """ε x' T (v₀ / v_least)² beyond a crossing, and no less than half of ε x' T v₀² / v²_greatest."""
    change, times = 1e-6, np.linspace(0.0, 0.3 if rate < 20.0 else 0.1, 200)
    slow, fast = (
        simulate(swung(each), "taylor", times, Limits(rtol=1e-12)) for each in (rate, rate * (1.0 + change))
    )
    assert len(slow.crossings) == len(fast.crossings) == 1
    ahead = np.abs(fast.position - slow.position)[-1].max()
    moved = change * np.abs(slow.velocity[-1]).max() * times[-1] * slow.kinetic_energy[0]
    least, greatest = slow.kinetic_energy.min(), slow.kinetic_energy.max()
    assert 0.5 * moved / greatest < ahead < 1.001 * moved / least
