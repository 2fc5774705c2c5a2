"""Stages of a comparison / which settings run, in which order, and what is timed, with records on paper."""

from __future__ import annotations

from concurrent.futures import Future
from typing import Any

import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.study import comparison, sweep
from crosscheck.study.comparison import Wanted
from crosscheck.study.grid import Case, key
from crosscheck.study.timings import REPEATS
from crosscheck.study.verdict import Grade
from mbref.scene import Body, Scene

TIMES = np.array([0.0, 0.1])
STEPS = (0.08, 0.04, 0.02, 0.01, 0.005)


def still(name: str = "still") -> Scene:
    block = Body(name="block", mass=2.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 2.0, 3.0))
    return Scene(name=name, duration=0.1, body=(block,))


def cases(
    engine: str = "e", family: str = "a", steps: tuple[float, ...] = STEPS, limit: float = 5.0
) -> list[Case]:
    return [Case(still(), TIMES, engine, Setting(family, {"step": step}), limit) for step in steps]


def record(case: Case, **parts: Any) -> dict[str, Any]:
    made = {
        "key": key(case),
        "step": case.setting.options["step"],
        "family": case.setting.family,
        "engine": case.engine,
        "outcome": "COMPLETED",
        "t_end": 0.1,
        "metrics": {"error": 1.0, "error_bound": 1e-14},
        "cost": {"seconds": 1e-3 / case.setting.options["step"], "rhs": 1.0},
    }
    return {**made, **parts}


