"""Interrupts of a compilation inside ``with interrupts_kept()``, sent to the test's own process."""

import contextlib
import signal
from collections.abc import Iterator

import pytest

from mbref.kernels.interrupts import interrupts_kept


@pytest.fixture(autouse=True)
def _python_handler() -> Iterator[None]:
    """Begin with Python's own handler, also where the shell has made this process ignore interrupts."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("lost", [(KeyboardInterrupt,), ()], ids=["lost", "not lost"])
def test_interrupt_of_a_compilation_is_raised_at_once_or_if_it_is_lost_at_the_end(lost):
    """LLVM's callbacks lose the exception, as ``suppress`` does here: then the next line runs. Python's
    handler is back at the end."""
    done = []
    with pytest.raises(KeyboardInterrupt), interrupts_kept():
        with contextlib.suppress(*lost):
            signal.raise_signal(signal.SIGINT)
        done.append("compiled")
    assert done == ["compiled"] * len(lost) and signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_error_that_follows_a_lost_interrupt_is_an_interrupt():
    """A compilation whose callback was interrupted has no machine code, which is an error of numba's."""
    with pytest.raises(KeyboardInterrupt), interrupts_kept():
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        raise RuntimeError("no compiled object")


def test_handler_that_the_program_installed_receives_the_interrupt():
    """The handler notes the number of the signal and raises nothing."""
    received = []
    signal.signal(signal.SIGINT, lambda number, _: received.append(number))
    with interrupts_kept():
        signal.raise_signal(signal.SIGINT)
    assert received == [signal.SIGINT]
