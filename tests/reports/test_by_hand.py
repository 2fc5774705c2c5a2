"""Cells, labels and stored times / the numbers put into synthetic records."""

from __future__ import annotations

import pytest

from reports.runs import by_scene
from reports.sections import outcomes, speed
from tests.reports import synthetic


def one(record: dict) -> list:
    return by_scene([record], {synthetic.scene().name: synthetic.scene()})


def test_cells_of_the_outcome_table():
    record = synthetic.record("mbref", "family", 1e-3, 0.25, steps=70, rtol=1e-6)
    record["metrics"] |= {"error": 2e-2, "position_error": 1e-3}
    (group,) = one(record)
    table = outcomes.render(group)[1]
    cells = dict(zip(table.header, table.rows[0], strict=True))
    assert (cells["Engine"], cells["Family"], cells["Settings"]) == ("mbref", "family", "rtol=1e-06")
    assert (cells["Steps"], cells["Right-hand sides"]) == ("70", "280")
    assert (cells["Outcome"], cells["End time (s)"]) == ("COMPLETED", "0.02")
    assert cells["Error"] == "2.00e-02"
    assert cells["Time"] == "250 ms"


def test_letter_of_an_outcome_of_the_paper():
    (group,) = one(synthetic.groups()[0].runs[-2].record)
    assert outcomes.render(group)[1].rows[0][3] == "NOT_CONVERGED (b)"


def test_axes_of_the_speed_plot():
    (group, *_) = synthetic.groups()
    axes = speed.plot(group, speed.failed(group.runs)).axes[0]
    assert axes.get_ylabel() == "time of stepping (s)"
    assert axes.get_xlabel() == "largest error (fraction of the mechanism's length, or rad)"
    drawn = [line.get_xydata() for line in axes.get_lines() if line.get_label() == "mbref mpi-svd+projection"]
    assert sorted(drawn[0][:, 1]) == pytest.approx([0.01, 0.02, 0.04])


def estimated(error: float, largest: float | None, bound: float = 0.0, engine: str = "mbref") -> dict:
    found = synthetic.record(engine, "family", error, 0.25, rtol=error)
    found["metrics"] |= {"error": error, "error_bound": bound}
    return found if largest is None else {**found, "error_estimate": {"largest": largest}}


def outcome_of(*records: dict) -> tuple[str, dict[str, list[str]]]:
    """Return the sentences above the table of outcomes, and its columns."""
    (group,) = by_scene(records, {synthetic.scene().name: synthetic.scene()})
    _, *texts, table = outcomes.render(group)
    columns = dict(zip(table.header, map(list, zip(*table.rows, strict=True)), strict=True))
    return " ".join(text.text for text in texts), columns


def test_estimated_errors_and_the_errors_against_the_truth():
    """The ratios of error and estimate are 0.5, 2 and 4; the fourth error and its estimate are unknown."""
    runs = [
        estimated(1e-3, 2e-3),
        estimated(4e-5, 2e-5),
        estimated(8e-7, 2e-7),
        estimated(1e-12, 1e-13, bound=1e-11),
        estimated(5e-3, None, engine="mujoco"),
    ]
    said, columns = outcome_of(*runs)
    assert columns["Estimate"] == ["2.0e-03", "2.0e-05", "2.0e-07", "1.0e-13", "–"]
    assert list(columns).index("Estimate") == list(columns).index("Error") + 1
    assert "Error over estimate lies between 0.5 and 4 in the 3 runs" in said, said
    assert said.startswith("mbref estimates the error of each run"), said


def test_a_table_without_estimates_has_no_column_for_them():
    said, columns = outcome_of(estimated(1e-3, None))
    assert "Estimate" not in columns and said == ""
    said, _ = outcome_of(estimated(1e-12, 1e-13, bound=1e-11), estimated(1e-13, 0.0, bound=1e-11))
    assert said.endswith("All 2 estimates and errors are below the bound of the truth."), said
    said, _ = outcome_of(estimated(1e-3, 0.0), estimated(1e-4, 1e-4))
    assert "between 1 and inf in the 2 runs" in said, "an estimate of zero beside an error"
