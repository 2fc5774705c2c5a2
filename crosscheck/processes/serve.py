"""The program of a child process: it makes calls, each in a directory of its own, until its parent closes the
connection.

``python -m crosscheck.processes.serve`` has the channel to its parent as standard input.  The parent sends
(directory, seconds after which the child ends itself if the parent has died, function, arguments, whether a
copy of the child calls the function). The child answers (True, value) or (False, sentence). It answers
GREETING by no bytes, which shows the parent that it is alive.
"""

from __future__ import annotations

import contextlib
import ctypes
import faulthandler
import os
import pickle
import sys
import time
import traceback
import warnings
from collections.abc import Callable, Sequence
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any, NoReturn

import numpy as np

from crosscheck.engine import Cannot, Engine, Owner, Setting, engine
from crosscheck.processes.answer import answered
from crosscheck.refusals import shortened
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Scene, SceneError

Job = tuple[str, Setting]  # engine name and setting
Capabilities = tuple[str, Cannot | None, list[Setting]]
GREETING = None


def get_ready(engine_name: str, families: Sequence[str]) -> tuple[str, float]:
    """Import and compile what an engine needs once.

    Returns its version, empty if its package is missing, and the CPU time (s) by which it extends the time
    limit of its runs.
    """
    simulator = engine(engine_name)
    try:
        version = simulator.version()
    except ImportError:  # the run reports the missing package
        return "", 0.0
    simulator.prepare(families)
    return str(version), float(simulator.compile_seconds)


def run_once(engine_name: str, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
    """Return one run; a missing package gives a failed trajectory whose message says what to install.

    Raises MalformedAnswer if the engine returns no trajectory of this run.
    """
    simulator = engine(engine_name)
    try:
        simulator.version()
    except ImportError as error:
        message = f"{simulator.package} is not installed: {error}"
        return failed(engine_name, "", scene, setting, Outcome.CRASHED, message)
    return answered(simulator, scene, times, setting)


def run_estimated(
    engine_name: str, scene: Scene, times: np.ndarray, setting: Setting, seconds: float
) -> Trajectory:
    """Return `run_once` with the engine's own estimate of its error, made within CPU time (s)."""
    run = run_once(engine_name, scene, times, setting)
    return engine(engine_name).with_error_estimate(run, seconds) if run.times.size else run


def capabilities(engine_name: str, scene: Scene) -> Capabilities:
    """Return the engine's version, the reason why it cannot run the scene or None, and its settings if the
    engine can run the scene."""
    simulator = engine(engine_name)
    version, cannot = simulator.version(), simulator.cannot(scene)
    return version, cannot, [] if cannot else list(simulator.settings(scene))


def offered(engine_name: str, scene: Scene, family: str) -> Capabilities:
    """Return `offers_of` for the engine of that name."""
    return offers_of(engine(engine_name), scene, family)


def offers_of(simulator: Engine, scene: Scene, family: str) -> Capabilities:
    """Return an engine's version, its refusal or None, and the settings of a family or of its best family."""
    if cannot := simulator.cannot(scene):
        return simulator.version(), cannot, []
    settings = simulator.settings_of(scene, family) if family else simulator.best_settings(scene)
    if family and not settings:
        return simulator.version(), _unserved(family), []
    return simulator.version(), None, list(settings)


def refused(engine_name: str, scene: Scene, family: str) -> Cannot | None:
    """Return `refusal_of` for the engine of that name."""
    return refusal_of(engine(engine_name), scene, family)


def refusal_of(simulator: Engine, scene: Scene, family: str) -> Cannot | None:
    """Return the reason why an engine cannot run a scene at settings of a family, or None."""
    return simulator.cannot(scene) or (None if simulator.serves(scene, family) else _unserved(family))


def _unserved(family: str) -> Cannot:
    return Cannot(Owner.MODEL, f"{family} has no settings for this scene")


def run_round(scene: Scene, times: np.ndarray, jobs: Sequence[Job]) -> list[tuple[float, float]]:
    """Return ``cost.seconds`` of one run of every job, and the CPU time (s) of the whole run.

    A run that did not complete has NaN, since its time is not the time of a complete run.
    """
    found = []
    for name, setting in jobs:
        began = time.process_time()
        run = engine(name).run(scene, times, setting)
        seconds = run.cost.seconds if run.outcome is Outcome.COMPLETED else float("nan")
        found.append((seconds, time.process_time() - began))
    return found


def failed(
    engine_name: str, version: str, scene: Scene, setting: Setting, outcome: Outcome, message: str
) -> Trajectory:
    """Return the trajectory of a run that gave no state."""
    return Trajectory.failed(
        scene=scene.name,
        engine=engine_name,
        version=version,
        method=setting.family,
        settings=dict(setting.options),
        bodies=tuple(b.name for b in scene.body),
        outcome=outcome,
        message=message,
    )


def main() -> None:
    """Make the calls that the parent sends over standard input, which is empty for the engines."""
    channel: Connection[Any, Any] = Connection(os.dup(0))
    with open(os.devnull) as nothing:
        os.dup2(nothing.fileno(), 0)
    while True:
        try:
            job = channel.recv()
        except EOFError:
            return
        if job is GREETING:
            channel.send_bytes(b"")
            continue
        folder, last_resort, function, arguments, in_copy = job
        os.chdir(folder)
        called = _answer_of_copy if in_copy else _answer_within
        channel.send_bytes(called(last_resort, function, arguments))


def _answer_within(last_resort: float, function: Callable[..., Any], arguments: tuple[Any, ...]) -> bytes:
    """Return the pickled result; the process ends itself after ``last_resort`` (s)."""
    faulthandler.dump_traceback_later(last_resort, exit=True)
    answer = _answer(function, arguments)
    faulthandler.cancel_dump_traceback_later()
    return answer


def _answer_of_copy(last_resort: float, function: Callable[..., Any], arguments: tuple[Any, ...]) -> bytes:
    """Return the pickled result of a forked copy; if the copy crashes, this process ends in the same way."""
    ours, theirs = Pipe(duplex=False)
    if not (copy := os.fork()):
        ours.close()
        theirs.send_bytes(_answer_within(last_resort, function, arguments))
        os._exit(0)
    theirs.close()
    answer = b""
    with contextlib.suppress(EOFError), ours:
        answer = ours.recv_bytes()
    status = os.waitstatus_to_exitcode(os.waitpid(copy, 0)[1])
    return answer or _end_as(status)


def _end_as(status: int) -> NoReturn:
    """End this process by a signal if the exit status is its negative number, otherwise with the status."""
    if status < 0:
        os.kill(os.getpid(), -status)
    os._exit(max(status, 0))


def _answer(function: Callable[..., Any], arguments: tuple[Any, ...]) -> bytes:
    """Return the pickled result; warnings and printed text of the call do not affect the next one."""
    try:
        with warnings.catch_warnings():  # reset the filter, so that each call warns again
            return pickle.dumps((True, function(*arguments)))
    except SceneError as error:
        return pickle.dumps((False, shortened(str(error))))
    except Exception as error:  # the parent turns the message into an Outcome
        return pickle.dumps((False, shortened(traceback.format_exception_only(error)[-1].strip())))
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        ctypes.CDLL(None).fflush(None)  # prints the buffered output of compiled code


if __name__ == "__main__":
    main()
