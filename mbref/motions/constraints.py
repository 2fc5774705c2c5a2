"""Constraint rows along a trajectory of any engine: violations, and which reactions are determined."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mbref import rotations
from mbref.equations.couplings import couplings_of
from mbref.equations.joint_reactions import determined_components
from mbref.equations.model import Model
from mbref.equations.offsets import angles_at_start, assembled
from mbref.motions.joint_motion import along, joint_motion
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene


class Violation(NamedTuple):
    """Largest violation of a constraint row at k sample times, at three levels.

    Attributes
    ----------
    position : ndarray, shape (k,)
        m or rad.
    velocity : ndarray, shape (k,)
        m/s or rad/s.
    acceleration : ndarray, shape (k,), or None
        m/s² or rad/s². None if the engine gives no accelerations.
    """

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray | None


def violations(scene: Scene, motion: Trajectory) -> Violation:
    """Return the largest |Φ|, |Φ_q q' - ν| and |Φ_q q'' - γ| over the constraint rows at each sample.

    Rows are defined in ``equations.primitives``: metres, or cosines of axes that stay
    perpendicular and sines of driven angles, which are radians to first order. Angles in rows of couplings
    count full turns along the trajectory.
    """
    model = Model(without_armatures(assembled(scene)))
    q, v, a = coordinates(model, motion)
    terms = model.terms(motion.times, q, v)
    counted = _from_start(scene, motion)
    for coupled in couplings_of(model.scene):
        ends = zip(coupled.joints, coupled.coordinates, coupled.factors, strict=True)
        terms.phi[:, model.row_joint.index(coupled.name)] = sum(
            factor * along(joint_motion(model.scene, counted, joint.name), coordinate)[0]
            for joint, coordinate, factor in ends
        )
    velocity = np.einsum("kmn,kn->km", terms.jacobian, v) - terms.nu
    acceleration = None if a is None else np.einsum("kmn,kn->km", terms.jacobian, a) - terms.gamma
    model.release()
    return Violation(
        _largest(terms.phi), _largest(velocity), None if acceleration is None else _largest(acceleration)
    )


def _from_start(scene: Scene, motion: Trajectory) -> Trajectory:
    """Return the motion with angles that count from its start, as couplings without offsets do."""
    start = angles_at_start(scene)
    return replace(motion, angles={name: each - start[name] for name, each in (motion.angles or {}).items()})


def determined_reactions(scene: Scene, motion: Trajectory) -> dict[str, np.ndarray]:
    """Return for each joint which components (k, 6) of its reaction equilibrium determines, along world
    axes."""
    model = Model(without_armatures(assembled(scene)))
    q, _, _ = coordinates(model, motion)
    q = q.reshape(len(q), model.nb, 7)
    found = determined_components(model, q, model.terms(motion.times, q).blocks)
    model.release()
    return found


def without_armatures(scene: Scene) -> Scene:
    """Return the scene without armatures, because a model has a rotor for each armature, whose pose is not in
    the trajectory."""
    bare = {"armature": 0.0}
    joints = [joint.model_copy(update=bare) if joint.reflected_inertia else joint for joint in scene.joint]
    return scene.with_(joint=joints)


def coordinates(model: Model, motion: Trajectory) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Return q (k, 7 nb), q' and q'' (k, 6 nb) of a trajectory, in the principal frames of the model.

    q'' is None without accelerations. A modelled ground stands still.
    """
    q = poses(model, motion.position, motion.orientation)
    p = q.reshape(-1, model.nb, 7)[:, : len(motion.bodies), 3:]
    v = _in_frames(model, p, motion.velocity, motion.angular_velocity)
    if motion.acceleration is None or motion.angular_acceleration is None:
        return q, v, None
    return q, v, _in_frames(model, p, motion.acceleration, motion.angular_acceleration)


def poses(model: Model, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
    """Return coordinates (k, 7 nb) of positions (k, b, 3) and orientations (k, b, 4) of the bodies."""
    count, own = position.shape[:2]
    q = np.tile(model.start(), (count, 1)).reshape(count, model.nb, 7)
    q[:, :own, :3] = position
    q[:, :own, 3:] = rotations.multiply(orientation, model.principal[:own])
    return q.reshape(count, 7 * model.nb)


def _in_frames(model: Model, p: np.ndarray, linear: np.ndarray, angular: np.ndarray) -> np.ndarray:
    """Return world velocities (k, b, 3) and angular velocities as rates (k, 6 nb) in the frames p (k, b,
    4)."""
    found = np.zeros((len(p), model.nb, 6))
    found[:, : p.shape[1], :3] = linear
    found[:, : p.shape[1], 3:] = rotations.rotate(rotations.conjugate(p), angular)
    return found.reshape(len(p), 6 * model.nb)


def _largest(rows: np.ndarray) -> np.ndarray:
    return np.asarray(np.abs(rows).max(axis=1, initial=0.0))
