"""Studies / records on paper at their limits: numbers that equal a limit, ties, and runs without a number."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.engine import Cannot, Owner, Setting
from crosscheck.judge.tolerances import ERROR_LEVELS, FALSE_SUCCESS, FLOOR
from crosscheck.study import (
    between,
    chains,
    difference,
    fair_timing,
    grid,
    hurried,
    ladder,
    least_errors,
    origin,
    pictures,
    progress,
    record_view,
    scouting,
    sentences,
    speed_sentences,
    truths,
    tuning,
    wording,
)
from crosscheck.study.between import coarser, within, work
from crosscheck.study.grid import Case, key
from crosscheck.study.verdict import Grade, Judged, grade, judged
from mbref.formats import OriginalRun
from mbref.scene import Body, Revolute, Scene
from mbref.trajectory import Trajectory

BLOCK = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
SCENE = Scene(name="s", body=(BLOCK,), duration=1.0)
TIMES = np.array([0.0, 1.0])


def run(error: float | None = 1e-5, seconds: float = 1.0, **more: Any) -> dict[str, Any]:
    made = {
        "scene": "s",
        "engine": "e",
        "family": "f",
        "outcome": "COMPLETED",
        "t_end": 1.0,
        "times": [0.0, 1.0],
        "metrics": {"error": error},
        "cost": {"seconds": seconds},
        "settings": {},
        "machine": {"cpu": "a"},
        "asked": {"engine": "e", "options": {}, "end": 1.0},
        "repeated": False,
        "time_limit": 5.0,
        "message": "",
    }
    return {**made, **more}


def family(*steps: float) -> list[Case]:
    return [Case(SCENE, TIMES, "e", Setting("f", {"step": step}), 5.0) for step in steps]


# --- grades -------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("record", "wanted"),
    [
        (run(FLOOR), Grade.RIGHT),
        (run(1.01 * FLOOR), Grade.INACCURATE),
        (run(FALSE_SUCCESS), Grade.INACCURATE),
        (run(1.01 * FALSE_SUCCESS), Grade.WRONG),
        (run(math.nan), Grade.WRONG),
        (run(None), Grade.UNJUDGED),
        (run(0.0, outcome="STEP_FAILED"), Grade.FAILED),
    ],
)
def test_grades_at_their_limits(record, wanted):
    assert grade(record) is wanted and str(wanted) == wanted.value


def group(*records: dict[str, Any], differences: dict[str, str] | None = None, kind: str = "k") -> Judged:
    return Judged(SCENE, {"kind": kind}, records, differences or {})


def test_the_fastest_run_within_an_error():
    """An error that equals the level is within it; of equal times the first run counts."""
    records = [
        run(1e-3, 9.0, key=1),
        run(1e-5, 2.0, key=2),
        run(1.1e-5, 1.0, key=3),
        run(1e-9, 2.0, key=4),
        run(1e-9, 0.5, key=5, outcome="CRASHED"),
        run(None, 0.5, key=6),
        run(1e-2, 0.5, key=7, engine="x"),
        run(1e-9, 0.5, key=8, engine="other"),
    ]
    found = group(*records, differences={"other": "heavier"}).cheapest(1e-5)
    assert {name: record["key"] for name, record in found.items()} == {"e": 2}


def test_the_fastest_of_accepted_runs_or_the_most_accurate():
    records = [
        run(1e-2, 0.1, key=1),
        run(1e-5, 3.0, key=2),
        run(1e-9, 2.0, key=3),
        run(1e-9, 1.0, key=4, family="g"),
        run(None, 0.5, key=5),
        run(1e-9, 0.1, key=6, outcome="CRASHED"),
        run(1e-2, 1.0, key=7, engine="x"),
        run(1e-3, 9.0, key=8, engine="x"),
        run(1e-9, 1.0, key=9, engine="other"),
    ]
    of = group(*records, differences={"other": "heavier"})
    found = of.within(1e-5, lambda record: record["family"] == "f")
    assert {name: record["key"] for name, record in found.items()} == {"e": 3, "x": 8}
    assert of.within(1e-5, lambda record: True)["e"]["key"] == 4
    assert of.within(1e-5, lambda record: False) == {}


def test_families_that_reach_an_error():
    """One family needs 1 s, another 4 s; a third does not reach the error."""
    records = [
        run(1e-5, 1.0, key=1),
        run(1e-5, 4.0, key=2, family="g"),
        run(1e-2, 0.1, key=3, family="h"),
        run(1e-9, 0.1, key=4, family="h", outcome="CRASHED"),
        run(1e-2, 0.1, key=5, engine="x"),
    ]
    of = group(*records)
    assert of.costs(1e-5) == {"e": pytest.approx(1.0)}
    assert of.fastest(1e-5)["e"][1]["key"] == 1
    slower = of.fastest(1e-5, without=lambda record: record["family"] == "f")
    assert slower["e"] == (pytest.approx(4.0), records[1])
    assert of.fastest(1e-5, without=lambda record: True) == {}


@pytest.mark.parametrize(
    ("kind", "records", "wanted"),
    [
        ("k", [run()], True),
        ("", [run()], False),
        ("k", [], False),
        ("k", [run(None)], False),
        ("k", [run(None, outcome="CRASHED")], True),
        ("k", [run(None), run(1e-3, outcome="STEP_FAILED")], True),
        ("k", [run(engine="other")], False),
    ],
)
def test_scenes_that_are_judged(kind, records, wanted):
    assert group(*records, kind=kind, differences={"other": "heavier"}).is_judged is wanted


def test_the_distance_of_two_engines():
    """0.25 and 0.5 of the length at the last sample; runs at other times are not compared."""

    def moved(name: str, x: float, times: tuple[float, ...] = (0.0, 1.0)) -> dict[str, Any]:
        place = np.zeros((len(times), 1, 3))
        place[-1, 0, 0] = x
        turn = np.tile([1.0, 0.0, 0.0, 0.0], (len(times), 1, 1))
        still = np.zeros_like(place)
        made = Trajectory("s", name, "1", "m", {}, np.array(times), ("b",), place, turn, still, still)
        return run(**{**made.to_record(), "outcome": "COMPLETED"})

    ended = {**moved("d", 9.0), "outcome": "CRASHED"}
    other = moved("c", 0.0, (0.0, 0.5))
    found = group(
        moved("a", 9.0), moved("a", 0.0), moved("b", 0.25), other, ended, moved("z", 0.75)
    ).agreement()
    assert set(found) == {("a", "b"), ("a", "z"), ("b", "z")}
    assert found["a", "b"] == pytest.approx(found["a", "z"] / 3) == pytest.approx(found["b", "z"] / 2)


def test_scenes_with_their_records():
    first, second, empty = (SCENE.with_(name=name) for name in "abc")
    known = [{"scene": name, "kind": name} for name in "cba"]
    records = [run(scene="b"), run(scene="a"), run(scene="a")]
    one, two = judged([first, second, empty], known, records, {"b": {"e": "lighter"}})
    assert (one.scene, one.truth["kind"], len(one.records), one.differences) == (first, "a", 2, {})
    assert (two.scene, len(two.records), two.differences) == (second, 1, {"e": "lighter"})


# --- least errors -------------------------------------------------------------------------------------------
def test_an_error_that_equals_the_floor_is_reached():
    [least] = least_errors.least_errors(
        [run(FLOOR), run(1.01 * FLOOR, family="g"), run(0.0, family="h", outcome="CRASHED")]
    )
    assert least.is_reached and least.share() == "1 of 3" and least.scene == "s"
    assert least.row()[6:] == ("f", f"g {1.01 * FLOOR:.2e}; h crashed")
    assert least_errors.HEADER[6] == f"within {FLOOR:.0e}"


def test_order_of_runs():
    """Completed runs by their errors, before others by their ends."""
    runs = [run(1.0, outcome="CRASHED", t_end=t) for t in (0.5, 0.75)] + [run(0.5), run(0.25)]
    assert [runs.index(r) for r in sorted(runs, key=least_errors.rank)] == [3, 2, 1, 0]
    assert least_errors.rank(run(None, t_end=0.5)) == (False, 0.0, math.inf)
    assert least_errors.rank(run(1e-3, t_end=0.5, outcome="CRASHED")) == (True, -0.5, 1e-3)


# --- settings that run --------------------------------------------------------------------------------------
@pytest.mark.parametrize(("middle", "chosen"), [(0.75, [0.03125]), (0.76, [0.0625])])
def test_a_finest_setting_of_just_the_seconds_that_are_affordable(middle, chosen):
    """Four times the middle run: 3 s are affordable."""
    steps = family(0.5, 0.25, 0.125, 0.0625, 0.03125)
    records = {key(steps[0]): run(seconds=0.1), key(steps[2]): run(seconds=middle)}
    assert [case.setting.options["step"] for case in ladder.finest(steps, records)] == chosen


@pytest.mark.parametrize(("rhs", "count"), [(97.0, 1), (97.1, 0)])
def test_a_coarser_setting_of_just_the_work_that_is_less(rhs, count):
    """0.97 of 100 right-hand sides."""
    steps = family(0.4, 0.2)
    cheap, dear = ({"cost": {"seconds": 1.0, "rhs": n}} for n in (rhs, 100.0))
    records = {key(steps[0]): run(ERROR_LEVELS[0], **cheap), key(steps[1]): run(1e-9, **dear)}
    assert len(ladder.beyond(steps, records)) == count


def test_families_are_grouped_by_scene_engine_and_name():
    cases = [
        Case(SCENE.with_(name=name), TIMES, engine, Setting(of, {"k": k}))
        for k in (0, 1)
        for name, engine, of in (("s", "e", "f"), ("t", "e", "f"), ("s", "x", "f"), ("s", "e", "g"))
    ]
    assert ladder.families(cases) == [[cases[k], cases[k + 4]] for k in range(4)]


# --- settings between others --------------------------------------------------------------------------------
def setting(**options: Any) -> Setting:
    return Setting("f", options)


@pytest.mark.parametrize(
    ("first", "second", "wanted"),
    [
        (setting(step=0.4), setting(step=0.1), setting(step=0.2)),
        (setting(step=0.4, n=3), setting(step=0.1, n=3), setting(step=0.2, n=3)),
        (setting(step=0.4), setting(step=0.0), None),
        (setting(step=-0.4), setting(step=-0.1), None),
        (setting(step=0.4), setting(), None),
        (setting(step=0.3), setting(step=0.1), setting(step=0.173)),
        (setting(step=0.1005), setting(step=0.1), None),
        (setting(step=0.2), setting(step=0.2), None),
    ],
)
def test_the_setting_half_way(first, second, wanted):
    assert between.between(first, second) == wanted


@pytest.mark.parametrize(
    ("coarsest", "finer", "wanted"),
    [
        (setting(step=0.2), setting(step=0.1), setting(step=0.4)),
        (setting(step=0.6), setting(step=0.1), setting(step=1.0)),
        (setting(step=1.0), setting(step=0.5), None),
        (setting(step=1.5), setting(step=0.5), None),
        (setting(rtol=0.1), setting(rtol=0.01), setting(rtol=0.5)),
        (setting(rtol=1e-3), setting(rtol=1e-4), setting(rtol=1e-2)),
        (setting(rtol=0.5), setting(rtol=0.05), None),
        (setting(step=0.2, rtol=0.25), setting(step=0.1, rtol=0.0625), setting(step=0.283, rtol=0.5)),
        (setting(step=0.2, beta=1.0), setting(step=0.1, beta=2.0), setting(step=0.4, beta=0.5)),
        (setting(step=0.1), setting(step=0.1), None),
        (setting(step=0.4), setting(step=0.0), None),
        (setting(beta=1.0), setting(beta=2.0), None),
        (setting(step=0.2, law="a"), setting(step=0.1, law="b"), None),
    ],
)
def test_the_next_coarser_setting(coarsest, finer, wanted):
    """At most a step of 1 s and a tolerance of 0.5; all options by the same share of their ratios."""
    assert coarser(coarsest, finer, 1.0) == wanted


def test_steps_that_fit():
    """Kept where the step is the longest; a first setting with the longest step replaces longer ones."""
    steps = [setting(step=h) for h in (0.8, 0.4, 0.2)]
    for longest, wanted in (
        (1.0, [0.8, 0.4, 0.2]),
        (0.8, [0.8, 0.4, 0.2]),
        (0.5, [0.5, 0.4, 0.2]),
        (0.4, [0.4, 0.2]),
        (0.2, [0.2]),
        (0.1, [0.1]),
    ):
        assert [s.options["step"] for s in within(steps, longest)] == wanted


@pytest.mark.parametrize(
    ("cost", "wanted"),
    [
        ({"rhs": 7, "steps": 3, "seconds": 2.0}, 7.0),
        ({"rhs": 0, "steps": 3, "seconds": 2.0}, 3.0),
        ({"steps": 0, "seconds": 2.0}, 2.0),
        ({"seconds": 2.0}, 2.0),
    ],
)
def test_work_of_a_run(cost, wanted):
    assert work({"cost": cost}) == wanted


# --- search for settings ------------------------------------------------------------------------------------
class Search(tuning._Search):
    """A search on paper: errors and work by step."""

    def __init__(
        self, steps: tuple[float, ...], error: Any, rhs: Any = lambda h: 1 / h, ends: Any = None
    ) -> None:
        self.asked: list[float] = []

        def run_one(cases: list[Case]) -> list[dict[str, Any]]:
            [case] = cases
            h = case.setting.options["step"]
            self.asked.append(h)
            outcome = (ends or (lambda h: "COMPLETED"))(h)
            return [run(error(h), 1 / h, outcome=outcome, cost={"seconds": 1 / h, "rhs": rhs(h)})]

        settings = [case._replace(times=np.array([0.0, 1e9])) for case in family(*steps)]
        [first] = run_one(settings[:1])
        super().__init__(settings, first, 1.0, run_one, record_view.error)


def test_an_error_at_the_level_is_reached():
    assert (
        Search((4.0,), lambda h: 1.0).least() == 0.25 and Search((4.0,), lambda h: 1.01).least() == math.inf
    )
    failed = Search((4.0,), lambda h: 0.5, ends=lambda h: "CRASHED")
    assert (
        failed.cheapest() == [] and failed.cost() == math.inf and Search((4.0,), lambda h: 9.0).cost() == 0.25
    )


def test_eight_coarser_settings_are_tried():
    search = Search((1.0, 0.5), lambda h: 0.5)
    search.carry_out(math.inf)
    assert search.asked == [2.0**k for k in range(9)] and search.cheapest()[0][1]["cost"]["rhs"] == 2.0**-8


@pytest.mark.parametrize(("rhs", "tried"), [(0.97, [1.0, 2.0, 4.0]), (0.98, [1.0, 2.0])])
def test_coarser_settings_without_less_work_end_the_search(rhs, tried):
    """The first of them needs a share of the work; the second needs more work."""
    search = Search((1.0, 0.5), lambda h: 0.5, lambda h: {1.0: 1.0, 2.0: rhs}.get(h, 2.0))
    search.carry_out(math.inf)
    assert search.asked == tried


def test_one_setting_has_no_coarser_one():
    search = Search((1.0,), lambda h: 0.5)
    search.carry_out(math.inf)
    assert search.asked == [1.0]


def test_six_bisections_between_a_miss_and_a_success():
    """A step of 1 misses and 1e-9 reaches; the work differs much, so that only the count ends the search."""
    search = Search((1.0, 1e-9), lambda h: 0.5 if h < 2e-9 else 2.0)
    search.carry_out(math.inf)
    assert len(search.asked) == 2 + 6 and search.asked[2] == pytest.approx(1e-9**0.5, rel=1e-2)


@pytest.mark.parametrize(("rhs", "count"), [(1.12, 2), (1.13, 3)])
def test_settings_whose_work_is_near_are_not_bisected(rhs, count):
    search = Search(
        (1.0, 0.5), lambda h: 2.0 if h == 1.0 else 0.5, lambda h: {1.0: 1.0, 0.5: rhs}.get(h, 1.0)
    )
    search.carry_out(math.inf)
    assert len(search.asked) == count


def test_a_miss_that_did_not_complete_is_bisected_whatever_its_work():
    ends = {1.0: "CRASHED"}
    search = Search((1.0, 0.5), lambda h: 0.5, lambda h: 1.0, lambda h: ends.get(h, "COMPLETED"))
    search.carry_out(math.inf)
    assert len(search.asked) == 2 + 6


@pytest.mark.parametrize(("limit", "asked"), [(2.01, 3), (2.0, 2), (1.0, 2), (0.99, 2), (0.5, 1), (0.51, 2)])
def test_families_are_given_up_at_twice_the_cost_of_the_cheapest(limit, asked):
    """Runs of 1, 4 and 16 s miss: the first ends the search at a limit of 0.5 s, the second at 2 s."""
    search = Search((1.0, 0.25, 0.0625), lambda h: 2.0)
    search.carry_out(limit)
    assert len(search.asked) == asked


def test_texts_of_criteria():
    assert tuning.by_error(1e-5).name == "an error of 1e-05" and tuning.by_error(1e-5).level == 1e-5
    hinged = SCENE.with_(
        joint=(Revolute(name="A", bodies=("ground", "b"), anchor=(4.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0)),)
    )
    wanted = tuning.by_closure(2e-3, hinged)
    assert (wanted.name, wanted.level) == ("a closure gap of 2 mm", 2e-3)
    assert wanted.text({"metrics": {"violation_position": 1e-3}}) == "4 mm"
    assert tuning.known_error(run(1e-9, metrics={"error": 1e-9, "error_bound": 1e-7})) == 1e-7


# --- differences of records ---------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("old", "new", "ratio", "noise", "wanted"),
    [
        (1.0, 2.0, 2.0, 0.0, False),
        (1.0, 2.01, 2.0, 0.0, True),
        (2.01, 1.0, 2.0, 0.0, True),
        (0.5, 2.0, 2.0, 1.0, False),
        (0.5, 2.1, 2.0, 1.0, True),
        (1.0, math.inf, 2.0, 0.0, True),
        (math.nan, 1.0, 2.0, 0.0, True),
        (math.inf, math.nan, 2.0, 0.0, False),
    ],
)
def test_numbers_that_change(old, new, ratio, noise, wanted):
    assert difference._is_changed(old, new, ratio, noise) is wanted


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [(1.0, 0.91, False), (1.0, 0.89, True), (0.0, 0.002, False), (0.0, 0.0021, True), (0.0, -0.0021, True)],
)
def test_ends_that_change(old, new, says):
    """By a tenth, or by a thousandth of the time that was asked for, 2 s."""
    asked = {"asked": {"end": 2.0}, "outcome": "STEP_FAILED"}
    found = list(difference._sentences(run(t_end=old, **asked), run(t_end=new, **asked)))
    assert bool(found) is says and all(text.startswith("end ") for text in found)


def test_times_of_the_same_machine_are_compared():
    old, new = run(seconds=1.0), run(seconds=9.0)
    assert list(difference._sentences(old, new)) == ["time 1.00e+00 s → 9.00e+00 s"]
    assert list(difference._sentences(old, {**new, "machine": {"cpu": "b"}})) == []
    failed = [{**r, "outcome": "STEP_FAILED"} for r in (old, new)]
    assert list(difference._sentences(*failed)) == []


def test_measures_that_one_run_lacks_are_not_compared():
    both, none = {"energy_error": 1e-5}, {"energy_error": None}
    assert list(difference._measures(both, {"energy_error": 1e-3})) == ["energy 1.00e-05 → 1.00e-03"]
    assert list(difference._measures(both, none)) == list(difference._measures(none, both)) == []
    assert list(difference._measures({}, both)) == []


def test_the_request_of_a_run():
    asked = {"engine": "m:E", "options": {"step": 0.5}, "times": [0.0, 1.0], "end": 1.0}
    found = difference.identity(run(asked=asked))
    assert found == ("s", "m:E", "f", '{"step": 0.5}', '{"times": [0.0, 1.0], "end": 1.0}')


# --- views of a record --------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("error", "bound", "more", "says"),
    [
        (1e-9, 1e-9, {}, "1.00e-09"),
        (0.99e-9, 1e-9, {}, "< 1e-09"),
        (None, 1e-9, {}, "–"),
        (math.nan, None, {}, "–"),
        (0.5, None, {"outcome": "CRASHED", "t_end": 0.0}, "–"),
        (0.5, None, {"outcome": "CRASHED", "t_end": 0.1}, "5.00e-01"),
        (0.5, None, {"t_end": 0.0}, "5.00e-01"),
    ],
)
def test_texts_of_errors(error, bound, more, says):
    assert record_view.error_text(run(metrics={"error": error, "error_bound": bound}, **more)) == says


@pytest.mark.parametrize(
    ("error", "until", "more", "wanted"),
    [
        (1e-3, 1.0, {}, True),
        (1e-3, 0.99, {}, False),
        (None, 1.0, {}, False),
        (None, 0.0, {"times": []}, True),
        (None, 0.0, {"outcome": "CRASHED", "t_end": 0.0}, True),
        (None, 0.0, {"outcome": "CRASHED", "t_end": 0.1}, False),
    ],
)
def test_errors_that_cover_the_run(error, until, more, wanted):
    assert record_view.is_judged(run(metrics={"error": error, "error_until": until}, **more)) is wanted


@pytest.mark.parametrize(
    ("outcome", "t_end", "says"),
    [
        ("COMPLETED", 0.5, "completed"),
        ("TIMED_OUT", 0.5, "timed out"),
        ("CRASHED", 0.5, "crashed"),
        ("STEP_FAILED", 0.12345, "step failed at 0.1235 s"),
        ("STEP_FAILED", -1.0, "step failed at 0 s"),
    ],
)
def test_ends_of_runs_in_words(outcome, t_end, says):
    assert record_view.ended(run(outcome=outcome, t_end=t_end)) == says


def test_settings_that_vary():
    alone = run(settings={"step": 0.1, "own": 1}, asked={"options": {"step": 0.1, "file": "/x", "n": 3}})
    assert record_view.varied_settings(alone, [alone]) == "step=0.1, n=3"
    first, second = (run(settings={"step": h, "rtol": 1e-6, "law": "soft"}) for h in (0.1, 0.05))
    other = run(settings={"law": "hard"}, engine="x")
    assert record_view.varied_settings(first, [first, second, other]) == "step=0.1"
    without = run(settings={})
    assert record_view.varied_settings(first, [first, without]) == "", "a setting that others lack"


def test_records_of_present_scenes(monkeypatch):
    monkeypatch.setattr(record_view, "mechanism", lambda scene: f"m of {scene.name}")
    records = [run(mechanism="m of s"), run(mechanism="old"), run(mechanism=None), run(), run(scene="gone")]
    assert record_view.of_scenes(records, [SCENE]) == [records[0], records[2], records[3]]


# --- records of a grid --------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("outcome", "limit", "is_kept"),
    [("TIMED_OUT", 4.9, False), ("TIMED_OUT", 5.0, True), ("TIMED_OUT", 5.1, True), ("CRASHED", 1.0, True)],
)
def test_runs_out_of_a_shorter_time_are_repeated(monkeypatch, outcome, limit, is_kept):
    [case] = family(0.1)
    monkeypatch.setattr(
        grid, "stored", lambda path: {key(case): run(outcome=outcome, time_limit=limit), "x": 0}
    )
    assert list(grid.known([case], "path")) == [key(case)] * is_kept


@pytest.mark.parametrize(
    ("times", "wanted"),
    [
        ([0.0, 0.5, 1.0], {"samples": 3}),
        ([0.0, 1.0], {"samples": 2}),
        ([0.0], {"times": [0.0]}),
        ([0.0, 0.6, 1.0], {"times": [0.0, 0.6, 1.0]}),
        ([0.0, 0.5], {"times": [0.0, 0.5]}),
    ],
)
def test_samples_that_are_asked_for(times, wanted):
    [case] = family(0.1)
    found = grid._asked(case._replace(times=np.array(times)))
    assert found == {"engine": "e", "options": {"step": 0.1}, "end": 1.0, **wanted}


def test_default_cases_of_a_scene(monkeypatch):
    offers = {"e": (Setting("f", {"k": 1}), Setting("g", {"k": 2})), "none": Cannot(Owner.ENGINE, "no loop")}
    monkeypatch.setattr(grid, "offer", lambda name, scene: offers[name])
    cases, [unable] = grid.default_cases(SCENE, ["none", "e"])
    assert (unable.engine, unable.cannot, unable.scene.name) == ("none", offers["none"], "s")
    assert [case.setting for case in cases] == list(offers["e"]) and {case.engine for case in cases} == {"e"}
    assert cases[0].times.tolist() == np.linspace(0.0, 1.0, 101).tolist() and cases[0].time_limit == 60.0
    [case], _ = grid.default_cases(SCENE, ["e"], ["g"], TIMES, 7.0)
    assert case.setting.family == "g" and case.times is TIMES and case.time_limit == 7.0


def test_fields_of_a_record(monkeypatch):
    [case] = family(0.1)
    made = SimpleNamespace(to_record=lambda: {"engine": "long name", "t_end": 1.0})
    monkeypatch.setattr(
        grid.metrics,
        "measure",
        lambda scene, run, truth: {"truth": truth} if scene is SCENE and run is made else {},
    )
    monkeypatch.setattr(grid, "_truth", lambda scene, seconds: (scene.name, seconds))
    monkeypatch.setattr(grid, "made_by", lambda: {"date": "today"})
    monkeypatch.setattr(grid, "shown_name", lambda name: f"shown {name}")
    monkeypatch.setattr(grid, "mechanism", lambda scene: "m")
    assert grid.record_of(case._replace(reference_time=3.0), made) == {
        "schema": 1,
        "key": key(case),
        "scene": "s",
        "mechanism": "m",
        "engine": "shown e",
        "t_end": 1.0,
        "family": "f",
        "asked": grid._asked(case),
        "time_limit": 5.0,
        "metrics": {"truth": ("s", 3.0)},
        "seed": 0,
        "date": "today",
    }


def test_the_key_of_a_run():
    """Scene, times, engine and setting count; limits do not."""
    [case] = family(0.1)
    same = case._replace(time_limit=9.0, reference_time=0.0)
    others = [
        case._replace(scene=SCENE.with_(duration=2.0)),
        case._replace(times=np.array([0.0, 0.5])),
        case._replace(engine="x"),
        case._replace(setting=Setting("g", {"step": 0.1})),
        case._replace(setting=Setting("f", {"step": 0.2})),
    ]
    assert key(same) == key(case) and len({key(case), *map(key, others)}) == 6


def test_progress_of_a_study(tmp_path):
    """Two of three cases are new; equal cases count once."""
    first, second = family(0.1, 0.2)
    seen: list[Any] = []

    class Here:
        def submit(self, function: Any, case: Case) -> Any:
            done = chains.Future()
            done.set_result(function(case))
            return done

    found = grid.study(
        [first, second, first],
        Here(),
        tmp_path / "r.jsonl",
        lambda *of: seen.append(of[:2]),
        lambda case: {"key": key(case), "h": case.setting.options["step"]},
    )
    assert [record["h"] for record in found] == [0.1, 0.2, 0.1] and seen == [(1, 2), (2, 2)]
    assert len((tmp_path / "r.jsonl").read_text().splitlines()) == 2


# --- settings of engines ------------------------------------------------------------------------------------
def test_settings_of_a_file_come_first(monkeypatch):
    monkeypatch.setattr(scouting, "_of_files", {})
    monkeypatch.setattr(scouting, "_found", {})
    own, other = (OriginalRun(name, "as in file", {"file": "x"}) for name in ("e", "x"))
    offers = {
        "e": (Setting("f", {"k": 1}),),
        "x": Cannot(Owner.ENGINE, "no loop"),
        "y": Cannot(Owner.ENGINE, "no"),
    }
    monkeypatch.setattr(scouting, "_offered", lambda name, scene: offers[name])
    assert scouting.of_file("e", SCENE) == () and scouting.unasked(["e", "x"], [SCENE]) == 2
    scouting.remember(SCENE.with_(duration=9.0), [own, other])
    wanted = Setting("as in file", {"file": "x"})
    assert scouting.of_file("e", SCENE) == (wanted,), "of any duration"
    assert scouting.offer("e", SCENE) == (wanted, Setting("f", {"k": 1}))
    assert scouting.offer("x", SCENE) == (wanted,) == scouting.settings("x", SCENE), (
        "of an engine that refuses"
    )
    assert scouting.offer("y", SCENE) == offers["y"] and scouting.settings("y", SCENE) == ()
    assert scouting.unasked(["e", "x", "y", "z"], [SCENE]) == 1


def test_short_runs_that_compare_mechanisms(monkeypatch):
    """The finest setting of an engine's best family, without compiled ones where others exist."""
    offered = {
        "a": [Setting("f", {"k": 1}), Setting("f", {"k": 2}), Setting("f, compiled", {"k": 9})],
        "b": [Setting("f, compiled", {"k": 3})],
        "none": [],
    }
    monkeypatch.setattr(fair_timing, "settings", lambda name, scene: offered[name])
    monkeypatch.setattr(fair_timing, "best_family", lambda settings: settings)
    monkeypatch.setattr(fair_timing, "gate_times", lambda scene: TIMES)
    cases = fair_timing.identity_cases(SCENE, ["a", "b", "none"], 7.0)
    assert [(c.engine, c.setting.options["k"], c.time_limit) for c in cases] == [("a", 2, 7.0), ("b", 3, 7.0)]
    assert all(c.times is TIMES and c.scene is SCENE for c in cases)


