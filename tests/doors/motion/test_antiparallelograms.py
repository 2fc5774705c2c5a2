"""Crossed four-bars, whose flat positions every turn passes, and four-bars whose crank cannot turn in full.
The crossed branch is smooth at a flat position, where it meets the parallel one: coupler and frame are equal,
as are crank and rocker, and the rocker's pin lies where two circles cross, away from the parallelogram."""

import numpy as np
import pytest

from crosscheck.conformance.mechanisms.parts import linkage
from mbref.scene import Driver
from mbref.simulation.simulate import Limits, simulate

END = 3.0  # s, in which a crank passes one to ten flat positions
RTOL = 1e-9
ROUNDING = 1e-11  # m, of pins, whose lengths hold to rounding: 100 times the largest error found


def crossing_of_circles(first, long, second, short, beside):
    """Return where circles about two points cross, on the side away from a third point; in the plane."""
    way = second - first
    distance = np.linalg.norm(way)
    along = (long**2 - short**2 + distance**2) / (2 * distance)
    way, aside = way / distance, np.array([-way[1], way[0]]) / distance
    height = np.sqrt(max(long**2 - along**2, 0.0))
    places = [first + along * way + sign * height * aside for sign in (1.0, -1.0)]
    return max(places, key=lambda place: np.linalg.norm(place - beside))


def pins(crank, frame, angle):
    """Return the four pins of the crossed four-bar at an angle of its crank, in the plane: closed form."""
    end, pivot = crank * np.array([np.cos(angle), np.sin(angle)]), np.array([frame, 0.0])
    return np.zeros(2), end, crossing_of_circles(end, frame, pivot, crank, end + pivot), pivot


def drawn(seed):
    """Return random lengths (m) of crank and frame, angle (rad) and rate (rad/s) of the crank at first."""
    rng = np.random.default_rng([seed, 7])
    rate = rng.uniform(2.0, 8.0) * rng.choice([-1, 1])
    return rng.uniform(0.1, 0.4), rng.uniform(0.45, 0.8), rng.uniform(0.2, 2.8), rate


def four_bar(places, driver=None):
    """Return a scene of the bars between places in the plane; the crank's hinge may be driven."""
    scene = linkage("four-bar", [(*place, 0.0) for place in places]).with_(duration=END)
    return scene.with_(driver=(Driver(joint="P0", polynomial=driver),)) if driver else scene


@pytest.mark.parametrize("seed", range(10))
def test_a_driven_crossed_four_bar_stays_crossed_through_flat_positions(seed):
    """The coupler's middle is midway between its pins, whose places at the crank's angle θ₀ + ω t are known
    in closed form (``pins``), to ROUNDING. On the other branch, the parallelogram, it would be elsewhere."""
    crank, frame, angle, rate = drawn(seed)
    times = np.linspace(0.0, END, 31)
    run = simulate(four_bar(pins(crank, frame, angle), (0.0, rate)), "taylor", times, Limits(rtol=RTOL))
    places = [pins(crank, frame, angle + rate * t) for t in times]
    expected = np.array([(end + pin) / 2 for _, end, pin, _ in places])
    assert run.outcome.label == "COMPLETED" and run.crossings, run.message
    assert np.abs(run.position[:, 1, :2] - expected).max() < ROUNDING


@pytest.mark.parametrize("seed", range(6))
def test_a_swinging_crossed_four_bar_stays_crossed_and_loses_no_energy(seed):
    """The coupler's middle is midway between its pins, whose places at the crank's angle are known in closed
    form (``pins``), to ROUNDING. The energy is constant, to 100 rtol."""
    crank, frame, angle, rate = drawn(seed)
    scene = four_bar(pins(crank, frame, angle))
    first = scene.body[0].model_copy(update={"angular_velocity": (0.0, 0.0, rate)})
    spun = scene.with_(body=(first, *scene.body[1:]))
    run = simulate(spun, times=np.linspace(0.0, END, 31), limits=Limits(rtol=RTOL))
    assert run.outcome.label == "COMPLETED" and run.crossings, run.message
    turns = 2 * np.arctan2(run.orientation[:, 0, 3], run.orientation[:, 0, 0])
    places = [pins(crank, frame, turn) for turn in turns]
    expected = np.array([(end + pin) / 2 for _, end, pin, _ in places])
    assert np.abs(run.position[:, 1, :2] - expected).max() < ROUNDING
    assert np.ptp(run.energy) < 100 * RTOL * np.abs(run.energy).max()


@pytest.mark.parametrize("method", ["alf-dual+projection", "taylor", "mpi-svd+none", "alf-dual+baumgarte"])
def test_driving_a_crank_beyond_its_reach_ends_the_run_at_the_dead_position(method):
    """Bars of 0.3 m, frame of 0.7 m: the crank stops at acos((0.3² + 0.7² - 0.6²) / (2 · 0.3 · 0.7)), where
    coupler and rocker are in line; at 2 rad/s from 0.3 rad it is there after 0.36 s."""
    start, end, pivot = np.zeros(2), 0.3 * np.array([np.cos(0.3), np.sin(0.3)]), np.array([0.7, 0.0])
    pin = crossing_of_circles(end, 0.3, pivot, 0.3, np.array([0.4, -1.0]))
    run = simulate(four_bar((start, end, pin, pivot), (0.0, 2.0)), method, np.linspace(0.0, 2.0, 21))
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
    run = simulate(four_bar(pins(crank, frame, distance)), "taylor", [0.0, 0.3], Limits(rtol=RTOL / 10))
    assert run.outcome.label == "COMPLETED" and run.cost.steps < 100, (run.message, run.cost.steps)
    assert np.ptp(run.energy) < 1000 * RTOL / 10 * run.kinetic_energy[-1]
