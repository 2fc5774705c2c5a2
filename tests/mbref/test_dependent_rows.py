"""Rows that depend on others on the constraints alone: stages, which are off these, leave them out."""

import numpy as np
import pytest

from mbref import Limits, simulate
from mbref.scenes import SCENES

LINKAGES = {"bennett": SCENES["bennett"], "bricard": SCENES["bricard"]}


@pytest.mark.parametrize(
    "method", ("alf-dual+projection", "mpi-svd+projection", "mpi-qr+projection", "mpi-gs+projection")
)
@pytest.mark.parametrize("name", LINKAGES)
def test_redundant_rows_do_not_shorten_steps(name, method):
    """Runs by alf-dual took 63 to 338 steps, by mpi-svd 425 to 784 and as many that were rejected."""
    times, limits = np.linspace(0.0, 0.7, 6), Limits(rtol=1e-6)  # later Bennett's linkage is flat
    run = simulate(LINKAGES[name](), method, times, limits)
    series = simulate(LINKAGES[name](), "taylor", times, limits)
    assert run.outcome.label == series.outcome.label == "COMPLETED", run.message
    assert run.cost.steps + run.cost.rejected < 100
    assert np.abs(run.position - series.position).max() < 1e-5
    assert np.abs(run.acceleration - series.acceleration).max() < 1e-4 * np.abs(series.acceleration).max()
