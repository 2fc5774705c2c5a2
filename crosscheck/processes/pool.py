"""Runs in child processes with a time limit; every run returns a Trajectory, whatever the engine does.

An engine's imports and compilation take up to seconds, so a child serves successive runs of one engine. A run
that does not complete ends its child, and the next run gets a new one.
"""

from __future__ import annotations

import atexit
import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from functools import partial
from threading import Lock, get_ident
from typing import Any

import numpy as np

from crosscheck.engine import BUILT_IN, ON_REQUEST, OPTIONAL, Cannot, Setting, engine_names
from crosscheck.processes import fork_server, serve
from crosscheck.processes.child import Child, ChildFailed, Observation
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Scene

OWN_ENGINES = (*BUILT_IN, *OPTIONAL, *ON_REQUEST)
MOST_IDLE = 8  # idle children: about one for every engine
NO_ENGINE = ""  # name of the engine-free child that computes metrics for the judge
EVERY_ENGINE = "*"  # name of the child in which the runs of all engines take turns
ESTIMATED = 0.1  # fraction of a run's time limit that its error estimate may take
FAR_BEHIND = 100.0  # time / time of the fastest setting; above it further repeats do not change the ranking
TIMING_SECONDS = 20.0  # CPU s of all runs of a scene by turns, after which no further repeat begins
READY_SECONDS = 600.0  # s for imports and compilation, before the time limit of a run applies

Question = Callable[..., Trajectory]  # a function of `serve` that makes a run

_idle: list[tuple[str, Child]] = []  # idle children with their engines, the latest one at the end
_lending = Lock()
_preparing: dict[str, Lock] = {}  # keyed by engine
_starting: dict[int, tuple[str, Child]] = {}  # engine or family, and its child in preparation, by thread
_prepared: set[tuple[str, str | None]] = (
    set()
)  # engine and family of settings that a child has prepared; None for a question


def run_isolated(
    engine_name: str, scene: Scene, times: np.ndarray, setting: Setting, time_limit: float
) -> Trajectory:
    """Return the engine's trajectory at ``times`` (k,), computed in a child process.

    ``engine_name`` is a known engine or ``module:attribute``. ``time_limit`` is CPU time (s) of the run, or
    of waiting, without imports and compilation; the engine's ``compile_seconds`` extend it. A crash, a hang,
    an exception or a missing package gives a trajectory without states and with outcome CRASHED or TIMED_OUT.
    Raises LookupError for an unknown engine.
    """
    return _run_alone(serve.run_once, engine_name, scene, times, setting, time_limit)


def run_estimated(
    engine_name: str, scene: Scene, times: np.ndarray, setting: Setting, time_limit: float
) -> Trajectory:
    """Run like `run_isolated`, with the engine's own estimate of its error if the engine makes one.

    The estimate may take ESTIMATED of the time limit; a run that took longer has none.
    """
    question = partial(serve.run_estimated, seconds=ESTIMATED * time_limit)
    return _run_alone(question, engine_name, scene, times, setting, time_limit)


def _run_alone(
    question: Question, engine_name: str, scene: Scene, times: np.ndarray, setting: Setting, time_limit: float
) -> Trajectory:
    _check(engine_name)
    with _in_use(engine_name) as child:
        run = _observed(child, engine_name, scene, times, setting, time_limit, question=question).value
        if run.outcome is not Outcome.COMPLETED:
            child.kill()
    return run


def run_in_turn(
    engine_name: str, scene: Scene, times: np.ndarray, setting: Setting, time_limit: float
) -> Trajectory:
    """Run like `run_isolated`, in a child that is used again after failed runs.

    This suits many short runs of an engine that ends by itself and leaves no files.
    """
    _check(engine_name)
    with _in_use(engine_name) as child:
        return _observed(child, engine_name, scene, times, setting, time_limit).value


