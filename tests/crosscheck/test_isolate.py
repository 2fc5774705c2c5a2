"""Isolation: what a misbehaving engine does / the outcome that comes back."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from crosscheck.conformance.runners import InProcess
from crosscheck.engine import Setting
from crosscheck.processes import fork_server
from crosscheck.processes.child import ChildFailed, stop_all
from crosscheck.processes.interrupts import calls_ended
from crosscheck.processes.pool import (
    ask,
    capabilities,
    end_idle,
    observe,
    run_in_turn,
    run_isolated,
    starting,
    time_interleaved,
)
from mbref.scene import Scene
from mbref.scenes import SCENES
from mbref.trajectory import Outcome, Trajectory
from tests.helpers.fake_engines import FAKE, FAKES, CompilingModels, converse
from tests.helpers.still_engines import resting as still

TIMES = np.array([0.0, 0.1, 0.3])
PLAIN = Setting("plain", {"seconds": 0.25})
HERE = Path(__file__).parent


@pytest.fixture(autouse=True)
def _children_of_its_own() -> Iterator[None]:
    end_idle()
    yield
    end_idle()


def run(fake: str, scene: Scene | None = None, time_limit: float = 60.0) -> Trajectory:
    return run_isolated(f"{FAKES}:{fake}", scene or still(), TIMES, PLAIN, time_limit)


def gone(pid: int) -> bool:
    """Whether the process has ended, waiting a little for the system to notice."""
    for _ in range(100):
        status = Path(f"/proc/{pid}/stat")
        if not status.exists() or status.read_text().rsplit(")", 1)[1].split()[0] == "Z":
            return True
        time.sleep(0.05)
    return False


def test_isolated_run_and_run_in_this_process_agree():
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
    observed = observe(f"{FAKES}:{fake}", still(), TIMES, PLAIN, 60.0)
    assert observed.value.to_record() == ended.to_record(), (observed.value, ended)


def test_compilation_of_a_model_extends_the_time_limit():
    runner = InProcess(CompilingModels(), time_limit=0.1)
    for ended in (run("COMPILING_MODELS", time_limit=0.1), runner.observe(still(), TIMES, PLAIN).value):
        assert ended.outcome is Outcome.COMPLETED, ended.message
    runner.engine.compile_seconds = 0.0
    ended = runner.observe(still(), TIMES, PLAIN).value
    assert ended.outcome is Outcome.TIMED_OUT and ended.message == "no result after 0.1 s"


def test_observed_runs_and_a_process_for_each(tmp_path: Path):
    """Each says what making the engine ready printed, and leaves no process behind."""
    log = tmp_path / "log"
    seen = [observe(f"{FAKES}:HERALD", still(str(log)), TIMES, PLAIN, 60.0) for _ in range(3)]
    assert [one.printed for one in seen] == ["a banner\n"] * 3, seen
    processes = [int(line.split()[1]) for line in log.read_text().splitlines()]
    assert len(set(processes)) == 3, processes
    assert all(gone(process) for process in processes), processes


def test_observed_run_that_hangs_is_killed_with_all_it_started(tmp_path: Path):
    pid = tmp_path / "pid"
    ended = observe(f"{FAKES}:HANG", still(str(pid)), TIMES, PLAIN, 2.0).value
    assert (ended.outcome, ended.message) == (Outcome.TIMED_OUT, "no result after 2 s"), ended.message
    assert gone(int(pid.read_text())), f"grandchild {pid.read_text()} is still alive"


def test_printing_and_files_of_an_engine_leave_no_trace(
    capfd: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    ended = run("CHATTER")
    assert ended.outcome is Outcome.COMPLETED, ended.message
    assert capfd.readouterr() == ("", ""), "the engine's printing reached this process"
    assert list(tmp_path.iterdir()) == [], "files were left in the working directory"


def test_child_computes_with_one_thread(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    ended = run("THREADS")
    assert ended.version == "11", f"OPENBLAS and OMP threads, one digit each: {ended.version}"


def test_runs_of_an_engine_share_a_process_until_one_does_not_complete(tmp_path: Path):
    """Process of every run, as the engine itself sees it."""
    log = tmp_path / "log"
    ways = [{}, {}, {"outcome": "NOT_CONVERGED"}, {}, {"raise": "no such joint"}, {}, {"signal": 11}, {}, {}]
    outcomes = [
        run_isolated(f"{FAKES}:RECORDER", still(str(log)), TIMES, Setting("a", way), 60.0).outcome.name
        for way in ways
    ]
    completed, crashed = "COMPLETED", "CRASHED"
    assert outcomes == [
        completed,
        completed,
        "NOT_CONVERGED",
        completed,
        crashed,
        completed,
        crashed,
        completed,
        completed,
    ], outcomes
    processes = [line.split()[1] for line in log.read_text().splitlines()]
    alike = [first == second for first, second in pairwise(processes)]
    assert alike == [True, True, False, True, False, True, False, True], processes
    assert len(set(processes)) == 4, processes


def test_runs_in_turn_share_a_process_until_one_is_ended(tmp_path: Path):
    """An engine that ends early by itself serves on; one that hangs ends at its limit."""
    log = tmp_path / "log"
    ways = [({}, 60.0), ({"outcome": "NOT_CONVERGED"}, 60.0), ({}, 60.0), ({"sleep": 60.0}, 1.0), ({}, 60.0)]
    outcomes = [
        run_in_turn(f"{FAKES}:RECORDER", still(str(log)), TIMES, Setting("a", way), limit).outcome.name
        for way, limit in ways
    ]
    completed = "COMPLETED"
    assert outcomes == [completed, "NOT_CONVERGED", completed, "TIMED_OUT", completed], outcomes
    processes = [line.split()[1] for line in log.read_text().splitlines()]
    alike = [first == second for first, second in pairwise(processes)]
    assert alike == [True, True, True, False], processes


def test_run_after_a_time_out_has_its_whole_time(tmp_path: Path):
    """Getting ready takes this engine longer than its runs may."""
    log, limit = tmp_path / "log", 1.5
    ways = [{}, {"sleep": 60.0}, {}]
    runs = [run_isolated(f"{FAKES}:SLOW", still(str(log)), TIMES, Setting("a", way), limit) for way in ways]
    assert [r.outcome.name for r in runs] == ["COMPLETED", "TIMED_OUT", "COMPLETED"], runs
    first, second, third = (line.split()[1] for line in log.read_text().splitlines())
    assert first == second != third, (first, second, third)


def test_engine_that_hangs_while_it_gets_ready_times_out(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("crosscheck.processes.pool.READY_SECONDS", 1.0)
    ended = run("STUCK", time_limit=60.0)
    assert (ended.outcome, ended.message) == (Outcome.TIMED_OUT, "no result after 1 s"), ended.message


def test_engine_that_compiles_and_what_it_prints_meanwhile():
    with ThreadPoolExecutor(1) as thread:
        setting = Setting("plain", {"seconds": 0.25})
        made = thread.submit(run_in_turn, f"{FAKES}:COMPILING", still(), TIMES, setting, 60.0)
        seen = set()
        while not made.done():
            seen |= set(starting().values())
        assert made.result().outcome is Outcome.COMPLETED, made.result().message
    assert {"compiling kernels", f"{FAKES}:COMPILING plain starts"} >= seen >= {"compiling kernels"}
    assert not starting()


def test_engine_is_asked_alone_until_it_has_answered_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    log = tmp_path / "log"
    monkeypatch.setenv("FAKE_LOG", str(log))
    with ThreadPoolExecutor(2) as threads:
        asked = [
            threads.submit(capabilities, f"{FAKES}:SEARCHING", still(name), 60.0) for name in ("one", "two")
        ]
    assert all(len(answer.result()[2]) == 3 for answer in asked), asked
    assert log.read_text().split() == ["begin", "end"] * 2, log.read_text()


def test_engines_do_not_share_a_process(tmp_path: Path):
    log, plain = tmp_path / "log", Setting("a")
    for fake in ("RECORDER", "SLOW", "RECORDER"):
        run_isolated(f"{FAKES}:{fake}", still(str(log)), TIMES, plain, 60.0)
    first, other, again = (line.split()[1] for line in log.read_text().splitlines())
    assert first != other, "two engines in one process"
    assert first == again, "the child of the first engine did not wait for it"


def test_no_child_outlives_its_parent(tmp_path: Path):
    """Neither one that waits after the parent's normal end, nor one whose parent is killed."""
    log = tmp_path / "log"
    script = (
        "import os, sys; sys.path.insert(0, sys.argv[1])\n"
        "from test_isolate import run, still\n"
        "run('RECORDER', still(sys.argv[2]))\n"
        "if sys.argv[3] == 'killed': os.kill(os.getpid(), 9)\n"
    )
    for way, status in (("ended", 0), ("killed", -9)):
        command = [sys.executable, "-W", "error", "-c", script, str(HERE), str(log), way]
        ended = subprocess.run(command, cwd=HERE.parents[1], capture_output=True, timeout=60, check=False)
        assert (ended.returncode, ended.stderr) == (status, b""), ended
        pid = int(log.read_text().splitlines()[-1].split()[1])
        assert gone(pid), f"parent {way}: its child is still alive"


