"""Parts of a report on plain records / ends of ranges, cells, captions and pictures worked out by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from test_figures_by_hand import BLOCK, SCENE, group, moving, of, plain

from crosscheck.setting import BRANCHES
from crosscheck.study import stability as ladders
from mbref.drawing.picture import Form, Look, names, signs
from mbref.drawing.svg import GREY
from mbref.scene import Revolute
from reports import figures, mechanisms, runs, stored, time_series
from reports.blocks import Table
from reports.runs import Run, SceneRuns, by_scene
from reports.sections import accelerations, crossings, least_errors, outcomes, provenance, stability, verdict


# --- runs -------------------------------------------------------------------------------------------------
def run(error: float | None, outcome: str = "COMPLETED", t_end: float = 1.0, **changes: Any) -> Run:
    return Run({**plain("a", "x", error, 0.5, outcome, t_end), **changes})


def test_limits_of_false_successes_and_of_tolerances():
    """1e-2 is not yet wrong, 100 times the tolerance not yet short of it."""
    assert [run(e).is_false_success for e in (1e-2, 1.01e-2)] == [False, True]
    asked = {"settings": {"rtol": 0.25}}
    assert [run(e, **asked).is_short_of_tolerance for e in (25.0, 25.5)] == [False, True]
    assert not run(1e9).is_short_of_tolerance, "no tolerance was asked for"
    assert not run(26.0, "STEP_FAILED", **asked).is_short_of_tolerance


def test_costs_per_second_of_motion():
    assert run(0.1, t_end=4.0).rate("steps") == 2.5 and run(0.1, t_end=4.0).rate("rhs") == 10.0
    assert math.isnan(run(0.1, t_end=0.0).rate("steps"))


def test_numbers_of_cells():
    assert [runs.duration(s) for s in (1.0, 0.999, 1e-3, 0.999e-3, 1e-6, 4e-8)] == [
        "1 s",
        "999 ms",
        "1 ms",
        "999 µs",
        "1 µs",
        "0.04 µs",
    ]
    assert [runs.power(x) for x in (0.0, 0.0213, math.nan, math.inf)] == ["0", "2.1e-02", "–", "–"]
    small = [runs.beyond_rounding(x) for x in (0.0, 0.9e-11, 1e-11, 2e-11)]
    assert small == ["0", "< 1e-11", "1.0e-11", "2.0e-11"]
    assert [runs.number(x) for x in (3.14159, math.inf)] == ["3.1", "–"] and runs.number(
        3.14159, 4
    ) == "3.142"
    assert [runs.ratio(x) for x in (2.345, math.nan)] == ["2.3", "–"]
    assert [runs.short(x) for x in (1e-3, 1e-12)] == ["1e-3", "1e-12"]
    assert [runs.plain(x) for x in (1e-6, 3, "x", True)] == ["1e-06", "3", "x", "True"]
    assert runs.ended_briefly(run(0.1, "VIOLATION", 0.123456)) == "0.1235 s c"
    assert runs.ended_briefly(run(0.1, "TIMED_OUT", 0.5)) == "0.5 s TIMED_OUT"


def test_the_best_run_of_a_curve():
    """Completed before failed; then the least error, or the latest end; an unknown error is the worst."""
    early, late = (run(None, "STEP_FAILED", t, step=k) for k, t in enumerate((0.25, 0.75)))
    unknown, poor, good = (run(e, step=k) for k, e in enumerate((None, 0.5, 0.25)))
    several = SceneRuns(SCENE, [early, unknown, poor, good, late])
    assert several.best() == {("a", "x"): good} and several.completed() == [unknown, poor, good]
    assert SceneRuns(SCENE, [early, late]).best() == {("a", "x"): late}
    assert SceneRuns(SCENE, [unknown, early]).best() == {("a", "x"): unknown}
    ordered = sorted([unknown, poor, good], key=lambda r: r.by_error)
    assert ordered == [good, poor, unknown]


def test_records_of_a_scene_stand_together():
    """Scenes without runs are left out, records of other scenes, too; each kind of record has its place."""
    other, third = SCENE.with_(name="other"), SCENE.with_(name="third")
    records = [
        {**plain("a", "x", 0.1, 1.0), "scene": name, "key": name} for name in ("third", "block", "far")
    ]
    more = [{"scene": name, "kind": "", "of": k} for k in range(4) for name in ("block", "third")]
    gates, truths, motions, branches = (more[2 * k : 2 * k + 2] for k in range(4))
    scenes = {scene.name: scene for scene in (SCENE, other, third)}
    first, second = by_scene(records, scenes, gates, truths, motions, branches)
    assert (first.scene, second.scene) == (SCENE, third)
    assert [r.record for r in first.runs] == [records[1]] and [r.record for r in second.runs] == [records[0]]
    kinds = (first.gate, [first.truth], [first.motion], first.branches)
    assert [list(kind) for kind in kinds] == [[gates[0]], [truths[0]], [motions[0]], [branches[0]]]
    assert first.differences == {}, "a truth without a kind"


def test_records_are_ordered_by_engine_and_from_coarse_to_fine():
    def record(engine: str, family: str, **options: Any) -> dict[str, Any]:
        return {"engine": engine, "family": family, "asked": {"options": options}}

    given = [
        record("theirs", "x", step=0.1),
        record("mujoco", "b", step=0.01, solver="p"),
        record("mujoco", "b", step=0.1, solver="p"),
        record("mujoco", "a", step=0.001),
        record("mbref", "z", rtol=1e-3),
    ]
    assert [given.index(r) for r in stored._ordered(given)] == [4, 3, 2, 1, 0]


# --- figures ----------------------------------------------------------------------------------------------
def test_colours_of_engines_are_those_of_their_order():
    first, second, *_ = figures.engine_names()
    assert [figures.colour(name) for name in (first, second)] == list(figures.COLOURS[:2])
    assert figures.colour("theirs") == figures.COLOURS[-1]


def test_a_plot_over_time_has_a_panel_for_each_label():
    """Sizes, a mark every eighth of the samples, and a cross at an early end; zero and NaN."""
    whole = moving("a", "x", (1.0,) * 17)
    early = moving("b", "y", (1.0, 1.0), outcome="STEP_FAILED")
    both = SceneRuns(SCENE, [whole, early])
    values = {("a", "x"): [np.full(17, -2.0), np.zeros(17)], ("b", "y"): [np.array([np.nan, 5.0])] * 2}
    figure = time_series.plot(both, values, ("one", "two"))
    assert figure.get_size_inches().tolist() == pytest.approx([7.2, 5.7])
    first, second = figure.axes
    assert [axes.get_ylabel() for axes in figure.axes] == ["one", "two"]
    assert (first.get_xlabel(), second.get_xlabel()) == ("", "t (s)")
    assert {axes.get_yscale() for axes in figure.axes} == {"log"}
    lines = [line.get_ydata().tolist() for line in second.lines]
    assert lines[0] == [1e-17] * 17 and math.isnan(lines[1][0]) and lines[1][1] == 5.0 and lines[2] == [5.0]
    assert first.lines[0].get_ydata().tolist() == [2.0] * 17, "magnitudes"
    assert [line.get_markevery() for line in first.lines[:2]] == [2, 1]
    assert [line.get_markersize() for line in first.lines] == [3.5, 3.5, 8]
    assert first.lines[2].get_xdata().tolist() == [0.5] and first.lines[2].get_marker() == figures.FAILED
    assert first.lines[2].get_color() == first.lines[1].get_color()
    [legend] = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["a x", "b y"]
    small = {("a", "x"): [np.array([-3.0, 1.0]), np.array([9.0])], ("b", "y"): [np.array([2.0]), np.zeros(1)]}
    assert time_series.largest(small) == ((("b", "y"), 2.0), (("a", "x"), 3.0))
    assert time_series.largest(small, 1) == ((("b", "y"), 0.0), (("a", "x"), 9.0))


# --- pictures of mechanisms -------------------------------------------------------------------------------
@pytest.fixture
def drawn(monkeypatch) -> list[dict[str, Any]]:
    """The arguments of each picture."""
    asked: list[dict[str, Any]] = []

    def picture(scene, panels, words, timeline=None, view=None, form=None, shown=()) -> str:
        asked.append(
            {
                "scene": scene,
                "panels": panels,
                "words": words,
                "timeline": timeline,
                "form": form,
                "shown": shown,
                "view": view,
            }
        )
        return f"<svg>{words}</svg>"

    monkeypatch.setattr(mechanisms, "picture", picture)
    return asked


def test_a_run_in_front_of_the_true_motion(drawn):
    """The true motion is grey, 9 px thick and pale; the run has its engine's colour and 3.5 px."""
    exact, other = (moving("a", "x", speeds).trajectory for speeds in ((1.0, 1.0, 1.0), (1.0, 2.0)))
    assert mechanisms.over_truth(SCENE, exact, other, "mujoco") == "<svg>The mechanism block in motion</svg>"
    mechanisms.over_truth(SCENE, exact, None, "")
    [panel], [alone] = drawn[0]["panels"], drawn[1]["panels"]
    assert [layer.look for layer in panel.layers] == [
        Look(GREY, 9.0, 0.45),
        Look(figures.colour("mujoco"), 3.5, 1.0),
    ]
    assert [layer.motion for layer in panel.layers] == [exact, other]
    assert [layer.motion for layer in alone.layers] == [exact] and alone.layers[0].look == Look(
        GREY, 9.0, 0.45
    )
    assert {len(layer.more) for layer in (*panel.layers, *alone.layers)} == {0}
    assert drawn[0]["form"] == Form(480.0, 34.0, 330.0) and drawn[0]["shown"] == [exact]
    assert drawn[0]["timeline"].times.tolist() == [0.0, 0.5, 1.0] and not drawn[0]["timeline"].marks


