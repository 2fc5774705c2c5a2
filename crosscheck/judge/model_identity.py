"""Check that two engines simulate equal mechanisms, made before their speeds are compared.

Every engine makes a short run.  The initial poses and the changes of the velocities must agree, so that
masses, inertias, axes and loads are the same.  Differences are relative to the largest value, or to a
fraction of the accelerations that gravity, loads, drivers and velocities of the scene can cause, whichever is
larger: accelerations that balance to zero are rounding. An engine in single precision may differ by the
rounding that it declares, and in the changes of the velocities by SINGLE_CHANGE.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from crosscheck.judge.constraints import initial_twists, jacobian, joint_coordinates, scene_length
from crosscheck.judge.coupling_laws import unwound
from crosscheck.judge.energy import kinetic_energy, potential_energy
from crosscheck.judge.gauss_motion import accelerations
from crosscheck.judge.joint_loads import turning_loads
from crosscheck.judge.metrics import in_scene_order
from crosscheck.judge.pieces import at_start, has_pieces
from crosscheck.judge.time_functions import value
from crosscheck.judge.tolerances import (
    GATE_TIME,
    GRAINS,
    LEAST_CHANGE,
    NEXT_TO_SINGULAR,
    RANK,
    ROUNDING,
    SAME_CHANGE,
    SAME_FORCES,
    SAME_START,
    SINGLE_CHANGE,
)
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import Force, Load, Moment, PointDamper, RotationalDamper, Scene, Spring
from mbref.scene.joints import ANGLE

ALONG = 6  # number of samples at which the accelerations of a run are compared
DRIVEN_SAMPLES = 101  # samples of a driver's motion among which its largest acceleration is found


@dataclass(frozen=True)
class Difference:
    """The first quantity in which two engines' models differ: the relative difference, and the allowed
    one."""

    field: str
    engines: tuple[str, str]
    by: float
    allowed: float

    def __str__(self) -> str:
        first, second = self.engines
        by = f"{self.by:.3g}"
        by = by if float(by) > self.allowed else repr(float(self.by))  # as many digits as show the excess
        return f"{self.field}: {first} and {second} differ by {by} (allowed {self.allowed:.0e})"


def gate_times(scene: Scene) -> np.ndarray:
    """Return the times (2,) s of the short runs: the start, and a thousandth of the scene's duration."""
    return np.array([0.0, GATE_TIME * scene.duration])


def gate(scene: Scene, trajectories: Sequence[Trajectory]) -> Difference | None:
    """Return the first difference between the first trajectory and another one, or None if all trajectories
    agree.

    Trajectories are runs at `gate_times`; put the truth's trajectory first if the scene has a truth.
    """
    return next(iter(differences(scene, trajectories).values()), None)


def differences(
    scene: Scene, trajectories: Sequence[Trajectory], rounding: Mapping[str, float] | None = None
) -> dict[str, Difference]:
    """Return for each engine the first difference of its trajectory from the first trajectory, as in `gate`.

    ``rounding`` has the relative rounding of each engine's numbers, by name; engines without an entry compute
    in double precision. Scenes with intervals are compared as they start.
    """
    scene = at_start(scene)
    reference, *others = (in_scene_order(scene, trajectory) for trajectory in trajectories)
    found: dict[str, Difference] = {}
    for other in others:
        for field, by, allowed in _differences(
            scene, reference, other, (rounding or {}).get(other.engine, 0.0)
        ):
            if not by <= allowed:
                found[other.engine] = Difference(field, (reference.engine, other.engine), by, allowed)
                break
    return found


