"""Interrupts of a compilation inside ``with interrupts_kept()``, sent to the test's own process."""

import contextlib
import signal
import threading
from collections.abc import Iterator

import pytest

from mbref.kernels.interrupts import interrupts_kept


@pytest.fixture(autouse=True)
def _python_handler() -> Iterator[None]:
    """Begin with Python's own handler, also where the shell has made this process ignore interrupts."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_interrupt_lost_during_a_compilation_is_raised_at_its_end():
    """LLVM's callbacks lose the exception, as ``except`` does here. Python's handler is back at the end."""
    done = []
    with pytest.raises(KeyboardInterrupt), interrupts_kept():
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            done.append("lost")
        done.append("compiled")
    assert done == ["lost", "compiled"] and signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_interrupt_that_is_not_lost_ends_the_compilation_at_once():
    """Nothing before Python's handler suppresses the exception; the line after it does not run."""
    done = []
    with pytest.raises(KeyboardInterrupt), interrupts_kept():
        signal.raise_signal(signal.SIGINT)
        done.append("compiled")
    assert not done and signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_error_of_a_compilation_is_raised_instead_of_a_lost_interrupt():
    """An interrupt is suppressed, and then a division by zero ends the compilation."""
    with pytest.raises(ZeroDivisionError), interrupts_kept():
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        _ = 1 / 0
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_handler_that_the_program_installed_receives_the_interrupt():
    """The handler notes the number of the signal and raises nothing."""
    received = []
    signal.signal(signal.SIGINT, lambda number, _: received.append(number))
    with interrupts_kept():
        signal.raise_signal(signal.SIGINT)
    assert received == [signal.SIGINT]


def test_handler_is_not_replaced_in_another_thread():
    """Python allows signal handlers to be set in the main thread only."""
    seen = []

    def compiled() -> None:
        with interrupts_kept():
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=compiled)
    thread.start()
    thread.join()
    assert seen == [signal.default_int_handler]