def test_branches_over_the_first_of_them(drawn):
    first, second = (moving("a", "x", speeds).trajectory for speeds in ((1.0, 1.0), (1.0, 2.0, 3.0)))
    titles = mechanisms.branches(SCENE, {"Branch 1": first, "Branch 2": second}, 0.25, "mbref")
    assert titles == {f"Branch {k}": f"<svg>block: Branch {k}</svg>" for k in (1, 2)}
    for asked, motion in zip(drawn, (first, second), strict=True):
        [panel] = asked["panels"]
        assert [layer.motion for layer in panel.layers] == [first, motion]
        assert asked["shown"] == [first, second] and asked["form"] == Form(420.0, 40.0, 300.0)
        assert asked["timeline"].marks == (0.25,) and len(asked["timeline"].times) == 3, "the longest"


def test_the_picture_of_runs_side_by_side(drawn):
    exact = moving("a", "x", (1.0, 1.0, 1.0)).trajectory
    whole = moving("a", "x", (1.0, 1.0), settings={"rtol": 1e-6, "step": 0.125, "solver": "p"})
    early = moving("b", "y", (1.0, 1.0), settings={}, outcome="STEP_FAILED", message="it stopped")
    mechanisms.compared(SCENE, exact, [whole, early], [0.25, 0.75])
    [asked] = drawn
    assert asked["words"] == "block in a x and b y, over the true motion"
    assert [panel.title for panel in asked["panels"]] == [
        ["a x, rtol 1e-06, step 0.12", "largest error 1.0e-03"],
        ["b y, ", "it stopped"],
    ]
    assert [[layer.motion for layer in panel.layers] for panel in asked["panels"]] == [
        [exact, whole.trajectory],
        [exact, early.trajectory],
    ]
    assert [layer.look for layer in asked["panels"][0].layers] == [Look(GREY, 9.0, 0.45), Look("", 3.5, 1.0)]
    assert asked["form"] == Form(360.0, 30.0, 240.0, 13, 2) and asked["shown"] == [exact]
    assert asked["timeline"].marks == (0.25, 0.75) and asked["timeline"].label == "singular positions"


