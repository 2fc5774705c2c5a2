"""Solutions of least norm and null spaces against NumPy's pseudo-inverse, for full and deficient ranks."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from mbref.linear_algebra.least_norm import least_norm, least_norm_and_null_space, null_space
from mbref.linear_algebra.redundancy import Redundancy

TOLERANCE = 1e-5  # of the rank: singular values below this fraction of the largest count as zero
ROUNDING = 1e-12  # of solutions and projections of size 1, of matrices of condition below 1e3


def unit_rows(seed: int, rows: int, columns: int, values: list[float]) -> np.ndarray:
    """Return a matrix (rows, columns) of about these singular values, its rows of length one or zero."""
    random = np.random.default_rng(seed)
    left, _ = np.linalg.qr(random.normal(size=(rows, rows)))
    right, _ = np.linalg.qr(random.normal(size=(columns, columns)))
    rank = len(values)
    matrix = left[:, :rank] @ np.diag(values) @ right[:rank]
    lengths = np.linalg.norm(matrix, axis=1, keepdims=True)
    return matrix / np.where(lengths > 0, lengths, 1.0)


def difference(matrix: np.ndarray, rhs: np.ndarray) -> float:
    """Return the largest difference from NumPy's pseudo-inverse A⁺: of the solution A⁺ b (over its size, if
    above 1), of the solutions of two systems at once, and of the projection I - A⁺ A on the null space."""
    x, basis = least_norm_and_null_space(matrix, rhs, TOLERANCE)
    inverse = np.linalg.pinv(matrix, rcond=TOLERANCE)
    off = np.abs(x - inverse @ rhs).max() / max(1.0, np.abs(x).max())
    two = least_norm(np.stack([matrix, 2 * matrix]), np.stack([rhs, rhs]), TOLERANCE)
    projection = np.eye(matrix.shape[1]) - inverse @ matrix
    return max(off, np.abs(two - [x, x / 2]).max(), np.abs(basis @ basis.T - projection).max())


@pytest.mark.parametrize(("rows", "columns", "rank"), [(6, 6, 6), (8, 12, 5), (24, 18, 18), (3, 6, 1)])
@pytest.mark.parametrize("seed", range(5))
def test_least_norm_solution_and_null_space_are_given_by_the_pseudo_inverse(seed, rows, columns, rank):
    """The function ``least_norm_and_null_space`` against NumPy's pseudo-inverse A⁺: A⁺ b and I - A⁺ A, for
    matrices with full and with deficient rank, to rounding."""
    matrix = unit_rows(seed, rows, columns, [1.0] * rank)
    assert difference(matrix, matrix @ np.random.default_rng(seed).normal(size=columns)) < ROUNDING


@pytest.mark.parametrize("least", [1e-4, 1.1e-5, 0.9e-5, 1e-7, 1e-12])
def test_singular_value_counts_only_above_the_tolerance(least):
    """NumPy's pseudo-inverse with the tolerance 1e-5 counts a fourth singular value of 1e-4 or 1.1e-5, and no
    smaller one. Conditions up to 1e5 magnify the rounding 1e-16 to 1e-11; 100 times that is allowed."""
    matrix = unit_rows(0, 7, 9, [1.0, 1.0, 1.0, least])
    assert difference(matrix, matrix @ np.random.default_rng(0).normal(size=9)) < 100 * 1e-11


@pytest.mark.parametrize("shape", [(0, 4), (3, 0), (3, 4)])
def test_zero_or_empty_matrix_has_the_solution_zero_and_a_full_null_space(shape):
    """The matrix has no equations (0 rows), no unknowns (0 columns), or zeros alone."""
    x, basis = least_norm_and_null_space(np.zeros(shape), np.zeros(shape[0]), TOLERANCE)
    assert not x.any() and basis.shape == (shape[1], shape[1])


def test_tolerance_is_relative_to_the_largest_singular_value():
    """Singular values 1e-8 and 1e-9: the smaller counts for tolerances below a tenth."""
    matrix, rhs = np.diag([1e-8, 1e-9]), np.array([2e-8, 3e-9])
    assert least_norm(matrix, rhs, 0.099) == pytest.approx([2.0, 3.0])
    assert least_norm(matrix, rhs, 0.101) == pytest.approx([2.0, 0.0])


@pytest.mark.parametrize("seed", range(5))
def test_basis_of_a_null_space_depends_on_the_space_alone(seed):
    """Six combinations of four equations have the null space of the four, and the same orthonormal basis."""
    random = np.random.default_rng(seed)
    matrix = random.normal(size=(4, 9))
    basis = null_space(matrix, TOLERANCE)
    other = null_space(random.normal(size=(6, 4)) @ matrix[::-1], TOLERANCE)
    assert basis.shape == (9, 5) and np.abs(basis.T @ basis - np.eye(5)).max() < ROUNDING
    assert np.abs(matrix @ basis).max() < ROUNDING
    assert np.abs(other - basis).max() < ROUNDING


def test_shares_of_redundant_rows_are_squares_of_left_null_vectors():
    """Two of six unit rows depend on others; NumPy's singular vectors give the null space. The squared matrix
    is factorised with 1/α = 1e-10 on its diagonal, which carries the rounding of up to six products. The last
    row is independent: its share is zero."""
    rounding = 6 * np.finfo(float).eps / 1e-10
    matrix = np.random.default_rng(7).normal(size=(6, 9))
    matrix[2], matrix[4] = 2.0 * matrix[0], matrix[1] - matrix[3]
    matrix /= np.linalg.norm(matrix, axis=1)[:, None]
    left, _, _ = np.linalg.svd(matrix)
    found = Redundancy(csr_array(matrix))
    assert found.rank == 4
    np.testing.assert_allclose(found.shares, np.sum(left[:, 4:] ** 2, axis=1), rtol=0, atol=rounding)
    assert found.shares[5] < 1e-12
