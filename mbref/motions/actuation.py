"""Forces, torques and powers of the drivers, springs and loads of joints of a motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mbref.motions.driving_forces import driving_forces, driving_moment
from mbref.motions.joint_motion import along, angular_velocity_of, joint_motion, position_of, velocity_of
from mbref.motions.trajectory import Trajectory
from mbref.rotations import cross
from mbref.scene import (
    Force,
    JointLoad,
    Moment,
    PointDamper,
    RotationalDamper,
    Scene,
    SlideSpring,
    Spring,
    TorsionSpring,
)
from mbref.scene.bodies import DRIVER
from mbref.scene.joints import ANGLE
from mbref.scene.loads import LoadEntry


@dataclass(frozen=True, eq=False)
class DriverMotion:
    """Force or torque, and power, that a driver supplies at k sample times (inverse dynamics).

    The driver acts on the second body of its joint and with the opposite sign on the first. A positive
    torque turns the second body about the joint's axis, a positive force pushes it along the axis. It
    accelerates the armature of the joint and drives the couplings of the joint; springs at the joint act in
    addition. Powers of all drivers and loads are the rate of energy (docs/outputs.md).

    Attributes
    ----------
    joint : str
        Name of the driven joint.
    force : ndarray, shape (k,), or None
        Force along the axis, N, of a translational joint.
    torque : ndarray, shape (k,), or None
        Torque about the axis, N m, of a revolute, cylindrical or planar joint.
    power : ndarray, shape (k,), or None
        Power into the mechanism, W: torque times rate of the angle, force times rate of the displacement, or
        moment times relative angular velocity.
    open : ndarray, shape (k,), or None
        1 where equilibrium does not determine the force or torque, because another driver or constraint can
        replace the driver; otherwise 0. None if the engine does not give it.
    moment : ndarray, shape (k, 3), or None
        Moment on the second body, N m, world axes, of a ball joint with driven orientation.

    All these are None without masses, and without reactions or accelerations that they need.
    """

    joint: str
    force: np.ndarray | None
    torque: np.ndarray | None
    power: np.ndarray | None
    open: np.ndarray | None = None
    moment: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class LoadMotion:
    """Length, angle or displacement, rate, force or torque, power and energy of a load at k sample times.

    Numbers that a load of this type does not have are None; forces and moments on bodies have power only.

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
        Power into the bodies, W: -force times length rate of a spring between points; torque times rate, or
        force times rate of the displacement, of a load of a joint; force times velocity of its point, or
        moment times angular velocity, of a force or moment on a body.
    energy : ndarray, shape (k,), or None
        Energy that a spring stores, J: stiffness times the square of its stretch, over 2. It is a part of the
        potential energy.
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
    energy: np.ndarray | None = None


def driver_motion(scene: Scene, motion: Trajectory, name: str) -> DriverMotion:
    """Return force or torque, and power of the driver of a joint; raises KeyError that lists the drivers."""
    driven = [driver.joint for driver in scene.driver]
    if name not in driven:
        raise KeyError(f"no driver of a joint {name!r}; driven joints: {', '.join(driven) or 'none'}")
    joint = scene.joint_named(name)
    coordinate = joint.facts.driven
    marks = (motion.open_reactions or {}).get(DRIVER.format(name))
    if coordinate is None:
        moment = driving_moment(motion, name)
        first, second = (angular_velocity_of(scene, motion, body) for body in joint.bodies)
        power = None if moment is None else np.einsum("ki,ki->k", moment, second - first)
        return DriverMotion(name, None, None, power, marks, moment)
    size = driving_forces(scene, motion).get(name)
    if size is None:
        return DriverMotion(name, None, None, None, marks)
    turns, rate = coordinate == ANGLE, along(joint_motion(scene, motion, name), coordinate)[1]
    return DriverMotion(name, None if turns else size, size if turns else None, size * rate, marks)