def test_eight_poses_and_the_paths_of_all_bodies(drawn):
    motion = moving("a", "x", (1.0,) * 29).trajectory
    mechanisms.poses(SCENE, motion)
    [panel] = drawn[0]["panels"]
    assert [layer.motion.times[0] for layer in panel.layers] == [2.0 * k for k in range(8)]
    assert [layer.look.thickness for layer in panel.layers] == [2.5] * 7 + [5.0]
    assert panel.layers[-1].more == (signs, names) and drawn[0]["form"] == Form()
    assert [path.shape for path in panel.paths] == [(12 * 29, 3)] and drawn[0]["shown"] == [motion]
    assert drawn[0]["words"] == "block: poses" and drawn[0]["timeline"] is None


def test_poses_of_motions_side_by_side(drawn):
    """Three panels share 900 px."""
    motion = moving("a", "x", (1.0,) * 9).trajectory
    motions = {name: (f"line {name}", motion) for name in ("one", "two", "three")}
    mechanisms.poses_side_by_side(SCENE, motions, 5)
    [asked] = drawn
    assert asked["form"] == Form(300.0, 26.0, 420.0, 13, 3)
    assert asked["words"] == "block: poses of one, two, three"
    assert [panel.title for panel in asked["panels"]] == [[name, f"line {name}"] for name in motions]
    for panel in asked["panels"]:
        assert [layer.motion.times[0] for layer in panel.layers] == [0.0, 1.0, 2.0, 3.0, 4.0]
        assert [layer.look.thickness for layer in panel.layers] == [2.0] * 4 + [4.0]
        assert not any(layer.more for layer in panel.layers)