def along(scene: Scene, run: Trajectory) -> Difference | None:
    """Return the first difference between a run's accelerations and the accelerations by the judge's
    equations at the run's own states. Some samples are compared. None without accelerations or masses.

    Errors of the integration have no influence, since the run is not compared with a motion.
    Samples next to singular positions are left out. None for a scene with intervals.
    """
    if has_pieces(scene):
        return None
    run, length = in_scene_order(scene, run), scene_length(scene)
    linear, angular = run.acceleration, run.angular_acceleration
    if linear is None or angular is None or not scene.has_mass():
        return None
    pose = run.times, run.position, run.orientation, run.angular_velocity
    angles = joint_coordinates(scene, *pose, run.angles)
    twisted = [load.joint for load in turning_loads(scene)]
    chosen = np.unique(np.linspace(0, len(run.times) - 1, ALONG).round().astype(int)).tolist()
    for k in _regular(scene, run, chosen if len(run.times) else []):
        turned = np.array([angles[name][k, 0] for name in twisted])
        state = run.position[k], run.orientation[k], run.velocity[k], run.angular_velocity[k], turned
        if not np.isfinite(turned).all():
            continue
        own = accelerations(scene, run.times[k], state) * np.repeat([1.0, length], 3)
        theirs = np.hstack([linear[k], length * angular[k]])
        scale = max(_size(own.reshape(-1, 3)), LEAST_CHANGE * acceleration_scale(scene))
        by = _apart(own.reshape(-1, 3), theirs.reshape(-1, 3), scale)
        if not by <= SAME_FORCES:
            field = f"acceleration at t = {run.times[k]:.3g} s"
            return Difference(field, ("the judge", run.engine), by, SAME_FORCES)
    return None


def acceleration_scale(scene: Scene) -> float:
    """Return the acceleration (m/s²) that gravity, loads, drivers and velocities can cause: relative to it,
    accelerations that balance to zero are rounding."""
    length, mass = scene_length(scene), sum(body.mass or 0.0 for body in scene.body)
    speed = _initial_speed(scene)
    parts = [math.hypot(*scene.gravity), speed**2 / length]
    for driver in scene.driver:
        of_length = 1.0 if scene.joint_named(driver.joint).facts.driven == "displacement" else length
        times = np.linspace(0.0, scene.duration, DRIVEN_SAMPLES)
        rate, change = (
            of_length * sum(np.abs(value(function, times, k)).max() for function in driver.functions)
            for k in (1, 2)
        )
        parts += [float(change), float(rate) ** 2 / length]
    if mass > 0:
        parts += [_force(load, length, speed) * _most(scene, load) / mass for load in scene.load]
    return max(parts)


def _most(scene: Scene, load: Load) -> float:
    """Return the largest size of the function of time that multiplies a load; 1 without such a function."""
    times = np.linspace(0.0, scene.duration, DRIVEN_SAMPLES)
    return 1.0 if load.over_time is None else float(np.abs(value(load.over_time, times)).max())


def _force(load: Load, length: float, speed: float) -> float:
    """Return the size (N) of a load at the start; moments are divided by the scene's length."""
    if isinstance(load, Force):
        return math.hypot(*load.force)
    if isinstance(load, Moment):
        return math.hypot(*load.moment) / length
    if isinstance(load, Spring):
        stretch = abs(math.dist(*load.points) - load.natural_length)
        return load.stiffness * stretch + load.damping * speed
    if isinstance(load, RotationalDamper | PointDamper):
        return load.damping * speed / (length**2 if isinstance(load, RotationalDamper) else 1.0)
    arm, action = length if load.coordinate == ANGLE else 1.0, load.action
    resistance = action.stiffness * abs(action.natural) + action.damping * speed / arm
    return (resistance + abs(action.amount)) / arm


def _initial_speed(scene: Scene) -> float:
    """Return the largest initial velocity (m/s), or angular velocity times the scene's length."""
    velocity, angular_velocity = initial_twists(scene)
    return max(_size(velocity), scene_length(scene) * _size(angular_velocity))


