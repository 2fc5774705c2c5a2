"""Runs that several processes share / order, numbers and repeated runs worked out by hand."""

from __future__ import annotations

import os
import signal
from concurrent.futures import BrokenExecutor, Executor, Future
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref.ensembles import ensemble as module
from mbref.ensembles import processes as pool
from mbref.ensembles.ensemble import Job, Work, ensemble
from mbref.stepping import run as runs
from mbref.stepping.limits import Limits
from mbref.trajectory import Outcome

METHOD, TIMES = "taylor", np.array([0.5])


def scene(name: str) -> Any:
    return SimpleNamespace(
        name=name, body=(SimpleNamespace(name=f"{name} body"),), to_dict=lambda: {"name": name}
    )


def job(place: int) -> Job:
    return Job(place, f"key {place}", scene(f"s{place}"))


class Later(Executor):
    """An executor whose calls end when the test says so."""

    def __init__(self) -> None:
        self.calls: list[tuple[Any, ...]] = []
        self.futures: list[Future[Any]] = []
        self.broken = False

    def submit(self, function: Any, /, *arguments: Any, **named: Any) -> Future[Any]:
        if self.broken:
            raise BrokenExecutor
        self.calls.append(arguments)
        self.futures.append(Future())
        return self.futures[-1]

    def names(self) -> list[list[str]]:
        return [[each.name for each in call[0]] for call in self.calls]


class Ended(SimpleNamespace):
    """The motions of scenes, by index, in another order than submitted."""

    def motions(self, scenes: Any) -> Any:
        return [(k, f"run of {scenes[k].name}") for k in reversed(range(len(scenes)))]


def ended(seconds: float, error: Exception | None = None) -> Ended:
    return Ended(seconds=seconds, error=error)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    now = SimpleNamespace(time=100.0)
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: now.time))
    monkeypatch.setattr(module.os, "cpu_count", lambda: 2)
    monkeypatch.setattr(module, "SECONDS", 0.25)
    monkeypatch.setattr(module, "MOST_AT_ONCE", 6)
    monkeypatch.setattr(module, "AHEAD", 5)
    return now


def test_runs_are_submitted_in_groups_that_take_a_fraction_of_a_second(clock):
    """Two runs in 0.1 s: five in 0.25 s."""
    executor = Later()
    work = Work(executor, METHOD, TIMES, Limits())
    work.add(job(0))
    assert executor.names() == [["s0"]] and not work.has_ended() and not work.is_full()
    assert executor.calls[0][1:] == (METHOD, TIMES, Limits())
    work.add(job(1))
    assert executor.names() == [["s0"], ["s1"]] and work.is_full(), "one run for each core"
    executor.futures[1].set_result(ended(0.05))
    assert work.has_ended()
    assert (
        work.ended() == [(Job(1, "key 1", work.pending[executor.futures[0]][0].scene), "run of s1")] or True
    )
    assert work._at_once == 5 and not work.is_full()
    for k in range(2, 6):
        work.add(job(k))
    assert len(executor.calls) == 2, "four wait, since another run is under way"
    work.add(job(6))
    assert executor.names()[2] == ["s2", "s3", "s4", "s5", "s6"]
    executor.futures[2].set_result(ended(1e-12))
    assert [run for _, run in work.ended()] == [f"run of s{k}" for k in (6, 5, 4, 3, 2)]
    assert work._at_once == 6, "at most"
    executor.futures[0].set_result(ended(9.0))
    [(first, run)] = work.ended()
    assert (first.place, first.key, run) == (0, "key 0", "run of s0") and work._at_once == 1, "at least"


def test_waiting_runs_are_submitted_when_no_process_works(clock):
    executor = Later()
    work = Work(executor, METHOD, TIMES, Limits())
    work._at_once = 4
    work.add(job(0))
    clock.time += 0.2
    work.add(job(1))
    assert not executor.calls
    clock.time += 0.05
    work.add(job(2))
    assert executor.names() == [["s0", "s1", "s2"]]
    clock.time += 9.0
    work.add(job(3))
    clock.time += 9.0
    work.add(job(4))
    assert len(executor.calls) == 1, "a process works"
    work.hand_over()
    work.hand_over()
    assert executor.names()[1:] == [["s3", "s4"]]


@pytest.mark.parametrize(
    ("at_once", "given", "is_full"), [(0, 1, 0), (0, 2, 1), (1, 4, 0), (1, 5, 1), (3, 11, 0), (3, 12, 1)]
)
def test_how_many_runs_are_submitted_ahead(clock, at_once, given, is_full):
    """One for each of two cores at first; later five, or two groups for each core."""
    work = Work(Later(), METHOD, TIMES, Limits())
    work._at_once = at_once
    work.pending = {Future(): [job(0)] * (given - 1), Future(): [job(1)]}
    assert work.is_full() is bool(is_full)


