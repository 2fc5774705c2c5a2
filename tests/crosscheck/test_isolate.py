"""Isolation: what a misbehaving engine does / the outcome that comes back."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.isolate import ChildFailed, run_isolated, stop_all, time_interleaved
from mbref.scene import Body, Scene
from mbref.trajectory import Outcome, Trajectory

TIMES = np.array([0.0, 0.1, 0.3])
PLAIN = Setting("plain", {"seconds": 0.25})
HERE = Path(__file__).parent


@pytest.fixture(autouse=True)
def _fakes_importable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(HERE))


def still(name: str = "still") -> Scene:
    return Scene(name=name, body=(Body(name="block", position=(1.0, 2.0, 3.0)),))


def run(fake: str, scene: Scene | None = None, time_limit: float = 60.0) -> Trajectory:
    return run_isolated(f"fake_engines:{fake}", scene or still(), TIMES, PLAIN, time_limit)


def gone(pid: int) -> bool:
    """Whether the process has ended, waiting a little for the system to notice."""
    for _ in range(100):
        status = Path(f"/proc/{pid}/stat")
        if not status.exists() or status.read_text().rsplit(")", 1)[1].split()[0] == "Z":
            return True
        time.sleep(0.05)
    return False


def test_isolated_run_and_run_in_this_process_agree():
    from fake_engines import FAKE

    here, there = FAKE.run(still(), TIMES, PLAIN), run("FAKE")
    assert there.to_record() == here.to_record(), (there, here)


@pytest.mark.parametrize(
    ("fake", "message", "version"),
    [
        ("SEGFAULT", "the process was ended by SIGSEGV; last printed: about to touch a bad pointer", "1.2.3"),
        ("RAISE", "ValueError: no such joint; last printed: residual 1e+300", "1.2.3"),
        ("QUIT", "the process ended with exit status 0", "1.2.3"),
        ("MISSING", "fake-package is not installed: No module named 'fake_package'", ""),
    ],
)
def test_failure_of_an_engine_and_the_trajectory(fake: str, message: str, version: str):
    ended = run(fake)
    assert (ended.outcome, ended.message, ended.version) == (Outcome.CRASHED, message, version)
    assert (ended.method, ended.settings) == (PLAIN.family, PLAIN.options)
    assert ended.position.shape == (0, 1, 3), ended.position.shape


def test_hang_is_killed_with_all_it_started(tmp_path: Path):
    pid = tmp_path / "pid"
    ended = run("HANG", still(str(pid)), time_limit=4.0)
    assert (ended.outcome, ended.message) == (Outcome.TIMED_OUT, "no result after 4 s"), ended.message
    assert gone(int(pid.read_text())), f"grandchild {pid.read_text()} is still alive"


def test_printing_and_files_of_an_engine_leave_no_trace(
    capfd: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    ended = run("CHATTER")
    assert ended.outcome is Outcome.COMPLETED, ended.message
    assert capfd.readouterr() == ("", ""), "the engine's printing reached this process"
    assert list(tmp_path.iterdir()) == [], "files were left in the working directory"


def test_child_computes_with_one_thread():
    ended = run("THREADS")
    assert ended.version == "11", f"OPENBLAS and OMP threads, one digit each: {ended.version}"


def test_unknown_engine_is_refused_before_anything_starts():
    with pytest.raises(LookupError, match="unknown engine 'nosuch'; known: mbref"):
        run_isolated("nosuch", still(), TIMES, PLAIN, 1.0)


def test_interrupting_the_parent_ends_the_child(tmp_path: Path):
    pid = tmp_path / "pid"
    script = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "from test_isolate import run, still\n"
        "run('HANG', still(sys.argv[2]), 60.0)\n"
    )
    parent = subprocess.Popen(
        [sys.executable, "-c", script, str(HERE), str(pid)], stderr=subprocess.PIPE, cwd=HERE.parents[1]
    )
    while not (pid.exists() and pid.read_text()):
        assert parent.poll() is None, parent.communicate()
        time.sleep(0.05)
    parent.send_signal(signal.SIGINT)
    _, said = parent.communicate(timeout=30)
    assert b"KeyboardInterrupt" in said, said
    assert gone(int(pid.read_text())), "the grandchild survived the interrupt"


def test_stop_all_ends_running_children(tmp_path: Path):
    from concurrent.futures import ThreadPoolExecutor

    pid = tmp_path / "pid"
    with ThreadPoolExecutor(1) as pool:
        future = pool.submit(run, "HANG", still(str(pid)))
        while not (pid.exists() and pid.read_text()):
            assert not future.done(), future.result().message
            time.sleep(0.05)
        stop_all()
        ended = future.result(timeout=30)
    assert (ended.outcome, ended.message) == (Outcome.CRASHED, "the process was ended by SIGKILL")


def test_interleaved_runs_take_turns_after_a_warm_up(tmp_path: Path):
    log = tmp_path / "log"
    jobs = [
        ("fake_engines:RECORDER", Setting("a", {"seconds": 0.5})),
        ("fake_engines:RECORDER", Setting("b", {"seconds": 0.7, "outcome": "NOT_CONVERGED"})),
    ]
    seconds = time_interleaved(still(str(log)), TIMES, jobs, repeats=2, time_limit=60.0)
    assert seconds[0] == [0.5, 0.5], seconds
    assert len(seconds[1]) == 2, seconds
    assert all(map(math.isnan, seconds[1])), f"an incomplete run has no time: {seconds}"
    order, processes = zip(*(line.split() for line in log.read_text().splitlines()), strict=True)
    assert order == ("a", "b") * 3, order
    assert len(set(processes)) == 1, f"one process for all, got {set(processes)}"
    assert int(processes[0]) != os.getpid()


def test_interleaved_crash_is_an_error():
    jobs = [("fake_engines:FAKE", PLAIN), ("fake_engines:SEGFAULT", PLAIN)]
    with pytest.raises(ChildFailed, match="SIGSEGV") as caught:
        time_interleaved(still(), TIMES, jobs, repeats=1, time_limit=60.0)
    assert caught.value.outcome is Outcome.CRASHED
