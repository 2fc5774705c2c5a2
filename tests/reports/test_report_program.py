"""The program that writes a report: refusals, before anything runs."""

from __future__ import annotations

import pytest

from reports import __main__ as program


@pytest.mark.parametrize(("asked", "given"), [(["four_bar"], "scenes"), (["--engine", "mbref"], "engines")])
def test_sections_with_scenes_of_their_own_take_no_others(tmp_path, capsys, asked, given):
    folder = tmp_path / "report"
    assert program.main([*asked, "--section", "paper", "--depth", "whole", "--out", str(folder)]) == 2
    assert f"--section paper: has {given} of its own; leave them out" in capsys.readouterr().err
    assert not folder.exists(), "something was run"


def test_a_scene_that_is_no_scene_is_refused_by_its_faults(tmp_path, capsys):
    (tmp_path / "bad.toml").write_text("gravity = 3\n")
    assert program.main([str(tmp_path / "bad.toml"), "--out", str(tmp_path / "out")]) == 2
    assert "gravity" in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_program_without_its_packages_and_what_to_install(capsys, monkeypatch):
    monkeypatch.setattr(program, "find_spec", lambda package: None)
    assert program.main([]) == 2
    assert "pip install 'mbref[report]'" in capsys.readouterr().err
