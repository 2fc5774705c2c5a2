"""Scenes that are made from a simulated motion: started at one of its states, run backwards, or driven by its
driver's moment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from crosscheck.conformance.changes.copies import Outside, mapped, replaced
from crosscheck.judge.constraints import joint_coordinates
from crosscheck.judge.joint_coordinates import COORDINATES
from crosscheck.judge.time_functions import value
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import GROUND, Driver, Factor, Joint, Load, Moment, Scene

CONSTANT = 1e-6  # relative variation below which a driver's moment counts as constant


def started(scene: Scene, motion: Trajectory, sample: int, sense: float, duration: float) -> Scene:
    """Return the scene that starts at a sample of its motion with velocities times ``sense``, for a duration
    (s); drivers and springs continue."""
    t, carry = float(motion.times[sample]), _Carry(scene, motion, sample)
    angles = joint_coordinates(
        scene, motion.times, motion.position, motion.orientation, motion.angular_velocity, motion.angles
    )
    bodies = [
        replaced(
            body,
            position=motion.position[sample, b],
            orientation=motion.orientation[sample, b],
            velocity=sense * motion.velocity[sample, b],
            angular_velocity=sense * motion.angular_velocity[sample, b],
        )
        for b, body in enumerate(scene.body)
    ]
    loads: list[Load] = []
    for load in scene.load:
        if load.type in ("torsion_spring", "slide_spring"):
            column, field = COORDINATES.index(load.coordinate), f"natural_{load.coordinate}"
            moved = float(angles[load.joint][sample, column])
            loads.append(replaced(load, **{field: load.action.natural - moved}))
        elif load.type == "spring":
            points = [carry.point(*end) for end in zip(load.bodies, load.points, strict=True)]
            loads.append(replaced(load, points=[point.tolist() for point in points]))
        elif load.type == "force":
            loads.append(replaced(load, point=carry.point(load.body, load.point)))
        elif load.type == "point_damper":
            loads.append(replaced(load, point=carry.point(load.bodies[1], load.point)))
        else:
            loads.append(load)
    loads = [replaced(load, factor=_shifted(load.over_time, t)) if load.over_time else load for load in loads]
    return scene.with_(
        duration=duration,
        body=tuple(bodies),
        joint=tuple(map(carry.joint, scene.joint)),
        load=tuple(loads),
        driver=tuple(_later(driver, t) for driver in scene.driver),
    )


class _Carry:
    """Map of body-fixed points and directions from their places at t = 0 to their places at a sample."""

    def __init__(self, scene: Scene, motion: Trajectory, sample: int):
        self.scene, self.motion, self.sample = scene, motion, sample

    def point(self, name: str, point: Sequence[float]) -> np.ndarray:
        if name == GROUND:
            return np.array(point)
        b = self.scene.body_index(name)
        arm = np.array(point) - np.array(self.scene.body[b].position)
        return self.motion.position[self.sample, b] + self.direction(name, arm)

    def direction(self, name: str, vector: Any) -> np.ndarray:
        if name == GROUND:
            return np.array(vector)
        b = self.scene.body_index(name)
        start = rotations.conjugate(np.array(self.scene.body[b].orientation))
        return rotations.rotate(
            rotations.multiply(self.motion.orientation[self.sample, b], start), np.array(vector)
        )

    def joint(self, joint: Joint) -> Joint:
        fields: dict[str, Any] = {}
        if joint.type == "distance":
            fields["anchors"] = [
                self.point(*end).tolist() for end in zip(joint.bodies, joint.anchors, strict=True)
            ]
        else:
            fields["anchor"] = self.point(joint.bodies[0], joint.anchor)
        if joint.type == "universal":
            fields["axes"] = [self.direction(*e).tolist() for e in zip(joint.bodies, joint.axes, strict=True)]
        elif hasattr(joint, "axis"):
            fields["axis"] = self.direction(joint.bodies[0], joint.axis)
        return replaced(joint, **fields)


def _later(driver: Driver, t: float) -> Driver:
    """Return the driver as a function of the time since t, measured from its value at t."""
    later: Driver = _shifted(driver, t, float(value(driver, t)))
    return later


def _shifted(function: Any, t: float, less: float = 0.0) -> Any:
    """Return a function of time shifted to begin at time t; its polynomial is ``less`` lower."""
    if function.interval[1] <= t:
        return Factor(polynomial=(0.0,))
    since = np.polynomial.Polynomial([t, 1.0])
    fields = {
        "polynomial": lambda c: (np.polynomial.Polynomial(c)(since) - less).coef,
        "sine": lambda sine: replaced(sine, phase=sine.phase + sine.frequency * t),
        "table": lambda rows: tuple((time - t, x) for time, x in rows),
        "start": lambda start: max(start - t, 0.0),
        "stop": lambda stop: stop - t,
    }
    return mapped(function, fields)


def _half_way(scene: Scene, motion: Trajectory) -> Scene:
    half = len(motion.times) // 2
    return started(scene, motion, half, 1.0, float(motion.times[-1] - motion.times[half]))


def _second_half(scene: Scene, motion: Trajectory) -> Trajectory:
    half = len(motion.times) // 2
    chosen = np.arange(half, len(motion.times))
    return _samples(scene, motion, chosen, motion.times[half:] - motion.times[half], 1.0)


def _from_the_end(scene: Scene, motion: Trajectory) -> Scene | Outside:
    if scene.driver or any(load.is_damped or load.over_time for load in scene.load):
        return Outside("a driver, a damper or a load over time acts, so the motion is not reversible")
    return started(scene, motion, len(motion.times) - 1, -1.0, scene.duration)


def _backwards(scene: Scene, motion: Trajectory) -> Trajectory:
    return _samples(scene, motion, np.arange(len(motion.times))[::-1], motion.times, -1.0)


def _samples(
    scene: Scene, motion: Trajectory, chosen: np.ndarray, times: np.ndarray, sense: float
) -> Trajectory:
    """Return samples of a motion, with the reactions of the joints whose two anchors stay together."""
    second, turning = motion.acceleration, motion.angular_acceleration
    kept = joints_kept(motion, pinned(scene)).reactions
    return replace(
        motion,
        times=times,
        position=motion.position[chosen],
        orientation=motion.orientation[chosen],
        velocity=sense * motion.velocity[chosen],
        angular_velocity=sense * motion.angular_velocity[chosen],
        acceleration=None if second is None else second[chosen],
        angular_acceleration=None if turning is None else turning[chosen],
        reactions=kept and {name: wrench[chosen] for name, wrench in kept.items()},
    )


def pinned(scene: Scene) -> list[str]:
    """Return the names of the joints whose two anchors stay together, so that the reaction acts on both
    bodies at one point."""
    return [joint.name for joint in scene.joint if len(joint.facts.forbidden_translations) == 3]


def joints_kept(motion: Trajectory, names: Sequence[str]) -> Trajectory:
    """Return the motion with the reactions of the named joints only."""
    return replace(motion, reactions=motion.reactions and {n: motion.reactions[n] for n in names})


RESTARTED = _half_way, _second_half
REVERSED = _from_the_end, _backwards


def replayed(scene: Scene, motion: Trajectory) -> Scene | Outside:
    """Return the scene with the driver of a hinge to the ground replaced by the driver's moment in the
    engine's output."""
    if len(scene.driver) != 1 or not motion.reactions:
        return Outside("the scene does not have exactly one driver, or the engine gives no reactions")
    joint = next(j for j in scene.joint if j.name == scene.driver[0].joint)
    if joint.facts.driven == "displacement" or joint.bodies[0] != GROUND:
        return Outside("its driver does not turn a body about an axis on the ground")
    axis: Any = rotations.unit(joint.directions[0])
    moment = motion.reactions[joint.name][:, 3:] @ axis
    if np.ptp(moment) > CONSTANT * np.abs(moment).max():
        return Outside("its driver's moment varies, and the scene format has constant moments only")
    load = Moment(body=joint.bodies[1], moment=float(moment.mean()) * axis)
    bodies = [
        replaced(body, velocity=motion.velocity[0, k], angular_velocity=motion.angular_velocity[0, k])
        for k, body in enumerate(scene.body)
    ]
    return scene.with_(driver=(), load=(*scene.load, load), body=tuple(bodies))
