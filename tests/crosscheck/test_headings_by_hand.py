"""Headings of printed tables and what `crosscheck.compare` asks for / written out by hand."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rich.table import Table

from crosscheck.cli import (
    closed_loops,
    comparison,
    convergence,
    differences,
    findings,
    judging,
    listing,
    modes,
    tables,
)
from mbref.scene import Body, Scene, Spring
from mbref.scenes import SCENES


def headings(table: Table) -> list[Any]:
    return [column.header for column in table.columns]


class Console:
    """A console that keeps what is printed."""

    def __init__(self) -> None:
        self.printed: list[Any] = []

    def print(self, what: Any, **options: Any) -> None:
        self.printed.append(what)


# --- headings ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("name", "title", "columns"),
    [
        ("scenes", "scenes", ["scene", "bodies", "joints", "drivers, loads", "end (s)"]),
        ("engines", "engines", ["engine", "package", "version"]),
        (
            "methods",
            "methods: formulation+stabilisation/integrator, such as lm2+baumgarte[alpha=10,beta=10]/rk4\n"
            "(meanings: mbref list methods)",
            ["engine", "part", "name", "options"],
        ),
        (
            "settings",
            "settings: a family is a way to run an engine; its options control the accuracy",
            ["engine", "name", "meaning"],
        ),
        ("metrics", "metrics", ["metric", "unit", "definition"]),
    ],
)
def test_headings_of_the_list(
    name: str, title: str, columns: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """One engine and one scene; each engine of methods and settings ends with a line."""
    engine = SimpleNamespace(
        package="p",
        version=lambda: "1.5",
        families={"f": "family", "ours": "own"},
        integrated_here=("ours",),
        options={"o": "option of it"},
        family_parts=lambda: {"integrator": {"rk4": {"step": 0.25, "n": 3.0}, "rk2": {}}},
    )
    monkeypatch.setattr(listing, "engine_names", lambda: ["one", "two"])
    monkeypatch.setattr(listing, "engine", lambda name: engine)
    monkeypatch.setattr(listing, "missing_package", lambda name: "" if name == "one" else "not here")
    monkeypatch.setattr(listing, "SCENES", {"four_bar": SCENES["four_bar"]})
    table = listing.TABLES[name]()
    assert table.title == title and headings(table) == columns
    rows = list(zip(*(column.cells for column in table.columns), strict=True))
    if name == "engines":
        assert rows == [("one", "p", "1.5"), ("two", "p", "not here")]
    if name == "methods":
        assert rows[:2] == [("one", "integrator", "rk4", "step=0.25, n=3"), ("one", "integrator", "rk2", "")]
    if name == "settings":
        assert rows[:3] == [
            ("one", "f", "family"),
            ("one", "ours", "own; integrated by crosscheck"),
            ("one", "option o", "option of it"),
        ]
    ends = [row.end_section for row in table.rows]
    each = {"methods": 2, "settings": 3}.get(name, 0)
    assert ends == ([k % each == each - 1 for k in range(2 * each)] if each else [False] * len(ends))


def test_causes_of_a_motion() -> None:
    body = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
    spring = Spring(bodies=("ground", "b"), points=((0, 0, 0), (1, 0, 0)), stiffness=1.0, natural_length=1.0)
    scene = Scene(name="s", body=(body,), load=(spring,))
    assert listing._causes(scene) == "spring"
    assert listing._causes(scene.with_(gravity=(0.0, 0.0, -9.81))) == "gravity, spring"
    assert listing._causes(SCENES["four_bar"]()) == "driver of A"


def test_headings_of_a_judged_recording(monkeypatch: pytest.MonkeyPatch) -> None:
    console = Console()
    monkeypatch.setattr(judging, "console", lambda: console)
    columns = [
        SimpleNamespace(name="b.x", largest=1.0, bound=0.5, is_right=True, begins=None),
        SimpleNamespace(name="b.x", largest=0.5, bound=0.5, is_right=True, begins=0.25),
        SimpleNamespace(name="b.x", largest=2.0, bound=0.5, is_right=False, begins=1.0),
    ]
    monkeypatch.setattr(judging, "kind_of", lambda name: "position")
    found: Any = SimpleNamespace(columns=columns, reason="", is_right=True, explanations=())
    judging._show(found, ())
    [table] = console.printed
    assert headings(table) == ["column", "largest error", "bound", "", "begins at"]
    assert table.title == "against the reference"
    assert [list(column.cells) for column in table.columns][1:] == [
        ["1.00e+00 m", "5.00e-01 m", "2.00e+00 m"],
        ["5.00e-01 m"] * 3,
        ["right", "right within the bound on the reference", "off"],
        ["", "0.25 s", "1 s"],
    ]
    for names, said in (
        ("abcdef", "not read: a, b, c, d, e, f"),
        ("abcdefg", "not read: a, b, c, d, e, f and 1 more"),
    ):
        judging._show(found, list(names))
        assert console.printed[-1] == said


def test_headings_of_findings_with_and_without_a_check(monkeypatch: pytest.MonkeyPatch) -> None:
    answer = SimpleNamespace(version="2.0", status=SimpleNamespace(value="present"), words="off by 3 m")
    found = SimpleNamespace(name="f", engine="e", version="1.0", does="drifts", recheck=lambda: answer)
    monkeypatch.setattr(findings, "findings", lambda: [found])
    counted: list[Any] = []

    class Counted:
        def __enter__(self) -> Any:
            return counted.append

        def __exit__(self, *error: object) -> None:
            pass

    monkeypatch.setattr(findings, "counted", lambda *given: counted.append(given) or Counted())
    for recheck, more, cells in (
        (False, [], []),
        (True, ["installed", "status", "measured"], ["2.0", "present", "off by 3 m"]),
    ):
        console: Any = Console()
        findings.show(console, [], recheck)
        [table] = console.printed
        assert headings(table) == ["finding", "engine", "found in", "what it does", *more]
        assert [list(column.cells) for column in table.columns] == [
            [cell] for cell in ["f", "e", "1.0", "drifts", *cells]
        ]
    assert counted == [("running proofs", 0), ("running proofs", 1), "f"]


def test_headings_of_orders_loops_and_modes(monkeypatch: pytest.MonkeyPatch) -> None:
    table = convergence._table([])
    assert headings(table) == ["engine, family", *(m.heading for m in convergence.ladders.MECHANISMS)]
    assert table.title == "least errors, and orders in parentheses"
    assert headings(closed_loops._table({}, True)) == ["engine"]
    assert [closed_loops._table({}, best).title for best in (True, False)] == [
        "at its best settings",
        "by the library's defaults",
    ]
    console: Any = Console()
    closed_loops._legend(console)
    assert console.printed == [f"{sign:10} {text}" for sign, text in closed_loops.LEGEND.items()]
    console = Console()
    monkeypatch.setattr(modes.document, "heading", lambda record: "at rest")
    monkeypatch.setattr(modes.document, "search", lambda record: "found by `search`")
    monkeypatch.setattr(modes.document, "written", lambda *s: f"{s[0]:g}{s[1]:+g}i")
    monkeypatch.setattr(modes.document, "rows", lambda record: [("mbref", "1e-12"), ("judge", "0")])
    modes._show(console, [{"scene": "s", "eigenvalues": [(0.0, 2.0), (-1.0, 0.5)]}])
    *lines, table = console.printed
    assert lines == ["s: at rest", "  s = 0+2i, -1+0.5i 1/s", "  found by search"]
    assert headings(table) == ["method", "error of the eigenvalues"]
    assert [list(column.cells) for column in table.columns] == [["mbref", "judge"], ["1e-12", "0"]]


def test_headings_of_changes_fold_and_have_no_numbers() -> None:
    assert differences.HEADER == ("scene", "engine", "family", "settings", "change")
    table = tables.listing_table("runs", differences.HEADER)
    assert table.title == "\nruns" and headings(table) == list(differences.HEADER)
    assert all(c.overflow == "fold" and not c.no_wrap and c.justify == "left" for c in table.columns)
    assert (table.box, table.padding, table.title_justify, table.pad_edge) == (
        None,
        (0, 1, 0, 0),
        "left",
        False,
    )
    assert [c.min_width for c in table.columns] == [0, 0, 0, tables.SETTINGS_WIDTH, 0]


# --- crosscheck.compare -----------------------------------------------------------------------------------
class Asked:
    """Stand-ins for the parts of a comparison, which keep what they are given."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.calls: dict[str, Any] = {}
        self.result = SimpleNamespace(name="the comparison")
        for place, name, answer in (
            (comparison, "started", lambda scene: scene),
            (comparison.scene_request, "find_scenes", lambda names: [SCENES["four_bar"]()]),
            (comparison.request, "lasting", lambda scene, times, duration: scene.with_(duration=duration)),
            (comparison.request, "find_engines", lambda names, notice: ["one", "two"]),
            (comparison.request, "sample_times", lambda scene, times, samples: [0.0, samples]),
            (comparison.request, "plan", lambda *given: ["the plan"]),
            (comparison, "collected", lambda *given: "the records"),
            (comparison, "comparisons", lambda *given: [self.result]),
        ):
            monkeypatch.setattr(place, name, self.noting(name, answer))

    def noting(self, name: str, answer: Any) -> Any:
        def called(*given: Any) -> Any:
            self.calls[name] = given
            return answer(*given)

        return called


