"""Tables, headings and written pages of a report on made-up records / columns of numbers, and words."""

from __future__ import annotations

import math
import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_hex
from test_figures_by_hand import BLOCK, SCENE, group, moving, plain
from test_paper_figures_by_hand import turning
from test_pictures_by_hand import violated

from crosscheck.judge.model_identity import gate_times
from crosscheck.judge.truth import NoSolution
from crosscheck.paper.runs import ALPHAS
from crosscheck.setting import BRANCHES
from crosscheck.study.record_view import UNTIMED
from mbref.records import append
from mbref.trajectory import Trajectory
from reports import (
    benchmark_plot,
    engine_looks,
    figures,
    mechanisms,
    places,
    render,
    runs,
    sections,
    stored,
    time_series,
)
from reports.blocks import (
    Card,
    Cell,
    Figure,
    Heading,
    HeatMap,
    Listing,
    Matrix,
    Moving,
    Opening,
    Plot,
    Record,
    Table,
    Text,
    Verdict,
)
from reports.runs import Run, SceneRuns
from reports.sections import (
    accelerations,
    conformance,
    convergence,
    crossings,
    paper_figures,
    paper_methods,
    paper_teaching,
    records,
    speed,
    summary,
    verdict,
)


def right(table: Table) -> list[str]:
    """The names of the columns of numbers."""
    return [table.header[k] for k in sorted(table.right)]


# --- conformance ------------------------------------------------------------------------------------------
def judged(check: str, status: str, scene: str = "s", **numbers: Any) -> dict[str, Any]:
    named = {"property": check, "card": f"{check}/1", "status": status, "scene": scene, "reason": ""}
    return {**named, "measured": None, "allowed": None, **numbers}


@pytest.fixture
def verdicts(monkeypatch) -> list[dict[str, Any]]:
    """An engine, a family of mbref, and both on random mechanisms."""
    planted = [SimpleNamespace(about="a leak", scene="s", check="energy")]
    monkeypatch.setattr(conformance, "proofs", lambda: planted)
    monkeypatch.setattr(conformance, "abouts", lambda: {"energy": "energy stays"})
    monkeypatch.setattr(conformance, "explanations", lambda: {})
    counts = {"energy": {"card": "energy/1", "about": "energy stays", "pass": 3, "fail": 1}}
    more = {"truth": {"card": "truth/1", "about": "the truth", "pass": 2}}
    bad = judged("energy", "fail", measured=3.0, allowed=2.0)
    drawn = {"mechanisms": 4, "cards": counts, "violations": []}
    return [
        {"engine": "mujoco", "version": "1", "verdicts": [bad, judged("truth", "pass")], "family": ""},
        {"engine": "mbref", "version": "2", "verdicts": [judged("energy", "pass")], "family": "lm2+none"},
        {"engine": "mujoco", "version": "1", "family": "", **drawn},
        {"engine": "mbref", "version": "2", "family": "alf", **drawn, "cards": {**more, **counts}},
    ]


def test_tables_of_conformance_and_their_columns(verdicts):
    title, engines, checks, violated, causes, single, of_mbref, families, random, drawn, none, defects = (
        conformance.render(verdicts)
    )
    assert title == Heading("Conformance", 2) and violated == Heading("Violations")
    assert of_mbref == Heading("Methods of mbref") and random == Heading("Drawn mechanisms")
    assert [tuple(row) for row in engines.rows] == [("MuJoCo", "1", "1", "1", "0", "0")]
    assert right(engines) == ["Passed", "Violated", "Refused", "Not applicable"]
    assert [tuple(row) for row in checks.rows] == [
        ("energy/1", "energy stays", "1", "0 of 1", "MuJoCo on 1 of 1"),
        ("truth/1", "", "0", "1 of 1", "none"),
    ]
    assert right(checks) == ["Defects", "Engines pass"]
    assert right(causes) == right(single) == ["Measured", "Allowed"]
    assert [tuple(row) for row in families.rows] == [("lm2+none", "1", "0", "0", "0", "none", "–")]
    assert right(families) == ["Holds", "Violated", "Cannot", "Outside"]
    assert drawn.header == ("Check", "It checks", "MuJoCo", "mbref alf") and right(drawn) == list(
        drawn.header[2:]
    )
    assert [tuple(row) for row in drawn.rows] == [
        ("energy/1", "energy stays", "3 of 4", "3 of 4"),
        ("truth/1", "the truth", "–", "2"),
    ]
    assert none == Text("No random mechanism violates a check.")
    assert defects.rows == [("a leak", "s", "energy")] and defects.folded and not causes.folded
    assert defects.header == ("Defect", "Mechanism", "Check") and defects.caption.startswith("The 1 planted")


