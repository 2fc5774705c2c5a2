"""Engines that leave every body where it starts, and do one more thing that a test asks for. A child process
finds them as ``tests.helpers.still_engines:NAME``. The environment variable STILL_LOG names their log."""

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from crosscheck.engine import Cannot, Cost, Engine, Owner, Scene, Setting, Trajectory
from mbref.scene import Body

LONG = "words " * 1_700_000 + "end"  # a text of 10 MB
FOR_FIVE_MINUTES = [sys.executable, "-S", "-c", "import time; time.sleep(300)"]


def resting(name: str = "resting") -> Scene:
    """Return a scene of one body at rest."""
    return Scene(name=name, body=(Body(name="block", position=(1.0, 2.0, 3.0)),))


class Still(Engine):
    """An engine that leaves every body where it starts."""

    name = "still"
    package = "still"
    message = ""

    def version(self) -> str:
        return "1.0"

    def cannot(self, scene: Scene) -> Cannot | None:
        return self.refuses(scene)

    def settings(self, scene: Scene) -> list[Setting]:
        return [Setting("plain", {})]

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        self.act(scene)
        nothing = np.zeros((len(times), len(scene.body), 3))
        places = nothing + [body.position for body in scene.body]
        turns = np.zeros((*nothing.shape[:2], 4)) + [body.orientation for body in scene.body]
        asked = (scene.name, self.name, self.version(), setting.family, dict(setting.options))
        names = tuple(body.name for body in scene.body)
        end = {"message": self.message, "t_end": float(times[-1]), "cost": Cost(seconds=0.1)}
        return Trajectory(*asked, np.array(times), names, places, turns, nothing, nothing, **end)

    def act(self, scene: Scene) -> None:
        """Do nothing more."""


class Logged(Still):
    """Appends the number of its process to a file."""

    def act(self, scene: Scene) -> None:
        with Path(os.environ["STILL_LOG"]).open("a") as log:
            log.write(f"{os.getpid()}\n")


class WithProgram(Still):
    """Starts a program of five minutes, appends both process numbers to a file, and returns or waits."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds

    def act(self, scene: Scene) -> None:
        started = subprocess.Popen(FOR_FIVE_MINUTES)
        with Path(os.environ["STILL_LOG"]).open("a") as log:
            log.write(f"{os.getpid()} {started.pid}\n")
        time.sleep(self.seconds)


class Talkative(Still):
    """Ends with a message of 10 MB."""

    message = LONG


class Failing(Still):
    """Raises an error whose message has 10 MB."""

    def act(self, scene: Scene) -> None:
        raise RuntimeError(LONG)


class Refusing(Still):
    """Refuses every scene with a reason of 10 MB."""

    def refuses(self, scene: Scene) -> Cannot | None:
        return Cannot(Owner.MODEL, LONG)


LOGGED, TALKATIVE, FAILING, REFUSING = Logged(), Talkative(), Failing(), Refusing()
LEAVES_A_PROGRAM, WAITS_WITH_A_PROGRAM = WithProgram(0.0), WithProgram(300.0)