# --- sections ---------------------------------------------------------------------------------------------
def test_cells_of_a_ladder():
    """9 of 15 digits have six tenths of the colour; letters and false successes have none."""

    def cell(error: float, outcome: str = "COMPLETED", engine: str = "mbref") -> tuple[str, str, float]:
        found = stability._cell(plain(engine, "x", error, 1.0, outcome))
        return found.text, found.kind, found.depth

    assert cell(1e-9) == ("9", "kept", pytest.approx(0.6)) and cell(1e-7)[2] == pytest.approx(7 / 15)
    assert cell(1e-6)[1] == "kept" and cell(2e-6) == ("6", "false", 0.0)
    assert cell(2e-6, engine="mujoco")[1] == "kept"
    ends = ("SINGULAR_MATRIX", "SINGULAR_POSITION", "UNDECIDED", "LEFT_MOTION", "TIMED_OUT", "CRASHED")
    assert [cell(1e-9, end) for end in ends] == [(letter, "ended", 0.0) for letter in "asumtx"]
    assert stability._letter("NOT_FINITE") == "n" and stability._cell(None).kind == ""
    digits = [stability._digits(e) for e in (math.nan, 2.0, 1.0, 0.1, 1e-15, 1e-20, 0.0)]
    assert digits == pytest.approx([0, 0, 0, 1, 15, 15, 15])
    assert (stability._name(("mbref", "x")), stability._name(("mujoco", "x"))) == ("x", "mujoco x")


def test_methods_of_mbref_come_first_in_their_order():
    first, second, *_ = stability.METHODS
    made = [("mujoco", "x"), ("mbref", second), ("mbref", first)]
    records = [{"engine": e, "family": f, "scene": stability_scene()} for e, f in made]
    [found] = stability._runs(records).values()
    assert list(found) == made[::-1]


def stability_scene() -> str:
    [name, *_] = [scene.name for scene in ladders.scenes()]
    return name


def test_an_estimate_at_the_bound_of_the_truth_is_not_compared():
    """The error is at the bound: nothing is known. An unknown error or estimate is not counted."""
    at_bound = plain("a", "x", 1e-11, 1.0, bound=1e-11)
    unknown = plain("a", "x", None, 1.0)
    records = [
        {**at_bound, "error_estimate": {"largest": 1e-13}},
        {**unknown, "error_estimate": {"largest": 0.5}},
    ]
    [said] = outcomes._on_estimates([Run(r) for r in (*records, plain("a", "x", 0.5, 1.0))])
    assert said.text.endswith("All 1 estimates and errors are below the bound of the truth.")


