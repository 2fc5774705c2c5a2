"""Runs on an engine's terms / three coordinates, the middle one driven, and closures on paper."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.engines import terms as on_terms
from crosscheck.engines.sampling import Failed
from crosscheck.engines.spanning_tree import GROUND_LINK
from crosscheck.engines.terms import Simulation, Terms, _Rows
from mbref.trajectory import Outcome

MASS = np.array([[4.0, 9.0, 2.0], [9.0, 8.0, 7.0], [2.0, 7.0, 5.0]])
ROOT = np.array([[2.0, 0.0], [1.0, 2.0]])
"""Times its transpose: rows and columns 0 and 2 of MASS."""
ROW = np.array([[2.0, 7.0, 3.0]])
POINT, WELD = SimpleNamespace(kind="point"), SimpleNamespace(kind="weld")


def terms(mass: np.ndarray = MASS, bias: Any = (0.0, 0.0, 0.0)) -> Terms:
    nothing = np.zeros(0)
    return Terms(mass, np.array(bias), nothing, nothing, nothing, nothing)


def simulation(**fields: Any) -> Any:
    """A simulation with three coordinates, of which the middle one is driven."""
    found = object.__new__(Simulation)
    at = SimpleNamespace(nv=3, nq=3, moved=lambda q, change: q + change)
    vars(found).update({"free": np.array([0, 2]), "at": at, "driven": [(1, "d")], **fields})
    return found


def test_root_spread_and_least_change():
    """The row (2, 3) divided by the root is (1, 1); the least change for 4 has the parts 1/2 and 1."""
    asked = simulation()
    assert asked._root(0.0, terms()) == pytest.approx(ROOT)
    assert asked._spread(0.0, ROOT, ROW) == pytest.approx(np.array([[1.0, 1.0]]))
    change = asked._least(0.0, ROOT, ROW, np.array([4.0]))
    assert change == pytest.approx([0.5, 0.0, 1.0]) and ROW @ change == pytest.approx([4.0])


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda s: s._root(0.25, terms(np.where(MASS > 4.5, np.inf, MASS))), "the state is not finite at"),
        (lambda s: s._spread(0.25, ROOT, np.full((1, 3), np.nan)), "the closures are not finite at"),
    ],
)
def test_terms_that_are_not_finite(call, says):
    with pytest.raises(Failed, match=f"{says} 0.25 s") as error:
        call(simulation())
    assert error.value.outcome is Outcome.NOT_FINITE and error.value.t == 0.25


@pytest.mark.parametrize("rows", [[[2.0, 7.0, 3.0]], [[2.0, 7.0, 3.0], [4.0, 14.0, 6.0]]])
def test_accelerations_satisfy_the_equations_of_motion_and_the_rows(monkeypatch, rows):
    """M a = f - b + Jᵀ λ in the free coordinates, J a = -drift, and the driven acceleration as prescribed."""
    jacobian, forces, bias = np.array(rows), np.array([1.0, 50.0, -2.0]), (0.5, 9.0, 0.25)
    drift = np.array([1.5, 3.0])[: len(rows)]
    monkeypatch.setattr(on_terms, "motion", lambda driver, t: (0.0, 0.0, 3.0))
    asked = simulation(
        _terms=lambda q, v: terms(bias=bias),
        _motion=lambda *_: "moving",
        _rows=lambda *_: _Rows(np.zeros(0), jacobian, drift, ["place"]),
        _forces=lambda *_: forces,
        _accelerated=lambda terms, of, a: (of, a),
    )
    a, multipliers, moved, found = asked.accelerations(0.5, np.zeros(3), np.zeros(3))
    assert a[1] == 3.0 and jacobian @ a == pytest.approx(-drift)
    left = MASS @ a - forces + np.array(bias) - jacobian.T @ multipliers
    assert left[[0, 2]] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert moved[0] == "moving" and moved[1] is a and found.places == ["place"]


def test_forces_that_are_not_finite(monkeypatch):
    monkeypatch.setattr(on_terms, "motion", lambda driver, t: (0.0, 0.0, 0.0))
    asked = simulation(
        _terms=lambda q, v: terms(),
        _motion=lambda *_: None,
        _rows=lambda *_: _Rows(np.zeros(0), ROW, np.zeros(1), []),
        _forces=lambda *_: np.array([np.inf, 0.0, 0.0]),
    )
    with pytest.raises(Failed, match=r"the forces are not finite at 0\.5 s"):
        asked.accelerations(0.5, np.zeros(3), np.zeros(3))


def settling(residual: Any, closures: Any = (POINT,)) -> Any:
    moves: list[np.ndarray] = []

    def rows(terms: Terms, q: np.ndarray, v: np.ndarray) -> _Rows:
        moves.append(q)
        return _Rows(np.array([residual(q)]), ROW, np.zeros(1), [])

    return simulation(
        moves=moves,
        split=lambda t, y: (y[:3], y[3:]),
        tree=SimpleNamespace(closures=closures),
        scene=SimpleNamespace(coupling=()),
        _terms=lambda q, v: terms(),
        _rows=rows,
    )


def test_a_state_is_moved_to_its_closures():
    """The gap is ROW q - 4: one change of (1/2, 0, 1). Velocities lose the part that opens the closure."""
    asked = settling(lambda q: float(ROW[0] @ q) - 4.0)
    found = asked.settled(0.0, np.array([0.0, 0.0, 0.0, 2.0, 0.0, 0.0]))
    assert found == pytest.approx([0.5, 0.0, 1.0, 1.5, 0.0, -1.0]) and len(asked.moves) == 2
    y = np.arange(6.0)
    assert settling(lambda q: np.nan, ()).settled(0.0, y).tolist() == y.tolist(), "nothing to close"


@pytest.mark.parametrize(
    ("gap", "moves", "converges"), [(1e-13, 1, True), (9e-9, 10, True), (1.1e-8, 10, False)]
)
def test_projections_end_at_a_gap_of_1e_13_and_after_ten_moves(gap, moves, converges):
    asked = settling(lambda q: gap)
    if converges:
        assert len(asked.settled(0.5, np.zeros(6))) == 6
    else:
        with pytest.raises(Failed, match=r"^the closures could not be met at 0.5 s") as error:
            asked.settled(0.5, np.zeros(6))
        assert error.value.outcome is Outcome.NOT_CONVERGED and error.value.t == 0.5
    assert len(asked.moves) == moves


def test_wrenches_of_closures_about_the_origin():
    """The moment of a force (0, 0, 2) at (1, 0, 0) is (0, -2, 0)."""
    asked = simulation(tree=SimpleNamespace(closures=[WELD, POINT]))
    places = [np.array([1.0, 0.0, 0.0]), np.array([0.0, 3.0, 0.0])]
    multipliers = np.array([0.0, 0.0, 2.0, 5.0, 6.0, 7.0, 4.0, 0.0, 0.0])
    first, second = asked._closing(multipliers, _Rows(np.zeros(0), ROW, np.zeros(0), places))
    assert np.concatenate([np.ravel(part) for part in first]).tolist() == [0.0, 0.0, 2.0, 5.0, 4.0, 7.0]
    assert np.concatenate([np.ravel(part) for part in second]).tolist() == [4.0, 0.0, 0.0, 0.0, 0.0, -12.0]


def test_a_point_of_a_link_and_of_the_ground():
    """A link turned by a quarter about z: the arm (1, 0, 0) is (0, 1, 0), and turns at 2 rad/s."""
    quarter = np.array([[[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]])
    moves = np.array([[[1.0], [0.0], [0.0], [0.0], [0.0], [2.0]]])
    drift = np.array([[0.0, 0.0, 7.0, 0.0, 0.0, 5.0]])
    state = Terms(np.eye(1), np.zeros(1), quarter, np.array([[0.0, 0.0, 8.0]]), moves, drift)
    link = SimpleNamespace(position=np.array([1.0, 2.0, 3.0]))
    asked = simulation(tree=SimpleNamespace(links=[link]), at=SimpleNamespace(nv=1))
    place, jacobian, second = asked._end(state, np.ones(1), 0, np.array([2.0, 2.0, 3.0]))
    assert place.tolist() == [0.0, 1.0, 8.0] and jacobian[:, 0].tolist() == [-1.0, 0.0, 0.0, 0.0, 0.0, 2.0]
    assert second.tolist() == [-5.0, -4.0, 7.0, 0.0, 0.0, 5.0]
    anchor = np.array([1.0, 2.0, 3.0])
    place, jacobian, second = asked._end(state, np.ones(1), GROUND_LINK, anchor)
    assert place is anchor and not jacobian.any() and jacobian.shape == (6, 1) and not second.any()
    assert asked._rotation(state, GROUND_LINK).tolist() == np.eye(3).tolist()
    assert asked._rotation(state, 0) is not None and asked._rotation(state, 0)[1, 0] == 1.0