def test_the_truth_that_mechanisms_are_compared_with(monkeypatch):
    """With the time that a reference may take; without records nothing is compared."""
    asked: list[Any] = []
    monkeypatch.setattr(fair_timing, "truth_for", lambda *of: asked.append(of))
    assert fair_timing.model_differences(SCENE, [], 7.0) == {}
    assert fair_timing.model_difference(SCENE, [], 8.0) is None
    assert fair_timing.model_differences(SCENE, []) == {} == fair_timing.model_differences(SCENE, [], 7.0, [])
    assert asked == [(SCENE, 7.0), (SCENE, 8.0), (SCENE, fair_timing.SECONDS), (SCENE, 7.0)]


# --- origins, truths, words ---------------------------------------------------------------------------------
def test_origin_of_a_record(monkeypatch):
    monkeypatch.setattr(origin, "commit", lambda: "c")
    found = origin.made_by()
    assert list(found) == ["versions", "commit", "date", "machine"] and found["date"].endswith("+00:00")
    assert len(found["date"]) == len("2000-01-01T00:00:00+00:00"), "to the second"
    assert list(found["versions"]) == ["python", "mbref", "numpy", "scipy", "numba"]
    assert found["versions"]["numpy"] == np.__version__ and origin._installed("no such package") is None
    assert list(found["machine"]) == ["cpu", "cores", "system"]


