"""Joint reactions against the exact motion: together they move the bodies, and each does no work."""

from __future__ import annotations

import numpy as np

from crosscheck.conformance.gauss_motion import applied
from crosscheck.judge.constraints import jacobian, joint_coordinates, length_rows, scene_length
from crosscheck.judge.joint_reactions import _on_second, resultants
from crosscheck.judge.loads import world_inertia
from mbref import rotations
from mbref.scene import Scene, TorsionSpring
from mbref.trajectory import Trajectory


def balance(scene: Scene, run: Trajectory, exact: Trajectory) -> float:
    """Largest part of the largest force (moments over the scene's length) by which the joints' resultants
    on a body miss mass times exact acceleration less the loads."""
    units = np.repeat([1.0, scene_length(scene)], 3)
    wanted = demanded(scene, exact) / units
    found = np.array([resultants(scene, run, k) for k in range(len(run.times))]) / units
    return float(np.abs(found - wanted).max() / _scale(scene, wanted))


def demanded(scene: Scene, exact: Trajectory) -> np.ndarray:
    """Forces and moments about the centres (k, nb, 6), world, that the joints must give for the motion."""
    pose = exact.times, exact.position, exact.orientation, exact.angular_velocity
    coordinates = joint_coordinates(scene, *pose)
    springs = [load.joint for load in scene.load if isinstance(load, TorsionSpring)]
    mass = np.array([body.mass for body in scene.body])[:, None]
    found = []
    for k in range(len(exact.times)):
        angles = np.array([coordinates[name][k, 0] for name in springs])
        state = exact.position[k], exact.orientation[k], exact.velocity[k], exact.angular_velocity[k], angles
        inertia = world_inertia(scene, rotations.to_matrix(exact.orientation[k]))
        turning = np.einsum("bij,bj->bi", inertia, exact.angular_acceleration[k])
        found.append(np.hstack([mass * exact.acceleration[k], turning]) - applied(scene, state))
    return np.array(found)


def idle(scene: Scene, run: Trajectory, exact: Trajectory) -> float:
    """Largest part of the largest force by which a reaction is not of its joint's and driver's rows."""
    length = scene_length(scene)
    wanted = demanded(scene, exact) / np.repeat([1.0, length], 3)
    worst = max(_idle_at(scene, run, k, length) for k in range(len(run.times)))
    return worst / _scale(scene, wanted)


def _idle_at(scene: Scene, run: Trajectory, k: int, length: float) -> float:
    position, orientation = run.position[k], run.orientation[k]
    rows, _ = jacobian(scene, run.times[k], position, orientation)
    worst, start = 0.0, 0
    for joint in scene.joint:
        stop = start + len(length_rows(scene)[joint.name])
        held = _on_second(scene, joint, rows[start:stop], position, orientation)
        held = held / np.repeat([1.0, length], 3)[:, None]
        wrench = run.reactions[joint.name][k] / np.repeat([1.0, length], 3)
        worst = max(worst, float(np.abs(wrench - held @ np.linalg.lstsq(held, wrench, rcond=1e-9)[0]).max()))
        start = stop
    return worst


def _scale(scene: Scene, wanted: np.ndarray) -> float:
    weight = sum(body.mass or 0.0 for body in scene.body)
    return max(float(np.abs(wanted).max()), 1e-3 * weight)  # at least that of a millimetre per second squared
