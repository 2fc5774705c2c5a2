"""The committed report equals its records, rendered again."""

import re
from pathlib import Path

import pytest

from mbref.scenes import SCENES
from reports import render, sections, stored
from reports.blocks import Figure, Plot
from reports.runs import SceneRuns

FOLDER = Path(__file__).parents[2] / "reports" / "reference"
README = (Path(__file__).parents[2] / "README.md").read_text()


@pytest.fixture(scope="module")
def groups() -> list[SceneRuns]:
    return stored.groups(FOLDER)


def test_sections_of_the_committed_report_follow_from_the_stored_records(groups):
    """Each of more than 100 blocks stands in report.md. The slow test below renders reactions."""
    text = (FOLDER / "report.md").read_text()
    names = [name for name in sections.NAMES if name != "reactions"]
    blocks = sections.blocks(groups, names, stored.verified(FOLDER))
    missing = [b for b in blocks if render.markdown([b]).split("\n\n", 1)[1].strip() not in text]
    says = f"crosscheck report --render reports/reference renews it: {missing}"
    assert not missing and len(blocks) > 100, says


@pytest.mark.slow
def test_committed_report_follows_from_the_stored_records_and_the_page_has_all_its_numbers(groups):
    """report.md is equal letter by letter; numbers with an exponent are looked for in the page."""
    blocks = sections.blocks(groups, verified=stored.verified(FOLDER))
    assert render.markdown(blocks) == (FOLDER / "report.md").read_text()
    drawn = [b.figure if isinstance(b, Plot) else b for b in blocks if isinstance(b, Figure | Plot)]
    page, text = render.html(blocks, {figure.name: "" for figure in drawn}), render.markdown(blocks)
    lost = [number for number in set(re.findall(r"\b\d\.\d+e-\d+\b", text)) if number not in page]
    assert not lost, lost


def test_committed_records_are_of_the_current_scenes(groups):
    """The stored scenes are the built-in ones, except for the duration that was asked for."""
    assert groups
    for group in groups:
        assert group.scene == SCENES[group.scene.name]().with_(duration=group.scene.duration)


def test_report_s_records_are_of_one_clean_commit_that_the_readme_states(groups):
    """A "+" marks a commit with changes."""
    commits = {run.record["commit"] for group in groups for run in group.runs}
    [commit] = commits
    assert "+" not in commit
    text = (FOLDER / "report.md").read_text()
    assert f"records of commit {commit}, " in text, "the report names the commit of its records"
    assert f"are of commit {commit[:7]}, later changes" in README, "README states the commit of the report"
