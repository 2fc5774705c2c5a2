"""Equations of the spanning tree / ranks, selections of rows and corrections worked out by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.judge.arithmetic import DOUBLE, EXTENDED
from crosscheck.judge.reference.tree_equations import TreeEquations, _least
from crosscheck.judge.reference.tree_joints import spanning_tree, used_coordinates
from mbref.scene import Body, Driver, Revolute, Scene, Spherical

Z = (0.0, 0.0, 1.0)


def made(**parts: Any) -> TreeEquations:
    """Equations without a scene; parts replace what is asked of one."""
    found = object.__new__(TreeEquations)
    found.__dict__.update({"arithmetic": DOUBLE, "length": 1.0, **parts})
    return found


@pytest.mark.parametrize(
    ("rows", "length", "rank"),
    [
        ([[1.0, 0.0], [0.0, 1e-3]], 1.0, 2),
        ([[1.0, 0.0], [1.0, 2e-9]], 1.0, 2),
        ([[1.0, 0.0], [1.0, 0.5e-9]], 1.0, 1),
        ([[1.0, 0.0], [0.0, 0.9e-9]], 1.0, 1),
        ([[4.0, 0.0], [0.0, 3e-9]], 1.0, 1),
        ([[2e-10, 0.0]], 0.01, 1),
        ([[2e-10, 0.0]], 2.0, 0),
        ([[2e-9, 0.0]], 100.0, 1),
        (np.zeros((0, 2)), 1.0, 0),
        ([[0.0, 0.0]], 1.0, 0),
    ],
)
def test_rows_of_rounding_have_no_rank(rows, length, rank):
    """A row counts from 1e-9 of the largest row on, which is at least the square of the length, up to one."""
    assert made(length=length)._rank(np.array(rows)) == rank


def chosen(rows: list[list[float]], kept: list[int] | None, **parts: Any) -> list[int]:
    at = SimpleNamespace(rows=SimpleNamespace(jacobian=np.array([rows])))
    given = {"_rate_sizes": np.ones(2), "_row_sizes": np.ones(3), "_weights": np.array([1.0, 1.1, 1.0])}
    equations = made(kept=None if kept is None else np.array(kept), rank=2, **{**given, **parts})
    equations._choose(at)
    return equations.kept.tolist()


def test_rows_are_selected_by_their_weights_and_stay_while_they_serve():
    """Rows 0 and 1 have one direction, and row 2 is perpendicular to them."""
    same = [[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
    assert chosen(same, None) == [1, 2] and chosen(same, [0, 2]) == [0, 2]
    assert chosen([[0.49, 0.0], *same[1:]], [0, 2]) == [1, 2], "below half of the best conditioning"
    assert chosen([[0.5, 0.0], *same[1:]], [0, 2]) == [0, 2]


def test_rows_are_measured_in_sizes_of_rates_and_rows():
    """2 · 2 / 8 is half; a row that turns a rate of size 3 counts three times."""
    rows = [[1.9, 0.0], [0.5, 0.0], [0.0, 1.0]]
    sizes = {"_rate_sizes": np.array([2.0, 1.0]), "_row_sizes": np.array([8.0, 1.0, 1.0])}
    assert chosen(rows, [0, 2], **sizes) == [1, 2]
    assert chosen([[2.0, 0.0], *rows[1:]], [0, 2], **sizes) == [0, 2]


def test_least_singular_values():
    assert _least(np.diag([3.0, 2.0])) == pytest.approx(2.0) and _least(np.zeros((0, 4))) == np.inf


@pytest.mark.parametrize(
    ("steps", "reached", "count"),
    [
        ([0.5, 0.25, 0.25], 0.75, 3),
        ([0.5**k for k in range(1, 99)], 1 - 0.5**8, 8),
        ([0.0, 0.0], 0.0, 2),
        ([np.nan], 0.0, 1),
    ],
)
def test_loops_are_closed_while_corrections_decrease(steps, reached, count):
    asked: list[tuple[float, float]] = []

    def nearer(t: np.ndarray, y: np.ndarray) -> np.ndarray:
        asked.append((t[0], y[0, 0]))
        return y + steps[len(asked) - 1]

    equations = made(nearer=nearer, at=lambda t, y: None, _choose=lambda at: None)
    assert equations.closed(0.25, np.zeros(1)).tolist() == [reached]
    assert len(asked) == count and all(t == 0.25 for t, _ in asked)


def test_gaps_are_relative_to_the_length():
    at = SimpleNamespace(rows=SimpleNamespace(value=np.array([[1e-3, -6e-3]])))
    assert made(length=3.0, at=lambda t, y: at).gap(0.0, np.zeros(1)) == pytest.approx(2e-3)
    none = SimpleNamespace(rows=SimpleNamespace(value=np.zeros((1, 0))))
    assert made(at=lambda t, y: none).gap(0.0, np.zeros(1)) == 0.0


def test_bodies_without_mass_need_drivers():
    bare = Scene(name="s", body=(Body(name="a", position=Z), Body(name="b", position=Z)))
    found = made(scene=bare, kept=np.arange(3), nv=4).undetermined()
    assert found == "bodies without mass move freely: a, b"
    assert made(scene=bare, kept=np.arange(4), nv=4).undetermined() == ""
    heavy = Body(name="a", mass=1.0, inertia=(1.0, 1.0, 1.0), position=Z)
    massive = Scene(name="s", body=(heavy,))
    assert made(scene=massive, kept=np.arange(0), nv=6).undetermined() == ""


# --- a scene ----------------------------------------------------------------------------------------------
def body(name: str, x: float) -> Body:
    return Body(name=name, mass=1.0, inertia=(1.0, 1.0, 1.0), position=(x, 0.0, 0.0))


def hinge(name: str, first: str, second: str, x: float) -> Revolute:
    return Revolute(name=name, bodies=(first, second), anchor=(x, 0.0, 0.0), axis=Z)


CHAIN = Scene(
    name="chain",
    body=(body("a", 1.0), body("b", 3.0)),
    joint=(
        Spherical(name="ball", bodies=("ground", "a"), anchor=(0.0, 0.0, 0.0)),
        hinge("A", "ground", "a", 0.0),
        hinge("B", "a", "b", 2.0),
    ),
    driver=(Driver(joint="B", polynomial=(0.0, 2.0, 3.0)),),
)


def test_joints_with_more_rows_or_a_driver_are_in_the_tree():
    assert [link.joint.name for link in spanning_tree(CHAIN)] == ["A", "B"]
    assert used_coordinates(CHAIN) == {("angle", "B")}
    driven = CHAIN.with_(driver=(Driver(joint="A"),), joint=(*CHAIN.joint, hinge("C", "b", "ground", 4.0)))
    names = [link.joint.name for link in spanning_tree(driven)]
    assert names[0] == "A" and "C" not in names[:1]


def test_rows_of_a_closure_and_a_driver_are_displaced_and_weighted_by_a_seed():
    plain, other = (TreeEquations(CHAIN, DOUBLE, way) for way in ((0, 0.0), (3, 1e-6)))
    assert np.all(plain._weights == 1.0)
    assert not plain._displaced.any() and plain._row_sizes[-1] == 1.0
    assert (other._weights >= 1.0).all() and 1.0 < other._weights.max() < 1.2
    away = np.abs(other._displaced) / plain.length
    assert away.shape == (3,) and 0.0 < away.max() <= 1e-6
    assert plain._row_sizes[:3].tolist() == [plain.length] * 3


def test_equations_in_double_precision_hold_the_same_rows():
    exact = TreeEquations(CHAIN, EXTENDED)
    exact.start()
    exact.since = 0.75
    found = exact.in_doubles()
    assert found.arithmetic is DOUBLE and found.kept is exact.kept and found.since == 0.75
    assert exact.in_doubles() is found and exact.kept.tolist() == [3], "the ball's rows are redundant"


def test_a_driver_s_values_and_rates():
    """2 t + 3 t², 2 + 6 t and 6 at 0 and 0.5 s; without drivers there is no column."""
    found = TreeEquations(CHAIN, DOUBLE)._wanted(np.array([0.0, 0.5]))
    assert found[:, :, 0].tolist() == [[0.0, 1.75], [2.0, 5.0], [6.0, 6.0]]
    none = TreeEquations(CHAIN.with_(driver=()), DOUBLE)._wanted(np.zeros(4))
    assert none.shape == (3, 4, 0)


def test_the_start_has_the_driver_s_rate_and_the_least_energy():
    """2 T = 2 u² + (3 u + w)² + (u + w)² with w = 2 rad/s is least for u = -w / 3."""
    state = TreeEquations(CHAIN, DOUBLE).start()
    assert state[-2:] == pytest.approx([-2 / 3, 2.0])
