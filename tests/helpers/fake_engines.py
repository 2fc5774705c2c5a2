"""Engines for tests: one that leaves every body at its start, and variants of it that fail or misbehave."""

import ctypes
import itertools
import os
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from crosscheck.engine import Cannot, Owner, Setting
from mbref.motions.trajectory import Cost, Outcome, Trajectory
from mbref.scene import Scene
from tests.helpers.still_engines import Still

FAKES = __name__  # an engine is named f"{FAKES}:NAME"


class Fake(Still):
    """Leaves every body where it starts; ``options`` give the outcome and the time of a run."""

    name = "fake"
    package = "fake-package"

    def version(self) -> str:
        return "1.2.3"

    def cannot(self, scene: Scene) -> Cannot | None:
        return Cannot(Owner.MODEL, "this fake has no loads") if scene.load else None

    def settings(self, scene: Scene) -> list[Setting]:
        coarse_to_fine = [Setting("plain", {"seconds": s}) for s in (0.1, 0.2)]
        return [*coarse_to_fine, Setting("noisy", {"seconds": 0.5})]

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        made, options = super().run(scene, times, setting), setting.options
        outcome = Outcome[options.get("outcome", "COMPLETED")]
        return replace(made, outcome=outcome, cost=Cost(seconds=options.get("seconds", 0.1)))


class Segfault(Fake):
    name = "fake that crashes"

    def act(self, scene: Scene) -> None:
        os.write(2, b"about to touch a bad pointer\n")
        os.kill(os.getpid(), signal.SIGSEGV)


class Refusing(Fake):
    name = "refusing fake"

    def cannot(self, scene: Scene) -> Cannot:
        return Cannot(Owner.MODEL, "this fake runs nothing")


class NoSettings(Fake):
    name = "fake without settings"

    def settings(self, scene: Scene) -> list[Setting]:
        raise ValueError("no table of steps")


class Hang(Fake):
    """Sleeps, and so does a grandchild, whose process id is left in the file the scene's name gives."""

    def act(self, scene: Scene) -> None:
        grandchild = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
        Path(scene.name).write_text(str(grandchild.pid))
        time.sleep(600)


class Chatter(Fake):
    """Prints past Python's sys.stdout, as compiled code does, and writes into the working directory."""

    def act(self, scene: Scene) -> None:
        os.write(1, b"solver banner\n")
        print("python banner")
        Path("solution.txt").write_text("left behind")


class Raise(Fake):
    def act(self, scene: Scene) -> None:
        print("residual 1e+300", flush=True)
        raise ValueError("no such joint")


class Quit(Fake):
    def act(self, scene: Scene) -> None:
        os._exit(0)


class Threads(Fake):
    def version(self) -> str:
        return os.environ["OPENBLAS_NUM_THREADS"] + os.environ["OMP_NUM_THREADS"]


class Missing(Fake):
    def version(self) -> str:
        raise ModuleNotFoundError("No module named 'fake_package'")


class Recorder(Fake):
    """Its runs leave their order and process in the file that the scene's name gives; the options may have it
    sleep, raise or send itself a signal after that."""

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        with open(scene.name, "a") as file:
            file.write(f"{setting.family} {os.getpid()}\n")
        time.sleep(setting.options.get("sleep", 0.0))
        if "raise" in setting.options:
            raise ValueError(setting.options["raise"])
        if "signal" in setting.options:
            os.kill(os.getpid(), setting.options["signal"])
        return super().run(scene, times, setting)


class Aging(Fake):
    """Moves its bodies a little further in every run of a process."""

    runs = 0

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        self.runs += 1
        trajectory = super().run(scene, times, setting)
        return replace(trajectory, position=trajectory.position + 1e-14 * self.runs)


class Keeping(Fake):
    """Moves its bodies by the mass and setting of the first run of a process."""

    first: float | None = None

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        if self.first is None:
            self.first = sum(body.mass or 0.0 for body in scene.body) + setting.options["seconds"]
        trajectory = super().run(scene, times, setting)
        return replace(trajectory, position=trajectory.position + 1e-14 * self.first)


class Slow(Recorder):
    """Needs two seconds before the first run of a process."""

    is_ready = False

    def prepare(self, families: Sequence[str]) -> None:
        time.sleep(0.0 if self.is_ready else 2.0)
        self.is_ready = True


class Herald(Recorder):
    """Prints when it is made ready for the first time in a process."""

    is_ready = False

    def prepare(self, families: Sequence[str]) -> None:
        if not self.is_ready:
            print("a banner")
        self.is_ready = True


class Compiling(Fake):
    def prepare(self, families: Sequence[str]) -> None:
        print("compiling kernels", flush=True)
        time.sleep(0.5)


class CompilingModels(Fake):
    """Computes for 0.2 s of CPU time in each run, and says that it compiles for as long."""

    compile_seconds = 10.0

    def act(self, scene: Scene) -> None:
        computing(time.process_time() + 0.2)