def test_the_name_of_a_processor(monkeypatch, tmp_path):
    listed = tmp_path / "cpuinfo"
    listed.write_text("vendor : x\nmodel name\t: First: fast \nmodel name : Second\n")
    monkeypatch.setattr(origin, "Path", lambda place: listed if place == "/proc/cpuinfo" else None)
    monkeypatch.setattr(origin.platform, "processor", lambda: "")
    monkeypatch.setattr(origin.platform, "machine", lambda: "m")
    assert origin._processor() == "First: fast"
    listed.write_text("vendor : x\n")
    assert origin._processor() == "m"


def test_the_record_of_a_truth(monkeypatch):
    """The times are the samples, the gates and 601 more; the seconds are given, or counted."""
    asked, clock = [], iter([1.0, 4.0, 1.0, 4.0])

    def known_at(scene: Scene, times: np.ndarray, seconds: float) -> dict[str, Any]:
        asked.append((times, seconds))
        return {"kind": "k"} if len(asked) == 1 else {"kind": "k", "seconds": 9.0}

    monkeypatch.setattr(truths, "known_at", known_at)
    monkeypatch.setattr(truths, "gate_times", lambda scene: np.array([0.0, 0.01234]))
    monkeypatch.setattr(truths, "mechanism", lambda scene: "m")
    monkeypatch.setattr(truths.time, "process_time", lambda: next(clock))
    times = np.array([0.0, 0.777777, 1.0])
    found = truths.truth_record(SCENE, times, 20.0)
    assert found == {
        "key": truths.key(SCENE, times),
        "scene": "s",
        "mechanism": "m",
        "given": 20.0,
        "kind": "k",
        "seconds": 3.0,
    }
    assert asked[0][1] == 20.0
    assert asked[0][0] == pytest.approx(sorted([*np.linspace(0.0, 1.0, 601), 0.01234, 0.777777]))
    assert truths.truth_record(SCENE, times, 20.0)["seconds"] == 9.0
    assert (
        len(
            {truths.key(SCENE, times), truths.key(SCENE, times[:2]), truths.key(SCENE.with_(name="t"), times)}
        )
        == 3
    )


