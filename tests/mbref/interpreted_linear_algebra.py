"""Factorisations of ``mbref.linear_algebra`` / numbers worked out by hand, and dense algebra by NumPy.

``test_thresholds.py`` runs this file in a process whose kernels are interpreted, so that nothing is compiled.
"""

from __future__ import annotations

import hashlib
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.sparse import csr_array

from mbref.kernels.compilation import PLAIN

if not PLAIN:
    pytest.skip("kernels are interpreted by test_thresholds.py", allow_module_level=True)

from mbref.kernels.layout import NOT_CONVERGED, OK
from mbref.linear_algebra import elimination, minimum_norm, sparse_cholesky, sparse_lu
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


def of_qr(transposed: Any) -> Any:
    """Memory of ``qr_pivoted`` with old numbers in it."""
    a = np.array(transposed, dtype=float)
    n, m = a.shape
    return SimpleNamespace(
        transposed=a,
        order=np.full(m, 7),
        tau=np.full(m, 7.0),
        work=np.full(m, 7.0),
        norms=np.full((2, m), 7.0),
        b=np.zeros(m),
        x=np.full(n, 7.0),
        dual=np.full(m, 7.0),
    )


def test_qr_with_exchanges_reproduces_the_columns():
    a = np.array([[1.0, 0.0, 2.0, 1.0], [2.0, 1.0, -2.0, 1.0], [2.0, 5.0, 1.0, 1.0]])
    made = of_qr(a)
    assert orthogonal.qr_pivoted(1e-9, made) == 3 and made.order[0] == 1
    q = np.eye(3)
    for k in range(3):
        v = np.concatenate([np.zeros(k), [1.0], made.transposed[k + 1 :, k]])
        q = q @ (np.eye(3) - made.tau[k] * np.outer(v, v))
    assert q @ np.triu(made.transposed) == pytest.approx(a[:, made.order])
    assert abs(made.transposed[0, 0]) == pytest.approx(math.sqrt(26))
    assert sorted(made.order.tolist()) == [0, 1, 2, 3]


@pytest.mark.parametrize(("tolerance", "rank"), [(0.25, 1), (0.2499, 2)])
def test_rank_of_columns_by_their_remaining_norm(tolerance, rank):
    """Columns of the lengths 4 and 1: the second counts if it exceeds the tolerance times the first."""
    made = of_qr([[0.0, 4.0], [1.0, 0.0], [0.0, 0.0]])
    assert orthogonal.qr_pivoted(tolerance, made) == rank and made.order.tolist() == [1, 0]


@pytest.mark.parametrize(("share", "anew"), [(0.8e-4, True), (1.2e-4, False)])
def test_norms_are_computed_again_after_cancellation(share, anew):
    """The squares of the second column's parts along the first column and beside it."""
    side = math.sqrt(share)
    made = of_qr([[2.0, math.sqrt(1 - share)], [0.0, 0.6 * side], [0.0, -0.8 * side]])
    assert orthogonal.qr_pivoted(1e-9, made) == 2
    assert made.norms[0, 1] == pytest.approx(share, rel=1e-9)
    assert made.norms[1].tolist() == [4.0, pytest.approx(share if anew else 1.0)]


def test_norms_of_a_ten_thousandth_are_not_computed_again():
    """The squares 1111 and 11110000 = 3333² + 1111 have that ratio without rounding."""
    made = of_qr([[4000.0, 3333.0], [0.0, 33.0], [0.0, 4.0], [0.0, 2.0], [0.0, 1.0], [0.0, 1.0]])
    assert orthogonal.qr_pivoted(1e-9, made) == 2 and made.norms[:, 1].tolist() == [1111.0, 11110000.0]


def test_norms_are_exchanged_with_their_columns():
    """Lengths 1, 2 and 3: the largest column comes first, and the norms of the first go to its place."""
    made = of_qr(np.diag([1.0, 2.0, 3.0]))
    assert orthogonal.qr_pivoted(1e-9, made) == 3 and made.order.tolist() == [2, 1, 0]
    assert made.norms[:, 1:].tolist() == [[4.0, 1.0]] * 2
    made = of_qr([[3.0, 1.0, 0.0], [0.0, 0.0, 2.0], [0.0, 1.0, 0.0]])  # the second column keeps 1 of 2
    assert orthogonal.qr_pivoted(1e-9, made) == 3 and made.order.tolist() == [0, 2, 1]
    assert made.norms.tolist() == [[9.0, 1.0, 1.0], [9.0, 2.0, 2.0]]


