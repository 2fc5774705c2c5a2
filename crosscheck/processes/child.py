"""A child process that makes calls one after another; a crash, a hang or an interrupt ends only the child.

Each call works in a temporary directory. Everything printed is captured at file-descriptor level, and
numerical libraries get one thread. The child ends when its parent ends.

Calls and results are pickled. An engine in the child is trusted, like any installed package: the child
process protects against accidents, not against malicious code.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from multiprocessing import Pipe
from pathlib import Path
from typing import Any, NamedTuple

import psutil

from crosscheck.processes import fork_server, serve
from crosscheck.processes.fork_server import Forked
from mbref.motions.trajectory import Outcome

ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
INTERVAL = 0.2  # s, between two readings of a child's CPU time
LOADED = 10.0  # largest wall time of a call on a busy machine / its limit of CPU time
ORPHAN_SECONDS = 10.0  # s after which a child ends itself if its parent has died
ENDING_SECONDS = 10.0  # s in which a child without connection must end by itself
WAKING_SECONDS = 10.0  # s in which a waiting child must answer a greeting, on a loaded machine
TAIL = 4000  # last bytes of the output, searched for the last printed line
PRINTED = 200  # characters of the last printed line that a message quotes

Function = Callable[..., Any]
Arguments = tuple[Any, ...]

_alive: set[Child] = set()


class ChildFailed(Exception):
    """A call gave no result: ``outcome`` TIMED_OUT or CRASHED, and a sentence."""

    def __init__(self, outcome: Outcome, message: str):
        self.outcome = outcome
        super().__init__(message)


class Observation(NamedTuple):
    """Result of a call: its value, the printed text, and the files left in its working directory."""

    value: Any
    printed: str
    files: tuple[str, ...]


class Child:
    """A child process; its owner must call ``close``.

    It runs the interpreter ``python`` of another environment that has crosscheck on its path, or this one.
    """

    def __init__(self, python: Path | None = None) -> None:
        self.ready: Observation | None = None  # result of preparing the engine, for copies of the process
        self._copies = False  # True if a copy of the process makes the present call
        self._printed = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 - closed by `close`
        self._channel, theirs = Pipe()
        with theirs:
            self._process = _started(theirs.fileno(), self._printed.fileno(), python)
        _alive.add(self)

    @property
    def is_alive(self) -> bool:
        """Return whether the process is running."""
        return self._process.poll() is None

    def answers(self) -> bool:
        """Return whether the waiting child answers a greeting; a child that was killed meanwhile does not."""
        try:
            self._channel.send(serve.GREETING)
            return self._channel.poll(WAKING_SECONDS) and self._channel.recv_bytes() == b""
        except (EOFError, OSError):
            return False

    def call(
        self, function: Function, arguments: Arguments, time_limit: float, in_copy: bool = False
    ) -> Observation:
        """Call ``function(*arguments)`` in the child, or in a copy of it that leaves nothing behind, within
        ``time_limit`` (s).

        The limit applies to CPU time and to time of waiting. Raises ChildFailed; the child has then ended, as
        after an interrupt.
        """
        try:
            return self._called((function, arguments, in_copy), time_limit)
        except BaseException:
            self.kill()
            raise

    def last_printed(self) -> str:
        """Return the last line that the present call has printed so far."""
        size = os.fstat(self._printed.fileno()).st_size
        # does not move the file position that both processes share
        text = os.pread(self._printed.fileno(), TAIL, max(0, size - TAIL))
        return _last_line(text.decode(errors="replace"))

    def kill(self) -> None:
        """End the process and its child processes; a running call fails."""
        if self.is_alive:
            with contextlib.suppress(ProcessLookupError):  # the process may have ended just now
                os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()

    def close(self) -> None:
        """Kill the process and release its channel and its captured output."""
        self.kill()
        _alive.discard(self)
        self._channel.close()
        self._printed.close()

    def _called(self, asked: tuple[Function, Arguments, bool], time_limit: float) -> Observation:
        self._copies = asked[-1]
        self._printed.seek(0)  # the child writes at this position, too, because it shares the open file
        self._printed.truncate()
        with tempfile.TemporaryDirectory(prefix="crosscheck-", ignore_cleanup_errors=True) as folder:
            self._ask((folder, LOADED * time_limit + ORPHAN_SECONDS, *asked), time_limit)
            is_value, value = self._answer()
            files = sorted(str(path.relative_to(folder)) for path in Path(folder).rglob("*"))
        if not is_value:
            raise self._failure(Outcome.CRASHED, value)
        return Observation(value, self._said(), tuple(files))

    def _ask(self, job: tuple[Any, ...], time_limit: float) -> None:
        """Send the job and wait for a result or the time limit."""
        # the child has closed the connection; receiving reports it
        with contextlib.suppress(BrokenPipeError):
            self._channel.send(job)
        if not self._has_answer(time_limit):
            raise self._failure(Outcome.TIMED_OUT, f"no result after {time_limit:g} s")

    def _has_answer(self, time_limit: float) -> bool:
        """Return whether a result can be received before the child has used up its time.

        The limit applies to CPU time, and to wall time while the child uses no CPU time. On a busy machine
        wall time may be LOADED times the limit.
        """
        began, used, cpu = time.monotonic(), 0.0, self._cpu_seconds()
        while (left := time_limit - used) > 0:
            interval = min(left, INTERVAL)
            if self._channel.poll(interval):
                return True
            now = self._cpu_seconds()
            used = max(used + (now - cpu or interval), (time.monotonic() - began) / LOADED)
            cpu = now
        return False

    def _cpu_seconds(self) -> float:
        """Return CPU seconds of the process and of the copy that makes the call, without their children; 0
        after the end."""
        try:
            process = psutil.Process(self._process.pid)
            copies = process.children() if self._copies else []
            times = [member.cpu_times() for member in (process, *copies)]
        except psutil.Error:
            return 0.0
        return sum(used.user + used.system for used in times)

    def _answer(self) -> tuple[bool, Any]:
        try:
            return pickle.loads(self._channel.recv_bytes())
        except (EOFError, ConnectionError):
            raise self._failure(Outcome.CRASHED, f"the process {self._ending()}") from None
        except Exception as error:  # unpickling an engine's result can raise any exception
            raise self._failure(Outcome.CRASHED, f"its answer cannot be read: {error}") from None

    def _ending(self) -> str:
        try:
            status = self._process.wait(ENDING_SECONDS)
        except subprocess.TimeoutExpired:
            return "does not answer"
        try:
            return f"was ended by {signal.Signals(-status).name}"
        except ValueError:
            return f"ended with exit status {status}"

    def _said(self) -> str:
        self._printed.seek(0)
        return self._printed.read().decode(errors="replace")

    def _failure(self, outcome: Outcome, sentence: str) -> ChildFailed:
        """Return the failure with the sentence and the last printed line."""
        last = _last_line(self._said())
        return ChildFailed(outcome, sentence + (f"; last printed: {last[:PRINTED]}" if last else ""))


def _last_line(text: str) -> str:
    return next((line.strip() for line in reversed(text.split("\n")) if line.strip()), "")


def stop_all() -> None:
    """Kill every child of this process; running calls fail."""
    for child in tuple(_alive):
        child.kill()


def _started(channel: int, printed: int, python: Path | None) -> Forked | subprocess.Popen[bytes]:
    """Return a new process that reads its calls from a file descriptor and prints to another."""
    environment = _environment()
    if python is not None:
        del environment["PYTHONPATH"]  # the packages of this environment follow its own, by its path file
    elif fork_server.AVAILABLE:
        with contextlib.suppress(EOFError, OSError):  # the server has ended
            return fork_server.forked(channel, printed, environment)
    return subprocess.Popen(
        [python or sys.executable, "-P", "-m", "crosscheck.processes.serve"],
        stdin=channel,
        stdout=printed,
        stderr=subprocess.STDOUT,
        env=environment,
        start_new_session=True,
    )


def _environment() -> dict[str, str]:
    """Return the environment of the child: it finds all packages of this process, and computes with one
    thread."""
    path = os.pathsep.join(os.path.abspath(entry) for entry in sys.path)
    return {**os.environ, "PYTHONPATH": path, **dict.fromkeys(ONE_THREAD, "1")}