def test_parts_of_conformance_that_have_no_verdicts(verdicts):
    engine, family, drawn, _ = verdicts

    def kinds(*found: dict[str, Any]) -> list[str]:
        return [b.text for b in conformance.render(found) if isinstance(b, Heading)]

    assert kinds(engine) == ["Conformance", "Violations"] and kinds(family)[1:] == ["Methods of mbref"]
    assert kinds(drawn)[1:] == ["Drawn mechanisms"] and conformance.render([]) == []
    right_one = {**engine, "verdicts": [judged("truth", "pass")]}
    assert conformance.render([right_one])[3] == Text("No engine violates a check.")


def test_violations_as_multiples_of_their_limits(monkeypatch):
    numbers = [(3.0, 2.0), (3.0, None), (None, 2.0), (3.0, 0.0)]
    found = [conformance._excess({"measured": m, "allowed": a}) for m, a in numbers]
    assert found == [1.5, 3.0, 0.0, 3.0]
    assert conformance._numbers({"measured": 0.25, "allowed": None}) == ("2.5e-01", "–")
    slip = SimpleNamespace(cause="It slips.", remedy="Hold it.")
    known = {("mbref x", "energy", "s"): slip, ("mbref x", "energy", "t"): slip}
    monkeypatch.setattr(conformance, "explanations", lambda: known)
    failed = [judged("energy", "fail", scene) for scene in ("s", "t")]
    assert conformance._cause("x", failed) == "It slips. Hold it." and conformance._cause("x", []) == "–"
    unknown = [*failed, judged("truth", "fail")]
    assert conformance._cause("x", unknown) == f"It slips. Hold it. {conformance.UNEXPLAINED}"
    assert conformance._explanation("a", judged("truth", "fail", reason="It leaks"), "s") == ("It leaks", "–")


# --- convergence ------------------------------------------------------------------------------------------
def stepped(error: float | None, step: float, **changes: Any) -> Run:
    made = plain("a", "x", error, 1.0, step=step)
    return Run({**moving("a", "x", (1.0, 1.0)).record, **made, "times": [0.0, 0.5], **changes})


def test_the_limit_of_completed_runs_of_known_error(monkeypatch):
    """The finest completed run has an error of 4e-4; the limit is off by 2e-3 at most."""
    runs_ = [
        stepped(4e-4, 0.025),
        stepped(1e-2, 0.1),
        stepped(1e-3, 0.05),
        stepped(None, 0.0125),
        stepped(1e-5, 0.00625, outcome="STEP_FAILED"),
    ]
    several = SceneRuns(SCENE, runs_)
    found = SimpleNamespace(
        motion=SimpleNamespace(times=np.array([0.0, 0.5])), order=2.04, discretisation=1e-4
    )
    asked: list[Any] = []

    def limit(scene, steps, motions):
        asked.append((scene, steps, [motion.times.tolist() for motion in motions]))
        return found

    monkeypatch.setattr(convergence, "limit", limit)
    monkeypatch.setattr(convergence, "error_series", lambda scene, motion, exact: np.array([1e-3, 2e-3, 0.0]))
    monkeypatch.setattr(SceneRuns, "exact", lambda self, times: "the truth")
    heading, text, table = convergence._limits([several])
    assert asked == [(SCENE, [0.025, 0.1, 0.05], [[0.0, 0.5]] * 3)]
    assert table.rows == [
        ("block", "a", "x", "0.025", "2", "4.0e-04", "1.0e-04", "2.0e-03", "bias"),
    ]
    assert right(table) == list(convergence.LIMITS[3:8]) and table.folded
    assert table.caption == "Limits of 1 sweeps; in 1 of them bias outweighs discretisation."
    assert heading == Heading("The limit h → 0") and text.text.startswith("Three runs whose differences")
    monkeypatch.setattr(SceneRuns, "exact", lambda self, times: None)
    assert convergence._limits([several]) == []
    monkeypatch.setattr(convergence, "limit", lambda *given: None)
    assert convergence._limit_rows(several) == []
    tight = [Run(plain("a", "x", e, 1.0, rtol=e)) for e in (1e-3, 1e-4, 1e-5)]
    monkeypatch.setattr(convergence, "limit", lambda *given: pytest.fail("a limit over a tolerance"))
    assert convergence._limit_rows(SceneRuns(SCENE, tight)) == []


