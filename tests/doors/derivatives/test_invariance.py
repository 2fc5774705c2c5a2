"""The judge's derivatives at a state keep symmetries, and follow frames, units and orders."""

from functools import cache

import numpy as np

from crosscheck.conformance.changes.isometry import ASKEW, Isometry
from crosscheck.conformance.changes.units import in_other_units
from crosscheck.conformance.mechanisms.random_mechanisms import random_mechanism
from crosscheck.judge.constraints import inertia_matrices
from crosscheck.judge.state_derivatives import bounded_derivatives
from mbref import rotations
from mbref.scene import Scene

LENGTH, TIME = 10.0, 0.5  # new units per old unit
NEAR = 1e-11  # relative; the derivatives of the mechanism are right to 1e-13
STILL = {"velocity": None, "angular_velocity": None}


@cache
def mechanism() -> Scene:
    """Return a spatial mechanism with a loop and two freedoms, under gravity alone."""
    return random_mechanism(0).with_(load=[])


@cache
def derivatives(scene: Scene):
    return bounded_derivatives(scene).values


def assert_mapped(old, new, motions, accelerations, forces, time=1.0):
    """Assert that derivatives are the old ones: twists, accelerations and forces times a matrix each."""
    turned = np.linalg.lstsq(motions @ old.basis, new.basis, rcond=None)[0]
    near(motions @ old.basis @ turned, new.basis)
    near(accelerations @ old.by_position @ turned, new.by_position)
    near(time * accelerations @ old.by_velocity @ turned, new.by_velocity)
    near(accelerations @ old.by_force @ np.linalg.inv(forces), new.by_force)


def near(a, b):
    assert np.abs(a - b).max() <= NEAR * np.abs(b).max()


def test_derivatives_turn_with_the_frame_of_the_scene():
    """A turn about a skew axis, and a displacement."""
    scene = mechanism()
    turn = np.kron(np.eye(2 * len(scene.body)), ASKEW)
    moved = Isometry(ASKEW, np.array([0.3, -0.7, 1.9])).change(scene)
    assert_mapped(derivatives(scene), derivatives(moved), turn, turn, turn)


def test_derivatives_do_not_depend_on_the_order_of_bodies_and_joints():
    scene = mechanism()
    swapped = scene.with_(body=scene.body[::-1], joint=scene.joint[::-1])
    order = np.kron(np.eye(len(scene.body))[::-1], np.eye(6))
    assert_mapped(derivatives(scene), derivatives(swapped), order, order, order)


def test_derivatives_follow_the_units_of_length_and_time():
    scene, bodies = mechanism(), np.eye(len(mechanism().body))
    motions, push = np.diag([LENGTH] * 3 + [1.0] * 3), LENGTH / TIME**2
    forces = np.kron(bodies, np.diag([push] * 3 + [LENGTH * push] * 3))
    motions = np.kron(bodies, motions)
    other = in_other_units(scene, LENGTH, TIME)
    assert_mapped(derivatives(scene), derivatives(other), motions, motions / TIME**2, forces, TIME)


def test_derivatives_by_forces_and_stiffness_at_rest_are_symmetric():
    """Gravity's stiffness, the second derivative of its potential, is Nᵀ M a_u with changes of N and of
    inertia tensors J. For angular velocities ω_i by unit u_i, ∂ω_i/∂u_j has the part ω_j × ω_i / 2."""
    scene = mechanism()
    scene = scene.with_(body=[body.model_copy(update=STILL) for body in scene.body])
    found = derivatives(scene)
    near(found.by_force, found.by_force.T)
    turn = rotations.to_matrix(np.array([body.orientation for body in scene.body]))
    inertia = turn @ inertia_matrices(scene) @ np.swapaxes(turn, 1, 2)
    basis = found.basis.reshape(len(scene.body), 6, -1)
    slopes = found.by_position.reshape(basis.shape)
    accelerations = found.accelerations.reshape(-1, 6)
    f = basis.shape[2]
    stiffness, parts = np.zeros((f, f)), 0.0
    for b, body in enumerate(scene.body):
        alpha, spun = accelerations[b, 3:], inertia[b] @ accelerations[b, 3:]
        for i in range(f):
            for j in range(f):
                one, other = basis[b, 3:, i], basis[b, 3:, j]
                stiffness[i, j] += body.mass * basis[b, :3, i] @ slopes[b, :3, j]
                stiffness[i, j] += one @ inertia[b] @ slopes[b, 3:, j]
                change = np.cross(other, one) @ spun / 2 + one @ np.cross(other, spun)
                change -= one @ inertia[b] @ np.cross(other, alpha)
                stiffness[i, j] += change
                parts = max(parts, abs(change))
    assert f > 1 and parts > 1e-3  # the changes count
    near(stiffness, stiffness.T)
