"""Verdicts and differences: records of known errors and times / grades, sentences, changes."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from crosscheck.cli import differences, tables
from crosscheck.cli.terminal_plot import scatter
from crosscheck.study.difference import load
from crosscheck.study.sentences import breaks, headline, right, verdict
from crosscheck.study.speed_sentences import ADAPTERS, CLOCK, WITHOUT_PYTHON, fast
from crosscheck.study.truth_sentences import truth
from crosscheck.study.verdict import Grade, Judged, grade, judged
from mbref.records import append
from mbref.scenes import SCENES
from reports.runs import Run
from tests.reports import synthetic

REDUNDANT, SOUND = SCENES["planar_slider_crank"](), SCENES["spatial_slider_crank"]()
TRUTH = {"kind": "reference", "bound": 3e-14, "reason": "", "until": 1.0, "seconds": 2.4, "both": True}


def record(
    engine: str, family: str, error: float | None, seconds: float = 0.1, **more: Any
) -> dict[str, Any]:
    asked = {"engine": engine, "options": {"s": seconds}, "samples": 3, "end": 1.0}
    found = {
        "scene": REDUNDANT.name,
        "engine": engine,
        "family": family,
        "settings": {"seconds": seconds},
        "outcome": "COMPLETED",
        "message": "",
        "t_end": 1.0,
        "times": [],
        "cost": {"seconds": seconds},
        "versions": {},
        "metrics": {"error": error, "error_bound": 3e-14},
        "key": f"{engine} {family} {seconds}",
        "version": "1",
        "machine": {"cpu": "a"},
        "asked": asked,
    }
    return {**found, "time_limit": 60.0, **more}


def failed(engine: str, family: str, t_end: float = 0.0) -> dict[str, Any]:
    return record(engine, family, None, outcome="NOT_FINITE", t_end=t_end)


RECORDS = (
    record("mbref", "own", 5e-12, 0.001),
    record("mujoco", "tuned", 4e-9, 0.5),
    record("mujoco", "defaults", 2.8),
    failed("pinocchio", "defaults"),
    failed("exudyn", "defaults"),
    record("pinocchio", "tuned", 6.04e-9, 0.032),
    record("exudyn", "tuned", 1.7e-4, 0.2),
)


def group(records=RECORDS, scene=REDUNDANT, **known: Any) -> Judged:
    return Judged(scene, {"scene": scene.name, **TRUTH, **known}, records)


def test_runs_without_a_result_are_not_told_as_an_end_at_0():
    late = [
        record("mujoco", family, None, outcome="TIMED_OUT", t_end=0.0) for family in ("tuned", "defaults")
    ]
    found = group([record("mbref", "own", 1e-12), *late])
    assert "MuJoCo completes no run: no result within 60 s (--time-limit)." in right([found])
    assert breaks([found]).startswith("The defaults of MuJoCo do not end within the time limit. ")


@pytest.mark.parametrize(
    ("error", "verdict"),
    [
        (1e-8, Grade.RIGHT),
        (1.1e-8, Grade.INACCURATE),
        (1e-2, Grade.INACCURATE),
        (1.1e-2, Grade.WRONG),
        (None, Grade.UNJUDGED),
    ],
)
def test_grades_by_the_error_alone(error, verdict):
    assert grade(record("a", "b", error)) is verdict
    assert grade(record("a", "b", error, outcome="TIMED_OUT")) is Grade.FAILED


def test_sentences_of_one_scene():
    assert headline([group()]) == (
        "mbref, MuJoCo and Pinocchio are right at their best settings; "
        "with their libraries' defaults none of MuJoCo, Pinocchio and Exudyn is."
    )
    assert right([group()]) == (
        "mbref, MuJoCo and Pinocchio agree with the truth to 6.1e-9. "
        "Exudyn is inaccurate at best: off by 1.70e-04."
    ), right([group()])
    assert fast([group()]) == (
        "mbref reaches an error of 1e-6 in 1 ms of stepping; Pinocchio takes 32 times as long and MuJoCo "
        "takes 500 times as long. Exudyn does not reach it. Pinocchio's fastest runs are integrated by "
        "crosscheck (“tuned”), as all of its runs here are." + CLOCK + ADAPTERS
    ), fast([group()])
    assert breaks([group()]) == (
        "The defaults of Pinocchio and Exudyn end at t = 0 s, where a constraint is redundant. "
        "MuJoCo's defaults complete, but with an error of 2.8 at best."
    ), breaks([group()])
    assert "known to 3e-14: two formulations that share no code agree; it took 2.4 s" in truth([group()])


def test_an_unknown_motion_is_not_judged_by_runs_that_end_at_its_start():
    """Every run agrees with the scene at t = 0. This error of 0 had led to "unjudged at best: off by –"."""
    ended = record("exudyn", "defaults", 0.0, outcome="SINGULAR_MATRIX", t_end=0.0)
    completed = [{**record(n, "tuned", None), "times": [0.0, 1.0]} for n in ("mbref", "mujoco")]
    unknown = {"kind": "", "bound": None, "until": 0.0, "reason": "it starts in a singular position"}
    found = group([ended], **unknown)
    assert not found.is_judged and not group([ended, *completed], **unknown).is_judged
    assert group([ended]).is_judged, "the motion is known, and no engine completes it"
    assert headline([found]).startswith("There is no reference for this motion"), headline([found])
    assert right([found]) == (
        f"{REDUNDANT.name}: no two engines completed the motion, so nothing can be compared."
    )
    assert fast([found]) == "Without a truth no error is known, so speeds are not compared."


def test_the_time_of_an_engines_own_integrator_is_given_beside_crosschecks():
    both = [record("mujoco", "newton, compiled", 1e-9, 0.002), record("mujoco", "tuned", 1e-7, 0.05)]
    others = [record("mbref", "own", 1e-9, 0.004)]
    assert fast([group([*both, *others])]).startswith(
        "MuJoCo, integrated by crosscheck, reaches an error of 1e-6 in 2 ms of stepping; mbref takes 2.0 "
        "times as long. MuJoCo's fastest runs are integrated by crosscheck (“newton, compiled”); its own "
        "integrator needs 50 ms (“tuned”)."
    ), fast([group([*both, *others])])
    rough = [both[0], record("mujoco", "tuned", 1e-3, 0.05)]
    own = "; the runs by its own integrators (“tuned”) do not reach 1e-6."
    assert own in fast([group(rough)]), fast([group(rough)])
    two = [*rough, record("mujoco", "stock", 1e-2, 0.01)]
    assert "its own integrators (“tuned” and “stock”) do not reach" in fast([group(two)]), fast([group(two)])
    elsewhere = [{**r, "scene": SOUND.name} for r in [*both, *others]]
    truths = [{"scene": scene.name, **TRUTH} for scene in (REDUNDANT, SOUND)]
    several = judged([REDUNDANT, SOUND], truths, [*rough, *others, *elsewhere])
    assert fast(several).startswith("MuJoCo, integrated by crosscheck, is the fastest"), fast(several)
    own = "; the runs by its own integrators (“tuned”) reach 1e-6 on 1 of 2 scenes."
    assert own in fast(several), fast(several)


def test_engines_of_another_mechanism_are_not_judged():
    """Right at their best settings or wrong: the sentences name the term, and no verdict counts them."""
    why = {"mujoco": "change of velocity: truth and mujoco differ by 0.317 (allowed 1e-04)"}
    found = replace(group(), differences=why)
    assert headline([found]) == (
        "mbref and Pinocchio are right at their best settings; with their libraries' defaults neither "
        "Pinocchio nor Exudyn is; MuJoCo is not judged: the adapter or the scene differs."
    ), headline([found])
    assert right([found]) == (
        "mbref and Pinocchio agree with the truth to 6.1e-9. Exudyn is inaccurate at best: off by 1.70e-04. "
        "MuJoCo is not judged, because the adapter or the scene differs: change of velocity: truth and "
        "mujoco differ by 0.317 (allowed 1e-04)."
    ), right([found])
    assert "MuJoCo" not in fast([found]) and "MuJoCo" not in breaks([found])
    assert [found.grade(r) for r in RECORDS[:2]] == [Grade.RIGHT, Grade.UNJUDGED]
    alone = replace(group([record("mujoco", "tuned", 1.0)]), differences=why)
    assert headline([alone]) == "MuJoCo is not judged: the adapter or the scene differs."
    assert right([alone]).startswith("MuJoCo is not judged, because the adapter")
    both = [found, group([record("mbref", "own", 1e-9, scene=SOUND.name)], SOUND)]
    assert f"MuJoCo is not judged on {REDUNDANT.name}: the adapter or" in headline(both), headline(both)


@pytest.mark.parametrize(("error", "said"), [(2.8, "is not"), (1e-10, "is, too")])
def test_the_only_engine_with_defaults_is_named(error, said):
    runs = [record(name, "tuned", 1e-10) for name in ("mbref", "mujoco")]
    assert headline([group([*runs, record("mujoco", "defaults", error)])]) == (
        f"Both engines are right at their best settings; with its library's defaults MuJoCo {said}."
    )


def test_other_results_and_other_sentences():
    good = [record(name, family, 1e-10) for name in ("mujoco", "exudyn") for family in ("defaults", "tuned")]
    assert headline([group(good)]) == (
        "Both engines are right at their best settings; so are the libraries' defaults of MuJoCo and Exudyn."
    )
    assert breaks([group(good)]) == "The defaults of MuJoCo and Exudyn are right."
    near = [record("mujoco", "tuned", 1e-10), record("mujoco", "defaults", 1e-5)]
    assert headline([group(near)]).endswith("with its library's defaults MuJoCo is not.")
    assert breaks([group(near)]) == "MuJoCo's defaults are inaccurate, with an error of 1e-05 at best."
    assert "No engine reaches an error of 1e-6" in fast([group([record("mujoco", "tuned", 1e-3)])])
    compiled = record("mujoco", "forward, compiled", 1e-9, 0.1)
    assert fast([group([compiled])]) == (
        "MuJoCo, integrated by crosscheck, reaches an error of 1e-6 in 100 ms of stepping. MuJoCo's fastest "
        "runs are integrated by crosscheck (“forward, compiled”), as all of its runs here are."
        + CLOCK
        + WITHOUT_PYTHON
    ), fast([group([compiled])])
    lost = [record("mbref", "own", 1e-15), failed("exudyn", "tuned", 0.25)]
    assert right([group(lost)]) == (
        "mbref agrees with the truth to less than the truth's own bound, 3e-14. "
        "Exudyn completes no run: not finite at t = 0.25 s."
    ), right([group(lost)])
    cut = group(kind="reference", reason="singular", until=0.3, both=False)
    assert headline([cut]).startswith(
        "Up to t = 0.3 s, as far as the motion is known, mbref, MuJoCo and Pinocchio are right at their best "
        "settings; with"
    ), headline([cut])
    bad = group([record("mbref", "own", 1.0)], kind="reference", reason="singular", until=0.3, both=False)
    assert headline([bad]).startswith(
        "Up to t = 0.3 s, as far as the motion is known, no engine is right at any"
    )
    assert right([cut]).startswith("mbref, MuJoCo and Pinocchio agree with the truth to 6.1e-9 as far as it")
    known = "up to t = 0.3 s of 0.4 s (singular), and errors are of this part: two runs of one formulation"
    assert known in truth([cut]), truth([cut])


def test_sentences_of_several_scenes():
    runs = (("mbref", "own", 0.1), ("pinocchio", "defaults", 0.05))
    sound = [record(engine, family, 1e-9, s, scene=SOUND.name) for engine, family, s in runs]
    truths = [{"scene": scene.name, **TRUTH} for scene in (REDUNDANT, SOUND)]
    groups = judged([REDUNDANT, SOUND], truths, [*RECORDS, *sound])
    assert "fastest to an error of 1e-6 on 1 of 2 scenes" in fast(groups), fast(groups)
    assert "On all other scenes the fastest is Pinocchio on spatial_slider_crank" in fast(groups), fast(
        groups
    )
    assert "Pinocchio and Exudyn end at t = 0 s on planar_slider_crank, where a" in breaks(groups)
    assert "and Pinocchio are right at their best settings on the scenes they can run;" in headline(groups)


def test_a_motion_that_is_not_known_beside_one_that_is():
    still = [record(name, "tuned", None, times=[0.0], scene=SOUND.name) for name in ("mbref", "exudyn")]
    groups = [group(), group(still, SOUND, kind="", reason="two ways", bound=None)]
    assert headline(groups) == (
        "mbref, MuJoCo and Pinocchio are right at their best settings on planar_slider_crank, whose motion "
        "is known; with their libraries' defaults none of MuJoCo, Pinocchio and Exudyn is."
    ), headline(groups)
    assert "agree with the truth to 6.1e-9 on planar_slider_crank." in right(groups), right(groups)


def test_speeds_are_compared_where_one_of_two_motions_is_known():
    still = [record(name, "tuned", None, times=[0.0], scene=SOUND.name) for name in ("mbref", "exudyn")]
    unknown = group(still, SOUND, kind="", reason="two ways", bound=None)
    assert fast([group(), unknown]).startswith("mbref is the fastest to an error of 1e-6 on ")
    assert fast([unknown, unknown]).startswith("Without a truth no error is known")


def test_defaults_that_nothing_judges():
    unjudged = [record(name, "defaults", None, times=[0.0]) for name in ("mujoco", "exudyn")]
    assert breaks([group(unjudged, kind="", reason="two ways", bound=None)]) == (
        "The defaults of MuJoCo and Exudyn complete; without a truth it is unknown whether they are right."
    )
    assert breaks([group([record("mbref", "own", 1e-12)])]) == "No run used a library's default settings."


def test_a_best_setting_beside_one_that_ran_out_of_time():
    late = record("sundials", "ggl", None, 0.2, outcome="TIMED_OUT", t_end=0.0, time_limit=5.0)
    assert right([group([record("sundials", "ggl", 2.87), late])]) == (
        "SUNDIALS IDA is wrong at best of the settings that end within 5 s: off by 2.87e+00."
    )


def test_engines_without_a_truth_are_compared_at_the_same_times():
    """Two motions that are 1e-3 of the scene's length apart, and one at other times."""
    first, second = (synthetic.record(name, "x", error, 0.1) for name, error in (("a", 1e-3), ("b", 2e-3)))
    scene, other = synthetic.scene(), {**first, "engine": "c", "times": [0.5 * t for t in first["times"]]}
    found = Judged(scene, {}, [first, second, other]).agreement()
    assert found == {("a", "b"): pytest.approx(1e-3, rel=1e-9)}, found