def test_the_scene_of_the_worst_run_is_animated(monkeypatch):
    """A motion to 0.998 of the duration is a part of it; a run at other times is not shown."""
    whole = moving("a", "x", (1.0, 1.0, 1.0)).record
    truth = {"kind": "reference", "motion": whole, "given": 1.0}
    seen = []
    monkeypatch.setattr(
        verdict, "over_truth", lambda scene, exact, run, engine: seen.append((run, engine)) or "<svg/>"
    )
    worst = {**whole, "engine": "mujoco", "family": "stock"}
    poor = SceneRuns(SCENE, [run(0.25), run(None), run(0.125), run(0.5, "STEP_FAILED")], (), truth, worst)
    good = SceneRuns(SCENE.with_(name="good"), [run(0.1)], (), truth, worst)
    still = SceneRuns(SCENE.with_(name="still"), [run(9.0)], (), {**truth, "motion": None}, worst)
    assert verdict._shown([good, poor, still]) is poor and verdict._shown([still]) is None
    shown, caption = verdict.motion(poor)
    assert shown == "<svg/>" and seen[0][1] == "mujoco" and seen[0][0].times.tolist() == [0.0, 0.5, 1.0]
    assert caption == (
        "block, 1 s of its true motion as thick lines. Coloured: the completed run of largest error, MuJoCo, "
        "stock, off by 2.5e-01."
    )
    long = SceneRuns(SCENE.with_(duration=1.0021), poor.runs, (), truth, {**worst, "times": [0.0, 1.0]})
    assert verdict.motion(long)[1] == "block, the first 1 s of its true motion as thick lines."
    assert seen[1] == (None, "")
    near = SceneRuns(SCENE.with_(duration=1.0009), poor.runs, (), truth, None)
    assert verdict.motion(near)[1].startswith("block, 1 s of its")
    assert verdict.motion(still) == verdict.motion(None) == ("", "")


def test_entries_of_the_matrix():
    """The failed runs of a family are counted only if one of its runs completes."""
    runs_ = [run(0.1, step=1), run(None, "STEP_FAILED", 0.5), run(None, "STEP_FAILED", 0.25)]
    [best] = verdict._row(SceneRuns(SCENE, runs_))["a"]
    assert best.lines == ["1.00e-01", "500 ms", "2 of 3 failed"] and best.place == "c-block-a-x"
    [lost] = verdict._row(SceneRuns(SCENE, runs_[1:]))["a"]
    assert len(lost.lines) == 1 and "0.5 s" in lost.lines[0], lost.lines
    hinges = [
        Revolute(name=name, bodies=("ground", "b"), anchor=(0.0, 0.0, z), axis=(0.0, 0.0, 1.0))
        for name, z in (("A", 0.0), ("B", 1.0))
    ]
    still = BLOCK.model_copy(update={"velocity": None})
    hinged = SCENE.with_(joint=tuple(hinges), body=(still,), duration=2.5)
    assert verdict._scene(SceneRuns(hinged, [])) == ("block", "2.5 s, 10 rows, 5 redundant")
    assert verdict._scene(SceneRuns(SCENE, [])) == ("block", "1 s, 0 rows, none redundant")


def test_differences_of_initial_accelerations():
    """The block accelerates at 3 m/s² by a force; the engine's is 3.03: 1 % off. Later samples do not
    count, nor do runs that begin later."""
    falling = SCENE.with_(gravity=(0.0, -3.0, 0.0))

    def given(engine: str, *values: float, **changes: Any) -> Run:
        record = moving(engine, "x", (1.0, 1.0), **changes).record
        body = {**record["bodies"]["b"], "acceleration": [[0.0, a, 0.0] for a in values]}
        body["angular_acceleration"] = [[0.0, 0.0, 0.0]] * 2
        return Run({**record, "bodies": {"b": body}})

    found = [given("a", -3.03, 7.0), given("b", -3.0, -3.0), given("c", -3.03, 7.0, times=[0.1, 0.2])]
    heading, table = accelerations.render(SceneRuns(falling, found))
    assert [tuple(row) for row in table.rows] == [("a", "x", "1.0e-02"), ("b", "x", "0")]
    assert heading.text == "Initial accelerations" and table.right == {2} and table.folded
    assert table.caption.endswith("relative to the largest acceleration. "), "no joint, no singularity"