REAL = {  # settings of two families each
    "mbref": (Setting("alf-dual+projection", {"rtol": 1e-6}), Setting("mpi-svd+none", {"rtol": 1e-6})),
    "mujoco": (Setting("stock", {"step": 1e-3}), Setting("defaults", {"step": 1e-3})),
    "pinocchio": (Setting("proximal", {"step": 1e-4}), Setting("baumgarte", {"step": 1e-4})),
    "exudyn": (Setting("alpha", {"step": 2e-4}), Setting("static", {"step": 1e-3})),
}


@pytest.mark.parametrize("name", REAL)
def test_runs_in_one_process_and_in_processes_of_their_own_agree(name: str):
    times = np.linspace(0.0, 0.01, 5)
    scenes = SCENES["five_bar"](), SCENES["spatial_slider_crank_driven"]()
    first, second = jobs = list(zip(scenes, REAL[name], strict=True))
    alone = [observe(name, scene, times, setting, 60.0).value for scene, setting in jobs]
    shared = [run_isolated(name, scene, times, setting, 60.0) for scene, setting in (first, second, first)]
    assert all(run.outcome is Outcome.COMPLETED for run in shared), shared
    assert list(map(untimed, shared)) == [untimed(alone[0]), untimed(alone[1]), untimed(alone[0])]


