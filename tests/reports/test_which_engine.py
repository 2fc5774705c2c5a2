"""The page "Which engine, which settings": its text follows from the committed records."""

from __future__ import annotations

from pathlib import Path

import pytest

from reports.stored import groups
from reports.which_engine import FOLDERS, KINDS, judged, keep, page

DOCUMENT = Path(__file__).parents[2] / "docs" / "which-engine.md"


def test_document_and_generated_page():
    assert DOCUMENT.read_text() == page(), (
        "docs/which-engine.md is stale: python -m reports.which_engine docs/which-engine.md renews it"
    )


def test_every_kind_has_records():
    known = {group.scene.name for folder in FOLDERS for group in groups(folder)}
    assert known >= {name for kind in KINDS for name in kind.scenes}


@pytest.fixture
def folder(tmp_path):
    """A folder with the records of one scene: the plane slider-crank of the reference report."""
    keep([group for group in groups(FOLDERS[0]) if group.scene.name == "planar_slider_crank"], tmp_path)
    return tmp_path


def test_kept_records_give_the_answers_of_whole_ones(folder):
    (kept,) = groups(folder)
    whole = next(group for group in groups(FOLDERS[0]) if group.scene.name == kept.scene.name)
    assert "bodies" not in kept.runs[0].record and len(kept.runs) == len(whole.runs)
    found, expected = (group.cheapest(1e-6) for group in map(judged, (kept, whole)))
    assert {e: r["key"] for e, r in found.items()} == {e: r["key"] for e, r in expected.items()}


def test_another_record_gives_another_answer(folder):
    """An engine whose runs all fail has no run within the error, and the page says how they end."""
    text = (folder / "records.jsonl").read_text()
    lines = [
        line.replace('"COMPLETED"', '"STEP_FAILED"') if '"engine": "mujoco"' in line else line
        for line in text.splitlines()
    ]
    (folder / "records.jsonl").write_text("\n".join(lines) + "\n")
    row = next(line for line in page([folder]).splitlines() if line.startswith("| MuJoCo | "))
    assert row.startswith("| MuJoCo | none | – | – | ") and "step failed" in row


def test_a_scene_without_its_truth_is_refused(folder):
    (folder / "truths.jsonl").write_text("")
    (group,) = groups(folder)
    with pytest.raises(ValueError, match="no record of its truth"):
        judged(group)