def test_slopes_leave_out_errors_of_zero():
    zero = SceneRuns(SCENE, [Run(plain("a", "x", e, 1.0, step=h)) for e, h in ((0.0, 0.1), (0.0, 0.2))])
    assert not convergence.slope(zero, ("a", "x")) < 0 and not convergence.slope(zero, ("a", "x")) >= 0
    squares = [(h**2, h) for h in (0.4, 0.2, 0.1)]
    some = SceneRuns(SCENE, [Run(plain("a", "x", e, 1.0, step=h)) for e, h in (*squares, (0.0, 0.05))])
    assert convergence.slope(some, ("a", "x")) == pytest.approx(2.0)


# --- other sections ---------------------------------------------------------------------------------------
def test_columns_of_singular_positions_and_a_start_at_zero(monkeypatch):
    """Times are rounded to 12 decimals: 2e-13 s is the start."""
    passed = [{"time": 0.5, "sentence": "two", "taken": 1}]
    run = {**plain("a", "x", 1e-3, 1.0), "crossings": passed}
    title, table = crossings.render(group((run,)))
    assert title == Heading("Singular positions") and right(table) == ["Number", "t, s", "Taken"]
    asked = {"engine": "a", "options": {BRANCHES: [[1, 1]]}}
    branch = {**moving("a", "x", (1.0,) * 3).record, "crossings": passed, "asked": asked}
    monkeypatch.setattr(crossings.mechanisms, "branches", lambda *given: {"Branch 1": "<svg/>"})
    for start, words in ((2e-13, "from 0 s to 1 s"), (2e-12, "from 2e-12 s to 1 s")):
        record = {**branch, "times": [start, 0.5, 1.0]}
        [picture] = crossings._pictures(SceneRuns(SCENE, [], branches=[record]))
        assert words in picture.caption


def test_initial_accelerations_over_the_largest_of_two_bodies():
    """Forces of 3 and 4 m/s² on the second body's axes: 5 m/s². The first body's acceleration is off by 1."""
    second = BLOCK.model_copy(update={"name": "c", "position": (0.0, 0.0, 5.0)})
    pulled = SCENE.with_(body=(BLOCK, second), gravity=(3.0, 4.0, 0.0))
    made = moving("a", "x", (1.0, 1.0))
    body = dict(made.record["bodies"]["b"]) | {"angular_acceleration": [[0.0] * 3] * 2}
    bodies = {
        "b": {**body, "acceleration": [[3.0, 4.0, 1.0]] * 2},
        "c": {**body, "acceleration": [[3.0, 4.0, 0.0]] * 2},
    }
    _, table = accelerations.render(SceneRuns(pulled, [Run({**made.record, "bodies": bodies})]))
    assert list(table.rows) == [("a", "x", "2.0e-01")]


def test_a_record_leads_back_to_its_cell():
    asked = {"engine": "mujoco", "options": {}, "samples": 3, "end": 1.0}
    made = {**plain("mujoco", "x", 0.5, 1.0), "machine": {"cpu": "p"}, "asked": asked}
    _, _, first = records.render([group((made,))])
    curve = ("mujoco", "x")
    assert (first.place, first.back) == (places.of_family("block", curve), places.of_cell("block", curve))
    assert (first.scene, first.title, first.tone) == ("block", "MuJoCo, x", engine_looks.tone("mujoco"))
    [card] = first.cards
    assert (card.grade, card.sign) == ("wrong", "≠")