@pytest.mark.parametrize(
    ("depth", "limit", "given"), [("quick", "QUICK", None), ("whole", "WHOLE", None), ("quick", 3.0, 3.0)]
)
def test_a_comparison_is_planned_by_its_arguments(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, depth: str, limit: Any, given: float | None
) -> None:
    asked = Asked(monkeypatch)
    limit = {"QUICK": comparison.sweep.QUICK_LIMIT, "WHOLE": comparison.TIME_LIMIT}.get(limit, limit)

    def notice(sentence: str) -> None:
        pass

    scene = SCENES["five_bar_gravity"]()
    found = comparison.compare(
        scene,
        "one",
        families=["f", "g"],
        depth=depth,
        duration=0.5,
        samples=7,
        time_limit=given,
        reference_time=11.0,
        out=tmp_path,
        notice=notice,
    )
    assert found is asked.result and asked.calls["started"] == (scene,)
    assert asked.calls["lasting"] == (scene, None, 0.5) and "find_scenes" not in asked.calls
    assert asked.calls["find_engines"] == (["one"], notice)
    lasting, _, samples = asked.calls["sample_times"]
    assert lasting.duration == 0.5 and samples == 7
    scenes, engines, wanted, plan, tell = asked.calls["collected"]
    assert scenes == [lasting] and engines == ["one", "two"] and tell is notice
    assert wanted.times == [[0.0, 7]] and wanted.reference_time == 11.0 and wanted.out == tmp_path
    assert wanted.is_quick is (depth == "quick") and wanted.is_named is True
    assert plan() == ["the plan"]
    planned, names, chosen, times, longest, given = asked.calls["plan"]
    assert planned == [lasting] and names == engines and times == wanted.times and given is notice
    assert longest == limit and chosen.is_quick is (depth == "quick") and chosen.families == ["f", "g"]
    assert asked.calls["comparisons"] == ("the records", {scene.name: f"{scene.name}.toml"}, 11.0)


def test_a_comparison_by_a_name_is_quiet(monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    asked = Asked(monkeypatch)
    comparison.compare(Path("four_bar"), duration=1.0)
    assert asked.calls["find_scenes"] == (["four_bar"],) and "started" not in asked.calls
    names, tell = asked.calls["find_engines"]
    assert names is None and tell("a sentence") is None and capsys.readouterr() == ("", "")
    wanted = asked.calls["collected"][2]
    assert wanted.out is None and wanted.is_named is False and wanted.is_quick is True
    assert asked.calls["sample_times"][2] == comparison.sweep.QUICK_SAMPLES
    assert asked.calls["comparisons"][1:] == ({"four_bar": "four_bar"}, comparison.SECONDS)
