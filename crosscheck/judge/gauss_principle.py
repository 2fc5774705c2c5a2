"""Gauss's principle: initial accelerations by the judge's own equations, and the distance from singular
positions."""

from __future__ import annotations

import numpy as np

from crosscheck.judge.constraints import (
    closure_accelerations,
    initial_poses,
    initial_twists,
    jacobian,
    scene_length,
)
from crosscheck.judge.joint_coordinates import reflected
from crosscheck.judge.joint_loads import applied
from crosscheck.judge.loads import mass_matrix, world_inertia
from crosscheck.judge.tolerances import RANK
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

# relative residual of the accelerations; a larger residual shows that the mobility is infinitesimal only
CONTINUES = 1e-8


def gauss(scene: Scene) -> np.ndarray:
    """Return accelerations at t = 0 in the form of `stacked`.

    Among all accelerations that joints and drivers allow, the result minimises ½ aᵀ M a - aᵀ f. The scene
    must have masses. A moment of inertia may be zero if joints prevent the rotation.
    """
    mass, force = unbound(scene)
    # weights of the entries of `stacked`
    weights = np.tile(np.repeat([1.0, 1 / scene_length(scene)], 3), len(scene.body))
    rows = jacobian(scene, 0.0, *initial_poses(scene))[0]
    found = of_least_constraint(mass, force, rows, bias(scene), weights)
    return np.concatenate(np.hsplit(found.reshape(-1, 6), 2))


def of_least_constraint(
    mass: np.ndarray, force: np.ndarray, rows: np.ndarray, coasting: np.ndarray, weights: np.ndarray
) -> np.ndarray:
    """Return accelerations a / weights (n,) that minimise ½ aᵀ M a - aᵀ f subject to J a = -coasting.

    Arguments are M (n, n), f (n,), rows J (m, n) and the acceleration residuals (m,) of bodies without
    acceleration."""
    rows, mass, force = rows * weights, mass * weights * weights[:, None], force * weights
    _, s, vt = np.linalg.svd(rows, full_matrices=True)
    free = vt[int((s > RANK * s.max(initial=0.0)).sum()) :].T
    held = np.linalg.lstsq(rows, -coasting, rcond=RANK)[0]
    step = np.linalg.lstsq(free.T @ mass @ free, free.T @ (force - mass @ held), rcond=None)[0]
    found: np.ndarray = held + free @ step
    return found


def unbound(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Return the mass matrix M (6 nb, 6 nb) of the twists at t = 0, and the forces f (6 nb,) of loads and
    gyroscopic moments."""
    pose, twist = initial_poses(scene), initial_twists(scene)
    mass = mass_matrix(scene, world_inertia(scene, rotations.to_matrix(pose[1])))
    armatures = reflected(scene, *pose, *twist)
    force = applied(scene, 0.0, (*pose, *twist, np.zeros(len(scene.load)))).ravel()
    return mass + armatures.mass, force + armatures.force


def singular_values(scene: Scene) -> np.ndarray:
    """Return singular values of the Jacobian at t = 0, rows of unit length, lengths over the scene's;
    largest first."""
    rows, _ = jacobian(scene, 0.0, *initial_poses(scene))
    scaled = rows * np.tile(np.repeat([scene_length(scene), 1.0], 3), len(scene.body))
    return np.linalg.svd(scaled / np.linalg.norm(scaled, axis=1, keepdims=True), compute_uv=False)


def rank_of(values: np.ndarray) -> int:
    """Return the number of singular values (k,) above rounding relative to the largest."""
    return int(np.sum(values > RANK * values.max(initial=0.0)))


def rank(scene: Scene) -> int:
    """Return the rank of the rows of joints and drivers at t = 0."""
    return rank_of(singular_values(scene)) if scene.joint else 0


def bias(scene: Scene) -> np.ndarray:
    """Return the acceleration residuals (rows,) of bodies without acceleration; J a must equal their
    negative."""
    pose, rates = initial_poses(scene), initial_twists(scene)
    still = np.zeros_like(pose[0])
    rows = closure_accelerations(scene, 0.0, *pose, *rates, still, still)
    return np.concatenate([np.zeros(0), *rows.values()])


def goes_on(scene: Scene, within: float = CONTINUES) -> bool:
    """Return whether accelerations exist that keep the velocities consistent with the joints.

    If no such accelerations exist, the mobility is infinitesimal only. ``within`` is the allowed residual
    relative to the least accelerations that the joints require.
    """
    rows, _ = jacobian(scene, 0.0, *initial_poses(scene))
    coasting = bias(scene)
    left = rows @ np.linalg.lstsq(rows, coasting, rcond=RANK)[0] - coasting if len(rows) else coasting
    return bool(np.linalg.norm(left) <= within * max(1.0, float(np.linalg.norm(coasting))))


def stacked(scene: Scene, run: Trajectory, sample: int) -> np.ndarray:
    """Return accelerations at a sample, and angular accelerations times the scene's length (2 nb, 3), m/s²,
    world. Raises ValueError if the run has no accelerations.
    """
    if run.acceleration is None or run.angular_acceleration is None:
        raise ValueError(f"{run.engine} reports no accelerations")
    return np.concatenate([run.acceleration[sample], scene_length(scene) * run.angular_acceleration[sample]])