def test_tones_of_engines():
    """Engines share the last of seven colours from the seventh on."""
    names = list(engine_looks._names())
    tones = [engine_looks.tone(name) for name in names]
    assert tones == [*range(7), *[6] * (len(names) - 7)][: len(names)] and engine_looks.tone("theirs") == 6
    assert engine_looks.mark("theirs") == engine_looks.MARKS[6] and len(engine_looks.MARKS) == 7


def test_the_opening_stands_above_the_matrix(monkeypatch):
    seen: list[Any] = []
    said = SimpleNamespace(headline="a headline", labelled=lambda: {"Who": "nobody"})
    monkeypatch.setattr(verdict, "verdict", lambda known: seen.append(known) or said)
    monkeypatch.setattr(verdict, "motion", lambda found: ("<svg/>", "a caption"))
    monkeypatch.setattr(verdict, "_scene", lambda found: (found.scene.name, ""))
    monkeypatch.setattr(verdict, "_shown", lambda groups: None)
    truth = {"kind": "", "motion": None}
    bare, known = group(), SceneRuns(SCENE.with_(name="known"), [Run(plain("b", "y", 0.5, 1.0))], truth=truth)
    assert [type(block) for block in verdict.render([bare])] == [Heading, Matrix] and not seen
    opening, heading, matrix = verdict.render([bare, known])
    assert opening == Opening("a headline", {"Who": "nobody"}, "<svg/>", "a caption")
    [shown] = seen[0]
    assert shown.scene.name == "known" and shown.truth is truth
    assert [record["engine"] for record in shown.records] == ["b"] and shown.differences == {}
    assert heading == Heading("Every scene in every engine", 2)
    assert [name for name, _ in matrix.scenes] == ["block", "known"] == list(matrix.cells)
    assert matrix.engines[1] == ("b", verdict.title("b"), 6, engine_looks.MARKS[6])
    monkeypatch.setattr(verdict, "_shown", lambda groups: bare)
    *_, last, figure = verdict.render([bare, known])
    assert last == Heading("Time against error: block", 2) and isinstance(figure, Plot)


def test_ends_of_motions_and_runs_of_one_family(monkeypatch):
    """0.999 of the duration is the whole motion; without a completed run no error is the largest."""
    exact = SimpleNamespace(times=np.array([0.0, 999.0]))
    monkeypatch.setattr(verdict, "motion_of", lambda scene, record: exact)
    monkeypatch.setattr(verdict, "over_truth", lambda scene, exact, run, engine: "<svg/>")
    long = SceneRuns(SCENE.with_(duration=1000.0), [], truth={"motion": {"times": []}})
    assert verdict.motion(long) == ("<svg/>", "block, 999 s of its true motion as thick lines.")
    assert verdict._largest(long) == 0.0
    alone = group((plain("a", "defaults", 0.5, 1.0),))
    assert [found.family for found in verdict._row(alone)["a"]] == ["defaults"]


def test_costs_that_rank_families():
    """The middle one of the levels counts; families without it are not the fastest."""
    run = Run(plain("a", "x", 0.25, 1.0))
    assert summary._rank(run, [1.0, 2.0, 3.0, 4.0, 5.0]) == (False, 3.0, 0.25)
    costs = {("a", "x"): [math.nan, math.nan], ("b", "y"): [2.0, math.nan], ("c", "z"): [3.0, math.nan]}
    assert summary._least(costs, 0) == 2.0 and math.isnan(summary._least(costs, 1))
    _, _, _, table = summary.render([group((plain("a", "x", 1e-4, 1.0),))])
    assert right(table) == [table.header[k] for k in (2, 3, 5, 6, 7, 8)]


def test_only_scenes_with_a_motion_are_shown():
    """The scene needs a worst run and the true motion."""
    run, motion = Run(plain("a", "x", 0.5, 1.0)), {"times": [0.0]}
    truths = (None, {"motion": None}, {"motion": motion})
    groups = [
        SceneRuns(SCENE, [run], truth=truth, motion=worst) for truth in truths for worst in (None, motion)
    ]
    assert [verdict._shown([one]) for one in groups] == [None] * 5 + [groups[5]]


def test_an_engine_with_another_mechanism_is_not_judged():
    several = group()
    several.__dict__["differences"] = {"a": "its mass"}
    row = verdict._row(several)
    assert [(v.grade, v.sign) for v in row["a"]] == [("unjudged", "?")]
    assert [(v.grade, v.sign) for v in row["b"]] == [("inaccurate", "≈")]


