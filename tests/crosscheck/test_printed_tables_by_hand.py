"""Tables and lines that commands print / plain records, each cell and sentence worked out by hand."""

from __future__ import annotations

import io
import json
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from rich.table import Table

from crosscheck.cli import differences, judging, listing, running, support, tables, terminal_plot
from crosscheck.cli.request import RequestError
from crosscheck.engine import Cannot, Owner, engine, engine_names
from crosscheck.study import record_view
from crosscheck.study.tuning import by_error
from mbref.scene import Body, Scene
from mbref.scenes import SCENES

BLOCK = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
SCENE = Scene(name="block", body=(BLOCK,), duration=1.0)


def run(
    engine: str = "a",
    family: str = "x",
    error: float | None = 1e-5,
    seconds: float = 0.5,
    outcome: str = "COMPLETED",
    t_end: float = 1.0,
    **more: Any,
) -> dict[str, Any]:
    settings = more.pop("settings", {"step": 0.1})
    metrics = {"error": error, "error_bound": 1e-12, **more.pop("metrics", {})}
    return {
        "scene": "block",
        "engine": engine,
        "family": family,
        "outcome": outcome,
        "message": "it failed" if outcome != "COMPLETED" else "",
        "t_end": t_end,
        "times": [0.0, t_end],
        "settings": settings,
        "asked": {"engine": engine, "options": settings, "samples": 3, "end": 1.0},
        "metrics": metrics,
        "cost": {"seconds": seconds, "rhs": 10},
        "time_limit": 20.0,
        **more,
    }


def cells(table: Table) -> list[tuple[str, ...]]:
    return list(zip(*([str(cell) for cell in column.cells] for column in table.columns), strict=True))


def printed(show: Any, *arguments: Any, width: int = 200) -> str:
    out = io.StringIO()
    show(Console(file=out, width=width, markup=False, highlight=False), *arguments)
    return out.getvalue()


def test_plot_of_errors_and_times():
    """Errors 1e-8 and 1e-2, times 0.01 and 10 s: corners of a plot of 64 by 16 characters."""
    records = [run(error=1e-8, seconds=10.0), run("b", "y", 1e-2, 0.01), run("b", "z", None, 1.0)]
    letters = {("a", "x"): "A", ("b", "y"): "B", ("b", "z"): "C"}
    lines = terminal_plot.scatter(records, letters).plain.splitlines()
    assert lines[0] == "time (s)" and len(lines) == 1 + 16 + 2 + 3
    assert lines[1] == " 1e+01 │A" + " " * 63 and lines[16] == " 1e-02 │" + " " * 63 + "B"
    assert {line[:8] for line in lines[2:16]} == {"       │"} and not "".join(lines[2:16]).strip(" │")
    assert lines[17] == "       └" + "─" * 64
    assert lines[18].startswith("        1e-08") and lines[18].endswith("1e-02") and len(lines[18]) == 72
    assert lines[19:] == ["   A a x", "   B b y", "   C b z"]
    text = terminal_plot.scatter(records, letters)
    styles = {text.plain[span.start : span.end]: span.style for span in text.spans if span.style}
    assert styles["A"] == styles["   A a x\n"] == "blue" and styles["B"] == styles["   C b z\n"] == "red"
    middle = terminal_plot.scatter([*records, run("a", "x", 1e-5, 10**-0.5)], letters).plain.splitlines()
    assert [(k, line.index("A")) for k, line in enumerate(middle[:17]) if "A" in line] == [(1, 8), (9, 40)]
    assert terminal_plot.scatter(records[2:], letters).plain.startswith("nothing to plot")
    assert terminal_plot._range([2.0, 2.0]) == (2, 3) and terminal_plot._range([-2.5, 0.1]) == (-3, 1)


def test_places_of_a_plot_are_raised_to_what_is_known():
    assert record_view.drawn(run(error=1e-14), 0.0) == (1e-12, 1e-6)
    assert record_view.drawn(run(error=0.0, metrics={"error_bound": None}), 2.0) == (1e-16, 2.0)


ANSWERS = {
    "one": {"e": None, "f": Cannot(Owner.MODEL, "no hinge")},
    "two": {"e": Cannot(Owner.MODEL, "no hinge"), "f": Cannot(Owner.MODEL, "no hinge")},
    "three": {"e": Cannot(Owner.ADAPTER, "no slide"), "f": None},
}


