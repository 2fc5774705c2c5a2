"""The committed stability ladders equal their records, rendered again; a record for every run."""

from pathlib import Path

import pytest

from crosscheck.cli.collection import stored_ladders
from crosscheck.study import stability
from reports import __main__ as program
from reports import render
from reports.sections import stability as section

FOLDER = Path(__file__).parents[2] / "reports" / "stability"


@pytest.fixture(scope="module")
def records():
    return stored_ladders(FOLDER)


def test_committed_text_on_stability_follows_from_the_stored_records(records):
    """reports/stability/report.md is rendered again, and is equal letter by letter."""
    text = render.markdown(section.render(records), program.TITLES[program.STABILITY,])
    kept = (FOLDER / "report.md").read_text()
    assert text == kept, "crosscheck report --section stability --render reports/stability renews it"


def test_every_method_has_a_stored_run_at_every_difficulty(records):
    """All of them were made from one commit without changes ("+")."""
    found = {(record["scene"], record["family"]) for record in records if record["engine"] == stability.MBREF}
    missing = {(scene.name, method) for scene in stability.scenes() for method in stability.METHODS} - found
    assert not missing, missing
    [commit] = {record["commit"] for record in records}
    assert "+" not in commit, f"made from a clean checkout: {commit}"