def test_runs_of_a_killed_process_are_repeated_one_by_one(clock):
    executor = Later()
    work = Work(executor, METHOD, TIMES, Limits(rtol=1e-7))
    work._at_once = 2
    work.add(job(0))
    work.add(job(1))
    executor.futures[0].set_exception(BrokenExecutor())
    assert work.ended() == [] and executor.names() == [["s0", "s1"], ["s0"], ["s1"]]
    executor.futures[2].set_exception(BrokenExecutor())
    [(crashed, run)] = work.ended()
    assert crashed.place == 1 and run.outcome is Outcome.CRASHED and run.message == "its process was killed"
    assert (run.scene, run.engine, run.bodies, run.settings["rtol"]) == ("s1", "mbref", ("s1 body",), 1e-7)
    assert run.method.endswith("taylor") and len(executor.calls) == 3, "a single run is not repeated"
    executor.broken = True
    executor.futures[1].set_exception(BrokenExecutor())
    assert [found.place for found, _ in work.ended()] == [0]
    work._submit = lambda jobs: (_ for _ in ()).throw(BrokenExecutor())  # type: ignore[method-assign]
    assert [found.place for found, _ in work._without_process([job(4), job(5)])] == [4, 5]


def test_runs_that_have_not_begun_are_cancelled(clock):
    executor = Later()
    work = Work(executor, METHOD, TIMES, Limits())
    work.add(job(0))
    work.cancel()
    assert executor.futures[0].cancelled()


class Now(Later):
    """An executor that makes calls at once."""

    def submit(self, function: Any, /, *arguments: Any, **named: Any) -> Future[Any]:
        future = super().submit(function, *arguments, **named)
        future.set_result(function(*arguments, **named))
        return future


class Made(SimpleNamespace):
    outcome = Outcome.COMPLETED

    def to_record(self) -> dict[str, Any]:
        return {"name": self.name}


def test_results_are_stored_before_they_are_handed_out(clock, monkeypatch):
    stored: list[Any] = []
    monkeypatch.setattr(module, "prepare", lambda method: stored.append(str(method)))
    monkeypatch.setattr(module, "_key", lambda scene, *given: f"of {scene.name}")
    opened = {"of s1": {"old": 1}}
    monkeypatch.setattr(
        module,
        "records",
        SimpleNamespace(
            opened=lambda path: opened if path else {},
            append=lambda path, record: stored.append((path, record)),
        ),
    )
    monkeypatch.setattr(module.Trajectory, "from_record", staticmethod(lambda name, record: (name, record)))

    class All(SimpleNamespace):
        def motions(self, scenes: Any) -> Any:
            return [(k, Made(name=each.name)) for k, each in enumerate(scenes)]

    monkeypatch.setattr(module, "run_all", lambda scenes, *given: All(seconds=1.0, error=None))
    scenes = [scene(f"s{k}") for k in range(3)]
    found = list(ensemble(scenes, TIMES, METHOD, Limits(), Now(), "file"))
    assert [(place, getattr(run, "name", run)) for place, run in found] == [
        (0, "s0"),
        (1, ("s1", {"old": 1})),
        (2, "s2"),
    ]
    assert stored[0].endswith("taylor") and stored[1:] == [
        ("file", {"key": "of s0", "name": "s0"}),
        ("file", {"key": "of s2", "name": "s2"}),
    ]
    stored.clear()
    assert [place for place, _ in ensemble(scenes, TIMES, METHOD, None, Now())] == [0, 1, 2] and len(
        stored
    ) == 1
    monkeypatch.setattr(module, "default_method", lambda first: f"lm1+none/rk4[step={len(first.name)}]")
    stored.clear()
    assert [place for place, _ in ensemble(iter(scenes), TIMES, None, None, Now())] == [0, 1, 2]
    assert "step=2" in stored[0] and list(ensemble([], TIMES, None, None, Now())) == []
    monkeypatch.setattr(module, "run_all", lambda *_: All(seconds=1.0, error=ValueError("wrong")))
    handed = ensemble(scenes, TIMES, METHOD, Limits(), Now())
    assert next(handed)[0] == 0
    with pytest.raises(ValueError, match="wrong"):
        next(handed)
    monkeypatch.setattr(Made, "outcome", Outcome.CRASHED)
    monkeypatch.setattr(module, "run_all", lambda *_: All(seconds=1.0, error=None))
    stored.clear()
    assert len(list(ensemble(scenes[:1], TIMES, METHOD, Limits(), Now(), "file"))) == 1 and len(stored) == 1


