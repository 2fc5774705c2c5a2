"""Columns of drivers, loads and energies, such as driver(A).torque in N m, by the judge's own equations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from crosscheck.judge.driver_forces import driver_forces
from crosscheck.judge.energy import kinetic_energy, potential_energy
from crosscheck.judge.loads import attachment
from crosscheck.judge.time_functions import value
from mbref import rotations
from mbref.motions.trajectory import Trajectory
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
from mbref.scene.joints import ANGLE

ENERGIES = ("kinetic_energy", "potential_energy", "energy")
SPRING = ("length", "length_rate", "force", "power", "energy")
TURNING = ("angle", "rate", "torque", "power")
MOMENTS = ("moment.x", "moment.y", "moment.z")  # of a driven orientation
SLIDING = ("displacement", "displacement_rate", "force", "power")


def action_names(scene: Scene) -> list[str]:
    """Return the names of the columns of loads, and of drivers and energies if all bodies have masses."""
    found: list[str] = []
    for place, load in enumerate(scene.load):
        found += [f"load({place}).{kind}" for kind in _kinds(load)]
    if scene.has_mass():
        for driver in scene.driver:
            slides = scene.joint_named(driver.joint).facts.driven != ANGLE
            kinds = MOMENTS if driver.turn else ("force",) if slides else ("torque",)
            found += [f"driver({driver.joint}).{kind}" for kind in (*kinds, "power")]
        found += ENERGIES
    return found


def _kinds(load: object) -> tuple[str, ...]:
    if isinstance(load, JointLoad):
        kinds = TURNING if load.coordinate == ANGLE else SLIDING
        return (*kinds, "energy") if isinstance(load, TorsionSpring | SlideSpring) else kinds
    return SPRING if isinstance(load, Spring) else ("power",)


def actions(scene: Scene, motion: Trajectory, moved: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the columns (k,) of drivers, loads and energies of a motion, in SI units.

    ``moved`` has the columns of joints, such as ``A.angle`` and ``A.rate``. Force and power of a driver are
    NaN at samples at which redundant constraints do not determine them.
    """
    found: dict[str, np.ndarray] = {}
    for place, load in enumerate(scene.load):
        if isinstance(load, JointLoad):
            numbers = _of_joint(load, motion.times, moved)
        elif isinstance(load, Spring):
            numbers = _of_spring(scene, load, motion)
        else:
            numbers = (_power(scene, load, motion),)
        found.update(zip((f"load({place}).{kind}" for kind in _kinds(load)), numbers, strict=True))
    if scene.has_mass():
        found.update(_energies(scene, motion, moved))
        if motion.acceleration is not None:
            found.update(_drivers(scene, motion, moved))
    return found


def _of_joint(load: JointLoad, times: np.ndarray, moved: Mapping[str, np.ndarray]) -> tuple[np.ndarray, ...]:
    """Return coordinate, rate, force or torque on the second body, and power into the bodies (k,); of a
    spring also its energy."""
    q, rate = (moved[f"{load.joint}.{kind}"] for kind in _kinds(load)[:2])
    action = load.action
    stretch = q - action.natural
    push = action.amount * _factor(load, times) - action.stiffness * stretch - action.damping * rate
    energy = (action.stiffness * stretch**2 / 2,) if "energy" in _kinds(load) else ()
    return q, rate, push, push * rate, *energy


def _factor(load: Force | Moment | JointLoad, times: np.ndarray) -> np.ndarray:
    """Return the factor (k,) of a load at times (k,), s."""
    return np.ones(len(times)) if load.over_time is None else value(load.over_time, times)


def _power(
    scene: Scene, load: Force | Moment | RotationalDamper | PointDamper, motion: Trajectory
) -> np.ndarray:
    """Return the power (k,) of a force or a moment on a body, or of a damper between bodies, W."""
    if isinstance(load, RotationalDamper | PointDamper):
        first = scene.body_index(load.bodies[0])
        spins = [_spin(scene, name, motion) for name in load.bodies]
        if isinstance(load, RotationalDamper):
            rate = spins[1] - spins[0]
        else:
            place, rate = _end(scene, load.bodies[1], load.point, motion)
            if first >= 0:
                carried = np.cross(spins[0], place - motion.position[:, first])
                rate = rate - motion.velocity[:, first] - carried
        return np.asarray(-load.damping * np.sum(rate**2, axis=1))
    if isinstance(load, Force):
        rate, action = _end(scene, load.body, load.point, motion)[1], load.force
    else:
        rate, action = motion.angular_velocity[:, scene.body_index(load.body)], load.moment
    return np.asarray(_factor(load, motion.times) * (rate @ np.array(action)))


def _spin(scene: Scene, name: str, motion: Trajectory) -> np.ndarray:
    """Return the angular velocity (k, 3) of a body or of the ground."""
    body = scene.body_index(name)
    return np.zeros((len(motion.times), 3)) if body < 0 else motion.angular_velocity[:, body]


def _of_spring(scene: Scene, load: Spring, motion: Trajectory) -> tuple[np.ndarray, ...]:
    """Return length, its rate, pull, power into the bodies, and energy (k,)."""
    ends = [_end(scene, name, point, motion) for name, point in zip(load.bodies, load.points, strict=True)]
    offset, rate = (second - first for first, second in zip(*ends, strict=True))
    length = np.linalg.norm(offset, axis=1)
    along = np.sum(offset * rate, axis=1) / np.where(length > 0, length, 1.0)
    stretch = length - load.natural_length
    pull = load.stiffness * stretch + load.damping * along
    return length, along, pull, -pull * along, load.stiffness * stretch**2 / 2


def _end(
    scene: Scene, name: str, point: tuple[float, ...], motion: Trajectory
) -> tuple[np.ndarray, np.ndarray]:
    """Return world position and velocity (k, 3) of a point given at t = 0."""
    body, local = attachment(scene, name, point)
    if body < 0:
        return np.tile(local, (len(motion.times), 1)), np.zeros((len(motion.times), 3))
    arm = rotations.rotate(motion.orientation[:, body], local)
    speed = motion.velocity[:, body] + np.cross(motion.angular_velocity[:, body], arm)
    return motion.position[:, body] + arm, speed


def _energies(
    scene: Scene, motion: Trajectory, moved: Mapping[str, np.ndarray]
) -> Iterator[tuple[str, np.ndarray]]:
    pose = motion.position, motion.orientation
    kinetic = kinetic_energy(scene, *pose, motion.velocity, motion.angular_velocity)
    potential = potential_energy(scene, *pose)
    for load in scene.load:
        if isinstance(load, JointLoad):
            stretch = moved[f"{load.joint}.{load.coordinate}"] - load.action.natural
            potential = potential + load.action.stiffness * stretch**2 / 2
    yield from zip(ENERGIES, (kinetic, potential, kinetic + potential), strict=True)


def _drivers(
    scene: Scene, motion: Trajectory, moved: Mapping[str, np.ndarray]
) -> Iterator[tuple[str, np.ndarray]]:
    for joint, push in driver_forces(scene, motion).items() if scene.driver else ():
        if push.ndim > 1:
            yield from zip((f"driver({joint}).{kind}" for kind in MOMENTS), push.T, strict=True)
            first, second = (_spin(scene, name, motion) for name in scene.joint_named(joint).bodies)
            yield f"driver({joint}).power", np.sum(push * (second - first), axis=1)
            continue
        slides = scene.joint_named(joint).facts.driven != ANGLE
        yield f"driver({joint}).{'force' if slides else 'torque'}", push
        yield f"driver({joint}).power", push * moved[f"{joint}.{'displacement_rate' if slides else 'rate'}"]
