"""The sparse factor against dense linear algebra, and runs with it against dense runs and closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import csr_array

from mbref.kernels.named_memory import packed
from mbref.linear_algebra.redundancy import Redundancy
from mbref.linear_algebra.sparse_cholesky import (
    assemble_gradients,
    factorise,
    find_squared_pivots,
    solve,
    substitute_back,
    subtract_product,
    times_transpose,
)
from mbref.linear_algebra.symbolic_factorisation import sparse_factor, symbolic_factorisation
from mbref.scenes import find_scene
from mbref.simulation.simulate import simulate


@given(bodies=st.integers(1, 12), rows=st.integers(1, 40), seed=st.integers(0, 999))
def test_sparse_factor_solves_multiplies_and_has_pivots_as_dense_matrices(bodies, rows, seed):
    """Each row of D has random entries of up to two bodies; S is D Dᵀ with its diagonal times 1 + 1/α. By
    dense matrices S b = r holds to rounding over |S| |b|, and so do Dᵀ r and r - D x, sums of at most 72
    terms. A second solution, by the finished factor, has the bits of the first, during factorisation. Pivots
    are those of Cholesky's factor of S over √S_ii. None is below √(1/α); a millionth of this is allowed."""
    rounding = 1e-12
    rng, n = np.random.default_rng(seed), 6 * bodies
    columns = 6 * rng.integers(0, bodies, rows)[:, None] + np.arange(6)
    second = np.where(rng.random(rows) < 0.3, bodies, (columns[:, 0] // 6 + 1) % (bodies + 1))
    columns = np.hstack([columns, 6 * second[:, None] + np.arange(6)])
    entries = (rng.random((rows, 12)) < 0.6) & (columns < n)
    blocks, root, alpha = rng.normal(size=(rows, 12)), rng.uniform(0.5, 2.0, n), 10.0 ** rng.integers(1, 8)
    moving = np.isin(np.arange(n), columns[entries])
    row, entry = np.nonzero(entries)
    factor = sparse_factor(symbolic_factorisation(row, columns[row, entry], 12 * row + entry, moving))
    memory, b = packed(factor).argument, factor.residual
    dense = np.zeros((rows, n))
    dense[np.nonzero(entries)[0], columns[entries]] = (blocks * entries)[entries]
    d_true = (dense * root)[np.ix_(factor.symbolic.row, factor.symbolic.column)]
    s_true = d_true @ d_true.T
    s_true[np.diag_indices_from(s_true)] *= 1 + 1 / alpha
    rhs, x = (rng.normal(size=size) for size in d_true.shape)

    assemble_gradients(memory, blocks.ravel(), root)
    b[:] = rhs
    assert factorise(memory, alpha, b)
    substitute_back(memory, b)
    left = np.abs(s_true @ b - rhs).max(initial=0) / (
        1 + np.abs(s_true).max(initial=0) * np.abs(b).max(initial=0)
    )
    assert left < rounding / 10, f"residual of the solution {left:.1e}"
    first = b.copy()
    b[:] = rhs
    solve(memory, b)
    assert np.array_equal(b, first), "the finished factor gives another solution"
    times_transpose(memory, rhs, factor.change)
    assert np.abs(factor.change - d_true.T @ rhs).max(initial=0) < rounding
    b[:] = rhs
    subtract_product(memory, x, b)
    assert np.abs(b - (rhs - d_true @ x)).max(initial=0) < rounding
    pivots = np.sort(np.diag(np.linalg.cholesky(s_true)) / np.sqrt(np.diag(s_true)))
    find_squared_pivots(memory)
    seen = np.sqrt(np.sort(factor.squared_pivots))
    assert np.abs(seen - pivots).max(initial=0) < 1e-6 / np.sqrt(alpha), f"pivots {seen}, dense {pivots}"


@pytest.mark.parametrize("formulation", ["alf-dual", "mpi-svd"])
def test_velocities_across_the_plane_decay_to_zero_instead_of_denormals(formulation):
    """Denormal numbers, below 2e-308, slow a processor down. Velocities that projection halves again and
    again pass 1e-90 on the way to them: none is between zero and this."""
    scene, method = find_scene("four_bar_chain[1]"), f"{formulation}+projection/rk4[step=0.01]"
    run = simulate(scene, method, [0.5])
    values = np.abs(np.concatenate([run.velocity, run.angular_velocity], axis=None))
    left = values[(values > 0) & (values < 1e-90)]
    assert not left.size, f"{left.size} velocities have decayed to {left.max():.0e}"


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
    np.testing.assert_allclose(found.shares, np.sum(left[:, 4:] ** 2, axis=1), atol=rounding)
    assert found.shares[5] < 1e-12
