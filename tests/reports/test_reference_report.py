"""The committed report: its page and text / its records, rendered again."""

import re
from pathlib import Path

import pytest

from mbref.scenes import SCENES
from reports import render, sections, stored
from reports.blocks import Figure, Plot
from reports.runs import SceneRuns

FOLDER = Path(__file__).parents[2] / "reports" / "reference"
README = (Path(__file__).parents[2] / "README.md").read_text()
DRAWING = re.compile(r'(<div class="wide"[^>]*>).*?</div>', re.DOTALL)


@pytest.fixture(scope="module")
def groups() -> list[SceneRuns]:
    return stored.groups(FOLDER)


def test_text_is_rendered_from_the_records(groups):
    """All sections except for the reactions, whose analysis takes longer than all others."""
    text = (FOLDER / "report.md").read_text()
    names = [name for name in sections.NAMES if name != "reactions"]
    blocks = sections.blocks(groups, names, stored.verified(FOLDER))
    missing = [b for b in blocks if render.markdown([b]).split("\n\n", 1)[1].strip() not in text]
    assert not missing and len(blocks) > 100, (
        f"crosscheck report --render reports/reference renews it: {missing}"
    )


@pytest.mark.slow
def test_committed_text_and_page_are_rendered_from_the_records(groups):
    blocks = sections.blocks(groups, verified=stored.verified(FOLDER))
    assert render.markdown(blocks) == (FOLDER / "report.md").read_text()
    drawn = [b.figure if isinstance(b, Plot) else b for b in blocks if isinstance(b, Figure | Plot)]
    page = DRAWING.sub(r"\1</div>", (FOLDER / "index.html").read_text())
    assert page == DRAWING.sub(r"\1</div>", render.html(blocks, {figure.name: "" for figure in drawn}))


def test_committed_page_has_the_numbers_and_figures_of_the_text():
    page, text = ((FOLDER / name).read_text() for name in ("index.html", "report.md"))
    assert len(re.findall(r'<div class="wide"[^>]*>\s*<svg', page)) > 10
    lost = [number for number in set(re.findall(r"\b\d\.\d+e-\d+\b", text)) if number not in page]
    assert not lost, lost


def test_committed_records_are_of_the_current_scenes(groups):
    for group in groups:
        assert group.scene == SCENES[group.scene.name]().with_(duration=group.scene.duration)


def test_report_s_records_are_of_one_clean_commit_that_the_readme_states(groups):
    """A "+" marks a commit with changes. The folder has at most 15 MB."""
    commits = {run.record["commit"] for group in groups for run in group.runs}
    [commit] = commits
    assert "+" not in commit
    text = (FOLDER / "report.md").read_text()
    assert f"records of commit {commit}, " in text, "the report names the commit of its records"
    assert f"are of commit {commit[:7]}, later changes" in README, "README states the commit of the report"
    assert sum(path.stat().st_size for path in FOLDER.rglob("*") if path.is_file()) < 15e6
