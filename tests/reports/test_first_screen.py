"""The first screen has the matrix, the mechanism and the figure that follow from the records."""

import re

import pytest

from reports import render
from reports.blocks import Matrix, Opening, Plot, Record
from reports.places import of_family, of_run
from reports.sections import blocks
from reports.sections.verdict import render as first_screen
from tests.reports.synthetic import groups, scene
from tests.reports.synthetic import records as stored_records


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> str:
    out = tmp_path_factory.mktemp("page")
    render.write(blocks(groups(), ["verdict", "outcomes", "records"]), out)
    return (out / "index.html").read_text()


def one(kind: type):
    [found] = [block for block in first_screen(groups()) if isinstance(block, kind)]
    return found


def test_matrix_of_the_first_screen_shows_grades_errors_and_ends():
    """Records: MuJoCo tuned is off by 2e-3, by default 0.5; Exudyn ends at 0.6 · 0.02 s; mbref 1e-3 / 8², 40
    ms."""
    cells = one(Matrix).cells["spatial_slider_crank"]
    assert [(v.family, v.grade) for v in cells["mujoco"]] == [("tuned", "inaccurate"), ("defaults", "wrong")]
    assert [(v.grade, v.lines) for v in cells["exudyn"]] == [("failed", ["not converged at 0.012 s"])]
    assert cells["mbref"][0].lines == ["1.56e-05", "40 ms"], cells["mbref"]


def test_opening_names_the_worst_run_and_who_is_right():
    """At best mbref is off by 1e-3 / 8², more than a right run's 1e-8, and others by more; MuJoCo's defaults
    by 0.5."""
    opening = one(Opening)
    assert opening.headline.startswith("No engine is right on every scene"), opening.headline
    assert "MuJoCo, defaults, off by 5.0e-01" in opening.caption, opening.caption
    assert opening.sentences["Who is right"].startswith("mbref is inaccurate at best on spatial_slider_crank")


def test_links_of_the_page_lead_to_places_of_the_page_and_every_run_has_a_place(page):
    """Links are of the form #id; no id occurs twice, and each run and family has one."""
    ids = set(re.findall(r' id="([^"]+)"', page))
    links = set(re.findall(r'href="#([^"]+)"', page))
    assert links <= ids, links - ids
    assert {of_run(run) for group in groups() for run in group.runs} <= ids
    assert of_family(scene().name, ("mujoco", "tuned")) in ids
    assert len(re.findall(r' id="([^"]+)"', page)) == len(ids), "an id occurs twice"


def test_marks_of_the_speed_figure_have_the_records_errors_and_times():
    """Each completed run has one mark with its numbers; each mark has a title, and so has the figure."""
    plot = one(Plot)
    marks = re.findall(r'data-error="([^"]+)" data-seconds="([^"]+)"', plot.svg)
    shown = [(f"{r.error:.4g}", f"{r.seconds:.4g}") for r in groups()[0].completed()]
    assert sorted(marks) == sorted(shown), (marks, shown)
    assert plot.svg.count("<title>") == len(shown) + 1


def test_every_run_has_a_card_with_the_command_that_repeats_it():
    """The command has scene, engine, family, settings, samples and duration of the record."""
    expected = [
        f"crosscheck run scenes/{r['scene']}.toml --engine {r['engine']} --setting {r['family']}"
        + "".join(f" --option {name}={value}" for name, value in r["settings"].items())
        + " --samples 13 --duration 0.02"
        for r in stored_records()
    ]
    shown = [block for block in blocks(groups(), ["records"]) if isinstance(block, Record)]
    assert sorted(card.command for record in shown for card in record.cards) == sorted(expected)
