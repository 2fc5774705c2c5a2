"""Quaternions of rotation matrices, also in extended precision."""

import math

import numpy as np
import pytest

from crosscheck.judge.arithmetic import DOUBLE, EXTENDED, doubles
from crosscheck.judge.reference.natural import quaternions
from mbref import rotations

ROUNDED = 4e-15  # some roundings of numbers up to 1
AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (-2 / 7, 3 / 7, 6 / 7))


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("angle", [0.0, 0.3, 2.0, 3.0, math.pi, 4.0])
def test_quaternion_of_a_rotation_matrix_has_its_axis_and_angle(axis, angle):
    """q = (cos α/2, sin α/2 n), of either sign. At half a turn the first component is zero."""
    q = np.array([math.cos(angle / 2), *(math.sin(angle / 2) * np.array(axis))])
    found = quaternions(rotations.to_matrix(q))
    assert found.shape == (4,) and abs(found @ q) == pytest.approx(1.0, abs=ROUNDED)
    assert rotations.to_matrix(found) == pytest.approx(rotations.to_matrix(q), abs=ROUNDED)


def test_largest_component_of_each_quaternion_is_positive():
    """For 100 random unit quaternions q, in double and in extended precision: the quaternion of q's rotation
    matrix is q or -q, whose largest component is positive. All to rounding."""
    q = np.random.default_rng(3).normal(size=(2, 50, 4))
    q /= np.linalg.norm(q, axis=2, keepdims=True)
    signs = np.sign(np.take_along_axis(q, np.abs(q).argmax(axis=2)[..., None], axis=2))
    for numbers in (DOUBLE, EXTENDED):
        found = quaternions(numbers.array(rotations.to_matrix(q)))
        assert found.dtype == numbers.dtype and doubles(found) == pytest.approx(signs * q, abs=1e-14)
