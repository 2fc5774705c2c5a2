"""Engines in child processes: outcomes of failures, limits, processes that are shared or ended."""

import math
import os
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from crosscheck.conformance.runners import InProcess
from crosscheck.engine import Setting
from crosscheck.processes.child import ChildFailed, stop_all
from crosscheck.processes.interrupts import calls_ended
from crosscheck.processes.pool import (
    apart,
    ask,
    capabilities,
    end_idle,
    observe,
    run_in_turn,
    run_isolated,
    starting,
    time_interleaved,
)
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Scene
from mbref.scene.structure import refuse_intervals
from mbref.scenes import SCENES
from tests.helpers.fake_engines import FAKES, CompilingModels, converse
from tests.helpers.intermittent_mechanisms import intermittent_mechanism
from tests.helpers.processes import is_gone
from tests.helpers.still_engines import resting as still

TIMES = np.array([0.0, 0.1, 0.3])
PLAIN = Setting("plain", {"seconds": 0.25})  # the fake says that its run took 0.25 s


@pytest.fixture(autouse=True)
def _children_of_its_own() -> Iterator[None]:
    end_idle()
    yield
    end_idle()


def run(fake: str, scene: Scene | None = None, time_limit: float = 60.0) -> Trajectory:
    return run_isolated(f"{FAKES}:{fake}", scene or still(), TIMES, PLAIN, time_limit)


@pytest.mark.parametrize(
    ("fake", "message", "version"),
    [
        ("SEGFAULT", "the process was ended by SIGSEGV; last printed: about to touch a bad pointer", "1.2.3"),
        ("RAISE", "ValueError: no such joint; last printed: residual 1e+300", "1.2.3"),
        ("QUIT", "the process ended with exit status 0", "1.2.3"),
        ("MISSING", "fake-package is not installed: No module named 'fake_package'", ""),
    ],
)
def test_a_failed_engine_gives_a_crashed_trajectory_with_the_cause(fake: str, message: str, version: str):
    """The engines end their process, raise, quit, or miss a package. The trajectory has the setting and no
    samples, whether the run has a process of its own (``observe``) or shares one."""
    ended = run(fake)
    assert (ended.outcome, ended.message, ended.version) == (Outcome.CRASHED, message, version)
    assert (ended.method, ended.settings) == (PLAIN.family, PLAIN.options)
    assert ended.position.shape == (0, 1, 3), ended.position.shape
    observed = observe(f"{FAKES}:{fake}", still(), TIMES, PLAIN, 60.0)
    assert observed.value.to_record() == ended.to_record(), (observed.value, ended)


def test_the_time_that_an_engine_needs_to_compile_extends_the_limit_of_a_run():
    """The engine computes for 0.2 s at a limit of 0.1 s. A run in a child and one in this process complete if
    it says that it compiles for up to 10 s, and time out if not."""
    runner = InProcess(CompilingModels(), time_limit=0.1)
    for ended in (run("COMPILING_MODELS", time_limit=0.1), runner.observe(still(), TIMES, PLAIN).value):
        assert ended.outcome is Outcome.COMPLETED, ended.message
    runner.engine.compile_seconds = 0.0
    ended = runner.observe(still(), TIMES, PLAIN).value
    assert ended.outcome is Outcome.TIMED_OUT and ended.message == "no result after 0.1 s"


def test_every_observed_run_has_a_process_of_its_own_that_ends(tmp_path: Path):
    """The engine HERALD prints a banner when a process prepares it for the first time, and logs the process
    of each run: three runs have three banners and three processes, which end."""
    log = tmp_path / "log"
    seen = [observe(f"{FAKES}:HERALD", still(str(log)), TIMES, PLAIN, 60.0) for _ in range(3)]
    assert [one.printed for one in seen] == ["a banner\n"] * 3, seen
    processes = [int(line.split()[1]) for line in log.read_text().splitlines()]
    assert len(set(processes)) == 3, processes
    assert all(is_gone(process) for process in processes), processes


