"""Sweeps of a report and their times / families, limits, growth and repeats worked out by hand."""

from __future__ import annotations

import math
import sys
from contextlib import contextmanager
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.engine import Cannot, Engine, Owner, Setting
from crosscheck.judge.truth import NoSolution
from crosscheck.paper import runs as paper_runs
from crosscheck.paper.runs import Label
from crosscheck.processes.child import ChildFailed
from crosscheck.study import fair_timing, grid, ladder, stability, timings
from crosscheck.study import sweep as sweeps
from crosscheck.study.between import between, coarser, longest_step, within, work
from crosscheck.study.grid import Case, Record, Unable, key
from mbref.records import append
from mbref.scene import Body, Scene
from mbref.scenes import SCENES
from mbref.trajectory import Outcome


def still(name: str) -> Scene:
    block = Body(name="block", mass=2.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 2.0, 3.0))
    return Scene(name=name, body=(block,), duration=0.5)


def case(family: str, k: int) -> Case:
    return Case(still("s"), np.array([0.0, 1.0]), "e", Setting(family, {"k": k}))


def test_thinned_sweep_and_the_ends_of_every_family():
    named = [case(family, k) for family in ("other", "defaults", "tuned") for k in range(7)]
    kept = [(c.setting.family, c.setting.options["k"]) for c in sweeps.thinned(named)]
    assert kept == [(f, k) for f in ("other", "defaults", "tuned") for k in (0, 3, 6)], kept
    few = {c.setting.family for c in sweeps.of_few_families(named)}
    assert few == {"defaults", "tuned"}, few
    unnamed = [case(family, k) for family in ("a", "b", "c", "d") for k in range(2)]
    assert {c.setting.family for c in sweeps.of_few_families(unnamed)} == {"a", "b"}
    assert {c.setting.family for c in sweeps.of_few_families(unnamed, ["c"])} == {"c"}


def cost(asked: Case, seconds: float, outcome: str = "COMPLETED") -> dict[str, Record]:
    return {key(asked): {"outcome": outcome, "cost": {"seconds": seconds}}}


@pytest.mark.parametrize(
    ("seconds", "middle", "outcome", "chosen"),
    [
        (0.01, 0.02, "COMPLETED", 6),
        (0.1, 0.8, "COMPLETED", 4),
        (0.5, 4.0, "COMPLETED", None),
        (0.5, 10.0, "TIMED_OUT", None),
        (0.1, 0.1, "STEP_FAILED", 6),
    ],
)
def test_the_finest_setting_that_is_affordable_by_the_growth_so_far(seconds, middle, outcome, chosen):
    family = [case("a", k) for k in range(7)]
    begun = ladder.first(family)
    assert [c.setting.options["k"] for c in begun] == [0, 3]
    records = cost(begun[0], seconds) | cost(begun[1], middle, outcome)
    assert [c.setting.options["k"] for c in ladder.finest(family, records)] == [chosen] * (chosen is not None)


def test_the_cost_of_a_step_is_inverse_to_its_length():
    family = [case("a", k)._replace(setting=Setting("a", {"step": 10.0**-k})) for k in range(5)]
    records = cost(family[0], 0.4, "STEP_FAILED") | cost(family[2], 0.2)
    assert ladder.finest(family, records) == [family[3]], "2 s are affordable, 20 s are not"
    assert ladder.first(family[:1]) == family[:1] and not ladder.finest(family[:1], cost(family[0], 0.1))


def test_growth_between_two_runs_is_continued():
    """0.1 s and 0.2 s of settings 0 and 3: 0.4 s for setting 6, if the cost does not fall."""
    family = [case("a", k) for k in range(7)]
    assert ladder._expected(family, (0.1, 0.2), 6) == pytest.approx(0.4)
    assert ladder._expected(family, (0.1, 0.2), 4) == pytest.approx(0.2 * 2 ** (1 / 3))
    assert ladder._expected(family, (0.2, 0.1), 6) == 0.1, "a cost that falls is not continued"
    assert ladder._expected(family, (None, None), 6) == 0.0
    assert ladder._expected(family, (0.3, None), 6) == ladder._expected(family, (0.0, 0.3), 6) == 0.3
    assert ladder._expected(family[:2], (0.3, 0.3), 1) == 0.3, "the middle of two settings is the first"
    stepped = [case("a", k)._replace(setting=Setting("a", {"step": 2.0**-k})) for k in range(5)]
    assert (
        ladder._expected(stepped, (0.1, 0.5), 4) == 2.0 and ladder._expected(stepped, (0.1, None), 4) == 1.6
    )
    assert (
        ladder._cost({"outcome": "TIMED_OUT"}) == math.inf and ladder._cost({"outcome": "NOT_FINITE"}) is None
    )


