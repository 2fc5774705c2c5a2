"""Records of closed loops / cases, files, refusals and cells of the page worked out by hand."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest

from crosscheck.closed_loops import document, matrix, records
from crosscheck.closed_loops.mechanisms import DIFFICULTIES, FOLDER, ROOT, Difficulty
from crosscheck.engine import Cannot, Owner
from crosscheck.setting import Setting
from crosscheck.study.grid import Unable


class Case(NamedTuple):
    """A case of a study, with the fields that the records read."""

    scene: Any
    engine: str
    setting: Setting
    time_limit: float = 9.0


SCENE = SimpleNamespace(name="s")
COLUMN = SimpleNamespace(make=lambda: SCENE, end=3.0)


def record(**parts: Any) -> dict[str, Any]:
    made = {"key": "k", "engine": "e", "scene": "s", "version": "1", "family": "f", "outcome": "COMPLETED"}
    return {**made, "metrics": {}, "cost": {"seconds": 1.0}, **parts}


def test_files_of_records(tmp_path: Path):
    """One record a line; no file has no records, and no part of a file is left."""
    path = tmp_path / "r.jsonl"
    assert records.read(path) == []
    records.write([{"a": 1}, {"b": [2.5, None]}], path)
    assert path.read_text() == '{"a": 1}\n{"b": [2.5, null]}\n' and [*tmp_path.iterdir()] == [path]
    assert records.read(path) == [{"a": 1}, {"b": [2.5, None]}]
    records.write([record(), record(key="l"), record(engine="g")], path)
    records._store(record(family="new"), path)
    assert records.read(path) == [record(key="l"), record(engine="g"), record(family="new")]
    assert records.FILE.name == "records.jsonl" and records.read() == records.read(records.FILE)


def test_the_finest_case_of_each_family(monkeypatch, tmp_path: Path):
    """Cases that would take too long by a stored record are left out; 21 samples and 60 s each."""
    asked: list[Any] = []
    cases = [
        Case(SCENE, "e", Setting(family, {"step": step}))
        for family, step in (("f", 3), ("f", 2), ("f", 1), ("g", 7))
    ]
    refusal = Unable(SCENE, "h", Cannot(Owner.MODEL, "no"))

    def default_cases(scene: Any, engines: Any, families: Any, times: np.ndarray) -> Any:
        asked.append((scene, engines, families, times.tolist()))
        return cases, [refusal]

    monkeypatch.setattr(records, "default_cases", default_cases)
    monkeypatch.setattr(
        records, "_is_too_long", lambda case, stored: case.setting.options["step"] <= stored["limit"]
    )
    path = tmp_path / "r.jsonl"
    found, unable = records.cases(["e"], ["f", "g"], path, [COLUMN, COLUMN])
    assert asked[0] == (SCENE, ["e"], ["f", "g"], pytest.approx([0.15 * k for k in range(21)]))
    assert [(c.setting.options["step"], c.time_limit) for c in found] == [(1, 60.0), (7, 60.0)] * 2
    assert unable == [refusal, refusal]
    records.write([{"limit": 0}, {"limit": 1}], path)
    found, _ = records.cases(["e"], None, path, [COLUMN])
    assert [c.setting.options["step"] for c in found] == [2, 7] and asked[-1][2] is None


def test_cases_run_once_and_are_stored(monkeypatch, tmp_path: Path):
    """A refusal is stored, too; a case whose key is in the file does not run."""
    path, ran, seen = tmp_path / "r.jsonl", [], []
    records.write([record(key="known", scene="other")], path)
    whole = {name: name for name in records.KEPT} | {"engine": "e", "scene": "s", "bodies": 1}
    numbers = {"error": 1.0, "error_bound": 2.0, "violation_position": 3.0}
    whole["metrics"] = {**numbers, "energy_error": 4.0}

    def study(wanted: Any, progress: Any) -> None:
        ran.extend(wanted)
        for case in wanted:
            progress(1, 2, whole | {"key": case})

    monkeypatch.setattr(records, "study", study)
    monkeypatch.setattr(records, "key", lambda case: case)
    monkeypatch.setattr(records, "engine", lambda name: SimpleNamespace(version=lambda: f"{name} 2"))
    monkeypatch.setattr(records, "made_by", lambda: {"commit": "c", "date": "d", "python": "3"})
    refusal = Unable(SCENE, "h", Cannot(Owner.MODEL, "no hinge"))
    records.measure(["known", "new"], [refusal], path, lambda *progress: seen.append(progress))
    assert ran == ["new"] and [(done, total) for done, total, _ in seen] == [(1, 2)]
    assert records.read(path)[1:] == [
        {
            "key": "h refuses s",
            "scene": "s",
            "engine": "h",
            "version": "h 2",
            "outcome": "REFUSED",
            "owner": "excluded by the engine's model",
            "message": "no hinge",
            "commit": "c",
            "date": "d",
        },
        {**{name: whole[name] for name in records.KEPT}, "key": "new", "metrics": numbers},
    ]
    records.measure(["newer"], [], path)
    assert ran == ["new", "newer"], "without a sign of progress"


# --- mechanisms and cells ---------------------------------------------------------------------------------
def test_places_of_mechanisms():
    built_in, file = Difficulty("h", "a", "bennett", 2.0), Difficulty("h", "a", "four_bar_free", 0.25)
    assert (
        built_in.place() == "bennett" and file.place() == "crosscheck/closed_loops/scenes/four_bar_free.toml"
    )
    assert built_in.make().duration == 2.0 and file.make().duration == 0.25
    assert file.make().name == "four_bar_free" and (ROOT / file.place()).parent == FOLDER
    assert [(c.heading, c.end) for c in DIFFICULTIES] == [
        ("four-bar", 1.0),
        ("redundant", 1.0),
        ("Bennett", 1.0),
        ("singular", 0.1),
        ("turned", 1.0),
        ("driven", 1.0),
        ("stiff spring", 0.2),
        ("long run", 5.0),
        ("coupling", 0.5),
    ]


@pytest.mark.parametrize(
    ("error", "bound", "text"),
    [
        (1e-2, 0.0, "1e-02"),
        (1.001e-2, 0.0, "0.01"),
        (0.126, 0.0, "0.13"),
        (3.4e-9, 3.4e-9, "3e-09"),
        (3.4e-9, 3.6e-9, "<4e-09"),
    ],
)
def test_sizes_of_errors_in_cells(error, bound, text):
    assert matrix._size(record(metrics={"error": error, "error_bound": bound})) == text


def refused(name: str = "h", **parts: Any) -> dict[str, Any]:
    made = record(engine=name, outcome="REFUSED", message="no hinge", owner="missing in the engine", **parts)
    del made["family"]
    return made


def cell(*found: dict[str, Any]) -> matrix.Cell:
    return matrix.Cell("some engine, a_b", Difficulty("head", "about", "bennett", 1.0), found)


def test_runs_of_a_cell_by_their_errors():
    poor, good = record(metrics={"error": 1e-3}), record(metrics={"error": 1e-5})
    ours, other = record(family="defaults", metrics={"error": 1e-2}), refused()
    assert cell(poor, good, ours).best() is good and cell().best() is None is cell().defaults()
    assert cell(poor, good).defaults() is None and cell(poor, ours).defaults() is ours
    assert cell(other).best() is other is cell(other).defaults() and cell(other).families() == {}
    assert cell(poor, good, ours).families() == {"f": good, "defaults": ours}
    assert cell().place == "some-engine-a-b-bennett"
    assert matrix.is_run(poor) and not matrix.is_run(other) and not matrix.is_run(None)
    assert matrix._order(other) == (True, 0.0, 0.0)


def test_tables_leave_rows_without_runs_by_defaults():
    """In the table of defaults an engine has a row if it has a run by its defaults."""
    ours = cell(record(family="defaults", metrics={"error": 1e-3}))
    tuned, other = cell(record(metrics={"error": 1e-9})), cell(refused())
    rows = {"with": {"head": ours}, "without": {"head": tuned}, "refuses": {"head": other}}
    best = [line for line in document._table(rows, True) if line.startswith(("| w", "| r"))]
    assert [line.split("|")[1].strip() for line in best] == ["with", "without", "refuses"]
    assert "1e-09" in best[1] and "–" in best[2]
    shown = [line for line in document._table(rows, False) if line.startswith(("| w", "| r"))]
    assert [line.split("|")[1].strip() for line in shown] == ["with"] and "1e-03" in shown[0]