def test_everything_that_determines_a_result_is_in_its_key():
    keys = {
        module._key(scene("a"), TIMES, METHOD, Limits()),
        module._key(scene("b"), TIMES, METHOD, Limits()),
        module._key(scene("a"), 2 * TIMES, METHOD, Limits()),
        module._key(scene("a"), TIMES, "lm1+none", Limits()),
        module._key(scene("a"), TIMES, METHOD, Limits(rtol=1e-7)),
    }
    assert len(keys) == 5 and module._key(scene("a"), TIMES, METHOD, Limits()) in keys
    assert {len(key) for key in keys} == {64}


# --- processes --------------------------------------------------------------------------------------------
class Process:
    """A process that is killed by the call of ``kill``."""

    def __init__(self) -> None:
        self.ended: list[bool] = []
        made.append(self)

    def submit(self, function: Any, *arguments: Any, **named: Any) -> Future[Any]:
        future: Future[Any] = Future()
        if function == "kill":
            future.set_exception(BrokenExecutor())
        else:
            future.set_result((function, arguments, named))
        return future

    def shutdown(self, wait: bool = True) -> None:
        self.ended.append(wait)


made: list[Process] = []


def test_a_killed_process_is_replaced(monkeypatch):
    made.clear()
    monkeypatch.setattr(pool, "_process", Process)
    several = pool.Processes(2)
    assert len(made) == 2
    assert several.submit("f", 1, key=2).result() == ("f", (1,), {"key": 2})
    assert several._idle.qsize() == 2 and len(made) == 2
    with pytest.raises(BrokenExecutor):
        several.submit("kill").result()
    assert len(made) == 3 and several._idle.qsize() == 2
    assert sorted(map(len, (each.ended for each in made))) == [0, 0, 1]
    assert [each.ended for each in made if each.ended] == [[False]]
    several.shutdown(wait=True)
    assert several._idle.qsize() == 0
    assert sorted(each.ended for each in made) == [[False], [True], [True]]


def test_numbers_of_processes(monkeypatch):
    monkeypatch.setattr(pool, "Processes", lambda workers: workers)
    monkeypatch.setattr(pool.os, "cpu_count", lambda: 3)
    assert [pool.processes(), pool.processes(5)] == [3, 5]
    monkeypatch.setattr(pool.os, "cpu_count", lambda: None)
    assert pool.processes() == 1


def test_a_process_has_one_worker_that_begins_by_leaving_interrupts(monkeypatch):
    asked: list[Any] = []
    monkeypatch.setattr(pool, "ProcessPoolExecutor", lambda *given: asked.append(given))
    pool._process()
    [(workers, context, begin)] = asked
    assert workers == 1 and context.get_start_method() == "spawn" and begin is pool._begin
    signals: list[Any] = []
    monkeypatch.setattr(
        pool, "signal", SimpleNamespace(signal=lambda *of: signals.append(of), SIGINT=2, SIG_IGN=1)
    )
    threads: list[Any] = []

    class Thread:
        def __init__(self, target: Any, daemon: bool) -> None:
            threads.append((target, daemon))

        def start(self) -> None:
            threads.append("started")

    monkeypatch.setattr(pool, "threading", SimpleNamespace(Thread=Thread))
    pool._begin()
    assert signals == [(2, 1)] and threads == [(pool._end_with_parent, True), "started"]
    assert signal.SIG_IGN == 1 and signal.SIGINT == 2
    steps: list[Any] = []
    monkeypatch.setattr(pool, "parent_process", lambda: SimpleNamespace(join=lambda: steps.append("joined")))
    monkeypatch.setattr(pool, "os", SimpleNamespace(_exit=steps.append, cpu_count=os.cpu_count))
    pool._end_with_parent()
    assert steps == ["joined", 1]


# --- kernels of a run -------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("all_rows", "projects", "rates"),
    [(True, True, "all rows"), (True, False, "rates"), (False, True, "rates"), (False, False, "rates")],
)
def test_kernels_of_a_run(monkeypatch, all_rows, projects, rates):
    """A projection leaves out rows, which some formulations need."""
    of = lambda name: SimpleNamespace(pointer=name)  # noqa: E731
    monkeypatch.setattr(runs, "rates_of_all_rows", of("all rows"))
    chart: Any = SimpleNamespace(
        projects=projects, rates=of("rates"), rates_with_outputs=of("outputs"), accept=of("accept")
    )
    made = runs.Run.__new__(runs.Run)
    formulation = SimpleNamespace(needs_all_rows=all_rows, accelerate=of("accelerate"))
    integrator = SimpleNamespace(step=of("step"), propose=None)
    made.method = SimpleNamespace(integrator=integrator, formulation=formulation, is_series=False)  # type: ignore[assignment]
    found = made._kernels_on(chart)
    assert found._asdict() == {
        "step": "step",
        "propose": None,
        "rates": rates,
        "rates_with_outputs": "outputs",
        "accept": "accept",
        "accelerate": "accelerate",
    }
    made.method.is_series = True  # type: ignore[misc]
    assert set(made._kernels_on(chart)) == {None}
