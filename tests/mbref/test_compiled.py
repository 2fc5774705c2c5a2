"""Promises of the decorators of kernels."""

import numba
import numpy as np
import pytest

from mbref.kernels.compilation import PLAIN, Entry, allocating, kernel
from mbref.taylor.driven import follow_drivers
from mbref.taylor.preparation import KERNELS_OF_SERIES
from mbref.taylor.series_memory import CALLED


@allocating
def total(n):
    return np.ones(n).sum()


@kernel
def greedy(n):
    return np.ones(n).sum()


@pytest.mark.skipif(PLAIN, reason="without the JIT kernels are plain functions")
def test_array_is_allocated_only_by_a_kernel_with_the_decorator_allocating():
    """``total`` and ``greedy`` both sum three ones. ``total`` has this decorator; ``greedy`` has ``kernel``,
    and numba refuses to compile it."""
    assert total(3) == 3.0
    with pytest.raises(numba.core.errors.NumbaError, match="of array passed into"):
        greedy(3)


def test_every_kernel_that_a_series_calls_is_compiled_before_a_run():
    """A missing kernel would compile while the clock of a run counts. Called are the entries that the modules
    of stepper and branches import, and CALLED by address. All are in the list that is prepared, except
    ``follow_drivers``, which the stepper prepares if drivers prescribe the motion."""
    from mbref.taylor import stepper
    from mbref.taylor.crossing import branches

    names = vars(stepper) | vars(branches)
    called = {kernel for kernel in names.values() if isinstance(kernel, Entry)}
    assert {*CALLED, *called} == {*KERNELS_OF_SERIES, follow_drivers} and called