def test_versions_machines_and_settings_of_records():
    first = {**plain("b", "x", 0.1, 1.0, rtol=1e-3, solver="p"), "versions": {"numpy": "2", "numba": None}}
    second = {**plain("a", "y", 0.1, 1.0, rtol=1e-4), "versions": {"numpy": "1"}, "version": ""}
    third = {**first, "settings": {"rtol": 1e-5, "solver": "p"}}
    machines = [{"cpu": "p", "cores": 2}, {"cpu": "n", "cores": 4}, {"cpu": "p", "cores": 2}]
    found = [
        Run({**r, "machine": m, "seed": 7}) for r, m in zip((first, second, third), machines, strict=True)
    ]
    versions = provenance._versions(found)
    assert versions.header == ("Kind", "Name", "Version")
    assert [tuple(row) for row in versions.rows] == [
        ("engine", "a", "not installed"),
        ("engine", "b", "1"),
        ("package", "numba", "not installed"),
        ("package", "numpy", "1"),
        ("package", "numpy", "2"),
    ]
    table = provenance._machines(found)
    assert table.header == ("cpu", "cores") and list(table.rows) == [("n", "4"), ("p", "2")]
    assert provenance._machines([]).header == ()
    settings = provenance._settings(found)
    assert settings.header == ("Engine", "Family", "Option", "Values") and settings.folded
    assert [tuple(row) for row in settings.rows] == [
        ("b", "x", "rtol", "0.001, 1e-05"),
        ("b", "x", "solver", "p"),
        ("a", "y", "rtol", "0.0001"),
    ]
    groups = [SceneRuns(SCENE, found), SceneRuns(SCENE.with_(name="other"), [])]
    *_, listing = provenance.render(groups)
    assert listing.text.splitlines() == [
        "pip install 'mbref[engines,report]'",
        "crosscheck report scenes/block.toml scenes/other.toml --out .",
    ]
    assert "3 records; seed 7. Time is the CPU time" in provenance.render(groups)[1].text


def branch(number: int, taken: int, **changes: Any) -> dict[str, Any]:
    """A run that asks for a branch at a singular position; it passes two, at 0.25 and 0.375 s."""
    passed = [
        {"time": 0.25, "sentence": "two meet", "taken": 1},
        {"time": 0.375, "sentence": "three meet", "taken": 1},
    ]
    asked = {"options": {BRANCHES: [[number, taken]]}}
    return {
        **moving("mbref", "taylor", (1.0, 1.0, 1.0)).record,
        "asked": asked,
        "crossings": passed,
        **changes,
    }


def test_pictures_of_the_branches_of_each_singular_position(monkeypatch):
    shown = []

    def branches(scene, motions, at, engine) -> dict[str, str]:
        shown.append((list(motions), at, engine))
        return {title: f"<svg>{title}</svg>" for title in motions}

    monkeypatch.setattr(crossings.mechanisms, "branches", branches)
    records = [
        branch(2, 1),
        branch(1, 2, outcome="STEP_FAILED", t_end=0.625),
        branch(1, 1, times=[0.1234567891234, 0.5, 1.0]),
        branch(3, 1),
        branch(1, 3, crossings=None),
    ]
    first, second = crossings._pictures(SceneRuns(SCENE, [], branches=records))
    assert shown == [
        (["Branch 1, smooth", "Branch 2; ended at t = 0.625 s: STEP_FAILED"], 0.25, "mbref"),
        (["Branch 1, smooth"], 0.375, "mbref"),
    ]
    assert first.caption.startswith("Singular position 1 at t = 0.25 s: two meet. In colour")
    assert "from 0.1235 s to 1 s; the line of time" in first.caption and "scenes/block.toml" in first.caption
    assert second.caption.startswith("Singular position 2 at t = 0.375 s: three meet.")
    assert second.caption.endswith("--branches --crossing 2` shows the same.")
    assert first.panels[0] == ("Branch 1, smooth", "<svg>Branch 1, smooth</svg>")


def test_columns_of_least_errors():
    table, others = (b for b in least_errors.render([group()]) if isinstance(b, Table))
    assert list(table.header[:3]) == ["Scene", "Engine", "Family"] and len(table.header) == 7
    assert others.folded and list(others.header[:2]) == ["Scene", "Engine"] and len(others.header) == 4
    assert of(Table, outcomes.render(group())).header == outcomes.HEADER