def ran(asked: Case, error: float, rhs: int, outcome: str = "COMPLETED") -> dict[str, Record]:
    record = {"outcome": outcome, "cost": {"seconds": 1.0, "rhs": rhs}, "metrics": {"error": error}}
    return {key(asked): record}


def test_coarser_settings_follow_as_long_as_they_are_good_and_cheap():
    family = [case("a", k)._replace(setting=Setting("a", {"step": 0.1 / 2**k})) for k in range(3)]
    good = ran(family[0], 1e-3, 10) | ran(family[1], 1e-4, 20)
    [coarse] = ladder.beyond(family, good)
    assert coarse.setting == Setting("a", {"step": 0.2}) and coarse.scene == family[0].scene
    assert ladder.beyond(family, ran(family[0], 1.1e-3, 10) | ran(family[1], 1e-4, 20)) == []
    assert ladder.beyond(family, ran(family[0], 1e-3, 10, "NOT_FINITE") | ran(family[1], 1e-4, 20)) == []
    assert ladder.beyond(family, ran(family[0], 1e-3, 20) | ran(family[1], 1e-4, 20)) == [], "no cheaper"
    failed = ran(family[0], 1e-3, 20) | ran(family[1], 1e-4, 20, "NOT_FINITE")
    assert len(ladder.beyond(family, failed)) == 1, "the work of a failed run is not known"
    assert ladder.beyond(family, ran(family[0], 1e-3, 10)) == [], "one run"
    assert ladder.beyond(family, ran(family[1], 1e-3, 10) | ran(family[2], 1e-4, 20)) == []
    longest = [c._replace(setting=Setting("a", {"step": 1.0 / 2**k})) for k, c in enumerate(family)]
    assert ladder.beyond(longest, ran(longest[0], 1e-3, 10) | ran(longest[1], 1e-4, 20)) == [], (
        "a step of 1 s"
    )


def test_steps_within_the_interval_of_the_samples():
    def stepped(*steps: float) -> list[Setting]:
        return [Setting("f", {"step": step}) for step in steps]

    assert within(stepped(0.4, 0.1), 1.0) == within(stepped(0.4, 0.1), 0.4) == stepped(0.4, 0.1)
    assert within(stepped(0.4, 0.1), 0.2) == stepped(0.2, 0.1), "the longest step comes first"
    assert within(stepped(0.4, 0.1), 0.1) == stepped(0.1) and within(stepped(0.8, 0.4), 0.1) == stepped(0.1)
    tolerances = [Setting("f", {"rtol": 0.1}), Setting("f", {"rtol": 0.01})]
    assert within(tolerances, 1e-9) == tolerances
    both = [Setting("f", {"step": 0.4, "hard": 1.0}), Setting("f", {"step": 0.1, "hard": 16.0})]
    assert within(both, 0.2)[0] == Setting("f", {"step": 0.2, "hard": 4.0}), "by equal ratios"
    assert longest_step([0.5, 0.75, 1.5]) == 0.75 and longest_step([2.0, 2.5]) == 2.0
    assert between(*stepped(0.4, 0.1)) == Setting("f", {"step": 0.2}) and between(*stepped(0.1, 0.1)) is None
    assert between(*stepped(0.1001, 0.1)) is None, "equal in three digits"
    words = Setting("f", {"law": "soft", "step": 0.4}), Setting("f", {"law": "hard", "step": 0.1})
    assert between(*words) is None and between(Setting("f", {"n": 2}), Setting("f", {"n": 8})) is None
    assert coarser(*stepped(0.1, 0.2), longest=1.0) is None, "no step grows"
    assert work({"cost": {"rhs": 0, "steps": 3, "seconds": 9.0}}) == 3.0
    assert work({"cost": {"rhs": 2, "steps": 3}}) == 2.0 and work({"cost": {"seconds": 9.0}}) == 9.0


