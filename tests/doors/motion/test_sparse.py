"""Velocities that decay under sparse matrices, and redundant rows against NumPy's singular vectors."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from mbref.linear_algebra.redundancy import Redundancy
from mbref.scenes import find_scene
from mbref.simulation.simulate import simulate


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
    np.testing.assert_allclose(found.shares, np.sum(left[:, 4:] ** 2, axis=1), rtol=0, atol=rounding)
    assert found.shares[5] < 1e-12
