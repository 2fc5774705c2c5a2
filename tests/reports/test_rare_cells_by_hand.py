"""Cells and sentences of a report on runs without an error, a sample or an end / worked out by hand."""

from __future__ import annotations

import math
from typing import Any

import pytest
from matplotlib.colors import to_rgba
from synthetic import scene
from test_figures_by_hand import BLOCK, RECORDS, SCENE, group, moving, of, plain

from crosscheck.paper.cells import Cell
from crosscheck.paper.runs import HEAVY, UNEQUAL, Label
from crosscheck.setting import BRANCHES
from crosscheck.study.stability import Ladder
from mbref.trajectory import Outcome
from reports import benchmark_plot, figures, speed_figure
from reports.blocks import Table
from reports.runs import Run, SceneRuns
from reports.sections import (
    accelerations,
    conformance,
    convergence,
    crossings,
    paper,
    paper_cranks,
    paper_figures,
    paper_sweep,
    provenance,
    published,
    records,
    stability,
    support,
)
from reports.sections.paper_cranks import RAISED

HALF_TURN = "θ₂ = π/2"
RATE = 124.8  # rad/s, of the crank of the paper's linkages


def ended(t_end: float, outcome: str = "VIOLATION", message: str = "") -> Run:
    return Run({**plain("mbref", "x", 1e-3, 1.0, outcome, t_end), "message": message})


def test_the_printed_end_between_two_crossings_and_at_the_start():
    """θ₂ = π/2 - 124.8 t passes 0 at t = π/2/124.8 = 12.59 ms; 20 ms are 0.925 rad after it."""
    assert paper._papers_place(Cell("I", "ALF", HALF_TURN, None, "")) == []
    [start] = paper._papers_place(Cell("I", "ALF", HALF_TURN, 0.0, "a"))
    assert start.startswith("the start is singular")
    [between] = paper._papers_place(Cell("I", "ALF", HALF_TURN, 0.02, "b"))
    assert between == "the printed end is 0.93 rad from a singular position"
    near = (math.pi / 2 + 0.09) / RATE
    assert paper._papers_place(Cell("I", "ALF", HALF_TURN, near, "b")) == []
    far = (math.pi / 2 + 0.11) / RATE
    assert len(paper._papers_place(Cell("I", "ALF", HALF_TURN, far, "b"))) == 1


def test_where_a_linkage_ended():
    """From θ₂ = π/2 the singular positions 0, -π, -2π follow at 12.587, 37.760 and 62.933 ms."""
    done = Run({**plain("mbref", "x", 1e-3, 1.0), "metrics": {"violation_position": 2e-9}})
    assert paper._where(HALF_TURN, done) == "passes every singular position, violation 2.0e-09"
    first, second = math.pi / 2 / RATE, 3 * math.pi / 2 / RATE
    assert paper._where(HALF_TURN, ended(first)) == (
        "ends at θ₂ = 0, singular position 1 of 0.0126, 0.0378, 0.0629 s"
    )
    assert "singular position 2 of 0.0126, 0.0378, 0.0629, 0.0881 s" in paper._where(HALF_TURN, ended(second))
    assert paper._where(HALF_TURN, ended(first + 0.005)) == (
        "ends 0.62 rad from the singular position θ₂ = 0, on a wrong branch"
    )


def test_a_message_stands_for_an_outcome_that_the_paper_has_no_letter_for():
    assert paper._message(ended(0.1, "VIOLATION", "off")) == []
    assert paper._message(ended(0.1, "TIMED_OUT", "the time is up")) == ["the time is up"]
    assert paper._message(Run(plain("mbref", "x", 1e-3, 1.0))) == []


def test_most_frequent_end_of_draws():
    runs = [ended(0.0125), ended(0.1), ended(0.01252), Run(plain("mbref", "x", 1e-3, 1.0))]
    letter = runs[0].outcome.letter
    assert paper_sweep._most([]) == "–"
    assert paper_sweep._most([*runs, ended(0.0131)]) == f"0.013 {letter} (3 of 5)"
    assert paper_sweep._most([runs[3], runs[3], runs[0]]) == "– (2 of 3)"


