"""Series of loads and joint coordinates / differences of their terms, and the judge's own wrenches."""

from __future__ import annotations

from math import comb
from typing import Any

import numpy as np
import pytest

from crosscheck.judge.arithmetic import DOUBLE
from crosscheck.judge.constraints import inertia_matrices, initial_poses, initial_twists
from crosscheck.judge.gauss_principle import _unbound
from crosscheck.judge.reference.natural import NaturalCoordinates
from crosscheck.judge.reference.natural_joints import AngleForm, SlideForm, convolved
from crosscheck.judge.reference.natural_loads import Loads
from mbref import rotations
from mbref.scene import Factor, Force, Moment, Scene, Sine
from tests.crosscheck.test_first_samples_of_engines import loaded

TERMS = 5


def scene() -> Scene:
    """Loads of joints and a spring, and forces and moments with and without factors."""
    wave = Factor(polynomial=(0.75, 2.0), sine=Sine(amplitude=0.5, frequency=4.0, phase=0.3))
    more = (
        Force(body="arm", point=(0.5, 0.1, 0.3), force=(1.0, 2.0, -4.0)),
        Force(body="puck", point=(-0.6, 0.1, 0.3), force=(-3.0, 2.5, 1.0), factor=wave),
        Moment(body="wheel", moment=(0.5, -2.0, 3.0)),
        Moment(body="sled", moment=(1.0, 2.0, -0.5), factor=wave),
    )
    return loaded().with_(load=(*loaded().load, *more))


SCENE = scene()


@pytest.fixture(scope="module")
def of() -> NaturalCoordinates:
    return NaturalCoordinates(SCENE, DOUBLE)


def motion_of(of: NaturalCoordinates) -> np.ndarray:
    """Coefficients (TERMS, 3, n) of a motion: the start with its velocities, and then some numbers."""
    x, v = of.start()
    velocity, spin = initial_twists(SCENE)
    for b in range(of.nb):
        v[:, 4 * b] = velocity[b] / of.length
        for i in (1, 2, 3):
            v[:, 4 * b + i] = np.cross(spin[b], x[:, 4 * b + i])
    rest = 0.3 * np.random.default_rng(5).normal(size=(TERMS - 2, *x.shape))
    rest[:, :, -4:] = 0.0
    return np.concatenate([x[None], v[None], rest])


def moved(x: np.ndarray, h: float) -> np.ndarray:
    """The coefficients about a time h later."""
    found = np.zeros_like(x)
    for k in range(TERMS):
        for i in range(k, TERMS):
            found[k] += x[i] * h ** (i - k) * comb(i, k)
    return found


def grown(of: NaturalCoordinates, x: np.ndarray, t: float, angles: list[float]) -> Any:
    series = Loads(of).series(t, angles, TERMS)
    for k in range(TERMS):
        series.grow(k, x)
    return series


def angles_at(of: NaturalCoordinates, x: np.ndarray, t: float) -> list[float]:
    """Angles of the loads about joints, each near the one by its rate."""
    forms = [form.coordinate for form in Loads(of).turned]
    return [form.value(moved(x, t)[0], t * form.rate(x[0], x[1])) for form in forms]


def test_the_power_of_all_loads_is_that_of_the_judge_s_wrenches(of):
    """At the start, for velocities and angular velocities of each body: gravity and all loads."""
    x = motion_of(of)
    force = grown(of, x, 0.0, [0.0, 0.0]).order(0, x)
    _, wrenches = _unbound(SCENE)
    _, spin = initial_twists(SCENE)
    turn = rotations.to_matrix(initial_poses(SCENE)[1])
    for b, inertia in enumerate(inertia_matrices(SCENE)):
        world = turn[b] @ inertia @ turn[b].T
        for i in range(6):
            twist, rate = np.eye(6)[i], np.zeros_like(x[0])
            rate[:, 4 * b] = twist[:3] / of.length
            for k in (1, 2, 3):
                rate[:, 4 * b + k] = np.cross(twist[3:], x[0][:, 4 * b + k])
            wrench = np.asarray(wrenches).reshape(-1, 6)[b].copy()
            wrench[3:] += np.cross(spin[b], world @ spin[b])  # the judge's forces have the gyroscopic moment
            assert (force * rate).sum() * of.length**2 == pytest.approx(wrench @ twist, abs=1e-10), (b, i)