def load_motion(scene: Scene, motion: Trajectory, place: int) -> LoadMotion:
    """Return length, angle or displacement, rate and force or torque of the load with the given index; raises
    IndexError."""
    if not 0 <= place < len(scene.load):
        raise IndexError(f"no load {place}; the scene has {len(scene.load)} loads, counted from 0")
    load = scene.load[place]
    if isinstance(load, Spring):
        return _spring(scene, motion, place, load)
    if isinstance(load, JointLoad):
        return _of_joint(scene, motion, place, load)
    if isinstance(load, RotationalDamper | PointDamper):
        rates = _seen(scene, motion, load)
        return LoadMotion(place, power=-load.damping * np.einsum("ki,ki->k", rates, rates))
    return LoadMotion(place, power=factor_of(load, motion) * _power_of_constant(scene, motion, load))


def factor_of(load: LoadEntry, motion: Trajectory) -> np.ndarray:
    """Return the factor (k,) of a load over time; ones for a load without a factor."""
    values = np.ones(len(motion.times)) if load.over_time is None else load.over_time.values(motion.times)
    return np.asarray(values)


def _power_of_constant(scene: Scene, motion: Trajectory, load: Force | Moment) -> np.ndarray:
    """Return the power (k,) of a force or moment on a body, before its factor: F · v of its point, or
    M · ω."""
    if isinstance(load, Force):
        return velocity_of(scene, motion, load.body, load.point) @ np.array(load.force)
    return angular_velocity_of(scene, motion, load.body) @ np.array(load.moment)


def _seen(scene: Scene, motion: Trajectory, load: RotationalDamper | PointDamper) -> np.ndarray:
    """Return the angular velocity (k, 3) of a damper's second body, or the velocity of its point, as seen
    from the first body, world axes."""
    first, second = load.bodies
    if isinstance(load, RotationalDamper):
        return angular_velocity_of(scene, motion, second) - angular_velocity_of(scene, motion, first)
    apart = position_of(scene, motion, second, load.point) - position_of(scene, motion, first, load.point)
    velocity = velocity_of(scene, motion, second, load.point) - velocity_of(scene, motion, first, load.point)
    return np.asarray(velocity - cross(angular_velocity_of(scene, motion, first), apart))


def _of_joint(scene: Scene, motion: Trajectory, place: int, load: JointLoad) -> LoadMotion:
    found, action = joint_motion(scene, motion, load.joint), load.action
    moved, rate = along(found, load.coordinate)
    stretch = moved - action.natural
    size = action.amount * factor_of(load, motion) - action.stiffness * stretch - action.damping * rate
    energy = action.stiffness * stretch**2 / 2 if isinstance(load, TorsionSpring | SlideSpring) else None
    numbers = {"power": size * rate, "energy": energy}
    if load.coordinate == ANGLE:
        return LoadMotion(place, angle=moved, rate=rate, torque=size, **numbers)
    return LoadMotion(place, force=size, displacement=moved, displacement_rate=rate, **numbers)


def _spring(scene: Scene, motion: Trajectory, place: int, load: Spring) -> LoadMotion:
    ends = list(zip(load.bodies, load.points, strict=True))
    start, stop = (position_of(scene, motion, *end) for end in ends)
    start_rate, stop_rate = (velocity_of(scene, motion, *end) for end in ends)
    length = np.linalg.norm(stop - start, axis=1)
    direction = (stop - start) / np.where(length > 0, length, 1.0)[:, None]
    rate = np.einsum("ki,ki->k", stop_rate - start_rate, direction)
    stretch = length - load.natural_length
    force = load.stiffness * stretch + load.damping * rate
    return LoadMotion(place, length, rate, force, power=-force * rate, energy=load.stiffness * stretch**2 / 2)


def largest_force(trajectory: Trajectory) -> np.ndarray | None:
    """Return the largest reaction force of a joint at each sample (k,), N; None without reactions."""
    if trajectory.reactions is None:
        return None
    forces = [np.linalg.norm(wrench[:, :3], axis=1) for wrench in trajectory.reactions.values()]
    return np.asarray(np.max(forces, axis=0, initial=0.0)) if forces else np.zeros(len(trajectory.times))