def _regular(scene: Scene, run: Trajectory, chosen: Sequence[int]) -> list[int]:
    """Return the chosen samples, except samples near a pose at which the rank of the joints' rows drops."""
    if not scene.joint:
        return list(chosen)
    units = np.tile(np.repeat([1.0, 1 / scene_length(scene)], 3), len(scene.body))
    scenes = unwound(scene, run)
    poses = {k: (scenes[k], run.times[k], run.position[k], run.orientation[k]) for k in chosen}
    rows = {k: jacobian(*pose)[0] * units for k, pose in poses.items()}
    chosen = [k for k, matrix in rows.items() if np.isfinite(matrix).all()]
    values = [np.linalg.svd(rows[k], compute_uv=False) for k in chosen]
    ranks = [int(np.sum(v > RANK * v[0])) for v in values]
    near = [bool(v[rank - 1] < NEXT_TO_SINGULAR * v[0]) for v, rank in zip(values, ranks, strict=True)]
    return [k for k, r, n in zip(chosen, ranks, near, strict=True) if r == max(ranks) and not n]


def _differences(
    scene: Scene, first: Trajectory, second: Trajectory, rounding: float = 0.0
) -> Iterator[tuple[str, float, float]]:
    """Return (quantity, difference relative to its scale, allowed difference), causes before their
    effects."""
    missing = abs(len(first.times) - len(second.times)) + abs(2 - len(first.times))
    yield "samples reached", float(missing), 0.0
    length, grain = scene_length(scene), GRAINS * rounding
    same_place = SAME_START + grain * max(1.0, _size(first.position[0]) / length)
    yield "initial position", _apart(first.position[0], second.position[0], length), same_place
    angles = rotations.angle_between(first.orientation[0], second.orientation[0])
    yield "initial orientation", float(angles.max()), SAME_START + grain
    if scene.has_mass():
        off = _apart(_centre_of_mass(scene, first), _centre_of_mass(scene, second), length)
        yield "centre of mass", off, same_place
    speed = max(_size(first.velocity[0]), length * _size(first.angular_velocity[0]), length / scene.duration)
    yield "initial velocity", _apart(first.velocity[0], second.velocity[0], speed), SAME_START + grain
    angular = (first.angular_velocity[0], second.angular_velocity[0])
    yield "initial angular velocity", _apart(*angular, speed / length), SAME_START + grain
    if scene.has_mass():
        energies = [_energy(scene, t) for t in (first, second)]
        scale = max(*map(abs, energies), _energy_unit(scene))
        yield "initial energy", abs(energies[0] - energies[1]) / scale, 4 * same_place
    yield from _changes(scene, first, second, speed, SAME_CHANGE if rounding <= ROUNDING else SINGLE_CHANGE)


def _changes(
    scene: Scene, first: Trajectory, second: Trajectory, speed: float, allowed: float
) -> Iterator[tuple[str, float, float]]:
    """Return the differences of the changes of velocities, and of given accelerations; ``speed`` (m/s) is the
    largest initial velocity."""
    length, least = scene_length(scene), LEAST_CHANGE * acceleration_scale(scene)
    changes = [
        (np.diff(t.velocity, axis=0), length * np.diff(t.angular_velocity, axis=0)) for t in (first, second)
    ]
    change = max(*map(_size, changes[0]), least * float(first.times[1]), SAME_START * speed)
    yield "change of velocity", _apart(changes[0][0], changes[1][0], change), allowed
    yield "change of angular velocity", _apart(changes[0][1], changes[1][1], change), allowed
    linear = (first.acceleration, second.acceleration)
    angular = (first.angular_acceleration, second.angular_acceleration)
    if linear[0] is None or linear[1] is None or angular[0] is None or angular[1] is None:
        return
    scale = max(_size(linear[0][0]), length * _size(angular[0][0]), least)
    if scale > 0:
        turned = _apart(angular[0][0], angular[1][0], scale / length)
        yield "initial acceleration", _apart(linear[0][0], linear[1][0], scale), SAME_CHANGE
        yield "initial angular acceleration", turned, SAME_CHANGE


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
    return float(kinetic_energy(scene, *at, *rates)[0] + potential_energy(scene, *at)[0])


def _energy_unit(scene: Scene) -> float:
    """Return an energy (J) of the scene's size: all masses at a speed of one length per duration, or lifted
    by the length."""
    mass, length = sum(body.mass or 0.0 for body in scene.body), scene_length(scene)
    return mass * max((length / scene.duration) ** 2, math.hypot(*scene.gravity) * length)
