"""Least errors: rows of the table / records made by hand."""

from __future__ import annotations

from typing import Any

from crosscheck.study.search.least_errors import least_errors


def record(
    engine: str, family: str, error: float, outcome: str = "COMPLETED", t_end: float = 1.0
) -> dict[str, Any]:
    return {
        "scene": "bar",
        "engine": engine,
        "family": family,
        "settings": {"step": error},
        "asked": {"options": {"step": error}},
        "outcome": outcome,
        "t_end": t_end,
        "metrics": {"error": error},
        "cost": {"seconds": 2.0},
    }


RECORDS = [
    record("good", "coarse", 1e-3),
    record("good", "fine", 3e-9),
    record("good", "fine", 2e-10),
    record("good", "early", 1e-15, "SINGULAR_MATRIX", 0.2),
    record("good", "early", 1e-15, "NOT_CONVERGED", 0.4),
    record("bad", "only", 2e-8),
]


def test_table_shows_the_best_family_and_the_end_of_the_others():
    """Columns: scene, engine, best family, its settings, least error, time (s), families within 1e-9,
    others. A run is reached (within 1e-9) for "good", 2e-10, and not for "bad", 2e-8."""
    good, bad = least_errors(RECORDS)
    assert good.row() == (
        "bar",
        "good",
        "fine",
        "step=2e-10",
        "2.00e-10",
        "2",
        "fine",
        "coarse 1.00e-03; early not converged at 0.4 s",
    )
    assert (good.is_reached, bad.is_reached) == (True, False)
    assert bad.row()[4:] == ("2.00e-08", "2", "", "only 2.00e-08"), bad.row()


def test_engine_without_a_completed_run_is_shown_by_its_last_end():
    (least,) = least_errors([r for r in RECORDS if r["family"] == "early"])
    assert not least.is_reached
    assert least.best["outcome"] == "NOT_CONVERGED", "the run that got furthest stands for the engine"
