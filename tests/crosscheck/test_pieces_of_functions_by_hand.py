"""Functions of time and residuals by the judge / pieces of tables, and arrays with more than one index."""

from __future__ import annotations

import math

import numpy as np
import pytest

from crosscheck.judge import joint_residuals, time_functions
from crosscheck.judge.arithmetic import DOUBLE, EXTENDED
from mbref.scene import Body, Driver, Factor, Moment, Revolute, Scene, Sine

CUBIC = (0.0, 1.0, -2.0, 0.5)
TIMES = (0.0, 0.5, 1.5, 2.0, 3.0)


def cubic(t: float) -> float:
    return t - 2 * t**2 + 0.5 * t**3


TABLE = Driver(joint="A", table=tuple((t, cubic(t)) for t in TIMES))


@pytest.mark.parametrize(
    ("since", "knot"),
    [(0.0, 0.0), (0.49, 0.0), (0.5, 0.5), (1.6, 1.5), (2.0, 2.0), (3.0, 2.0), (9.0, 2.0)],
)
def test_the_piece_of_a_table_that_acts_from_a_time_on(since, knot):
    """A spline through the points of a cubic is that cubic; its last piece goes on after the table."""
    piece = time_functions.piece_of(TABLE, since, DOUBLE)
    assert piece.acts and piece.knot == knot
    slopes = [cubic(knot), 1 - 4 * knot + 1.5 * knot**2, -2 + 1.5 * knot, 0.5]
    assert piece.cubic == pytest.approx(slopes, abs=1e-13)
    assert time_functions.values(TABLE, np.array([5.0]), since) == pytest.approx([cubic(5.0)])


@pytest.mark.parametrize(("part", "knot"), [(0.9e-12, 0.5), (1.1e-12, 0.0)])
def test_a_time_next_to_a_row_belongs_to_the_next_piece(part, knot):
    """Within 1e-12 of itself, as a time of a step is."""
    assert time_functions.piece_of(TABLE, 0.5 * (1 - part), DOUBLE).knot == knot
    late = Scene(
        name="s",
        body=(Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0, 0, 0)),),
        joint=(Revolute(name="A", bodies=("ground", "b"), anchor=(0, 0, 0), axis=(0, 0, 1)),),
        driver=(TABLE,),
    )
    assert time_functions.next_end(late, 0.5 * (1 - part)) == (1.5 if knot else 0.5)


def test_a_switched_function_acts_between_its_times():
    factor = Factor(polynomial=(2.0, 3.0), start=0.5, stop=1.5)
    found = [time_functions.piece_of(factor, t, EXTENDED).acts for t in (0.0, 0.49, 0.5, 1.49, 1.5)]
    assert found == [False, False, True, True, False]
    piece = time_functions.piece_of(factor, 0.0, EXTENDED)
    assert piece.knot == 0.0 and not piece.cubic.any() and piece.cubic.dtype == EXTENDED.dtype
    assert time_functions.ends(factor) == (0.5, 1.5) and time_functions.ends(TABLE) == (0.5, 1.5, 2.0)
    assert time_functions.ends(Factor(polynomial=(1.0,))) == ()


@pytest.mark.parametrize("derivative", range(4))
def test_values_of_a_switched_wave_at_a_table_of_times(derivative):
    """2 + 3 t + 0.25 sin(4 t + 0.5) from 0.5 s to 1.5 s; zero before and after."""
    factor = Factor(
        polynomial=(2.0, 3.0), sine=Sine(amplitude=0.25, frequency=4.0, phase=0.5), start=0.5, stop=1.5
    )
    t = np.array([[0.25, 0.5], [1.0, 1.75]])
    line = [2 + 3 * t, 3 + 0 * t, 0 * t, 0 * t][derivative]
    wave = 0.25 * 4.0**derivative * np.sin(4 * t + 0.5 + derivative * math.pi / 2)
    wanted = np.where((t >= 0.5) & (t < 1.5), line + wave, 0.0)
    found = time_functions.value(factor, t, derivative)
    assert found.shape == (2, 2) and found == pytest.approx(wanted, abs=1e-12)
    assert time_functions.value(factor, 1.0, derivative, since=1.0) == pytest.approx(wanted[1, 0])
    assert time_functions.value(factor, 1.75, derivative, since=1.0) == pytest.approx((line + wave)[1, 1])


def test_loads_without_a_function_of_time_have_none():
    driven = Factor(polynomial=(1.0, 1.0))
    loads = (Moment(body="b", moment=(0, 0, 1)), Moment(body="b", moment=(0, 0, 1), factor=driven))
    scene = Scene(
        name="s", body=(Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0, 0, 0)),), load=loads
    )
    assert time_functions.functions_of(scene) == [driven] and time_functions.next_end(scene, 0.0) == math.inf


# --- arrays of orientations -------------------------------------------------------------------------------
def test_rotation_vectors_and_tilts_of_many_orientations():
    """Each orientation of an array gives the same numbers as it does alone."""
    q = np.random.default_rng(6).normal(size=(2, 3, 4))
    q /= np.linalg.norm(q, axis=2, keepdims=True)
    q[1, 1], q[1, 2] = (1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0)
    for function, size in ((joint_residuals._rotation_vector, 3), (joint_residuals._tilt, 2)):
        found = function(q)
        assert found.shape == (2, 3, size)
        for i in range(2):
            for k in range(3):
                assert found[i, k] == pytest.approx(function(q[i, k]), abs=1e-15)


@pytest.mark.parametrize("shape", [(), (5,), (2, 5)])
def test_the_ground_is_the_last_body(shape):
    """At the origin, not turned and at rest; quaternions of bodies are normalised."""
    place, q = np.full((*shape, 2, 3), 7.0), np.tile([0.0, 3.0, 0.0, 4.0], (*shape, 2, 1))
    position, orientation = joint_residuals.with_ground(place, q)
    assert position.shape == (*shape, 3, 3) and (position[..., :2, :] == 7.0).all()
    assert not position[..., 2, :].any()
    assert orientation[..., :2, :] == pytest.approx(np.tile([0.0, 0.6, 0.0, 0.8], (*shape, 2, 1)))
    assert (orientation[..., 2, :] == [1.0, 0.0, 0.0, 0.0]).all()
    rates = joint_residuals.grounded(place)
    assert rates.shape == (*shape, 3, 3) and not rates[..., 2, :].any() and (rates[..., :2, :] == 7.0).all()
