"""Initial velocities, lengths and least scales of the judge / numbers worked out by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.judge import constraints, free_fall, precision
from crosscheck.judge.arithmetic import DOUBLE, EXTENDED, doubles, largest
from crosscheck.judge.constraints import (
    _given,
    _of_one_point,
    _place,
    _refuse,
    _root_of_mass,
    _solve,
    scene_length,
)
from crosscheck.judge.reference import vectors
from crosscheck.judge.reference.panels import Panels
from crosscheck.judge.reference.saddle_point import SaddlePoint
from crosscheck.judge.reference.start_velocities import given
from crosscheck.judge.reference.vectors import saddle_solve
from mbref import rotations
from mbref.scene import Body, Coupling, Cylindrical, Distance, Revolute, Scene, SceneError, Translational

X, Z, O = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
TURN = (0.8, 0.0, 0.6, 0.0)


def body(name: str = "b", **parts: Any) -> Body:
    return Body(**{"name": name, "mass": 2.0, "inertia": (0.3, 0.4, 0.5), "position": O, **parts})


def hinge(name: str, *bodies: str, anchor: tuple[float, ...] = O, **parts: Any) -> Revolute:
    return Revolute(name=name, bodies=bodies, anchor=anchor, axis=Z, **parts)


def scene(*bodies: Body, **parts: Any) -> Scene:
    return Scene(**{"name": "s", "body": bodies or (body(),), "gravity": O, **parts})


# --- lengths ----------------------------------------------------------------------------------------------
def test_the_length_of_a_scene():
    """The largest distance of two anchors or centres: (1, 0, 0) and (4, 4, 0) are 5 m apart."""
    far = Distance(name="D", bodies=("ground", "b"), anchors=((4.0, 4.0, 0.0), (2.0, 0.0, 0.0)))
    assert scene_length(scene(body(position=X), joint=(far,))) == 5.0
    assert scene_length(scene(body(position=X), body("c", position=(1.0, 0.0, 3.0)))) == 3.0
    point = hinge("A", "ground", "b", anchor=(1.0, 1e-14, 0.0))
    assert scene_length(scene(body(position=X), joint=(point,))) == math.sqrt(0.25), "points that coincide"
    beside = hinge("A", "ground", "b", anchor=(1.0, 1.01e-14, 0.0))
    assert scene_length(scene(body(position=X), joint=(beside,))) == 1.01e-14


@pytest.mark.parametrize(
    ("parts", "gravity", "length"),
    [
        ({"mass": None, "inertia": None}, O, 1.0),
        ({"mass": None, "inertia": None, "velocity": (0.0, 3.0, 4.0)}, O, 10.0),
        ({"mass": None, "inertia": None, "velocity": (0.0, 3.0, 4.0)}, (0.0, -6.0, 8.0), 30.0),
        ({}, O, 0.5),
        ({"inertia": ((7.0, 0.0, 0.0), (0.0, 5.0, 3.0), (0.0, 3.0, 5.0))}, O, 2.0),
        ({"velocity": (0.1, 0.0, 0.0)}, O, 0.5),
        ({"velocity": (0.3, 0.0, 0.0)}, O, 0.6),
        ({"mass": 0.0, "inertia": O}, O, 1.0),
    ],
)
def test_the_length_of_one_point(parts, gravity, length):
    """A way in 2 s, or a radius of gyration: √(0.5 / 2) m; 1 m if both vanish."""
    given = scene(body(**parts), gravity=gravity, duration=2.0)
    assert scene_length(given) == pytest.approx(length, rel=1e-15)
    assert _of_one_point(given) == pytest.approx(0.0 if length == 1.0 else length, rel=1e-15)


def test_the_farthest_of_several_ways():
    """The second body is the fastest, the third has the largest radius of gyration; a link has none."""
    given = scene(
        body("a", velocity=(0.1, 0.0, 0.0)),
        body("b", velocity=(0.2, 0.0, 0.0)),
        body("c", mass=1.0, inertia=(9.0, 8.0, 7.0)),
        body("d", mass=0.0, inertia=O),
        duration=10.0,
    )
    assert _of_one_point(given) == 3.0 and _of_one_point(given.with_(duration=20.0)) == pytest.approx(4.0)


# --- velocities -------------------------------------------------------------------------------------------
@pytest.mark.parametrize("size", [1.0, 1e-12])
def test_least_solutions_and_null_spaces(size):
    """The second row is 1.1e-9 of the first one, the third row 0.9e-9 of it."""
    matrix = size * np.diag([1.0, 1.1e-9, 0.9e-9, 0.0])[:3]
    x, free = _solve(matrix, size * np.array([3.0, 2.2e-9, 9.0]))
    assert x == pytest.approx([3.0, 2.0, 0.0, 0.0]) and free.shape == (4, 2)
    assert np.abs(free[:2]).max() < 1e-12 and free.T @ free == pytest.approx(np.eye(2))
    x, free = _solve(np.zeros((2, 3)), np.zeros(2))
    assert x.tolist() == [0.0] * 3 and free.shape == (3, 3)
    x, free = _solve(np.zeros((0, 3)), np.zeros(0))
    assert x.tolist() == [0.0] * 3 and free.shape == (3, 3)


def test_given_velocities_over_their_scales():
    """Components of bodies without a velocity are not given; scales divide the others."""
    both = scene(body("a", angular_velocity=(1.0, 2.0, 3.0)), body("b", velocity=(4.0, 5.0, 6.0)))
    given, values = _given(both, np.tile([1.0, 1.0, 2.0, 0.5, 0.25, 0.125], 2))
    assert np.flatnonzero(given).tolist() == [3, 4, 5, 6, 7, 8]
    assert values.tolist() == [2.0, 8.0, 24.0, 4.0, 5.0, 3.0]


def test_roots_of_mass_matrices():
    """WᵀW has masses, turned inertias and armatures; a massless link counts as 1 kg without inertia."""
    inertia = ((0.6, 0.1, 0.0), (0.1, 0.7, 0.05), (0.0, 0.05, 0.8))
    both = scene(body("a", inertia=inertia, orientation=TURN), body("link", mass=0.0, inertia=O, position=X))
    root = _root_of_mass(both)
    turn = rotations.to_matrix(np.array(TURN))
    wanted = np.zeros((12, 12))
    wanted[range(3), range(3)], wanted[range(6, 9), range(6, 9)] = 2.0, 1.0
    wanted[3:6, 3:6] = turn @ np.array(inertia) @ turn.T
    assert root.shape == (12, 12) and root.T @ root == pytest.approx(wanted, abs=1e-15)
    geared = both.with_(joint=(hinge("A", "a", "link", armature=0.25),))
    row = np.zeros(12)
    row[[5, 11]] = -1.0, 1.0
    assert _root_of_mass(geared).T @ _root_of_mass(geared) == pytest.approx(
        wanted + 0.25 * np.outer(row, row), abs=1e-15
    )
    bare = scene(Body(name="a", position=O), Body(name="b", position=X))
    assert _root_of_mass(bare).tolist() == np.eye(12).tolist()


@pytest.mark.parametrize(("size", "is_refused"), [(0.1, False), (0.1 + 1e-9, True)])
def test_contradictions_name_the_joint_with_the_largest_residual(size, is_refused):
    """A residual of 5 % of 2 m/s is allowed; the row of a coupling follows the rows of the joints."""
    sleeve = Cylindrical(name="C", bodies=("ground", "b"), anchor=O, axis=Z)
    gear = Coupling(name="G", joints=("A", "C"), ratio=2.0)
    both = scene(joint=(hinge("A", "ground", "b"), sleeve), coupling=(gear,))
    x = np.array([0.5, -2.0, 1.0])
    for row, place in ((2, "joint[0] 'A'"), (5, "joint[1] 'C'"), (9, "coupling[0] 'G'")):
        residual = np.full(10, 0.01)
        residual[row] = -size
        if not is_refused:
            _refuse(both, "why", residual, x, 0.05)
            continue
        with pytest.raises(SceneError) as caught:
            _refuse(both, "why", residual, x, 0.05)
        assert str(caught.value) == f"{place}: why: off by 0.1 of 2 m/s or rad/s"
    _refuse(scene(), "why", np.zeros(0), np.zeros(0), 0.05)
    with pytest.raises(KeyError, match="no"):
        _place(both, "no")


def test_velocities_nearest_to_the_given_ones():
    """A body on a rail along x: given 3 m/s along x and 0.14 m/s across; 5 % of 3 m/s may be lost."""
    rail = Translational(name="R", bodies=("ground", "b"), anchor=O, axis=X)
    for across, is_refused in ((0.149, False), (0.151, True)):
        given = scene(body(velocity=(3.0, across, 0.0)), joint=(rail,))
        if is_refused:
            with pytest.raises(
                SceneError, match=r"joint\[0\] 'R': the given velocities contradict it: off by"
            ):
                constraints.initial_twists(given)
        else:
            velocity, spin = constraints.initial_twists(given)
            assert velocity == pytest.approx(np.array([[3.0, 0.0, 0.0]])) and not spin.round(12).any()
            velocity[:] = 9.0
            assert constraints.initial_twists(given)[0][0, 0] == pytest.approx(3.0), "a copy"


def test_velocities_that_a_scene_gives(monkeypatch):
    """Components by their numbers; the weight of an angular velocity is the length of 2.5 m."""
    monkeypatch.setattr(constraints, "scene_length", lambda scene: 2.5)
    both = scene(body("a", angular_velocity=(1.0, 2.0, 3.0)), body("b", velocity=(4.0, 5.0, 6.0)), body("c"))
    found = given(both)
    assert found.components.tolist() == [3, 4, 5, 6, 7, 8] and found.values.tolist() == [1, 2, 3, 4, 5, 6]
    assert found.weights.tolist() == [2.5, 2.5, 2.5, 1.0, 1.0, 1.0]


# --- falls ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("velocities", "falls"),
    [
        (((1.0, 0.0, 0.0), (1.0, 1e-9, 0.0)), True),
        (((1.0, 0.0, 0.0), (1.0, 1.1e-9, 0.0)), False),
        (((-2.0, 0.0, 0.0), (-2.0, 1.9e-9, 0.0)), True),
        ((O, O), True),
        ((O, (0.0, 1e-200, 0.0)), False),
    ],
)
def test_bodies_with_one_velocity_fall_as_one(velocities, falls):
    """Differences up to 1e-9 of the speed are rounding."""
    bodies = [
        body(name, position=place, velocity=v, angular_velocity=O)
        for name, place, v in zip("ab", (O, X), velocities, strict=True)
    ]
    assert free_fall.falls_freely(scene(*bodies, gravity=(0.0, -10.0, 0.0))) is falls


SLIGHT = free_fall.ROUNDING


@pytest.mark.parametrize("part", [0, 1])
@pytest.mark.parametrize(("size", "falls"), [(SLIGHT, True), (1.01 * SLIGHT, False)])
def test_accelerations_of_a_fall_are_gravity(monkeypatch, part, size, falls):
    """Up to 1e-9 of 10 m/s²; the second part has angular accelerations."""
    made = np.zeros((4, 3))
    made[:2, 1] = -10.0
    made[2 * part, 2] = -10.0 * size
    monkeypatch.setattr(free_fall, "gauss", lambda scene: made)
    assert free_fall.falls_freely(scene(body("a"), body("b", position=X), gravity=(0.0, -10.0, 0.0))) is falls


def test_slow_rotations_are_no_fall():
    """An angular velocity counts times the length of 4 m: 4e-10 of the speed is 2.5 times 1.6e-10."""
    for spin, falls in ((2.4e-10, True), (2.6e-10, False)):
        bodies = [
            body(n, position=place, velocity=X, angular_velocity=(0.0, 0.0, spin if n == "b" else 0.0))
            for n, place in (("a", O), ("b", (4.0, 0.0, 0.0)))
        ]
        assert free_fall.falls_freely(scene(*bodies, gravity=(0.0, -10.0, 0.0))) is falls


# --- vectors and quaternions ------------------------------------------------------------------------------
@pytest.mark.parametrize("numbers", [DOUBLE, EXTENDED], ids=["double", "extended"])
def test_vectors_and_quaternions_of_many_samples(numbers):
    """Products of arrays (2, 5, ·) as NumPy and mbref's rotations know them."""
    draws = np.random.default_rng(3)
    a, b = draws.normal(size=(2, 2, 5, 3))
    p, q = draws.normal(size=(2, 2, 5, 4))
    x, y, r, s = map(numbers.array, (a, b, p, q))
    assert doubles(vectors.cross(x, y)) == pytest.approx(np.cross(a, b))
    assert doubles(vectors.dot(x, y)) == pytest.approx(np.einsum("kij,kij->ki", a, b))
    assert doubles(vectors.skew(x) @ y[..., None])[..., 0] == pytest.approx(np.cross(a, b))
    assert doubles(vectors.product(r, s)) == pytest.approx(rotations.multiply(p, q))
    unit = vectors.unit(r)
    assert doubles((unit * unit).sum(axis=2)) == pytest.approx(np.ones((2, 5)))
    assert doubles(unit / r).std(axis=2) == pytest.approx(np.zeros((2, 5)), abs=1e-15)
    assert doubles(vectors.matrices(unit)) == pytest.approx(rotations.to_matrix(doubles(unit)))
    matrix = numbers.array(draws.normal(size=(2, 5, 4, 3)))
    assert doubles(vectors.apply(matrix, x)) == pytest.approx(np.einsum("kimn,kin->kim", doubles(matrix), a))
    assert vectors.product(r, s).dtype == vectors.matrices(unit).dtype == numbers.dtype


