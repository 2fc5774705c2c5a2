"""Verdicts on records of known errors and times: grades and sentences, and changes between two sets."""

import io
import re
from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from crosscheck.cli import differences, tables
from crosscheck.cli.terminal_plot import scatter
from crosscheck.study.difference import load
from crosscheck.study.grades import Grade, Judged, grade, judged
from crosscheck.study.truths import truth_record
from crosscheck.study.words.speed import fast
from crosscheck.study.words.truth import truth
from crosscheck.study.words.verdict import breaks, headline, right, verdict
from mbref.motions.trajectory import Cost
from mbref.records import append
from mbref.scenes import SCENES
from reports.runs import Run
from tests.helpers.falling_engine import STONE
from tests.reports import synthetic

REDUNDANT, SOUND = SCENES["planar_slider_crank"](), SCENES["spatial_slider_crank"]()
TRUTH = {"kind": "reference", "bound": 3e-14, "reason": "", "until": 1.0, "seconds": 2.4, "both": True}


def record(engine: str, family: str, error: float | None, seconds=0.1, **more: Any) -> dict[str, Any]:
    """Return the record of a completed run with its error and CPU time, with ``more`` fields or others."""
    found = {"scene": REDUNDANT.name, "engine": engine, "family": family, "version": "1", "versions": {}}
    found |= {"outcome": "COMPLETED", "message": "", "t_end": 1.0, "times": [], "time_limit": 60.0}
    found |= {"settings": {"seconds": seconds}, "cost": asdict(Cost(seconds)), "machine": {"cpu": "a"}}
    found |= {"metrics": {"error": error, "error_bound": 3e-14}, "key": f"{engine} {family} {seconds}"}
    asked = {"engine": engine, "options": {"s": seconds}, "samples": 3, "end": 1.0}
    return {**found, "asked": asked, **more}


def failed(engine: str, family: str, t_end: float = 0.0) -> dict[str, Any]:
    """Return the record of a run that is no longer finite at a time."""
    return record(engine, family, None, outcome="NOT_FINITE", t_end=t_end)


RECORDS = (
    *(record("mbref", "own", 5e-12, 0.001), record("mujoco", "tuned", 4e-9, 0.5)),
    *(record("mujoco", "defaults", 2.8), failed("pinocchio", "defaults"), failed("exudyn", "defaults")),
    *(record("pinocchio", "tuned", 6.04e-9, 0.032), record("exudyn", "tuned", 1.7e-4, 0.2)),
)


def group(records=RECORDS, scene=REDUNDANT, **known: Any) -> Judged:
    """Return records of a scene with TRUTH, of which ``known`` changes fields."""
    return Judged(scene, {"scene": scene.name, **TRUTH, **known}, records)


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (1e-8, Grade.RIGHT),
        (1.1e-8, Grade.INACCURATE),
        (1e-2, Grade.INACCURATE),
        (1.1e-2, Grade.WRONG),
        (None, Grade.UNJUDGED),
    ],
)
def test_grade_follows_from_the_error_of_a_completed_run(error, expected):
    """Right up to 1e-8 of the length, wrong above 1e-2; unjudged without an error, failed if incomplete."""
    assert grade(record("a", "b", error)) is expected
    assert grade(record("a", "b", error, outcome="TIMED_OUT")) is Grade.FAILED


@pytest.mark.parametrize(("drop", "bound", "is_said"), [(0.0, 0.0, 1), (1e-7, 0.0, 0), (1e-7, 1e-6, 1)])
def test_verdict_says_where_standing_still_is_right(drop, bound, is_said):
    """A stone of 1 m falls by ``drop`` (m). A run in which it stands still is right if this is at most 1e-8
    of its length, the limit of a right run, or the bound of the truth's error."""
    stone = STONE.with_(gravity=(0.0, 0.0, -2.0 * drop), duration=1.0)
    known = truth_record(stone, np.array([0.0, 1.0]), 0.0)
    known["bound"] = max(bound, known["bound"])
    own = Judged(stone, known, [record("a", "b", 0.0, scene=stone.name)])
    assert ("moves nothing" in verdict([own]).headline) == is_said


