"""Child processes: one that was killed while it waited is replaced, and none outlives its parent."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.processes.pool import end_idle, run_isolated
from mbref.motions.trajectory import Outcome
from tests.helpers.processes import PATIENCE, is_gone
from tests.helpers.still_engines import resting

ENGINES = "tests.helpers.still_engines"
ROOT = Path(__file__).parents[3]
RUN = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell ignores it in jobs in the background
from crosscheck.engine import Setting
from crosscheck.processes.pool import run_isolated
from tests.helpers.still_engines import resting
run_isolated(sys.argv[1], resting(), [0.0, 1.0], Setting("plain", {}), 60.0)
sys.stdin.read()
"""
PROGRAM = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell ignores it in jobs in the background
from crosscheck.processes.program import run_program
sys.exit(run_program("waiting_module", sys.argv[1:]))
"""
WAITING = """
import os, signal, subprocess, sys, time
signal.signal(signal.SIGINT, signal.SIG_DFL)
started = subprocess.Popen([sys.executable, "-S", "-c", "import time; time.sleep(300)"])
print(os.getpid(), started.pid, *sys.argv[1:], flush=True)
time.sleep(300)
"""


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """File to which engines append the numbers of their processes."""
    monkeypatch.setenv("STILL_LOG", str(tmp_path / "log"))
    return tmp_path / "log"


def numbers_in(log: Path) -> list[int]:
    """Return the process numbers of the log's last line, waiting for it."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if log.exists() and (text := log.read_text()).endswith("\n"):
            return [int(number) for number in text.splitlines()[-1].split()]
        time.sleep(0.02)
    raise AssertionError(f"nothing was written to {log}")


def test_child_process_that_is_killed_between_two_runs_is_replaced(log: Path):
    """Five runs complete in five processes, whose numbers differ: SIGKILL ends each process after its run."""
    end_idle()
    for _ in range(5):
        run = run_isolated(f"{ENGINES}:LOGGED", resting(), np.array([0.0, 1.0]), Setting("plain", {}), 60.0)
        assert run.outcome is Outcome.COMPLETED, run.message
        os.kill(numbers_in(log)[-1], signal.SIGKILL)  # the next run begins before or after its end
    assert len(set(log.read_text().split())) == 5
    end_idle()


@pytest.mark.parametrize(
    ("engine", "way"),
    [
        ("LOGGED", "end"),
        ("LEAVES_A_PROGRAM", "SIGKILL"),
        *(("WAITS_WITH_A_PROGRAM", name) for name in ("SIGINT", "SIGTERM", "SIGKILL")),
    ],
)
def test_processes_of_an_engine_end_with_a_parent_that_ends_or_is_killed(engine: str, way: str, log: Path):
    """The parent ends in the engine's run or after it, by a signal, or as its standard input is closed."""
    command = [sys.executable, "-c", RUN, f"{ENGINES}:{engine}"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, cwd=ROOT) as parent:
        processes = numbers_in(log)
        if way != "end":
            parent.send_signal(getattr(signal, way))
    assert all(map(is_gone, processes)), processes


def parent_ended_by(number: signal.Signals, folder: Path) -> tuple[int, int, int]:
    """Return the exit status of a parent that a signal ends, and the numbers of its program and of the
    process that this has started. The parent runs the program as `crosscheck report` runs its own."""
    (folder / "waiting_module.py").write_text(WAITING)
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{folder}"}
    command = [sys.executable, "-c", PROGRAM, "--option"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment, cwd=folder) as parent:
        assert parent.stdout is not None
        program, started, *options = parent.stdout.readline().split()
        parent.send_signal(number)
        status = parent.wait()
    assert options == [b"--option"]
    return status, int(program), int(started)


def test_program_and_its_processes_end_when_sigkill_ends_the_parent(tmp_path: Path):
    """SIGKILL cannot be passed on by the parent; the operating system ends its children."""
    _, program, started = parent_ended_by(signal.SIGKILL, tmp_path)
    assert is_gone(program) and is_gone(started)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_to_the_parent_ends_the_program_whose_exit_status_the_parent_returns(number, tmp_path: Path):
    """A program that a signal n ends has the status -n, which is 256 - n in a byte."""
    status, program, started = parent_ended_by(number, tmp_path)
    os.kill(started, signal.SIGKILL)
    assert is_gone(program) and status == 256 - number


@pytest.mark.slow
@pytest.mark.parametrize("command", ["report", "compare"])
def test_command_that_is_killed_leaves_no_process(command: str, log: Path, tmp_path: Path):
    """The command's processes are found by STILL_LOG in their environment. There are three at least: the
    command, the engine's process and the program that the engine started."""
    options = ["--out", str(tmp_path / "out")] if command == "report" else []
    resting().save(tmp_path / "resting.toml")
    asked = [command, str(tmp_path / "resting.toml"), "--engine", f"{ENGINES}:WAITS_WITH_A_PROGRAM", *options]
    with subprocess.Popen([sys.executable, "-m", "crosscheck", *asked], cwd=ROOT) as parent:
        numbers_in(log)
        assert len(logging_to(log)) > 2
        parent.kill()
    assert all(map(is_gone, logging_to(log)))


def logging_to(log: Path) -> list[int]:
    """Return the numbers of the processes, except this one, whose environment names the log."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if f"STILL_LOG={log}".encode() in (folder / "environ").read_bytes():
                found.append(int(folder.name))
        except OSError:  # another user's process, or one that has just ended
            continue
    return found
