"""Pages of the documentation that are made from records: they follow from the stored records and the links
within each lead to places of the page."""

import re
from pathlib import Path

import pytest

from crosscheck.cli import main as crosscheck
from crosscheck.closed_loops.records import FILE
from mbref.records import looked_at, rewrite
from reports.pages.__main__ import NAMES, PROOFS, proofs, text

RESULTS = Path(__file__).parents[2] / "docs" / "results"


# the page on thresholds has a row for each constant, and `make docs` renews it
@pytest.fixture(scope="module", params=[name for name in NAMES if name != "thresholds"])
def page(request) -> tuple[str, str]:
    return request.param, text(request.param)


def test_committed_page_follows_from_the_stored_records(page):
    """Each page of docs/results that is made from records is made again, and is equal letter by letter."""
    name, made = page
    assert (RESULTS / f"{name}.md").read_text() == made, f"python -m reports.pages {name} renews it"


def test_committed_scripts_of_findings_follow_from_the_stored_findings():
    """`python -m reports.pages findings` renews them."""
    assert {path: path.read_text() for path in PROOFS.iterdir()} == proofs()


def test_links_within_a_page_lead_to_its_headings_and_folded_runs(page):
    """The pages on small motions and on support have no such links."""
    name, made = page
    headings = {text.lower().replace(" ", "-") for text in re.findall(r"^## (.+)$", made, re.M)}
    places = headings | set(re.findall(r' id="(.+?)"', made))
    links = set(re.findall(r"\]\(#(.+?)\)", made))
    assert links <= places, links - places
    assert bool(links) == (name not in ("small-motions", "support"))


def test_every_page_folds_some_of_its_text(page):
    """Folds are <details> elements, each of which is closed."""
    _, made = page
    assert made.count("<details") == made.count("</details>") > 0


@pytest.mark.parametrize("name", ["closed-loops", "convergence"])
def test_page_of_runs_shows_less_than_a_fifth_of_its_text_and_folds_the_rest(name):
    """The page opens with verdicts and maps; lists of runs and commands are folded in <details>."""
    made = (RESULTS / f"{name}.md").read_text()
    shown = re.sub(r"<details.*?</details>", "", made, flags=re.S)
    assert len(shown) < 0.2 * len(made)


def test_command_writes_the_page_of_the_records_that_it_is_given(tmp_path):
    """Of all stored runs those by mbref are given: the page has a place for mbref and none for Drake."""
    records, out = tmp_path / "few.jsonl", tmp_path / "page.md"
    rewrite(records, [r for r in looked_at(FILE).values() if r["engine"] == "mbref"])
    assert crosscheck(["closed-loops", "--records", str(records), "--page", str(out)]) == 0
    assert "(#mbref)" in out.read_text() and "(#drake)" not in out.read_text()