def test_orders_of_loads_are_slopes(of):
    """Order k of the force is its k-th derivative over k!, by differences of expansions about near times."""
    x, t, h = motion_of(of), 0.25, 1e-4
    series = grown(of, x, t, [0.0, 0.0])
    first, second, third = (series.order(k, x) for k in range(3))
    ends = []
    for step in (-h, h):
        there = moved(x, step)
        ends.append(grown(of, there, t + step, angles_at(of, x, step)).order(0, there))
    size = np.abs(first).max()
    assert second == pytest.approx((ends[1] - ends[0]) / (2 * h), abs=1e-5 * size)
    assert third == pytest.approx((ends[1] - 2 * first + ends[0]) / (2 * h**2), abs=1e-4 * size)


@pytest.mark.parametrize(
    ("form", "joint"), [(AngleForm, "A"), (AngleForm, "D"), (SlideForm, "C"), (SlideForm, "D")]
)
def test_coordinates_of_joints_and_their_series(of, form, joint):
    """Values, rates and gradients by differences; series of the value and of a force times the gradient."""
    made = form(of, SCENE.joint_named(joint))
    x, h = motion_of(of), 1e-5
    start = made.value(x[0], 0.0)
    gradient = made.gradient(x[0])
    assert made.rate(x[0], x[1]) == pytest.approx((gradient * x[1]).sum())
    series = made.series(start, TERMS)
    for k in range(TERMS):
        series.grow(k, x)
    near = [made.value(moved(x, step)[0], start) for step in (-h, h)]
    assert series.value[0] == pytest.approx(start, abs=1e-14)
    assert series.value[1] == pytest.approx((near[1] - near[0]) / (2 * h), rel=1e-6, abs=1e-8)
    assert series.value[1] == pytest.approx(made.rate(x[0], x[1]))
    rates = [made.rate(moved(x, step)[0], moved(x, step)[1]) for step in (-h, h)]
    assert 2 * series.value[2] == pytest.approx((rates[1] - rates[0]) / (2 * h), rel=1e-5, abs=1e-7)
    force = np.array([2.0, -3.0, 0.5, 1.0, 4.0])
    pulls = [series.pull(force, k) for k in range(2)]
    assert pulls[0] == pytest.approx(2.0 * gradient, abs=1e-12)
    slopes = [made.gradient(moved(x, step)[0]) for step in (-h, h)]
    wanted = -3.0 * gradient + 2.0 * (slopes[1] - slopes[0]) / (2 * h)
    assert pulls[1] == pytest.approx(wanted, abs=1e-6)


def test_displacements_and_angles_by_hand(of):
    """The ground's anchor is 0.3 m from the sled's along its axis; the arm has turned by 0.4 rad."""
    x, _ = of.start()
    slide, hinge = SlideForm(of, SCENE.joint_named("C")), AngleForm(of, SCENE.joint_named("A"))
    x[:, 4] += -0.3 * np.array([0.6, 0.8, 0.0]) / of.length
    assert slide.value(x, 0.0) == pytest.approx(0.3 / of.length)
    turn = rotations.to_matrix(rotations.from_vector(np.array([0.0, 0.0, 0.4])))
    x[:, 1:4] = turn @ x[:, 1:4]
    assert hinge.value(x, 0.35) == pytest.approx(0.4, abs=1e-12)
    assert hinge.value(x, 0.4 + 2 * np.pi) == pytest.approx(0.4 + 2 * np.pi), "the nearest turn"


def test_products_of_series():
    """(1 + 2 t + 3 t²) (4 + 5 t + 6 t²) = 4 + 13 t + 28 t² + …"""
    a, b = np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0])
    assert [convolved(a, b, k) for k in range(3)] == [4.0, 13.0, 28.0]
