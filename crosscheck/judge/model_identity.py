"""Model identity: do two engines simulate the same mechanism? Asked before their speeds are compared.

Every engine makes a short run.  The initial poses and the changes of the velocities must agree, so that
masses, inertias, axes and loads are the same.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from crosscheck.judge.constraints import scene_length
from crosscheck.judge.energy import kinetic_energy, potential_energy
from crosscheck.judge.metrics import in_scene_order
from crosscheck.judge.tolerances import GATE_TIME, SAME_CHANGE, SAME_START
from mbref import rotations
from mbref.scene import Scene
from mbref.trajectory import Trajectory


@dataclass(frozen=True)
class Difference:
    """The first field in which two engines' models differ, by how much of its scale, and the allowance."""

    field: str
    engines: tuple[str, str]
    by: float
    allowed: float

    def __str__(self) -> str:
        first, second = self.engines
        return f"{self.field}: {first} and {second} differ by {self.by:.3g} (allowed {self.allowed:.0e})"


def gate_times(scene: Scene) -> np.ndarray:
    """The times (2,) to run every engine for, s: the start, and a thousandth of the scene's duration."""
    return np.array([0.0, GATE_TIME * scene.duration])


def gate(scene: Scene, trajectories: Sequence[Trajectory]) -> Difference | None:
    """The first difference between the first trajectory and another, or None when all agree.

    Trajectories are runs at `gate_times`; put the truth's first when there is one.
    """
    reference, *others = (in_scene_order(scene, trajectory) for trajectory in trajectories)
    for other in others:
        for field, by, allowed in _differences(scene, reference, other):
            if not by <= allowed:
                return Difference(field, (reference.engine, other.engine), by, allowed)
    return None


def _differences(
    scene: Scene, first: Trajectory, second: Trajectory
) -> Iterator[tuple[str, float, float]]:  # fmt: skip
    """(field, difference relative to its scale, allowance), in the order in which causes come first."""
    missing = abs(len(first.times) - len(second.times)) + abs(2 - len(first.times))
    yield "samples reached", float(missing), 0.0
    length = scene_length(scene)
    yield "initial position", _apart(first.position[0], second.position[0], length), SAME_START
    angles = rotations.angle_between(first.orientation[0], second.orientation[0])
    yield "initial orientation", float(angles.max()), SAME_START
    if scene.has_mass():
        off = _apart(_centre_of_mass(scene, first), _centre_of_mass(scene, second), length)
        yield "centre of mass", off, SAME_START
    speed = max(_size(first.velocity[0]), length * _size(first.angular_velocity[0]), length / scene.duration)
    yield "initial velocity", _apart(first.velocity[0], second.velocity[0], speed), SAME_START
    angular = (first.angular_velocity[0], second.angular_velocity[0])
    yield "initial angular velocity", _apart(*angular, speed / length), SAME_START
    if scene.has_mass():
        energies = [_energy(scene, t) for t in (first, second)]
        scale = max(*map(abs, energies), _energy_unit(scene))
        yield "initial energy", abs(energies[0] - energies[1]) / scale, 4 * SAME_START
    yield from _changes(first, second, length, speed)


def _changes(
    first: Trajectory, second: Trajectory, length: float, speed: float
) -> Iterator[tuple[str, float, float]]:  # fmt: skip
    changes = [
        (np.diff(t.velocity, axis=0), length * np.diff(t.angular_velocity, axis=0)) for t in (first, second)
    ]
    change = max(*map(_size, changes[0]), SAME_START * speed)
    yield "change of velocity", _apart(changes[0][0], changes[1][0], change), SAME_CHANGE
    yield "change of angular velocity", _apart(changes[0][1], changes[1][1], change), SAME_CHANGE
    yield from _given_accelerations(first, second, length)


def _given_accelerations(
    first: Trajectory, second: Trajectory, length: float
) -> Iterator[tuple[str, float, float]]:  # fmt: skip
    linear = (first.acceleration, second.acceleration)
    angular = (first.angular_acceleration, second.angular_acceleration)
    if linear[0] is None or linear[1] is None or angular[0] is None or angular[1] is None:
        return
    scale = max(_size(linear[0][0]), length * _size(angular[0][0]))
    if scale > 0:
        yield "initial acceleration", _apart(linear[0][0], linear[1][0], scale), SAME_CHANGE
        yield (
            "initial angular acceleration",
            _apart(angular[0][0], angular[1][0], scale / length),
            SAME_CHANGE,
        )


def _size(vectors: np.ndarray) -> float:
    return float(np.linalg.norm(vectors, axis=-1).max())


def _apart(first: np.ndarray, second: np.ndarray, scale: float) -> float:
    return _size(second - first) / scale


def _centre_of_mass(scene: Scene, trajectory: Trajectory) -> np.ndarray:
    mass = np.array([body.mass for body in scene.body])
    return mass @ trajectory.position[0] / mass.sum()


def _energy(scene: Scene, trajectory: Trajectory) -> float:
    at = (trajectory.position[:1], trajectory.orientation[:1])
    rates = (trajectory.velocity[:1], trajectory.angular_velocity[:1])
    return float(kinetic_energy(scene, at[1], *rates)[0] + potential_energy(scene, *at)[0])


def _energy_unit(scene: Scene) -> float:
    """An energy (J) of the scene's size: all its mass at one length per duration."""
    return sum(body.mass or 0.0 for body in scene.body) * (scene_length(scene) / scene.duration) ** 2
