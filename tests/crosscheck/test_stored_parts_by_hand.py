"""Corners of stored results and commands / small records, worked out by hand."""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import reports.__main__ as program
from crosscheck.cli import commands, request
from crosscheck.closed_loops import records as closed_loops
from crosscheck.conformance import deep
from crosscheck.convergence import ladders
from crosscheck.engine import Setting
from crosscheck.paper import settings as paper_settings
from crosscheck.paper import singular
from crosscheck.study.grid import Case
from mbref.scene import Body, Distance, Scene
from reports import stored

BODY = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
SCENE = Scene(name="s", body=(BODY,), duration=2.0)


def case(**options: float) -> Case:
    return Case(SCENE, np.array([0.0, 2.0]), "e", Setting("f", options), 60.0)


# --- Orders of convergence --------------------------------------------------------------------------------
def record(seconds: float, outcome: str = "COMPLETED", **options: float) -> dict[str, Any]:
    return {"outcome": outcome, "cost": {"seconds": seconds}, "asked": {"options": options}}


def test_time_of_the_next_finer_run() -> None:
    """A run with half the step takes twice as long, and one with another tolerance the same time."""
    assert ladders._would_take(case(step=0.25), record(3.0, step=0.5)) == 6.0
    assert ladders._would_take(case(rtol=1e-5), record(3.0, rtol=1e-4)) == 3.0
    assert ladders._would_take(case(step=0.25), record(3.0, "TIMED_OUT", step=0.5)) == math.inf
    assert ladders._would_take(case(step=0.25), record(3.0, "STEP_FAILED", step=0.5)) == 0.0


def test_a_ladder_ends_before_runs_that_take_too_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ladders, "in_vain", lambda records: 0)
    cases = [case(step=2.0**-k) for k in range(5)]

    def run(of: Case) -> dict[str, Any]:
        return record(1.0 / of.setting.options["step"], step=of.setting.options["step"])

    assert [r["cost"]["seconds"] for r in ladders.climb(cases, run, 4.0)] == [1.0, 2.0, 4.0]
    assert len(ladders.climb(cases, run, 3.9)) == 2 and len(ladders.climb(cases, run, 99.0)) == 5
    monkeypatch.setattr(ladders, "in_vain", lambda records: ladders.VAIN if len(records) == 2 else 0)
    assert len(ladders.climb(cases, run, 99.0)) == 2