def test_least_norm_and_multipliers_of_three_rows_of_rank_two():
    d, rhs = np.array([[1.0, 1.0, 0, 0], [0, 2.0, 0, 1.0], [1.0, 3.0, 0, 1.0]]), np.array([2.0, 5.0, 7.0])
    made = of_qr(d.T)
    made.b[:] = rhs
    assert orthogonal.qr_pivoted(1e-9, made) == 2
    orthogonal.minimum_norm(2, made)
    assert made.x == pytest.approx(np.linalg.pinv(d) @ rhs)
    orthogonal.row_multipliers(2, made)
    assert d.T @ made.dual == pytest.approx(made.x) and made.dual[made.order[2]] == 0.0


def test_rows_of_unit_length():
    """M^(-1/2) = (1, 1/2): rows (3, 2), zero and (1, 0)."""
    d, scale = np.full((3, 2), 7.0), np.full(3, 7.0)
    orthogonal.equilibrate(np.array([[3.0, 4.0], [0.0, 0.0], [2.0, 0.0]]), np.array([1.0, 0.5]), d, scale)
    assert scale == pytest.approx([1 / math.sqrt(13), 1.0, 0.5])
    assert d == pytest.approx(np.array([[3 / math.sqrt(13), 2 / math.sqrt(13)], [0.0, 0.0], [1.0, 0.0]]))


def test_gram_schmidt_in_the_order_of_rows(monkeypatch):
    """Row 1 = 2 q0 + 3 q1, row 2 = q0 - q1 + 4 q2, each made orthogonal twice."""
    calls, subtract = [], orthogonal.subtract_projection
    monkeypatch.setattr(
        orthogonal, "subtract_projection", lambda a, i, k, r: [calls.append((i, k)), subtract(a, i, k, r)]
    )
    a, r = np.array([[0.0, 5.0, 0.0], [3.0, 2.0, 0.0], [-1.0, 1.0, -4.0]]), np.full((3, 3), 7.0)
    assert orthogonal.gram_schmidt(a, r, 1e-9)
    assert a.tolist() == [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]
    assert r.tolist() == [[5.0, 2.0, 1.0], [7.0, 3.0, -1.0], [7.0, 7.0, 4.0]]
    assert calls == [(0, 1), (0, 1), (0, 2), (1, 2), (0, 2), (1, 2)]


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


def test_pseudo_inverse_by_gram_schmidt():
    d, b = np.array([[1.0, 1.0, 0, 0], [0, 2.0, 0, 1.0], [1.0, 3.0, 0, 1.0]]), np.array([2.0, -1.0, 0.5])
    n, m = 4, 3
    made = SimpleNamespace(
        columns=d.T.copy(),
        r=np.full((n, n), 7.0),
        l=np.full((n, n), 7.0),
        b=b,
        c=np.full(n, 7.0),
        order=np.full(n, 7),
        order_rows=np.full(n, 7),
        x=np.full(n, 7.0),
        dual=np.full(m, 7.0),
    )
    assert orthogonal.gram_schmidt_solve(1e-9, made) == 2
    inverse = np.linalg.pinv(d)
    assert made.x == pytest.approx(inverse @ b) and made.dual == pytest.approx(inverse.T @ inverse @ b)


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


# --- sparse factors ---------------------------------------------------------------------------------------
NUMBERS = np.array([0.0, 2.0, 1.0, 9.0, 3.0, 8.0])


