"""Constraint rows of every type of joint: zero along the motions that the joint allows, and not along others.

The second body moves relative to the first by rotations and displacements written out here, after both have
been moved together. The facts of a joint type do not enter.
"""

import numpy as np
import pytest

from mbref import rotations
from mbref.equations.joints import AXES, ORIGIN, ROWS_OF, Primitive
from mbref.equations.model import Model
from mbref.kernels.scene_layout import COUPLED_ANGLE, COUPLED_SLIDE, DISTANCE, DOT1, DOT2, POINT
from mbref.scene import JOINT_TYPES, Body, Scene

ANCHOR = np.array([0.4, -0.3, 0.2])
AXIS = np.array([1.0, 2.0, 2.0]) / 3.0
ACROSS = np.array([2.0, 1.0, -2.0]) / 3.0  # perpendicular to AXIS
THIRD = np.array([2.0, -2.0, 1.0]) / 3.0  # AXIS × ACROSS, up to its sign
FAR = np.array([1.0, 0.5, -0.2])  # the second anchor of the distance joint
ONE = np.array([1.0, 0.0, 0.0, 0.0])
STILL = np.zeros(3)
POSITIONS = np.array([[0.1, 0.2, 0.3], [0.9, -0.4, 0.1]])
TOGETHER = np.array([0.7, -0.2, 0.5]), np.array([0.6, 0.8, 0.0])  # angle times axis; displacement


def turn(angle, axis):
    """The quaternion of a rotation about an axis."""
    return np.append(np.cos(angle / 2), np.sin(angle / 2) * np.asarray(axis))


def moved(point, quaternion, about, by):
    """A point after a rotation about another point, and a displacement."""
    return about + rotations.rotate(quaternion, point - about) + by


def after(*turns):
    """The rotation that makes these rotations one after another, the last about axes that are at rest."""
    found = ONE
    for each in reversed(turns):
        found = rotations.multiply(found, each)
    return found


def joint(kind):
    places = {"anchor": ANCHOR, "axis": AXIS, "axes": (AXIS, ACROSS), "anchors": (ANCHOR, FAR)}
    as_lists = {name: np.asarray(value).tolist() for name, value in places.items()}
    return JOINT_TYPES[kind].at("J", ("a", "b"), **as_lists)


def violation(kind, quaternion, by):
    """The largest |Φ| after the second body has moved; all is moved together afterwards."""
    bodies = tuple(
        Body(name=name, mass=1.0, inertia=(0.1, 0.2, 0.3), position=place.tolist())
        for name, place in zip("ab", POSITIONS, strict=True)
    )
    model = Model(Scene(name="pair", body=bodies, joint=(joint(kind),)))
    all_turned = turn(np.linalg.norm(TOGETHER[0]), TOGETHER[0] / np.linalg.norm(TOGETHER[0]))
    poses = [(POSITIONS[0], ONE), (moved(POSITIONS[1], quaternion, ANCHOR, by), quaternion)]
    q = [
        np.append(moved(place, all_turned, STILL, TOGETHER[1]), rotations.multiply(all_turned, own))
        for place, own in poses
    ]
    phi = model.terms(0.0, np.concatenate(q), np.zeros(12)).phi
    assert phi.size == joint(kind).facts.rows
    return float(np.abs(phi).max())


SPIN = turn(0.8, AXIS)
TILTED = turn(0.5, ACROSS)
ANY = turn(0.9, np.array([0.6, 0.0, 0.8]))
ALONG, ASIDE = 0.3 * AXIS, 0.2 * ACROSS - 0.1 * THIRD


@pytest.mark.parametrize(
    ("kind", "quaternion", "by"),
    [
        ("fixed", ONE, STILL),
        ("revolute", SPIN, STILL),
        ("spherical", ANY, STILL),
        ("translational", ONE, ALONG),
        ("cylindrical", SPIN, ALONG),
        ("planar", SPIN, ASIDE),
        ("inline", ANY, ALONG),
        ("universal", after(TILTED, SPIN), STILL),  # AXIS rests in the first body, ACROSS in the second
    ],
)
def test_rows_are_zero_along_the_motions_of_a_joint(kind, quaternion, by):
    assert violation(kind, quaternion, by) < 1e-14


@pytest.mark.parametrize(
    ("kind", "quaternion", "by"),
    [
        ("fixed", SPIN, STILL),
        ("fixed", TILTED, STILL),
        ("fixed", ONE, ALONG),
        ("revolute", TILTED, STILL),
        ("revolute", turn(0.5, THIRD), STILL),
        ("revolute", SPIN, ALONG),
        ("revolute", SPIN, ASIDE),
        ("spherical", ANY, ALONG),
        ("spherical", ANY, ASIDE),
        ("translational", SPIN, ALONG),
        ("translational", TILTED, ALONG),
        ("translational", turn(0.5, THIRD), ALONG),
        ("translational", ONE, 0.2 * ACROSS),
        ("translational", ONE, 0.2 * THIRD),
        ("cylindrical", TILTED, STILL),
        ("cylindrical", turn(0.5, THIRD), STILL),
        ("cylindrical", SPIN, 0.2 * ACROSS),
        ("cylindrical", SPIN, 0.2 * THIRD),
        ("planar", TILTED, ASIDE),
        ("planar", turn(0.5, THIRD), ASIDE),
        ("planar", SPIN, ALONG),
        ("inline", ANY, 0.2 * ACROSS),
        ("inline", ANY, 0.2 * THIRD),
        ("universal", after(SPIN, TILTED), STILL),  # the axes of both bodies exchanged
        ("universal", turn(0.5, THIRD), STILL),
        ("universal", after(TILTED, SPIN), ALONG),
    ],
)
def test_rows_are_violated_along_other_motions(kind, quaternion, by):
    assert violation(kind, quaternion, by) > 0.02


def test_a_distance_keeps_the_length_between_its_anchors():
    """The second body turns about the first anchor, so that the second anchor keeps its distance."""
    assert violation("distance", ANY, STILL) < 1e-14
    assert violation("distance", ONE, FAR - ANCHOR) == pytest.approx(1.5 * np.linalg.norm(FAR - ANCHOR))


def test_facts_of_primitives():
    """A point has three rows; a primitive has zeros where nothing is given, and is not driven."""
    assert np.array(AXES).tolist() == np.eye(3).tolist() and ORIGIN == (0.0, 0.0, 0.0)
    single = (DOT1, DOT2, DISTANCE, COUPLED_ANGLE, COUPLED_SLIDE)
    assert dict(ROWS_OF) == {POINT: 3, **dict.fromkeys(single, 1)}
    assert Primitive(DOT1) == (DOT1, *[(0.0, 0.0, 0.0)] * 5, 0.0, False)
