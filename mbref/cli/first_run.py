"""The first run on a machine: interpreted kernels compute its result while the kernels are being compiled.

Compiling the kernels of a method takes half a minute, interpreting a short run a few seconds, with the same
arithmetic.  So two processes work at once: the first process runs the interpreted kernels, the second process
compiles. If the compilation ends first, the run is made with compiled kernels.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess

import numpy as np

from mbref.method import Method, MethodError
from mbref.motion import Motion
from mbref.scene import Scene, SceneError
from mbref.simulation.simulate import are_compiled, prepare, simulate
from mbref.stepping.limits import Limits

SPAWN = multiprocessing.get_context("spawn")
INTERPRETED = "NUMBA_DISABLE_JIT"  # environment variable that turns numba's compilation off
COMPILING = (
    "mbref: compiling kernels for this machine, once for each method, up to a minute; "
    "meanwhile they are interpreted"
)
WAITING = (
    "mbref: this result was computed by interpreted kernels; compilation continues for later runs "
    "(Ctrl-C stops it)"
)

Simulate = Callable[..., Motion]  # function with the arguments of ``simulate``


@contextmanager
def simulator(method: str) -> Iterator[Simulate]:
    """Return ``simulate``, or, if the method's kernels are not compiled, a function that runs and compiles at
    once.

    When the ``with`` block ends, the caller waits for the compilation. Raises MethodError for an unknown
    method.
    """
    if INTERPRETED in os.environ or (os.cpu_count() or 1) < 2 or are_compiled(Method.parse(method)):
        yield simulate
        return
    print(COMPILING, file=sys.stderr, flush=True)
    compiling = SPAWN.Process(target=_compile, args=(method,))
    compiling.start()
    try:
        yield lambda *arguments: _raced(compiling, *arguments)
        if compiling.is_alive():
            print(WAITING, file=sys.stderr, flush=True)
        compiling.join()
    finally:
        compiling.kill()


def _raced(
    compiling: BaseProcess,
    scene: Scene,
    method: str,
    times: np.ndarray,
    limits: Limits,
    progress: Callable[[float], None],
) -> Motion:
    """Return the motion by interpreted kernels, or by compiled kernels if the compilation ends first."""
    answers, answer = SPAWN.Pipe(duplex=False)
    interpreting = SPAWN.Process(target=_interpret, args=(answer, scene, method, times, limits))
    with _environment(INTERPRETED, "1"):
        interpreting.start()
    answer.close()
    try:
        while answers in wait([answers, compiling.sentinel]):
            said = answers.recv()
            if isinstance(said, Exception):
                raise said
            if isinstance(said, Motion):
                return said
            progress(said)
    except EOFError:  # the process with interpreted kernels has crashed
        compiling.join()
    finally:
        interpreting.kill()
    return simulate(scene, method, times, limits, progress)


def _compile(method: str) -> None:
    """Compile in a child process; its parent handles interrupts."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.stderr = open(os.devnull, "w")  # noqa: SIM115 - its parent has reported that kernels are compiled
    prepare(Method.parse(method))


def _interpret(answer: Connection, scene: Scene, method: str, times: np.ndarray, limits: Limits) -> None:
    """Run interpreted kernels in a child process; sends reached times, then a motion or the error."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        motion = simulate(scene, method, times, limits, answer.send)
        answer.send(replace(motion, settings={**motion.settings, "kernels": "interpreted"}))
    except (SceneError, MethodError, ValueError) as error:
        answer.send(error)


@contextmanager
def _environment(name: str, value: str) -> Iterator[None]:
    """Set an environment variable for processes that are started in the ``with`` block."""
    os.environ[name] = value
    try:
        yield
    finally:
        del os.environ[name]