def test_matrix_of_support():
    found = support.Support(("e", "f"), ANSWERS)
    first, second = found.notes()
    assert (
        first.startswith("f, e: ")
        and "no hinge" in first
        and second.startswith("e: ")
        and "no slide" in second
    )
    assert [found.row(name, found.notes()) for name in ANSWERS] == [
        ["✓", "– 1"],
        ["– 1", "– 1"],
        ["– 2", "✓"],
    ]
    assert list(support._table("feature", found)) == [
        "| feature | e | f |",
        "| --- | :-: | :-: |",
        "| one | ✓ | – 1 |",
        "| two | – 1 | – 1 |",
        "| three | – 2 | ✓ |",
        "",
        f"1. {first}",
        f"2. {second}",
    ]
    able = support.Support(("e",), {"four": {"e": None}})
    assert list(support._table("scene", able)) == ["| scene | e |", "| --- | :-: |", "| four | ✓ |"]
    assert list((able | support.Support(("e",), {"five": {"e": None}})).answers) == ["four", "five"]


def test_scenes_and_features_are_asked_for_each_engine():
    asked = []

    def ask(name: str, scene: Scene) -> None:
        asked.append((name, scene.name))

    found = support.of_scenes(["e", "f"], ask)
    assert list(found.answers) == list(SCENES) and len(asked) == 2 * len(SCENES)
    assert asked[:2] == [("e", "four_bar"), ("f", "four_bar")]
    assert "motion without masses" in support.of_features(["e"], ask).answers


def test_block_of_a_document(tmp_path, monkeypatch):
    begin, end = support.BEGIN, support.END
    assert support.block_of(f"a\n{begin}\nx\n{end}\nb\n") == f"{begin}\nx\n{end}\n"
    for text in ("", begin, end, f"{end}{begin}"):
        with pytest.raises(ValueError, match="no <!-- support -->"):
            support.block_of(text)
    (tmp_path / "page.md").write_text(f"a\n{begin}\nold\n{end}\nb\n")
    monkeypatch.setattr(support, "markdown", lambda engines: f"{begin}\nnew\n{end}\n")
    support.refresh(tmp_path / "page.md")
    assert (tmp_path / "page.md").read_text() == f"a\n{begin}\nnew\n{end}\nb\n"


def test_tables_of_the_list():
    rows = {name: rest for name, *rest in cells(listing._scenes())}
    assert rows["four_bar"] == [
        "crank, coupler, rocker",
        "A revolute, B universal, C universal, D revolute",
        "driver of A",
        "0.1",
    ]
    assert rows["flyball_governor"][2] == "gravity, spring, spring"
    metrics = {name: rest for name, *rest in cells(listing._metrics())}
    assert metrics["rotation_error"] == ["rad", "rotation error"]
    methods = cells(listing._methods())
    assert ("mbref", "integrator", "rk4", "step=0.0001") in methods
    settings = {(name, entry): meaning for name, entry, meaning in cells(listing._settings())}
    ours = engine("pinocchio").integrated_here
    assert all(settings["pinocchio", f].endswith("; integrated by crosscheck") for f in ours)
    assert not settings["mbref", "taylor"].endswith("integrated by crosscheck")
    assert ("mujoco", "option step") in settings
    engines = cells(listing._engines())
    assert [row[0] for row in engines] == list(engine_names()) and engines[0][1] == "mbref"
    assert list(listing.TABLES) == ["scenes", "engines", "methods", "settings", "metrics", "support"]


def test_one_table_or_all_are_shown(monkeypatch):
    made = {name: (lambda name=name: name) for name in ("one", "two")}
    monkeypatch.setattr(listing, "TABLES", made)
    assert printed(listing.show, None) == "one\ntwo\n" and printed(listing.show, "two") == "two\n"


def test_table_of_runs():
    """Two families; a run that failed at 0.25 s, and one that never moved."""
    records = [
        run(metrics={"violation_position": 2e-9, "energy_error": None}),
        run(settings={"step": 0.01}, error=1e-13, seconds=2.0),
        run("b", "y", None, 1.0, "SINGULAR_MATRIX", 0.25, metrics={"violation_position": 1e-3}),
        run("b", "y", None, 1.0, "NOT_CONVERGED", 0.0, settings={"step": 0.2}),
    ]
    text = printed(tables.print_runs, records)
    lines = [line.split() for line in text.splitlines() if line.strip()]
    assert lines[0] == ["block"] and lines[1][:3] == ["engine,", "family", "settings"]
    assert lines[2] == ["a", "x", "step=0.1", "completed", "1.00e-05", "2.00e-09", "–", "5.00e-01"]
    assert lines[3] == ["a", "x", "step=0.01", "completed", "<", "1e-12", "–", "–", "2.00e+00"]
    assert lines[4] == ["b", "y", "step=0.1", "singular", "–", "1.00e-03", "–", "1.00e+00"]
    assert lines[5] == ["at", "0.25", "s"]
    assert lines[6] == ["b", "y", "step=0.2", "not", "converged", "–", "–", "–", "–"]
    assert lines[7] == ["at", "0", "s"]
    assert text.rstrip().endswith(
        "b y step=0.1: SINGULAR_MATRIX: it failed\nb y step=0.2: NOT_CONVERGED: it failed"
    )


