"""Compilation of kernels in a second process, in parallel with this process.

Compiling uses one core. The second process stores its kernels in the cache of this machine, from which this
process loads them.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from mbref.kernels.compilation import Exchangeable

# The second process ends with its parent, whose end closes its standard input.
PROGRAM = """\
from mbref.kernels.background import end_with_parent
end_with_parent()
from {module} import {function}
{function}()
"""


@contextmanager
def compiled_in_background(kernels: Sequence[Exchangeable], module: str, function: str) -> Iterator[None]:
    """Compile the kernels by ``module.function()`` in a second process while the ``with`` block runs, then
    wait for the process.

    No process is started if the cache has all kernels, or with one core for this process. If the second
    process fails, the kernels are compiled at their first call.
    """
    if _cores() < 2 or all(kernel.is_kept for kernel in kernels):
        yield
        return
    program = PROGRAM.format(module=module, function=function)
    quiet = {"stdin": subprocess.PIPE, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with subprocess.Popen([sys.executable, "-c", program], **quiet) as process:  # type: ignore[call-overload]
        try:
            yield
            process.wait()
        finally:
            process.kill()


def _cores() -> int:
    """Return the number of cores on which this process may run."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def end_with_parent() -> None:
    """End this process when its standard input is closed."""
    threading.Thread(target=_end_at_end_of_input, daemon=True).start()


def _end_at_end_of_input() -> None:
    sys.stdin.read()
    os._exit(1)