def test_a_crank_without_a_sample_and_one_with_a_larger_rank_tolerance():
    empty = {
        "times": [],
        "bodies": {"b": {name: [] for name in moving("a", "x", (1.0,)).record["bodies"]["b"]}},
    }
    lost = Run({**moving("a", "x", (1.0,), outcome="STEP_FAILED").record, **empty, "t_end": 0.0})
    shown = paper_cranks._cells(HEAVY, lost)
    assert len(shown) == 8 and set(shown[1:]) == {"–"} and shown[0].startswith("0 s ")
    raised = {**plain("mbref", "x", 2e-5, 1.0, "VIOLATION", 12.3456), "settings": {}}
    label = Label("dynamic", "MPI (SVD)", UNEQUAL, RAISED.name)
    assert paper_cranks._raised({}) == ""
    assert "the motion stays right, error 2.0e-05, until drift ends it at 12.35 s. " in paper_cranks._raised(
        {label: raised}
    )
    assert paper_cranks._passed(UNEQUAL, 1.0) == "–"


def test_a_run_that_ends_early_has_a_mark_at_its_last_sample():
    runs = {
        "whole": moving("a", "x", (1.0, 1.0, 1.0)),
        "short": moving("a", "y", (1.0, 1.0), outcome="VIOLATION"),
    }
    for record_ in (run.record for run in runs.values()):
        record_["bodies"]["b"]["angular_velocity"] = [
            [0.0, 0.0, 2.0 + k] for k in range(len(record_["times"]))
        ]
    runs = {name: Run(run.record) for name, run in runs.items()}
    whole, short, mark = paper_figures.plot_rates(runs).axes[0].lines
    assert whole.get_xydata().tolist() == [[0.0, 2.0], [0.5, 3.0], [1.0, 4.0]]
    assert short.get_xydata().tolist() == [[0.0, 2.0], [0.5, 3.0]]
    assert mark.get_xydata().tolist() == [[0.5, 3.0]] and mark.get_color() == short.get_color()
    assert [line.get_label() for line in (whole, short)] == ["whole", "short"]


def test_commits_and_dates_of_records():
    made = [
        Run({"commit": "abc", "date": "2026-05-02T10:00:00"}),
        Run({"commit": "abc", "date": "2026-04-01T10:00:00"}),
    ]
    assert provenance._made([]) == "" and provenance._made([Run({"commit": "abc"})]) == ""
    assert provenance._made(made) == " of commit abc, 2026-04-01 to 2026-05-02"
    assert provenance._made([made[0]] * 2) == " of commit abc, 2026-05-02"
    assert provenance._made([Run({"date": "2026-05-02"})]) == " of 2026-05-02"
    assert provenance._timing([ended(0.5)]) == "No run completed."
    timed = [Run({**plain("a", "x", 1e-3, 1.0), "timing": {"repeats": k}}) for k in (5, 3)]
    assert "the least of 3 or 5 runs;" in provenance._timing([*timed, ended(0.5)])
    assert "the least of 1 runs;" in provenance._timing([Run(plain("a", "x", 1e-3, 1.0))])


def test_a_published_problem_that_a_run_does_not_finish():
    frame = scene("h_frame")
    early = Run({**plain("a", "x", None, 0.25, "STEP_FAILED", 0.01234, step=0.1), "scene": frame.name})
    group_ = SceneRuns(frame, [early])
    assert published._row(group_, early) == ("a", "x", "step=0.1", "–", "ended at 0.0123 s", "250 ms")


def test_no_errors_no_speed_figure():
    assert speed_figure.speed_svg(group((plain("a", "x", None, 1.0),)), "") == ""
    assert "<svg" in speed_figure.speed_svg(group((plain("a", "x", 1e-3, 1.0),)), "")


def test_a_suite_without_violations_and_the_worst_of_several():
    def violation(measured: float, allowed: float, scene: str) -> dict[str, Any]:
        named = {"property": "p", "card": "a check", "scene": scene, "reason": "a reason"}
        return {**named, "measured": measured, "allowed": allowed}

    assert [b.text for b in conformance._drawn_violations([{"engine": "a", "violations": []}])] == [
        "No random mechanism violates a check."
    ]
    found = [violation(4.0, 2.0, "s1"), violation(3.0, 1.0, "s2"), violation(5.0, 4.0, "s3")]
    [table] = conformance._drawn_violations([{"engine": "no_engine", "violations": found}])
    [row] = table.rows
    assert row[1:4] == ("a check", "3", "s2") and row[6:] == ("a reason", "–")
    assert [float(cell) for cell in row[4:6]] == [3.0, 1.0] and table.right == {2, 4, 5}


def crossing(time: float) -> dict[str, Any]:
    return {"time": time, "sentence": f"two at {time}", "taken": 1}