def test_failures_of_one_cause_share_a_line():
    records = [run("b", "y", None, 1.0, "CRASHED", 0.5, settings={"step": h}) for h in (0.1, 0.2)]
    text = printed(tables._print_messages, [*records, run()])
    assert (
        text == "\nb y step=0.1; step=0.2: CRASHED: it failed\n"
        and printed(tables._print_messages, [run()]) == ""
    )
    assert [tables._at(r) for r in (run(), records[0], run(outcome="TIMED_OUT"))] == ["", "", ""]
    assert tables._at(run(outcome="STEP_FAILED", t_end=-1.0)) == "\nat 0 s"


def test_letters_of_many_families():
    found = tables._letters([run(family=f"f{k}") for k in range(64)] + [run(family="f0")])
    assert "".join(found.values()) == "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789AB"


def test_widths_of_columns():
    table = tables._table("t", ("engine", "settings", "verdict", "error", "time (s)"))
    widths = [(c.justify, c.no_wrap, c.min_width, c.max_width) for c in table.columns]
    assert widths == [
        ("left", False, 0, None),
        ("left", False, 15, None),
        ("left", False, 0, 13),
        ("right", True, 8, None),
        ("right", True, 8, None),
    ]
    assert {c.justify for c in tables.listing_table("t", ("a", "b", "c", "d", "e")).columns} == {"left"}


def test_ranked_runs_and_their_ratios():
    records = [
        run(error=1e-3, seconds=0.5),
        run("b", "y", 1e-9, 2.0),
        run("c", "z", None, 9.0, "STEP_FAILED", 0.125),
    ]
    group = SimpleNamespace(
        records=records, comparable=records[:2], grade=lambda r: "right" if r["engine"] == "b" else "wrong"
    )
    letters = tables._letters(records)
    rows = cells(tables._ranked(group, letters, True))
    assert rows[0] == ("B", "b y", "step=0.1", "right", "1.00e-09", "2.00e+00", "4.0")
    assert rows[1] == ("A", "a x", "step=0.1", "wrong", "1.00e-03", "5.00e-01", "1.0")
    assert rows[2][0] == "C" and rows[2][4:] == ("–", "9.00e+00", "–")
    assert [row[:-1] for row in rows] == cells(tables._ranked(group, letters, False))


NEAREST = by_error(1e-6)


@pytest.mark.parametrize(
    ("record", "says"),
    [
        (run(outcome="STEP_FAILED"), "No setting reaches an error of 1e-06: no run completes."),
        (run(error=None), "No error is known, because no truth of this motion is known."),
        (
            run(metrics={"error_bound": 2e-6}),
            "The truth is known to 2e-06, so no run can be seen to reach 1e-06. The nearest:",
        ),
        (run(error=1e-5), "No setting reaches an error of 1e-06; the nearest run has 1.00e-05:"),
        (run(metrics={"error_bound": 1e-6}), "No setting reaches an error of 1e-06; the nearest run has"),
    ],
)
def test_why_no_setting_reaches_an_error(record, says):
    assert tables._unreached(NEAREST, record).startswith(says)


def test_the_nearest_run_is_the_completed_one_of_least_error():
    records = [run(error=1e-9, outcome="STEP_FAILED"), run(error=1e-3), run("b", "y", 1e-4)]
    text = printed(tables.print_tuning, NEAREST, [], records, SCENE, "my.toml")
    assert "the nearest run has 1.00e-04:" in text and "b y" in text and "a x" not in text