@pytest.mark.parametrize(
    ("function", "arguments", "says"),
    [
        (wording.listed, ([],), ""),
        (wording.listed, (["a"],), "a"),
        (wording.listed, (["a", "b", "c"],), "a, b and c"),
        (wording.at_most, (1e-9, 1e-9), "1.0e-9"),
        (wording.at_most, (0.9e-9, 1e-9), "less than the truth's own bound, 1e-09"),
        (wording.at_most, (0.0, 0.0), "0"),
        (wording.at_most, (1.21e-5, 0.0), "1.3e-5"),
        (wording.runs, (1,), "1 run"),
        (wording.runs, (0,), "0 runs"),
        (wording.runs, (2,), "2 runs"),
        (wording.uncapitalised, ("All two",), "all two"),
        (wording.uncapitalised, ("Alliance",), "Alliance"),
        (wording.is_or_are, (["a"],), "is"),
        (wording.is_or_are, (["a", "b"],), "are"),
        (wording.its_or_their, (["a"],), "its"),
        (wording.its_or_their, (["a", "b"],), "their"),
        (wording.agree, (["a"],), "agrees"),
        (wording.agree, (["a", "b"],), "agree"),
        (wording.seconds, (1.0,), "1 s"),
        (wording.seconds, (0.9996,), "1 s"),
        (wording.seconds, (0.9994,), "999 ms"),
        (wording.seconds, (1e-3,), "1 ms"),
        (wording.seconds, (9.994e-4,), "999 µs"),
        (wording.multiple, (9.94,), "9.9 times"),
        (wording.multiple, (9.95,), "10 times"),
        (wording.span, (3.2, 140.2), "3.2 to 140 times"),
        (wording.span, (3.21, 3.19), "3.2 times"),
    ],
)
def test_words_at_their_limits(function, arguments, says):
    assert function(*arguments) == says


