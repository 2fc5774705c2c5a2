"""Committed reports equal their records, rendered again; their records are whole, and of one clean commit."""

import importlib.util
import re
from pathlib import Path

import pytest

from crosscheck.cli import collection
from crosscheck.paper.cells import CELLS
from crosscheck.paper.runs import Label, has
from crosscheck.study import stability
from mbref.scenes import SCENES
from reports import __main__ as program
from reports import render, sections, stored
from reports.blocks import Figure, Plot
from reports.runs import SceneRuns
from reports.sections import paper
from reports.sections import stability as ladders

ROOT = Path(__file__).parents[2]
REFERENCE, PAPER, STABILITY = (ROOT / "reports" / name for name in ("reference", "paper", "stability"))
README = (ROOT / "README.md").read_text()


@pytest.fixture(scope="module")
def groups() -> list[SceneRuns]:
    return stored.groups(REFERENCE)


@pytest.fixture(scope="module")
def of_paper():
    return collection.stored_paper(PAPER)


@pytest.fixture(scope="module")
def of_ladders():
    return collection.stored_ladders(STABILITY)


def test_sections_of_the_committed_report_follow_from_the_stored_records(groups):
    """Each of more than 100 blocks stands in report.md. The slow test below renders reactions."""
    text = (REFERENCE / "report.md").read_text()
    names = [name for name in sections.NAMES if name != "reactions"]
    blocks = sections.blocks(groups, names, stored.verified(REFERENCE))
    missing = [b for b in blocks if render.markdown([b]).split("\n\n", 1)[1].strip() not in text]
    says = f"crosscheck report --render reports/reference renews it: {missing}"
    assert not missing and len(blocks) > 100, says


@pytest.mark.slow
def test_committed_report_follows_from_the_stored_records_and_the_page_has_all_its_numbers(groups):
    """report.md is equal letter by letter; numbers with an exponent are looked for in the page."""
    blocks = sections.blocks(groups, verified=stored.verified(REFERENCE))
    assert render.markdown(blocks) == (REFERENCE / "report.md").read_text()
    drawn = [b.figure if isinstance(b, Plot) else b for b in blocks if isinstance(b, Figure | Plot)]
    page, text = render.html(blocks, {figure.name: "" for figure in drawn}), render.markdown(blocks)
    lost = [number for number in set(re.findall(r"\b\d\.\d+e-\d+\b", text)) if number not in page]
    assert not lost, lost


def test_committed_text_on_the_paper_follows_from_the_stored_records(of_paper):
    """reports/paper/report.md is rendered again, and is equal letter by letter."""
    text = render.markdown(paper.render(*of_paper), program.TITLES[program.PAPER,])
    kept = (PAPER / "report.md").read_text()
    assert text == kept, "crosscheck report --section paper --render reports/paper renews it"


def test_committed_text_on_stability_follows_from_the_stored_records(of_ladders):
    """reports/stability/report.md is rendered again, and is equal letter by letter."""
    text = render.markdown(ladders.render(of_ladders), program.TITLES[program.STABILITY,])
    kept = (STABILITY / "report.md").read_text()
    assert text == kept, "crosscheck report --section stability --render reports/stability renews it"


def test_committed_records_are_of_the_current_scenes(groups):
    """The stored scenes are the built-in ones, except for the duration that was asked for."""
    assert groups
    for group in groups:
        assert group.scene == SCENES[group.scene.name]().with_(duration=group.scene.duration)


def test_every_cell_of_the_paper_and_two_studies_have_stored_records(of_paper):
    """CELLS are the cells of the paper's tables; the studies are of growing violations and of gains."""
    missing = [c for c in CELLS if Label(c.table, c.row, c.column) not in of_paper.records]
    assert not missing, missing
    assert has(of_paper.records, "growth") and has(of_paper.records, "gain")


def test_every_method_has_a_stored_run_at_every_difficulty(of_ladders):
    """The ladders are scenes of growing difficulty."""
    own = [record for record in of_ladders if record["engine"] == stability.MBREF]
    found = {(record["scene"], record["family"]) for record in own}
    assert not {(scene.name, method) for scene in stability.scenes() for method in stability.METHODS} - found


def test_records_of_each_report_are_of_one_clean_commit_that_the_readme_states(groups, of_paper, of_ladders):
    """A "+" marks a commit with changes; README has the first seven letters of two reports' commits, and the
    text of the reference report all letters."""
    runs = [run.record for group in groups for run in group.runs]
    each = runs, of_paper.records.values(), of_ladders
    (reference,), (own,), (ladder,) = ({record["commit"] for record in records} for records in each)
    assert "+" not in reference + own + ladder, "made from a checkout with changes"
    assert f"records of commit {reference}, " in (REFERENCE / "report.md").read_text()
    assert f"are of commit {reference[:7]}, later changes" in README, "README states the report's commit"
    assert f"records of commit {own[:7]}" in README, "README states the commit of the paper's records"


def test_no_stored_run_of_the_paper_timed_out_or_crashed(of_paper):
    """Such a run shows that its process was stopped, and not what its method does."""
    ended = [label for label, r in of_paper.records.items() if r["outcome"] in ("TIMED_OUT", "CRASHED")]
    assert not ended, ended


def test_committed_page_shows_the_figures_of_the_paper_s_numbers():
    """The paper's kinematic analysis has figures 4, 5, 6 and 8, its dynamic analysis figures 11 to 16."""
    text = (PAPER / "report.md").read_text()
    for number in (4, 5, 6, 8, *range(11, 17)):
        assert f"](figures/paper-figure-{number}.svg)" in text, number
        assert (PAPER / "figures" / f"paper-figure-{number}.svg").stat().st_size > 1000, number


def test_page_of_the_site_has_the_tables_and_a_figure_of_the_report_on_the_paper():
    """The page, which docs/hooks.py makes, has as many lines of tables as the report, more than 100."""
    pytest.importorskip("mkdocs", reason="the extra docs builds the site")
    found = importlib.util.spec_from_file_location("site_hooks", ROOT / "docs" / "hooks.py")
    hooks = importlib.util.module_from_spec(found)
    found.loader.exec_module(hooks)
    body, text = hooks.paper(), (PAPER / "report.md").read_text()
    assert len(re.findall(r"^\|", body, re.M)) == len(re.findall(r"^\|", text, re.M)) > 100
    assert "](figures/paper-figure-4.svg)" in body