def of_two_rows(numbers: Any = NUMBERS, inverse_root: Any = (0.0, 1.0, 2.0, 0.5)) -> Any:
    """D = [[1·1, 2·2, 0], [0, 3·2, 8·½]] of columns 1, 2, 3: S = [[17, 24], [24, 52]]; rows 5 and 4."""
    symbolic = SimpleNamespace(
        row=np.array([5, 4]),
        column=np.array([1, 2, 3]),
        d_start=np.array([0, 2, 4]),
        d_entry=np.array([2, 1, 4, 5]),
        d_column=np.array([0, 1, 1, 2]),
        s_start=np.array([0, 2, 3, 5]),
        s_left=np.array([0, 1, 2, 2, 3]),
        s_right=np.array([0, 1, 1, 2, 3]),
        l_start=np.array([0, 2, 3]),
        l_row=np.array([0, 1, 1]),
        update_start=np.array([0, 0, 0, 1]),
        update_left=np.array([1]),
        update_right=np.array([1]),
    )
    made = SimpleNamespace(symbolic=symbolic, d=np.zeros(4), root=np.zeros(3))
    for name, size in (("l", 3), ("scaled", 3), ("change", 3)):
        setattr(made, name, np.full(size, 7.0))
    for name in ("diagonal", "squared_pivots", "step", "total", "residual", "direction"):
        setattr(made, name, np.full(2, 7.0))
    sparse_cholesky.assemble_gradients(made, np.asarray(numbers, float), np.asarray(inverse_root, float))
    return made


D = np.array([[1.0, 4.0, 0.0], [0.0, 6.0, 4.0]])


def test_scaled_gradients_and_their_products():
    made = of_two_rows()
    assert made.root.tolist() == [1.0, 2.0, 0.5] and made.d.tolist() == [1.0, 4.0, 6.0, 4.0]
    assert [sparse_cholesky.product_of_rows(made, entry) for entry in range(3)] == [17.0, 24.0, 52.0]
    b, x = np.array([100.0, 200.0]), np.array([1.0, 2.0, 3.0])
    sparse_cholesky.subtract_product(made, x, b)
    assert b.tolist() == [91.0, 176.0]
    sparse_cholesky.times_transpose(made, np.array([2.0, 3.0]), x)
    assert x.tolist() == [2.0, 26.0, 12.0]
    sparse_cholesky.add_transpose(made, np.array([1.0, 1.0]), x)
    assert x.tolist() == [3.0, 36.0, 16.0]


def test_the_factor_of_two_rows():
    """α = 4: S + diag(S)/4 = [[21.25, 24], [24, 65]], the pivots 21.25 and 65 - 24²/21.25."""
    made, b, below = of_two_rows(), np.array([2.0, 5.0]), 24 / 21.25
    last = 65 - 24 * below
    assert sparse_cholesky.factorise(made, 4.0, b)
    assert made.diagonal.tolist() == [21.25, 65.0] and made.scaled[1] == 24.0
    assert made.l == pytest.approx([1 / 21.25, below, 1 / last]) and b == pytest.approx([2.0, 5 - 2 * below])
    sparse_cholesky.find_squared_pivots(made)
    assert made.squared_pivots == pytest.approx([1.0, last / 65])
    assert sparse_cholesky.least_squared_pivot(made) == pytest.approx(last / 65)
    full, rhs = np.array([[21.25, 24.0], [24.0, 65.0]]), np.array([3.0, -1.0])
    solution = rhs.copy()
    sparse_cholesky.solve(made, solution)
    assert full @ solution == pytest.approx(rhs)
    forward = rhs.copy()
    assert sparse_cholesky.substitute_forward(made, forward) == pytest.approx(rhs @ solution)
    assert forward == pytest.approx([3.0, -1 - 3 * below])


def test_factors_that_do_not_exist_and_rows_without_entries():
    made = of_two_rows([0.0, 2.0, 1.0, 9.0, 2.0, 2.0])  # rows (1, 4, 0) and (0, 4, 1)
    assert not sparse_cholesky.factorise(made, -2.0, np.zeros(2)), "8.5 and 8.5 - 16²/8.5"
    same = of_two_rows([0.0, 2.0, 0.0, 9.0, 2.0, 0.0])
    assert not sparse_cholesky.factorise(same, math.inf, np.zeros(2)), "the second pivot is zero"
    empty = of_two_rows([0.0, 2.0, 1.0, 9.0, 0.0, 0.0])
    made.step[:] = 5.0
    numbers, root = np.array([0.0, 2.0, 1.0, 9.0, 0.0, 0.0]), np.array([0.0, 1.0, 2.0, 0.5])
    assert sparse_cholesky.regularised_factor(empty, numbers, root, 1e10)
    assert empty.diagonal == pytest.approx([17.0, 1.0]) and empty.step.tolist() == [0.0, 0.0]
    assert sparse_cholesky.least_squared_pivot(empty) == pytest.approx(1.0)
    empty.diagonal = np.zeros(0)
    assert sparse_cholesky.least_squared_pivot(empty) == 1.0


