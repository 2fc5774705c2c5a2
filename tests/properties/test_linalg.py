"""Factorisations on matrices of known rank: Penrose identities, ranks, and the formulations' agreement."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mbref.formulations import mpi_gs, mpi_qr
from mbref.kernels.named_memory import allocate, packed
from mbref.linear_algebra.elimination import determinant, full_pivot, product_of_pivots
from mbref.linear_algebra.orthogonal_factorisations import (
    add_pseudo_solution,
    gram_schmidt_solve,
    minimum_norm,
    qr_pivoted,
    svd_solve,
)

RATIO = 30.0  # LAPACK's customary bound for ‖residual‖ / (ε n ‖…‖) of a stable algorithm


def pinv_svd(d, tolerance):
    """Return D⁺ and the rank, column by column from the kernels of MPI-SVD, without its refinement."""
    m, n = d.shape
    inverse, rank = np.zeros((n, m)), 0
    factors = np.linalg.svd(d, full_matrices=False)
    for i, unit in enumerate(np.eye(m)):
        rank = svd_solve(np.ascontiguousarray(d), unit.copy(), tolerance, np.zeros(n), np.zeros(m))
        x = np.zeros(n)
        add_pseudo_solution(*factors, rank, unit, x, np.zeros(m))
        inverse[:, i] = x
    return inverse, rank


def pinv_gram_schmidt(d, tolerance):
    """Return D⁺ and the rank, column by column from the kernel of MPI-GS."""
    m, n = d.shape
    inverse, rank = np.zeros((n, m)), 0
    for i, unit in enumerate(np.eye(m)):
        scratch = allocate(mpi_gs.Scratch, {"m": m, "n": n})
        scratch.columns[:], scratch.b[:] = d.T, unit
        rank = gram_schmidt_solve(tolerance, packed(scratch).argument)
        inverse[:, i] = scratch.x
    return inverse, rank


PSEUDO_INVERSES = {"svd": pinv_svd, "gram_schmidt": pinv_gram_schmidt}


@st.composite
def matrices(draw, most=40, condition=1e12):
    """Return a matrix m × n, its rank and its singular values from 1 to 1/condition; random factors."""
    m, n = draw(st.integers(1, most)), draw(st.integers(1, most))
    rank = draw(st.integers(1, min(m, n)))
    exponents = draw(st.floats(0, np.log10(condition)))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    u = np.linalg.qr(rng.normal(size=(m, m)))[0][:, :rank]
    v = np.linalg.qr(rng.normal(size=(n, n)))[0][:, :rank]
    values = 10 ** -np.linspace(0, exponents, rank) if rank > 1 else np.ones(1)
    return (u * values) @ v.T, rank, values


def norm(a):
    """Return the largest singular value of a matrix, or the length of a vector."""
    return np.linalg.norm(a, 2)


def penrose_ratios(d, inverse):
    """Residuals of the four identities over ε max(m, n) ‖·‖ κ, κ = ‖D‖ ‖D⁺‖. κ belongs there: rounding the
    entries of D⁺ alone makes residuals of that size."""
    unit = np.finfo(float).eps * max(d.shape) * norm(d) * norm(inverse)
    return {
        "D D⁺ D = D": norm(d @ inverse @ d - d) / (unit * norm(d)),
        "D⁺ D D⁺ = D⁺": norm(inverse @ d @ inverse - inverse) / (unit * norm(inverse)),
        "D D⁺ symmetric": norm(d @ inverse - (d @ inverse).T) / unit,
        "D⁺ D symmetric": norm(inverse @ d - (inverse @ d).T) / unit,
    }


@pytest.mark.parametrize("name", PSEUDO_INVERSES)
@given(case=matrices(condition=1e12), noise=st.floats(0, 1e-15), seed=st.integers(0, 2**32 - 1))
def test_pseudo_inverse_has_the_four_penrose_properties(name, case, noise, seed):
    """PSEUDO_INVERSES are those of MPI-SVD and MPI-GS. Matrices have known rank and condition up to 1e12,
    exact or changed by rounding, up to 1e-15 an entry. The rank is found with the tolerance 1e-13; residuals
    are below RATIO, 30, times ε n κ (``penrose_ratios``)."""
    d, rank, _ = case
    changed = d + noise * np.random.default_rng(seed).normal(size=d.shape)
    inverse, found = PSEUDO_INVERSES[name](changed, 1e-13)
    assert found == rank
    ratios = penrose_ratios(changed, inverse)
    assert max(ratios.values()) < RATIO, ratios


@pytest.mark.parametrize(
    ("condition", "noise", "tolerance"), [(1e4, 1e-13, 1e-9), (1e12, 0.0, 1e-14)], ids=["noise", "no noise"]
)
@given(data=st.data())
def test_full_pivoting_finds_the_rank_and_independent_rows(condition, noise, tolerance, data):
    """The rank is known by construction: singular values are from 1 to 1/condition, or zero, and noise in the
    entries makes zeros no larger than the tolerance. The chosen rows and columns are independent: the least
    singular value of their block is at least a thousandth of the matrix's."""
    d, rank, values = data.draw(matrices(condition=condition))
    m, n = d.shape
    rows, columns = np.zeros(m, dtype=np.int64), np.zeros(n, dtype=np.int64)
    noisy = np.ascontiguousarray(d + noise * np.random.default_rng(7).normal(size=d.shape))
    assert full_pivot(noisy, m, n, rows, columns, tolerance) == rank
    least = np.linalg.svd(d[np.ix_(rows[:rank], columns[:rank])], compute_uv=False)[-1]
    assert least > values[-1] / 1000, f"the block chosen has {least:.1e}, the matrix {values[-1]:.1e}"