def test_settings_to_type_come_before_settings_that_crosscheck_integrates(monkeypatch):
    found = SimpleNamespace(
        integrated_here=("ours",),
        families={"own": "an integrator", "ours": ""},
        options={"step": "length of a step, s"},
        own_code=lambda scene, asked: "model.step = 0.1" if asked.family == "own" else "",
    )
    monkeypatch.setattr(tables, "engine", lambda name: found)
    own, ours = run("mujoco", "own", 1e-7, 2.0), run("mujoco", "ours", 1e-7, 1.0, settings={"n": 3})
    text = printed(tables.print_tuning, NEAREST, [ours, own], [ours, own], SCENE, "my.toml")
    first, second = text.index("integrated by MuJoCo itself"), text.index("integrated by crosscheck")
    assert first < second
    assert (
        "own: an integrator; step = 0.1 (length of a step, s).\nThe cheapest: crosscheck run my.toml" in text
    )
    assert "To copy: model.step = 0.1\n" in text and text.count("To copy") == 1
    assert "ours; n = 3.\n" in text
    text = printed(tables.print_tuning, NEAREST, [ours], [ours, own], SCENE, "my.toml")
    assert text.startswith("MuJoCo reaches an error of 1e-06 with none of its own.")
    text = printed(tables.print_tuning, NEAREST, [ours], [ours], SCENE, "my.toml")
    assert text.startswith("MuJoCo has no integrator of its own here.")


def test_cells_of_numbers():
    assert [tables._number(v) for v in (None, math.inf, 0.00123456)] == ["–", "–", "1.23e-03"]
    assert tables._value(0.5) == "0.5" and tables._value(3) == "3" and tables._value("p") == "p"
    assert tables._outcome(run(outcome="SINGULAR_MATRIX")) == "singular"


def test_views_of_a_record():
    still = run(error=1e-3, outcome="STEP_FAILED", t_end=0.0)
    assert record_view.error_text(still) == "–" and record_view.error_text(run(error=None)) == "–"
    assert record_view.error_text(run(error=1e-12)) == "1.00e-12" and record_view.never_moved(still)
    assert not record_view.never_moved(run(t_end=0.0)), "a run to t = 0 completed"
    assert record_view.ended(run(outcome="NOT_CONVERGED", t_end=0.123456)) == "not converged at 0.1235 s"
    assert (
        record_view.ended(run(outcome="TIMED_OUT")) == "timed out" and record_view.ended(run()) == "completed"
    )
    known = run(metrics={"error_until": 1.0})
    assert record_view.is_judged(known) and record_view.is_judged(still)
    assert not record_view.is_judged(run(metrics={"error_until": 0.5}))
    assert not record_view.is_judged(run(error=None)) and record_view.is_judged(run(error=None, times=[]))
    assert record_view.error(run(error=math.nan)) == math.inf
    public = record_view.public({**run(error=math.nan), "key": "k", "timing": {"median": math.inf}})
    assert public["metrics"]["error"] is None and public["timing"] == {"median": None} and "key" not in public
    timed = record_view.with_time({**run(), "key": "k"}, {"k": {"seconds": 9.0, "timing": {"repeats": 5}}})
    assert timed["cost"] == {"seconds": 9.0, "rhs": 10} and timed["timing"] == {"repeats": 5}
    assert "timing" not in record_view.with_time({**run(), "key": "k"}, {})


def test_settings_that_vary_within_a_family():
    records = [run(settings={"step": h, "beta": 2.0, "solver": "p"}) for h in (0.1, 0.01)]
    assert record_view.varied_settings(records[1], records) == "step=0.01"
    assert record_view.varied_settings(records[0], records[:1]) == "step=0.1, beta=2, solver=p"
    assert (
        record_view.varied_settings(records[0], [records[0], run("b", "y")]) == "step=0.1, beta=2, solver=p"
    )


def change(old: bool, new: bool, *sentences: str, engine: str = "a") -> SimpleNamespace:
    return SimpleNamespace(
        identity=("s", engine, "f", '{"step": 0.1, "n": 2}', "{}"),
        old={"a": 1} if old else None,
        new={"a": 1} if new else None,
        sentences=sentences,
    )


def test_difference_of_two_sets(monkeypatch, tmp_path):
    found = [
        change(True, True, "error 1 → 2", "time 1 s → 3 s"),
        change(True, True),
        change(True, False, "only in the old set"),
        change(True, False, "only in the old set"),
        change(False, True, "only in the new set", engine="b"),
    ]
    monkeypatch.setattr(differences, "load", lambda path: {})
    monkeypatch.setattr(differences, "changes", lambda old, new: found)
    monkeypatch.setattr(differences, "circumstances", lambda old, new: ["numpy: 1 → 2"])
    text = printed(differences.show, "old", "new", False)
    lines = text.splitlines()
    assert lines[:3] == ["numpy: 1 → 2", "a: 2 runs only in the old set", "b: 1 run only in the new set"]
    assert "1 of 2 runs of both sets changed." in text and text.count("step=0.1, n=2") == 1
    assert "error 1 → 2; time 1 s → 3 s" in text
    text = printed(differences.show, "old", "new", True)
    assert text.count("step=0.1, n=2") == 5 and "none" in text and "a: 2 runs" not in text
    monkeypatch.setattr(differences, "changes", lambda old, new: found[1:2])
    assert "0 of 1 runs" in printed(differences.show, "old", "new", False)
    monkeypatch.setattr(differences, "changes", lambda old, new: found[2:3])
    assert differences.NONE_OF_BOTH in printed(differences.show, "old", "new", False)
    monkeypatch.undo()
    with pytest.raises(RequestError, match="no such file"):
        differences.show(Console(file=io.StringIO()), str(tmp_path / "x"), str(tmp_path / "y"), False)