@pytest.mark.parametrize(("error", "expected"), [(9e-7, Grade.RIGHT), (2e-6, Grade.INACCURATE)])
def test_a_run_that_agrees_with_the_truth_to_its_bound_is_not_inaccurate(error, expected):
    """A reference known to 1e-6 cannot tell an engine with an error of 9e-7 from an exact one."""
    own = record("mbref", "own", error, metrics={"error": error, "error_bound": 1e-6})
    assert grade(own) is expected
    assert ("inaccurate" in right([group([own], bound=1e-6)])) is (expected is Grade.INACCURATE)


# parts of SITUATIONS, whose names say what the records are for
TUNED, COMPILED = "tuned", "newton, compiled"  # families: an engine's own integrator, and crosscheck's
UNKNOWN = {"kind": "", "bound": None, "until": 0.0, "reason": "it starts in a singular position"}
CUT = {"kind": "reference", "reason": "singular", "until": 0.3, "both": False}
OTHER_MECHANISM = {"mujoco": "change of velocity: truth and mujoco differ by 0.317 (allowed 1e-04)"}
OWN = record("mbref", "own", 1e-9, 0.004)
BEST = [record(name, TUNED, 1e-10) for name in ("mbref", "mujoco")]
STILL = [record(name, TUNED, None, times=[0.0], scene=SOUND.name) for name in ("mbref", "exudyn")]
LATE = [record("mujoco", f, None, outcome="TIMED_OUT", t_end=0.0) for f in (TUNED, "defaults")]
EACH = [record(name, f, 1e-10) for name in ("mujoco", "exudyn") for f in ("defaults", TUNED)]
BOTH = [record("mujoco", COMPILED, 1e-9, 0.002), record("mujoco", TUNED, 1e-7, 0.05)]
ROUGH = [BOTH[0], record("mujoco", TUNED, 1e-3, 0.05)]
ENDED = record("exudyn", "defaults", 0.0, outcome="SINGULAR_MATRIX", t_end=0.0)
SLOW = record("sundials", "ggl", None, 0.2, outcome="TIMED_OUT", t_end=0.0, time_limit=5.0)


def of_two_scenes(here: Sequence[dict[str, Any]], there: Sequence[dict[str, Any]]) -> list[Judged]:
    truths = [{"scene": scene.name, **TRUTH} for scene in (REDUNDANT, SOUND)]
    return judged([REDUNDANT, SOUND], truths, [*here, *({**r, "scene": SOUND.name} for r in there)])


SITUATIONS = {
    "most engines are right": [group()],
    "runs without a result": [group([OWN, *LATE])],
    "no engine completes a known motion": [group([LATE[1], failed("exudyn", TUNED, 0.25)])],
    "no engine completes an unknown motion": [group([ENDED], **UNKNOWN)],
    "the truth ends early": [group(**CUT)],
    "the truth ends early and every run is wrong": [group([record("mbref", "own", 1.0)], **CUT)],
    "own integrator beside crosscheck's": [group([*BOTH, OWN])],
    "own integrator too rough": [group(ROUGH)],
    "two own integrators too rough": [group([*ROUGH, record("mujoco", "stock", 1e-2, 0.01)])],
    "compiled runs alone": [group([record("mujoco", "forward, compiled", 1e-9)])],
    "another mechanism": [replace(group(), differences=OTHER_MECHANISM)],
    "another mechanism alone": [replace(group(BEST[1:]), differences=OTHER_MECHANISM)],
    "another mechanism on one of two scenes": [
        replace(group(), differences=OTHER_MECHANISM),
        group([{**OWN, "scene": SOUND.name}], SOUND),
    ],
    "defaults of one engine are wrong": [group([*BEST, record("mujoco", "defaults", 2.8)])],
    "defaults of one engine are inaccurate": [group([BEST[1], record("mujoco", "defaults", 1e-5)])],
    "defaults of one engine are right": [group([*BEST, record("mujoco", "defaults", 1e-10)])],
    "defaults of all engines are right": [group(EACH)],
    "more exact than the truth": [group([record("mbref", "own", 1e-15), failed("exudyn", TUNED, 0.25)])],
    "the best setting ran out of time": [group([record("sundials", "ggl", 2.87), SLOW])],
    "two scenes": of_two_scenes(RECORDS, [OWN, record("pinocchio", "defaults", 1e-9, 0.001)]),
    "own integrators on one of two scenes": of_two_scenes([*ROUGH, OWN], [*BOTH, OWN]),
    "one of two motions is known": [group(), group(STILL, SOUND, **UNKNOWN)],
}


