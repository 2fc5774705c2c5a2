"""The committed page on the paper equals its records, rendered again; the page of the site."""

import re
from pathlib import Path

import pytest

from crosscheck.cli import collection
from crosscheck.paper.cells import CELLS
from crosscheck.paper.runs import Label, has
from reports import __main__ as program
from reports import render
from reports.sections import paper

FOLDER = Path(__file__).parents[2] / "reports" / "paper"
README = (Path(__file__).parents[2] / "README.md").read_text()
HOOKS = Path(__file__).parents[2] / "docs" / "hooks.py"


@pytest.fixture(scope="module")
def records():
    return collection.stored_paper(FOLDER)


def test_committed_text_on_the_paper_follows_from_the_stored_records(records):
    """reports/paper/report.md is rendered again, and is equal letter by letter."""
    text = render.markdown(paper.render(*records), program.TITLES[program.PAPER,])
    kept = (FOLDER / "report.md").read_text()
    assert text == kept, "crosscheck report --section paper --render reports/paper renews it"


def test_every_cell_of_the_paper_and_two_studies_have_stored_records(records):
    """CELLS are the cells of the paper's tables; the studies are of growing violations and of gains."""
    missing = [c for c in CELLS if Label(c.table, c.row, c.column) not in records.records]
    assert not missing, missing
    assert has(records.records, "growth") and has(records.records, "gain")


def test_committed_page_shows_the_figures_of_the_paper_s_numbers():
    """The paper's kinematic analysis has figures 4, 5, 6 and 8, its dynamic analysis figures 11 to 16."""
    text = (FOLDER / "report.md").read_text()
    for number in (4, 5, 6, 8, *range(11, 17)):
        assert f"](figures/paper-figure-{number}.svg)" in text, number
        assert (FOLDER / "figures" / f"paper-figure-{number}.svg").stat().st_size > 1000, number


def test_paper_s_records_are_of_one_clean_commit_that_the_readme_states(records):
    """A "+" marks a commit with changes; README has the first seven letters of the commit."""
    commits = {record["commit"] for record in records.records.values()}
    [commit] = commits
    assert "+" not in commit, f"made from a clean checkout: {commit}"
    assert f"records of commit {commit[:7]}" in README, "README states the commit of the paper's records"


def test_no_stored_run_of_the_paper_timed_out_or_crashed(records):
    """Both ends are those of a process, and say nothing about a method."""
    ended = [label for label, r in records.records.items() if r["outcome"] in ("TIMED_OUT", "CRASHED")]
    assert not ended, ended


def test_page_of_the_site_has_the_tables_and_a_figure_of_the_report_on_the_paper():
    """The page, which docs/hooks.py makes, has as many lines of tables as the report, more than 100."""
    pytest.importorskip("mkdocs", reason="the extra docs builds the site")
    import importlib.util

    found = importlib.util.spec_from_file_location("site_hooks", HOOKS)
    hooks = importlib.util.module_from_spec(found)
    found.loader.exec_module(hooks)
    body, text = hooks.paper(), (FOLDER / "report.md").read_text()
    assert len(re.findall(r"^\|", body, re.M)) == len(re.findall(r"^\|", text, re.M)) > 100
    assert "](figures/paper-figure-4.svg)" in body
