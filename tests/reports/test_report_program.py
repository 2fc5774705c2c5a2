"""The program that writes a report: refusals, before anything runs."""

import pytest

from reports import __main__ as program
from tests.helpers.intermittent_mechanisms import carts


@pytest.mark.parametrize(("asked", "given"), [(["four_bar"], "scenes"), (["--engine", "mbref"], "engines")])
def test_paper_section_refuses_scenes_and_engines(tmp_path, capsys, asked, given):
    """The section has the paper's mechanisms, run by mbref; no folder is made."""
    folder = tmp_path / "report"
    assert program.main([*asked, "--section", "paper", "--depth", "whole", "--out", str(folder)]) == 2
    assert f"--section paper: has {given} of its own; leave them out" in capsys.readouterr().err
    assert not folder.exists()


def test_report_on_a_faulty_scene_file_is_refused_with_the_faulty_field(tmp_path, capsys):
    """Gravity is a number instead of a vector; no folder is made."""
    (tmp_path / "bad.toml").write_text("gravity = 3\n")
    assert program.main([str(tmp_path / "bad.toml"), "--out", str(tmp_path / "out")]) == 2
    assert "gravity" in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_report_on_a_latch_is_refused_before_anything_runs_and_names_sections_that_have_none(
    tmp_path, capsys
):
    """A page on energies has one set of constraints. No folder is made."""
    carts().save(tmp_path / "carts.toml")
    assert program.main([str(tmp_path / "carts.toml"), "--out", str(tmp_path / "out")]) == 2
    assert "joint[L].active: no report's section verdict or mechanism or" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_report_without_its_packages_says_what_to_install(capsys, monkeypatch):
    """`find_spec` is replaced: it finds no package, as where the extra `report` is not installed."""
    monkeypatch.setattr(program, "find_spec", lambda package: None)
    assert program.main([]) == 2
    assert "pip install 'mbref[report]'" in capsys.readouterr().err