@given(case=matrices(condition=1e6))
def test_least_norm_solution_by_qr_equals_numpys_least_squares_solution_by_svd(case):
    """Equations are consistent and of any rank. The relative difference is below RATIO, 30, times
    ε max(m, n) κ, where κ is the largest over the least singular value that is not zero."""
    d, rank, values = case
    m, n = d.shape
    rhs = d @ np.random.default_rng(3).normal(size=n)
    scratch = allocate(mpi_qr.Scratch, {"m": m, "n": n})
    scratch.transposed[:], scratch.b[:] = d.T, rhs
    memory, x = packed(scratch), scratch.x
    found = qr_pivoted(1e-10, memory.argument)
    assert found == rank
    minimum_norm(found, memory.argument)
    exact = np.linalg.lstsq(d, rhs, rcond=1e-10)[0]
    error = norm(x - exact) / norm(exact)
    unit = np.finfo(float).eps * max(m, n) * values[0] / values[-1]
    assert error < RATIO * unit, f"relative difference {error:.1e}"


@given(n=st.integers(1, 30), seed=st.integers(0, 2**32 - 1), scale=st.integers(-140, 140))
def test_sign_and_logarithm_of_a_determinant_are_numpys(n, seed, scale):
    """`determinant` has the sign and logarithm of slogdet for matrices with factors of 1e-140 to 1e140, whose
    determinant may be beyond the largest double; so has `product_of_pivots` for a triangular matrix, whose
    pivots are random. Logarithms agree to rounding times condition and size."""
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(n, n))
    sign, size = np.linalg.slogdet(a)
    size += n * np.log(10.0) * scale
    negative, found = determinant(a * 10.0**scale, n)
    assert negative == (sign < 0.0)
    assert abs(found - size) < 1e-14 * n * (np.linalg.cond(a) + abs(size))
    pivots = rng.normal(size=n) * 10.0**scale
    negative, found = product_of_pivots(pivots, n)
    assert negative == (np.prod(np.sign(pivots)) < 0.0)
    assert abs(found - np.log(np.abs(pivots)).sum()) < 1e-14 * n * (1.0 + abs(found))
