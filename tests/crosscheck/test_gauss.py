"""Gauss's principle for bodies without moments of inertia, and singular values of flat linkages."""

import numpy as np
import pytest

from crosscheck.judge.arithmetic import EXTENDED, doubles
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.gauss_principle import gauss, singular_values
from crosscheck.judge.reference.taylor import natural_motion
from mbref.scenes import SCENES


@pytest.mark.parametrize("name", ["point_pendulum", "bricard_thin"])
def test_gausss_principle_accelerates_bodies_without_moments_of_inertia_as_the_reference(name):
    """Their mass matrix is singular. Before, its Cholesky factorisation failed. The reference solves
    equations of its own in long doubles; differences are rounding (1e-12 of the largest acceleration)."""
    scene = SCENES[name]()
    motion = natural_motion(scene, [0.0], EXTENDED, seconds=100.0)
    angular = scene_length(scene) * motion.angular_acceleration[0]
    exact = doubles(np.concatenate([motion.acceleration[0], angular]))
    assert np.abs(gauss(scene) - exact).max() < 1e-12 * np.abs(exact).max()


def test_a_flat_rhombus_has_one_more_zero_singular_value_than_a_square_one():
    """A flat linkage can move on two branches, so that its rows have one rank less. Zeros are below 1e-12;
    the least other singular value of the square one is above 1e-2."""
    straight, quarter = (singular_values(SCENES[n]()) for n in ("four_bar_straight", "four_bar_quarter"))
    zeros = [int(np.sum(values < 1e-12)) for values in (straight, quarter)]
    assert zeros[0] == zeros[1] + 1, (straight, quarter)
    assert quarter[-1 - zeros[1]] > 1e-2, quarter
