"""Spatial linkages with rows that are redundant only where the constraints hold, not at each stage of a
step."""

import numpy as np
import pytest

from crosscheck.judge.truth import truth_for
from mbref import Limits, simulate
from mbref.scenes import SCENES

LINKAGES = {"bennett": SCENES["bennett"], "bricard": SCENES["bricard"]}


@pytest.mark.parametrize(
    "method", ("alf-dual+projection", "mpi-svd+projection", "mpi-qr+projection", "mpi-gs+projection")
)
@pytest.mark.parametrize("name", LINKAGES)
def test_linkage_with_redundant_rows_moves_as_the_judge_s_reference_in_under_100_steps(name, method):
    """Bennett's linkage has three redundant rows, Bricard's one. Rounding in these rows must not shorten
    steps."""
    scene, times = LINKAGES[name](), np.linspace(0.0, 0.7, 6)  # s; later Bennett's linkage is flat
    run, true = simulate(scene, method, times, Limits(rtol=1e-6)), truth_for(scene).poses(times)
    assert run.outcome.label == "COMPLETED", run.message
    assert run.cost.steps + run.cost.rejected < 100
    assert np.abs(run.position - true.position).max() < 1e-5  # m, ten times rtol
    largest = np.abs(true.acceleration).max()  # m/s²
    assert np.abs(run.acceleration - true.acceleration).max() < 1e-4 * largest  # 100 times rtol
