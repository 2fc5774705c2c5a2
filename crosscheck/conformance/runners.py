"""Runners call an engine for the suite, in child processes or, for tests, in this process."""

from __future__ import annotations

import contextlib
import io
import math
import signal
import tempfile
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from crosscheck.engine import Alternatives, Cannot, Engine, Setting, engine
from crosscheck.processes import serve
from crosscheck.processes.answer import answered
from crosscheck.processes.pool import ChildFailed, Observation, ask, observe, run_isolated
from crosscheck.refusals import shortened
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Scene

Task = tuple[Scene, Setting]


class Runner(Protocol):
    """Interface of a runner, which asks one engine for its settings and runs it; raises ChildFailed if the
    engine crashes when asked."""

    @property
    def name(self) -> str:
        """The engine's name."""

    @property
    def rounding(self) -> float:
        """Relative rounding error of the numbers that the engine declares."""

    @property
    def alternatives(self) -> Sequence[Alternatives]:
        """The engine's ways to solve the same equations."""

    @property
    def own_families(self) -> Sequence[str]:
        """The engine's families of settings that it integrates itself."""

    def offers(self, scene: Scene, family: str = "") -> tuple[str, Cannot | None, list[Setting]]:
        """Return the version, and the reason of a refusal or the settings, of the engine or of one family of
        settings."""

    def refuses(self, scene: Scene, family: str) -> Cannot | None:
        """Return the reason why the engine cannot run a scene at settings of a family, or None."""

    def observe(self, scene: Scene, times: np.ndarray, setting: Setting) -> Observation:
        """Return a run at times (k,), s, uninfluenced by earlier runs, with its printed text and the files it
        left."""

    def in_turn(self, tasks: Sequence[Task], times: np.ndarray) -> list[Trajectory]:
        """Return runs of (scene, setting) pairs that follow each other in one process."""


def own_families(engine: Engine) -> list[str]:
    """Return the families of settings that an engine integrates itself."""
    return [family for family in engine.families if family not in engine.integrated_here]


@contextlib.contextmanager
def answering() -> Iterator[None]:
    """Turn an exception of an engine that is asked into a ChildFailed with its message, as a child process
    does."""
    try:
        yield
    except ImportError:
        raise
    except Exception as error:
        raise ChildFailed(Outcome.CRASHED, shortened(f"{type(error).__name__}: {error}")) from error


@dataclass(frozen=True)
class Isolated:
    """Runner that makes each run in a child process with a time limit (s); ``name`` is a known engine or
    ``module:attribute``."""

    name: str
    time_limit: float

    @property
    def rounding(self) -> float:
        with answering():
            return engine(self.name).rounding

    @property
    def alternatives(self) -> Sequence[Alternatives]:
        with answering():
            return engine(self.name).alternatives

    @property
    def own_families(self) -> Sequence[str]:
        with answering():
            return own_families(engine(self.name))

    def offers(self, scene: Scene, family: str = "") -> tuple[str, Cannot | None, list[Setting]]:
        return ask(self.name, serve.offered, (scene, family), self.time_limit)

    def refuses(self, scene: Scene, family: str) -> Cannot | None:
        return ask(self.name, serve.refused, (scene, family), self.time_limit)

    def observe(self, scene: Scene, times: np.ndarray, setting: Setting) -> Observation:
        return observe(self.name, scene, times, setting, self.time_limit)

    def in_turn(self, tasks: Sequence[Task], times: np.ndarray) -> list[Trajectory]:
        return [run_isolated(self.name, scene, times, setting, self.time_limit) for scene, setting in tasks]


class _OutOfTime(BaseException):
    """End of a run at its time limit; no ``except Exception`` of an engine catches it."""


@contextlib.contextmanager
def _within(seconds: float) -> Iterator[None]:
    """Raise _OutOfTime after CPU seconds, as soon as a call into compiled code has returned; without effect
    outside the main thread, and on systems without timers."""
    in_main = threading.current_thread() is threading.main_thread()
    if not (math.isfinite(seconds) and in_main and hasattr(signal, "setitimer")):
        yield
        return

    def end(*_: object) -> None:
        raise _OutOfTime

    before = signal.signal(signal.SIGPROF, end)
    try:
        signal.setitimer(signal.ITIMER_PROF, seconds)
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


@dataclass(frozen=True)
class InProcess:
    """Runner in this process, in an empty directory: for engines that are trusted to return.

    ``called`` is the engine's name in commands if it differs from its own name. A run ends after CPU time
    ``time_limit`` (s) and the engine's ``compile_seconds``, without the time in which the engine prepares its
    first run.
    """

    engine: Engine
    called: str = ""
    time_limit: float = math.inf

    @property
    def name(self) -> str:
        return self.called or self.engine.name

    @property
    def rounding(self) -> float:
        return self.engine.rounding

    @property
    def alternatives(self) -> Sequence[Alternatives]:
        return self.engine.alternatives

    @property
    def own_families(self) -> Sequence[str]:
        return own_families(self.engine)

    def offers(self, scene: Scene, family: str = "") -> tuple[str, Cannot | None, list[Setting]]:
        with answering():
            return serve.offers_of(self.engine, scene, family)

    def refuses(self, scene: Scene, family: str) -> Cannot | None:
        with answering():
            return serve.refusal_of(self.engine, scene, family)

    def observe(self, scene: Scene, times: np.ndarray, setting: Setting) -> Observation:
        said = io.StringIO()
        with tempfile.TemporaryDirectory() as place, contextlib.chdir(place):
            with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
                run = self._run(scene, times, setting)
            files = tuple(sorted(path.name for path in Path(place).iterdir()))
        return Observation(run, said.getvalue(), files)

    def in_turn(self, tasks: Sequence[Task], times: np.ndarray) -> list[Trajectory]:
        return [self.observe(scene, times, setting).value for scene, setting in tasks]

    def _run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        """Return a run; an exception, a malformed result or the end of the time becomes the outcome CRASHED
        or TIMED_OUT with a message, as in a child process."""
        try:
            if math.isfinite(self.time_limit):
                self.engine.prepare([setting.family])
            with _within(self.time_limit + self.engine.compile_seconds):
                return answered(self.engine, scene, times, setting)
        except _OutOfTime:
            outcome, words = (
                Outcome.TIMED_OUT,
                f"no result after {self.time_limit + self.engine.compile_seconds:g} s",
            )
        except Exception as error:
            outcome, words = Outcome.CRASHED, shortened(f"{type(error).__name__}: {error}")
        return serve.failed(self.name, self.engine.version(), scene, setting, outcome, words)