class Machine:
    """A substitute for runs in child processes: it notes what runs, stage by stage."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.stages: list[tuple[str, list[tuple[str, str, float]]]] = []
        self.notices: list[str] = []
        self.calls = 0
        self.timed: tuple[Any, ...] = ()
        monkeypatch.setattr(comparison, "_made", self.made)
        monkeypatch.setattr(comparison, "with_timings", self.timings)
        monkeypatch.setattr(comparison, "identity_cases", lambda *given: [])
        monkeypatch.setattr(comparison, "grade", lambda record: Grade.RIGHT)

    def made(self, what: str, chosen: list[Case], path: Any) -> dict[str, dict[str, Any]]:
        found = [(case.engine, case.setting.family, case.setting.options["step"]) for case in chosen]
        self.calls += 1
        if chosen:
            self.stages.append((what, found))
        return {key(case): record(case) for case in chosen}

    def timings(self, *given: Any) -> Any:
        self.timed = given
        return given[1]

    def measured(self, chosen: list[Case], is_quick: bool, **more: Any) -> comparison.Collection:
        truths: Future[list[Any]] = Future()
        truths.set_result([{"truth": 1}])
        wanted = Wanted([TIMES], 7.0, is_quick, **more)
        return comparison._measured([still()], chosen, wanted, truths, self.notices.append)

    def steps(self, stage: int) -> list[float]:
        return [step for _, _, step in self.stages[stage][1]]


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Machine:
    return Machine(monkeypatch)


def test_the_quick_depth_runs_three_settings_of_a_family(machine):
    """The coarsest and the middle one, and then the finest one: 1e-3 / 0.005 = 0.2 s are affordable."""
    found = machine.measured(cases(), True)
    assert machine.stages == [
        ("running", [("e", "a", 0.08), ("e", "a", 0.02)]),
        ("running at finer settings", [("e", "a", 0.005)]),
    ]
    assert [r["step"] for r in found.records] == [0.08, 0.02, 0.005], "coarse to fine"
    assert found.truths == [{"truth": 1}] and found.scenes == [still()] and found.identities == []


def test_the_whole_depth_runs_every_setting(machine):
    found = machine.measured(cases(), False)
    assert machine.stages == [("running", [("e", "a", step) for step in STEPS])]
    assert [r["step"] for r in found.records] == list(STEPS)


@pytest.mark.parametrize(
    ("is_quick", "is_named", "has_others"), [(True, False, True), (True, True, False), (False, False, False)]
)
def test_other_families_run_where_none_is_right_and_none_is_named(
    machine, monkeypatch, is_quick, is_named, has_others
):
    monkeypatch.setattr(comparison, "grade", lambda record: Grade.FAILED)
    monkeypatch.setattr(
        comparison, "default_cases", lambda *given: (cases() + cases(family="b", steps=(0.3, 0.1)), [])
    )
    found = machine.measured(cases(steps=(0.08,)), is_quick, is_named=is_named)
    families = [(r["family"], r["step"]) for r in found.records]
    assert families == [("a", 0.08)] + [("b", 0.3), ("b", 0.1)] * has_others


def test_other_families_have_the_times_and_limits_of_the_runs(machine, monkeypatch):
    asked: list[Any] = []

    def default_cases(*given: Any) -> Any:
        asked.append(given)
        return cases(given[1][0], "b", (0.3,)), []

    monkeypatch.setattr(comparison, "default_cases", default_cases)
    monkeypatch.setattr(
        comparison, "grade", lambda r: Grade.RIGHT if r["engine"] == "f" and r["step"] < 0.1 else Grade.FAILED
    )
    groups = [cases("e", "a", (0.2, 0.1)), cases("f", "a", (0.2, 0.05)), cases("g", "a", (0.2,), 9.0)]
    groups = [[c._replace(reference_time=7.0) for c in group] for group in groups]
    done = {key(c): record(c) for group in groups for c in group if c.setting.options["step"] != 0.1}
    found = comparison._other_families(groups, done)
    assert [(g[0].engine, g[0].setting.family, g[0].reference_time) for g in found] == [
        ("e", "b", 7.0),
        ("g", "b", 7.0),
    ]
    assert [(given[1], given[2], given[4]) for given in asked] == [(["e"], None, 5.0), (["g"], None, 9.0)]
    assert all(given[3] is TIMES for given in asked)


def test_families_that_have_run_are_no_other_families(machine, monkeypatch):
    monkeypatch.setattr(comparison, "default_cases", lambda *given: (cases(steps=(0.3, 0.1)), []))
    monkeypatch.setattr(comparison, "grade", lambda record: Grade.FAILED)
    group = cases(steps=(0.08,))
    assert comparison._other_families([group], {key(group[0]): record(group[0])}) == []


@pytest.mark.parametrize(
    ("grades", "has_others"),
    [
        ((Grade.UNJUDGED, Grade.FAILED), False),
        ((Grade.FAILED, Grade.FAILED), True),
        ((Grade.WRONG, Grade.FAILED), True),
        ((Grade.INACCURATE, Grade.WRONG), True),
        ((Grade.FAILED, Grade.RIGHT), False),
    ],
)
def test_no_further_family_runs_if_one_is_right_or_completes_an_unknown_motion(
    machine, monkeypatch, grades, has_others
):
    group = cases(steps=(0.2, 0.1))
    of = dict(zip((0.2, 0.1), grades, strict=True))
    monkeypatch.setattr(comparison, "default_cases", lambda *given: (cases(family="b", steps=(0.3,)), []))
    monkeypatch.setattr(comparison, "grade", lambda r: of[r["step"]])
    done = {key(case): record(case) for case in group}
    assert bool(comparison._other_families([group], done)) == has_others


@pytest.mark.parametrize(("is_quick", "long"), [(True, sweep.QUICK_LONG), (False, sweep.LONG)])
def test_runs_that_are_timed_again(machine, is_quick, long):
    machine.measured(cases(), is_quick, repeats=4)
    run, reported, path, notice, longest, repeats = machine.timed
    assert (longest, repeats, path) == (long, 4, None) and notice == machine.notices.append
    assert [case.setting.options["step"] for case in run] == [r["step"] for r in reported]
    assert {case.reference_time for case in run} == {7.0}, "the time that was asked for a reference"
    assert Wanted([TIMES], 1.0, True).repeats == REPEATS


def test_coarser_settings_are_added_until_none_is_useful(machine, monkeypatch):
    """The first family gets 0.16 and 0.32; the second gets none: its coarsest is too inaccurate."""

    def beyond(family: list[Case], records: dict[str, Any]) -> list[Case]:
        step = family[0].setting.options["step"]
        return cases("e", family[0].setting.family, (2 * step,)) if step < 0.3 else []

    monkeypatch.setattr(comparison, "beyond", beyond)
    groups, records = comparison._with_coarser(
        [cases(steps=(0.08,)), cases(family="b", steps=(0.5,))], {"k": 1}, None
    )
    assert machine.stages == [
        ("running at coarser settings", [("e", "a", 0.16)]),
        ("running at coarser settings", [("e", "a", 0.32)]),
    ]
    assert [[c.setting.options["step"] for c in group] for group in groups] == [[0.32, 0.16, 0.08], [0.5]]
    assert len(records) == 3 and records["k"] == 1 and machine.calls == 2, "nothing runs without settings"


def test_coarser_settings_end_after_eight(machine, monkeypatch):
    monkeypatch.setattr(
        comparison, "beyond", lambda family, _: cases(steps=(2 * family[0].setting.options["step"],))
    )
    groups, _ = comparison._with_coarser([cases(steps=(1.0,))], {}, None)
    assert [c.setting.options["step"] for c in groups[0]] == [2.0**k for k in range(8, -1, -1)]


def test_gates_run_with_the_first_settings(machine, monkeypatch):
    gate = cases("gate", "g", (1.0,))
    asked: list[Any] = []
    monkeypatch.setattr(comparison, "identity_cases", lambda *given: asked.append(given) or gate)
    found = machine.measured([*cases(limit=3.0), *cases("f", limit=4.0)], True)
    assert machine.stages[0][1][-1] == ("gate", "g", 1.0) and len(machine.stages[0][1]) == 5
    assert [r["step"] for r in found.identities] == [1.0] and len(found.records) == 6
    assert asked == [(still(), ["e", "f"], 4.0)], "all engines, and the longest limit"
    machine.stages.clear()
    machine.measured(cases(), False)
    assert machine.stages[0][1][-1] == ("gate", "g", 1.0)


def test_nothing_runs_for_no_cases():
    assert comparison._made("running", [], None) == {}


@pytest.mark.parametrize("fails", [False, True])
def test_children_end_with_the_comparison(machine, monkeypatch, fails):
    ended: list[str] = []
    monkeypatch.setattr(comparison, "end_idle", lambda: ended.append("end"))
    monkeypatch.setattr(comparison, "_truths", lambda *given: [{"truth": 1}])
    monkeypatch.setattr(comparison, "scouted", lambda *given: ended.append("scouted"))

    def plan() -> list[Case]:
        if fails:
            raise KeyboardInterrupt
        return cases()

    wanted = Wanted([TIMES], 7.0, True)
    if fails:
        with pytest.raises(KeyboardInterrupt):
            comparison.collected([still()], ["e"], wanted, plan, machine.notices.append)
    else:
        found = comparison.collected([still()], ["e"], wanted, plan, machine.notices.append)
        assert found.truths == [{"truth": 1}] and len(found.records) == 3
    assert ended == ["scouted", "end"]


# --- order ------------------------------------------------------------------------------------------------
def order(*given: tuple[str, str]) -> list[str]:
    chosen = [Case(still(), TIMES, engine, Setting(family)) for engine, family in given]
    return [case.engine for case in comparison._long_first(chosen)]


def test_engines_that_compile_come_before_the_others_and_the_last_before_the_first():
    """The first engine stays first; "c" has a compiled family, and so comes before "b" and "d"."""
    assert order(("a", "x"), ("b", "x"), ("c", "forward, compiled"), ("d", "x")) == ["a", "c", "d", "b"]
    assert order(("a", "x"), ("b", "x")) == ["a", "b"]
    assert order(("a", "x"), ("b", "x"), ("a", "y"), ("c", "x")) == ["a", "a", "c", "b"]


def test_settings_are_found_out_with_their_number(monkeypatch):
    seen: list[Any] = []

    class Bar:
        def __enter__(self) -> Any:
            return "advance"

        def __exit__(self, *_: object) -> None:
            seen.append("end")

    monkeypatch.setattr(comparison, "unasked", lambda engines, scenes: len(engines) * len(scenes))
    monkeypatch.setattr(comparison, "counted", lambda what, total: seen.append((what, total)) or Bar())
    monkeypatch.setattr(comparison, "scout", lambda *given: seen.append(given))
    scenes = [still("a"), still("b")]
    comparison.scouted(scenes, ["x", "y", "z"])
    assert seen == [("looking for settings", 6), (["x", "y", "z"], scenes, "advance"), "end"]
    seen.clear()
    comparison.scouted(scenes, [])
    assert seen == [], "all settings are known"


def test_pictures_are_made_for_a_report_only(monkeypatch, tmp_path):
    asked: list[Any] = []
    monkeypatch.setattr(comparison.pictures, "worst_runs", lambda *given: asked.append(given) or ["worst"])
    monkeypatch.setattr(comparison.pictures, "branches", lambda *given: asked.append(given) or ["branch"])
    assert comparison._pictures([], [], None) == ([], []) and asked == []
    assert comparison._pictures(["run"], ["truth"], tmp_path) == (["worst"], ["branch"])
    assert asked == [
        (["run"], ["truth"], tmp_path / "motions.jsonl"),
        (["run"], tmp_path / "branches.jsonl"),
    ]


@pytest.mark.parametrize(("stored", "is_made"), [(2.0, False), (2.1, False), (1.9, True)])
def test_a_stored_truth_that_had_the_time_is_kept(monkeypatch, tmp_path, stored, is_made):
    monkeypatch.setattr(
        comparison, "stored", lambda path: {comparison.truth_key(still(), TIMES): {"given": stored}}
    )
    monkeypatch.setattr(comparison, "append", lambda path, record: kept.append((path, record)))
    monkeypatch.setattr(comparison, "truth_record", lambda *given: {"made": given[2]})
    kept: list[Any] = []
    found = comparison._truths([still(), still("other")], Wanted([TIMES, TIMES], 2.0, True, tmp_path))
    assert found == [{"made": 2.0} if is_made else {"given": stored}, {"made": 2.0}]
    assert [path for path, _ in kept] == [tmp_path / "truths.jsonl"] * (1 + is_made)