def test_the_factors_of_a_product_of_two_gradients():
    """D D̃ᵀ + diag(D Dᵀ)/α of D̃ = [[2, 1, 0], [0, -1, 3]] and α = 2: [[6 + 8.5, -4], [6, 6 + 26]]."""
    made, other = of_two_rows(), np.array([2.0, 1.0, -1.0, 3.0])
    product = SimpleNamespace(lower=np.zeros(3), upper=np.zeros(3), pivots=np.zeros(2))
    sparse_lu.factorise_product(made, other, 2.0, product)
    last = 32 - 6 * -4 / 14.5
    assert product.pivots == pytest.approx([14.5 / 17, last / 52])
    assert product.lower[1] == pytest.approx(6 / 14.5) and product.upper[1] == -4.0
    # the first pivot is zero, and α / 17 takes its place
    other[:2] = -8.5, 0.0
    sparse_lu.factorise_product(made, other, 2.0, product)
    assert product.pivots[0] == 0.0 and product.lower[1] == 0.0
    other[:2] = -12.5, 1.0
    sparse_lu.factorise_product(made, other, 2.0, product)
    assert product.pivots[0] == 0.0 and product.lower[1] == pytest.approx(6.0 * 2 / 17)
    empty = of_two_rows([0.0, 2.0, 1.0, 9.0, 0.0, 0.0])
    sparse_lu.factorise_product(empty, np.array([2.0, 1.0, 0.0, 0.0]), 2.0, product)
    assert product.pivots == pytest.approx([14.5 / 17, 0.5]), "a row without entries"


# --- solutions of least norm ------------------------------------------------------------------------------
def of_one_row(alpha: float, residual: float = 1.0) -> Any:
    """Memory of the row D = (1,) of column 1, whose M^(-1/2) is 1/2, with S + I/α; row 2 of three."""
    symbolic = SimpleNamespace(
        row=np.array([2]),
        column=np.array([1]),
        d_start=np.array([0, 1]),
        d_entry=np.array([0]),
        d_column=np.array([0]),
        s_start=np.array([0, 1]),
        s_left=np.array([0]),
        s_right=np.array([0]),
        l_start=np.array([0, 1]),
        l_row=np.array([0]),
        update_start=np.array([0, 0]),
        update_left=np.array([], int),
        update_right=np.array([], int),
    )
    made = SimpleNamespace(symbolic=symbolic, d=np.zeros(1), root=np.zeros(1))
    for name in ("l", "scaled", "change", "diagonal", "total", "direction"):
        setattr(made, name, np.full(1, 7.0))
    made.residual = np.array([residual])
    made.step = np.array([residual])
    sparse_cholesky.assemble_gradients(made, np.array([2.0]), np.array([9.0, 0.5]))
    assert sparse_cholesky.factorise(made, alpha, made.step)
    return made


@pytest.mark.parametrize(
    ("epsilon", "most", "count", "status"),
    [
        (0.0161, 20, 2, OK),
        (0.0159, 20, 3, OK),
        (0.5, 20, 2, OK),
        (0.5, 1, 1, OK),
        (0.39, 1, 1, NOT_CONVERGED),
        (0.0031, 3, 3, NOT_CONVERGED),
        (0.0033, 3, 3, OK),
        (0.0, 0, 0, NOT_CONVERGED),
    ],
)
def test_iterations_until_the_next_change_is_small(epsilon, most, count, status):
    """α = 4: each iteration leaves a fifth; changes 0.4, 0.08, 0.016 of the target 0.5.

    The change after the second is estimated as 0.08 · 0.2 = 0.016, the one after the third as 0.0032.
    """
    made, target, multipliers = of_one_row(4.0), np.array([5.0, 0.0]), np.full(3, 7.0)
    assert minimum_norm.solve_to_tolerance(made, epsilon, most, target, multipliers) == status
    done = 1 - 0.2**count
    assert target == pytest.approx([5.0, 0.5 * done]) and multipliers == pytest.approx([7.0, 7.0, -done])