def test_sections_stand_in_their_order(monkeypatch):
    """A heading for each scene stands above its parts; sections that are not asked for are left out."""

    def of(name: str) -> Any:
        return lambda given: [Text(f"{name} {[g.scene.name for g in given]}")]

    def part(name: str) -> Any:
        return lambda given: [Text(f"{name} of {given.scene.name}")]

    monkeypatch.setattr(sections, "OPENING", {"first": of("first"), "second": of("second")})
    monkeypatch.setattr(sections, "OF_A_SCENE", {"one": part("one"), "two": part("two")})
    monkeypatch.setattr(sections, "CLOSING", {"last": of("last")})
    monkeypatch.setattr(conformance, "render", lambda verified: [Text(f"conformance {verified}")])
    groups = [SceneRuns(SCENE, []), SceneRuns(SCENE.with_(name="other"), [])]

    def shown(*names: str) -> list[Any]:
        found = sections.blocks(groups, names, ["v"])
        return [(b.text, b.level) if isinstance(b, Heading) else b.text for b in found]

    both = "['block', 'other']"
    assert shown("last", "two", "one", "conformance", "second") == [
        f"second {both}",
        ("block", 2),
        "one of block",
        "two of block",
        ("other", 2),
        "one of other",
        "two of other",
        "conformance ['v']",
        f"last {both}",
    ]
    assert shown("first") == [f"first {both}"] and shown() == [sections.NOTHING]


# --- runs and stored records ------------------------------------------------------------------------------
def test_the_truth_of_a_scene(monkeypatch):
    """The truth may take the CPU time that its record took; it may end before the last time."""
    asked: list[Any] = []

    def truth(scene, seconds):
        asked.append((scene.name, seconds))
        return known

    def poses(times):
        if max(times) > 1.0:
            raise NoSolution("it ends", 1.0)
        return moving("a", "x", (0.0,) * len(times)).trajectory

    monkeypatch.setattr(runs, "truth_for", truth)
    known: Any = SimpleNamespace(poses=poses)
    with_record = SceneRuns(SCENE, [], truth={"given": 7.0})
    assert len(with_record.exact(np.array([0.0, 0.5])).times) == 2
    assert SceneRuns(SCENE, []).exact(np.array([0.0, 2.0])) is None
    assert asked == [("block", 7.0), ("block", runs.SECONDS)]
    late = moving("a", "x", (0.0,) * 4).trajectory
    assert len(with_record.exact_part(late).times) == 3, "of 0, 0.5, 1 and 1.5 s"
    known = None
    assert with_record.exact(np.array([0.0])) is None and with_record.exact_part(late) is None


def test_differences_of_the_engines_mechanisms(monkeypatch):
    monkeypatch.setattr(runs, "model_difference", lambda scene, gate, motions: f"{gate} {len(motions)}")
    monkeypatch.setattr(
        runs, "model_differences", lambda scene, gate, motions: {"a": f"start {len(motions)}"}
    )
    monkeypatch.setattr(runs, "force_differences", lambda scene, found: {"b": f"force {len(found)}"})
    one, truth = [Run(plain("a", "x", 0.5, 1.0))], {"kind": "closed form"}
    assert SceneRuns(SCENE, one, ["gate"]).difference() == "['gate'] 1"
    assert SceneRuns(SCENE, one).difference() is None and SceneRuns(SCENE, one, ["gate"]).differences == {}
    assert SceneRuns(SCENE, one, ["gate"], truth).differences == {"a": "start 1", "b": "force 1"}
    assert SceneRuns(SCENE, one, (), truth).differences == {"b": "force 1"}
    assert SceneRuns(SCENE, one, ["gate"], {"kind": ""}).differences == {}


