"""Spatial linkages with rows that are redundant only where constraints hold, not at each stage."""

import numpy as np
import pytest

from crosscheck.judge.truth import truth_for
from mbref import Limits, simulate
from mbref.scenes import SCENES

END = 0.7  # s; later Bennett's linkage is flat
RTOL = 1e-6
MOST_STEPS = 20  # rejected ones included; 7 are taken if rounding in redundant rows shortens none


@pytest.mark.parametrize(
    "method", ("alf-dual+projection", "mpi-svd+projection", "mpi-qr+projection", "mpi-gs+projection")
)
@pytest.mark.parametrize("name", ["bennett", "bricard"])
def test_linkage_with_redundant_rows_moves_as_the_judge_s_reference_in_under_20_steps(name, method):
    """Bennett's linkage has three redundant rows, Bricard's one. Positions (m) are the reference's to ten
    rtol, accelerations to 100 rtol of the largest. Rounding in redundant rows must not shorten steps."""
    scene, times = SCENES[name](), np.linspace(0.0, END, 6)
    run, true = simulate(scene, method, times, Limits(rtol=RTOL)), truth_for(scene).poses(times)
    assert run.outcome.label == "COMPLETED", run.message
    assert run.cost.steps + run.cost.rejected < MOST_STEPS
    assert np.abs(run.position - true.position).max() < 10 * RTOL
    largest = np.abs(true.acceleration).max()  # m/s²
    assert np.abs(run.acceleration - true.acceleration).max() < 100 * RTOL * largest