@pytest.mark.parametrize(
    ("apart", "says"),
    [
        ({}, "s: no two engines completed the motion, so nothing can be compared."),
        ({("a", "b"): 1e-3}, "The finest runs of a and b agree to 1.0e-03."),
        (
            {("a", "c"): 5e-3, ("a", "b"): 1e-3, ("b", "c"): 2e-3},
            "The finest runs of a and b agree to 1.0e-03; the nearest of them from the others: c 2.0e-03.",
        ),
    ],
)
def test_engines_that_agree_without_a_truth(apart, says):
    """An engine without a completed motion is not named."""
    group = SimpleNamespace(scene=SCENE, agreement=lambda: apart, engines=lambda: dict.fromkeys("abcd"))
    assert sentences._agreement(group) == says


SCENES_AND_SECONDS = {
    "s": {"b": 3.0, "a": 1.0, "c": 5.0},
    "t": {"a": 2.0, "c": 30.0, "b": 20.0},
    "u": {"b": 1.0, "a": 9.0},
    "v": {"a": 1.0},
}


@pytest.mark.parametrize(
    ("scenes", "count", "aided", "says"),
    [
        (
            "stuv",
            4,
            {("a", "s"), ("a", "t")},
            "a is the fastest to an error of 1e-6 on 3 of 4 scenes; the best other engine takes 3.0 to 10 "
            "times as long. On all other scenes the fastest is b on u.",
        ),
        (
            "stv",
            3,
            {("a", "s"), ("a", "t"), ("a", "v")},
            "a, integrated by crosscheck, is the fastest to an error of 1e-6 on all 3 scenes; the best other "
            "engine takes 3.0 to 10 times as long.",
        ),
        (
            "uv",
            2,
            (),
            "b is the fastest to an error of 1e-6 on 1 of 2 scenes; the best other engine takes 9.0 times "
            "as long. On all other scenes the fastest is a on v.",
        ),
        (
            "v",
            2,
            (),
            "a is the fastest to an error of 1e-6 on v, the only scene on which an engine reaches it.",
        ),
        (
            "tv",
            3,
            (),
            "a is the fastest to an error of 1e-6 on both scenes on which an engine reaches it; the best "
            "other engine takes 10 times as long.",
        ),
        (
            "uv",
            3,
            (),
            "b is the fastest to an error of 1e-6 on 1 of the 2 scenes on which an engine reaches it; the "
            "best other engine takes 9.0 times as long. On all other scenes the fastest is a on v.",
        ),
    ],
)
def test_the_fastest_on_several_scenes(scenes, count, aided, says):
    """Ratios count on the scenes of the engine that is the fastest most often, where another one reaches."""
    costs = {scene: SCENES_AND_SECONDS[scene] for scene in scenes}
    assert speed_sentences._fast_on_several(costs, aided, count) == says


