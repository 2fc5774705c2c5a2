"""Gauss's principle: bodies without moments of inertia, and singular values of straight linkages."""

from __future__ import annotations

import numpy as np
import pytest

from crosscheck.judge.arithmetic import EXTENDED, doubles
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.gauss_principle import gauss, singular_values
from crosscheck.judge.reference.taylor import natural_motion
from mbref.scenes import SCENES


@pytest.mark.parametrize("name", ["point_pendulum", "bricard_thin"])
def test_bodies_without_moment_of_inertia(name):
    """The report of these published problems ended with an error of the Cholesky factorisation."""
    scene = SCENES[name]()
    motion = natural_motion(scene, [0.0], EXTENDED, seconds=100.0)
    angular = scene_length(scene) * motion.angular_acceleration[0]
    exact = doubles(np.concatenate([motion.acceleration[0], angular]))
    assert np.abs(gauss(scene) - exact).max() < 1e-12 * np.abs(exact).max()


def test_distance_from_singular_and_rank_of_the_rhombus():
    """The straight rhombus lacks one more rank than the quarter-turned one, whose least value is far off."""
    straight, quarter = (singular_values(SCENES[n]()) for n in ("four_bar_straight", "four_bar_quarter"))
    zeros = [int(np.sum(values < 1e-12)) for values in (straight, quarter)]
    assert zeros[0] == zeros[1] + 1, f"{zeros[0]} and {zeros[1]} zero singular values: {straight}, {quarter}"
    assert quarter[-1 - zeros[1]] > 1e-2, f"least above rank {quarter[-1 - zeros[1]]:.1e}"
