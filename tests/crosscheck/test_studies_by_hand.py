"""Parts around a study, by hand: origin of records, progress, hopeless settings, collections."""

from __future__ import annotations

import json
import subprocess
import threading
from pathlib import Path

import numpy as np
import pytest
from rich.progress import Task

from crosscheck.engine import Setting
from crosscheck.study import comparison, hurried, origin, progress
from crosscheck.study.comparison import Wanted, collected
from crosscheck.study.grid import Case
from crosscheck.study.progress import UnderWay, counted, followed, shown
from mbref.scene import Body, Scene
from mbref.trajectory import Outcome, Trajectory

TIMES = np.array([0.0, 0.1])


@pytest.fixture(autouse=True)
def _fakes_importable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parent))


def still(name: str = "still") -> Scene:
    block = Body(name="block", mass=2.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 2.0, 3.0))
    return Scene(name=name, duration=0.1, body=(block,))


def git(place: Path, *words: str) -> str:
    named = ["-c", "user.name=a", "-c", "user.email=a@b.c", "-c", "commit.gpgsign=false"]
    done = subprocess.run(
        ["git", "-C", str(place), *named, *words], capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A repository with one file, in which the module on origins seems to be."""
    git(tmp_path, "init", "-q")
    (tmp_path / "a.txt").write_text("a")
    git(tmp_path, "add", "a.txt")
    git(tmp_path, "commit", "-qm", "First")
    monkeypatch.setattr(origin, "__file__", str(tmp_path / "crosscheck" / "study" / "origin.py"))
    origin.commit.cache_clear()
    yield tmp_path
    origin.commit.cache_clear()


def test_a_record_has_the_commit_of_the_checkout(checkout):
    assert origin.commit() == git(checkout, "rev-parse", "--short=12", "HEAD")
    (checkout / "b.txt").write_text("b")
    origin.commit.cache_clear()
    assert not origin.commit().endswith("+"), "a file that git does not track is no change"
    (checkout / "a.txt").write_text("b")
    origin.commit.cache_clear()
    assert origin.commit() == git(checkout, "rev-parse", "--short=12", "HEAD") + "+"
    assert origin.made_by()["commit"] == origin.commit()


def test_a_folder_that_is_no_checkout_has_no_commit(checkout, tmp_path, monkeypatch):
    (checkout / ".git" / "HEAD").write_text("ref: refs/heads/none")
    assert origin.commit() is None, "a repository without a commit"
    monkeypatch.setattr(origin, "__file__", str(tmp_path / "x" / "y" / "z" / "origin.py"))
    origin.commit.cache_clear()
    assert origin.commit() is None
    assert origin._git(tmp_path / "nowhere", "status") is None


class Clock:
    """A clock that the test sets, s."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 100.0
        monkeypatch.setattr(progress.time, "monotonic", lambda: self.now)
        monkeypatch.setattr(progress, "LOOKED", 3600.0)  # no line by the watching thread


def test_lines_of_a_progress_come_at_every_tenth_with_the_time_left(monkeypatch, capsys):
    clock = Clock(monkeypatch)
    with counted("settings", 20) as advance:
        for k in range(20):
            clock.now += 2.0
            advance(f"work {k + 1}")
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "settings: 2 of 20, 4 s, about 36 s left; work 2"
    assert lines[1] == "settings: 4 of 20, 8 s, about 32 s left; work 4"
    assert lines[-1] == "settings: 20 of 20, 40 s; work 20" and len(lines) == 10


def test_records_and_motions_have_lines_of_their_own(monkeypatch, capsys):
    clock = Clock(monkeypatch)
    record = {"scene": "door", "engine": "mbref", "family": "taylor", "outcome": "COMPLETED"}
    with shown("runs", 2) as show:
        clock.now += 1.0
        show(1, 2, record)
    with followed("motion", 4.0) as reached:
        clock.now += 5.0
        reached(1.0)
        reached(1.1)
        reached(7.0)
    assert capsys.readouterr().err.splitlines() == [
        "runs: 1 of 2, 1 s, about 1 s left; door mbref taylor: COMPLETED",
        "motion: 25 of 100, 5 s, about 15 s left; t = 1 s",
        "motion: 100 of 100, 5 s; t = 4 s",
    ]


def test_running_work_is_named_with_its_time_until_it_ends(monkeypatch):
    clock, work = Clock(monkeypatch), UnderWay()
    seen = []

    def run(given: int) -> int:
        clock.now += 7.0
        seen.append(str(work))
        if given < 0:
            raise ValueError("negative")
        return 2 * given

    called = work.named(run, lambda given: f"run {given}")
    assert called(3) == 6 and seen == ["run 3, for 7 s"] and str(work) == ""
    with pytest.raises(ValueError, match="negative"):
        called(-1)
    assert str(work) == "", "work that failed is over"
    monkeypatch.setattr(progress, "starting", lambda: {threading.get_ident(): "compiling", 1: "importing"})
    called(4)
    assert seen[-1] == "run 4, for 7 s (compiling); importing"
    column, task = progress._Working(work), Task(0, "t", 1, 0, fields={"last": "the last"}, _get_time=float)
    assert column.render(task).plain == "compiling; importing"
    monkeypatch.setattr(progress, "starting", dict)
    assert column.render(task).plain == "the last"


def test_finer_settings_of_a_family_that_ran_out_of_time_are_not_started(monkeypatch):
    """Another family, engine or scene still runs, and so does a family whose run only failed."""
    begun = []

    def run(engine: str, scene: Scene, times: np.ndarray, setting: Setting, limit: float) -> Trajectory:
        begun.append((engine, scene.name, str(setting), limit))
        ends = {"slow": Outcome.TIMED_OUT, "broken": Outcome.NOT_FINITE}
        outcome = ends.get(setting.family, Outcome.COMPLETED)
        return hurried.failed(engine, "1", scene, setting, outcome, "ended")

    monkeypatch.setattr(hurried, "run_estimated", run)
    made = hurried.Hurried()
    cases = [
        Case(still(name), TIMES, engine, Setting(family, {"step": step}), 5.0)
        for name, engine, family, step in (
            ("one", "a", "slow", 0.1),
            ("one", "a", "slow", 0.01),
            ("one", "b", "slow", 0.1),
            ("two", "a", "slow", 0.1),
            ("one", "a", "fast", 0.1),
            ("one", "a", "broken", 0.1),
            ("one", "a", "broken", 0.01),
        )
    ]
    runs = [made.trajectory(case) for case in cases]
    assert [run.message for run in runs].count(hurried.NOT_STARTED) == 1
    assert runs[1].message == hurried.NOT_STARTED and runs[1].outcome is Outcome.TIMED_OUT
    assert runs[1].settings == {"step": 0.01} and runs[1].scene == "one" and runs[1].engine == "a"
    assert len(begun) == len(cases) - 1 and all(limit == 5.0 for *_, limit in begun)


def test_engines_that_compile_run_first_and_the_last_engines_follow():
    families = {"a": ["plain"], "b": ["plain"], "c": ["plain", "fast, compiled"], "d": ["plain"]}
    cases = [
        Case(still(), TIMES, engine, Setting(family, {}), 5.0)
        for engine, names in families.items()
        for family in names
    ]
    order = [(case.engine, case.setting.family) for case in comparison._long_first(cases)]
    assert [engine for engine, _ in order] == ["a", "c", "c", "d", "b"]
    assert order[1:3] == [("c", "plain"), ("c", "fast, compiled")], "an engine's cases keep their order"


def collection(place: Path | None, notices: list[str], monkeypatch) -> comparison.Collection:
    """Collect the runs of two settings of a fake engine."""
    name, scene = "fake_engines:FAKE", still()
    cases = [
        Case(scene, TIMES, name, Setting("a", {"seconds": s}), limit) for s, limit in ((0.5, 5), (0.7, 9))
    ]
    monkeypatch.setattr(comparison, "with_timings", lambda cases, records, *_: records)
    limits = []
    monkeypatch.setattr(
        comparison, "identity_cases", lambda scene, engines, limit: limits.append((engines, limit)) or []
    )
    wanted = Wanted([TIMES], 1.0, False, place)
    found = collected([scene], [name], wanted, lambda: cases, notices.append)
    assert limits == [([name], 9)], "the gate has the longest limit of all runs"
    return found


def test_a_collection_keeps_scenes_records_and_truths_and_does_not_repeat_them(tmp_path, monkeypatch):
    notices: list[str] = []
    found = collection(tmp_path, notices, monkeypatch)
    assert [r["asked"]["options"]["seconds"] for r in found.records] == [0.5, 0.7] and notices == []
    assert Scene.from_file(tmp_path / "scenes" / "still.toml") == still()
    lines = (tmp_path / "records.jsonl").read_text().splitlines()
    assert [json.loads(line)["key"] for line in lines] == [r["key"] for r in found.records]
    again = collection(tmp_path, notices, monkeypatch)
    assert notices == [f"{tmp_path / 'records.jsonl'} already has 2 of the runs"]
    assert [r["date"] for r in again.records] == [r["date"] for r in found.records]
    truths = (tmp_path / "truths.jsonl").read_text().splitlines()
    assert len(truths) == 1 and again.truths == found.truths and found.truths[0]["given"] == 1.0


def test_a_truth_with_less_time_than_asked_is_made_again(tmp_path, monkeypatch):
    path = tmp_path / "truths.jsonl"
    made = []

    def record(scene: Scene, times: np.ndarray, seconds: float) -> dict:
        made.append(seconds)
        return {"key": comparison.truth_key(scene, times), "scene": scene.name, "given": seconds}

    monkeypatch.setattr(comparison, "truth_record", record)
    for seconds in (2.0, 1.0, 2.0, 3.0):
        comparison._truths([still()], Wanted([TIMES], seconds, True, tmp_path))
    assert made == [2.0, 3.0] and len(path.read_text().splitlines()) == 2


def test_a_comparison_without_a_folder_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    notices: list[str] = []
    found = collection(None, notices, monkeypatch)
    assert not found.motions and not found.branches and not any(tmp_path.iterdir()) and not notices