def apart(function: Callable[..., Any], arguments: tuple[Any, ...], time_limit: float) -> Any:
    """Return ``function(*arguments)``, computed in a child process within CPU time (s); raises
    ChildFailed."""
    with _in_use(NO_ENGINE) as child:
        return child.call(function, arguments, time_limit).value


def observe(
    engine_name: str, scene: Scene, times: np.ndarray, setting: Setting, time_limit: float
) -> Observation:
    """Run like `run_isolated` in a process of its own, and return also what was printed and the files that
    the run left.

    Both texts are empty if the run gave no result, since its message then quotes the printed text. The
    process is new, or a copy of a process that has only prepared the engine.
    """
    _check(engine_name)
    if fork_server.AVAILABLE:
        return _observed_in_copy(engine_name, scene, times, setting, time_limit)
    with closing(Child()) as child:
        return _observed(child, engine_name, scene, times, setting, time_limit)


def _observed_in_copy(
    engine_name: str, scene: Scene, times: np.ndarray, setting: Setting, time_limit: float
) -> Observation:
    with _in_use(f"{engine_name} {setting.family} ready") as child:
        seen = _observed(child, engine_name, scene, times, setting, time_limit, in_copy=True)
        if seen.value.outcome is not Outcome.COMPLETED:
            child.kill()
    return seen


def capabilities(
    engine_name: str, scene: Scene, time_limit: float
) -> tuple[str, Cannot | None, list[Setting]]:
    """Return an engine's version, its refusal of a scene or None, and otherwise its settings, all found out
    in a child process.

    Raises ChildFailed if that fails, LookupError for an unknown engine.
    """
    return ask(engine_name, serve.capabilities, (scene,), time_limit)


def ask(engine_name: str, question: Callable[..., Any], about: tuple[Any, ...], time_limit: float) -> Any:
    """Return ``question(engine_name, *about)``, called in a child that has served the engine before, or in a
    new child.

    Raises ChildFailed if that fails, LookupError for an unknown engine.
    """
    _check(engine_name)
    with _in_use(engine_name) as child, _starts(engine_name, child), _alone_at_first(engine_name):
        return child.call(question, (engine_name, *about), time_limit).value


def time_interleaved(
    scene: Scene,
    times: np.ndarray,
    jobs: Sequence[serve.Job],
    repeats: int,
    time_limit: float,
    after_round: Callable[[], None] = lambda: None,
    most_seconds: float = TIMING_SECONDS,
) -> list[list[float]]:
    """Return CPU seconds of stepping for speed comparisons: for every job a list of up to ``repeats`` times.

    The jobs (engine name, setting) take turns in one child process after a warm-up round, so that all jobs
    see the same machine. An idle child of the first job's engine is used, since mbref's child has loaded
    kernels. The same child times the next scene. A run that does not complete has NaN. A job that takes more
    than FAR_BEHIND times as long as the fastest one has one repeat. A further repeat begins only before all
    runs have taken ``most_seconds`` of CPU time, with what is not stepping, such as a search for events.
    ``time_limit`` (s) is for all rounds together. Raises ChildFailed if the child gives no result,
    LookupError for an unknown engine.
    """
    for engine_name, _ in jobs:
        _check(engine_name)
    found: list[list[float]] = [[] for _ in jobs]
    with _in_use(EVERY_ENGINE, instead=jobs[0][0]) as child:

        def a_round(chosen: Sequence[int]) -> list[tuple[float, float]]:
            asked, left = (scene, times, [jobs[k] for k in chosen]), max(0.0, end - time.monotonic())
            rows: list[tuple[float, float]] = child.call(serve.run_round, asked, left).value
            after_round()
            return rows

        end = time.monotonic() + time_limit
        warm = a_round(range(len(jobs)))
        spent = sum(whole for _, whole in warm)
        limit = FAR_BEHIND * min((s for s, _ in warm if s > 0.0), default=float("inf"))
        for number in range(repeats):
            chosen = [k for k, (before, _) in enumerate(warm) if number == 0 or not before > limit]
            if not chosen or (number and spent > most_seconds):
                break
            for k, (seconds, whole) in zip(chosen, a_round(chosen), strict=True):
                found[k].append(seconds)
                spent += whole
    return found