def test_a_folder_of_records_by_scene(tmp_path):
    """The run of the first thousandth is the gate's; times that were taken again replace those of runs."""
    with pytest.raises(FileNotFoundError, match="has no records"):
        stored.groups(tmp_path)
    (tmp_path / "scenes").mkdir()
    with pytest.raises(FileNotFoundError, match="has no records"):
        stored.groups(tmp_path)
    SCENE.save(tmp_path / "scenes" / "block.toml")
    fine, coarse = (plain("mujoco", "x", 0.5, s, step=h) for s, h in ((2.0, 0.01), (1.0, 0.1)))
    asked = {"engine": "mbref", "options": {}, "times": gate_times(SCENE).tolist()}
    short = {**plain("mbref", "x", 0.0, 3.0), "asked": asked}
    elsewhere = {**plain("mujoco", "x", 0.5, 9.0), "scene": "far", "key": "far"}
    for record in (fine, coarse, short, elsewhere):
        append(tmp_path / "records.jsonl", record)
    append(tmp_path / "timings.jsonl", {"key": fine["key"], "seconds": 0.25, "timing": {"repeats": 5}})
    for name in ("truths", "motions", "branches"):
        append(tmp_path / f"{name}.jsonl", {"key": name, "scene": "block", "kind": ""})
    [found] = stored.groups(tmp_path)
    assert found.scene == SCENE and [run.seconds for run in found.runs] == [1.0, 0.25]
    assert [record["key"] for record in found.gate] == [short["key"]]
    assert (found.truth["key"], found.motion["key"]) == ("truths", "motions")
    assert [record["key"] for record in found.branches] == ["branches"]


def test_verdicts_of_other_engines_come_last(tmp_path):
    (tmp_path / "conformance").mkdir()
    for name in ("another", "mujoco", "mbref"):
        (tmp_path / "conformance" / f"{name}.json").write_text(f'{{"engine": "{name}"}}')
    assert [found["engine"] for found in stored.verified(tmp_path)] == ["mbref", "mujoco", "another"]


def test_names_of_a_part_of_a_motion():
    motion = Trajectory(
        "scene",
        "engine",
        "version",
        "method",
        {},
        np.array([0.0, 1.0]),
        ("b",),
        *(np.zeros((2, 1, n)) for n in (3, 4, 3, 3)),
    )
    part = mechanisms.sample(motion, 1)
    assert (part.scene, part.engine, part.version, part.method) == ("scene", "engine", "version", "")
    record = {
        "times": [0.0],
        "bodies": {"b": {"position": [[1.0, 2.0, 3.0]], "orientation": [[1.0, 0, 0, 0]]}},
    }
    shown = mechanisms.motion_of(SCENE, record)
    assert (shown.scene, shown.engine, shown.method, shown.bodies) == ("block", "", "", ("b",))
    assert shown.position.tolist() == [[[1.0, 2.0, 3.0]]] and shown.orientation.tolist() == [[[1.0, 0, 0, 0]]]
    assert shown.times.tolist() == [0.0] and not shown.velocity.any() and not shown.angular_velocity.any()


# --- figures ----------------------------------------------------------------------------------------------
def test_sizes_in_the_benchmark_s_figure():
    curves = [{"engine": name, "cost": [0.25, 0.5]} for name in ("a", "limit")]
    figure = benchmark_plot.draw({"scenes": {"first": {"levels": [1e-3, 1e-6], "curves": curves}}})
    assert figure.get_size_inches().tolist() == pytest.approx([7.6, 5.8])
    marks = {line.get_label(): line.get_markersize() for line in figure.axes[0].lines}
    assert marks == {"a": 6, "limit": 12}
    top, bottom = figure.axes
    assert top.title.get_fontsize() == 9 and bottom.get_xticklabels()[0].get_rotation() == 30
    [legend] = figure.legends
    assert legend._ncols == 2


