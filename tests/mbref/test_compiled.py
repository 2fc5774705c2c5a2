"""Promises of the decorators of kernels."""

from types import SimpleNamespace

import numba
import numpy as np
import pytest

from mbref.kernels import compilation
from mbref.kernels.compilation import INT, PLAIN, Entry, allocating, exchangeable, kernel, prepare_all
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


def stand_in(name, done, is_compiled_elsewhere):
    prepare = lambda: done.append(name)  # noqa: E731
    return SimpleNamespace(prepare=prepare, is_compiled_elsewhere=is_compiled_elsewhere)


def test_kernels_that_another_process_compiles_come_last():
    done = []
    prepare_all([stand_in(name, done, name in "ac") for name in "abcd"])
    assert done == ["b", "d", "a", "c"]


def test_a_kernel_that_this_process_has_is_not_sought_in_others(monkeypatch):
    monkeypatch.setattr(compilation, "is_held", lambda _: True)
    monkeypatch.setattr(compilation, "PLAIN", True)
    needed = exchangeable(INT(INT))(lambda k: k)
    assert needed.is_compiled_elsewhere
    needed.prepare()
    assert not needed.is_compiled_elsewhere


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
