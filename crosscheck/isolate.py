"""One run = one child process with a time limit: whatever an engine does, a Trajectory comes back.

The child works in a temporary directory that is removed, everything printed is captured at
file-descriptor level, and numerical libraries get one thread.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np

from crosscheck import worker
from crosscheck.engine import Cannot, Setting, engine_names
from mbref.scene import Scene
from mbref.trajectory import Outcome, Trajectory

ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
ORPHAN_SECONDS = 10.0  # beyond its limit, a child whose parent has died ends itself
PRINTED = 200  # characters of the last printed line that a message quotes

_running: set[subprocess.Popen] = set()


class ChildFailed(Exception):
    """A child process gave no result: ``outcome`` TIMED_OUT or CRASHED, and a sentence."""

    def __init__(self, outcome: Outcome, message: str, version: str = ""):
        self.outcome = outcome
        self.version = version  # of the engine, when the child got that far
        super().__init__(message)


class Observation(NamedTuple):
    """What came of a call in a child: its value, what was printed, and files left in its directory."""

    value: Any
    printed: str
    files: tuple[str, ...]


def run_isolated(
    engine_name: str, scene: Scene, times: np.ndarray, setting: Setting, time_limit: float
) -> Trajectory:
    """The engine's trajectory at ``times`` (k,), computed in a child process.

    ``engine_name`` is a known engine or ``module:attribute``; ``time_limit`` is wall time (s) of the
    whole child, imports included.  A crash, a hang, an exception and a missing package are outcomes
    CRASHED or TIMED_OUT of a trajectory without states.  Raises LookupError for an unknown engine.
    """
    return observe(engine_name, scene, times, setting, time_limit).value


def observe(
    engine_name: str, scene: Scene, times: np.ndarray, setting: Setting, time_limit: float
) -> Observation:
    """`run_isolated` with what the engine printed and the files it left in its working directory; both
    empty when the run gave no result, as its message then quotes them."""
    _check(engine_name)
    try:
        return _observed(worker.run_once, (engine_name, scene, times, setting), time_limit)
    except ChildFailed as failure:
        outcome, message = failure.outcome, str(failure)
        failed = worker.failed(engine_name, failure.version, scene, setting, outcome, message)
        return Observation(failed, "", ())


def offers(engine_name: str, scene: Scene, time_limit: float) -> tuple[str, Cannot | None, list[Setting]]:
    """An engine's version, what it cannot do with a scene, and else its settings, found out in a child.

    Raises ChildFailed when that fails, LookupError for an unknown engine.
    """
    _check(engine_name)
    return _in_child(worker.offers, (engine_name, scene), time_limit)


def time_interleaved(
    scene: Scene, times: np.ndarray, jobs: Sequence[worker.Job], repeats: int, time_limit: float
) -> list[list[float]]:
    """CPU seconds of stepping of every job, one list of ``repeats`` each, for speed comparisons.

    The jobs (engine name, setting) take turns in one child process after a warm-up round, so that
    all see the same machine.  A run that does not complete has NaN.  ``time_limit`` (s) is for all.
    Raises ChildFailed when there is no result, LookupError for an unknown engine.
    """
    for engine_name, _ in jobs:
        _check(engine_name)
    return _in_child(worker.run_interleaved, (scene, times, list(jobs), repeats), time_limit)


def stop_all() -> None:
    """Kill every running child of this process; their runs come back as CRASHED."""
    for child in tuple(_running):
        _kill(child)


def _check(engine_name: str) -> None:
    if ":" not in engine_name and engine_name not in engine_names():
        raise LookupError(f"unknown engine {engine_name!r}; known: {', '.join(engine_names())}")


def _in_child(function: Callable[..., Any], arguments: tuple, time_limit: float) -> Any:
    return _observed(function, arguments, time_limit).value


def _observed(function: Callable[..., Any], arguments: tuple, time_limit: float) -> Observation:
    with tempfile.TemporaryDirectory(prefix="crosscheck-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        (folder / "work").mkdir()
        (folder / "job").write_bytes(pickle.dumps((function, arguments, time_limit + ORPHAN_SECONDS)))
        with open(folder / "printed", "wb") as printed:
            status = _wait(_start(folder, printed), time_limit)
        value = _result(folder, status, time_limit)
        files = {str(path.relative_to(folder / "work")) for path in (folder / "work").rglob("*")}
        printed = (folder / "printed").read_text(errors="replace")
        return Observation(value, printed, tuple(sorted(files - {worker.VERSION})))


def _start(folder: Path, printed: IO[bytes]) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "crosscheck.worker", str(folder)],
        stdin=subprocess.DEVNULL, stdout=printed, stderr=subprocess.STDOUT,
        cwd=folder / "work", env=_environment(), start_new_session=True,
    )  # fmt: skip


def _environment() -> dict[str, str]:
    """The child finds every package this process finds, and computes with one thread."""
    path = os.pathsep.join(os.path.abspath(entry) for entry in sys.path)
    return {**os.environ, "PYTHONPATH": path, **dict.fromkeys(ONE_THREAD, "1")}


def _wait(child: subprocess.Popen, time_limit: float) -> int | None:
    """Exit status of the child, None when it had to be killed; an interrupt kills it too."""
    _running.add(child)
    try:
        return child.wait(time_limit)
    except subprocess.TimeoutExpired:
        return None
    finally:
        _running.discard(child)
        if child.poll() is None:
            _kill(child)


def _kill(child: subprocess.Popen) -> None:
    """End the child and what it started."""
    try:
        if hasattr(os, "killpg"):
            os.killpg(child.pid, signal.SIGKILL)
        else:
            child.kill()
    except ProcessLookupError:
        pass  # it has just ended by itself
    child.wait()


def _result(folder: Path, status: int | None, time_limit: float) -> Any:
    result = folder / "result"
    if result.exists():  # complete, even if the process then failed to end properly
        done, value = pickle.loads(result.read_bytes())
        if done:
            return value
        why = value
    elif status is None:
        why = f"no result after {time_limit:g} s"
    else:
        why = f"the process {_ending(status)}"
    outcome = Outcome.TIMED_OUT if status is None else Outcome.CRASHED
    version = folder / "work" / worker.VERSION
    raise ChildFailed(outcome, why + _quote(folder), version.read_text() if version.exists() else "")


def _ending(status: int) -> str:
    try:
        return f"was ended by {signal.Signals(-status).name}"
    except ValueError:
        return f"ended with exit status {status}"


def _quote(folder: Path) -> str:
    """The last line the engine printed, for the message."""
    lines = (folder / "printed").read_text(errors="replace").split("\n")
    last = next((line.strip() for line in reversed(lines) if line.strip()), "")
    return f"; last printed: {last[:PRINTED]}" if last else ""
