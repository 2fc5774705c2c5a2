"""Promises of the decorators of kernels."""

import numba
import numpy as np
import pytest

from mbref.kernels.compilation import PLAIN, allocating, kernel


@allocating
def total(n):
    return np.ones(n).sum()


@kernel
def greedy(n):
    return np.ones(n).sum()


@pytest.mark.skipif(PLAIN, reason="without the JIT kernels are plain functions")
def test_only_a_kernel_that_says_so_can_allocate():
    assert total(3) == 3.0
    with pytest.raises(numba.core.errors.NumbaError, match="of array passed into"):
        greedy(3)