# --- numbers ----------------------------------------------------------------------------------------------
def test_numbers_of_double_and_extended_precision():
    assert (DOUBLE.name, DOUBLE.eps, DOUBLE.digits) == ("double", 2.0**-52, 0) and DOUBLE.dtype is np.float64
    assert (EXTENDED.name, EXTENDED.dtype, EXTENDED.digits) == ("long double", np.longdouble, 0)
    assert EXTENDED.eps == float(np.finfo(np.longdouble).eps)
    assert DOUBLE.array([[1, 2]]).tolist() == [[1.0, 2.0]] and DOUBLE.array([1]).dtype == float
    zeros = EXTENDED.zeros(2, 3)
    assert zeros.shape == (2, 3) and not zeros.any() and zeros.dtype == np.longdouble
    assert EXTENDED.number(0.5) == 0.5 and isinstance(EXTENDED.number(0.5), np.longdouble)
    given = np.ones(2)
    assert DOUBLE.settled(given) is given
    assert doubles(EXTENDED.array([1, 3]) / 3).tolist() == [1 / 3, 1.0]
    assert largest(np.array([[1.0, -3.0], [2.0, 0.5]])) == 3.0 and largest(np.array([-0.25])) == 0.25
    assert largest(np.zeros(0)) == 0.0


