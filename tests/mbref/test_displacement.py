"""Displacements of poses: q ⊕ x moves a pose, and x follows from two poses."""

import numpy as np
import pytest

from mbref import rotations
from mbref.equations.model import all_displaced, displaced, displacement

Q = np.array([1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0, -1.0, 0.5, 0.25, *np.full(4, 0.5)])  # two bodies
X = np.array([0.3, -0.2, 0.1, 1e-6, -2e-6, 3e-6, -0.4, 0.6, 0.8, 2e-6, 1e-6, -1e-6])  # m, rad of each body
SECOND_ORDER = 1e-11  # about (3e-6 rad)²: displacements are exact to first order in a rotation


def test_displacement_between_a_pose_and_the_displaced_pose_is_the_one_applied():
    """``displacement`` is the inverse of ``displaced``."""
    assert displacement(Q, displaced(Q, X)) == pytest.approx(X, rel=0.0, abs=SECOND_ORDER)


@pytest.mark.parametrize("body", [0, 1])
def test_displacement_does_not_depend_on_the_sign_of_a_quaternion(body):
    """The quaternions p and -p are one orientation."""
    target = displaced(Q, X)
    target[7 * body + 3 : 7 * body + 7] *= -1.0
    assert displacement(Q, target) == pytest.approx(X, rel=0.0, abs=SECOND_ORDER)


def test_rotation_of_a_displacement_is_about_the_body_s_own_axes():
    """A rotation of 2e-4 rad about the second body's z axis multiplies its quaternion from the right by (cos
    1e-4, 0, 0, sin 1e-4), to third order, (1e-4)³; all other coordinates stay."""
    turned = displaced(Q, np.array([0.0] * 9 + [0.0, 0.0, 2e-4]))
    about_z = np.array([np.cos(1e-4), 0.0, 0.0, np.sin(1e-4)])
    assert turned[10:] == pytest.approx(rotations.multiply(Q[10:], about_z), rel=0.0, abs=1e-12)
    assert np.array_equal(turned[:10], Q[:10])


def test_displacements_of_a_batch_equal_single_displacements():
    """``all_displaced`` of three displacements gives the poses of three calls of ``displaced``, to the
    bit."""
    many = np.array([X, -X, 2.0 * X])
    assert np.array_equal(all_displaced(Q, many), [displaced(Q, x) for x in many])