@pytest.mark.parametrize(
    ("costs", "aided", "says"),
    [
        ({"a": 0.5}, (), "a reaches an error of 1e-6 in 500 ms of stepping."),
        (
            {"b": 1.5, "a": 0.5, "mujoco": 1.0},
            {"a"},
            "a, integrated by crosscheck, reaches an error of 1e-6 in 500 ms of stepping; MuJoCo takes 2.0 "
            "times as long and b takes 3.0 times as long.",
        ),
    ],
)
def test_the_fastest_on_one_scene(costs, aided, says):
    assert speed_sentences._fast_on_one(costs, aided) == says


# --- progress -----------------------------------------------------------------------------------------------
def test_running_work_is_named_after_twenty_quiet_seconds(monkeypatch):
    """Looks are half a second apart, and a line follows 20 s after the last one, if something runs."""
    clock, looks, lines = [100.0], [], []
    console = SimpleNamespace(print=lambda line, **options: lines.append((line, options)))
    monkeypatch.setattr(progress.time, "monotonic", lambda: clock[0])
    working = ["a"]
    shown = progress._Lines("runs", 4, console, SimpleNamespace(__str__=None))
    shown._under_way = type("Work", (), {"__str__": lambda self: working[0]})()

    class Over:
        def wait(self, seconds: float) -> bool:
            looks.append(seconds)
            clock[0] += 10.0
            if len(looks) == 4:
                working[0] = ""
            return len(looks) > 7

    shown._over = Over()
    shown._name_work()
    assert set(looks) == {0.5}
    options = {"markup": False, "highlight": False, "soft_wrap": True}
    assert lines == [("runs: 0 of 4, 20 s; now a", options)]
    shown(2, 4, "last")
    assert lines[1][0] == "runs: 2 of 4, 80 s, about 80 s left; last" and shown._watch.daemon


