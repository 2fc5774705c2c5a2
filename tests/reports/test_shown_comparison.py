"""The extract of a comparison in docs/compare.md: its lines and those that a comparison prints."""

import re
from pathlib import Path

from crosscheck.cli.comparison import Comparison
from reports.pages.which_engine import REPORTS, judged
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