def test_singular_positions_of_the_most_accurate_run():
    several = [crossing(0.01 * k) for k in range(1, 14)]
    runs = [
        {**plain("a", "x", 1e-3, 1.0), "crossings": [crossing(0.5)]},
        {**plain("b", "y", 1e-6, 1.0), "crossings": several},
        {**plain("c", "z", 1e-9, 1.0), "crossings": []},
        {**plain("d", "w", 1e-9, 1.0, "STEP_FAILED", 0.5), "crossings": several},
    ]
    table = of(Table, crossings.render(group(tuple(runs))))
    assert "passed by b y;" in table.caption and table.caption.endswith(" The first 12 of 13.")
    assert [row[:2] for row in table.rows][::11] == [("1", "0.01"), ("12", "0.12")]
    assert table.rows[0][2:] == ("two at 0.01", "1")
    runs[1]["crossings"] = several[:12]
    assert "The first" not in of(Table, crossings.render(group(tuple(runs)))).caption
    assert crossings.render(group((runs[2],))) == []


@pytest.mark.parametrize(
    ("marks", "said"),
    [
        ({}, None),
        ({"A": [0, 1, 0], "B": [0, 0, 0]}, "of the reactions of A at t = 0.5 s than elsewhere."),
        ({"A": [1, 1, 2], "B": [0, 3, 0]}, "of the reactions of A, B at t = 0.5, 1 s than elsewhere."),
        ({"A": [1, 1, 1]}, "No sample lies so near a singular position"),
        ({"A": []}, "No sample lies so near a singular position"),
    ],
)
def test_samples_with_fewer_reactions(marks, said):
    run = Run({**plain("a", "x", 1e-3, 1.0), "times": [0.0, 0.5, 1.0], "open_reactions": marks})
    found = list(crossings._open_reactions(run))
    assert (said is None and not found) or said in found[0], found


def test_title_of_a_branch():
    asked = {"engine": "a", "options": {BRANCHES: [[2, 1]]}}
    run = {**plain("a", "x", 1e-3, 1.0), "asked": asked}
    assert crossings._asked(run) == (2, 1) and crossings._title(run) == "Branch 1, smooth"
    asked["options"][BRANCHES] = [[2, 3]]
    assert crossings._title({**run, "outcome": "STEP_FAILED", "t_end": 0.123456}) == (
        "Branch 3; ended at t = 0.1235 s: STEP_FAILED"
    )


def test_no_accelerations_of_bodies_without_masses_or_without_samples():
    massless = SCENE.with_(body=(BLOCK.model_copy(update={"mass": None, "inertia": None}),))
    run = moving("a", "x", (1.0, 1.0))
    assert accelerations.render(SceneRuns(massless, [run])) == []
    assert accelerations.render(SceneRuns(SCENE, [run])) == [], "a run without accelerations"


def test_benchmark_plot_shows_the_least_cost_of_each_engine():
    """Two families of b: the least cost at each level; at 1e-9 only a has one."""
    curves = [
        {"engine": "a", "cost": [0.002, None, 0.5]},
        {"engine": "b", "cost": [0.003, 0.004, None]},
        {"engine": "b", "cost": [0.001, 0.008, None]},
    ]
    limit = {"engine": "limit", "cost": [0.0005, 0.0006, 0.0007]}
    data = {
        "scenes": {
            "first_scene": {"levels": [1e-3, 1e-6, 1e-9], "curves": [*curves, limit]},
            "second": {"levels": [1e-3, 1e-6, 1e-9], "curves": curves[:1]},
        }
    }
    figure = benchmark_plot.draw(data)
    points = [
        {line.get_label(): line.get_xydata().round(9).tolist() for line in axes.lines} for axes in figure.axes
    ]
    assert points == [
        {"a": [[-0.06, 2.0], [0.94, 2.0]], "b": [[0.0, 1.0]], "limit": [[0.06, 0.5]]},
        {"b": [[0.0, 4.0]], "limit": [[0.06, 0.6]]},
        {"a": [[-0.06, 500.0], [0.94, 500.0]], "limit": [[0.06, 0.7]]},
    ]
    assert [axes.get_ylabel() for axes in figure.axes] == ["ms at 1e-3", "ms at 1e-6", "ms at 1e-9"]
    assert {axes.get_yscale() for axes in figure.axes} == {"log"}
    names = [label.get_text() for label in figure.axes[-1].get_xticklabels()]
    assert names == ["first scene", "second"] and figure.axes[-1].get_xticks().tolist() == [0, 1]
    angles = {(label.get_rotation(), label.get_ha()) for label in figure.axes[-1].get_xticklabels()}
    assert angles == {(30.0, "right")}, "names below the last panel"
    marks = {line.get_label(): line.get_marker() for line in figure.axes[0].lines}
    assert marks["limit"] == "_" and len(set(marks.values())) == 3
    colours = {line.get_label(): line.get_color() for line in figure.axes[0].lines}
    assert colours == {"limit": figures.GREY, "a": figures.colour("a"), "b": figures.colour("b")}
    assert "CPU milliseconds per simulated second" in figure.axes[0].get_title()
    [legend] = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["a", "b", "limit"]


