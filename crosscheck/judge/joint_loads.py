"""Loads along joint coordinates, by the judge: the row of a coordinate in the Jacobian, times the sum of
spring, damper and applied force."""

from __future__ import annotations

import numpy as np

from crosscheck.judge.joint_coordinates import COORDINATES, coordinate_jacobian, coordinates
from crosscheck.judge.joint_residuals import grounded, joint_frames, with_ground
from crosscheck.judge.loads import Motion, world_inertia, wrenches
from crosscheck.judge.time_functions import value
from mbref import rotations
from mbref.rotations import cross
from mbref.scene import JointLoad, Scene
from mbref.scene.joints import ANGLE

NO_AXIS = np.zeros(3)  # loads of joints are added here, along their joints' coordinates
# position (nb, 3), unit orientation (nb, 4), velocity, spin (nb, 3), and angles of `turning_loads`
State = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def joint_loads(scene: Scene) -> list[JointLoad]:
    """Return the loads along joint coordinates."""
    return [load for load in scene.load if isinstance(load, JointLoad)]


def turning_loads(scene: Scene) -> list[JointLoad]:
    """Return the loads about joints' axes, whose angles a state contains."""
    return [load for load in joint_loads(scene) if load.coordinate == ANGLE]


def joint_wrenches(
    scene: Scene,
    t: float,
    pose: tuple[np.ndarray, np.ndarray],
    twist: tuple[np.ndarray, np.ndarray],
    angles: np.ndarray,
    since: float | None = None,
) -> np.ndarray:
    """Return forces and moments (nb, 6), world, of the loads along joint coordinates.

    Arguments are a pose and twist (nb, ·) and the ``angles`` of ``turning_loads``. Functions of time are of
    the piece that acts from ``since`` (s) on, by default of the piece at t.
    """
    found = np.zeros(6 * len(scene.body))
    rates, turned = np.hstack(twist).ravel(), iter(angles)
    for load in joint_loads(scene):
        row = coordinate_jacobian(scene, load.joint, *pose)[COORDINATES.index(load.coordinate)]
        moved = next(turned) if load.coordinate == ANGLE else _displacement(scene, load.joint, pose)
        action, factor = load.action, 1.0
        if load.over_time is not None:
            factor = float(value(load.over_time, t, since=since))
        resistance = action.stiffness * (moved - action.natural) + action.damping * (row @ rates)
        found += (action.amount * factor - resistance) * row
    return found.reshape(-1, 6)


def _displacement(scene: Scene, name: str, pose: tuple[np.ndarray, np.ndarray]) -> float:
    joint = next(joint for joint in joint_frames(scene) if joint.name == name)
    position, orientation = (part[None] for part in with_ground(*pose))
    still = grounded(np.zeros((1, len(pose[0]), 3)))
    return float(coordinates(joint, np.zeros(1), position, orientation, still)[0, 1])


def applied(scene: Scene, t: float, state: State, since: float | None = None) -> np.ndarray:
    """Return forces and moments about the centres of mass (nb, 6), world: gravity, loads, gyroscopic
    moments."""
    position, orientation, velocity, spin, angles = state
    turn = rotations.to_matrix(orientation)
    still = np.zeros((1, len(position)))
    motion = Motion(position[None], turn[None], velocity[None], spin[None], still)
    force, moment = (w[0] for w in wrenches(scene, motion, NO_AXIS, t, since))
    of_joints = joint_wrenches(scene, t, (position, orientation), (velocity, spin), angles, since)
    inertia = world_inertia(scene, turn)
    gyroscopic = cross(spin, np.einsum("bij,bj->bi", inertia, spin))
    return np.hstack([force, moment - gyroscopic]) + of_joints
