"""The coefficients of DOP853 / those of SciPy, and the conditions of their order."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import DOP853

from crosscheck.engines.compiled import dop853
from crosscheck.engines.compiled import dop853_coefficients as tableau

STAGES = 12


def test_coefficients_are_those_of_scipy():
    assert tableau.STAGES == STAGES and dop853.A.shape == (STAGES, STAGES)
    assert dop853.A == pytest.approx(DOP853.A[:STAGES, :STAGES], rel=1e-15, abs=1e-17)
    assert dop853.C == pytest.approx(DOP853.C[:STAGES], rel=1e-15)
    assert dop853.B == pytest.approx(DOP853.B[:STAGES], rel=1e-15)
    assert dop853.ERROR3 == pytest.approx(DOP853.E3[:STAGES], rel=1e-13, abs=1e-17)
    assert dop853.ERROR5 == pytest.approx(DOP853.E5[:STAGES], rel=1e-15)


def test_conditions_of_the_order():
    """Rows of A add up to C; Σ b cᵏ = 1 / (k + 1) to the order 8; the errors of constants are zero."""
    assert dop853.A.sum(axis=1) == pytest.approx(dop853.C, abs=1e-14)
    moments = [dop853.B @ dop853.C**k for k in range(8)]
    assert moments == pytest.approx([1 / (k + 1) for k in range(8)], abs=1e-14)
    assert np.abs([dop853.ERROR3.sum(), dop853.ERROR5.sum()]).max() < 1e-14