def test_the_strip_of_failed_runs():
    """The strip is a sixth of the width; a run without a time stands at a microsecond."""
    lost = [plain("a", "x", None, 0.0, "TIMED_OUT", 0.5), plain("b", "y", None, 2.0, "CRASHED", 0.5)]
    failed = group(tuple(lost))
    main, strip = speed.plot(failed, speed.failed(failed.runs)).axes
    assert [line.get_ydata().tolist() for line in strip.lines] == [[UNTIMED], [2.0]]
    assert {line.get_markersize() for line in strip.lines} == {6}
    assert strip.get_gridspec().get_geometry() == (1, 2)
    assert strip.get_gridspec().get_width_ratios() == (5, 1) and strip.get_xlim() == (0, 1)
    assert main.get_subplotspec().num1 == 0 and strip.get_subplotspec().num1 == 1
    assert [(t.xyann, t.get_fontsize(), t.get_ha()) for t in strip.texts] == [((0, 6), 8, "center")] * 2
    assert to_hex(strip.get_facecolor()) == "#f6f0ee"
    assert strip.title.get_fontsize() == 8 and not strip.spines["left"].get_visible()
    for which in ("major", "minor"):
        found = strip.yaxis.get_tick_params(which=which)
        assert (found["left"], found["labelleft"]) == (False, False)
    assert main.margins() == (0.06, 0.09) and main.get_yscale() == "log" and not strip.get_xticks().size
    known = group(
        (plain("a", "x", 1e-3, 4.0), plain("a", "x", 1e-4, 8.0), plain("a", "y", None, 0.5, "CRASHED"))
    )
    main, strip = speed.plot(known, speed.failed(known.runs)).axes
    assert strip.lines[0].get_ydata().tolist() == [4.0], "the least time of a completed run"
    assert (main.lines[0].get_markersize(), main.lines[0].get_alpha()) == (5, 0.9)
    heading, plot, key = speed.render(known)
    assert heading == Heading("Speed against error") and right(key) == ["Mark", "Runs", "End time (s)"]
    assert plot.svg.startswith("<svg") and [name for name, *_ in plot.legend] == ["a"]
    assert plot.figure.draw.func is speed.plot and plot.figure.draw.args[0] is known


def test_one_error_below_the_bound_of_the_truth_is_told():
    below, above = (plain("a", f, 1e-9, 1.0, bound=b, step=0.1) for f, b in (("x", 1e-7), ("y", 1e-14)))
    sentence = " An error below the bound on the truth's own error is drawn at that bound."
    for records_, is_told in (((below, above), True), ((above,), False)):
        assert (sentence in speed.render(group(records_))[1].caption) is is_told


def test_every_plot_has_a_legend():
    ended = violated([0.0, 1.0], [1e-9, 1e-6])
    run = turning((1.0, 2.0))
    values = {("a", "x"): [np.array([1.0, 2.0])]}
    plots = {
        "rtol 1e-6": paper_teaching.plot_growth({"1e-6": ended}),
        "violation": paper_teaching.plot_gains({"5": ended}),
        "one": paper_teaching.plot_violations({"one": ended}),
        "two": paper_figures.plot_violations({"two": violated_motion(ended)}),
        "three": paper_figures.plot_rates({"three": run}),
        "four": paper_figures.plot_accelerations({"four": run}),
        "smallest": paper_methods.plot_values([0.0], [(0.1, 0.2)]),
        "ALF": paper_methods.plot_digits({"ALF": [1e-3] * len(ALPHAS)}),
        "a x": time_series.plot(SceneRuns(SCENE, [moving("a", "x", (1.0, 1.0))]), values, ("one",)),
    }
    assert {name: figure.legends[0].get_texts()[0].get_text() for name, figure in plots.items()} == {
        name: name for name in plots
    }


def violated_motion(run: Run) -> Run:
    return Run({**moving("a", "x", (1.0, 1.0)).record, **run.record})


# --- pages ------------------------------------------------------------------------------------------------
ALL = Figure("a figure", "A picture.", lambda: "<svg>drawn</svg>")
NUMBERS = Table("Numbers.", ("Name", "Size"), [("a|b", "1"), ("c\nd", "2")], right=frozenset({1}))
CARD = Card("k-1", "step=1", "right", "=", {"Error": "1"}, "", "crosscheck run x", "made")
BLOCKS = [
    Heading("Chapter", 2),
    Heading("Part"),
    Text("Words."),
    NUMBERS,
    ALL,
    Plot("Speed.", "<svg/>", [], ALL),
    Opening("No <b> is right", {"Who": "nobody"}, "", ""),
    Moving("Moves.", [("one", "<svg/>"), ("two", "<svg/>")]),
    HeatMap("Heat.", "gap", ["1", "2"], {"row": [Cell("9", "kept"), Cell("3", "false")]}),
    Matrix(
        "Scenes.",
        [("a", "Engine A", 1, ""), ("b", "Engine B", 2, "")],
        [("s", "1 s")],
        {
            "s": {
                "a": [
                    Verdict("x", "right", "=", ["1e-9", "2 s"], "", ""),
                    Verdict("y", "bad", "≠", ["1e-1"], "", ""),
                ]
            }
        },
    ),
    Record("r-1", "s", "Engine A, x", 1, [CARD], "c-1"),
    Listing("a command"),
]