# --- runs of a report -------------------------------------------------------------------------------------
def test_every_setting_of_every_scene(monkeypatch):
    asked = []

    def default_cases(scene, engines, families, times, limit):
        asked.append((scene.name, engines, families, len(times), times[-1], limit))
        cases = [
            case(family, 0)._replace(scene=scene, engine=e) for e in engines for family in ("tuned", "x", "y")
        ]
        return cases, [Unable(scene, "none", Cannot(Owner.ENGINE, "no loop"))]

    monkeypatch.setattr(sweeps, "default_cases", default_cases)
    scenes = [still("one"), still("two").with_(duration=2.0)]
    cases, unable = sweeps.whole(scenes, ["e"])
    assert asked == [("one", ["e"], None, 101, 0.5, 120.0), ("two", ["e"], None, 101, 2.0, 120.0)]
    assert [(c.scene.name, c.setting.family) for c in cases] == [
        (n, f) for n in ("one", "two") for f in ("tuned", "x", "y")
    ]
    assert [u.scene.name for u in unable] == ["one", "two"]
    asked.clear()
    cases, unable = sweeps.quick(scenes, ["e"])
    assert asked == [("one", ["e"], None, 31, 0.5, 5.0), ("two", ["e"], None, 31, 2.0, 5.0)]
    assert [c.setting.family for c in cases] == ["tuned", "tuned"] and len(unable) == 2
    assert [scene.name for scene in sweeps.whole_scenes()] == list(SCENES)
    assert {s.name: s.duration for s in sweeps.quick_scenes()} == sweeps.QUICK_SCENES


def test_ladders_run_after_settings_are_found(monkeypatch, tmp_path):
    asked: list[Any] = []

    @contextmanager
    def shown(what: str, count: int):
        yield f"{what}: {count}"

    monkeypatch.setattr(stability, "FAMILIES", {"mbref": 1, "mujoco": 1, "dart": 1})
    monkeypatch.setattr(stability, "scenes", lambda: ["s"])
    monkeypatch.setattr(stability, "unasked", lambda able, rungs: asked.append((able, rungs)) or 2)
    monkeypatch.setattr(stability, "scout", lambda *given: asked.append(given))
    monkeypatch.setattr(stability, "cases", lambda able: [f"case of {name}" for name in able])
    monkeypatch.setattr(stability, "study", lambda *given: given)
    monkeypatch.setattr(stability, "counted", shown)
    monkeypatch.setattr(stability, "shown", shown)
    found = stability.run(tmp_path, ["mujoco", "other", "mbref"])
    able = ["mbref", "mujoco"]
    assert asked == [(able, ["s"]), (able, ["s"], "finding out settings: 2")]
    assert found == (["case of mbref", "case of mujoco"], None, tmp_path, "the stability ladders: 2")


def test_metrics_of_a_run_in_turn_have_a_limit_of_their_own(monkeypatch):
    asked: list[Any] = []
    monkeypatch.setattr(grid, "record_of", lambda case, run: (case.reference_time, run))
    monkeypatch.setattr(grid.pool, "run_in_turn", lambda *given: asked.append(given) or "motion")

    def apart(function: Any, given: tuple[Any, ...], limit: float) -> Any:
        asked.append(limit)
        if limit > 100.0:
            raise ChildFailed(Outcome.TIMED_OUT, "late")
        return function(*given)

    monkeypatch.setattr(grid.pool, "apart", apart)
    one = case("f", 1)._replace(time_limit=5.0, reference_time=20.0)
    assert grid.run_in_turn(one) == (20.0, "motion")
    assert asked == [("e", one.scene, one.times, one.setting, 5.0), 50.0]
    assert grid.run_in_turn(one._replace(time_limit=40.0)) == (0.0, "motion"), "no error without a truth"


# --- interleaved times ------------------------------------------------------------------------------------
def timed_record(name: str, seconds: float, outcome: str = "COMPLETED", scene: str = "s") -> Record:
    return {"key": name, "scene": scene, "outcome": outcome, "cost": {"seconds": seconds, "steps": 3}}


def test_completed_runs_of_a_scene_take_turns(monkeypatch):
    """Three repeats of each; a repeat that did not complete is no number."""
    asked, lines = [], []

    def interleaved(scene, times, jobs, repeats, limit):
        asked.append((scene.name, times.tolist(), jobs, repeats, limit))
        if scene.name == "lost":
            raise ChildFailed(Outcome.CRASHED, "the process ended")
        return [[3.0, 1.0, math.nan], [math.nan] * 3][: len(jobs)]

    monkeypatch.setattr(fair_timing, "time_interleaved", interleaved)
    cases = [case(f, k)._replace(time_limit=k + 1.0) for k, f in enumerate("abc")]
    lost = [case("a", 1)._replace(scene=still("lost")), case("b", 1)._replace(scene=still("none"))]
    records = [
        timed_record("1", 9.0),
        timed_record("2", 8.0, "NOT_FINITE"),
        timed_record("3", 7.0),
        timed_record("4", 6.0, scene="lost"),
        timed_record("5", 5.0, "NOT_FINITE", scene="none"),
    ]
    found = fair_timing.timed([*cases, *lost], records, 3, lines.append)
    assert asked[0] == (
        "s",
        [0.0, 1.0],
        [("e", cases[0].setting), ("e", cases[2].setting)],
        3,
        4 * (1.0 + 3.0),
    )
    assert [a[0] for a in asked] == ["s", "lost"], "no run of the third scene completed"
    assert found[0] == {
        **records[0],
        "cost": {"seconds": 1.0, "steps": 3},
        "timing": {"median": 2.0, "repeats": 2},
    }
    assert found[1:] == records[1:] and records[0]["cost"]["seconds"] == 9.0
    assert lines == ["lost: no interleaved timing, single runs are shown: the process ended"]