class Varying(Fake):
    """Says that its runs take 2, 0.4, 1, 4, 0.7, 2, 0.4, … times the seconds of their settings."""

    factors = itertools.cycle((2.0, 0.4, 1.0, 4.0, 0.7))

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        made = super().run(scene, times, setting)
        return replace(made, cost=Cost(next(self.factors) * made.cost.seconds))


class Searching(Fake):
    """Writes begin and end of its compilation to the file FAKE_LOG, and waits a while for a second one."""

    def settings(self, scene: Scene) -> list[Setting]:
        log = Path(os.environ["FAKE_LOG"])
        with log.open("a", encoding="utf-8", buffering=1) as lines:
            lines.write("begin\n")
            for _ in range(40):
                if log.read_text(encoding="utf-8").count("begin") > 1:
                    break
                time.sleep(0.05)
            lines.write("end\n")
        return super().settings(scene)


class Stuck(Fake):
    def prepare(self, families: Sequence[str]) -> None:
        time.sleep(600)


class Malformed(Fake):
    """Damages a good answer by the function that its options name."""

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        return DAMAGES[setting.options["damage"]](super().run(scene, times, Setting(setting.family)))


DAMAGES = {
    "None": lambda good: None,
    "a dictionary": lambda good: good.to_record(),
    "a class": lambda good: Fake,
    "outcome as text": lambda good: replace(good, outcome="COMPLETED"),
    "other bodies": lambda good: replace(good, bodies=("someone",)),
    "no bodies": lambda good: replace(good, bodies=None),
    "other times": lambda good: replace(good, times=good.times + 1e-3),
    "few samples": lambda good: replace(good, times=good.times[:1], position=good.position[:1]),
    "few positions": lambda good: replace(good, position=good.position[:1]),
    "wrong shape": lambda good: replace(good, position=good.position[:, 0]),
    "velocity as text": lambda good: replace(good, velocity="fast"),
    "ragged velocity": lambda good: replace(good, velocity=[[1.0], [1.0, 2.0]]),
    "no rotation": lambda good: replace(good, orientation=0 * good.orientation),
    "unknown joint": lambda good: replace(good, reactions={"X": np.zeros((3, 6))}),
    "cost as a number": lambda good: replace(good, cost=1.0),
    "negative cost": lambda good: replace(good, cost=Cost(seconds=-0.1)),
    "another scene": lambda good: replace(good, scene="moving"),
    "blank version": lambda good: replace(good, version=" "),
    "cost of NaN": lambda good: replace(good, cost=Cost(seconds=float("nan"))),
    "settings of objects": lambda good: replace(good, settings={"a": Fake}),
    "a local class": lambda good: type("Local", (), {})(),
}


class Scalars(Fake):
    """Answers with numbers of numpy's and lists where Python's numbers and arrays are expected."""

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        good = super().run(scene, times, setting)
        cost = Cost(np.float32(0.5), np.float64(0.1), np.int64(7))
        lists = {"velocity": good.velocity.tolist(), "bodies": list(good.bodies)}
        settings = {"seconds": np.float64(0.5)}
        return replace(good, t_end=np.float64(good.t_end), cost=cost, settings=settings, **lists)


class Elsewhere(Fake):
    """Simulates another mechanism: every body is a millimetre from where the scene has it."""

    name = "elsewhere"

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        trajectory = super().run(scene, times, setting)
        return replace(trajectory, position=trajectory.position + 1e-3)


class LastOneRuns(Fake):
    """Has four families, of which the last completes."""

    name = "last"

    def settings(self, scene: Scene) -> list[Setting]:
        lost = [Setting(family, {"outcome": "NOT_CONVERGED"}) for family in ("first", "second", "third")]
        return [*lost, Setting("fourth", {})]


class Versionless(Fake):
    def version(self) -> str:
        raise RuntimeError("no licence")


FAKE, SEGFAULT, HANG, CHATTER, RAISE, QUIT = Fake(), Segfault(), Hang(), Chatter(), Raise(), Quit()
THREADS, MISSING, RECORDER, AGING = Threads(), Missing(), Recorder(), Aging()
KEEPING, HERALD = Keeping(), Herald()
SLOW, STUCK, COMPILING, SEARCHING = Slow(), Stuck(), Compiling(), Searching()
NO_SETTINGS, REFUSING = NoSettings(), Refusing()
MALFORMED, SCALARS, VERSIONLESS, VARYING = Malformed(), Scalars(), Versionless(), Varying()
COMPILING_MODELS = CompilingModels()
LAST_ONE_RUNS, ELSEWHERE = LastOneRuns(), Elsewhere()


def computing(seconds: float) -> None:
    """Compute for some CPU time (s)."""
    while time.process_time() < seconds:
        pass


def converse(text: str) -> tuple[str, int]:
    """Prints by Python, by the C library and to the descriptor, warns and leaves a file; says where it is."""
    print(text)
    ctypes.CDLL(None).printf(b"compiled %s\n", text.encode())
    warnings.warn("careful", stacklevel=1)
    Path(text).write_text("left behind")
    return os.getcwd(), os.getpid()