def test_columns_of_a_bar():
    columns = progress._columns(progress.UnderWay())
    names = ["TextColumn", "BarColumn", "MofNCompleteColumn", "TimeElapsedColumn", "TextColumn"]
    assert [type(column).__name__ for column in columns] == [*names, "TimeRemainingColumn", "_Working"]
    assert (columns[0].text_format, columns[4].text_format) == ("{task.description}", "left")


def test_the_watch_ends_with_the_progress():
    calls: list[str] = []
    lines = progress._Lines("runs", 4, None, progress.UnderWay())
    lines._over = SimpleNamespace(set=lambda: calls.append("over"))
    lines._watch = SimpleNamespace(start=lambda: calls.append("start"), join=lambda: calls.append("join"))
    with lines as entered:
        calls.append("work")
    assert entered is lines and calls == ["start", "work", "over", "join"]


# --- runs of cases ------------------------------------------------------------------------------------------
def test_runs_of_a_case(monkeypatch):
    """Engine, scene, times, setting and limit in this order; a record is made of the case and its run."""
    [case] = family(0.1)
    given = ("e", SCENE, TIMES, case.setting)
    asked: list[Any] = []

    bodies = {"b": {"position": [[1.0, 0.0, 0.0]], "orientation": [[1.0, 0.0, 0.0, 0.0]]}}

    def run_by(name: str) -> Any:
        return lambda *of: asked.append((name, *of)) or SimpleNamespace(outcome=None)

    for module in (pictures, hurried, grid):
        monkeypatch.setattr(module, "run_estimated", run_by("estimated"))
        monkeypatch.setattr(module, "record_of", lambda *of: {"bodies": bodies, "of": of})
    monkeypatch.setattr(grid, "run_once", run_by("once"))
    pictures._run(case)
    assert hurried.Hurried()(case)["of"][0] is case
    assert grid.run_case(case)["of"][0] is case and grid.run_here(case)["of"][0] is case
    assert asked == [("estimated", *given, 5.0)] * 3 + [("once", *given)]
    assert pictures._pictured(case, "run")["of"] == (case, "run")


