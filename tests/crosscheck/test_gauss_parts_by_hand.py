"""Gauss's principle / least changes of accelerations, states of the integration and their rates by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from crosscheck.judge import gauss_motion
from crosscheck.judge.gauss_motion import _along_free_directions, _least, _rates, _state
from mbref.scene import Body, Moment, Revolute, Scene, TorsionSpring
from mbref.trajectory import Outcome

SPUN = Body(
    name="b",
    mass=2.0,
    inertia=(0.5, 0.5, 0.5),
    position=(1.0, 2.0, 3.0),
    velocity=(4.0, 5.0, 6.0),
    angular_velocity=(0.0, 0.0, 8.0),
)
FREE = Scene(
    name="s", body=(SPUN,), gravity=(0.0, -10.0, 0.0), load=(Moment(body="b", moment=(0.0, 0.0, 3.0)),)
)


@pytest.mark.parametrize(
    ("small", "rank", "second"), [(1.1e-9, None, 2.0), (0.9e-9, None, 0.0), (0.9e-9, 2, 2.0), (0.5, 1, 0.0)]
)
def test_the_least_solution_of_rows(small, rank, second):
    """x = 3 and small · y = 2 small, from 1e-9 of the largest row on or by a given rank; z is zero."""
    found = _least(np.array([[1.0, 0.0, 0.0], [0.0, small, 0.0]]), np.array([3.0, 2 * small]), rank)
    assert found == pytest.approx([3.0, second, 0.0])


@pytest.mark.parametrize(("matrix", "wanted"), [(1.0, math.nan), (math.inf, 1.0), (math.nan, math.nan)])
def test_rows_that_are_not_finite_have_no_solution(matrix, wanted):
    assert np.isnan(_least(np.array([[matrix, 1.0]]), np.array([wanted]), None)).all()
    singular = _along_free_directions(np.eye(2), np.ones(2), np.array([[math.nan, 1.0]]), np.ones(1), None)
    assert np.isnan(singular).all() and singular.shape == (2,)


@pytest.mark.parametrize(("rank", "small"), [(None, 1e-10), (1, 0.5)])
def test_accelerations_along_free_directions(rank, small):
    """a₀ = -3; the second equation of M a = f is -3 + 4 a₁ = 8. Rows below the rank do not count."""
    mass, push = np.array([[2.0, 1.0], [1.0, 4.0]]), np.array([5.0, 8.0])
    found = _along_free_directions(mass, push, np.array([[1.0, 0.0]]), np.array([3.0]), None)
    assert found == pytest.approx([-3.0, 2.75])
    rows, coasting = np.array([[1.0, 0.0], [0.0, small]]), np.array([3.0, 0.0])
    assert _along_free_directions(mass, push, rows, coasting, rank) == pytest.approx([-3.0, 2.75])
    both = _along_free_directions(mass, push, np.eye(2), np.array([3.0, -1.0]), None)
    assert both == pytest.approx([-3.0, 1.0])


def test_states_and_their_rates():
    """Quaternions are normalised; the rate of a quaternion is half of the spin times it."""
    y = np.concatenate([[1.0, 2.0, 3.0], [0.0, 0.0, 0.0, 2.0], [4.0, 5.0, 6.0], [0.0, 0.0, 8.0]])
    position, unit, velocity, spin, angles = _state(FREE, y)
    assert position.tolist() == [[1.0, 2.0, 3.0]] and unit.tolist() == [[0.0, 0.0, 0.0, 1.0]]
    assert velocity.tolist() == [[4.0, 5.0, 6.0]] and spin.tolist() == [[0.0, 0.0, 8.0]] and not angles.size
    found = _rates(0.0, y, FREE, 0, 0.0)
    assert found[:3].tolist() == [4.0, 5.0, 6.0] and found[3:7].tolist() == [-8.0, 0.0, 0.0, 0.0]
    assert found[7:] == pytest.approx([0.0, -10.0, 0.0, 0.0, 0.0, 6.0])


def test_states_of_two_bodies_with_an_angle():
    """The last number of the state is the angle of the torsion spring, whose rate is 11 - 8 = 3 rad/s."""
    other = SPUN.model_copy(update={"name": "c"})
    hinge = Revolute(name="J", bodies=("b", "c"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 2.0))
    pair = FREE.with_(body=(SPUN, other), joint=(hinge,), load=(TorsionSpring(joint="J", stiffness=1.0),))
    unit = np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))
    spins = np.array([[0.0, 0.0, 8.0], [7.0, 0.0, 11.0]])
    y = np.concatenate([np.arange(6.0), unit.ravel(), np.arange(6.0) + 10, spins.ravel(), [0.75]])
    position, _, velocity, spin, angles = _state(pair, y)
    assert position.tolist() == [[0, 1, 2], [3, 4, 5]] and velocity.tolist() == [[10, 11, 12], [13, 14, 15]]
    assert spin.tolist() == spins.tolist() and angles.tolist() == [0.75]
    assert _rates(0.0, y, pair, 5, 0.0)[-1] == pytest.approx(3.0)


def test_a_body_that_is_thrown_and_twisted():
    """3 N m on 0.5 kg m² is 6 rad/s²."""
    times = (0.0, 0.25, 0.5)
    run = gauss_motion.gauss_motion(FREE, times)
    t = np.array(times)
    assert run.position[:, 0, 1] == pytest.approx(2 + 5 * t - 5 * t**2)
    assert run.angular_velocity[:, 0, 2] == pytest.approx(8 + 6 * t)
    assert run.acceleration[:, 0] == pytest.approx(np.tile([0.0, -10.0, 0.0], (3, 1)))
    assert run.angular_acceleration[:, 0, 2] == pytest.approx([6.0] * 3)
    assert (run.engine, run.t_end, run.outcome, run.bodies) == (
        gauss_motion.NAME,
        0.5,
        Outcome.COMPLETED,
        ("b",),
    )
    assert run.settings == {"rtol": gauss_motion.RTOL} and run.times.tolist() == list(times)
    angles = 2 * np.arctan2(run.orientation[:, 0, 3], run.orientation[:, 0, 0]) % (4 * np.pi)
    assert angles == pytest.approx((8 * t + 3 * t**2) % (4 * np.pi))
