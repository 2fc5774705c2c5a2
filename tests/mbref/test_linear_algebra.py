"""Factorisations of ``mbref.linear_algebra`` / numbers worked out by hand, and dense algebra by NumPy.

``test_thresholds.py`` runs this file in a process whose kernels are interpreted, so that nothing is compiled.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from mbref.kernels.compilation import PLAIN

if not PLAIN:
    pytest.skip("kernels are interpreted by test_thresholds.py", allow_module_level=True)

from mbref.linear_algebra import elimination
from mbref.linear_algebra import orthogonal_factorisations as orthogonal
from mbref.linear_algebra import symbolic_factorisation as patterns


# --- elimination ------------------------------------------------------------------------------------------
def test_lu_factors_with_partial_pivoting():
    """Pivots 8, -3/4 and -2/3 of a matrix inside a larger one."""
    a = np.full((4, 4), 9.0)
    a[:3, :3] = [[2, 1, 1], [4, 3, 3], [8, 7, 9]]
    pivots = np.full(4, 7)
    assert elimination.lu_factor(a, 3, pivots, 0.0)
    assert pivots.tolist() == [2, 2, 2, 7] and (a[3] == 9.0).all() and (a[:, 3] == 9.0).all()
    assert a[0, :3].tolist() == [8.0, 7.0, 9.0] and a[1, :3].tolist() == [0.25, -0.75, -1.25]
    assert a[2, :3] == pytest.approx([0.5, 2 / 3, -2 / 3])
    b = np.array([7.0, 19.0, 49.0, 5.0])
    elimination.lu_solve(a, 3, pivots, b)
    assert b == pytest.approx([1.0, 2.0, 3.0, 5.0])


@pytest.mark.parametrize(("least", "good"), [(0.5, False), (0.49, True), (math.nan, False), (-1.0, True)])
def test_pivots_that_are_too_small(least, good):
    a = np.diag([4.0, -0.5])
    assert elimination.lu_factor(a, 2, np.zeros(2, int), least) is good


def test_the_first_of_equal_rows_is_the_pivot():
    a, pivots = np.array([[1.0, 5.0], [-1.0, 2.0]]), np.zeros(2, int)
    assert elimination.lu_factor(a, 2, pivots, 0.0) and pivots.tolist() == [0, 1]
    assert a.tolist() == [[1.0, 5.0], [-1.0, 7.0]]


@pytest.mark.parametrize(
    ("part", "number", "size", "left"),
    [
        (2.0, -3.0, 0.5, 6.0),
        (1.5e-150, 1.0, 0.5, 1.5e-150),
        (1e-150, 1.0, 0.5 + math.log(1e-150), 1.0),
        (1e150, 1.0, 0.5 + math.log(1e150), 1.0),
        (1.5e150, 1.0, 0.5 + math.log(1.5e150), 1.0),
        (0.9e150, 1.0, 0.5, 0.9e150),
        (1e10, 0.0, 0.5, 1e10 * 1e-150),
        (1e10, 1.2e-150, 0.5, 1e10 * 1.2e-150),
    ],
)
def test_products_whose_logarithm_is_put_off(part, number, size, left):
    assert elimination.multiplied(0.5, part, number) == (pytest.approx(size), left)


@pytest.mark.parametrize(
    ("rows", "negative", "size"),
    [
        ([[0.0, 2.0], [3.0, 0.0]], True, math.log(6)),
        ([[2.0, 0.0], [0.0, 3.0]], False, math.log(6)),
        ([[-2.0, 1.0], [0.0, 3.0]], True, math.log(6)),
        ([[0.0, 2.0], [-3.0, 0.0]], False, math.log(6)),
        ([[0.0, 1.0], [0.0, 2.0]], False, math.log(1e-150) + math.log(2)),
        ([[1e-150, 1.0], [1e-150, 3.0]], False, math.log(1e-150) + math.log(3)),
        ([[1.5e-150, 1.0], [1.5e-150, 3.0]], False, math.log(1.5e-150) + math.log(2)),
        ([[1e-155, 1e155], [1e-155, 3e155]], False, math.log(1e-150) + math.log(3e155)),
    ],
)
def test_sign_and_size_of_a_determinant(rows, negative, size):
    """A first pivot up to 1e-150 counts as zero, and nothing is eliminated with it."""
    a = np.full((3, 3), 7.0)
    a[:2, :2] = rows
    assert elimination.determinant(a, 2) == (negative, pytest.approx(size))
    assert (a[2] == 7.0).all() and (a[:, 2] == 7.0).all()
    assert not elimination.product_of_pivots(np.array([0.0, 2.0]), 2)[0]


def test_the_first_of_equal_entries_is_the_pivot():
    a, rows, columns = np.array([[2.0, -2.0], [2.0, 1.0]]), np.zeros(2, int), np.zeros(2, int)
    assert elimination.full_pivot(a, 2, 2, rows, columns, 0.0) == 2
    assert rows.tolist() == [0, 1] and columns.tolist() == [0, 1] and a.tolist() == [[2.0, -2.0], [1.0, 3.0]]
    a, rows, columns = np.array([[0.25, 0.0], [0.0, 0.5], [0.0, 0.0]]), np.zeros(3, int), np.zeros(2, int)
    assert elimination.full_pivot(a, 3, 2, rows, columns, 1e-9) == 2
    assert rows.tolist() == [1, 0, 2] and columns.tolist() == [1, 0]
    assert elimination.full_pivot(np.zeros((2, 2)), 2, 2, rows, columns, 0.0) == 0


def test_back_substitution_reads_the_upper_triangle():
    r = np.full((4, 4), 99.0)
    r[:3, :3] = [[2, 1, 1], [99, 4, 2], [99, 99, 5]]
    x = np.array([7.0, 14.0, 15.0, 8.0])
    elimination.back_substitute(r, 3, x)
    assert x.tolist() == [1.0, 2.0, 3.0, 8.0]


def test_the_upper_half_of_a_product_with_the_transpose():
    s = np.full((3, 3), 7.0)
    elimination.gram(np.array([[1.0, 2.0, 0.0], [3.0, 0.0, 4.0]]), s)
    assert s.tolist() == [[10.0, 2.0, 12.0], [7.0, 4.0, 0.0], [7.0, 7.0, 16.0]]


def test_symmetric_factors_without_roots():
    upper, d = np.array([[1.0, 2, 3, 0], [0, 1, 4, 2], [0, 0, 1, 1], [0, 0, 0, 1]]), np.array([2.0, 4, 5, 8])
    full, x = (upper.T * d) @ upper, np.array([1.0, -2.0, 3.0, 0.5])
    a = np.full((5, 5), 7.0)
    a[:4, :4] = np.triu(full) + np.tril(np.full((4, 4), 7.0), -1)
    assert elimination.cholesky_factor(a, 4)
    assert a[:4, :4] == pytest.approx(np.triu(upper, 1) + np.diag(1 / d) + np.tril(np.full((4, 4), 7.0), -1))
    assert (a[4] == 7.0).all() and (a[:, 4] == 7.0).all()
    b = np.append(full @ x, 6.0)
    elimination.cholesky_solve(a, 4, b)
    assert b == pytest.approx([*x, 6.0])
    for last in (0.0, -1.0, math.nan):
        assert not elimination.cholesky_factor(np.diag([1.0, last]), 2)


# --- orthogonalisation ------------------------------------------------------------------------------------
def test_the_first_of_the_largest_entries():
    values = np.array([9.0, 1.0, 5.0, 5.0, 8.0])
    assert orthogonal.largest_from(values, 1, 4) == 2 and orthogonal.largest_from(values, 0, 5) == 0
    assert orthogonal.largest_from(values, 4, 5) == 4


@pytest.mark.parametrize("head", [3.0, -3.0, 0.0])
def test_a_reflector_below_a_row(head):
    """The column (head, 4, 0) below the first row becomes (∓ its length, 0, 0); others are reflected, too."""
    b = np.array([[1.0, 2.0, 3.0], [9.0, head, 1.0], [9.0, 4.0, 2.0], [9.0, 0.0, 7.0]])
    norm, tau, work = math.hypot(head, 4.0), np.full(3, 8.0), np.zeros(3)
    end = -norm if head > 0 else norm
    v = np.array([head - end, 4.0, 0.0])
    mirrored = np.array([1.0, 2.0, 7.0]) - 2 * v * (v @ [1.0, 2.0, 7.0]) / (v @ v)
    orthogonal.reflect(b, 4, 3, 1, norm, tau, work)
    assert b[0].tolist() == [1.0, 2.0, 3.0] and b[:, 0].tolist() == [1.0, 9.0, 9.0, 9.0]
    assert b[1:, 1] == pytest.approx([end, *(v[1:] / v[0])]) and b[1:, 2] == pytest.approx(mirrored)
    assert tau.tolist() == [8.0, pytest.approx(2 * v[0] ** 2 / (v @ v)), 8.0]


def test_rows_of_unit_length():
    """M^(-1/2) = (1, 1/2): rows (3, 2), zero and (1, 0)."""
    d, scale = np.full((3, 2), 7.0), np.full(3, 7.0)
    orthogonal.equilibrate(np.array([[3.0, 4.0], [0.0, 0.0], [2.0, 0.0]]), np.array([1.0, 0.5]), d, scale)
    assert scale == pytest.approx([1 / math.sqrt(13), 1.0, 0.5])
    assert d == pytest.approx(np.array([[3 / math.sqrt(13), 2 / math.sqrt(13)], [0.0, 0.0], [1.0, 0.0]]))


@pytest.mark.parametrize(("tolerance", "independent"), [(0.59, True), (0.61, False)])
def test_gram_schmidt_of_nearly_dependent_rows(tolerance, independent):
    """The second row, of length 4, keeps 2.4 beside the first."""
    a = np.array([[4.0, 0.0], [3.2, 2.4]])
    assert orthogonal.gram_schmidt(a, np.zeros((2, 2)), tolerance) is independent
    assert not orthogonal.gram_schmidt(np.array([[4.0, 0.0], [0.0, 0.0]]), np.zeros((2, 2)), tolerance)


def test_gram_schmidt_with_the_largest_row_first():
    """Rows of lengths 1, 5 and 2, with parts 4 and 0 along the second."""
    a = np.array([[0.6, 0.8, 0.0], [0.0, 5.0, 0.0], [0.0, 0.0, -2.0]])
    order, r, first = np.full(3, 7), np.full((3, 3), 7.0), a.copy()
    assert orthogonal.gram_schmidt_pivoted(a, 3, order, r, 0.1) == 3
    assert order.tolist() == [1, 2, 0] and r.T @ a == pytest.approx(first[order])
    assert np.tril(r, -1).tolist() == np.zeros((3, 3)).tolist()
    assert np.diag(r) == pytest.approx([5.0, 2.0, 0.6]) and r[0, 2] == pytest.approx(0.8)


@pytest.mark.parametrize(
    ("rows", "tolerance", "rank", "order"),
    [
        ([[0.1, 0.0], [0.0, 0.05]], 0.5, 1, [0, 1]),
        ([[0.1, 0.0], [0.0, 0.05]], 0.49, 2, [0, 1]),
        ([[0.25, 0.0], [0.0, 0.25]], 0.5, 2, [0, 1]),
        ([[0.0, 0.0], [0.0, 0.0]], 0.0, 0, [0, 1]),
        ([[1.0, 0.0], [0.0, 2.0], [3.0, 0.0]], 0.0, 2, [2, 1, 0]),
    ],
)
def test_rank_by_gram_schmidt(rows, tolerance, rank, order):
    a, found = np.array(rows), np.full(len(rows), 7)
    r = np.full((len(rows), len(rows)), 7.0)
    assert orthogonal.gram_schmidt_pivoted(a, len(rows), found, r, tolerance) == rank
    assert found.tolist() == order


def test_pseudo_inverse_by_singular_values():
    """Singular values 2 and 1; the residual of a third row that contradicts remains."""
    d = np.array([[0.0, 2.0], [1.0, 0.0], [0.0, 0.0]])
    for tolerance, rank, x, dual, left in (
        (0.49, 2, [3.0, 4.0], [2.0, 3.0, 0.0], [0.0, 0.0, 5.0]),
        (0.5, 1, [0.0, 4.0], [2.0, 0.0, 0.0], [0.0, 3.0, 5.0]),
    ):
        rhs, found, multipliers = np.array([8.0, 3.0, 5.0]), np.full(2, 7.0), np.full(3, 7.0)
        assert orthogonal.svd_solve(d, rhs, tolerance, found, multipliers) == rank
        assert found == pytest.approx(x) and multipliers == pytest.approx(dual) and rhs == pytest.approx(left)


@pytest.mark.parametrize(("value", "rank"), [(math.nan, -1), (math.inf, -1), (1.0, 1)])
def test_singular_values_of_numbers_that_are_none(value, rank):
    x, dual = np.full(1, 7.0), np.full(1, 7.0)
    assert orthogonal.svd_solve(np.array([[value]]), np.ones(1), 1e-9, x, dual) == rank
    assert x.tolist() == dual.tolist() == [1.0 if rank > 0 else 0.0]
    nothing = np.zeros(0)
    assert orthogonal.svd_solve(np.zeros((0, 1)), nothing, 1e-9, x, nothing) == 0 and x.tolist() == [0.0]


def test_one_step_of_refinement_after_singular_values(monkeypatch):
    """Singular values that are off by 1 % leave 1e-4 of the solution."""
    svd = np.linalg.svd

    def rough(d: np.ndarray, full_matrices: bool) -> Any:
        u, s, vt = svd(d, full_matrices=full_matrices)
        return u, 1.01 * s, vt

    monkeypatch.setattr(np.linalg, "svd", rough)
    x, dual = np.zeros(2), np.zeros(2)
    orthogonal.svd_solve(np.diag([2.0, 5.0]), np.array([8.0, 5.0]), 1e-9, x, dual)
    off = 1 - (0.01 / 1.01) ** 2
    assert x == pytest.approx([4.0 * off, off], rel=1e-12)


def test_a_pseudo_solution_is_added():
    """u = (0.6, 0, 0.8), s = 2, v = (0, 1): (1 · 0.6 + 2 · 0.8) / 2 = 1.1, and half of that by rows."""
    u, vt = np.array([[0.6, 0.8], [0.0, 0.0], [0.8, -0.6]]), np.array([[0.0, 1.0], [9.0, 9.0]])
    x, dual = np.array([1.0, 2.0]), np.array([10.0, 20.0, 30.0])
    orthogonal.add_pseudo_solution(u, np.array([2.0, 9.0]), vt, 1, np.array([1.0, 7.0, 2.0]), x, dual)
    assert x == pytest.approx([1.0, 3.1]) and dual == pytest.approx([10.33, 20.0, 30.44])
    x, dual = np.zeros(4), np.zeros(1)
    wide = np.array([[0.0, 0.6, 0.0, -0.8]])
    orthogonal.add_pseudo_solution(np.ones((1, 1)), np.array([4.0]), wide, 1, np.array([8.0]), x, dual)
    assert x == pytest.approx([0.0, 1.2, 0.0, -1.6]) and dual == pytest.approx([0.5])


# --- patterns of factors ----------------------------------------------------------------------------------
ROWS, COLUMNS, PLACES = np.array([7, 7, 4, 4, 9]), np.array([0, 2, 2, 3, 0]), np.array([70, 72, 42, 43, 90])


def test_patterns_of_nothing():
    made = patterns.empty_factor()
    assert made.d.size == made.l.size == made.root.size == made.step.size == 0
    assert made.symbolic.l_start.tolist() == [0] and made.symbolic.d_start.tolist() == [0]


def test_indices_of_32_bits():
    assert patterns.unsigned([0, 2**32 - 1]).tolist() == [0, 4294967295]
    assert patterns.unsigned(np.zeros(0)).dtype == np.uint32
    with pytest.raises(OverflowError, match="too large for 32-bit indices"):
        patterns.unsigned([2**32])