def test_numbers_of_many_digits():
    flint = pytest.importorskip("flint")
    from crosscheck.judge.arithmetic import many_digits

    numbers = many_digits(30)
    assert (numbers.name, numbers.digits, numbers.dtype) == ("30 digits", 30, object)
    assert numbers.eps == pytest.approx(1e-30, rel=1e-9)
    third = numbers.array([[1.0, 2.0]]) / 3
    assert third.shape == (1, 2) and third.dtype == object and doubles(third).tolist() == [[1 / 3, 2 / 3]]
    assert flint.ctx.dps == 30
    assert third[0, 0].rad() > 0 and numbers.settled(third)[0, 0].rad() == 0
    assert numbers.array(third)[0, 1] is third[0, 1] and numbers.settled(third).shape == (1, 2)
    assert doubles(numbers.zeros(2)).tolist() == [0.0, 0.0] and float(numbers.number(0.5)) == 0.5


# --- least scales -----------------------------------------------------------------------------------------
def test_scales_of_zeros():
    """Rows of zeros are scaled by 1e150; bodies without mass keep their finite scale."""
    system = SaddlePoint(np.eye(1), np.zeros((1, 3, 1)), np.zeros(1), DOUBLE)
    assert system._scale == pytest.approx([1.0, 1.0, 1.0, 1e150])
    x, _ = saddle_solve(np.zeros((1, 1, 1)), np.ones((1, 1, 1)), np.full((1, 1), 5.0), np.full((1, 1), 3.0))
    assert x[0] == pytest.approx([3.0])
    assert (Panels(DOUBLE, 8)._size(np.zeros((2, 2)), np.zeros((2, 2)), 1) > 0.0).all()
    run = SimpleNamespace(
        reactions={"A": np.zeros((2, 6))},
        acceleration=None,
        velocity=np.zeros((2, 1, 3)),
        angular_velocity=np.zeros((2, 1, 3)),
    )
    bare = scene(Body(name="b", position=O), gravity=O)
    [(name, _, scale)] = precision._of_joints(bare, run)
    assert name == "reaction in A" and scale.tolist() == [1e-300] * 6