def test_output_and_files_of_an_engine_do_not_reach_the_parent_process(capfd, tmp_path, monkeypatch):
    """CHATTER prints and writes a file into its working folder."""
    monkeypatch.chdir(tmp_path)
    ended = run("CHATTER")
    assert ended.outcome is Outcome.COMPLETED, ended.message
    assert capfd.readouterr() == ("", "")
    assert list(tmp_path.iterdir()) == []


def test_a_child_computes_with_one_thread(monkeypatch: pytest.MonkeyPatch):
    """The environment asks for two. THREADS gives OpenBLAS' and OpenMP's numbers, 1 and 1, as its version."""
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    assert run("THREADS").version == "11"


def test_runs_of_an_engine_share_a_process_until_one_does_not_complete(tmp_path: Path):
    """RECORDER logs the process of every run. A run that does not complete is its process's last."""
    log = tmp_path / "log"
    runs = [  # options, outcome, number of the process
        ({}, "COMPLETED", 0),
        ({}, "COMPLETED", 0),
        ({"outcome": "NOT_CONVERGED"}, "NOT_CONVERGED", 0),
        ({}, "COMPLETED", 1),
        ({"raise": "no such joint"}, "CRASHED", 1),
        ({}, "COMPLETED", 2),
        ({"signal": 11}, "CRASHED", 2),
        ({}, "COMPLETED", 3),
        ({}, "COMPLETED", 3),
    ]
    for options, outcome, _ in runs:
        ended = run_isolated(f"{FAKES}:RECORDER", still(str(log)), TIMES, Setting("a", options), 60.0)
        assert ended.outcome.name == outcome, options
    assert numbered(log) == [process for *_, process in runs]


def numbered(log: Path) -> list[int]:
    """Return the processes of the logged runs, numbered by their first run."""
    processes = [line.split()[1] for line in log.read_text().splitlines()]
    return [list(dict.fromkeys(processes)).index(process) for process in processes]


def test_runs_in_turn_share_a_process_until_one_passes_its_limit(tmp_path: Path):
    """The engine RECORDER logs the process of every run. A process in which a run did not converge serves the
    next run; one whose run sleeps past its limit is ended."""
    log = tmp_path / "log"
    runs = [  # options, limit (s), outcome
        ({}, 60.0, "COMPLETED"),
        ({"outcome": "NOT_CONVERGED"}, 60.0, "NOT_CONVERGED"),
        ({}, 60.0, "COMPLETED"),
        ({"sleep": 60.0}, 0.3, "TIMED_OUT"),
        ({}, 60.0, "COMPLETED"),
    ]
    for options, limit, outcome in runs:
        ended = run_in_turn(f"{FAKES}:RECORDER", still(str(log)), TIMES, Setting("a", options), limit)
        assert ended.outcome.name == outcome, options
    assert numbered(log) == [0, 0, 0, 0, 1]


def test_preparation_of_an_engine_after_a_time_out_does_not_count_against_the_next_limit(tmp_path: Path):
    """The engine SLOW prepares for 2 s in every new process, and its runs may take 1.5 s. The third run has a
    new process, since the second one timed out, and completes."""
    log, limit = tmp_path / "log", 1.5
    for options, outcome in (({}, "COMPLETED"), ({"sleep": 60.0}, "TIMED_OUT"), ({}, "COMPLETED")):
        ended = run_isolated(f"{FAKES}:SLOW", still(str(log)), TIMES, Setting("a", options), limit)
        assert ended.outcome.name == outcome, options
    assert numbered(log) == [0, 0, 1]


def test_an_engine_that_hangs_in_its_preparation_times_out(monkeypatch: pytest.MonkeyPatch):
    """The engine STUCK sleeps in its preparation, which may take 1 s here."""
    monkeypatch.setattr("crosscheck.processes.pool.READY_SECONDS", 1.0)
    ended = run("STUCK", time_limit=60.0)
    assert (ended.outcome, ended.message) == (Outcome.TIMED_OUT, "no result after 1 s"), ended.message