@pytest.mark.parametrize(
    ("changes", "epsilon", "count"),
    [
        ([0.5, 0.25], 0.125, 2),  # the next change is estimated as 0.125
        ([0.5, 0.25, 0.125], math.nextafter(0.125, 0.0), 3),
        ([0.25, 0.5], 0.25, 2),  # the least estimate counts; a change that grows is no factor
        ([0.25, 0.5, 0.125], 0.1, 3),
        ([0.0, 0.0], 0.0, 2),
    ],
)
def test_iterations_end_at_the_estimate_of_the_next_change(monkeypatch, changes, epsilon, count):
    made, left = of_one_row(4.0), list(changes)
    monkeypatch.setattr(minimum_norm, "change_by_step", lambda factor, target: left.pop(0))
    assert minimum_norm.solve_to_tolerance(made, epsilon, 9, "target", np.zeros(3)) == OK
    assert len(changes) - len(left) == count


def test_a_change_is_relative_to_a_target_longer_than_one():
    """A change of 0.4 to (0, 3) and to (0, 0.5): relative to 3, and to 1."""
    made = of_one_row(4.0)
    for before, size in ((2.6, 0.4 / 3), (0.1, 0.4), (-1.4, 0.4)):
        made.residual[:] = 1.0
        target = np.array([0.0, before])
        assert minimum_norm.iterate(made, target) == pytest.approx(size)
        assert target == pytest.approx([0.0, before + 0.4]) and made.change == pytest.approx([0.8])


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_a_fixed_number_of_iterations(count):
    made, target = of_one_row(4.0), np.zeros(2)
    minimum_norm.solve_fixed_iterations(made, count, target)
    assert target == pytest.approx([0.0, 0.5 * (1 - 0.2**count)])
    assert made.residual[0] == pytest.approx(1.0 if count < 2 else 0.2 ** (count - 1))


def test_norms_of_targets_and_inner_products():
    made = of_one_row(4.0)
    assert minimum_norm.norm_of(np.array([9.0, -2.0]), made) == 4.0
    assert minimum_norm.norm_of(np.array([9.0, 0.2]), made) == 1.0
    assert minimum_norm.product(np.array([1.0, 2.0]), np.array([3.0, -4.0])) == -5.0
    assert minimum_norm.product(np.zeros(0), np.zeros(0)) == 0.0


def test_a_length_along_the_direction():
    made, target, multipliers = of_one_row(4.0), np.array([5.0, 1.0]), np.full(3, 7.0)
    made.direction[:], made.total[:], made.change[:] = 3.0, 10.0, 4.0
    minimum_norm.go_along(0.5, made, target, multipliers)
    assert made.total.tolist() == [8.5] and multipliers.tolist() == [7.0, 7.0, 8.5]
    assert made.change.tolist() == [2.0] and target.tolist() == [5.0, 2.0]


def test_conjugate_directions_of_one_row():
    """The residual 1 - 0.8: one direction removes it, since one row needs one."""
    made, target, multipliers = of_one_row(4.0), np.zeros(2), np.zeros(3)
    made.change[:], made.total[:], made.direction[:] = 0.8, -0.8, 99.0
    target[1] = 0.4
    assert minimum_norm.go_on_by_conjugate_directions(made, 4.0, target, multipliers) == OK
    assert target == pytest.approx([0.0, 0.5]) and multipliers == pytest.approx([0.0, 0.0, -1.0])


@pytest.mark.parametrize(("share", "moved"), [(1.1, False), (0.9, True)])
def test_a_residual_of_rounding_is_left(share, moved):
    """Residual r: r² / 1.25 against α (1e-15 · 6)², since M^(1/2) target is 6."""
    made, target, multipliers = of_one_row(4.0), np.array([0.0, 3.0]), np.zeros(3)
    made.change[:], made.total[:] = 0.0, 0.0
    made.residual[:] = math.sqrt(1.25 * 4.0) * 6e-15 / share
    assert minimum_norm.go_on_by_conjugate_directions(made, 4.0, target, multipliers) == OK
    assert bool(multipliers[2]) is moved


