"""Crossed four-bars, whose flat positions every turn passes, and four-bars whose crank cannot turn in full.
The crossed branch is smooth at a flat position, where it meets the parallel one: coupler and frame are equal,
as are crank and rocker, and the rocker's pin lies where two circles cross, away from the parallelogram."""

import numpy as np
import pytest

from crosscheck.conformance.mechanisms.parts import linkage
from mbref.scene import Driver
from mbref.simulation.simulate import Limits, simulate
from tests.helpers.four_bars import crank_pins

END = 3.0  # s, in which a crank passes one to ten flat positions
RTOL = 1e-9
ROUNDING = 1e-11  # m, of pins, whose lengths hold to rounding: 100 times the largest error found


def pins(crank, frame, angle):
    """Return the pins B and C (…, 2) of the crossed four-bar at angles of its crank: closed form."""
    return crank_pins((crank, frame, crank, frame), angle, -np.sign(np.sin(angle))[..., None])


def drawn(seed):
    """Return random lengths (m) of crank and frame, angle (rad) and rate (rad/s) of the crank at first."""
    rng = np.random.default_rng([seed, 7])
    rate = rng.uniform(2.0, 8.0) * rng.choice([-1, 1])
    return rng.uniform(0.1, 0.4), rng.uniform(0.45, 0.8), rng.uniform(0.2, 2.8), rate


def four_bar(moving, frame, driver=None):
    """Return a scene of the bars between (0, 0), the moving pins and (frame, 0); the crank may be driven."""
    places = (0.0, 0.0), *moving, (frame, 0.0)
    scene = linkage("four-bar", [(*place, 0.0) for place in places]).with_(duration=END)
    return scene.with_(driver=(Driver(joint="P0", polynomial=driver),)) if driver else scene


@pytest.mark.parametrize("seed", range(10))
def test_a_driven_crossed_four_bar_stays_crossed_through_flat_positions(seed):
    """The coupler's middle is midway between its pins, whose places at the crank's angle θ₀ + ω t are known
    in closed form (``pins``), to ROUNDING. On the other branch, the parallelogram, it would be elsewhere."""
    crank, frame, angle, rate = drawn(seed)
    times = np.linspace(0.0, END, 31)
    scene = four_bar(pins(crank, frame, angle), frame, (0.0, rate))
    run = simulate(scene, "taylor", times, Limits(rtol=RTOL))
    expected = np.mean(pins(crank, frame, angle + rate * times), axis=0)
    assert run.outcome.label == "COMPLETED" and run.crossings, run.message
    assert np.abs(run.position[:, 1, :2] - expected).max() < ROUNDING


@pytest.mark.parametrize("seed", range(6))
def test_a_swinging_crossed_four_bar_stays_crossed_and_loses_no_energy(seed):
    """The coupler's middle is midway between its pins, whose places at the crank's angle are known in closed
    form (``pins``), to ROUNDING. The energy is constant, to 100 rtol."""
    crank, frame, angle, rate = drawn(seed)
    scene = four_bar(pins(crank, frame, angle), frame)
    first = scene.body[0].model_copy(update={"angular_velocity": (0.0, 0.0, rate)})
    spun = scene.with_(body=(first, *scene.body[1:]))
    run = simulate(spun, times=np.linspace(0.0, END, 31), limits=Limits(rtol=RTOL))
    assert run.outcome.label == "COMPLETED" and run.crossings, run.message
    turns = 2 * np.arctan2(run.orientation[:, 0, 3], run.orientation[:, 0, 0])
    expected = np.mean(pins(crank, frame, turns), axis=0)
    assert np.abs(run.position[:, 1, :2] - expected).max() < ROUNDING
    assert np.ptp(run.energy) < 100 * RTOL * np.abs(run.energy).max()


@pytest.mark.parametrize("method", ["alf-dual+projection", "taylor", "mpi-svd+none", "alf-dual+baumgarte"])
def test_driving_a_crank_beyond_its_reach_ends_the_run_at_the_dead_position(method):
    """Bars of 0.3 m, frame of 0.7 m: the crank stops at acos((0.3² + 0.7² - 0.6²) / (2 · 0.3 · 0.7)), where
    coupler and rocker are in line; at 2 rad/s from 0.3 rad it is there after 0.36 s."""
    scene = four_bar(crank_pins((0.3, 0.3, 0.3, 0.7), 0.3, side=1.0), 0.7, (0.0, 2.0))
    run = simulate(scene, method, np.linspace(0.0, 2.0, 21))
    dead = np.arccos((0.3**2 + 0.7**2 - 0.6**2) / (2 * 0.3 * 0.7))
    time = (dead - 0.3) / 2.0  # s
    assert run.t_end == pytest.approx(time, abs=1e-6)  # s, in which the crank turns 2e-6 rad
    assert f"the drivers come to a dead position at t = {time:.4g}" in run.message


@pytest.mark.parametrize("distance", (-1.3e-5, 2e-5, 5e-5))
@pytest.mark.parametrize("seed", range(4))
def test_release_near_the_flat_position_takes_few_steps_and_loses_no_energy(seed, distance):
    """The crank starts at rest, ``distance`` (rad) from the flat pose. A run whose steps stay as short as the
    distance takes 92 000 of them in 0.3 s; fewer than 100 are allowed. The energy stays, to 1000 rtol."""
    crank, frame, _, _ = drawn(seed)
    scene = four_bar(pins(crank, frame, distance), frame)
    run = simulate(scene, "taylor", [0.0, 0.3], Limits(rtol=RTOL / 10))
    assert run.outcome.label == "COMPLETED" and run.cost.steps < 100, (run.message, run.cost.steps)
    assert np.ptp(run.energy) < 1000 * RTOL / 10 * run.kinetic_energy[-1]