def test_settings_of_a_ladder(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first step is the interval by a power of two, and at most the engine's own step."""
    asked: list[Any] = []
    mechanism: Any = SimpleNamespace(make=lambda: SCENE, end=1.0)
    row: Any = SimpleNamespace(engine="e", family="f")
    offered: list[Case] = []

    def default_cases(*given: Any) -> Any:
        asked.append(given)
        return offered, []

    monkeypatch.setattr(ladders, "default_cases", default_cases)
    assert ladders.ladder(row, mechanism) == []
    scene, engines, families, times, limit = asked[0]
    assert (scene, engines, families, limit) == (SCENE, ["e"], ["f"], 120.0)
    assert (times[0], times[-1], len(times)) == (0.0, 1.0, 11)
    offered[:] = [case(rtol=1e-3, other=5.0), case(rtol=1e-4)]
    found = ladders.ladder(row, mechanism)
    assert [c.setting.options["rtol"] for c in found] == [float(f"1e-{k}") for k in range(2, 14)]
    assert {c.setting.options["other"] for c in found} == {5.0} and {c.setting.family for c in found} == {"f"}
    interval = float(times[1])
    for step, first in ((interval / 3, 2), (interval / 4, 2), (interval * 5, 0)):
        offered[:] = [case(step=step)]
        steps = [c.setting.options["step"] for c in ladders.ladder(row, mechanism)]
        assert steps == [interval / 2.0**k for k in range(first, first + 16)]


def judged(error: float, steps: int = 0, outcome: str = "COMPLETED", bound: float = 0.0) -> dict[str, Any]:
    metrics = {"error": error, "error_bound": bound}
    return {"outcome": outcome, "t_end": 0.5, "cost": {"steps": steps}, "metrics": metrics}


@pytest.mark.parametrize(
    ("records", "vain"),
    [
        ([], 0),
        ([(1e-3, 1)], 0),
        ([(1e-3, 1), (0.7e-3, 2)], 0),
        ([(1e-3, 1), (0.71e-3, 2)], 1),
        ([(1e-3, 1), (1e-3, 1)], 0),  # as many steps
        ([(1e-3, 1), (1e-3, 2), (1e-3, 3)], 2),
        ([(1e-3, 1), (1e-3, 2), (0.5e-3, 3)], 0),
        ([(0.5, 1), (0.5, 2)], 0),  # no right motion yet
        ([(1e-2, 1), (0.5, 2)], 1),
        ([(1e-3, 1), (0.8e-3, 2), (0.6e-3, 3)], 2),  # of the least error so far, 0.8e-3
        ([(1e-3, 1), (0.8e-3, 2), (0.55e-3, 3)], 0),
    ],
)
def test_runs_in_vain(records: list[tuple[float, int]], vain: int) -> None:
    assert ladders.in_vain([judged(*r) for r in records]) == vain


def test_failed_runs_and_bounds_are_no_lower_errors() -> None:
    good, lost = judged(1e-3, 1), judged(1e-9, 2, "STEP_FAILED")
    assert ladders.in_vain([good, lost]) == 1 == ladders.in_vain([good, judged(1e-9, 2, bound=1e-3)])


def test_fineness_and_points_of_runs() -> None:
    for options, fine in (
        ({"step": 0.5, "rtol": 0.1}, 0.5),
        ({"rtol": 0.1}, 0.1),
        ({"accuracy": 0.2}, 0.2),
        ({}, 0),
    ):
        assert ladders.fineness({"asked": {"options": options}}) == fine
    assert ladders.fineness({}) == 0.0
    of = {"asked": {"options": {"step": 0.5}}}
    assert "1.0e-03" in ladders.point({**judged(1e-3), **of})
    assert "step failed at 0.5 s" in ladders.point({**judged(1e-3, outcome="STEP_FAILED"), **of})


# --- Closed loops -----------------------------------------------------------------------------------------
def test_only_missing_runs_on_closed_loops_are_made(monkeypatch: pytest.MonkeyPatch) -> None:
    cases = [case(step=0.5), case(step=0.25)]
    stored_ones: list[Any] = []
    monkeypatch.setattr(closed_loops, "key", lambda c: f"key {c.setting.options['step']}")
    monkeypatch.setattr(closed_loops, "read", lambda path: [{"key": "key 0.5"}])
    monkeypatch.setattr(closed_loops, "_store", lambda r, path: stored_ones.append((r, path)))
    monkeypatch.setattr(closed_loops, "_refused", lambda refusal: f"refused {refusal}")
    monkeypatch.setattr(closed_loops, "kept", lambda r: f"kept {r}")
    progressed: list[Any] = []

    def study(wanted: Any, progress: Any) -> None:
        assert wanted == cases[1:]
        progress(1, 2, "record")

    monkeypatch.setattr(closed_loops, "study", study)
    path = Path("p")
    closed_loops.measure(cases, ["a"], path, lambda *given: progressed.append(given))  # type: ignore[list-item]
    assert stored_ones == [("refused a", path), ("kept record", path)] and progressed == [(1, 2, "record")]
    closed_loops.measure(cases, [], path)
    assert len(stored_ones) == 3 and len(progressed) == 1


# --- The paper --------------------------------------------------------------------------------------------
def test_parts_of_the_paper_that_need_what_a_scene_lacks() -> None:
    rod = Distance(name="R", bodies=("ground", "b"), anchors=((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)))
    with pytest.raises(ValueError, match="joint 'R': a distance joint has two anchors"):
        paper_settings._anchor(rod)


def test_singular_values_need_an_exact_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(singular, "truth_for", lambda scene: None)
    functions = [
        f
        for f in vars(singular).values()
        if getattr(f, "__doc__", None) and "known exact motion" in f.__doc__
    ]
    [smallest] = functions
    with pytest.raises(ValueError, match="s: no exact motion is known"):
        smallest(SCENE, np.zeros(1))


# --- Commands ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize("as_json", [True, False])
@pytest.mark.parametrize("conforms", [True, False])
def test_random_mechanisms_are_verified_beside_engines_that_exist(
    as_json: bool, conforms: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked: list[Any] = []
    monkeypatch.setattr(request, "find_engines", lambda names, notice: asked.append(names))

    def examined(plan: Any, path: Any, advance: Any) -> Any:
        asked.append((tuple(plan), path))
        return SimpleNamespace(to_record=lambda: {"engine": plan.engine}, conforms=conforms)

    monkeypatch.setattr(deep, "examined", examined)
    monkeypatch.setattr("crosscheck.conformance.deep_table.tables", lambda found: ["one table", "another"])
    given = argparse.Namespace(
        beside=("x=y", "z"), mechanisms=3, first_seed=7, family="f", records="path", json=as_json
    )
    status = commands._verify_random("e", given)
    assert status == (commands.COMPLETED if conforms else commands.OTHERWISE)
    assert asked == [["x"], ["z"], (("e", 3, 7, "f", ("x=y", "z")), "path")]
    out = capsys.readouterr().out
    if as_json:
        assert json.loads(out)["engine"] == "e" and "machine" in json.loads(out)
    else:
        assert "one table" in out and "another" in out


# --- Reports ----------------------------------------------------------------------------------------------
def test_a_folder_without_scenes_or_records_is_no_report(tmp_path: Path) -> None:
    for make in ((), ("records.jsonl",), ("scenes",)):
        folder = tmp_path / "-".join(("f", *make))
        folder.mkdir()
        for name in make:
            (folder / name).mkdir() if name == "scenes" else (folder / name).touch()
        with pytest.raises(FileNotFoundError, match=r"has no records\.jsonl and scenes/ of a report"):
            stored.groups(folder)
    both = tmp_path / "both"
    (both / "scenes").mkdir(parents=True)
    (both / "records.jsonl").touch()
    assert stored.groups(both) == []


@pytest.mark.parametrize(
    ("error", "status", "says"),
    [
        (KeyboardInterrupt(), 130, "interrupted; the finished runs are in"),
        (OSError(28, "No space left", "x.html"), 2, "x.html: No space left"),
    ],
)
def test_ends_of_the_report_s_program(
    error: BaseException,
    status: int,
    says: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def raising(*given: Any, **more: Any) -> Any:
        raise error

    monkeypatch.setattr(program, "_blocks", raising)
    assert program.main(["--out", str(tmp_path / "r"), "--depth", "quick"]) == status
    assert says in capsys.readouterr().err


def test_an_error_without_a_file_is_not_hidden(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def raising(*given: Any) -> Any:
        raise OSError("no file")

    monkeypatch.setattr(program, "_blocks", raising)
    with pytest.raises(OSError, match="no file"):
        program.main(["--out", str(tmp_path / "r"), "--depth", "quick"])
