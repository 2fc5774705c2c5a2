"""Displacements of poses: q ⊕ x moves a pose, and x follows from two poses."""

import numpy as np
import pytest

from mbref import rotations
from mbref.equations.model import all_displaced, displaced, displacement

Q = np.array([1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0, -1.0, 0.5, 0.25, *np.full(4, 0.5)])  # two bodies
X = np.array([0.3, -0.2, 0.1, 1e-6, -2e-6, 3e-6, -0.4, 0.6, 0.8, 2e-6, 1e-6, -1e-6])


def test_the_displacement_between_two_poses_moves_one_to_the_other():
    assert displacement(Q, displaced(Q, X)) == pytest.approx(X, rel=1e-5, abs=1e-12)


@pytest.mark.parametrize("body", [0, 1])
def test_quaternions_of_both_signs_are_one_orientation(body):
    target = displaced(Q, X)
    target[7 * body + 3 : 7 * body + 7] *= -1.0
    assert displacement(Q, target) == pytest.approx(X, rel=1e-5, abs=1e-12)


def test_rotations_are_about_the_axes_of_the_body():
    turned = displaced(Q, np.array([0.0] * 9 + [0.0, 0.0, 2e-4]))
    about_z = np.array([np.cos(1e-4), 0.0, 0.0, np.sin(1e-4)])
    assert turned[10:] == pytest.approx(rotations.multiply(Q[10:], about_z), abs=1e-11)
    assert turned[:10] == pytest.approx(Q[:10], abs=0.0)


def test_many_displacements_are_those_of_each():
    many = np.array([X, -X, 2.0 * X])
    assert all_displaced(Q, many) == pytest.approx(np.array([displaced(Q, x) for x in many]), abs=0.0)
