"""Kills of processes at random moments of a study or an ensemble, and counts of lost and repeated records.
``python -m tests.kills --runs 200 --times 20`` kills (SIGKILL) the parent of a study, the child processes of
its engine, and the worker processes of an ensemble, each so many times, and prints a line for each; exit
status 1 where a record is lost, written twice, or where more runs are lost than processes were killed."""

import argparse
import json
import multiprocessing
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from crosscheck.engine import Setting
from crosscheck.study.grid import Case, study
from mbref.ensembles.ensemble import ensemble
from mbref.ensembles.processes import processes
from mbref.scene import Body, Scene
from mbref.scene.variation import Variation, variants
from mbref.scenes import SCENES

HERE = Path(__file__).parent
PARENT = """
import sys
sys.path.insert(0, {root!r})
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from crosscheck.study.grid import run_here, study
from tests.kills import cases

study(cases({runs}, Path({log!r}), 0.005), ThreadPoolExecutor(2), {path!r}, run=run_here)
"""
DRIVEN = SCENES["spatial_slider_crank_driven"]()
MASS = [Variation("body[slider].mass", 0.9, 1.1)]


class Counted(NamedTuple):
    """Processes killed; records wanted and found; keys found twice; runs lost to a kill; runs made in all."""

    kills: int
    wanted: int
    found: int
    twice: int
    crashed: int
    made: int

    @property
    def is_sound(self) -> bool:
        """Whether all records are there once, and a kill cost one run at most."""
        return self.found == self.wanted and not self.twice and self.crashed <= self.kills

    def __str__(self) -> str:
        return (
            f"{self.kills} kills, {self.found} of {self.wanted} records, {self.twice} twice, "
            f"{self.crashed} runs CRASHED, {self.made} runs made"
        )


def cases(runs: int, log: Path, sleep: float) -> list[Case]:
    """Runs of an engine that writes into the log as each begins, and sleeps so long (s)."""
    block = Body(name="block", mass=2.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 2.0, 3.0))
    scene, times = Scene(name=str(log), body=(block,)), np.array([0.0, 0.1, 0.3])
    settings = [Setting(str(k), {"sleep": sleep}) for k in range(runs)]
    return [Case(scene, times, "tests.helpers.fake_engines:RECORDER", setting) for setting in settings]


def parents(runs: int, times: int, folder: Path) -> Counted:
    """The process that makes a study is killed, and the study is started again."""
    path, log = folder / "records.jsonl", folder / "log"
    program = PARENT.format(root=str(HERE.parent), runs=runs, log=str(log), path=str(path))
    draw, kills = random.Random(3), 0
    for _ in range(times):
        before = _lines(path)
        kills += _killed(program, path, before + draw.randint(1, 9), draw)
        assert _lines(path) >= before, "a record was lost"
    subprocess.run([sys.executable, "-c", program], check=True)
    return _counted(kills, runs, path, 0, _lines(log))


def _killed(program: str, path: Path, goal: int, draw: random.Random) -> bool:
    """Whether a program was killed when it had written so many lines, before its end."""
    process = subprocess.Popen([sys.executable, "-c", program], stderr=subprocess.DEVNULL)
    while process.poll() is None and _lines(path) < goal:
        time.sleep(draw.uniform(0.0, 0.002))
    is_running = process.poll() is None
    process.kill()
    process.wait()
    return is_running


def children(runs: int, times: int, folder: Path) -> Counted:
    """The child processes that run an engine are killed while their study goes on."""
    path, log, draw = folder / "records.jsonl", folder / "log", random.Random(4)
    every = max(1, runs // times)

    def kill(k: int) -> bool:
        """The process of the run that began last."""
        if _lines(log) < 1 + k * every:
            return False
        time.sleep(draw.uniform(0.0, 0.03))
        return _kill(int(log.read_text().split()[-1]))

    with _killer(kill, times) as killed:
        records = study(cases(runs, log, 0.02), records_path=path)
    outcomes = [record["outcome"] for record in records]
    assert set(outcomes) <= {"COMPLETED", "CRASHED"}, outcomes
    return _counted(len(killed), runs, path, outcomes.count("CRASHED"), _lines(log))


def workers(runs: int, times: int, folder: Path) -> Counted:
    """The worker processes of an ensemble are killed; their runs are repeated afterwards."""
    path, draw = folder / "ensemble.jsonl", random.Random(5)
    every = max(1, runs // (times + 1))

    def kill(k: int) -> bool:
        found = [process.pid for process in multiprocessing.active_children() if process.pid]
        if _lines(path) < 1 + k * every or not found:
            return False
        time.sleep(draw.uniform(0.0, 0.03))
        return _kill(draw.choice(found))

    outcomes: list[str] = []
    with _killer(kill, times) as killed:
        outcomes += _ensemble(runs, path)
    crashed = outcomes.count("CRASHED")
    again = _ensemble(runs, path)
    assert set(again) == {"COMPLETED"}, again
    return _counted(len(killed), runs, path, crashed, runs + crashed)


def _ensemble(runs: int, path: Path) -> list[str]:
    with processes(2) as pool:
        made = ensemble(variants(DRIVEN, MASS, runs), [0.0, 0.01], executor=pool, path=path)
        return [run.outcome.label for _, run in made]


@contextmanager
def _killer(kill: Callable[[int], bool], times: int) -> Iterator[list[float]]:
    """A thread that calls ``kill(k)`` until it has killed so many processes; the times of the kills."""
    done, over = [], threading.Event()

    def work() -> None:
        while len(done) < times and not over.wait(0.001):
            if kill(len(done)):
                done.append(time.monotonic())

    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield done
    finally:
        over.set()
        thread.join()


def _kill(pid: int) -> bool:
    """Whether there was such a process."""
    with suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)
        return True
    return False


def _lines(path: Path) -> int:
    return path.read_bytes().count(b"\n") if path.exists() else 0


def _counted(kills: int, wanted: int, path: Path, crashed: int, made: int) -> Counted:
    keys = [json.loads(line)["key"] for line in path.read_text().splitlines()]
    return Counted(kills, wanted, len(set(keys)), len(keys) - len(set(keys)), crashed, made)


KINDS = {"parents": parents, "children": children, "workers": workers}


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m tests.kills", description=__doc__)
    parser.add_argument("kinds", nargs="*", default=list(KINDS), metavar="KIND", help=", ".join(KINDS))
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--times", type=int, default=20)
    options = parser.parse_args()
    found = []
    for kind in options.kinds:
        with tempfile.TemporaryDirectory() as folder:
            found.append(KINDS[kind](options.runs, options.times, Path(folder)))
        print(f"{kind}: {found[-1]}", flush=True)
    return 0 if all(counted.is_sound and counted.kills == options.times for counted in found) else 1


if __name__ == "__main__":
    sys.exit(main())
