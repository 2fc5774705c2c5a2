"""The paper's chapter on made-up runs / the order of its parts, its captions, columns and ratios by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
from test_figures_by_hand import plain
from test_paper_figures_by_hand import turning
from test_pictures_by_hand import violated

from crosscheck.paper import settings
from crosscheck.paper.runs import ALPHAS, DUAL, EXACT, HEAVY, PENALTY, SPATIAL_DYNAMIC, Label, Records
from crosscheck.paper.settings import STRICT, TIGHT
from mbref.trajectory import Outcome
from reports import figures
from reports.blocks import Figure, Heading, Table, Text
from reports.runs import Run
from reports.sections import (
    paper,
    paper_cranks,
    paper_figures,
    paper_methods,
    paper_misprints,
    paper_sweep,
    paper_teaching,
)


def run(
    t_end: float, seconds: float = 1.0, error: float = 1e-3, outcome: str = "COMPLETED"
) -> dict[str, Any]:
    """A run of 10 steps."""
    return {**plain("mbref", "x", error, seconds, outcome, t_end), "settings": {}}


def right(table: Table) -> list[str]:
    """The names of the columns of numbers."""
    return [table.header[k] for k in sorted(table.right)]


@pytest.mark.parametrize(
    ("parts", "last"),
    [
        ((), []),
        (("sweep",), ["sweep"]),
        (("pairs",), ["methods"]),
        (("pairs", "sweep"), ["sweep", "methods"]),
    ],
)
def test_the_parts_of_the_chapter(monkeypatch, parts, last):
    """The studies of settings and of methods follow where there are records of them."""

    def stand_in(module: Any, name: str, text: str, records: Any) -> None:
        def render(*given: Any) -> list[Text]:
            assert given == records, name
            return [Text(text)]

        monkeypatch.setattr(module, name, render)

    records: Records = {Label(part, "row", "column"): {} for part in parts}
    monkeypatch.setattr(paper, "score", lambda given: f"score of {len(given)}")
    monkeypatch.setattr(paper, "_table", lambda name, given: [Text(f"table {name} of {len(given)}")])
    monkeypatch.setattr(paper, "_settings", lambda: Text("settings"))
    stand_in(paper, "_counts", "counts", (records,))
    stand_in(paper, "_differences", "differences", (records,))
    stand_in(paper_misprints, "render", "misprints", ())
    stand_in(paper_figures, "render", "figures", (records,))
    stand_in(paper_cranks, "render", "cranks", (records,))
    stand_in(paper_teaching, "render", "teaching", (records,))
    stand_in(paper_methods, "explained", "explained", ("illustration",))
    stand_in(paper_sweep, "render", "sweep", (records,))
    stand_in(paper_methods, "render", "methods", (records,))
    heading, about, score, marks, *others = paper.render(records, "illustration")
    assert heading == Heading("The paper, reproduced", 2)
    assert about.text.startswith("M. A. Neto and J. Ambrósio, Stabilization methods")
    assert score == Text(f"score of {len(parts)}") and marks.text.startswith("A cell states when")
    tables = [f"table {name} of {len(parts)}" for name in ("I", "II", "III")]
    between = ["settings", "counts", "differences", "misprints", "figures", "cranks", "teaching", "explained"]
    assert [block.text for block in others] == [*tables, *between, *last]


def test_the_settings_of_the_chapter():
    table = paper._settings()
    assert table.caption == "The settings of all runs, none chosen for a cell." and table.folded
    assert table.header == ("Setting", "Meaning") and table.rows == list(settings.REASONS.items())


COUNTS = {"one": (100, 8.0), "two": (25, 4.0)}


def counted(part: str, column: str) -> Records:
    """Row one: 10 steps in 2 s, of 2 s CPU time a second; row two: 10 in 0.5 s, of 6 s a second."""
    return {
        Label(part, "one", column): run(2.0),
        Label(part, "two", column): run(0.5, error=2e-3, outcome="VIOLATION"),
        Label("timed", "one", column): run(2.0, 4.0),
        Label("timed", "two", column): run(0.5, 3.0),
    }


ROWS = [
    ("one", "100", "5", "1.000", "1.000", "1.0", "1.0", "20 s", "1.0e-03"),
    ("two", "25", "20", "0.250", "4.000", "0.5", "3.0", "0.5000 s c", "2.0e-03"),
]


def test_steps_and_times_over_those_of_the_first_row():
    assert paper._count_rows("III", "a column", COUNTS, counted("III", "a column")) == ROWS
    tight: Records = {
        Label("tight", row, SPATIAL_DYNAMIC, TIGHT.name): run(t) for row, t in (("one", 2.0), ("two", 8.0))
    }
    added = paper._with_tight(ROWS, tight)
    assert [row[5] for row in added] == ["1.000", "0.250"]
    assert [(*row[:5], *row[6:]) for row in added] == ROWS


def test_the_tables_of_steps(monkeypatch):
    """The strict run takes 10 steps in 0.25 s."""
    monkeypatch.setattr(paper, "COUNTS_III", COUNTS)
    monkeypatch.setattr(paper, "COUNTS_IV", COUNTS)
    monkeypatch.setattr(paper, "FREE", ("one",))
    monkeypatch.setattr(paper, "_kept", lambda records: Text(f"kept of {len(records)}"))
    records = {
        **counted("III", paper.SPATIAL),
        **counted("dynamic", SPATIAL_DYNAMIC),
        Label("strict", "one", paper.SPATIAL, STRICT.name): run(0.25),
        **{Label("tight", row, SPATIAL_DYNAMIC, TIGHT.name): run(4.0) for row in COUNTS},
    }
    third, three, fourth, four, kept = paper._counts(records)
    assert third == Heading("Table III: steps and cost")
    assert fourth == Heading("Table IV: dynamic analysis of the spatial slider-crank")
    assert "With rtol 1e-9 one take 40 steps/s, the paper's 3303" in three.caption
    assert list(three.rows) == ROWS and {len(row) for row in four.rows} == {len(four.header)} == {10}
    assert [row[5] for row in four.rows] == ["1.000", "1.000"] and four.header[5] == "at 1e-9"
    assert right(three) == [name for name in three.header if name not in ("Method", "ended")]
    assert right(four) == [name for name in four.header if name not in ("Method", "ended")]
    assert kept == Text(f"kept of {len(records)}") and not three.folded


def test_the_table_of_kept_partitions(monkeypatch):
    """At 1e-6 5 steps/s without partitioning and 10 with it; other parts and tolerances are left out."""
    monkeypatch.setattr(paper, "KEPT_RTOLS", (1e-6, 1e-7))

    def label(part: str, name: str, rtol: str) -> Label:
        return Label(part, name, SPATIAL_DYNAMIC, f"rtol {rtol}")

    records: Records = {
        label("kept", "partitioning", "1e-06"): run(1.0, error=2e-3, outcome="VIOLATION"),
        label("kept", "none", "1e-06"): run(2.0),
        label("tight", "none", "1e-06"): run(9.0),
        label("kept", "none", "1e-07"): run(0.5),
        label("kept", "none", "1e-08"): run(9.0),
    }
    table = paper._kept(records)
    assert table.rows == [
        ("1e-06", "partitioning", "10", "2.000", "1 s c", "2.0e-03"),
        ("1e-06", "none", "5", "1.000", "20 s", "1.0e-03"),
        ("1e-07", "none", "20", "1.000", "20 s", "1.0e-03"),
    ]
    assert table.folded and right(table) == ["rtol", "Steps/s", "Ratio", "Error"]


# --- methods ----------------------------------------------------------------------------------------------
def test_accelerations_against_the_closed_form(monkeypatch):
    """True accelerations of 4 and 3 rad/s²; those of the run are a quarter larger."""
    asked = []

    def poses(times):
        asked.append(times.tolist())
        return turning((1.0,)).trajectory

    monkeypatch.setattr(paper_methods, "truth_for", lambda scene: SimpleNamespace(poses=poses))
    assert paper_methods._relative_error(turning((1.25,))) == pytest.approx(0.25)
    assert paper_methods._relative_error(turning((-1.0,))) == pytest.approx(2.0)
    assert asked == [[0.0]] * 2 and math.isnan(paper_methods._relative_error(turning(())))


def test_digits_of_both_forms_over_the_penalty(monkeypatch):
    """The dual form does not converge for the second penalty."""
    monkeypatch.setattr(paper_methods, "_relative_error", lambda run: run.error)
    records: Records = {Label("digits", EXACT, ""): run(0.0, error=4e-16)}
    for k, alpha in enumerate(ALPHAS):
        records[Label("digits", PENALTY, f"{alpha:g}")] = run(0.0, error=(k + 1) * 1e-9)
        records[Label("digits", DUAL, f"{alpha:g}")] = run(0.0, error=(k + 1) * 1e-14)
    lost = run(0.0, error=math.nan, outcome="NOT_CONVERGED")
    records[Label("digits", DUAL, f"{ALPHAS[1]:g}")] = lost
    heading, table, figure = paper_methods._digits(records)
    assert heading == Heading("ALF against its dual, digit by digit over α")
    assert table.rows[0] == ("1e+02", "1.0e-09", "1.0e-14", "COMPLETED", "COMPLETED")
    assert table.rows[1] == ("1e+03", "2.0e-09", "–", "COMPLETED", "NOT_CONVERGED")
    assert len(table.rows) == len(ALPHAS) and right(table) == ["α", "ALF", "ALF, dual"]
    assert "the closed form (mpi-svd: 4.0e-16), iterated to ε = 1e-14 or 100 times" in table.caption
    assert (figure.name, figure.caption) == ("paper-alf-digits", "The table above.")
    assert isinstance(figure, Figure) and figure.draw.func is paper_methods.plot_digits
    [errors] = figure.draw.args
    assert list(errors) == [PENALTY, DUAL] and errors[PENALTY][2] == pytest.approx(3e-9)
    monkeypatch.setattr(paper_methods, "_pairs", lambda given: [f"pairs of {len(given)}"])
    first, *others = paper_methods.render(records)
    assert first == f"pairs of {len(records)}" and others[:2] == [heading, table]


def test_the_figure_of_singular_values_and_the_parts_of_the_explanation():
    theta, smallest = [0.5, 0.25], [(0.1, 0.2), (0.3, 0.4)]
    found = {"fold": (0.1, 0.0), "crossings": [], "theta": theta, "smallest": smallest}
    heading, _, crossings, figure, near = paper_methods.explained({**found, "alf_iterations": [[1] * 4] * 6})
    assert heading == Heading("Singular positions explained")
    assert crossings.caption == "Singular positions up to 0.06 s." and near.caption.startswith(
        "Iterations of"
    )
    assert figure.draw.func is paper_methods.plot_values and figure.draw.args == (theta, smallest)


# --- lectures ---------------------------------------------------------------------------------------------
def test_the_section_for_lectures():
    """Each part has its own runs: two tolerances, two gains, six methods."""
    records: Records = {}
    for tolerance in ("1e-04", "1e-05"):
        records[Label("growth", "LM2", SPATIAL_DYNAMIC, tolerance)] = violated(
            [0.0, 1.0, 2.0], [0.0, 1e-6, 2e-6]
        ).record
    for gain, size in (("0", 1e-3), ("5", 1e-5)):
        records[Label("gain", "LM2 + B", SPATIAL_DYNAMIC, gain)] = violated(
            [0.0], [0.0], violation_position=size, violation_velocity=2 * size
        ).record
    for k, row in enumerate(("ALF", "LM2", "LM2 + CP", "ALF + CP", "MPI (SVD)", "MPI (SVD) + CP", "LM1")):
        records[Label("dynamic", row, SPATIAL_DYNAMIC)] = violated(
            [0.0, 1.0], [0.0, 0.5 + k], violation_position=0.5 + k
        ).record
        records[Label("dynamic", row, HEAVY)] = violated([0.0], [9.0]).record
    heading, text, grown, gains, over, remedies, over_time = paper_teaching.render(records)
    assert heading == Heading("For lectures: constraint violation and its remedies")
    assert text.text.startswith("The spatial slider-crank under 100 N m")
    assert [f.name for f in (grown, over, over_time)] == ["paper-growth", "paper-gains", "paper-remedies"]
    assert "; after 2 s: 2.0e-06 at rtol 1e-04, 2.0e-06 at rtol 1e-05. " in grown.caption
    draws = [figure.draw for figure in (grown, over, over_time)]
    assert [draw.func for draw in draws] == [
        paper_teaching.plot_growth,
        paper_teaching.plot_gains,
        paper_teaching.plot_violations,
    ]
    shown = ["LM2", "LM2 + CP", "ALF", "ALF + CP", "MPI (SVD)", "MPI (SVD) + CP"]
    assert [list(draw.args[0]) for draw in draws] == [["1e-04", "1e-05"], ["0", "5"], shown]
    assert [row[:3] for row in gains.rows] == [("0", "1.0e-03", "2.0e-03"), ("5", "1.0e-05", "2.0e-05")]
    assert right(gains) == ["α = β", "Violation", "of velocities", "Error", "Steps/s"]
    assert [row[0] for row in remedies.rows] == shown and remedies.rows[2][1] == "5.0e-01"
    assert right(remedies) == ["Violation", "of velocities", "Error", "Steps/s", "ms CPU per s"]
    assert {len(row) for row in remedies.rows} == {len(remedies.header)}


def test_a_gain_whose_run_ends_early_and_colours_in_turn():
    early = Run({**violated([0.0], [0.0]).record, "outcome": "VIOLATION", "t_end": 0.5})
    assert paper_teaching._gains({"5": early}).rows[0][-1] == f"0.5 s {Outcome.VIOLATION.letter}"
    many = {f"{k}": violated([0.0, 1.0, 2.0], [1e-9, 1e-6, 1e-6]) for k in range(len(figures.COLOURS) + 2)}
    for plot in (paper_teaching.plot_growth, paper_teaching.plot_violations):
        lines = plot(many).axes[0].lines
        assert [line.get_color() for line in lines] == [*figures.COLOURS, *figures.COLOURS[:2]]
        kinds = [line.get_linestyle() for line in lines]
        assert kinds[0] == kinds[len(figures.DASHES)] != kinds[1] == kinds[len(figures.DASHES) + 1]


# --- settings ---------------------------------------------------------------------------------------------
def test_the_section_on_the_influence_of_settings():
    """All cells end after 31.5 ms; a size of the errors has eight draws, two of which end later."""
    records: Records = {
        Label(cell.table, cell.row, cell.column): run(0.0315, outcome="VIOLATION")
        for cell in paper_sweep.SWEPT
    }
    for seed in range(8):
        late = 0.04 if seed > 5 else 0.0315
        label = Label("sized", "ALF", "five-bar", f"1e-09 m, seed {seed}")
        records[label] = run(late, outcome="VIOLATION")
    heading, text, scores, sizes, varied, drawn, figure = paper_sweep.render(records)
    assert heading == Heading("Influence of the settings") and text.text.startswith("An unstabilised run is")
    assert [row[0] for row in scores.rows] == ["the settings", *(v.name for v in settings.SWEEP)]
    assert scores.header[0] == "Varied" and scores.rows[0][4] == str(len(paper_sweep.SWEPT))
    assert list(sizes.header) == ["Errors, m", "Method", *paper_sweep.COLUMNS] and not sizes.right
    assert len(sizes.rows) == 18 and [row[:2] for row in sizes.rows[:3]] == [
        ("1e-13", "MPI (SVD)"),
        ("1e-13", "ALF"),
        ("1e-13", "ALF + CP"),
    ]
    [row] = [row for row in sizes.rows if row[:2] == ("1e-09", "ALF")]
    assert row[2:] == ("–", "–", "–", "0.032 c (6 of 8)") and "among 8 draws" in sizes.caption
    assert "– is 0.12 s reached" in sizes.caption
    assert list(varied.header[3:]) == ["the settings", *(v.name for v in settings.SWEEP)]
    assert list(drawn.header[3:]) == ["seed 0", *(f"seed {k}" for k in range(1, 20))]
    assert drawn.rows[0][3:] == ("0.0315 c", *["–"] * 19) and drawn.folded
    assert drawn.caption.endswith("over draws of first step and data errors.")
    assert figure.name == "paper-failure-times" and figure.caption.startswith("End times over settings")
    assert figure.draw.func is paper_sweep.plot and figure.draw.args == (records,)
