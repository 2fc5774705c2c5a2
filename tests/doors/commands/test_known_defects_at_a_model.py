"""Known defects of engines at a user's mechanism: said where short runs show them, and nowhere else."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from crosscheck.cli.commands import main
from crosscheck.engine import Setting, engine
from crosscheck.findings.at_model import defects
from crosscheck.findings.finding import Finding, When
from tests.helpers.falling_engine import STONE

CHAINS = Path(__file__).parents[3] / "examples" / "four_chains.xml"
ENGINE = "tests.helpers.falling_engine:ENGINE"


def said(options: Mapping[str, Any], remedy: Mapping[str, Any], **conditions: Any) -> list[str]:
    """Return the sentences on an engine with a setting, whose finding has a remedy and conditions."""
    when = When("falls too fast", "set factor = 1", ["plain"], 1e-3, options=remedy, **conditions)
    words = dict.fromkeys(("package", "version", "does", "right", "cause"), "a")
    found = Finding(name="too-fast", engine=ENGINE, when=when, **words)
    shown = defects(STONE, [ENGINE], lambda name: [Setting("plain", options)], [found])
    return [one.sentence for one in shown]


def test_defect_is_reported_where_its_remedy_mends_the_accelerations():
    """The stone falls with 1.5 g, off by (1.5 - 1) g of g; with the remedy it falls with g."""
    (sentence,) = said({"factor": 1.5}, {"factor": 1.0}, versions=["1.0"])
    assert "1.0 falls too fast and is wrong there: set factor = 1" in sentence
    assert "off by 0.5 of the largest, otherwise by 0" in sentence


@pytest.mark.parametrize(
    ("options", "remedy", "conditions"),
    [
        ({"factor": 1.0}, {"factor": 1.0}, {}),
        ({"factor": 1.0}, {"factor": 1.5}, {}),
        ({"factor": 1.5}, {"factor": 1.0}, {"versions": ["1.1"]}),
        ({"factor": 1.5}, {"factor": 1.0}, {"loops": 1}),
        ({"factor": 1.5}, {"factor": 1.0}, {"joints": ["revolute"]}),
    ],
    ids=["remedy changes nothing", "remedy makes it wrong", "other version", "no loop", "no hinge"],
)
def test_no_defect_is_reported_without_an_improvement_or_where_its_conditions_are_not_met(
    options: dict[str, Any], remedy: dict[str, Any], conditions: dict[str, Any]
):
    """Factors are of gravity. The engine has the version 1.0, and the stone neither loops nor joints."""
    assert said(options, remedy, **conditions) == []


@pytest.mark.slow
def test_sparse_jacobian_of_mujoco_4_0_0_is_named_at_a_file_with_several_loops(capsys):
    """MuJoCo 4.0.0 factorises the sparse matrix of this file wrongly: one defect, exit status 1. Other
    versions have no defect there, and status 0."""
    status = main(["diagnose", str(CHAINS), "--engine", "mujoco", "--json"])
    (found,) = json.loads(capsys.readouterr().out)["engines"]
    is_wrong = engine("mujoco").version() == "4.0.0"
    assert status == is_wrong and len(found["defects"]) == is_wrong