def test_bias_outweighs_discretisation_beyond_five_times_it():
    weighed = [convergence._heavier(bias, 0.25) for bias in (1.5, 1.25, 0.25, 0.125)]
    assert weighed == ["bias", "–", "–", "discretisation"]


def stepping(family: str, errors: dict[float, float], a_group: str = "a") -> list[dict[str, Any]]:
    return [plain(a_group, family, error, 1.0, step=step) for step, error in errors.items()]


def test_slopes_over_a_step_and_their_caption():
    """Errors h² and 3 h⁴ on three steps; two runs, equal errors and failures give no slope."""
    squares = stepping("two", {h: h**2 for h in (0.1, 0.05, 0.025)})
    fourths = stepping("four", {h: 3 * h**4 for h in (0.1, 0.05, 0.025)})
    short = stepping("short", {0.1: 1e-2, 0.05: 1e-3})
    level = stepping("level", dict.fromkeys((0.1, 0.05, 0.025), 1e-9))
    lost = [
        {**record, "outcome": "STEP_FAILED"} for record in stepping("lost", {h: h for h in (0.1, 0.2, 0.3)})
    ]
    groups = [group((*squares, *fourths, *short, *level, *lost))]
    curves = sorted(groups[0].curves())
    assert [convergence._row(groups, curve) for curve in curves] == [
        ("a", "four", "step", "4"),
        ("a", "level", "step", "–"),
        ("a", "lost", "step", "–"),
        ("a", "short", "step", "–"),
        ("a", "two", "step", "2"),
    ]
    assert convergence._caption(groups, curves) == "Slopes from 2 (a two, block) to 4 (a four, block)."
    tight = tuple(plain("a", "x", e, 1.0, rtol=e) for e in (1e-3, 1e-4, 1e-5))
    heading, _, table = convergence.render([group(tight)])
    assert table.right == {3} and table.header == ("Engine", "Family", "Over", "block")
    assert tuple(table.rows[0]) == ("a", "x", "rtol", "1") and (heading.text, heading.level) == (
        "Order of convergence",
        2,
    )
    assert convergence._caption([group(tuple(squares))], [("a", "two")]) == "One slope: 2 (a two, block)."
    assert convergence._caption([group(tuple(short))], [("a", "short")]) == (
        "No family has three runs on a line."
    )


def test_the_option_that_varies_is_the_first_number_that_does():
    runs = [
        Run(plain("a", "x", 1e-3, 1.0, solver=s, size=2.0, rtol=r)) for s, r in (("p", 1e-3), ("q", 1e-4))
    ]
    assert convergence.swept_option(runs) == "rtol"
    assert convergence.swept_option(runs[:1]) is None and convergence.swept_option([]) is None


def test_a_card_has_the_numbers_and_the_origin_of_its_run():
    measured = {"violation_position": 2e-9, "energy_error": 3e-5, "reaction_error": None}
    asked = {"engine": "a", "options": {"rtol": 1e-3}, "samples": 3, "end": 1.0}
    made = {"commit": "abc", "date": "2026-05-02", "machine": {"cpu": "a processor"}, "message": "the matrix"}
    made["asked"] = asked
    whole = {
        **RECORDS[0],
        **made,
        "key": "0123456789abcdef",
        "metrics": {**RECORDS[0]["metrics"], **measured},
    }
    card = records._card(group(), Run(whole))
    assert card.numbers == {
        "Error": "2.00e-02",
        "Time of stepping": "500 ms",
        "Outcome": "completed, t = 1 s",
        "Joints open by": "2.0e-09",
        "Energy is off by": "3.0e-05",
        "Reactions are off by": "–",
    }
    assert card.made == "record 0123456789ab, a 1, commit abc, made 2026-05-02, on a processor"
    assert (card.place, card.settings, card.message) == ("k-0123456789ab", "rtol=0.001", "the matrix")
    assert card.command.startswith("crosscheck run scenes/block.toml --engine a --setting x")
    lost = {**RECORDS[7], **made, "commit": None, "cost": {"seconds": 0.0, "steps": 0}}
    card = records._card(group(), Run(lost))
    assert card.numbers["Time of stepping"] == card.numbers["Error"] == "–"
    assert card.numbers["Outcome"] == "timed out, t = 0.5 s" and "commit" not in card.made
    _, text, *blocks = records.render([group(tuple({**r, **made} for r in RECORDS))])
    assert [len(block.cards) for block in blocks] == [3, 4, 1] and "repeats its run" in text.text


