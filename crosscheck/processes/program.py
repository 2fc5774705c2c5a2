"""A Python program that ends, with its child processes, when the process that started it ends.

``python -m crosscheck.processes.program MODULE OPTIONS`` runs a module as a program. Its standard input is a
pipe that only the parent holds. The end of the pipe, which also follows the parent's death by SIGKILL, ends
the program.
"""

from __future__ import annotations

import contextlib
import os
import runpy
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from typing import Any

from mbref.command_line import INTERRUPTED


def run_program(module: str, options: Sequence[str]) -> int:
    """Run a module as a program and return its exit status, negative if a signal ended it.

    The program has a process group of its own, so that it gets each interrupt once, from here. It hears an
    interrupt when Python has started.
    """
    command = [sys.executable, "-m", __name__, module, *options]
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # which the program inherits
    try:
        with (
            subprocess.Popen(command, stdin=subprocess.PIPE, process_group=0) as started,
            _passed_on(started),
        ):
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            return started.wait()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def _passed_on(started: subprocess.Popen[Any]) -> Iterator[None]:
    """Pass SIGINT and SIGTERM on to a program during the ``with`` block, unless this process ignores them."""
    before = {
        number: signal.signal(number, lambda received, _: started.send_signal(received))
        for number in (signal.SIGINT, signal.SIGTERM)
        if signal.getsignal(number) is not signal.SIG_IGN
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def main() -> None:
    """Run the module that the command line names."""
    parent = os.dup(0)
    with open(os.devnull) as nothing:
        os.dup2(nothing.fileno(), 0)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    sys.argv[:] = sys.argv[1:]
    try:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
    except KeyboardInterrupt:  # while it was imported
        sys.exit(INTERRUPTED)


def _end_with(parent: int) -> None:
    """Wait for the end of the pipe, and end the process group."""
    while os.read(parent, 1):
        pass
    if hasattr(os, "killpg"):
        os.killpg(os.getpgrp(), signal.SIGKILL)
    os._exit(1)


if __name__ == "__main__":
    main()
