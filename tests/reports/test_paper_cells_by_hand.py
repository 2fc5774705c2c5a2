"""Cells, marks and sentences of the paper's section on a few plain runs / worked out by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from test_figures_by_hand import moving, plain

from crosscheck.paper import singular
from crosscheck.paper.cells import FIVE_BAR, SPATIAL, Cell
from crosscheck.paper.runs import HEAVY, UNEQUAL, Label, Records
from mbref.trajectory import Trajectory
from reports.blocks import Table
from reports.runs import Run
from reports.sections import paper, paper_cranks, paper_methods, paper_misprints, paper_sweep, paper_teaching

HALF_TURN = "θ₂ = π/2"
DRIFTING = Cell("III", "LM2", SPATIAL, 6.163, "c")
AGAIN = [f"seed {k}" for k in range(1, 8)]


def ended(t_end: float, outcome: str = "VIOLATION", **changes: Any) -> dict[str, Any]:
    return {**plain("mbref", "x", 1e-3, 1.0, outcome, t_end), "settings": {}, **changes}


def of_cell(cell: Cell, shown: float, *drawn: float, **changes: Any) -> Records:
    """The records of a cell: the run shown, and draws, by their end times."""
    records: Records = {Label(cell.table, cell.row, cell.column): ended(shown, **changes)}
    for seed, t_end in zip(AGAIN, drawn, strict=False):
        records[Label("drawn", cell.row, cell.column, seed)] = ended(t_end, **changes)
    return records


# --- tables -----------------------------------------------------------------------------------------------
def test_marks_at_the_ends_of_their_ranges():
    """The paper prints milliseconds; 2 ms from its time is the same time."""
    start = Cell("I", "ALF", HALF_TURN, 0.0, "c")
    marks = [paper._mark(start, Run(ended(t))) for t in (0.0, 0.0009, 0.001, 0.002, 0.0021)]
    assert marks == ["=", "=", "= within 2 ms:", "= within 2 ms:", "≈"]
    assert paper._mark(start, Run(ended(0.0, "NOT_CONVERGED"))) == "≠"
    lasting = Cell("I", "ALF", HALF_TURN, None, "")
    assert paper._mark(lasting, Run(ended(20.0, "COMPLETED"))) == "="
    assert paper._mark(lasting, Run(ended(0.5))) == "≠"


def test_end_times_have_four_decimals_within_the_first_second():
    times = [0.0, 0.0123456, 0.99999, 1.0, 6.16312]
    assert [paper.ended(Run(ended(t))) for t in times] == [
        "0 s c",
        "0.0123 s c",
        "1.0000 s c",
        "1 s c",
        "6.163 s c",
    ]
    assert paper.ended(Run(ended(0.5, "TIMED_OUT"))) == "0.5000 s TIMED_OUT"
    assert paper.ended(Run(ended(0.5, "COMPLETED"))) == "20 s"


def test_ends_before_and_after_the_paper_s_time():
    assert paper._inside(DRIFTING, of_cell(DRIFTING, 6.0, 6.3))
    assert not paper._inside(DRIFTING, of_cell(DRIFTING, 6.163, 6.3)), "not before"
    assert not paper._inside(DRIFTING, of_cell(DRIFTING, 6.0, 6.163)), "not after"
    assert not paper._inside(DRIFTING, of_cell(DRIFTING, 6.0, 6.3, outcome="NOT_CONVERGED"))
    other = Cell("II", DRIFTING.row, DRIFTING.column, DRIFTING.end, DRIFTING.letter)
    assert not paper._inside(other, of_cell(other, 6.0, 6.3))
    lasting = Cell("III", "ALF", SPATIAL, None, "")
    assert not paper._inside(lasting, of_cell(lasting, 6.0, 6.3))


def test_score_of_four_cells(monkeypatch):
    """One as printed; one as printed in 4 of 8 draws, on both sides of the paper's time; one that only drifts
    around that time; one that completes."""
    cells = (
        Cell("I", "LM2", HALF_TURN, 0.0, "a"),
        DRIFTING,
        Cell("III", "MPI (SVD)", SPATIAL, 6.163, "c"),
        Cell("II", "MPI (SVD) + CP", FIVE_BAR, 3.538, "d"),
    )
    monkeypatch.setattr(paper, "CELLS", cells)
    records = {
        **of_cell(cells[0], 0.0, outcome="SINGULAR_MATRIX"),
        **of_cell(cells[1], 6.9, 6.163, 6.163, 6.162, 6.164, 6.0, 6.1, 6.5),
        **of_cell(cells[2], 6.0, 6.3),
        **of_cell(cells[3], 20.0, outcome="COMPLETED"),
    }
    assert paper.score(records) == (
        "Of 4 cells of Tables I to III, 1 have the printed outcome and end time within 2 ms in the run "
        "shown, 2 the outcome at another time, 1 another outcome. The paper gives no first step and few "
        "digits, so runs are repeated with random ones (draws): 1 cells have the printed outcome and time "
        "in most draws, 2 in at least one; 1 more, of Table III, end by drift around that time."
    )
    heading, table = paper._table("III", records)
    assert heading.text == "Table III: the driven spatial slider-crank"
    assert table.caption == (
        "0 of 2 cells are as printed, 2 end with the printed outcome at another time, 0 end otherwise."
    )
    assert list(table.header) == ["Method", f"{SPATIAL}: printed", "ours", "error", "draws"]
    assert [list(row) for row in table.rows] == [
        ["LM2", "6.163 s c", "≈ 6.9 s c", "1.0e-03", "4 of 8"],
        ["MPI (SVD)", "6.163 s c", "≈ 6 s c", "1.0e-03", "0 of 8"],
    ]
    assert table.right == {3, 4}, "errors and numbers of draws"
    _, second = paper._table("II", records)
    assert second.rows[0][1:] == ["3.538 s d", "≠ 20 s", "1.0e-03", "0 of 8"]
    _, first = paper._table("I", records)
    assert first.rows[0][-1] == "–", "a start that is singular has no draws"
    [_, differing] = paper._differences(records)
    assert [row[:5] for row in differing.rows] == [
        ("III", SPATIAL, "LM2", "6.163 s c", "6.9 s c"),
        ("III", SPATIAL, "MPI (SVD)", "6.163 s c", "6 s c"),
        ("II", FIVE_BAR, "MPI (SVD) + CP", "3.538 s d", "20 s"),
    ]
    assert [row[5] for row in differing.rows[:2]] == [
        "drift, the sum of local errors: 6 to 6.9 s over the draws",
        "drift, the sum of local errors: 6 to 6.3 s over the draws",
    ]


def test_the_error_of_a_run_without_a_sample_is_of_the_run_that_repeats_it():
    records = of_cell(DRIFTING, 6.0)
    assert paper._error(DRIFTING, records) == "1.0e-03"
    again = ended(5.7, metrics={"error": 2.5e-4, "error_bound": 0.0})
    assert paper._error(DRIFTING, {**records, Label("error", "LM2", SPATIAL): again}) == "2.5e-04"


def test_reasons_of_drift():
    """The strict run has rtol 1e-9 and a violation of 1.6e-5."""
    metrics = {"error": 1e-3, "violation_position": 3e-7}
    strict = {Label("strict", "LM2", SPATIAL, "rtol 1e-9"): ended(7.25, metrics={"violation_position": 2e-5})}
    records = {**of_cell(DRIFTING, 20.0, outcome="COMPLETED", metrics=metrics), **strict}
    assert paper._reason(DRIFTING, records) == (
        "the violation stays at 3.0e-07, below the tolerance; at rtol 1e-9 and a violation of 1.6e-05 it "
        "ends at 7.25 s c, violation 2.0e-05"
    )


def test_reasons_at_a_singular_position():
    """θ₂ = π/2 - 124.8 t passes -π after 37.76 ms; the paper prints 31 ms."""
    cell = Cell("I", "MPI (SVD)", HALF_TURN, 0.0378, "c")
    place = "ends at θ₂ = -π, singular position 2 of 0.0126, 0.0378, 0.0629, 0.0881 s"
    other_letter = of_cell(cell, 0.0378, outcome="NOT_CONVERGED")
    assert paper._reason(cell, other_letter) == place
    drawn = {**other_letter, Label("drawn", cell.row, cell.column, "seed 1"): ended(0.0126)}
    drawn[Label("sweep", cell.row, cell.column, "rtol 1e-5")] = ended(0.06293)
    assert paper._reason(cell, drawn) == (
        f"{place}; with other settings and draws it ends at 2 times from 0.0126 to 0.0629 s, none of them "
        "the printed one"
    )
    drawn[Label("sweep", cell.row, cell.column, "rtol 1e-7")] = ended(0.038)
    assert paper._reason(cell, drawn) == f"{place}; the run ends as printed if the setting is: rtol 1e-7"
    drawn[Label("drawn", cell.row, cell.column, "seed 2")] = ended(0.0379)
    assert paper._reason(cell, drawn) == (
        f"{place}; 1 of 20 draws end as printed; the run ends as printed if the setting is: rtol 1e-7"
    )


# --- planar slider-cranks ---------------------------------------------------------------------------------
def shown(places: list[list[float]], turns: list[list[float]] | None = None, **changes: Any) -> Run:
    """A run of one body at places (m), with orientations."""
    run = moving("a", "x", (0.0,) * len(places), **changes)
    body = {**run.record["bodies"]["b"], "position": places}
    body["angular_velocity"] = [[0.0, 0.0, 0.5 + k] for k in range(len(places))]
    body |= {"orientation": turns} if turns else {}
    return Run({**run.record, "bodies": {"b": body}})


def test_the_largest_distance_and_tilt_out_of_the_plane():
    """A tilt is twice the largest of the quaternion's x and y; its z turns within the plane."""
    flat = [[1.0, 0.0, 0.0, 0.0]] * 3
    tilted = [[0.9, 0.01, -0.02, 0.4], [0.9, 0.0, 0.0, -0.5], [1.0, 0.0, 0.0, 0.0]]
    heights = [[5.0, 7.0, z] for z in (0.1, -0.3, 0.2)]
    assert paper_cranks._out_of_plane(shown(heights, flat).trajectory) == 0.3
    assert paper_cranks._out_of_plane(shown(heights, tilted).trajectory) == 0.3
    low = [[5.0, 7.0, z] for z in (0.001, -0.003, 0.002)]
    found = paper_cranks._out_of_plane(shown(low, tilted).trajectory)
    assert found == pytest.approx(0.04, rel=0.1), "unit quaternions"


