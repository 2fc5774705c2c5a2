"""Natural coordinates / rotations, frames and masses of bodies worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from crosscheck.judge.arithmetic import DOUBLE, EXTENDED, doubles
from crosscheck.judge.reference.natural import NaturalCoordinates, axial, quaternions, skew
from mbref import rotations
from mbref.scene import Body, Revolute, Scene

AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (-2 / 7, 3 / 7, 6 / 7))


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("angle", [0.0, 0.3, 2.0, 3.0, math.pi, 4.0])
def test_quaternions_of_rotation_matrices(axis, angle):
    """The quaternion may have either sign. At half a turn its first component is zero."""
    q = np.array([math.cos(angle / 2), *(math.sin(angle / 2) * np.array(axis))])
    found = quaternions(rotations.to_matrix(q))
    assert found.shape == (4,) and abs(found @ q) == pytest.approx(1.0, abs=1e-15)
    assert rotations.to_matrix(found) == pytest.approx(rotations.to_matrix(q), abs=1e-15)


def test_quaternions_of_many_matrices_in_any_arithmetic():
    """The largest of the four components is positive."""
    q = np.random.default_rng(3).normal(size=(2, 50, 4))
    q /= np.linalg.norm(q, axis=2, keepdims=True)
    signs = np.sign(np.take_along_axis(q, np.abs(q).argmax(axis=2)[..., None], axis=2))
    for numbers in (DOUBLE, EXTENDED):
        found = quaternions(numbers.array(rotations.to_matrix(q)))
        assert found.dtype == numbers.dtype and doubles(found) == pytest.approx(signs * q, abs=1e-14)


def test_vector_products_and_their_axial_vectors():
    v, other = np.array([1.0, -2.0, 3.0]), np.array([0.5, 4.0, -1.0])
    assert skew(v) @ other == pytest.approx(np.cross(v, other)) and axial(skew(v)).tolist() == v.tolist()
    symmetric = np.outer(other, other)
    many = np.stack([skew(v) + symmetric, 2 * skew(other) + symmetric])
    assert axial(many).tolist() == [v.tolist(), (2 * other).tolist()]


BODY = Body(
    name="b",
    mass=3.0,
    inertia=((0.5, 0.02, 0.01), (0.02, 0.6, 0.03), (0.01, 0.03, 0.7)),
    position=(3.0, -1.0, 0.5),
    orientation=tuple(rotations.from_vector(np.array([0.3, -0.2, 0.5])).tolist()),
    velocity=(1.0, 2.0, -3.0),
    angular_velocity=(0.5, -0.4, 0.2),
)
HINGE = Revolute(name="A", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 3.0, -4.0))
SCENE = Scene(name="s", body=(BODY.model_copy(update={"name": "a"}), BODY), joint=())


@pytest.fixture(scope="module")
def of() -> NaturalCoordinates:
    return NaturalCoordinates(SCENE, DOUBLE)


def rates(of: NaturalCoordinates, x: np.ndarray, velocity: np.ndarray, spin: np.ndarray) -> np.ndarray:
    """Return the rates (3, n) of coordinates of the second body."""
    v = np.zeros_like(x)
    v[:, 4] = velocity / of.length
    v[:, 5:8] = np.cross(spin, x[:, 5:8], axisb=0, axisc=0)
    return v


def test_energy_of_natural_coordinates(of):
    """½ m v² + ½ ω J ω, with lengths in the unit of the coordinates."""
    x, _ = of.start()
    velocity, spin = np.array(BODY.velocity), np.array(BODY.angular_velocity)
    v = rates(of, x, velocity, spin)[:, :8]
    own = rotations.rotate(rotations.conjugate(np.array(BODY.orientation)), spin)
    energy = 1.5 * velocity @ velocity + own @ np.array(BODY.inertia) @ own / 2
    assert np.trace(v @ of.mass @ v.T) / 2 * of.length**2 == pytest.approx(energy)
    assert of.length == 2.0 ** round(math.log2(of.length)), "a power of two"


def test_bodies_of_coordinates_and_their_rates(of):
    """Coordinates and rates are made from known poses, velocities and accelerations, and give them back."""
    x, _ = of.start()
    velocity, spin = np.array(BODY.velocity), np.array(BODY.angular_velocity)
    v = rates(of, x, velocity, spin)
    a = np.zeros_like(x)
    a[:, 4] = np.array([4.0, 5.0, 6.0]) / of.length
    bend = np.cross([0.1, 0.2, 0.3], x[:, 5:8], axisb=0, axisc=0)
    a[:, 5:8] = np.cross(spin, v[:, 5:8], axisb=0, axisc=0) + bend
    place, q, speed, turning, second, growing = of.bodies(x[None], v[None], a[None])
    assert place[0, 1] == pytest.approx(BODY.position) and abs(q[0, 1] @ BODY.orientation) == pytest.approx(1)
    assert speed[0, 1] == pytest.approx(BODY.velocity) and turning[0, 1] == pytest.approx(spin)
    assert second[0, 1] == pytest.approx([4.0, 5.0, 6.0]) and growing[0, 1] == pytest.approx([0.1, 0.2, 0.3])
    assert not speed[0, 0].any() and not turning[0, 0].any() and place[0, 0] == pytest.approx(BODY.position)


def test_frames_and_rows_of_rigid_bodies(of):
    """The frame's last vector is the axis; rows of a rigid body are ½ x · x = ½ and x · y = 0."""
    frame = of.frame((0.0, 3.0, -4.0))
    assert frame[2] == pytest.approx([0.0, 0.6, -0.8]) and frame @ frame.T == pytest.approx(np.eye(3))
    assert np.linalg.det(frame) == pytest.approx(1.0)
    x = np.random.default_rng(4).normal(size=(3, 12))
    products = ((x @ of.u.T) * (x @ of.w.T)).sum(axis=0)
    axes = x[:, 5:8]
    pairs = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]
    wanted = [(0.5 if i == j else 1.0) * axes[:, i] @ axes[:, j] for i, j in pairs]
    assert products[6:12] == pytest.approx(wanted)
    assert of.c.tolist() == [0.5, 0.0, 0.0, 0.5, 0.0, 0.5] * 2


def test_a_body_without_mass_has_unit_inertia():
    free = Body(name="b", position=(1.0, 0.0, 0.0))
    found = NaturalCoordinates(Scene(name="s", body=(free,), joint=(HINGE,)), DOUBLE)
    assert found.mass == pytest.approx(np.diag([1.0, 0.5, 0.5, 0.5]))