@pytest.mark.parametrize(("size", "moves"), [(1.9e-11, False), (2.1e-11, True)])
def test_a_row_that_depends_on_others_is_left(monkeypatch, size, moves):
    """A direction whose change is its length times the row's size, against √α times 1e-11, with α = 4."""
    made, moved = of_one_row(4.0), []
    made.d[0], made.l[0], made.change[0] = size, 1.0, 0.0
    monkeypatch.setattr(
        minimum_norm, "go_along", lambda *given: moved.append(given[0]) or given[1].residual.fill(0)
    )
    assert minimum_norm.go_on_by_conjugate_directions(made, 4.0, np.zeros(2), np.zeros(3)) == OK
    assert bool(moved) is moves
    if moves:
        assert moved[0] == pytest.approx(1 / size**2)


def test_the_first_two_conjugate_directions(monkeypatch):
    """The first is (S + I/α)⁻¹ r; the second adds the first times the ratio of both rᵀ (S + I/α)⁻¹ r."""
    made, directions, residuals = of_two_rows(), [], []
    assert sparse_cholesky.factorise(made, 4.0, made.step)
    made.residual[:], made.change[:], made.total[:], made.direction[:] = (3.0, -1.0), 0.0, 0.0, 99.0
    go = minimum_norm.go_along

    def noted(length: float, factor: Any, target: Any, multipliers: Any) -> None:
        directions.append(factor.direction.copy())
        residuals.append(factor.residual.copy())
        go(length, factor, target, multipliers)

    monkeypatch.setattr(minimum_norm, "go_along", noted)
    monkeypatch.setattr(minimum_norm, "ITERATIONS", 2)
    assert minimum_norm.go_on_by_conjugate_directions(made, 4.0, np.zeros(4), np.zeros(6)) == NOT_CONVERGED
    solved = [np.linalg.solve(np.array([[21.25, 24.0], [24.0, 65.0]]), r) for r in residuals]
    ratio = (residuals[1] @ solved[1]) / (residuals[0] @ solved[0])
    assert directions[0] == pytest.approx(solved[0])
    assert directions[1] == pytest.approx(solved[1] + ratio * solved[0])
    length = (residuals[0] @ solved[0]) / (solved[0] @ D @ D.T @ solved[0])
    assert residuals[1] == pytest.approx(residuals[0] - length * D @ D.T @ solved[0])


@pytest.mark.parametrize("force", [8.0, -3.0])
def test_multipliers_nearest_to_forces(force):
    """Φ_qᵀ λ = force with the row (2,) of unit length 1 in D: x = force / 2 and λ = -x of D."""
    made, multipliers = of_one_row(4.0), np.full(3, 7.0)
    minimum_norm.find_least_multipliers(made, np.array([99.0, force]), multipliers)
    assert multipliers == pytest.approx([7.0, 7.0, force / 2]) and abs(made.change[0]) < 1e-12


