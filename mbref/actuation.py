"""Forces, torques and powers of the drivers, springs and loads of joints of a motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mbref import rotations
from mbref.joint_motion import along, joint_motion, position_of, turned_since_start, velocity_of
from mbref.scene import JointLoad, Scene, Spring
from mbref.scene_joints import ANGLE
from mbref.trajectory import Trajectory


@dataclass(frozen=True)
class DriverMotion:
    """Force or torque, and power, that a driver supplies at k sample times (inverse dynamics).

    The driver acts on the second body of its joint and with the opposite sign on the first. A positive
    torque turns the second body about the joint's axis, a positive force pushes it along the axis. It is the
    component of the joint's reaction about or along the axis, on the second body. Springs at the joint act in
    addition. A motor must also accelerate its armature, and a coupling at the joint transmits a part of it.

    Attributes
    ----------
    joint : str
        Name of the driven joint.
    force : ndarray, shape (k,), or None
        Force along the axis, N, of a translational joint.
    torque : ndarray, shape (k,), or None
        Torque about the axis, N m, of a revolute or cylindrical joint.
    power : ndarray, shape (k,), or None
        Power into the mechanism, W: torque times rate of the angle, or force times rate of the displacement.

    All are None without masses.
    """

    joint: str
    force: np.ndarray | None
    torque: np.ndarray | None
    power: np.ndarray | None


@dataclass(frozen=True)
class LoadMotion:
    """Length, angle or displacement, rate, force or torque, and power of a load at k sample times.

    Numbers that a load of this type does not have are None; forces and moments on bodies have none.

    Attributes
    ----------
    place : int
        Place of the load in the scene, from 0.
    length, length_rate : ndarray, shape (k,), or None
        Distance of the points of a spring, m, and its rate, m/s.
    force : ndarray, shape (k,), or None
        Force of spring and damper, N: stiffness (length - natural length) + damping rate. It is positive
        where it pulls its points together. Of a load along a joint's axis, the force on the second body.
    angle, rate : ndarray, shape (k,), or None
        Angle, since t = 0, of the joint of a load about its axis, rad, and its rate, rad/s.
    displacement, displacement_rate : ndarray, shape (k,), or None
        Displacement, since t = 0, of the joint of a load along its axis, m, and its rate, m/s.
    torque : ndarray, shape (k,), or None
        Torque on the second body about the joint's axis, N m.
    power : ndarray, shape (k,), or None
        Power into the bodies, W: -force times length rate of a spring between points; otherwise torque times
        rate, or force times rate of the displacement.
    """

    place: int
    length: np.ndarray | None = None
    length_rate: np.ndarray | None = None
    force: np.ndarray | None = None
    angle: np.ndarray | None = None
    rate: np.ndarray | None = None
    displacement: np.ndarray | None = None
    displacement_rate: np.ndarray | None = None
    torque: np.ndarray | None = None
    power: np.ndarray | None = None


def driver_motion(scene: Scene, motion: Trajectory, name: str) -> DriverMotion:
    """Return force or torque, and power of the driver of a joint; raises KeyError that lists the drivers."""
    driven = [driver.joint for driver in scene.driver]
    if name not in driven:
        raise KeyError(f"no driver of a joint {name!r}; driven joints: {', '.join(driven) or 'none'}")
    joint, found = scene.joint_named(name), joint_motion(scene, motion, name)
    coordinate = joint.facts.driven
    if found.force is None or found.moment is None or coordinate is None:
        return DriverMotion(name, None, None, None)
    first = turned_since_start(scene, motion, joint.bodies[0])
    axis = rotations.rotate(first, rotations.unit(joint.directions[0])[None])
    turns, rate = coordinate == ANGLE, along(found, coordinate)[1]
    size = np.einsum("ki,ki->k", found.moment if turns else found.force, axis)
    return DriverMotion(name, None if turns else size, size if turns else None, size * rate)


def load_motion(scene: Scene, motion: Trajectory, place: int) -> LoadMotion:
    """Return length, angle or displacement, rate and force or torque of the load with the given index; raises
    IndexError."""
    if not 0 <= place < len(scene.load):
        raise IndexError(f"no load {place}; the scene has {len(scene.load)} loads, counted from 0")
    load = scene.load[place]
    if load.type == "spring":
        return _spring(scene, motion, place, load)
    return _of_joint(scene, motion, place, load) if isinstance(load, JointLoad) else LoadMotion(place)


def _of_joint(scene: Scene, motion: Trajectory, place: int, load: JointLoad) -> LoadMotion:
    found, action = joint_motion(scene, motion, load.joint), load.action
    moved, rate = along(found, load.coordinate)
    factor = 1.0 if load.over_time is None else load.over_time.values(motion.times)
    size = action.amount * factor - action.stiffness * (moved - action.natural) - action.damping * rate
    if load.coordinate == ANGLE:
        return LoadMotion(place, angle=moved, rate=rate, torque=size, power=size * rate)
    return LoadMotion(place, force=size, displacement=moved, displacement_rate=rate, power=size * rate)


def _spring(scene: Scene, motion: Trajectory, place: int, load: Spring) -> LoadMotion:
    ends = list(zip(load.bodies, load.points, strict=True))
    start, stop = (position_of(scene, motion, *end) for end in ends)
    start_rate, stop_rate = (velocity_of(scene, motion, *end) for end in ends)
    length = np.linalg.norm(stop - start, axis=1)
    direction = (stop - start) / np.where(length > 0, length, 1.0)[:, None]
    rate = np.einsum("ki,ki->k", stop_rate - start_rate, direction)
    force = load.stiffness * (length - load.natural_length) + load.damping * rate
    return LoadMotion(place, length, rate, force, power=-force * rate)


def largest_force(trajectory: Trajectory) -> np.ndarray | None:
    """Return the largest reaction force of a joint at each sample (k,), N; None without reactions."""
    if trajectory.reactions is None:
        return None
    forces = [np.linalg.norm(wrench[:, :3], axis=1) for wrench in trajectory.reactions.values()]
    return np.asarray(np.max(forces, axis=0, initial=0.0)) if forces else np.zeros(len(trajectory.times))