def test_a_run_out_of_time_is_not_followed(monkeypatch):
    """The record of a finer setting names engine, scene and setting."""
    coarse, fine = family(0.2, 0.1)
    late = SimpleNamespace(outcome=hurried.Outcome.TIMED_OUT)
    monkeypatch.setattr(hurried, "run_estimated", lambda *of: late)
    monkeypatch.setattr(hurried, "failed", lambda *of: of)
    made = hurried.Hurried()
    assert made.trajectory(coarse) is late
    wanted = ("e", "", SCENE, fine.setting, hurried.Outcome.TIMED_OUT, hurried.NOT_STARTED)
    assert made.trajectory(fine) == wanted


def test_the_truth_of_a_scene_is_found_once(monkeypatch):
    asked: list[Any] = []
    monkeypatch.setattr(grid, "truth_for", lambda *of: asked.append(of) or "truth")
    other = SCENE.with_(name="a scene of this test")
    assert grid._truth(other, 3.5) == grid._truth(other, 3.5) == "truth" and asked == [(other, 3.5)]


# --- questions and their arguments --------------------------------------------------------------------------
def test_settings_that_are_asked_in_a_child(monkeypatch):
    """The answer, a refusal, or a failure, which counts as one."""
    refusal, asked = Cannot(Owner.ENGINE, "no loop"), []
    answers: dict[str, Any] = {"able": (None, ["a", "b"]), "unable": (refusal, [])}

    def capabilities(name: str, scene: Scene, seconds: float) -> Any:
        asked.append((name, scene, seconds))
        if name not in answers:
            raise scouting.ChildFailed(grid.Outcome.CRASHED, "lost")
        return ("1", *answers[name])

    monkeypatch.setattr(scouting, "capabilities", capabilities)
    assert scouting._asked(("able", SCENE)) == ("a", "b") and scouting._asked(("unable", SCENE)) == refusal
    assert scouting._asked(("gone", SCENE)) == Cannot(Owner.ADAPTER, "its settings are unknown: lost")
    assert asked == [(name, SCENE, scouting.READY_SECONDS) for name in ("able", "unable", "gone")]


def test_settings_that_are_asked_here(monkeypatch):
    refusal = Cannot(Owner.ENGINE, "no loop")
    answers = {"able": None, "unable": refusal}
    monkeypatch.setattr(
        scouting,
        "engine",
        lambda name: SimpleNamespace(cannot=lambda scene: answers[name], settings=lambda scene: [scene.name]),
    )
    assert scouting._offered("able", SCENE) == ("s",) and scouting._offered("unable", SCENE) == refusal
    assert scouting.shown_name("m") == "m" and scouting.shown_name("m:gone") == "m:gone"


def test_the_finest_settings_are_asked_for_the_scene(monkeypatch):
    asked: list[Any] = []
    monkeypatch.setattr(
        least_errors, "default_cases", lambda *of, **more: asked.append((of, more)) or (family(0.1), [])
    )
    assert least_errors.candidates(SCENE, ["e"]) == family(0.1)
    assert asked == [((SCENE, ["e"]), {"time_limit": 240.0})]


def test_a_reference_is_asked_for_the_scene_at_the_times(monkeypatch):
    asked: list[Any] = []

    def reference(*of: Any) -> Any:
        asked.append(of)
        return truths.NoReference("none", 0.0, SimpleNamespace(times=np.zeros(0)))

    monkeypatch.setattr(truths, "reference", reference)
    assert truths._of_reference(SCENE, TIMES, 7.0)["reason"] == "none"
    assert asked == [(SCENE, [0.0, 1.0], 7.0)]


def test_a_record_as_a_trajectory_of_its_scene():
    place = np.zeros((2, 1, 3))
    turn = np.tile([1.0, 0.0, 0.0, 0.0], (2, 1, 1))
    made = Trajectory("s", "e", "1", "m", {}, TIMES, ("b",), place, turn, place, place)
    found = fair_timing._motion(SCENE, made.to_record())
    assert found.scene == "s" and found.times.tolist() == [0.0, 1.0]


def test_keys_do_not_depend_on_the_order_of_fields():
    def ordered(*names: str) -> Any:
        return SimpleNamespace(to_dict=lambda: {name: len(name) for name in names})

    one, other = ordered("aa", "b"), ordered("b", "aa")
    assert truths.key(one, TIMES) == truths.key(other, TIMES) != truths.key(ordered("aa", "c"), TIMES)
    cases = [Case(scene, TIMES, "e", Setting("f", {"k": 1})) for scene in (one, other)]
    assert key(cases[0]) == key(cases[1])


@pytest.mark.parametrize("count", [1, 2, 90, 91, 92, 135, 136, 500, 601])
def test_frames_are_other_samples(count):
    """At most 91, in their order, with the first and the last one, where nothing turns."""
    exact = SimpleNamespace(times=np.linspace(0.0, 1.0, count), angular_velocity=np.zeros((count, 1, 3)))
    chosen = truths.shown(exact)
    assert len(chosen) == min(91, count) and chosen[0] == 0 and chosen[-1] == count - 1
    assert np.diff(chosen).min(initial=1) >= 1


def test_ends_of_runs_without_an_asked_end():
    runs = [run(t_end=t, asked={}, outcome="STEP_FAILED") for t in (0.0, 5e-4)]
    assert [text.partition(" ")[0] for text in difference._sentences(*runs)] == ["end"]


def test_the_name_of_an_outsiders_engine(monkeypatch):
    monkeypatch.setattr(scouting, "engine", lambda name: SimpleNamespace(name=f"own name of {name}"))
    assert scouting.shown_name("m:E") == "own name of m:E" and scouting.shown_name("m") == "m"


def test_one_thread_measures_beside_the_runs(monkeypatch):
    monkeypatch.setattr(chains.os, "cpu_count", lambda: 3)
    with chains.Chains(lambda case, run: {}) as threads:
        assert (threads._max_workers, threads._measuring._max_workers) == (3, 1)
