"""The solver of the truths against solutions known in closed form."""

import numpy as np
import pytest

from crosscheck.truth.picard import NoSolution, Solution


def test_equations_of_motion_that_end_say_so():
    solution = Solution(lambda y: y**2, np.array([1.0]), 0.1)
    assert abs(solution(np.array([0.9]))[0, 0] - 10) < 1e-12
    with pytest.raises(NoSolution, match=r"t = (1|0\.99999)"):
        solution(np.array([1.1]))


def test_panels_reach_rounding_error_over_many_periods():
    t = np.linspace(0, 300.0, 50)
    got = Solution(lambda y: np.stack([y[:, 1], -y[:, 0]], axis=1), np.array([0.0, 1.0]), 0.1)(t)
    off = np.abs(got[:, 0].astype(float) - np.sin(t)).max()
    assert off < 1e-14, f"sine off by {off} after {t[-1]} rad"