def test_markdown_of_every_block():
    assert render.markdown(BLOCKS, "A title").split("\n\n") == [
        "# A title",
        "## Chapter",
        "### Part",
        "Words.",
        "Numbers.",
        "| Name | Size |\n| --- | ---: |\n| a\\|b | 1 |\n| c d | 2 |",
        "A picture.",
        f"![a figure](figures/{render.file_name('a figure')}.png)",
        "A picture.",
        f"![a figure](figures/{render.file_name('a figure')}.png)",
        "No &lt;b> is right",
        "Who: nobody",
        "Moves.",
        "- one\n- two",
        "Heat.",
        "| gap | 1 | 2 |\n| --- | --- | --- |\n| row | 9 | **3** |",
        "Scenes.",
        "| Scene | Engine A | Engine B |\n| --- | --- | --- |\n"
        "| s | x = right, 1e-9, 2 s; y ≠ bad, 1e-1 |  |",
        "### s: Engine A, x",
        "- step=1: right\n    crosscheck run x",
        "```\na command\n```\n",
    ]
    assert render.markdown([]) == f"# {render.TITLE}\n"


def test_chapters_and_title_of_a_page():
    page = render.html([*BLOCKS[:4], BLOCKS[-1]], {}, "A title")
    [nav] = re.findall(r"<nav[^>]*>(.*?)</nav>", page)
    assert nav == '<a href="#chapter">Chapter</a> ' and "<title>A title</title>" in page
    assert '<h2 id="chapter">Chapter</h2>' in page and "<h3>Part</h3>" in page and "<h1>A title</h1>" in page
    assert '<td data-label="Size" class="right whole">1</td>' in page and "<pre>a command</pre>" in page
    opened = render.html([BLOCKS[6]], {})
    assert "<h1>No &lt;b&gt; is right</h1>" in opened and opened.count("<h1>") == 1
    assert f"<title>{render.TITLE}</title>" in opened


def test_a_cell_is_coloured_only_by_a_given_depth():
    cells = [Cell("9", "kept"), Cell("8", "kept", 0.5)]
    page = render.html([HeatMap("Heat.", "gap", ["1", "2"], {"row": cells})], {})
    assert '<td class="kept">9</td><td class="kept" style="--depth:0.50">8</td>' in page


def test_pictures_are_written_beside_the_page(tmp_path, monkeypatch):
    monkeypatch.setattr(figures, "png", lambda drawing: f"png of {drawing}".encode())
    plot = Plot("Speed.", "<svg/>", [], Figure("speed", "The plot.", lambda: "<svg>speed</svg>"))
    for _ in range(2):
        render.write([ALL, plot, Text("Words.")], tmp_path / "new" / "page", "A title")
    out = tmp_path / "new" / "page"
    name = render.file_name("a figure")
    texts = {path.name: path.read_text() for path in (out / "figures").iterdir()}
    assert texts == {
        f"{name}.svg": "<svg>drawn</svg>",
        f"{name}.png": "png of <svg>drawn</svg>",
        "speed.svg": "<svg>speed</svg>",
        "speed.png": "png of <svg>speed</svg>",
    }
    page = (out / "index.html").read_text()
    assert "<title>A title</title>" in page and "<svg>drawn</svg>" in page
    assert (out / "report.md").read_text() == render.markdown([ALL, plot, Text("Words.")], "A title")


def test_words_and_numbers_of_a_page():
    assert render.numbers("error 2e-3 at t = 0.5 s, `crosscheck run`") == (
        'error <span class="nb">2e-3</span> at <span class="nb">t = 0.5 s</span>, <code>crosscheck run</code>'
    )
    assert render.breakable("a_b+c<") == "a_<wbr>b+<wbr>c&lt;"
    assert render.slug("The limit h → 0!") == "the-limit-h-0"
    assert render.file_name("x" * 81).startswith("x" * 80 + "-") and render.file_name("x" * 80) == "x" * 80