def test_times_are_stored_and_not_measured_again(monkeypatch, tmp_path):
    asked, lines, path = [], [], tmp_path / "timings.jsonl"

    def timed(cases, records, repeats, notice):
        asked.append(([c.setting.family for c in cases], [r["key"] for r in records], repeats))
        return [
            {**r, "cost": {"seconds": 0.1}, "timing": {"median": 0.2}} if r["key"] != "lost" else r
            for r in records
        ]

    monkeypatch.setattr(timings, "timed", timed)
    cases = [case(f, 0) for f in "abcde"]
    records = [
        timed_record("one", 0.5),
        timed_record("long", 0.51),
        timed_record("two", 0.2),
        timed_record("bad", 0.1, "NOT_FINITE"),
        timed_record("lost", 0.3),
    ]
    found = timings.with_timings(cases, records, path, lines.append)
    assert asked == [(["a", "c", "e"], ["one", "two", "lost"], 5)], "runs of up to 0.5 s"
    assert lines == ["s: timing, 5 interleaved repeats"]
    times = [(r["cost"]["seconds"], r.get("timing")) for r in found]
    short = (0.1, {"median": 0.2})
    assert times == [short, (0.51, None), short, (0.1, None), (0.3, None)]
    again = timings.with_timings(cases[:4], records[:4], path, lines.append)
    assert again == found[:4] and len(asked) == len(lines) == 1
    timings.with_timings(cases[1:2], records[1:2], path, lines.append, long=1.0, repeats=3)
    assert asked[1] == (["b"], ["long"], 3) and len(path.read_text().splitlines()) == 3
    append(path, {"key": "lost", "seconds": 0.25, "timing": None})
    assert timings.with_timings(cases[4:], records[4:], path, lines.append)[0]["cost"]["seconds"] == 0.25


def test_wrong_engines_with_other_accelerations_at_equal_states(monkeypatch):
    """An engine counts only if each of its wrong runs differs; the least difference is said."""

    def run(engine: str, error: float, by: float | None) -> Record:
        record = timed_record(f"{engine}{by}", 1.0)
        return {**record, "engine": engine, "family": f"{by}", "metrics": {"error": error}, "by": by}

    def along(scene: Scene, motion: Record) -> Any:
        by = motion["by"]
        return None if by is None else SimpleNamespace(by=by, __str__=None)

    class Difference(float):
        @property
        def by(self) -> float:
            return float(self)

        def __str__(self) -> str:
            return f"off by {float(self):g}"

    monkeypatch.setattr(fair_timing, "_motion", lambda scene, record: record)
    monkeypatch.setattr(
        fair_timing, "along", lambda scene, r: None if r["by"] is None else Difference(r["by"])
    )
    records = [
        run("both", 0.5, 3.0),
        run("both", 0.7, 2.0),
        run("both", 1e-3, None),
        run("one", 0.5, 3.0),
        run("one", 0.7, None),
        run("right", 1e-9, 4.0),
        run("right", 0.5, 4.0),
    ]
    assert fair_timing.force_differences(still("s"), records[3:]) == {}
    wrong = [r for r in records if r["metrics"]["error"] > 1e-2]
    assert fair_timing.force_differences(still("s"), wrong[:4]) == {"both": "off by 2"}


class SingleEngine(Engine):
    """An outsider's engine with 20 bits."""

    name, package, rounding = "mine", "numpy", 2.0**-20

    def settings(self, scene: Scene) -> list[Setting]:
        return []

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Any:
        raise NotImplementedError


