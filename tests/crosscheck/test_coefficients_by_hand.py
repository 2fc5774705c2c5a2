"""The coefficients of DOP853 / SciPy's coefficients, and the order conditions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import DOP853

from crosscheck.engines.compiled import dop853
from crosscheck.engines.compiled import dop853_coefficients as tableau

STAGES = 12


@pytest.mark.parametrize("name", ["A", "B", "C", "E3", "E5"])
def test_coefficients_are_those_of_scipy(name):
    own = {"E3": "ERROR3", "E5": "ERROR5"}.get(name, name)
    wanted = np.array(getattr(DOP853, name))[:STAGES]
    wanted = wanted[:, :STAGES] if wanted.ndim == 2 else wanted
    found = getattr(dop853, own)
    assert found.shape == wanted.shape and tableau.STAGES == STAGES
    assert found == pytest.approx(wanted, rel=1e-13, abs=1e-17)


def test_conditions_of_the_order():
    """Rows of A add up to C; Σ b cᵏ = 1 / (k + 1) to the order 8; the errors of constants are zero."""
    assert dop853.A.sum(axis=1) == pytest.approx(dop853.C, abs=1e-14)
    moments = [dop853.B @ dop853.C**k for k in range(8)]
    assert moments == pytest.approx([1 / (k + 1) for k in range(8)], abs=1e-14)
    assert np.abs([dop853.ERROR3.sum(), dop853.ERROR5.sum()]).max() < 1e-14
