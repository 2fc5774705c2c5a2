"""The page "Which engine, which settings" and the extract of a comparison follow from committed records."""

import re
import zipfile
from pathlib import Path

import pytest

from crosscheck.cli.comparison import Comparison
from reports.keep import keep
from reports.markdown import body
from reports.pages.which_engine import FOLDERS, KINDS, REPORTS, judged, parts
from reports.stored import groups

PAGE = Path(__file__).parents[2] / "docs" / "compare.md"
HEADINGS = re.compile(
    r"^(Who is right|How fast|Where each breaks|How the truth is known|runs|settings to use|to copy)"
)


def test_extract_in_the_docs_has_the_printed_headings_in_order_and_the_printed_columns():
    """Runs of the plane slider-crank in the reference report print seven headings, of which the first 12
    letters are compared, and the line of columns from "engine, family" to "ratio"."""
    group = next(g for g in groups(REPORTS / "reference") if g.scene.name == "planar_slider_crank")
    printed = str(Comparison(judged(group), "planar_slider_crank", None)).splitlines()
    _, extract, _ = re.split("<!-- /?compare -->", PAGE.read_text())
    shown, starts = (
        [line[:12].strip() for line in lines if HEADINGS.match(line)]
        for lines in (extract.splitlines(), printed)
    )
    assert len(shown) == 7 and shown == starts
    [columns] = re.findall(r"^ +engine, family .* ratio$", PAGE.read_text(), re.M)
    assert columns.split() in [line.split() for line in printed]


def test_every_scene_of_the_page_has_records():
    """The page's kinds of mechanisms name the scenes; FOLDERS have the committed records."""
    known = {group.scene.name for name in FOLDERS for group in groups(REPORTS / name)}
    assert known >= {name for kind in KINDS for name in kind.scenes}


@pytest.fixture
def folder(tmp_path):
    """A folder with the records of one scene: the plane slider-crank of the reference report."""
    found, place = groups(REPORTS / "reference"), tmp_path / "reference"
    keep([group for group in found if group.scene.name == "planar_slider_crank"], tmp_path)
    zipfile.ZipFile(tmp_path / "records.zip").extractall(place)
    return place


def test_page_says_none_for_an_engine_whose_runs_all_failed(folder):
    """All of MuJoCo's runs are changed to STEP_FAILED: its row has no setting, and says how they end."""
    text = (folder / "records.jsonl").read_text()
    lines = [
        line.replace('"COMPLETED"', '"STEP_FAILED"') if '"engine": "mujoco"' in line else line
        for line in text.splitlines()
    ]
    (folder / "records.jsonl").write_text("\n".join(lines) + "\n")
    text = body(parts(folder.parent)["kinds"])
    row = next(line for line in text.splitlines() if line.startswith("| MuJoCo | "))
    assert row.startswith("| MuJoCo | none | – | – | ") and "step failed" in row


def test_records_without_a_truth_are_refused(folder):
    """The file of truths is emptied: no run can be judged."""
    (folder / "truths.jsonl").write_text("")
    (group,) = groups(folder)
    with pytest.raises(ValueError, match="no record of its truth"):
        judged(group)