@pytest.mark.parametrize("situation", SITUATIONS)
def test_verdict_says_in_each_situation_who_is_right_how_fast_and_where_runs_break(situation, snapshot):
    """SITUATIONS are made-up records, whose errors and times the sentences repeat. The snapshot has the
    sentences, which were compared with the records by hand."""
    groups = SITUATIONS[situation]
    said = {"headline": headline(groups), "right": right(groups), "fast": fast(groups)}
    assert {**said, "breaks": breaks(groups), "truth": truth(groups)} == snapshot


def test_defaults_without_a_truth_are_not_judged(snapshot):
    """Two engines' defaults complete a motion whose truth is unknown, since it starts in a singular position;
    the snapshot has the sentences, which say so."""
    unjudged = [record(name, "defaults", None, times=[0.0]) for name in ("mujoco", "exudyn")]
    assert breaks([group(unjudged, **UNKNOWN)]) == snapshot


def test_runs_that_end_at_the_start_of_an_unknown_motion_are_not_judged():
    """ENDED ends at its start, where each run agrees with the scene, so that its error is zero. If no later
    time of the true motion is known, this says nothing of an engine, also beside runs without an error. If
    the motion is known, the early end does."""
    completed = [{**record(n, TUNED, None), "times": [0.0, 1.0]} for n in ("mbref", "mujoco")]
    assert not any(group([ENDED, *more], **UNKNOWN).is_judged for more in ([], completed))
    assert group([ENDED]).is_judged


def test_distance_of_two_runs_is_measured_only_at_equal_times():
    """a and b are off the truth by 1e-3 and 2e-3 of the length in one direction, so 1e-3 apart. c has the
    positions of a at other times, and is compared with neither."""
    first, second = (synthetic.record(name, "x", error, 0.1) for name, error in (("a", 1e-3), ("b", 2e-3)))
    scene, other = synthetic.scene(), {**first, "engine": "c", "times": [0.5 * t for t in first["times"]]}
    found = Judged(scene, {}, [first, second, other]).agreement()
    assert found == {("a", "b"): pytest.approx(1e-3, rel=1e-9)}, found


def test_engines_agree_by_the_finest_runs_of_the_families_that_agree_best():
    """Engine b lists its defaults, off by 1e-3 of the length, after its tuned family, which equals a's."""
    fine = [synthetic.record(name, "tuned", 1e-9, 0.1) for name in ("a", "b")]
    runs = [*fine, synthetic.record("b", "defaults", 1e-3, 0.1)]
    assert Judged(synthetic.scene(), {}, runs).agreement()["a", "b"] < 1e-15


def printed(records: Sequence[dict[str, Any]], scene=REDUNDANT, **known: Any) -> str:
    """Return what `crosscheck compare` prints on the records."""
    console, found = Console(width=200, record=True, file=io.StringIO()), [group(records, scene, **known)]
    tables.print_comparison(console, found[0], verdict(found), "my.toml", with_ratio=True)
    return console.export_text()


def test_without_a_truth_no_setting_is_called_most_accurate():
    """Two runs of a motion without a truth, of steps of 0.2 and 0.1 s, have no errors: no setting is
    recommended, and the finer run stands in the table of one run an engine."""
    runs = [synthetic.record("mbref", "own", 1e-9, 0.1, step=step) for step in (0.2, 0.1)]
    shown = printed([{**run, "metrics": {}} for run in runs], synthetic.scene(), **UNKNOWN)
    assert "least error" not in shown and "most accurate" not in shown and "crosscheck run" not in shown
    assert "a finest run of every engine" in shown
    assert "step=0.1" in shown.partition("a finest run")[2].partition("settings to use")[0]