def test_support_of_the_engines_that_have_records():
    known, unknown = (plain(name, "x", 1e-3, 1.0) for name in ("mbref", "a"))
    assert support.render([group((unknown,))]) == []
    heading, table, *reasons = support.render([group((unknown, known))])
    assert (
        heading.text == "Support"
        and table.header == ("Feature", "mbref")
        and table.caption == support.CAPTION
    )
    assert {len(row) for row in table.rows} == {2} and {row[1][:1] for row in table.rows} <= {"✓", "–"}
    assert [text.text[:3] for text in reasons] == [f"{i}. " for i in range(1, len(reasons) + 1)]


def test_runs_of_a_method_are_right_or_ended_or_false():
    """Of four runs on two ladders two are right, one ends early, and one is false."""
    ends = {"gap[1]": ("COMPLETED", 1e-9), "gap[2]": ("COMPLETED", 0.5), "mass[1]": ("STEP_FAILED", 0.5)}
    ends["mass[2]"] = ("COMPLETED", 1e-9)
    records = [
        {**plain("mujoco", "x", e, 1.0, outcome), "scene": name} for name, (outcome, e) in ends.items()
    ]
    found = stability._runs(records)
    curve = ("mujoco", "x")
    shown = [Ladder("gap", "", "", ()), Ladder("mass", "", "", ())]
    assert stability._counts(shown, found) == {curve: stability.Count(2, 1, 1)}
    assert stability._counts(shown[:1], found) == {curve: stability.Count(1, 0, 1)}


def test_sentences_of_the_ladders_need_taylor_and_another_method():
    one, two = stability.Count(3, 1, 0), stability.Count(2, 1, 1)
    taylor, other = ("mbref", "taylor"), ("mujoco", "projected")
    assert (
        stability._results({}) == stability._results({taylor: one}) == stability._results({other: two}) == []
    )
    better = ("mbref", "mpi-svd+none")
    first, second = stability._results({taylor: one, other: two, better: stability.Count(3, 0, 0)})
    assert first == "Of 4 runs by taylor 3 are right, 1 ended early, and 0 completed with a wrong motion."
    assert second.startswith("Of the others, mpi-svd+none is right most often (3 of 3 runs), and mujoco")
    assert second.endswith("projected completes wrong motions most often (1 of 4).")
    table = stability._table({taylor: one, other: two})
    assert [tuple(row) for row in table.rows] == [
        ("mbref", "taylor", "3", "1", "0"),
        ("mujoco", "projected", "2", "1", "1"),
    ]
    assert table.header == ("Engine", "Method", "Right", "Ended", "False") and table.right == {2, 3, 4}


@pytest.mark.parametrize(
    ("engine", "error", "is_false"),
    [("mbref", 1.1e-6, True), ("mbref", 0.9e-6, False), ("mujoco", 0.011, True), ("mujoco", 1e-2, False)],
)
def test_a_false_success_of_mbref_is_a_smaller_error(engine, error, is_false):
    assert pytest.approx(1e-6) == stability.ALLOWED
    assert stability.is_false(plain(engine, "x", error, 1.0)) is is_false
    assert not stability.is_false(plain(engine, "x", error, 1.0, "STEP_FAILED", 0.5))
    assert stability.is_false(plain(engine, "x", math.nan, 1.0)), "an unknown error is no success"


