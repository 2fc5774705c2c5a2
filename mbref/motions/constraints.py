"""Constraint rows along a trajectory of any engine: violations, and which reactions are determined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mbref import rotations
from mbref.equations.couplings import couplings_of
from mbref.equations.joint_reactions import determined_components
from mbref.equations.model import Model, poses
from mbref.equations.offsets import angles_at_start, assembled
from mbref.motions.joint_motion import along, joint_motion
from mbref.motions.pieces import is_intermittent, parts_of
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
    count full turns along the trajectory.  Constraints with intervals count while they hold.
    """
    if is_intermittent(scene):
        return _joined([violations(*part) for part in parts_of(scene, motion)])
    model = Model(without_armatures(assembled(scene)))
    q, v, a = coordinates(model, motion)
    counted = _from_start(scene, motion)
    terms = model.terms(motion.times, q, v, _counted(model, counted))
    for coupled in couplings_of(model.scene):
        ends = zip(coupled.joints, coupled.coordinates, coupled.laws, strict=True)
        terms.phi[:, model.row_joint.index(coupled.name)] = sum(
            np.polynomial.Polynomial([0.0, *law])(
                along(joint_motion(model.scene, counted, joint.name), coordinate)[0]
            )
            for joint, coordinate, law in ends
        )
    velocity = np.einsum("kmn,kn->km", terms.jacobian, v) - terms.nu
    acceleration = None if a is None else np.einsum("kmn,kn->km", terms.jacobian, a) - terms.gamma
    model.release()
    return Violation(
        _largest(terms.phi), _largest(velocity), None if acceleration is None else _largest(acceleration)
    )


def _joined(parts: Sequence[Violation]) -> Violation:
    """Return violations of consecutive samples as one; accelerations are missing in all parts, or in none."""
    position, velocity, acceleration = zip(*parts, strict=True)
    has_accelerations = all(rows is not None for rows in acceleration)
    return Violation(
        np.concatenate(position),
        np.concatenate(velocity),
        np.concatenate(acceleration) if has_accelerations else None,
    )


def _counted(model: Model, motion: Trajectory) -> np.ndarray | None:
    """Return the angles (k, a) of turning joints with full turns, on which the slopes of polynomial couplings
    depend; None without such couplings."""
    if not model.structure.places.powers:
        return None
    turning = [place.joint for place in model.structure.places.turning]
    return np.array([joint_motion(model.scene, motion, name).angle for name in turning]).T


def angles_from_start(model: Model, scene: Scene, motion: Trajectory) -> np.ndarray | None:
    """Return the angles (k, a) of turning joints that ``Model.terms`` needs for polynomial couplings; None
    without such couplings."""
    return _counted(model, _from_start(scene, motion))


def _from_start(scene: Scene, motion: Trajectory) -> Trajectory:
    """Return the motion with angles that count from its start, as couplings without offsets do."""
    start = angles_at_start(scene)
    return replace(motion, angles={name: each - start[name] for name, each in (motion.angles or {}).items()})


def determined_reactions(scene: Scene, motion: Trajectory) -> dict[str, np.ndarray]:
    """Return for each joint which components (k, 6) of its reaction equilibrium determines, along world
    axes. A joint that does not hold has none, which is determined."""
    if is_intermittent(scene):
        parts = [
            (np.ones((len(part.times), 6), dtype=bool), determined_reactions(piece, part))
            for piece, part in parts_of(scene, motion)
        ]
        names = [joint.name for joint in scene.joint]
        return {name: np.concatenate([own.get(name, every) for every, own in parts]) for name in names}
    model = Model(without_armatures(assembled(scene)))
    q, _, _ = coordinates(model, motion)
    q = q.reshape(len(q), model.nb, 7)
    angles = angles_from_start(model, scene, motion)
    found = determined_components(model, q, model.terms(motion.times, q, angles=angles).blocks, angles)
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
    v = in_frames(model, p, motion.velocity, motion.angular_velocity)
    if motion.acceleration is None or motion.angular_acceleration is None:
        return q, v, None
    return q, v, in_frames(model, p, motion.acceleration, motion.angular_acceleration)


def in_frames(model: Model, p: np.ndarray, linear: np.ndarray, angular: np.ndarray) -> np.ndarray:
    """Return world velocities (k, b, 3) and angular velocities as rates (k, 6 nb) in the frames p (k, b, 4);
    of rows of rates, the rows for such rates."""
    found = np.zeros((len(p), model.nb, 6))
    found[:, : p.shape[1], :3] = linear
    found[:, : p.shape[1], 3:] = rotations.rotate(rotations.conjugate(p), angular)
    return found.reshape(len(p), 6 * model.nb)


def _largest(rows: np.ndarray) -> np.ndarray:
    return np.asarray(np.abs(rows).max(axis=1, initial=0.0))
