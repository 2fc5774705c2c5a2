"""The page, Markdown and pictures that are written from blocks; repeated timings of short runs."""

import html
import re
from html.parser import HTMLParser
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


class Checked(HTMLParser):
    """Record elements that are closed in another order than opened, pictures (``<svg role=...>``) whose first
    element is no title, attributes of scripts, and addresses of what the page loads or leads to."""

    VOID = ("meta", "link", "input", "br", "wbr", "img", "hr")

    def __init__(self) -> None:
        super().__init__()
        self.open, self.faults, self.scripts, self.addresses, self.pictures = [], [], [], [], 0
        self.untitled = False

    def handle_starttag(self, tag, attrs):
        named = dict(attrs)
        if tag not in self.VOID:
            self.open.append(tag)
        if self.untitled and tag != "title":
            self.faults.append("a picture without a name")
        self.untitled = tag == "svg" and "role" in named
        self.pictures += self.untitled
        self.scripts += [named] if tag == "script" else []
        self.addresses += [named[name] for name in ("src", "href") if name in named]

    def handle_endtag(self, tag):
        if not self.open or self.open.pop() != tag:
            self.faults.append(f"</{tag}> at {self.getpos()}")


def test_page_is_well_formed_html_with_one_small_script_that_loads_nothing(written):
    """Elements close in order; six pictures have a title each. Addresses are places of the page and the empty
    icon, also in styles. The script is part of the page, has less than 10_000 letters, and names no address,
    request or module."""
    checked, page = Checked(), (written / "index.html").read_text()
    checked.feed(page)
    assert not re.search(r"""(?:url|@import)\s*[(=]\s*["']?http""", page)
    assert not checked.faults and not checked.open, (checked.faults, checked.open)
    assert checked.pictures == 6 and checked.scripts == [{}]
    assert {address for address in checked.addresses if address[0] != "#"} == {"data:,"}
    [script] = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    assert 0 < len(script) < 10_000 and not re.search(r"http|fetch\(|import|XMLHttp", script)


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