def steady(column: str, times: tuple[float, ...]) -> Trajectory:
    """A true motion at the origin whose first body turns about z at 2 rad/s, or at 3 rad/s with a ≠ b."""
    still = np.zeros((len(times), 1, 3))
    turning = np.zeros_like(still)
    turning[:] = 0.1, 0.2, 2.0 if column == HEAVY else 3.0
    turn = np.tile([1.0, 0.0, 0.0, 0.0], (len(times), 1, 1))
    return Trajectory("s", "e", "1", "m", {}, np.array(times), ("b",), still, turn, still, turning)


def test_singular_positions_passed_by_a_time(monkeypatch):
    """From θ = 0 at 2 rad/s: π/2 after 0.785 s, 3π/2 after 2.356 s."""
    monkeypatch.setattr(paper_cranks, "_true", steady)
    assert [paper_cranks._passed(HEAVY, t) for t in (0.78, 0.79, 2.35, 2.36)] == [0, 1, 1, 2]
    assert paper_cranks._passed(UNEQUAL, 2.36) == "–"


def test_cells_of_a_crank_that_leaves_the_true_motion(monkeypatch):
    """9.9 mm off the true motion at 0.5 s, 10.1 mm at 1 s, by when one position is passed."""
    monkeypatch.setattr(paper_cranks, "_true", steady)
    metrics = {"error": 2e-2, "violation_position": 3e-5}
    places = [[0.0, 0.0, 0.0], [0.0, -0.0099, 0.0], [0.002, -0.0101, -0.004]]
    run = shown(places, metrics=metrics)
    ended_at, *cells = paper_cranks._cells(HEAVY, run)
    assert ended_at == "20 s"
    assert cells == ["2.0e-02", "3.0e-05", "1", "1", "4.0e-03", "2.5", "2"]
    near = shown(places[:2], metrics=metrics, outcome="VIOLATION", t_end=2.4)
    ended_at, *cells = paper_cranks._cells(HEAVY, near)
    assert ended_at == "2.4 s c"
    assert cells == ["2.0e-02", "3.0e-05", "–", "2", "0", "1.5", "2"], "on the true motion to its end"
    assert paper_cranks._cells(UNEQUAL, run)[4:] == ("–", "4.0e-03", "2.5", "3")
    at_limit = shown([[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.02, 0.0, 0.0]], times=[0.0, 0.5, 0.987654])
    assert paper_cranks._cells(UNEQUAL, at_limit)[3] == "0.9877", "10 mm off is not off yet"


