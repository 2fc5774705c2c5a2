"""Published problems in a report, and kinds of mechanisms / rows and pages worked out by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from test_figures_by_hand import SCENE, moving

from reports import which_engine as kinds
from reports.blocks import Heading, Text
from reports.runs import Run, SceneRuns
from reports.sections import published
from reports.which_engine import Kind

LENGTH = 4.0


def problem(error: float | None, needs_truth: bool = False) -> Any:
    """A problem that accepts an error of 1e-3, in which a run has this error."""

    def measure(scene: Any, motion: Any, exact: Any) -> float | None:
        assert scene.name == "block" and len(motion.times) == 3
        return None if needs_truth and exact is None else error

    return SimpleNamespace(
        measure=measure, acceptance=1e-3, words="largest error (m)", level="1e-3", source="a paper"
    )


@pytest.fixture
def with_problem(monkeypatch):
    def put(found: Any) -> None:
        monkeypatch.setattr(published, "BY_SCENE", {"block": ("P1", found)})
        monkeypatch.setattr(published, "problem_of", lambda scene: found if scene.name == "block" else None)
        monkeypatch.setattr(published, "scene_length", lambda scene: LENGTH)

    return put


def group(monkeypatch, bound: float = 1e-14, samples: int | None = 3) -> tuple[SceneRuns, Run]:
    """A run whose truth is known at so many of three samples."""
    run = moving("a", "x", (1.0,) * 3, asked={"options": {}}, metrics={"error": 0.5, "error_bound": bound})
    found = SceneRuns(SCENE, [run])
    exact = None if samples is None else SimpleNamespace(times=np.array([0.0, 0.5, 1.0])[:samples])
    monkeypatch.setattr(SceneRuns, "exact_part", lambda self, motion: exact)
    return found, run


@pytest.mark.parametrize(
    ("error", "shown", "accepted"),
    [
        (2e-3, "2.0e-03", "no"),
        (1e-3, "1.0e-03", "yes"),
        (1e-14, "1.0e-14", "yes"),
        (0.9e-14, "< 1e-14", "yes"),
        (None, "–", "not known"),
    ],
)
def test_the_row_of_a_run(monkeypatch, with_problem, error, shown, accepted):
    with_problem(problem(error))
    found, run = group(monkeypatch, bound=1e-3)
    assert published._row(found, run)[3:5] == (shown, accepted)


@pytest.mark.parametrize(("error", "shown"), [(3.9e-6, "< 4e-06"), (4.1e-6, "4.1e-06")])
def test_errors_below_the_bound_of_the_truth(monkeypatch, with_problem, error, shown):
    """The bound is relative to the length of 4 m; it counts where the measure needs the truth."""
    with_problem(problem(error, needs_truth=True))
    found, run = group(monkeypatch, bound=1e-6)
    assert published._row(found, run)[3] == shown
    with_problem(problem(error))
    assert published._row(found, run)[3] == f"{error:.1e}"
    with_problem(problem(0.5e-6, needs_truth=True))
    monkeypatch.setattr(published, "scene_length", lambda scene: 0.25)
    assert published._row(found, run)[3] == "< 1e-06", "of a metre at least"


def test_a_truth_that_ends_early(monkeypatch, with_problem):
    with_problem(problem(1e-6))
    found, run = group(monkeypatch, samples=2)
    assert published._row(found, run)[4] == "yes, truth to 0.5 s"
    found, run = group(monkeypatch, samples=None)
    assert published._row(found, run)[4] == "yes"


def test_the_section_of_published_problems(monkeypatch, with_problem):
    with_problem(problem(1e-6))
    found, _ = group(monkeypatch)
    other = SceneRuns(SCENE.with_(name="other"), [])
    heading, text, table = published.render([found, other])
    assert isinstance(heading, Heading) and (heading.text, heading.level) == ("Published problems", 2)
    assert isinstance(text, Text)
    assert table.caption == (
        "P1: block to t = 1 s. Error: largest error (m); accepted up to 1e-3. Source: a paper."
    )
    assert table.header == published.HEADER and table.right == {3, 5} and len(table.rows) == 1
    assert tuple(table.rows[0][:2]) == ("a", "x") and len(table.rows[0]) == 6
    assert published.render([other]) == []


# --- kinds of mechanisms ----------------------------------------------------------------------------------
def test_the_page_has_the_kinds_of_the_folders(monkeypatch, tmp_path):
    """A later folder's scenes replace those of the first; kinds without a scene are left out."""
    first, second = tmp_path / "first", tmp_path / "second"
    first.mkdir()
    second.mkdir()

    def named(*names: str, of: str) -> list[Any]:
        return [SimpleNamespace(scene=SimpleNamespace(name=name), of=of) for name in names]

    stored = {
        first: named("planar_slider_crank", "a", of="first"),
        second: named("a", "b", of="second"),
    }
    monkeypatch.setattr(kinds, "groups", lambda folder: stored[folder])
    listed = (
        Kind("One", "About.", ("a", "gone")),
        Kind("Two", "About.", ("c",)),
        Kind("Three", "About.", ("b",)),
    )
    monkeypatch.setattr(kinds, "KINDS", listed)
    monkeypatch.setattr(
        kinds, "_in_short", lambda found: [f"short {[(k.title, [g.of for g in gs]) for k, gs in found]}"]
    )
    monkeypatch.setattr(kinds, "_section", lambda kind, found: [f"section {kind.title}"])
    monkeypatch.setattr(kinds, "_many", lambda found: [f"many {found.scene.name}"])
    monkeypatch.setattr(kinds, "_failures", lambda folder: [f"failures {folder.name}"])
    page = kinds.page((first, second, tmp_path / "none"))
    assert page == kinds.HEAD + "\n" + "\n".join(
        [
            "short [('One', ['second']), ('Three', ['second'])]",
            "section One",
            "section Three",
            "many planar_slider_crank",
            "failures first",
            "",
        ]
    )


def test_a_group_without_a_truth_is_not_judged():
    with pytest.raises(ValueError, match="block: the folder has no record of its truth"):
        kinds.judged(SceneRuns(SCENE, []))