def test_end_times_of_the_sweep_in_their_panels():
    """A cell of the paper has one bar at its end, a triangle at the printed time, and lines at crossings."""
    label = Label("I", "MPI (SVD)", HALF_TURN, "the settings")
    record = {**plain("mbref", "x", 1e-3, 1.0, "VIOLATION", 0.0378), "settings": {}}
    late = {**record, "t_end": 0.2}
    last = {**record, "t_end": 0.15}
    other = next(cell for cell in paper_sweep.SWEPT if cell.row == "ALF" and cell.column == HALF_TURN)
    second = Label("I", "ALF", HALF_TURN, label.variant)
    third = Label("I", "MPI (GS)", HALF_TURN, label.variant)
    drawing = paper_sweep.plot({label: record, second: late, third: last})
    assert drawing.get_size_inches().tolist() == [7.4, 7.0] and len(drawing.axes) == len(paper_sweep.COLUMNS)
    axes = drawing.axes[paper_sweep.COLUMNS.index(HALF_TURN)]
    assert axes.get_title() == f"{HALF_TURN}: 2 runs end here, 1 later or never"
    assert axes.title.get_fontsize() == 9
    [bar, _] = [patch for patch in axes.patches if patch.get_height()]
    assert bar.get_x() <= 0.0378 <= bar.get_x() + bar.get_width() and bar.get_width() == pytest.approx(1e-3)
    assert bar.get_facecolor() == to_rgba(figures.COLOURS[0])
    *crossings_, triangles = axes.lines
    assert triangles.get_marker() == "^" and set(triangles.get_ydata()) == {0.0}
    assert not triangles.get_clip_on()
    assert other.end is None or other.end in triangles.get_xdata()
    assert [line.get_xdata()[0] for line in crossings_][:2] == pytest.approx(
        [math.pi / 2 / RATE, 3 * math.pi / 2 / RATE]
    )
    assert [line.get_linestyle() for line in crossings_][:3] == [":", "--", ":"], "odd multiples are dashed"
    assert drawing.axes[-1].get_xlabel() == "end time (s)" and axes.get_ylabel() == "runs"


def test_cells_of_end_times():
    run = Run(plain("mbref", "x", 1e-3, 1.0))
    assert paper_sweep._text(None) == "–" and paper_sweep._text(run) == "20"
    assert paper_sweep._text(ended(0.012345)) == f"0.0123 {ended(0.1).outcome.letter}"
    assert paper_sweep._text(ended(0.5, "TIMED_OUT")) == "0.5000 TIMED_OUT"


def test_scores_and_times_of_the_sweep():
    """All cells but one have the printed outcome and time, that one the outcome at another time."""
    letters = {outcome.letter: outcome.label for outcome in Outcome if outcome.letter}
    first, second = (c for c in paper_sweep.SWEPT if c.column == HALF_TURN and c.row in ("ALF", "MPI (SVD)"))
    cells = {Label(c.table, c.row, c.column, "the settings"): c for c in paper_sweep.SWEPT}
    records_ = {
        label: {
            **plain(
                "mbref", "x", 1e-3, 1.0, letters[cell.letter], (cell.end or 0.0) + 0.02 * (cell == second)
            ),
            "settings": {},
        }
        for label, cell in cells.items()
    }
    count = len(paper_sweep.SWEPT)
    table = paper_sweep._scores(records_)
    assert tuple(table.rows[0]) == ("the settings", str(count - 1), "1", "0", str(count))
    assert {tuple(row[1:]) for row in table.rows[1:]} == {("0", "0", "0", "0")} and table.right == {
        1,
        2,
        3,
        4,
    }
    times = paper_sweep._times(records_, "settings", ("the settings", "another", "seed 0"))
    assert times.header == ("Column", "Method", "Paper", "the settings", "another", "seed 0") and times.folded
    rows = {(row[0], row[1]): row for row in times.rows}
    shown = f"{first.end:.4f} {first.letter}"
    assert rows[first.column, first.row][2:] == (str(first), shown, "–", shown)
    assert len(times.rows) == count and times.caption.startswith("End time (s) and letter of every cell over")
    sizes = paper_sweep._sizes({})
    assert {cell for row in sizes.rows for cell in row[2:]} == {"–"}
    sized = Label("sized", sizes.rows[0][1], HALF_TURN, f"{sizes.rows[0][0]} m, seed 0")
    row = paper_sweep._sizes({sized: next(iter(records_.values()))}).rows[0]
    assert row[2 + paper_sweep.COLUMNS.index(HALF_TURN)].endswith("(1 of 1)")


@pytest.mark.parametrize(
    ("error", "expected"), [(2.0, 0.0), (1.5, 0.0), (1.0, 0.0), (0.1, 1.0), (1e-5, 5.0), (math.nan, 0.0)]
)
def test_the_number_of_correct_digits(error, expected):
    assert stability._digits(error) == pytest.approx(expected)
    assert stability._digits(0.0) == stability._digits(1e-30) == stability.MOST_DIGITS