def test_the_true_motion_of_a_crank(monkeypatch):
    """The judge's motion of the column's mechanism; positions are counted over 2001 instants."""
    asked: list[Any] = []
    truth = SimpleNamespace(poses=lambda times: asked.append(times.tolist()) or steady(HEAVY, (0.0, 1.0)))
    monkeypatch.setattr(paper_cranks, "truth_for", lambda scene: asked.append(scene) or truth)
    monkeypatch.setattr(paper_cranks, "dynamic_scene", lambda column: f"scene of {column}")
    try:
        assert paper_cranks._true("a column", (0.0, 0.25)).times.tolist() == [0.0, 1.0]
    finally:
        paper_cranks._true.cache_clear()
    assert asked == ["scene of a column", [0.0, 0.25]]
    instants: list[int] = []
    monkeypatch.setattr(
        paper_cranks, "_true", lambda column, times: instants.append(len(times)) or steady(column, times)
    )
    assert paper_cranks._passed(HEAVY, 0.79) == 1 and instants == [2001]


def test_the_planar_slider_cranks_of_the_paper_alone_are_counted(monkeypatch):
    """Two of three runs with a = b last; the error of one is 10 mm, which is off. Others are not counted."""
    monkeypatch.setattr(paper_cranks, "_true", steady)

    def run(error: float, height: float = 0.0, **changes: Any) -> dict[str, Any]:
        metrics = {"error": error, "violation_position": 100 * error}
        return shown([[0.0, 0.0, height]] * 2, metrics=metrics, **changes).record

    records = {
        Label("dynamic", "one", HEAVY): run(9e-3),
        Label("dynamic", "two", HEAVY): run(1e-2),
        Label("dynamic", "three", HEAVY): run(1e-3, outcome="VIOLATION"),
        Label("peaks", "four", HEAVY): run(1e-4),
        Label("dynamic", "five", "spatial"): run(1e-4),
        Label("dynamic", "MPI (SVD)", UNEQUAL): run(2e-4, 0.05),
        Label("dynamic", "MPI (GS)", UNEQUAL): run(3e-4, 0.007),
    }
    heading, text, table = paper_cranks.render(records)
    assert heading.text == "The planar slider-cranks, run by run"
    assert "Of ours 2 of 3 last, 1 of them on the smooth branch" in text.text
    assert "with violations of 2.0e-02: nothing" in text.text and "grows to 5.0e-02. One" in text.text
    assert "(out of plane: 7.0e-03)" in text.text
    assert [row[:3] for row in table.rows] == [
        ("a = b", "one", "the settings"),
        ("a = b", "two", "the settings"),
        ("a = b", "three", "the settings"),
        ("a ≠ b", "MPI (SVD)", "the settings"),
        ("a ≠ b", "MPI (GS)", "the settings"),
    ]
    names = [table.header[k] for k in sorted(table.right)]
    assert names == [
        "Error",
        "Violation",
        "Off by 0.01 m from",
        "Passed by then",
        "Out of plane",
        "Crank, rad/s",
        "True",
    ]
    assert {len(row) for row in table.rows} == {len(table.header)} and table.folded


