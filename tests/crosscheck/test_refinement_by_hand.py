"""Iterative refinement of the reference / inverses that leave a known part of each error.

An inverse that leaves a part r of an error gives corrections with the ratio r. So the number of corrections
follows from r and from the limits of each iteration.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.judge.arithmetic import DOUBLE
from crosscheck.judge.reference import saddle_point, start_velocities, vectors
from crosscheck.judge.reference.saddle_point import SaddlePoint, Sparse
from crosscheck.judge.reference.start_velocities import least_squares, null_space


@pytest.fixture
def asked(monkeypatch) -> list[int]:
    """An entry for each correction."""
    found: list[int] = []
    for module in (saddle_point, start_velocities, vectors):
        monkeypatch.setattr(module, "ask", lambda: found.append(1))
    return found


# --- saddle points ----------------------------------------------------------------------------------------
def solved(monkeypatch: pytest.MonkeyPatch, steps: Any, wanted: Any = (1.0, 1.0, 1.0), eps: float = 2.0**-52):
    """x = wanted, by corrections ``steps(k, right-hand side)``."""
    count = iter(range(99))
    monkeypatch.setattr(saddle_point, "dgetrs", lambda lu, order, right: (steps(next(count), right), 0))
    numbers = SimpleNamespace(eps=eps, zeros=DOUBLE.zeros, settled=DOUBLE.settled)
    system = SaddlePoint(np.eye(1), np.zeros((0, 3, 1)), np.zeros(0), numbers)
    x, y = system.solve(np.array(wanted)[:, None], np.zeros(0))
    assert x.shape == (3, 1) and y.shape == (0,)
    return x[:, 0]


@pytest.mark.parametrize(("bits", "eps", "count"), [(10, -52, 6), (10, -49, 5), (20, -52, 3), (20, -63, 4)])
def test_refinement_ends_before_a_correction_below_rounding(monkeypatch, asked, bits, eps, count):
    """Corrections are r^k; the next one is estimated as c² / c before: r^(k + 1)."""
    part = 2.0**-bits
    x = solved(monkeypatch, lambda k, right: (1 - part) * right, eps=2.0**eps)
    assert len(asked) == count and x == pytest.approx([1.0] * 3, abs=1e-14)


def test_refinement_ends_where_corrections_stall(monkeypatch, asked):
    """With r = 0.6 corrections are 1, 3/8, 9/49 and 54/544 of the solution; the last one is above a half."""
    x = solved(monkeypatch, lambda k, right: 0.4 * right)
    assert len(asked) == 4 and x == pytest.approx([1 - 0.6**4] * 3)


def test_forty_corrections_at_most(monkeypatch, asked):
    x = solved(monkeypatch, lambda k, right: 0.55 * right, eps=0.0)
    assert len(asked) == 40 and x == pytest.approx([1.0] * 3)


def test_a_correction_of_half_the_one_before_is_no_stall(monkeypatch, asked):
    """x₂ is 1/2, then 0: this correction is half of the first one."""
    steps = [[1.0, 0.5, 0.0], [0.0, -1.0, 0.0], [0.0, 1.0, 0.0]]
    assert solved(monkeypatch, lambda k, right: np.array(steps[k]), (1.0, 1.0, 0.0)).tolist() == [1, 1, 0]
    assert len(asked) == 3


@pytest.mark.parametrize(("bits", "count"), [(10, 2), (11, 3)])
def test_refinement_ends_where_the_next_correction_is_rounding(monkeypatch, asked, bits, count):
    """Corrections of 1 and 2^-5: the next one would be 2^-10."""
    wanted, steps = (1.0, 2.0**-5, 0.0), [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    x = solved(monkeypatch, lambda k, right: np.array(steps[k]), wanted, eps=2.0**-bits)
    assert x.tolist() == list(wanted) and len(asked) == count


def test_nothing_is_solved_for_zero(monkeypatch, asked):
    assert solved(monkeypatch, None, (0.0, 0.0, 0.0)).tolist() == [0.0] * 3 and len(asked) == 1


def test_rows_and_columns_are_scaled_by_their_largest_entries():
    """4 x + y = 12 and x - 16 y = 3 of the first coordinate: x = 3, y = 0."""
    rows = np.array([[[1.0], [0.0], [0.0]]])
    system = SaddlePoint(np.array([[4.0]]), rows, np.array([16.0]), DOUBLE)
    assert system._scale == pytest.approx([0.5, 0.5, 0.5, 0.25])
    x, y = system.solve(np.array([[12.0], [8.0], [-4.0]]), np.array([3.0]))
    assert x[:, 0] == pytest.approx([3.0, 2.0, -1.0]) and y == pytest.approx([0.0], abs=1e-15)


def test_products_with_a_matrix_that_has_an_empty_row():
    matrix = np.array([[0.0, 2.0, 3.0], [0.0, 0.0, 0.0], [5.0, 0.0, 0.0]])
    vectors_ = np.array([[[1.0, 10.0, 100.0], [2.0, 20.0, 200.0]]])
    assert Sparse(matrix)(vectors_).tolist() == [[[320.0, 0.0, 5.0], [640.0, 0.0, 10.0]]]
    assert Sparse(np.zeros((2, 3)))(vectors_).tolist() == [[[0.0, 0.0], [0.0, 0.0]]]


# --- velocities at the start ------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("squares", "count", "found"),
    [
        ((0.75, 0.0), 40, 1.0),
        ((0.25, 0.25), 2, 0.5),
        ((0.4, 0.0), 2, 0.4),
    ],
)
def test_corrections_of_least_squares(monkeypatch, asked, squares, count, found):
    """x = 1 from two rows; a pseudo-inverse (a, b) leaves 1 - a² - b² of the error."""
    monkeypatch.setattr(np.linalg, "pinv", lambda matrix, rcond: np.sqrt([squares]))
    x = least_squares(DOUBLE, np.array([[1.0], [0.0]]), np.array([1.0, 0.0]))
    assert x == pytest.approx([found]) and len(asked) == count


def test_least_squares_of_rows_that_contradict():
    """x = 1 and x = 3: x = 2. A row below 1e-9 of the largest counts as zero."""
    assert least_squares(DOUBLE, np.array([[1.0], [1.0]]), np.array([1.0, 3.0])) == pytest.approx([2.0])
    for small, found in ((1.1e-9, 1.0), (0.9e-9, 0.0)):
        x = least_squares(DOUBLE, np.diag([1.0, small]), np.array([5.0, small]))
        assert x == pytest.approx([5.0, found])


@pytest.mark.parametrize(("part", "count"), [(0.75, 40), (0.5, 2), (0.4, 2)])
def test_corrections_of_a_null_space(monkeypatch, asked, part, count):
    """The null space of (1, 0) is (0, 1); the first basis has 1/4 along x, and corrections take a part."""
    turned = np.array([[1.0, 0.0], [0.25, 1.0]])
    monkeypatch.setattr(np.linalg, "svd", lambda matrix, full_matrices: (None, np.ones(1), turned))
    monkeypatch.setattr(np.linalg, "pinv", lambda matrix, rcond: np.array([[part], [0.0]]))
    basis = null_space(DOUBLE, np.array([[1.0, 0.0]]))
    left = 0.25 * (1 - part) ** (count - 1 if count < 40 else 40)
    assert basis[:, 0] == pytest.approx([left, 1.0], abs=1e-18) and len(asked) == count


def test_a_row_at_the_limit_of_the_rank_is_in_the_null_space():
    for small, free in ((1.1e-9, 0), (0.9e-9, 1)):
        assert null_space(DOUBLE, np.diag([1.0, small])).shape == (2, free)
    assert null_space(DOUBLE, np.zeros((0, 2))).shape == (2, 2)


# --- systems of many samples ------------------------------------------------------------------------------
@pytest.mark.parametrize(("part", "count", "found"), [(0.5, 2, 0.5), (0.4, 2, 0.4), (0.51, 40, 1.0)])
def test_corrections_of_many_samples(monkeypatch, asked, part, count, found):
    """An inverse that takes a part of the error; corrections must be below half of the one before."""
    inverse = np.array([[[part]]])
    monkeypatch.setattr(vectors, "_scaled_inverse", lambda mass, rows: (np.ones((1, 1)), inverse))
    x, distance = vectors.saddle_solve(
        np.ones((1, 1, 1)), np.zeros((1, 0, 1)), np.ones((1, 1)), np.zeros((1, 0))
    )
    assert x[0] == pytest.approx([found]) and len(asked) == count
    assert distance == pytest.approx([part**-0.5])


def test_each_sample_is_corrected_as_long_as_it_settles(monkeypatch, asked):
    """The first sample stalls at once, the second settles."""
    inverse = np.array([[[0.4]], [[1.0]]])
    monkeypatch.setattr(vectors, "_scaled_inverse", lambda mass, rows: (np.ones((2, 1)), inverse))
    x, _ = vectors.saddle_solve(
        np.ones((2, 1, 1)), np.zeros((2, 0, 1)), np.array([[1.0], [3.0]]), np.zeros((2, 0))
    )
    assert x[:, 0] == pytest.approx([0.4, 3.0]) and len(asked) == 3


def test_singular_systems_are_regularised():
    """Without a mass the scaled matrix is 1e-15, without a row -1e-15."""
    _, inverse = vectors._scaled_inverse(np.zeros((1, 1, 1)), np.zeros((1, 0, 1)))
    assert inverse[0, 0, 0] == pytest.approx(1e15)
    scale, inverse = vectors._scaled_inverse(np.full((1, 1, 1), 4.0), np.zeros((1, 1, 1)))
    assert inverse[0] == pytest.approx(np.diag([1.0, -1e15])) and scale[0] == pytest.approx([0.5, 1.0])
    scale, _ = vectors._scaled_inverse(np.full((2, 1, 1), 4.0), np.array([[[0.0]], [[6.0]]]))
    assert scale == pytest.approx(np.array([[0.5, 1 / 3]] * 2)), "of the largest row of all samples"