def test_models_differ_from_the_truth_or_from_the_first_run(monkeypatch):
    asked = []

    def differences(scene, motions, rounding):
        asked.append(motions)
        single = {"warp": 2.0**-23, "mine": 2.0**-20} if "b" in motions else {}
        assert rounding == single, "of engines on this machine, by the names in their records"
        return {"b": 0.25, "c": 0.5}

    monkeypatch.setattr(fair_timing, "_motion", lambda scene, record: record["key"])
    monkeypatch.setattr(fair_timing, "differences", differences)
    outsider = ModuleType("an_outsiders_module")
    vars(outsider).update(ENGINE=SingleEngine())
    monkeypatch.setitem(sys.modules, "an_outsiders_module", outsider)
    monkeypatch.setattr(fair_timing, "truth_for", lambda scene, seconds: None)
    engines = {
        "a": ("own", "own"),
        "b": ("warp", "warp"),
        "c": ("mine", "an_outsiders_module:ENGINE"),
        "d": ("elsewhere", "no_such_module:ENGINE"),
        "e": ("nameless", "an_outsiders_module:NONE"),
        "x": ("newton", "newton"),
    }
    records = [timed_record(key, 1.0, "NOT_FINITE" if key == "x" else "COMPLETED") for key in engines]
    for record in records:
        name, asked_for = engines[record["key"]]
        record.update(engine=name, asked={"engine": asked_for})
    motions = list("abcde")
    assert fair_timing.model_differences(still("s"), records) == {"b": "0.25", "c": "0.5"}
    assert fair_timing.model_difference(still("s"), records) == "0.25" and asked == [motions] * 2
    assert fair_timing.model_difference(still("s"), []) is None and len(asked) == 2
    exact = SimpleNamespace(poses=lambda times: "exact")
    monkeypatch.setattr(fair_timing, "truth_for", lambda scene, seconds: exact)
    fair_timing.model_differences(still("s"), records)
    fair_timing.model_differences(still("s"), [])
    assert asked[2:] == [["exact", *motions], ["exact"]]

    def ends(times):
        raise NoSolution.ending("it locks", 0.1)

    monkeypatch.setattr(fair_timing, "truth_for", lambda scene, seconds: SimpleNamespace(poses=ends))
    fair_timing.model_differences(still("s"), records)
    assert asked[4:] == [motions]


@pytest.mark.parametrize(
    ("errors", "is_left_out"), [((1.1e-8,), False), ((1e-8,), True), ((0.5, 1e-9), True), ((None,), False)]
)
def test_an_engine_with_a_right_motion_simulates_the_scene(monkeypatch, errors, is_left_out):
    """Its short run has an error of its settings, as of soft constraints of a linkage of 1 km."""
    monkeypatch.setattr(fair_timing, "_motion", lambda scene, record: record["key"])
    monkeypatch.setattr(fair_timing, "truth_for", lambda scene, seconds: SimpleNamespace(poses=lambda t: "x"))
    monkeypatch.setattr(fair_timing, "differences", lambda *given: {"b": 0.25, "c": 0.5})
    gates = [{**timed_record(key, 1.0, "COMPLETED"), "engine": key} for key in "bc"]
    for gate in gates:
        gate["asked"] = {"engine": gate["engine"]}
    runs = [{**timed_record("run", 1.0, "COMPLETED"), "engine": "b", "metrics": {"error": e}} for e in errors]
    found = fair_timing.model_differences(still("s"), gates, motions=runs)
    assert found == ({"c": "0.5"} if is_left_out else {"b": "0.25", "c": "0.5"})
    assert fair_timing.model_difference(still("s"), gates, motions=runs) == next(iter(found.values()))


# --- the paper's runs -------------------------------------------------------------------------------------
def test_labels_of_the_paper_s_runs():
    assert str(Label("II", "LM2", "four-bar")) == "Table II, LM2, four-bar"
    assert str(Label("figures", "LM2", "")) == "figures, LM2"
    assert str(Label("sweep", "LM2", "x", "rtol 1e-6")) == "sweep, LM2, x, rtol 1e-6"


def test_runs_that_failed_before_the_first_sample_are_repeated_up_to_their_end(monkeypatch):
    """The first sample is at 0.1 s; a run that failed at 0.04 s has its error at 0.9 of that."""
    ends = [("NOT_FINITE", 0.04), ("NOT_FINITE", 0.1), ("NOT_FINITE", 0.0), ("COMPLETED", 0.05)]
    cells = [SimpleNamespace(table="II", row=f"r{k}", column="c") for k in range(4)]
    records = {Label("II", f"r{k}", "c"): {"outcome": o, "t_end": t} for k, (o, t) in enumerate(ends)}
    monkeypatch.setattr(paper_runs, "CELLS", cells)
    monkeypatch.setattr(paper_runs, "SAMPLES", (0.0, 0.1, 0.2))
    monkeypatch.setattr(paper_runs, "linkage", lambda *given: given)
    [(label, (row, column, at))] = paper_runs.follow_ups(records).items()
    assert label == Label("error", "r0", "c") and (row, column) == ("r0", "c")
    assert at.tolist() == [paper_runs.SHARE * 0.04] and 0.5 < paper_runs.SHARE < 1.0
