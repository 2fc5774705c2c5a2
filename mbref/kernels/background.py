"""Kernels compiled in a second process, beside those that this process compiles.

Compiling is work of one core.  The second process leaves its kernels in the cache of this machine, from where
this process loads them.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from mbref.kernels.compilation import Exchangeable

# The second process ends with its parent, whose death closes its standard input.
PROGRAM = """\
from mbref.kernels.background import end_with_parent
end_with_parent()
from {module} import {function}
{function}()
"""


@contextmanager
def compiled_in_background(kernels: Sequence[Exchangeable], module: str, function: str) -> Iterator[None]:
    """While the block runs, ``module.function()`` compiles the kernels in a second process, whose end is
    waited for; without such a process where the cache has them all, or with one core.

    Where the second process fails, the kernels are compiled when they are first called.
    """
    if (os.cpu_count() or 1) < 2 or all(kernel.is_kept for kernel in kernels):
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


def end_with_parent() -> None:
    """End this process as soon as its standard input is closed."""
    threading.Thread(target=_end_at_end_of_input, daemon=True).start()


def _end_at_end_of_input() -> None:
    sys.stdin.read()
    os._exit(1)