# --- methods ----------------------------------------------------------------------------------------------
def test_the_explanation_of_singular_positions():
    """On the fold from θ₂ = 0 the crank would have to rest: 0.1 rad are missing."""
    crossings = [("θ₂ = π/4", 0.00629, 0, 17, 2e-16), ("θ₂ = π/4", 0.03147, -1, 18, 3e-5)]
    iterations = [[3, 4, 5, 6]] * 5 + [[9_999, 10_000, 10_001, 7]]
    found = {
        "fold": (0.1, 4e-16),
        "crossings": crossings,
        "theta": [0.0, 1.0],
        "smallest": [(0.1, 0.2), (0.3, 0.4)],
        "alf_iterations": iterations,
    }
    _, text, table, figure, near = paper_methods.explained(found)
    assert "Driven 0.1 rad further along the fold, the joint equations" in text.text
    assert "are violated by 4.0e-16 from θ₂ = π: coupler" in text.text
    assert "From θ₂ = 0 they are violated by 0.1 rad" in text.text
    assert list(table.rows) == [
        ("π/4", "0.0063", "0", "17", "2.0e-16", "excludes a turning crank"),
        ("π/4", "0.0315", "-π", "18", "3.0e-05", "admits a turning crank"),
    ]
    names = [table.header[k] for k in sorted(table.right)]
    assert names == ["t (s)", "Rank of 19 rows", "Smallest singular value"]
    assert figure.name == "paper-singular-values"
    assert near.header == ("Distance", "γ off by 0", "γ off by 1e-10", "γ off by 1e-08", "γ off by 1e-06")
    assert near.rows[0] == ("1", "3", "4", "5", "6")
    assert near.rows[5] == ("0.001", "9999", "> 10000", "> 10000", "7") and singular.MOST == 10_000
    assert near.right == {0, 1, 2, 3, 4}


