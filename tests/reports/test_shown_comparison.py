"""The extract of a comparison in docs/compare.md: its lines and those that a comparison prints."""

import re
from pathlib import Path

import pytest

from crosscheck.cli.comparison import Comparison
from reports.pages.which_engine import REPORTS, judged
from reports.stored import groups

PAGE = Path(__file__).parents[2] / "docs" / "compare.md"
HEADINGS = re.compile(
    r"^(Who is right|How fast|Where each breaks|How the truth is known|runs|settings to use|to copy)"
)


@pytest.fixture(scope="module")
def printed() -> str:
    """Return the output for the plane slider-crank of the reference report."""
    group = next(g for g in groups(REPORTS / "reference") if g.scene.name == "planar_slider_crank")
    return str(Comparison(judged(group), "planar_slider_crank", None))


def test_extract_in_the_docs_has_the_printed_headings_in_order(printed):
    """The comparison of stored runs prints seven headings; their first 12 letters are compared."""
    _, extract, _ = re.split("<!-- /?compare -->", PAGE.read_text())
    shown = [line for line in extract.splitlines() if HEADINGS.match(line)]
    starts = [line[:12].strip() for line in printed.splitlines() if HEADINGS.match(line)]
    assert len(shown) == 7 and [line[:12].strip() for line in shown] == starts


def test_extract_in_the_docs_has_the_printed_columns(printed):
    """The line of headings from "engine, family" to "ratio" is among the printed lines."""
    [columns] = re.findall(r"^ +engine, family .* ratio$", PAGE.read_text(), re.M)
    assert columns.split() in [line.split() for line in printed.splitlines()]
