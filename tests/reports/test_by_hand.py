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
    assert axes.get_xlabel() == "largest error (fraction of the scene's length, or rad)"
    drawn = [line.get_xydata() for line in axes.get_lines() if line.get_label() == "mbref mpi-svd+projection"]
    assert sorted(drawn[0][:, 1]) == pytest.approx([0.01, 0.02, 0.04])