def untimed(run: Trajectory) -> str:
    """The record of a run without the seconds it took, in bits (NaN equal to NaN)."""
    record = run.to_record()
    return repr({**record, "cost": {k: v for k, v in record["cost"].items() if "seconds" not in k}})


def test_unknown_engine_is_refused_before_anything_starts():
    with pytest.raises(LookupError, match="unknown engine 'nosuch'; known: mbref"):
        run_isolated("nosuch", still(), TIMES, PLAIN, 1.0)


@pytest.mark.parametrize("sent", ["SIGINT", "SIGTERM", "SIGKILL"])
def test_the_end_of_the_parent_ends_the_child_within_a_call(sent: str, tmp_path: Path):
    if sent != "SIGINT" and not fork_server.AVAILABLE:
        pytest.skip("without a fork server the child ends itself after its limit")
    pid = tmp_path / "pid"
    script = (
        "import signal, sys; sys.path.insert(0, sys.argv[1])\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # a shell's background job ignores it
        "from test_isolate import run, still\n"
        "run('HANG', still(sys.argv[2]), 60.0)\n"
    )
    parent = subprocess.Popen(
        [sys.executable, "-c", script, str(HERE), str(pid)], stderr=subprocess.PIPE, cwd=HERE.parents[1]
    )
    while not (pid.exists() and pid.read_text()):
        assert parent.poll() is None, parent.communicate()
        time.sleep(0.05)
    parent.send_signal(getattr(signal, sent))
    _, said = parent.communicate(timeout=30)
    assert (b"KeyboardInterrupt" in said) is (sent == "SIGINT"), said
    assert gone(int(pid.read_text())), f"the grandchild survived {sent}"


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
    _, served = ask(f"{FAKES}:RECORDER", converse, (), 60.0)
    jobs = [
        (f"{FAKES}:RECORDER", Setting("a", {"seconds": 0.5})),
        (f"{FAKES}:RECORDER", Setting("b", {"seconds": 0.7, "outcome": "NOT_CONVERGED"})),
    ]
    seconds = time_interleaved(still(str(log)), TIMES, jobs, repeats=2, time_limit=60.0)
    assert seconds[0] == [0.5, 0.5], seconds
    assert len(seconds[1]) == 2, seconds
    assert all(map(math.isnan, seconds[1])), f"an incomplete run has no time: {seconds}"
    order, processes = zip(*(line.split() for line in log.read_text().splitlines()), strict=True)
    assert order == ("a", "b") * 3, order
    assert len(set(processes)) == 1, f"one process for all, got {set(processes)}"
    assert int(processes[0]) != os.getpid()
    assert int(processes[0]) == served, "the child that has imported the first job's engine is used again"
    time_interleaved(still(str(log)), TIMES, jobs, repeats=1, time_limit=60.0)
    assert log.read_text().splitlines()[-1].split()[1] == processes[0], (
        "the process times the next scene, too"
    )


def test_interleaved_crash_is_an_error():
    jobs = [(f"{FAKES}:FAKE", PLAIN), (f"{FAKES}:SEGFAULT", PLAIN)]
    with pytest.raises(ChildFailed, match="SIGSEGV") as caught:
        time_interleaved(still(), TIMES, jobs, repeats=1, time_limit=60.0)
    assert caught.value.outcome is Outcome.CRASHED


def test_an_interrupt_ends_the_calls_of_threads(tmp_path: Path):
    """The running call ends with its child, and the waiting call does not begin."""
    pid = tmp_path / "pid"
    with ThreadPoolExecutor(1) as pool:
        calls = [pool.submit(run, "HANG", still(str(pid))) for _ in range(2)]
        with pytest.raises(KeyboardInterrupt), calls_ended(calls):
            while not (pid.exists() and pid.read_text()):
                time.sleep(0.05)
            raise KeyboardInterrupt
        assert calls[0].result(timeout=0).message == "the process was ended by SIGKILL"
        assert calls[1].cancelled()
