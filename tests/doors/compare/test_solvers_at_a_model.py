"""Solvers of an engine that differ at a user's mechanism: `compare` and `diagnose` name the right one."""

import json
from pathlib import Path

import pytest

import crosscheck
from crosscheck.alternatives.at_model import disagreements
from crosscheck.cli.commands import main
from crosscheck.engine import engine, installed
from crosscheck.invariants.experiments import four_bar
from tests.helpers.falling_engine import STONE
from tests.helpers.intermittent_mechanisms import intermittent_mechanism

CHAINS = Path(__file__).parents[3] / "examples" / "four_chains.xml"
SEVERAL = "tests.helpers.falling_engine:SEVERAL"


def test_way_with_too_much_gravity_is_named_beside_the_way_that_gauss_principle_supports():
    """A stone falls with g or with 1.5 g: they differ by a third of the larger. Gauss's principle gives g."""
    (found,) = disagreements(STONE, [SEVERAL])
    assert found.apart == pytest.approx(1 / 3, rel=1e-12) and found.ways == ("light", "heavy")
    assert "in acceleration of 'stone'; Gauss's principle supports 'light'" in found.sentence
    assert disagreements(STONE.with_(gravity=(0.0, 0.0, 0.0)), [SEVERAL]) == []  # nothing moves
    assert disagreements(intermittent_mechanism(1), [SEVERAL]) == []  # has no one set of equations


def test_compare_shows_solvers_that_differ():
    """The comparison prints the pair, and its document contains it; the mechanism is the one above."""
    found = crosscheck.compare(STONE, [SEVERAL], samples=3)
    assert "Solvers differ: " in str(found)
    (pair,) = found.document()["disagreements"]
    assert pair["ways"] == ("light", "heavy") and pair["engine"] == SEVERAL


@pytest.mark.slow
@pytest.mark.skipif(not installed("mujoco"), reason="MuJoCo is not installed")
def test_diagnose_names_mujocos_sparse_factors_on_four_chains_and_nothing_on_a_four_bar(tmp_path, capsys):
    """Finding `mujoco-sparse-jacobian-of-loops`: 4.0.0 is off by about the largest acceleration; Gauss's
    principle supports a dense Jacobian. A four-bar has one loop, on which the factors are right."""
    four_bar().save(path := tmp_path / "four_bar.toml")
    status = main(["diagnose", str(CHAINS), str(path), "--engine", "mujoco", "--json"])
    chains, bar = (one["engines"][0]["disagreements"] for one in json.loads(capsys.readouterr().out))
    is_wrong = engine("mujoco").version() == "4.0.0"
    assert status == is_wrong and bar == [] and len(chains) == is_wrong
    for pair in chains:
        right = pair["sentence"].split("supports '")[1].split("'")[0]
        (wrong,) = set(pair["ways"]) - {right}
        assert pair["apart"] > 0.5 and "sparse" in wrong and "Newton" in wrong
