"""The child process of `isolate`: calls the function pickled in a folder and leaves the result there.

``python -m crosscheck.worker FOLDER`` reads ``FOLDER/job`` (function, arguments, seconds after which
the child ends itself should its parent have died) and writes ``FOLDER/result``: (True, value) or
(False, sentence).
"""

from __future__ import annotations

import faulthandler
import pickle
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from crosscheck.engine import Cannot, Setting, engine
from mbref.scene import Scene
from mbref.trajectory import Outcome, Trajectory

Job = tuple[str, Setting]  # engine name and setting
VERSION = "version"  # the file that keeps an engine's version should its run crash


def run_once(engine_name: str, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
    """One run; a missing package is a failed trajectory that says what to install.

    The version is left in the file ``version`` of the working directory for the case of a crash.
    """
    simulator = engine(engine_name)
    try:
        version = simulator.version()
    except ImportError as error:
        message = f"{simulator.package} is not installed: {error}"
        return failed(engine_name, "", scene, setting, Outcome.CRASHED, message)
    Path(VERSION).write_text(version)
    return simulator.run(scene, times, setting)


def offers(engine_name: str, scene: Scene) -> tuple[str, Cannot | None, list[Setting]]:
    """Version, what cannot be done with the scene, and, where nothing hinders, the settings."""
    simulator = engine(engine_name)
    version, cannot = simulator.version(), simulator.cannot(scene)
    return version, cannot, [] if cannot else list(simulator.settings(scene))


def run_interleaved(
    scene: Scene, times: np.ndarray, jobs: Sequence[Job], repeats: int
) -> list[list[float]]:  # fmt: skip
    """``cost.seconds`` of every repeat of every job, round-robin after a warm-up round.

    NaN where a run did not complete: the time of a part is not the time of the whole.
    """
    simulators = [(engine(name), setting) for name, setting in jobs]

    def one_round() -> list[float]:
        runs = [simulator.run(scene, times, setting) for simulator, setting in simulators]
        return [r.cost.seconds if r.outcome is Outcome.COMPLETED else float("nan") for r in runs]

    one_round()
    rounds = [one_round() for _ in range(repeats)]
    return [list(seconds) for seconds in zip(*rounds, strict=True)]


def failed(
    engine_name: str, version: str, scene: Scene, setting: Setting, outcome: Outcome, message: str
) -> Trajectory:
    """The trajectory of a run that gave no state."""
    return Trajectory.failed(
        scene=scene.name, engine=engine_name, version=version, method=setting.family,
        settings=dict(setting.options), bodies=tuple(b.name for b in scene.body), outcome=outcome,
        message=message,
    )  # fmt: skip


def main(folder: Path) -> None:
    """Do the job in the folder: call its function, leave the result or the failure's sentence beside it."""
    function, arguments, last_resort = pickle.loads((folder / "job").read_bytes())
    faulthandler.dump_traceback_later(last_resort, exit=True)
    try:
        result = pickle.dumps((True, function(*arguments)))
    except Exception as error:  # the parent turns the sentence into an Outcome
        result = pickle.dumps((False, traceback.format_exception_only(error)[-1].strip()))
    (folder / "partial").write_bytes(result)
    (folder / "partial").rename(folder / "result")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