def test_the_last_line_that_an_engine_prints_in_its_preparation_is_known_meanwhile():
    """`starting` has the last line that an engine has printed while it is being prepared, and is empty
    afterwards. The engine COMPILING prints "compiling kernels"; the first line of its run may be seen."""
    with ThreadPoolExecutor(1) as thread:
        made = thread.submit(run_in_turn, f"{FAKES}:COMPILING", still(), TIMES, PLAIN, 60.0)
        seen = set()
        while not made.done():
            seen |= set(starting().values())
            time.sleep(0.001)
        assert made.result().outcome is Outcome.COMPLETED, made.result().message
    assert seen - {f"{FAKES}:COMPILING plain starts"} == {"compiling kernels"}
    assert not starting()


def test_first_questions_to_an_engine_wait_for_each_other(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """Two threads ask the engine SEARCHING for its settings. It logs when it begins and ends to look for
    them: the second one begins after the first one has ended."""
    log = tmp_path / "log"
    monkeypatch.setenv("FAKE_LOG", str(log))
    with ThreadPoolExecutor(2) as threads:
        asked = [threads.submit(capabilities, f"{FAKES}:SEARCHING", still(name), 60.0) for name in "ab"]
    assert all(len(answer.result()[2]) == 3 for answer in asked), asked
    assert log.read_text().split() == ["begin", "end"] * 2, log.read_text()


REAL = {  # settings of two families each
    "mbref": (Setting("alf-dual+projection", {"rtol": 1e-6}), Setting("mpi-svd+none", {"rtol": 1e-6})),
    "mujoco": (Setting("stock", {"step": 1e-3}), Setting("defaults", {"step": 1e-3})),
    "pinocchio": (Setting("proximal", {"step": 1e-4}), Setting("baumgarte", {"step": 1e-4})),
    "exudyn": (Setting("alpha", {"step": 2e-4}), Setting("static", {"step": 1e-3})),
}


@pytest.mark.parametrize("name", REAL)
def test_an_engines_run_does_not_depend_on_earlier_runs_in_its_process(name: str):
    """Two jobs, each a scene and a setting, run in processes of their own, and then as first, second, first
    in one process. Their records are equal to the bit."""
    times = np.linspace(0.0, 0.01, 5)
    scenes = SCENES["five_bar"](), SCENES["spatial_slider_crank_driven"]()
    first, second = jobs = list(zip(scenes, REAL[name], strict=True))
    alone = [observe(name, scene, times, setting, 60.0).value for scene, setting in jobs]
    shared = [run_isolated(name, scene, times, setting, 60.0) for scene, setting in (first, second, first)]
    assert all(each.outcome is Outcome.COMPLETED for each in shared), shared
    assert list(map(untimed, shared)) == [untimed(alone[0]), untimed(alone[1]), untimed(alone[0])]


def untimed(ended: Trajectory) -> str:
    """Return the record of a run without the seconds that it took, as text, in which NaN equals NaN."""
    record = ended.to_record()
    return repr({**record, "cost": {k: v for k, v in record["cost"].items() if "seconds" not in k}})


def test_stop_all_kills_a_running_child_and_its_run_is_crashed(tmp_path: Path):
    """HANG writes its process's number into a file when it runs, and sleeps; then ``stop_all`` is called."""
    pid = tmp_path / "pid"
    with ThreadPoolExecutor(1) as pool:
        future = pool.submit(run, "HANG", still(str(pid)))
        while not (pid.exists() and pid.read_text()):
            assert not future.done(), future.result().message
            time.sleep(0.05)
        stop_all()
        ended = future.result(timeout=30)
    assert (ended.outcome, ended.message) == (Outcome.CRASHED, "the process was ended by SIGKILL")


def test_interleaved_runs_take_turns_in_one_process_after_one_untimed_round(tmp_path: Path):
    """The engine RECORDER logs family and process of each run: a and b by turns, once untimed and twice
    timed. Job a says that it takes 0.5 s; job b does not complete, and has no time. All runs are in the
    process that had the engine before, and so are those of the next timing."""
    log = tmp_path / "log"
    _, served = ask(f"{FAKES}:RECORDER", converse, (), 60.0)
    settings = Setting("a", {"seconds": 0.5}), Setting("b", {"seconds": 0.7, "outcome": "NOT_CONVERGED"})
    jobs = [(f"{FAKES}:RECORDER", setting) for setting in settings]
    seconds = time_interleaved(still(str(log)), TIMES, jobs, repeats=2, time_limit=60.0)
    assert seconds[0] == [0.5, 0.5], seconds
    assert len(seconds[1]) == 2 and all(map(math.isnan, seconds[1])), seconds
    order, processes = zip(*(line.split() for line in log.read_text().splitlines()), strict=True)
    assert order == ("a", "b") * 3, order
    assert {int(process) for process in processes} == {served} and served != os.getpid()
    time_interleaved(still(str(log)), TIMES, jobs, repeats=1, time_limit=60.0)
    assert set(numbered(log)) == {0}


def test_setting_a_hundred_times_behind_the_fastest_is_timed_once(tmp_path: Path):
    """Three repeats are asked for. 0.5 s is 500 times the fastest's 0.001 s; 0.09 s is only 90 times."""
    costs = {"slow": 0.5, "fast": 0.001, "near": 0.09}  # s
    jobs = [(f"{FAKES}:RECORDER", Setting(name, {"seconds": s})) for name, s in costs.items()]
    seconds = time_interleaved(still(str(tmp_path / "log")), TIMES, jobs, repeats=3, time_limit=60.0)
    assert seconds == [[0.5], [0.001] * 3, [0.09] * 3]


def test_timing_beyond_its_cpu_time_ends_after_one_repeat_and_reports_each_round(tmp_path: Path):
    """No CPU time is left after the untimed round: of five repeats one is made, in two rounds."""
    rounds, jobs = [], [(f"{FAKES}:RECORDER", Setting("a", {"seconds": 0.5}))]
    scene = still(str(tmp_path / "log"))
    found = time_interleaved(scene, TIMES, jobs, 5, 60.0, lambda: rounds.append(1), most_seconds=0.0)
    assert found == [[0.5]] and len(rounds) == 2


def test_fault_of_a_scene_in_another_process_is_told_without_its_class():
    """Equations of a mechanism whose joints come and go are refused by the joint's name."""
    with pytest.raises(ChildFailed, match=r"^\w+\[.*: only motions have intervals"):
        apart(refuse_intervals, (intermittent_mechanism(1),), 60.0)


def test_a_crash_among_interleaved_runs_is_raised_with_its_signal():
    """The second of two engines, SEGFAULT, ends its process by the signal SIGSEGV."""
    jobs = [(f"{FAKES}:FAKE", PLAIN), (f"{FAKES}:SEGFAULT", PLAIN)]
    with pytest.raises(ChildFailed, match="SIGSEGV") as caught:
        time_interleaved(still(), TIMES, jobs, repeats=1, time_limit=60.0)
    assert caught.value.outcome is Outcome.CRASHED


def test_an_interrupt_ends_the_running_call_of_a_thread_and_cancels_the_waiting_one(tmp_path: Path):
    """One thread has two calls of HANG, which sleeps; KeyboardInterrupt is raised while the first runs."""
    pid = tmp_path / "pid"
    with ThreadPoolExecutor(1) as pool:
        calls = [pool.submit(run, "HANG", still(str(pid))) for _ in range(2)]
        with pytest.raises(KeyboardInterrupt), calls_ended(calls):
            while not (pid.exists() and pid.read_text()):
                time.sleep(0.05)
            raise KeyboardInterrupt
        assert calls[0].result(timeout=0).message == "the process was ended by SIGKILL"
        assert calls[1].cancelled()
