"""Rows of joints in natural coordinates / against constraints of numeric poses, of unit length 2 m.

Body 0 turns about z, whose variables are a cosine and a sine; body 1 turns freely; 2 is the ground.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref import rotations
from mbref.kernels.scene_layout import COUPLED_ANGLE, COUPLED_SLIDE, DISTANCE, DOT1, DOT2, POINT
from mbref.taylor import natural
from mbref.taylor.direction_vectors import DirectionVectors
from mbref.taylor.expressions import ONE, Elimination
from mbref.taylor.loads import COSINE, SINE, VALUE
from mbref.taylor.natural import NaturalCoordinates
from mbref.taylor.orientations import FIXED, Orientation

LENGTH, TURN = 2.0, 0.4
CENTRES = np.array([[0.3, -0.5, 0.7], [1.1, 0.2, -0.4]])  # m
ROTATIONS = [
    rotations.to_matrix(rotations.from_vector(np.array(turn)))
    for turn in ((0.0, 0.0, TURN), (0.7, -0.3, 0.5), (0.0, 0.0, 0.0))
]
A, B = np.array([0.6, -0.2, 0.9]), np.array([-0.4, 0.8, 0.3])
VALUES = {
    ONE: 1.0,
    **dict(enumerate((CENTRES / LENGTH).ravel())),
    **{6: np.cos(TURN), 7: np.sin(TURN)},
    **dict(enumerate(ROTATIONS[1].T.ravel(), 8)),
}


class Turned:
    """Orientations of both bodies and of the ground; the axes of the ground are the axes of the world."""

    def __init__(self) -> None:
        self.numbered = {
            -1: FIXED,
            0: Orientation((6, 7), np.eye(3), np.eye(3)),
            1: Orientation(tuple(range(8, 17)), np.eye(3)),
        }

    def __getitem__(self, body: int) -> Orientation:
        return self.numbered[self.number(body)]

    def number(self, body: int) -> int:
        return body if body < 2 else -1

    def world(self, body: int, local: np.ndarray) -> np.ndarray:
        return local

    def shared_axes(self) -> Any:
        return iter([((0, np.array([0.0, 0.0, 1.0])), (1, A))])


def made(**columns: Any) -> Any:
    """Natural coordinates with the primitives of these columns; others join A on body 0 and B on body 1."""
    count = len(columns["kind"])
    table = {
        "first": [0] * count,
        "second": [1] * count,
        "driver": [-1] * count,
        "begins": [1] * count,
        "length": [1.0] * count,
        **{name: [A] * count for name in ("point_first", "direction_first")},
        **{name: [B] * count for name in ("point_second", "direction_second")},
        "turning_first": [A[::-1]] * count,
        **columns,
    }
    found = NaturalCoordinates.__new__(NaturalCoordinates)
    primitives = SimpleNamespace(**{name: np.array(column) for name, column in table.items()})
    found.model = SimpleNamespace(data=SimpleNamespace(primitives=primitives))  # type: ignore[assignment]
    found.nb, found.length, found.driven, found.given = 2, LENGTH, False, {}
    found.direction_vectors = DirectionVectors(LENGTH)
    found.centres = [found.direction_vectors.add(b, np.eye(12)[:3]) for b in range(2)]
    found.direction_vectors.add(0, np.zeros((2, 12)))
    found.direction_vectors.add(1, np.zeros((9, 12)))
    found._positions, found.eliminate = range(6), Elimination(lambda *_: True)
    found.orientations = Turned()  # type: ignore[assignment]
    found.place, found._moving = CENTRES / LENGTH, np.ones((2, 6), bool)
    return found


def value(found: Any, more: Any = ()) -> float:
    """Return the value of an expression or of a polynomial."""
    at = {**VALUES, **dict(more)}
    pairs = ((key if isinstance(key, tuple) else (ONE, key), c) for key, c in found.items())
    return float(sum(c * at[i] * at[j] for (i, j), c in pairs))


def vector(found: Any, more: Any = ()) -> np.ndarray:
    return np.array([value(each, more) for each in found])


def place(body: int, local: np.ndarray) -> np.ndarray:
    """Return a point (m) of a body, or of the ground."""
    return (CENTRES[body] if body < 2 else 0.0) + ROTATIONS[body] @ local


@pytest.mark.parametrize("body", range(3))
def test_points_and_directions_of_bodies(body):
    found = made(kind=[DISTANCE], first=[body], second=[(body + 1) % 3])
    assert vector(found.direction(body, A)) == pytest.approx(ROTATIONS[body] @ A)
    assert vector(found.point(body, A)) == pytest.approx(place(body, A) / LENGTH)
    first, second = found._ends(0)
    assert vector(first) == pytest.approx(place(body, A) / LENGTH)
    assert vector(second) == pytest.approx(place((body + 1) % 3, B) / LENGTH)
    found.eliminate.expressed = {6: {ONE: 5.0}, 8: {ONE: 5.0}, 0: {ONE: 7.0}}
    touched = {v for each in (*found.direction(body, A), *found.point(body, A)) for v in each}
    assert not touched & {0, 6, 8}, "eliminated variables are replaced"


def test_coordinates_of_poses():
    poses = np.array([[1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0], [4.0, 5.0, 6.0, 0.0, 0.0, 0.0, 1.0]])
    centres, axes = natural.pose_of(poses.reshape(1, 14))
    assert centres.tolist() == [[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]]
    assert axes.tolist() == [[np.eye(3).tolist(), np.diag([-1.0, -1.0, 1.0]).tolist()]]
    assert natural.pose_of(poses.ravel()).centres.tolist() == centres[0].tolist()


@pytest.mark.parametrize(("first", "second"), [(0, 1), (1, 2), (2, 0)])
def test_rows_without_drivers(first, second):
    """Distances are squares over twice the length, in the unit of length; vectors are perpendicular."""
    found = made(kind=[DISTANCE, DOT1, DOT2], first=[first] * 3, second=[second] * 3, length=[1.6, 9.0, 9.0])
    apart = place(second, B) - place(first, A)
    assert value(found._undriven(0)) == pytest.approx((apart @ apart - 1.6**2) / (2 * 1.6 * LENGTH))
    one, other = ROTATIONS[first] @ A, ROTATIONS[second] @ B
    assert value(found._undriven(1)) == pytest.approx(one @ other)
    assert value(found._undriven(2)) == pytest.approx(one @ apart / LENGTH)
    assert vector(found._other_side(1)) == pytest.approx(other)
    assert vector(found._other_side(2)) == pytest.approx(apart / LENGTH)


def test_a_driven_displacement():
    found = made(kind=[DOT1, DOT2], driver=[-1, 5])
    [row] = found._driven(1)
    apart = place(1, B) - place(0, A)
    assert found.given == {17: (5, VALUE)} and len(found.direction_vectors) == 18
    assert value(row, {17: 0.25}) == pytest.approx((ROTATIONS[0] @ A) @ apart / LENGTH - 0.25)


@pytest.mark.parametrize(("first", "second", "own"), [(2, 1, 0), (0, 1, 3), (1, 2, 3)])
def test_a_driven_angle(first, second, own):
    """The driver turns e = cos ψ y - sin ψ x; a direction that moves, too, has variables of its own."""
    found = made(kind=[DOT1], first=[first], second=[second], driver=[4])
    *defining, row = found._driven(0)
    assert found.given == {17: (4, COSINE), 18: (4, SINE)} and len(defining) == own
    cosine, sine = np.cos(0.9), np.sin(0.9)
    e = ROTATIONS[first] @ (cosine * A[::-1] - sine * A)
    more = {17: cosine, 18: sine, **dict(zip(range(19, 22), e, strict=True))}
    assert value(row, more) == pytest.approx(e @ ROTATIONS[second] @ B)
    assert vector(defining, more) == pytest.approx(np.zeros(own), abs=1e-15)
    assert [each[ONE, 19 + k] for k, each in enumerate(defining)] == [-1.0] * own
    assert all(not {19, 20, 21} & {*pair} for each in defining for pair in each if ONE not in pair)
    if own:
        body, driver, along, across = found.direction_vectors.pose_maps([19, 20, 21])
        pose = np.append(CENTRES[first] if first < 2 else np.zeros(3), ROTATIONS[first].ravel())
        assert body.tolist() == [first] * 3 and driver.tolist() == [4] * 3
        assert along @ pose == pytest.approx(ROTATIONS[first] @ A[::-1])
        assert across @ pose == pytest.approx(ROTATIONS[first] @ A)


def test_rows_of_a_body_that_a_driver_turns():
    """From directions of the ground: R b = cos ψ x + sin ψ y, row by row."""
    found = made(kind=[DOT1], first=[2], second=[0], driver=[4])
    rows, more = found._turning(0), {17: np.cos(0.9), 18: np.sin(0.9)}
    assert found.given == {17: (4, COSINE), 18: (4, SINE)}
    expected = ROTATIONS[0] @ B - np.cos(0.9) * A - np.sin(0.9) * A[::-1]
    assert vector(rows, more) == pytest.approx(expected)
    upright = made(
        kind=[DOT1],
        first=[0],
        second=[1],
        driver=[4],
        direction_first=[[0, 0, 1.0]],
        turning_first=[[0, 0, 0]],
    )
    assert vector(upright._turning(0), more) == pytest.approx(ROTATIONS[1] @ B - [0, 0, np.cos(0.9)])


@pytest.mark.parametrize(
    ("columns", "driven", "number"),
    [
        ({}, True, 0),
        ({}, False, None),
        ({"driver": [-1]}, True, None),
        ({"driver": [0]}, True, 0),
        ({"kind": [DOT2]}, True, None),
        ({"second": [1]}, True, None),
        ({"first": [1]}, True, None),
        ({"first": [0], "direction_first": [[0, 0, 1.0]], "turning_first": [[0, 0, 2.0]]}, True, 0),
        ({"first": [0], "direction_first": [[0, 0, 1.0]]}, True, None),
        ({"first": [0], "turning_first": [[0, 0, 1.0]]}, True, None),
    ],
)
def test_drivers_that_turn_a_body_about_an_axis_at_rest(columns, driven, number):
    found = made(**{"kind": [DOT1], "first": [2], "second": [0], "driver": [4], **columns})
    found.driven = driven
    assert found._turned(0) == number


def test_couplings_of_slides_and_of_angles():
    """Factors are over the larger one, of slides in the unit of length: 3 · 2 against 1.5, and 4 · 2."""
    slide, angle = COUPLED_SLIDE, COUPLED_ANGLE
    found = made(
        kind=[slide, angle, slide, slide, angle, angle],
        begins=[1, 0, 1, 0, 1, 0],
        length=[3.0, 1.5, 1.0, -4.0, 2.0, -0.5],
    )
    moved = (ROTATIONS[0] @ A) @ (place(1, B) - place(0, A)) / LENGTH
    (one, of_one), (two, of_two), (three, of_three) = found._couplings()
    assert value(one) == pytest.approx(moved) and of_one == [(1, 0.25)]
    assert value(two) == pytest.approx(-0.75 * moved) and of_two == []
    assert three == {} and of_three == [(4, 1.0), (5, -0.25)]
    assert [found._unit(p) for p in range(2)] == [LENGTH, 1.0]


def test_linear_equations_of_bodies_and_joints():
    """Two positions at rest, three components of a common axis, and three of coincident points."""
    found = made(kind=[DOT1, POINT])
    found._moving[0, 1] = found._moving[1, 2] = False
    equations = list(found._linear_equations())
    assert len(equations) == 8 and equations[:2] == [{1: 1.0, ONE: 0.25}, {5: 1.0, ONE: 0.2}]
    axis = np.array([0.0, 0.0, 1.0]) - ROTATIONS[1] @ A
    assert vector(equations[2:5]) == pytest.approx(axis)
    assert vector(equations[5:]) == pytest.approx((place(0, A) - place(1, B)) / LENGTH)


@pytest.mark.parametrize(
    ("variable", "driven", "most"), [(5, False, 40), (5, True, 40), (6, False, 1), (6, True, 4)]
)
def test_equations_that_eliminate_a_variable(variable, driven, most):
    """By the number of further variables; a prescribed one is never eliminated."""
    found = made(kind=[DOT1])
    found.driven = driven
    assert found._may_go(variable, most) and not found._may_go(variable, most + 1)
    found.given = {variable: (0, VALUE)}
    assert not found._may_go(variable, 0)


def test_rows_without_eliminated_variables():
    """x2 = 2 x3 + 1: 3 x1 x2 + x2² / 2 + 5 x4 x1; a row with a prescribed variable eliminates nothing."""
    found = made(kind=[DOT1])
    found.eliminate.expressed = {2: {3: 2.0, ONE: 1.0}}
    row = {(1, 2): 3.0, (2, 2): 0.5, (1, 4): 5.0, (ONE, 1): 1.0, (ONE, 5): 1e-13}
    assert found._reduced(row) == {
        (1, 3): 6.0,
        (ONE, 1): 4.0,
        (3, 3): 2.0,
        (ONE, 3): 2.0,
        (ONE, ONE): 0.5,
        (1, 4): 5.0,
    }
    found.given = {4: (0, VALUE)}
    assert found._is_prescribed(row) and not found._is_prescribed({(1, 2): 3.0, (ONE, 1): 1.0})
    assert natural._difference(({1: 2.0}, {}), ({1: 2.0, 2: 3.0}, {ONE: 1.0})) == ({2: -3.0}, {ONE: -1.0})


def test_the_variables_that_are_kept(monkeypatch):
    """Those with most products come first; eliminated and prescribed variables are not kept."""
    rows = [
        {(0, 1): 1.0, (ONE, 2): 1.0},
        {(1, 1): 1.0, (1, 4): 1.0, (4, 5): 1.0, (ONE, 2): 1.0},
        {(4, 5): 2.0, (ONE, 0): 1.0, (ONE, 2): 1.0},
    ]
    asked: list[Any] = []

    def rows_of(found: Any) -> Any:
        found.eliminate.expressed, found.given = {3: {}}, {5: (0, VALUE)}
        return rows

    monkeypatch.setattr(NaturalCoordinates, "_rows", rows_of)
    monkeypatch.setattr(natural, "Orientations", lambda *given: asked.append(given) or "orientations")
    model: Any = SimpleNamespace(nb=2, length=1.9)
    pose = natural.Pose(CENTRES, np.array(ROTATIONS[:2]))
    moving = np.arange(12) % 5 > 0
    found = NaturalCoordinates(model, pose, moving, False, "numbers")  # type: ignore[arg-type]
    assert found.kept == [1, 4, 0, 2] and found.rows is rows and found.angles == {}
    assert found.length == 2.0 and found.place.tolist() == (CENTRES / 2.0).tolist()
    assert found.centres == [(0, 1, 2), (3, 4, 5)] and found._positions == range(6)
    [(given, axes, turning, vectors)] = asked
    assert given is model and axes is pose.axes and vectors is found.direction_vectors
    assert turning.tolist() == moving.reshape(2, 6)[:, 3:].tolist()
    body, _, along, _ = vectors.pose_maps(range(6))
    assert body.tolist() == [0, 0, 0, 1, 1, 1] and along[3:, :3].tolist() == (0.5 * np.eye(3)).tolist()
    assert found.eliminate._may_go(0, 40) and not found.eliminate._may_go(0, 41)


def test_rows_of_a_mechanism():
    """x0 = 2 and 2 x3 + 2 x4 = 0 eliminate variables; variables 10 and 11 may not go, and 17 is prescribed.

    A driver turns orientation 0, by which it needs no rows; a second driver of it is a row. Rows with fewer
    terms come first, and rows of angles last.
    """
    angle = COUPLED_ANGLE
    found = made(
        kind=[DOT1, POINT, DOT1, DOT2, angle, angle, DISTANCE], driver=[4, 9, 0, -1, 9, 9, 7], begins=[1] * 7
    )
    free = {(8, 8): 1.0, (ONE, ONE): -1.0}
    rows_of = lambda *rows: SimpleNamespace(rows=lambda: iter(rows))  # noqa: E731
    found.orientations.numbered = {
        -1: rows_of(),
        0: rows_of({(6, 6): 1.0, (ONE, ONE): -1.0}),
        1: rows_of(free),
    }
    found.eliminate, found.given = (
        Elimination(lambda variable, _: variable not in (10, 11)),
        {17: (4, COSINE)},
    )
    found._linear_equations = lambda: iter([{0: 1.0, ONE: -2.0}, {10: 1.0, 11: 2.0}])
    found._turned = {0: 0, 2: 0}.get
    turning, second = {(ONE, 6): 1.0, (ONE, 17): -1.0}, {(1, 2): 1.0, (ONE, 1): 3.0}
    found._turning = {0: [turning]}.__getitem__
    found._driven = {2: [second], 6: [{(4, 5): 1.0, (ONE, ONE): 1.0}]}.__getitem__
    found._undriven = {3: {(0, 3): 1.0, (ONE, 4): 2.0}}.__getitem__
    found._couplings = lambda: [({(3, 3): 1.0}, []), ({(0, 5): 1.0}, [(4, 1.0), (5, -0.5)])]
    found.angles = {}
    assert found._rows() == [
        {(3, 3): 1.0},
        free,
        turning,
        second,
        {(3, 5): -1.0, (ONE, ONE): 1.0},
        {(ONE, 10): 1.0, (ONE, 11): 2.0},
        {(ONE, 5): 2.0},
    ]
    assert found.angles == {4: (6, 1.0), 5: (6, -0.5)}
    assert found.eliminate.expressed == {0: {ONE: 2.0}, 4: {3: -1.0}}