def test_a_right_engine_that_gives_no_time_of_stepping_reaches_its_error():
    """Both engines are right; one gives no time, as an adapter that leaves out the cost. It gets no time and
    no ratio, and the other engine keeps its own."""
    runs = [record("mbref", "own", 1e-9, 0.5), record("exudyn", "own", 1e-9, 0.0)]
    shown = printed(runs)
    assert "Exudyn gives no time." in shown and "not reach" not in shown and "0.00e+00" not in shown
    assert re.search(r"mbref own .* 1\.0\n", shown)
    assert fast([group(runs[1:])]).startswith("Exudyn reaches an error of 1e-6, without a time of stepping")


def saved(folder: Path, records: list[dict]) -> Path:
    folder.mkdir()
    for one in records:
        append(folder / "records.jsonl", one)
    return folder


def test_reading_records_does_not_change_a_file_with_a_cut_line(tmp_path):
    """The last line was cut short, as by a study that is being written."""
    path = saved(tmp_path / "cut", [record("a", "x", 1e-5, 0.1)]) / "records.jsonl"
    path.write_text(path.read_text() + '{"key": "cut sho')
    before = path.read_text()
    assert len(load(path)) == 1 and path.read_text() == before


def test_runs_that_only_one_set_has_are_counted_or_listed(tmp_path):
    """Two runs of engine b are in the old set only: one line counts them, and --all (``is_all``) lists each
    under the scene's name. The run of engine a is in both sets, unchanged."""
    both, gone = record("a", "x", 1e-5, 0.1), [record("b", family, 1e-5, 0.1) for family in "pq"]
    folders = [saved(tmp_path / name, runs) for name, runs in (("old", [both, *gone]), ("new", [both]))]
    said = []
    for is_all in (False, True):
        console = Console(width=80, file=io.StringIO())
        assert differences.show(console, *map(str, folders), is_all)
        said.append(console.file.getvalue())
    assert "b: 2 runs only in the old set" in said[0] and "runs\nscene" not in said[0]
    assert said[0].count("only in the old set") == 1 and said[1].count("only in the old set") == 2
    assert "0 of 1 runs of both sets changed." in said[0]


def test_errors_below_the_truth_s_bound_are_drawn_at_the_bound():
    """The truth is known to 3e-14; the run's error is 1e-17."""
    below = record("a", "x", 1e-17, 0.1)
    assert Run(below).drawn == (3e-14, 0.1)
    drawn = scatter([below], {("a", "x"): "A"}).plain
    assert "1e-14" in drawn and "1e-16" not in drawn, drawn


def test_tables_of_eighty_columns_print_numbers_whole_and_no_end_time_that_is_rounding():
    """Each number of two long records stands whole in both tables, of the comparison and of the runs. A run
    that failed at its start has the end time -1e-8 s, by rounding: neither it nor a zero is printed."""
    errors = {"error": 2.71e-5, "error_bound": 1e-14, "energy_error": 2.5e-12}
    own = partial(record, "pinocchio", "defaults", None, metrics={**errors, "violation_position": 1.13e-13})
    ends = {0.0001: "COMPLETED", 7.8125e-06: "NOT_CONVERGED"}
    long = [own(7.8125e-06, settings={"accuracy": s}, outcome=end) for s, end in ends.items()]
    long.append(failed("exudyn", "alf-dual+projection, compiled"))
    console = Console(width=80, record=True, file=io.StringIO())
    long.append({**failed("exudyn", "defaults"), "t_end": -1e-08})
    tables.print_comparison(console, group(long), verdict([group(long)]), "my.toml", with_ratio=True)
    tables.print_runs(console, long)
    text = console.export_text()
    for number in ("2.71e-05", "1.13e-13", "2.50e-12", "7.81e-06", "accuracy=0.0001", "7.8125e-06"):
        assert len(re.findall(rf"{re.escape(number)}(?!\d)", text)) >= 2, (number, text)
    assert "0.00e+00" not in text and "-1e-08" not in text
