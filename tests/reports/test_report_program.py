"""The program that writes a report / stand-ins for its runs: options, sections, titles, and exit status."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from crosscheck.cli import collection
from mbref.scene import Body, Scene
from reports import __main__ as program
from reports import render as writing
from reports import sections, stored
from reports.blocks import Heading
from reports.sections import NAMES, closed_loops, paper, stability


def still(name: str) -> Scene:
    block = Body(name="block", mass=2.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 2.0, 3.0))
    return Scene(name=name, body=(block,), duration=0.5)


Calls = dict[str, tuple[Any, ...]]


@pytest.fixture
def calls(monkeypatch) -> Calls:
    """The arguments of the last call of each part of the program, which are stand-ins."""
    made: Calls = {}

    def stand_in(place: Any, name: str, key: str, value: Any) -> None:
        def called(*given: Any) -> Any:
            made[key] = given
            return value

        monkeypatch.setattr(place, name, called)

    found = collection.Collection([still("s")], ["r"], ["i"], ["t"], ["m"], ["b"])
    stand_in(collection, "comparison", "comparison", found)
    stand_in(collection, "stability_ladders", "ladders", "rungs")
    stand_in(collection, "closed_loops", "loops", "loops")
    stand_in(collection, "paper", "paper", collection.Paper("cells", "illustration"))
    stand_in(collection, "stored_ladders", "stored ladders", "stored rungs")
    stand_in(collection, "stored_paper", "stored paper", ("stored cells", "stored illustration"))
    stand_in(program, "by_scene", "by_scene", "runs by scene")
    stand_in(stored, "groups", "groups", "stored runs")
    stand_in(stored, "verified", "verified", "verdicts")
    stand_in(sections, "blocks", "blocks", [Heading("comparison")])
    stand_in(stability, "render", "stability", [Heading("stability")])
    stand_in(closed_loops, "render", "closed loops", [Heading("loops")])
    stand_in(paper, "render", "paper section", [Heading("paper")])
    stand_in(paper, "score", "score", "the score")
    stand_in(writing, "write", "write", None)
    return made


def headings(calls: Calls) -> list[str]:
    return [block.text for block in calls["write"][0]]


def test_a_whole_report_has_every_section(calls, capsys, tmp_path):
    assert program.main(["--depth", "whole", "--engine", "mbref", "--reference-time", "7"]) == 0
    out, wanted, notice = calls["comparison"]
    assert out == Path("report") and wanted == (None, ["mbref"], False, 7.0)
    assert calls["by_scene"] == (["r"], {"s": still("s")}, ["i"], ["t"], ["m"], ["b"])
    everything = (*NAMES, "stability", "closed_loops", "paper")
    assert calls["blocks"] == ("runs by scene", everything, "verdicts") and calls["verified"] == (out,)
    assert calls["ladders"] == (out, ["mbref"], notice) and calls["stability"] == ("rungs",)
    assert calls["closed loops"] == ("loops",) and calls["paper"] == (out, True, notice)
    assert calls["score"] == ("cells",) and calls["paper section"] == ("cells", "illustration")
    assert headings(calls) == ["comparison", "stability", "loops", "paper"]
    assert calls["write"][1:] == (out, writing.TITLE)
    printed = capsys.readouterr()
    assert printed.out == "the score\n"
    assert printed.err == "written: report/index.html and report/report.md\n"


@pytest.mark.parametrize("asked", [["--quick"], ["--depth", "quick"], ["--depth", "whole", "four_bar"]])
def test_quick_reports_and_reports_of_a_scene_have_no_sections_with_runs_of_their_own(asked, calls, tmp_path):
    assert program.main([*asked, "--out", str(tmp_path)]) == 0
    assert headings(calls) == ["comparison"] and calls["blocks"][1] == NAMES
    scenes, engines, is_quick, _ = calls["comparison"][1]
    assert is_quick == ("quick" in asked[-1]) and engines is None
    assert scenes is None if is_quick else [scene.name for scene in scenes] == ["four_bar"]


@pytest.mark.parametrize(
    ("section", "heading", "part"),
    [("stability", "stability", "ladders"), ("closed_loops", "loops", "loops"), ("paper", "paper", "paper")],
)
def test_a_section_alone_needs_its_own_records_only(section, heading, part, calls, tmp_path):
    assert program.main(["--section", section, "--out", str(tmp_path)]) == 0
    assert headings(calls) == [heading] and "comparison" not in calls and part in calls
    assert calls["write"][1:] == (tmp_path, program.TITLES[(section,)])
    assert program.main(["--section", section, "--section", "speed", "--out", str(tmp_path)]) == 0
    assert headings(calls) == ["comparison", heading] and calls["write"][2] == writing.TITLE
    assert calls["blocks"][1] == [section, "speed"]


def test_engines_of_the_stability_section(calls, tmp_path):
    assert program.main(["--section", "stability", "--engine", "mujoco", "--out", str(tmp_path)]) == 0
    assert calls["ladders"][:2] == (tmp_path, ["mujoco"])


def test_stored_records_are_rendered_by_section(calls, tmp_path):
    assert program.main(["--render", str(tmp_path)]) == 0
    assert headings(calls) == ["comparison"] and calls["blocks"] == ("stored runs", NAMES, "verdicts")
    assert calls["groups"] == calls["verified"] == (tmp_path,)
    asked = [word for name in ("stability", "closed_loops", "paper") for word in ("--section", name)]
    calls.clear()
    assert program.main(["--render", str(tmp_path), *asked]) == 0
    assert headings(calls) == ["stability", "loops", "paper"] and "groups" not in calls
    assert calls["stored ladders"] == calls["stored paper"] == (tmp_path,)
    assert calls["stability"] == ("stored rungs",) and calls["closed loops"] == ("loops",)
    assert calls["paper section"] == ("stored cells", "stored illustration")
    assert calls["write"][1:] == (tmp_path, writing.TITLE)
    assert not {"comparison", "ladders", "paper"} & calls.keys(), "nothing runs"


@pytest.mark.parametrize(("asked", "given"), [(["four_bar"], "scenes"), (["--engine", "mbref"], "engines")])
def test_sections_with_scenes_of_their_own_take_no_others(calls, tmp_path, capsys, asked, given):
    folder = tmp_path / "report"
    assert program.main([*asked, "--section", "paper", "--depth", "whole", "--out", str(folder)]) == 2
    assert f"--section paper: has {given} of its own; leave them out" in capsys.readouterr().err
    assert not folder.exists() and not calls, "something was run"


def test_a_scene_that_is_no_scene_is_refused_by_its_faults(tmp_path, capsys):
    (tmp_path / "bad.toml").write_text("gravity = 3\n")
    assert program.main([str(tmp_path / "bad.toml"), "--out", str(tmp_path / "out")]) == 2
    assert "gravity" in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_program_without_its_packages_and_what_to_install(capsys, monkeypatch):
    monkeypatch.setattr(program, "find_spec", lambda package: None)
    assert program.main([]) == 2
    assert "pip install 'mbref[report]'" in capsys.readouterr().err