def end_idle() -> None:
    """End the idle children."""
    with _lending:
        idle = [child for _, child in _idle]
        _idle.clear()
    for child in idle:
        child.close()


atexit.register(end_idle)
os.register_at_fork(after_in_child=_idle.clear)  # idle children belong to the process that started them


def _check(engine_name: str) -> None:
    if ":" in engine_name or engine_name in OWN_ENGINES:
        return
    if engine_name not in (known := engine_names()):  # reads files of installed packages
        raise LookupError(f"unknown engine {engine_name!r}; known: {', '.join(known)}")


def _observed(
    child: Child,
    engine_name: str,
    scene: Scene,
    times: np.ndarray,
    setting: Setting,
    time_limit: float,
    in_copy: bool = False,
    question: Question = serve.run_once,
) -> Observation:
    version = ""
    try:
        if child.ready is None or not in_copy:
            child.ready = _made_ready(child, engine_name, setting.family)
        (version, more), said, _ = child.ready
        seen = child.call(question, (engine_name, scene, times, setting), time_limit + more, in_copy)
    except ChildFailed as failure:
        outcome, message = failure.outcome, str(failure)
        return Observation(serve.failed(engine_name, version, scene, setting, outcome, message), "", ())
    return seen._replace(printed=said + seen.printed)


def _made_ready(child: Child, engine_name: str, family: str) -> Observation:
    """Return the engine's version and compile_seconds after preparing the engine."""
    with _starts(f"{engine_name} {family}", child), _alone_at_first(engine_name, family):
        return child.call(serve.get_ready, (engine_name, [family]), READY_SECONDS)


@contextmanager
def _alone_at_first(engine_name: str, family: str | None = None) -> Iterator[None]:
    """Let one child at a time prepare an engine's family of settings, or answer questions about an engine,
    until a child is ready.

    Two children would compile the same code.
    """
    if (engine_name, family) in _prepared:
        yield
        return
    with _preparing.setdefault(engine_name, Lock()):
        yield
        _prepared.add((engine_name, family))


@contextmanager
def _starts(what: str, child: Child) -> Iterator[None]:
    """Count a child as starting under a name while the ``with`` block runs."""
    _starting[get_ident()] = what, child
    try:
        yield
    finally:
        del _starting[get_ident()]


def starting() -> dict[int, str]:
    """Return, for each thread that waits for a starting engine, the last line that the engine printed, or
    that it starts."""
    return {
        thread: child.last_printed() or f"{what} starts" for thread, (what, child) in _starting.copy().items()
    }


@contextmanager
def _in_use(engine_name: str, instead: str = NO_ENGINE) -> Iterator[Child]:
    """Return an idle child of the engine, or of the engine ``instead``, or a new child."""
    child = _idle_child(engine_name) or (_idle_child(instead) if instead else None) or Child()
    try:
        yield child
    finally:
        _put_back(engine_name, child)


def _idle_child(engine_name: str) -> Child | None:
    """Return the engine's latest idle child that answers, which is then in use; None if there is none."""
    while child := _taken(engine_name):
        if child.answers():
            return child
        child.close()  # it was killed while it waited
    return None


def _taken(engine_name: str) -> Child | None:
    with _lending:
        known = [entry for entry in _idle if entry[0] == engine_name]
        if not known:
            return None
        _idle.remove(known[-1])
        return known[-1][1]


def _put_back(engine_name: str, child: Child) -> None:
    """Keep the child for another run if it is alive and fewer than MOST_IDLE children are idle."""
    with _lending:
        _idle.append((engine_name, child))
        waiting = [entry for entry in _idle if entry[1].is_alive][-MOST_IDLE:]
        ended = [entry for entry in _idle if entry not in waiting]
        _idle[:] = waiting
    for _, spent in ended:
        spent.close()