def test_pairs_of_formulations_and_stabilisations():
    """Two of three partitioned runs complete; 10 steps and 0.25 s of CPU time over 4 s."""

    def run(violation: float, **changes: Any) -> dict[str, Any]:
        made = plain("mbref", "x", 2e-3, 0.25, changes.pop("outcome", "COMPLETED"), 4.0)
        return {**made, "metrics": {"error": 2e-3, "violation_position": violation}, **changes}

    records = {
        Label("pairs", "lm1", "none"): run(0.5),
        Label("pairs", "lm1", "partitioning"): run(2e-9),
        Label("pairs", "lm2", "partitioning"): run(3e-9),
        Label("pairs", "alf", "partitioning"): run(1e-9, outcome="VIOLATION"),
        Label("tight", "alf", "partitioning"): run(0.7),
    }
    heading, table = paper_methods._pairs(records)
    assert heading.text == "Every formulation with every stabilisation"
    assert "With partitioning 2 of 3 formulations complete, with violations up to 3.0e-09." in table.caption
    assert table.rows[0] == ("lm1", "none", "20 s", "2.0e-03", "5.0e-01", "2.5", "62.5")
    assert table.rows[3] == ("alf", "partitioning", "4 s c", "2.0e-03", "1.0e-09", "2.5", "62.5")
    assert len(table.rows) == 4
    names = [table.header[k] for k in sorted(table.right)]
    assert names == ["Error", "Violation", "Steps/s", "ms CPU per s"]
    early = {**run(0.5, outcome="VIOLATION"), "t_end": 0.0}
    assert paper_methods._pair(Label("pairs", "lm1", "none"), Run(early))[5:] == ("–", "–")


def test_violations_of_rounding_have_no_exponent():
    """The limit is 1000 units of rounding; the first tenth of the 2 s is left out."""
    limit = 1e3 * np.finfo(float).eps

    def growing(times: list[float], values: list[float]) -> Run:
        return Run({**ended(2.0, "COMPLETED"), "times": times, "violation": values})

    assert paper_teaching.exponent(growing([1.0, 2.0], [limit, limit])) == pytest.approx(0.0, abs=1e-12)
    assert math.isnan(paper_teaching.exponent(growing([1.0, 2.0], [0.99 * limit] * 2)))
    across = growing([1.0, 2.0], [0.5 * limit, 2.0 * limit])
    assert paper_teaching.exponent(across) == pytest.approx(2.0), "the largest violation counts"
    from_tenth = growing([0.1, 0.2, 2.0], [1.0, 1e-6, 1e-3])
    assert paper_teaching.exponent(from_tenth) == pytest.approx(3.0)


def test_numbers_of_the_paper_that_contradict_its_sentences():
    """92.87 s are 1.166 times 79.64 s; 3286 steps are 31.9 times 103; 2428 steps are 1.37 and 1.77 times 1774
    and 1368."""
    said = {row[1]: row[2] for row in paper_misprints._contradictions()}
    assert said["the costs of Gram–Schmidt and SVD do not differ"] == (
        "Table III: 79.64 s by SVD, 92.87 s by Gram–Schmidt, 17 % more"
    )
    assert said["methods with partitioning are cheaper than those without"].endswith("32 times fewer steps")
    assert said["partitioning lengthens steps by 30 %"] == "Table IV: by 37 to 77 %"
    heading, misprints, contradictions = paper_misprints.render()
    assert heading.text == "Misprints found" and isinstance(misprints, Table)
    assert contradictions.header == ("Place", "Sentence", "Its tables")
    assert misprints.header == ("Place", "Printed", "Read as") and len(misprints.rows) == 7


def test_the_paper_s_end_times_are_orange_triangles():
    drawing = paper_sweep.plot({})
    axes = drawing.axes[paper_sweep.COLUMNS.index(HALF_TURN)]
    triangles = axes.lines[-1]
    assert triangles.get_color() == paper_sweep.figures.COLOURS[1] and triangles.get_markersize() == 7
    assert triangles.get_xdata().tolist() == [0.012, 0.037, 0.063], "without those of partitioned rows"
    assert axes.get_title() == "θ₂ = π/2: 0 runs end here, 0 later or never"
    lines = axes.lines[:-1]
    assert {line.get_linewidth() for line in lines} == {0.9} and {line.get_zorder() for line in lines} == {0}
    assert {line.get_color() for line in lines} == {paper_sweep.figures.GREY}
