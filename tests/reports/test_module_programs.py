"""Modules that are programs, too / each run as ``python -m`` in this process: what it prints and writes."""

from __future__ import annotations

import json
import runpy
import shutil
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from test_which_engine_by_hand import RECORDS, TRUTH

from crosscheck import engine
from crosscheck.cli import support
from crosscheck.conformance import features
from crosscheck.findings import document, finding
from mbref.scenes import SCENES
from reports import ladders, stored, which_engine
from reports.runs import Run, SceneRuns


def run(module: ModuleType | Path, *words: str) -> None:
    path = module if isinstance(module, Path) else module.__file__
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["program", *words])
        runpy.run_path(str(path), run_name="__main__")


def test_ladders_are_kept_in_another_folder(tmp_path):
    record = {name: name for name in (*ladders.KEPT, *ladders.ORIGIN)} | {"bodies": [1]}
    (tmp_path / ladders.FILE).write_text(json.dumps(record) + "\n")
    run(ladders, str(tmp_path), str(tmp_path / "kept"))
    kept = json.loads((tmp_path / "kept" / ladders.FILE).read_text())
    assert "bodies" not in kept and kept["scene"] == "scene" and kept["date"] == "date"
    with pytest.raises(SystemExit):
        run(ladders, str(tmp_path))


def test_the_page_of_findings_is_printed_or_written(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(finding, "findings", lambda: [])
    run(document)
    printed = capsys.readouterr().out
    assert printed.startswith("# ") and printed.count("| finding | engine | version | measured |") == 1
    run(document, str(tmp_path / "page.md"))
    assert (tmp_path / "page.md").read_text() == printed and capsys.readouterr().out == ""


def test_the_support_table_is_printed_or_replaced(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(features, "feature_scenes", lambda: {"hinge": SCENES["heavy_top"]()})
    for name in ("BUILT_IN", "OPTIONAL", "LARGE"):
        monkeypatch.setattr(engine, name, ("mbref",) if name == "BUILT_IN" else ())
    run(support)
    table = capsys.readouterr().out
    assert table.startswith("<!-- support -->\n| feature | mbref |\n| --- | :-: |\n") and table.endswith(
        "<!-- /support -->\n"
    )
    assert "\n| hinge | ✓ |\n" in table and "\n| motion without masses |" in table
    page = tmp_path / "engines.md"
    page.write_text("before\n<!-- support -->\nold\n<!-- /support -->\nafter\n")
    run(support, str(page))
    assert page.read_text() == f"before\n{table}after\n" and capsys.readouterr().out == ""


@pytest.fixture
def program(tmp_path, monkeypatch) -> Path:
    """A copy of the page's module, beside which it has its folders; records of two scenes are stored."""
    shutil.copy(which_engine.__file__, tmp_path / "page.py")
    (tmp_path / "reference").mkdir()
    (tmp_path / "kinds").mkdir()

    def group(name: str, *records: dict[str, Any]) -> SceneRuns:
        scene = SCENES["planar_slider_crank"]().model_copy(update={"name": name})
        return SceneRuns(scene, [Run(record | {"scene": name}) for record in records], truth=TRUTH)

    found = {
        "reference": [group("planar_slider_crank", *RECORDS[:2])],
        "kinds": [group("four_bar", RECORDS[0]), group("heavy_top", RECORDS[0])],
        "report": [group("four_bar", RECORDS[1])],
    }
    monkeypatch.setattr(stored, "groups", lambda folder: found[folder.name])
    monkeypatch.setattr(stored, "verified", lambda folder: [])
    monkeypatch.setattr(finding, "findings", lambda: [])
    return tmp_path / "page.py"


def test_the_page_on_engines_is_printed_or_written(program, tmp_path, capsys):
    run(program)
    printed = capsys.readouterr().out
    assert printed.startswith("# Which engine") and "`planar_slider_crank` over" in printed
    run(program, str(tmp_path / "page.md"))
    assert (tmp_path / "page.md").read_text() == printed and capsys.readouterr().out == ""


def test_records_of_a_report_replace_kept_ones_of_their_scenes(program, tmp_path, capsys):
    run(program, "--keep", str(tmp_path / "report"))
    lines = [json.loads(line) for line in (tmp_path / "kinds" / "records.jsonl").read_text().splitlines()]
    kept = [(record["scene"], record["metrics"]["error"]) for record in lines]
    assert kept == [("four_bar", 1e-4), ("heavy_top", 1e-7)] and capsys.readouterr().out == ""
