"""Coordinate partitioning follows random mechanisms, crank-rockers, also from near a singular position, and
free bodies."""

import math
from itertools import product

import numpy as np
import pytest

import mbref
from crosscheck.judge.truth import closed_form, truth_for
from mbref.scene import Scene
from tests.helpers.four_bars import crank_pins
from tests.helpers.parts import Z, hinge, rod, turning_about
from tests.helpers.spinning import spinning_mechanism

RATE, END = 7.0, 0.45  # rad/s of the crank at the start, and s
ORDINARY = (0.2, 0.5, 0.45, 0.55)  # crank, coupler, rocker and ground, m
CHANGE_POINT = (0.2, 0.4, 0.3, 0.5)  # flat at half a turn of the crank
MANY = (ORDINARY, CHANGE_POINT, (0.1, 0.5, 0.45, 0.5))
PARTS = (0.9998, 0.99, 0.5, 1.0002, 1.5)  # angle of the crank at the start / half a turn
ALL_STEPS = (1e-4, 5e-4, 1e-3, 2e-3, 3e-3, 5e-3)  # s


def crank_rocker(lengths: tuple[float, ...], angle: float) -> Scene:
    """Return a four-bar of rods, 1 kg/m, that moves freely, with the crank at an angle, rad. The velocities
    of coupler and rocker follow from the crank's."""
    a, d = (0.0, 0.0, 0.0), (lengths[3], 0.0, 0.0)
    b, c = ((*place, 0.0) for place in crank_pins(lengths, np.array(angle), 1.0))
    ends, names = ((a, b), (b, c), (d, c)), ("crank", "coupler", "rocker")
    bodies = [rod(name, p, q, math.dist(p, q)) for name, (p, q) in zip(names, ends, strict=True)]
    bodies[0] = turning_about(a, Z, RATE, bodies[0])
    pairs = (("ground", "crank"), ("crank", "coupler"), ("coupler", "rocker"), ("ground", "rocker"))
    joints = [hinge(n, *pair, at) for n, pair, at in zip("ABCD", pairs, (a, b, c, d), strict=True)]
    return Scene(name="crank_rocker", gravity=[0.0, 0.0, 0.0], duration=1.0, body=bodies, joint=joints)


def deviation(lengths: tuple[float, ...], angle: float, step: float) -> float:
    """Return the distance from the nearer branch (m), or the relative drift of energy if larger."""
    scene = crank_rocker(lengths, angle)
    motion = mbref.simulate(scene, f"alf-dual+partitioning/rk4[step={step}]", np.linspace(0.0, END, 6))
    assert motion.outcome is mbref.Outcome.COMPLETED, motion.message
    crank = angle + motion.joint("A").angle
    tip = 2 * motion.position[:, 2, :2] - np.array([lengths[3], 0.0])
    apart = [np.linalg.norm(tip - crank_pins(lengths, crank, side)[1], axis=1) for side in (1.0, -1.0)]
    return max(np.min(apart, axis=0).max(), np.abs(motion.energy / motion.energy[0] - 1).max())


@pytest.mark.parametrize(
    ("lengths", "part", "step", "limit"),
    [
        *((ORDINARY, 0.3, step, 2e-6) for step in (2e-3, 5e-3)),
        *((CHANGE_POINT, 0.9998, step, 1e-3) for step in (2e-3, 5e-3)),
        *(pytest.param(*start, 2e-3, marks=pytest.mark.slow) for start in product(MANY, PARTS, ALL_STEPS)),
    ],
)
def test_partitioning_keeps_the_branch_and_the_energy_of_a_crank_rocker(lengths, part, step, limit):
    """The crank starts at a ``part`` of half a turn. Pin C is within the limit (m) of an intersection of the
    circles of coupler and rocker, and the energy within this relative limit of its start. The crank turns by
    0.035 rad in a step of 5 ms, and errors of order 4 are 0.035⁴ = 1.5e-6. From 0.9998 the first step of
    CHANGE_POINT passes a singular position, which multiplies them: 5.1e-5 was measured, 1e-3 is allowed."""
    assert deviation(lengths, part * math.pi, step) < limit


def test_velocities_of_a_four_bar_at_a_loose_tolerance_meet_the_closed_form():
    """Both cranks of a parallelogram have one rate, whose closed form follows from the energy. With rtol 1e-3
    errors are below 1e-3 of the largest velocity."""
    scene, times = mbref.find_scene("four_bar_gravity"), np.linspace(0.25, 1.0, 4)
    exact = closed_form(scene).poses(times).velocity
    found = mbref.simulate(scene, "alf-dual+partitioning", times, mbref.Limits(rtol=1e-3))
    assert np.abs(found.velocity - exact).max() < 1e-3 * np.abs(exact).max()


@pytest.mark.parametrize("seed", [71, pytest.param(78, marks=pytest.mark.slow)])
def test_partitioning_moves_random_mechanisms_as_the_judges_reference(seed):
    """Bodies are within 1 µm at 1 s: errors of order 4 of 0.5 ms steps are 0.1 µm."""
    scene = spinning_mechanism(seed)
    found = mbref.simulate(scene, "mpi-svd+partitioning/rk4[step=5e-4]", [1.0])
    assert found.outcome is mbref.Outcome.COMPLETED, found.message
    assert np.abs(found.position - truth_for(scene).poses([1.0]).position).max() < 1e-6


@pytest.mark.parametrize("integrator", ["dop853", "adams", "rk4[step=1e-3]"])
@pytest.mark.parametrize("count", [1, 3])
def test_bodies_that_spin_freely_turn_by_rate_times_time(integrator, count):
    """At 4 rad/s w = cos 2t passes zero at 0.785 s, in all bodies at once; integrators keep 1e-7."""
    fields = {"mass": 1.0, "inertia": [0.1] * 3, "angular_velocity": [0.0, 0.0, 4.0]}
    bodies = [{"name": f"b{k}", "position": [k, 0.0, 0.0], **fields} for k in range(count)]
    scene, times = Scene(name="spinning", duration=1.6, body=bodies), np.array([0.4, 0.8, 1.6])
    motion = mbref.simulate(scene, f"alf-dual+partitioning/{integrator}", times)
    assert motion.outcome is mbref.Outcome.COMPLETED, motion.message
    exact = np.stack([np.cos(2 * times), 0 * times, 0 * times, np.sin(2 * times)], axis=-1)
    assert np.abs(motion.orientation - exact[:, None]).max() < 1e-7
