"""The program that writes a report: refusals, before anything runs."""

import pytest

from reports import __main__ as program
from tests.helpers.intermittent_mechanisms import carts

PAPER = ["--section", "paper", "--depth", "whole"]


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        (["four_bar", *PAPER], "--section paper: has scenes of its own; leave them out"),
        (["--engine", "mbref", *PAPER], "--section paper: has engines of its own; leave them out"),
        (["bad.toml"], "gravity"),
        (["carts.toml"], "joint[L].active: no report's section verdict or mechanism or"),
    ],
    ids=["scene for the paper", "engine for the paper", "faulty field", "latch"],
)
def test_report_is_refused_with_the_reason_and_makes_no_folder(tmp_path, monkeypatch, capsys, asked, says):
    """The paper's section has mechanisms of its own, run by mbref. A file has a number as its gravity. A page
    on energies has one set of constraints, which a latch changes."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.toml").write_text("gravity = 3\n")
    carts().save(tmp_path / "carts.toml")
    assert program.main([*asked, "--out", "out"]) == 2
    assert says in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_report_without_its_packages_says_what_to_install(capsys, monkeypatch):
    """`find_spec` is replaced: it finds no package, as where the extra `report` is not installed."""
    monkeypatch.setattr(program, "find_spec", lambda package: None)
    assert program.main([]) == 2
    assert "pip install 'mbref[report]'" in capsys.readouterr().err