@pytest.mark.parametrize(
    ("steps", "count"),
    [
        ([4.0, 1.0], 2),  # 1 is less than a quarter of 5
        ([4.0, 2.0, 1.0], 3),  # 2 is more than a quarter of 6, 1 less than a quarter of 7
        ([1.0, 2.0], 2),  # the change grows
        ([1.0, 1.0], 2),  # the change stays
        ([0.125, 0.0625, 0.03125], 3),
        ([8.0, 7.0, 6.0, 5.0], 3),  # the largest number of iterations
        ([0.0], 1),
    ],
)
def test_multipliers_are_improved_until_rounding_is_left(monkeypatch, steps, count):
    monkeypatch.setattr(minimum_norm, "LAST_CHANGE", 0.25)
    monkeypatch.setattr(minimum_norm, "ITERATIONS", 3)
    made, left, calls = of_one_row(4.0), list(steps), []

    def solve(factor: Any, b: np.ndarray) -> None:
        assert factor is made and b is made.step and b[0] == made.residual[0] == -1.5
        b[0] = left.pop(0)

    def subtract(factor: Any, x: np.ndarray, b: np.ndarray) -> None:
        assert factor is made and x is made.change and b is made.residual and b[0] == 0.0
        b[0] = -1.5

    monkeypatch.setattr(minimum_norm, "solve", solve)
    monkeypatch.setattr(minimum_norm, "subtract_product", subtract)
    monkeypatch.setattr(minimum_norm, "add_transpose", lambda *given: calls.append(given))
    multipliers = np.full(3, 7.0)
    minimum_norm.find_least_multipliers(made, np.array([9.0, 3.0]), multipliers)
    assert len(steps) - len(left) == len(calls) == count
    assert multipliers.tolist() == [7.0, 7.0, -sum(steps[:count])]
    for factor, step, x in calls:
        assert factor is made and step is made.step and x is made.change
    assert made.change.tolist() == [1.5], "half of the force, which add_transpose did not change here"


# --- patterns of factors ----------------------------------------------------------------------------------
ROWS, COLUMNS, PLACES = np.array([7, 7, 4, 4, 9]), np.array([0, 2, 2, 3, 0]), np.array([70, 72, 42, 43, 90])
ACTIVE = np.array([True, False, True, True])


@pytest.fixture
def stored(monkeypatch: pytest.MonkeyPatch) -> dict[Any, bytes]:
    """An empty cache of patterns."""
    files: dict[Any, bytes] = {}
    monkeypatch.setattr(patterns.checked_file, "read", files.get)
    monkeypatch.setattr(patterns.checked_file, "write", files.__setitem__)
    return files


def test_a_pattern_is_found_once_and_stored(monkeypatch, stored):
    """Rows 4, 7 and 9 of three active columns: 7 and 4 share column 2, 7 and 9 share column 0."""
    parts = [*(array.tobytes() for array in (ROWS, COLUMNS, PLACES)), ACTIVE.tobytes()]
    find = patterns._of_pattern.__wrapped__
    made = find(*parts)
    digest = hashlib.sha256(b"".join(len(part).to_bytes(8, "little") + part for part in parts)).hexdigest()
    [path] = stored
    assert path == patterns.CACHE / "patterns" / digest[:32]
    monkeypatch.setattr(patterns, "_made", None)
    again = find(*parts)
    for name, one, other in zip(made._fields, made, again, strict=True):
        assert one.dtype == other.dtype == np.uint32 and one.tolist() == other.tolist(), name
    assert sorted(made.row.tolist()) == [4, 7, 9] and made.column.tolist() == [0, 2, 3]
    spans = zip(made.row.tolist(), made.d_start.tolist(), made.d_start.tolist()[1:], strict=False)
    entries = {row: made.d_entry[first:last].tolist() for row, first, last in spans}
    assert entries == {7: [70, 72], 4: [42, 43], 9: [90]}
    assert made.column[made.d_column].tolist() == [entry % 10 for entry in made.d_entry.tolist()]
    assert patterns._of_pattern.cache_info().maxsize == patterns.MOST_PATTERNS == 64


def test_patterns_of_nothing():
    made = patterns.empty_factor()
    assert made.d.size == made.l.size == made.root.size == made.step.size == 0
    assert made.symbolic.l_start.tolist() == [0] and made.symbolic.d_start.tolist() == [0]


def test_indices_of_32_bits():
    assert patterns.unsigned([0, 2**32 - 1]).tolist() == [0, 4294967295]
    assert patterns.unsigned(np.zeros(0)).dtype == np.uint32
    with pytest.raises(OverflowError, match="too large for 32-bit indices"):
        patterns.unsigned([2**32])


def test_an_order_of_elimination_for_rows_alone_is_refused(monkeypatch):
    import scipy.sparse.linalg as sparse

    lu = SimpleNamespace(perm_c=np.array([0, 1]), perm_r=np.array([1, 0]))
    monkeypatch.setattr(sparse, "splu", lambda *given, **options: lu)
    with pytest.raises(AssertionError, match="not symmetric"):
        patterns._factor_pattern(csr_array(np.eye(2)))
