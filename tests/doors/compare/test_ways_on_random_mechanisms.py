"""Ways of an engine, settings that should give equal accelerations: differences, causes, stored records."""

import pytest

from crosscheck.alternatives.records import compared, mechanism, read
from crosscheck.alternatives.table import above, causes, engines
from crosscheck.cli.commands import main
from crosscheck.conformance.runners import InProcess
from crosscheck.engine import Alternatives, Setting
from crosscheck.findings.finding import findings
from mbref.records import rewrite
from tests.helpers.falling_engine import ENGINE, STONE

FACTORS = {"right": 1.0, "heavy": 1.5, "also right": 1.0}  # of gravity, by the name of a way
DIGITS = 2e-3  # relative; differences are stored with three digits


def falls() -> dict:
    """Return the comparison of ways in which a stone falls with its weight, or with one and a half of it."""
    ways = {name: Setting("plain", {"factor": factor}) for name, factor in FACTORS.items()}
    return compared(InProcess(ENGINE), STONE, Alternatives(ways, 1e-3))


def test_differences_of_ways_are_relative_to_the_larger_acceleration_and_gauss_names_the_wrong_way():
    """Accelerations g and 1.5 g differ by a third of the larger one. Gauss's principle gives g, so that the
    way with 1.5 g is off by half of the right acceleration."""
    found = falls()
    sizes = {(first, second): size for first, second, size, *_ in found["pairs"]}
    assert sizes == {
        ("right", "heavy"): pytest.approx(1 / 3, rel=DIGITS),
        ("right", "also right"): 0.0,  # equal numbers
        ("heavy", "also right"): pytest.approx(1 / 3, rel=DIGITS),
    }
    right = pytest.approx(0.0, abs=1e-14)  # 50 roundings
    assert found["off"] == {"right": right, "heavy": pytest.approx(0.5, rel=DIGITS), "also right": right}
    assert found["ended"] == dict.fromkeys(FACTORS, "")


def test_command_names_pairs_above_their_limit_whose_cause_is_not_listed(tmp_path, capsys):
    """A stone falls with g or with 1.5 g: a difference of a third of the larger, above the limit of 1e-3. The
    list of causes has none for an engine "stone"."""
    record = {"key": "stone 0", "engine": "stone", "version": "1.0", "seed": 0, "scene": STONE.name}
    record |= {"bodies": 1, "clearance": 1.0, "redundant": 0, "refused": "", "groups": [falls()]}
    rewrite(path := tmp_path / "records.jsonl", [record])
    assert main(["alternatives", "--records", str(path)]) == 0
    shown = capsys.readouterr().out
    assert f"stone, right – heavy: up to 3e-01 on {STONE.name}: not found" in shown
    assert f"stone, heavy – also right: up to 3e-01 on {STONE.name}: not found" in shown
    assert "right – also right" not in shown


def test_folder_of_records_is_asked_for_before_engines_run(tmp_path, capsys):
    """Runs take minutes, so that a missing folder is named first."""
    asked = ["--run", "--engine", "mbref", "--records", str(tmp_path / "missing" / "records.jsonl")]
    assert main(["alternatives", *asked]) == 2 and "there is no folder" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("number", "fewest", "most"), [(0, 5, 60), (3, 5, 60), pytest.param(9, 61, 200, marks=pytest.mark.slow)]
)
def test_every_tenth_mechanism_is_large(number, fewest, most):
    """Mechanisms 9, 19, 29 … have 61 to 200 bodies, all others 5 to 60."""
    assert fewest <= len(mechanism(number).body) <= most


def test_each_difference_above_a_limit_in_the_stored_records_has_a_cause():
    """A file lists causes by engine and ways: records need exactly these, and the named findings exist."""
    shown = {each.cause for each in above(engines(read()))}
    assert shown == set(causes())
    assert {cause.finding for cause in causes()} - {""} <= {finding.name for finding in findings()}