def saved(folder: Path, records: list[dict]) -> Path:
    folder.mkdir()
    for one in records:
        append(folder / "records.jsonl", one)
    return folder


def test_a_comparison_leaves_files_as_they_are(tmp_path):
    path = saved(tmp_path / "cut", [record("a", "x", 1e-5, 0.1)]) / "records.jsonl"
    path.write_text(path.read_text() + '{"key": "cut sho')
    before = path.read_text()
    assert len(load(path)) == 1 and path.read_text() == before


def test_runs_of_one_set_alone_are_counted_by_engine(tmp_path):
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


def test_errors_are_drawn_no_lower_than_they_are_known():
    below = record("a", "x", 1e-17, 0.1)
    assert Run(below).drawn == (3e-14, 0.1)
    drawn = scatter([below], {("a", "x"): "A"}).plain
    assert "1e-14" in drawn and "1e-16" not in drawn, drawn


def test_tables_of_eighty_columns_and_whole_numbers():
    measured = {
        "error": 2.71e-5,
        "error_bound": 1e-14,
        "violation_position": 1.13e-13,
        "energy_error": 2.5e-12,
    }
    long = [
        record(
            "pinocchio", "defaults", None, 7.8125e-06, settings={"accuracy": s}, metrics=measured, outcome=end
        )
        for s, end in ((0.0001, "COMPLETED"), (7.8125e-06, "NOT_CONVERGED"))
    ]
    long.append(failed("exudyn", "alf-dual+projection, compiled"))
    console = Console(width=80, record=True, file=io.StringIO())
    long.append({**failed("exudyn", "defaults"), "t_end": -1e-08})
    tables.print_comparison(console, group(long), verdict([group(long)]), "my.toml", with_ratio=True)
    tables.print_runs(console, long)
    text = console.export_text()
    for number in ("2.71e-05", "1.13e-13", "2.50e-12", "7.81e-06", "accuracy=0.0001", "7.8125e-06"):
        assert len(re.findall(rf"{re.escape(number)}(?!\d)", text)) >= 2, (number, text)
    assert "0.00e+00" not in text and "-1e-08" not in text, "a run that never moved has no numbers"


def test_a_known_motion_that_no_engine_completes_is_not_without_a_reference():
    """Runs that end without a state have no error; their failure is the verdict."""
    late = record("mujoco", "defaults", None, outcome="TIMED_OUT", t_end=0.0)
    found = group([late, failed("exudyn", "tuned", 0.25)])
    assert headline([found]) == (
        "No engine is right at any setting that was run; with its library's defaults MuJoCo is not."
    )
    assert right([found]) == (
        "MuJoCo completes no run: no result within 60 s (--time-limit). "
        "Exudyn completes no run: not finite at t = 0.25 s."
    )
    assert fast([found]).startswith("No engine reaches an error of 1e-6")
    unknown = replace(found, truth={**found.truth, "kind": "", "reason": "two ways"})
    assert headline([unknown]).startswith("There is no reference for this motion")