def test_a_difference_is_reported_by_its_status(monkeypatch):
    monkeypatch.setattr(differences, "load", lambda path: {})
    monkeypatch.setattr(differences, "circumstances", lambda old, new: [])
    for found, expected in (
        ([change(True, True)], False),
        ([change(True, True, "error")], True),
        ([], False),
    ):
        monkeypatch.setattr(differences, "changes", lambda old, new, found=found: found)
        assert differences.show(Console(file=io.StringIO()), "a", "b", False) is expected


def judgement(**changes: Any) -> SimpleNamespace:
    column = SimpleNamespace(name="rod.position.x", largest=2e-3, bound=1e-9, is_right=False, begins=0.25)
    good = SimpleNamespace(name="rod.velocity.x", largest=1e-12, bound=1e-9, is_right=True, begins=None)
    made = {"columns": [column, good], "reason": "", "until": 1.0, "is_right": False, "explanations": []}
    return SimpleNamespace(**{**made, **changes})


def test_a_judged_recording(capsys):
    judging._show(judgement(), [])
    out = capsys.readouterr().out
    assert "2.00e-03 m" in out and "1.00e-09 m/s" in out and "0.25 s" in out
    assert out.index("largest error") < out.index("bound") < out.index("begins at")
    row = next(line for line in out.splitlines() if "rod.position.x" in line)
    assert row.index("2.00e-03 m") < row.index("1.00e-09 m") < row.index("off") < row.index("0.25 s")
    assert out.count("right within the bound on the reference") == 1
    assert "None of the tested explanations removes half of the difference." in out and "not read" not in out
    mass = SimpleNamespace(sentence="a mass of 2 kg", remains=0.01234)
    judging._show(judgement(reason="it locks", until=0.5, explanations=[mass]), ["note", "id"])
    out = capsys.readouterr().out
    assert "The reference ends at t = 0.5 s: it locks" in out and "not read: note, id" in out
    assert "a mass of 2 kg: 1.2 % of the difference remains" in out and "None of the tested" not in out
    judging._show(judgement(is_right=True), [])
    assert "None of the tested" not in capsys.readouterr().out


@pytest.mark.parametrize("text", ["rod.position.x", "rod.position.x=", "="])
def test_a_column_needs_a_name_and_a_place(text):
    if text == "=":
        text = "x="
    with pytest.raises(RequestError, match="must be NAME=PLACE"):
        judging._assigned(text)
    assert judging._assigned("rod.position.x=3") == ("rod.position.x", "3")


def test_documents_of_one_scene_and_of_several(capsys):
    cases = [SimpleNamespace(scene=SimpleNamespace(name=name)) for name in ("block", "other", "block")]
    documents = running.by_scene(cases, [run(), {**run("b"), "scene": "other"}, run("c")])
    assert [(d["scene"], [r["engine"] for r in d["records"]]) for d in documents] == [
        ("block", ["a", "c"]),
        ("other", ["b"]),
    ]
    running.print_json(documents[:1])
    running.print_json(documents)
    one, both = map(json.loads, capsys.readouterr().out.splitlines())
    assert one["scene"] == "block" and [d["scene"] for d in both] == ["block", "other"]


def test_unknown_truths_are_named_once_for_each_scene(monkeypatch):
    monkeypatch.setattr(running, "known_at", lambda scene, times, seconds: seconds)
    monkeypatch.setattr(running, "unknown", lambda scene, known: f"{scene.name} {known}")
    cases = [SimpleNamespace(scene=SCENE, times=np.array([0.0, 1.0]), reference_time=2.0) for _ in range(2)]
    assert running.missing_truths(cases, [run(metrics={"error_until": 1.0})]) == []
    assert running.missing_truths(cases, [run(metrics={"error_until": 0.5}), run(error=None)]) == [
        "block 2.0"
    ]
