"""Promises of the decorators of kernels."""

import numba
import numpy as np
import pytest

from mbref.kernels.compilation import PLAIN, Entry, allocating, kernel
from mbref.taylor.preparation import KERNELS_OF_SERIES
from mbref.taylor.series_memory import CALLED


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


def test_every_kernel_of_the_series_is_prepared():
    """A missing kernel would compile while the clock of a run counts."""
    from mbref.taylor import stepper

    called = {kernel for kernel in vars(stepper).values() if isinstance(kernel, Entry)}
    assert {*CALLED, *called} == set(KERNELS_OF_SERIES) and called


@pytest.mark.skipif(PLAIN, reason="without the JIT kernels are plain functions")
def test_a_helper_has_no_code_for_calls_from_python_unless_python_calls_it():
    @kernel
    def twice(x):
        return 2 * x

    @numba.njit
    def four_times(x):
        return twice(twice(x))

    assert four_times(1) == 4 and "_callable" not in vars(twice)
    (compiled,) = vars(twice)["_called"].overloads.values()
    names = [function.name for function in compiled.library.get_defined_functions()]
    assert names and not any(name.startswith(("_ZN7cpython", "cfunc")) for name in names), names
    assert twice(1) == 2
