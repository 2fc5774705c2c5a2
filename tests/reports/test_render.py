"""The page, Markdown and pictures that are written from blocks; repeated timings of short runs."""

import html
import re
from pathlib import Path

import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.study.grid import study
from crosscheck.study.search import selection
from crosscheck.study.search.offers import default_cases
from crosscheck.study.timings import LONG, with_timings
from mbref.scene import Body, Scene
from reports import render
from reports.blocks import Block, Figure, Heading, Matrix, Plot, Table
from reports.sections import blocks
from tests.reports.synthetic import groups, records

FAKE = "tests.helpers.fake_engines:FAKE"


@pytest.fixture(scope="module")
def parts() -> list[Block]:
    return blocks(groups())


@pytest.fixture(scope="module")
def written(parts: list[Block], tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("report")
    render.write(parts, out)
    return out


def test_page_has_every_heading_figure_table_and_failed_run(written, parts):
    """Figures are wide pictures, plots are interactive, and one mechanism moves. Each of the four failed runs
    of `records` has its message, with escaped characters."""
    page = (written / "index.html").read_text()
    for block in parts:
        if isinstance(block, Heading):
            assert f">{block.text}</h{block.level}>" in page, block
    for kind, mark in ((Figure, 'class="wide"'), (Plot, 'class="plot"'), (Table, '<table class="cards">')):
        assert page.count(mark) == sum(isinstance(block, kind) for block in parts) > 0, kind
    assert page.count('mbref-moving">') == 1
    failed = [record for record in records() if record["outcome"] != "COMPLETED"]
    assert len(failed) == 4 and all(html.escape(record["message"]) in page for record in failed)


def test_page_opens_offline(written):
    """No script, style, picture or frame is loaded from elsewhere; a page with one of them is recognised."""
    tag = r"""<(?:script|link|img|iframe)\b[^>]*(?:src|href)=(?!"data:,")[^>]*"""
    address = r"""(?:url|src|@import)\s*[(=]\s*["\']?http[^)"\']*"""
    loads = re.compile(f"{tag}|{address}")
    page = (written / "index.html").read_text()
    assert not loads.findall(page)
    for element in ('<script src="a.js">', '<link rel="stylesheet" href="a.css">', "url(http://a.org/b.png)"):
        assert loads.search(page.replace("</body>", f"{element}</body>")), element


def test_markdown_shows_eight_figures_as_png_and_svg(written):
    """Two scenes have four figures each. A picture of less than 5_000 bytes would be nearly empty."""
    text = (written / "report.md").read_text()
    shown = re.findall(r"!\[[\w-]+\]\(([^)]+)\)", text)
    assert len(set(shown)) == 8, shown
    for name in shown:
        assert (written / name).stat().st_size > 5_000, f"{name} is nearly empty"
        assert (written / name).with_suffix(".svg").exists(), name


def test_markdown_table_has_one_line_for_each_row(written, parts):
    """Two more lines are the header and the rule below it; a line break in a cell would break a row."""
    lines = (written / "report.md").read_text().split("\n")
    rows = [b.rows if isinstance(b, Table) else b.scenes for b in parts if isinstance(b, Table | Matrix)]
    assert sum(line.startswith("| ") for line in lines) == sum(len(of_table) + 2 for of_table in rows)
    assert not (broken := [line for line in lines if line.startswith("|") and not line.endswith("|")]), broken


def still(name: str) -> Scene:
    block = Body(name="block", mass=2.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 2.0, 3.0))
    return Scene(name=name, body=(block,), duration=0.5)


def few(scenes, engines) -> selection.Sweep:
    return default_cases(scenes[0], engines, None, np.linspace(0, 0.5, 4))


def test_short_runs_are_timed_five_times_and_long_runs_once(tmp_path):
    """A fake engine says that its runs take 0.1, 0.2, 0.5 s and 2 LONG, where LONG is the time from which one
    run suffices; the stored costs stay as it says."""
    cases, _ = few([still("still")], [FAKE])
    long = cases[0]._replace(setting=Setting("plain", {"seconds": 2 * LONG}))
    cases = [*cases, long]
    timed = with_timings(cases, study(cases), tmp_path / "timings.jsonl", lambda _: None)
    assert [r.get("timing", {}).get("repeats") for r in timed] == [5, 5, 5, None], timed
    assert [r["cost"]["seconds"] for r in timed] == [0.1, 0.2, 0.5, 2 * LONG]
