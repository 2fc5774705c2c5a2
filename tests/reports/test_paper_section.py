"""The paper's section: marks, numbers and words in its tables, from made-up records; nothing is simulated."""

import dataclasses
import math
from collections import Counter
from typing import Any

import numpy as np
import pytest

from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import truth_for
from crosscheck.paper import runs, store
from crosscheck.paper.cells import CELLS
from crosscheck.paper.illustration import illustration
from crosscheck.paper.runs import Label, Records
from crosscheck.study.grid import Case, key
from mbref.motions.trajectory import Cost, Outcome, Trajectory
from mbref.records import append
from mbref.scene import Scene
from reports.blocks import Figure, Heading, Table
from reports.runs import Run
from reports.sections import paper, paper_cranks, paper_methods, paper_sweep, paper_teaching
from tests.reports.synthetic import MADE_OF

LETTERS = {outcome.letter: outcome for outcome in Outcome if outcome.letter}
SPATIAL = "spatial_slider_crank_flywheel"
ILLUSTRATION: dict[str, Any] = {}
MOTIONS: dict[tuple[str, int, float], tuple[Trajectory, dict[str, Any]]] = {}


def motion(scene: Scene, times: np.ndarray) -> tuple[Trajectory, dict[str, Any]]:
    """The exact motion at no more than 21 of the times, divided by four, with its metrics; of SPATIAL, whose
    truth takes long, divided by ten."""
    few = times[:: max(1, len(times) // 20)] / (10 if scene.name == SPATIAL else 4)
    key = (scene.name, len(few), float(few[-1]))
    if key not in MOTIONS:
        truth = truth_for(scene)
        exact = truth.poses(few)
        MOTIONS[key] = exact, measure(scene, exact, truth)
    return MOTIONS[key]


def record(case: Case, outcome: Outcome, t_end: float, steps: int) -> dict[str, Any]:
    """The record of a run that moved exactly and ended so."""
    scene = case.scene
    exact, metrics = motion(scene, np.asarray(case.times))
    family, options = case.setting.family, case.setting.options
    run = {"engine": "mbref", "version": "1", "method": family, "settings": dict(options)}
    run |= {"outcome": outcome, "message": "" if outcome is Outcome.COMPLETED else outcome.sentence}
    run |= {"scene": scene.name, "t_end": t_end, "cost": Cost(seconds=0.01 * t_end, steps=steps)}
    known = {"scene": scene.name, "family": family, "key": "", "metrics": metrics}
    known |= {"asked": {"engine": "mbref", "options": {}, "samples": 3, "end": t_end}}
    return {**MADE_OF, **dataclasses.replace(exact, **run).to_record(), **known}


@pytest.fixture(scope="module")
def records() -> Records:
    """Every cell as printed except for three: one ends late, one completes, one drifts sooner. Seed 1 of the
    draws ends as printed, the others at 0.2 s."""
    changed = {
        ("I", "MPI (SVD)", "θ₂ = π/4"): (Outcome.VIOLATION, 0.0566),
        ("II", "MPI (SVD) + CP", "five-bar"): (Outcome.COMPLETED, 20.0),
        ("III", "LM2", "spatial slider-crank, driven"): (Outcome.VIOLATION, 2.5),
    }
    out: Records = {}
    ends = {(c.table, c.row, c.column): (LETTERS.get(c.letter, Outcome.COMPLETED), c.end) for c in CELLS}
    ends |= {("drawn", *place): end for (_, *place), end in ends.items()}
    for label, case in (runs.cases() | runs.studies() | runs.timed()).items():
        if "data errors 1e-8" in label.variant or "no forced" in label.variant:
            continue  # a sweep that is not complete is shown as far as it got
        outcome, end = changed.get(label[:3]) or ends.get(label[:3]) or (Outcome.COMPLETED, case.times[-1])
        if label.part in ("sweep", "sized"):
            outcome, end = Outcome.VIOLATION, 0.0315
        if label.part == "drawn" and label.variant != "seed 1":
            outcome, end = Outcome.VIOLATION, 0.2
        made = record(case, outcome, 20.0 if end is None else float(end), steps=1000)
        out[label] = store.drawable(label, case.scene, made)
    return out


@pytest.fixture(scope="module")
def blocks(records: Records, tmp_path_factory) -> list:
    ILLUSTRATION.update(illustration(tmp_path_factory.mktemp("paper") / "illustration.jsonl"))
    return paper.render(records, ILLUSTRATION)


def tables(blocks: list, word: str) -> list[Table]:
    return [b for b in blocks if isinstance(b, Table) and word in b.header]


def cells(table: Table) -> list[dict[str, str]]:
    """Return the cells of each row by the headings of their columns."""
    return [dict(zip(table.header, row, strict=True)) for row in table.rows]


def test_score_counts_the_three_changed_cells(records):
    """Of the ``records`` two end at another time than printed, one with another outcome."""
    score = paper.score(records)
    assert f"Of {len(CELLS)} cells" in score and f"{len(CELLS) - 3} have" in score, score
    assert "2 the outcome at another time, 1 another outcome" in score, score


def test_score_counts_cells_that_end_as_printed_in_most_draws_and_in_any(records):
    """Of the 55 cells 20 run once, 11 with 8 random first steps (draws) and 24 with 20. Seed 1 alone ends as
    printed in these records: it is most draws of the 20 cells alone, and at least one of all 55."""
    assert Counter(map(runs.draws, CELLS)) == {1: 20, 8: 11, 20: 24}
    score = paper.score(records)
    assert "(draws): 20 cells have the printed outcome and time in most draws, 55 in at least one;" in score


def test_changed_cells_are_listed_with_their_causes(blocks):
    """Three of the ``records`` differ from the paper: MPI (SVD) ends late, at 0.0566 s, the next singular
    position (1 of its 20 random starts ends as printed); the five-bar completes and crosses every singular
    position; the violation of LM2 grows to the limit at 2.5 s."""
    [found] = tables(blocks, "Measured")
    reasons = {(c["Table"], c["Column"], c["Method"]): c["Measured"] for c in cells(found)}
    assert len(reasons) == 3, reasons
    late = reasons["I", "θ₂ = π/4", "MPI (SVD)"]
    assert "θ₂ = -2π" in late and "1 of 20 draws end as printed; " in late, late
    assert "the run ends as printed if the setting is: rtol 1e-5" in late, late
    assert "passes every singular position" in reasons["II", "five-bar", "MPI (SVD) + CP"], reasons
    assert reasons["III", "spatial slider-crank, driven", "LM2"].startswith("drift"), reasons


def test_every_cell_of_the_paper_is_marked_in_a_table(blocks):
    """A marked cell begins with = (ends as printed), ≈ (at another time) or ≠ (with another outcome)."""
    marks = [cell for t in tables(blocks, "Method") for row in t.rows for cell in row if cell[:1] in "=≈≠"]
    assert len(marks) == len(CELLS), f"{len(marks)} marked cells of {len(CELLS)}"


def test_paper_section_without_studies_lacks_their_headings_and_keeps_the_table_of_changed_cells(
    records, blocks
):
    """The ``records`` without those of studies are rendered. Rows of the table of changed cells are equal in
    their first five columns; the sixth has causes, which come from the studies."""
    needed = runs.cases() | runs.timed()
    some = {label: record for label, record in records.items() if label in needed}
    found = paper.render(some, ILLUSTRATION)
    whole, here = ([b.text for b in shown if isinstance(b, Heading)] for shown in (blocks, found))
    of_studies = {
        "Influence of the settings",
        "Every formulation with every stabilisation",
        "ALF against its dual, digit by digit over α",
    }
    assert of_studies <= set(whole) and here == [heading for heading in whole if heading not in of_studies]
    changed, all_changed = ([row[:5] for row in tables(b, "Measured")[0].rows] for b in (found, blocks))
    assert changed == all_changed


def test_indexed_records_return_under_their_labels(records, tmp_path):
    """A label is the table, row and column of the paper; the file of records has keys of runs alone.
    ``index`` writes the key of each label, by which ``indexed`` finds the records again."""
    chosen = dict(list(runs.cases().items())[:5])
    for label, case in chosen.items():
        append(tmp_path / store.FILE, {**records[label], "key": key(case)})
    store.index(tmp_path / store.FILE, chosen)
    found = store.indexed(tmp_path)
    assert list(found) == list(chosen), found.keys()
    assert all(found[label]["outcome"] == records[label]["outcome"] for label in chosen)


@pytest.mark.parametrize("power", [1.0, 2.0])
def test_exponent_of_a_growing_violation_is_the_power_put_in(records, power):
    """A violation of 1e-8 t^p has the exponent p; one that stays at rounding has none (NaN)."""
    [label] = [label for label in records if label.part == runs.GROWTH and label.variant == "1e-06"]
    t = runs.TEACHING
    run = Run({**records[label], "times": t.tolist(), "violation": (1e-8 * t**power).tolist()})
    assert paper_teaching.exponent(run) == pytest.approx(power, rel=1e-9)
    assert math.isnan(paper_teaching.exponent(Run({**run.record, "violation": [1e-16] * len(t)})))


def test_tables_show_the_paper_s_and_the_records_ratios_of_steps(blocks):
    """The paper prints steps a second: 103 of LM2 + CP and 3303 of LM2 (Table III), 1368 and 2428 of ALF + CP
    and LM1 (IV). Records have 1000 steps each: LM2 + CP to 20 s, LM2 to 2.5 s."""
    third, fourth = tables(blocks, "steps, ratio printed")
    printed = third.header.index("steps, ratio printed")  # the column of our ratio follows
    in_iii, in_iv = ({row[0]: row[printed : printed + 2] for row in t.rows} for t in (third, fourth))
    assert in_iii["LM2 + CP"] == (f"{103 / 3303:.3f}", f"{2.5 / 20:.3f}"), in_iii
    assert in_iv["ALF + CP"][0] == f"{1368 / 2428:.3f}", in_iv


def test_incomplete_sweep_is_shown_as_far_as_it_got(records):
    """The sweep has the cells that fail at singular positions in Tables I and II. Records with "data errors
    1e-8" are missing: this row counts 0 cells, and its end times are dashes. All others of the sweep end by a
    violation (c) at 0.0315 s. Draws, except seed 1, end at 0.2 s; the last seed has none that last 20 s."""
    swept = [cell for cell in CELLS if cell.table != "III" and cell.letter not in ("a", "")]
    [scores, sizes, times, drawn] = [b for b in paper_sweep.render(records) if isinstance(b, Table)]
    count = {row["Varied"]: row["Cells"] for row in cells(scores)}
    assert count["data errors 1e-8 m"] == "0" and count["rtol 1e-5"] == str(len(swept)), count
    assert all("–" in row and "0.0315 c" in row for row in times.rows), times.rows[0]
    ends = {end for row in cells(sizes) for name, end in row.items() if name not in ("Errors, m", "Method")}
    assert ends == {"0.032 c (8 of 8)"}
    last_draw = drawn.header[-1]
    assert {row[last_draw] for row in cells(drawn) if row["Method"] not in runs.LASTING} == {"0.2000 c"}


def test_table_of_cranks_shows_that_an_exact_record_never_leaves_the_true_motion(records):
    """Records move exactly: the table has "–" for the time from which on a run is off the true motion, and
    rates equal to the true ones. With a = b the crank angles π/2 + k π are singular; the 61 with k = 0
    to 60 are within the 61.0 π that the crank turns in 20 s."""
    [found] = [b for b in paper_cranks.render(records) if isinstance(b, Table)]
    [off] = [name for name in found.header if name.startswith("Off by")]
    assert {row[off] for row in cells(found)} == {"–"}
    assert {row["Passed by then"] for row in cells(found) if row["Lengths"] == "a = b"} == {"61"}
    assert all(row["Crank, rad/s"] == row["True"] for row in cells(found))


def test_accelerations_of_exact_records_have_all_digits_and_a_failed_start_has_none(records):
    """Errors of records of exact motions are below 1e-14, 50 roundings; without a sample they are NaN."""
    for name, errors in paper_methods.digit_errors(records).items():
        assert max(errors) < 1e-14, (name, errors)
    missing = Label("digits", "alf", "100")
    run = {"scene": records[missing]["scene"], "engine": "mbref", "version": "1", "method": "alf"}
    run |= {"settings": {}, "bodies": ("crank", "rod", "slider"), "message": ""}
    lost = Trajectory.failed(**run, outcome=Outcome.NOT_CONVERGED)
    lost_record = {**MADE_OF, **lost.to_record(), "key": "lost", "scene": records[missing]["scene"]}
    other = {**records, missing: lost_record}
    assert np.isnan(paper_methods.digit_errors(other)["alf"][0])


def test_every_figure_is_drawn_and_curves_over_time_run_forwards(blocks):
    """More than four panels are over the time, which passes 0.01 s; a violation would be smaller."""
    drawn = {block.name: block.draw() for block in blocks if isinstance(block, Figure)}
    for number in (4, 5, 6, 8, 11, 12, 13, 14, 15, 16):
        assert f"paper-figure-{number}" in drawn, f"Figure {number} is missing of {list(drawn)}"
    panels = [axes for one in drawn.values() if not isinstance(one, str) for axes in one.axes]
    over_time = [axes for axes in panels if axes.get_xlabel() == "t (s)"]
    assert len(over_time) > 4, [axes.get_xlabel() for axes in panels]
    for axes in over_time:
        for x in (line.get_xdata() for line in axes.lines if len(line.get_xdata()) > 2):
            assert x[-1] > 0.01 and (np.diff(x) > 0.0).all(), axes.get_ylabel()
