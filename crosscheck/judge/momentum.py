"""Momentum balance of a trajectory: joints and loads between bodies change neither momentum nor angular
momentum.

Without a joint or spring to the ground, P(t) = P(0) + (Σ m g + Σ F) t, and about the centre of mass of all
bodies, where gravity has no moment, L(t) = L(0) + Σ M t with constant moments M and no forces at points.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crosscheck.judge import constraints
from crosscheck.judge.loads import world_inertia
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import GROUND, Force, Moment, Scene


def momentum_series(scene: Scene, trajectory: Trajectory) -> np.ndarray | None:
    """Return the larger one of both drifts (k,) of `momentum_drifts`; None where they are not known."""
    drifts = momentum_drifts(scene, trajectory)
    return None if drifts is None else np.maximum(*drifts)


def momentum_drifts(scene: Scene, trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the drifts (k,) since t = 0 of momentum and angular momentum minus the impulse of gravity and
    loads.

    The drift of the momentum is relative to Σ m |v|, and the drift of the angular momentum relative to
    Σ m |v| times the scene's length plus Σ |J ω|. None if a joint or a spring is fixed to the ground, if a
    force or moment changes with time, without masses, or if nothing moves.
    """
    if not scene.has_mass() or any(GROUND in item.bodies for item in _links(scene)):
        return None
    if any(load.over_time for load in scene.load if load.acts_on == "body"):
        return None
    start = np.concatenate(_momenta(scene, *(a[None] for a in _initial(scene))), axis=-1)
    state = (trajectory.position, trajectory.orientation, trajectory.velocity, trajectory.angular_velocity)
    linear, angular = _momenta(scene, *state)
    time = trajectory.times[:, None]
    linear = linear - start[:, :3] - time * _push(scene)
    angular = angular - start[:, 3:] - time * _turning_push(scene)
    along, turning = _sizes(scene, *state)
    if not along + turning:
        return None
    if any(isinstance(load, Force) for load in scene.load):
        angular = 0 * angular  # the moment of a force changes as its point of attack moves
    by_length = turning + along * constraints.scene_length(scene)
    return np.linalg.norm(linear, axis=1) / (along or np.inf), np.linalg.norm(angular, axis=1) / by_length


def _links(scene: Scene) -> list[Any]:
    return [*scene.joint, *(load for load in scene.load if hasattr(load, "bodies"))]


def _initial(scene: Scene) -> tuple[np.ndarray, ...]:
    return (*constraints.initial_poses(scene), *constraints.initial_twists(scene))


def _masses(scene: Scene) -> np.ndarray:
    return np.array([body.mass for body in scene.body])


def _own(scene: Scene, orientation: np.ndarray, spin: np.ndarray) -> np.ndarray:
    """Return J ω (k, nb, 3) of each body about its own centre of mass, world."""
    return np.einsum("kbij,kbj->kbi", world_inertia(scene, rotations.to_matrix(orientation)), spin)


def _momenta(
    scene: Scene, position: np.ndarray, orientation: np.ndarray, velocity: np.ndarray, spin: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return momentum and angular momentum (k, 3) about the centre of mass of all bodies."""
    share = _masses(scene) / _masses(scene).sum()
    momentum = _masses(scene)[:, None] * velocity
    arms = position - np.einsum("b,kbi->ki", share, position)[:, None]
    orbital = np.cross(arms, momentum).sum(axis=1)
    return momentum.sum(axis=1), orbital + _own(scene, orientation, spin).sum(axis=1)


def _sizes(
    scene: Scene, position: np.ndarray, orientation: np.ndarray, velocity: np.ndarray, spin: np.ndarray
) -> tuple[float, float]:
    """Return the largest Σ m |v| and Σ |J ω| of the samples."""
    along = np.linalg.norm(velocity, axis=-1) @ _masses(scene)
    turning = np.linalg.norm(_own(scene, orientation, spin), axis=-1).sum(axis=1)
    return float(along.max(initial=0.0)), float(turning.max(initial=0.0))


def _push(scene: Scene) -> np.ndarray:
    """Return gravity and forces (3,), N."""
    forces = [np.array(load.force) for load in scene.load if isinstance(load, Force)]
    return _masses(scene).sum() * np.array(scene.gravity) + sum(forces, np.zeros(3))


def _turning_push(scene: Scene) -> np.ndarray:
    """Return the constant moments (3,), N m."""
    moments = [np.array(load.moment) for load in scene.load if isinstance(load, Moment)]
    return sum(moments, np.zeros(3))
