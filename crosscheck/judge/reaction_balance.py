"""Joint reactions of the exact motion and of a run: tests that reactions cause the accelerations, and do no
work."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crosscheck.judge.constraints import jacobian, joint_coordinates, scene_length
from crosscheck.judge.coupling_laws import unwound
from crosscheck.judge.deadline import ask
from crosscheck.judge.joint_coordinates import reflected
from crosscheck.judge.joint_loads import applied, turning_loads
from crosscheck.judge.joint_reactions import (
    LEAST,
    along_coordinate,
    of_multipliers,
    on_second,
    resultants,
    unit_rows,
)
from crosscheck.judge.loads import world_inertia
from crosscheck.judge.tolerances import RANK
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

ABSURD = 10.0  # multiple of the largest exact force above which a reaction is implausible


def with_exact_reactions(scene: Scene, exact: Trajectory) -> Trajectory:
    """Return the exact motion with the reactions that cause it (least squares of the joints' rows). Their
    unique components are exact, and undetermined components have the least norm for unit rows. They are NaN
    where full turns on which a coupling depends cannot be counted.

    Raises ValueError if the motion has no accelerations.
    """
    found = {joint.name: np.zeros((len(exact.times), 6)) for joint in scene.joint}
    wanted = demanded(scene, exact)
    for k, own in enumerate(unwound(scene, exact)):
        position, orientation = exact.position[k], exact.orientation[k]
        rows, _ = jacobian(own, exact.times[k], position, orientation)
        if np.isnan(rows).any():
            for wrenches in found.values():
                wrenches[k] = np.nan
            continue
        scaled, units, sizes = unit_rows(scene, rows)
        turned, strengths = forces_of_armatures(scene, exact, k)
        pushed = units * (wanted[k].ravel() - turned.T @ strengths)
        pushes = np.linalg.lstsq(scaled.T, pushed, rcond=RANK)[0] / sizes
        for joint, wrenches in of_multipliers(own, rows, position, orientation):
            found[joint.name][k] = wrenches @ pushes
        geared = [joint for joint in scene.joint if joint.reflected_inertia]
        for joint, row, strength in zip(geared, turned, strengths, strict=True):
            found[joint.name][k] += strength * on_second(scene, joint, row[None], position, orientation)[:, 0]
    return replace(exact, reactions=found)


def forces_of_armatures(scene: Scene, exact: Trajectory, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows (c, 6 nb) of coordinates q with an armature I at a sample, and their forces -I q''
    (c,)."""
    assert exact.acceleration is not None
    assert exact.angular_acceleration is not None
    state = exact.position[k], exact.orientation[k], exact.velocity[k], exact.angular_velocity[k]
    found = reflected(scene, *state)
    twist_rates = np.hstack([exact.acceleration[k], exact.angular_acceleration[k]]).ravel()
    return found.jacobian, -found.inertia * (found.jacobian @ twist_rates + found.drift)


def absurd(scene: Scene, run: Trajectory, exact: Trajectory) -> list[str]:
    """Return sentences on reactions of a run that exceed ABSURD times the largest exact force.

    Moments are divided by the scene's length; ``exact`` has reactions.
    """
    units = np.repeat([1.0, scene_length(scene)], 3)
    sizes = {
        name: float(np.linalg.norm(w / units, axis=-1).max(initial=0.0))
        for name, w in (run.reactions or {}).items()
    }
    true = [
        float(np.linalg.norm(w / units, axis=-1).max(initial=0.0)) for w in (exact.reactions or {}).values()
    ]
    largest = max(*true, 0.0)
    return [
        f"{run.engine} gives {size:.3g} N in {name}, where no force exceeds {largest:.3g} N"
        for name, size in sizes.items()
        if size > ABSURD * max(largest, LEAST * sum(body.mass or 0.0 for body in scene.body))
    ]


def balance(scene: Scene, run: Trajectory, exact: Trajectory) -> float:
    """Return the largest error of the force balance on a body, relative to the largest force.

    The joints' resultant is compared with mass times exact acceleration minus the loads. Moments are divided
    by the scene's length.
    """
    units = np.repeat([1.0, scene_length(scene)], 3)
    wanted = demanded(scene, exact) / units
    found = np.array([resultants(scene, run, k) for k in range(len(run.times))]) / units
    return float(np.abs(found - wanted).max() / _scale(scene, wanted))


def demanded(scene: Scene, exact: Trajectory) -> np.ndarray:
    """Return forces and moments about the centres of mass (k, nb, 6), world, that the joints must exert for
    the motion.

    Raises ValueError if the motion has no accelerations.
    """
    if exact.acceleration is None or exact.angular_acceleration is None:
        raise ValueError(f"{exact.engine} gives no accelerations of {scene.name}")
    pose = exact.times, exact.position, exact.orientation, exact.angular_velocity
    coordinates = joint_coordinates(scene, *pose, exact.angles)
    springs = [load.joint for load in turning_loads(scene)]
    mass = np.array([body.mass for body in scene.body])[:, None]
    found = []
    for k in range(len(exact.times)):
        ask()
        angles = np.array([coordinates[name][k, 0] for name in springs])
        state = exact.position[k], exact.orientation[k], exact.velocity[k], exact.angular_velocity[k], angles
        inertia = world_inertia(scene, rotations.to_matrix(exact.orientation[k]))
        turning = np.einsum("bij,bj->bi", inertia, exact.angular_acceleration[k])
        found.append(
            np.hstack([mass * exact.acceleration[k], turning]) - applied(scene, float(exact.times[k]), state)
        )
    return np.array(found)


def idle(scene: Scene, run: Trajectory, exact: Trajectory) -> float:
    """Return the largest component of a reaction along a motion that its joint and driver allow, relative to
    the largest force."""
    length = scene_length(scene)
    wanted = demanded(scene, exact) / np.repeat([1.0, length], 3)
    units = np.repeat([1.0, length], 3)
    worst = float(np.max([_idle_at(each, run, k, units) for k, each in enumerate(unwound(scene, run))]))
    return worst / _scale(scene, wanted)


def _idle_at(scene: Scene, run: Trajectory, k: int, units: np.ndarray) -> float:
    position, orientation = run.position[k], run.orientation[k]
    rows, _ = jacobian(scene, run.times[k], position, orientation)
    left = [np.zeros(6)]
    for joint, wrenches in of_multipliers(scene, rows, position, orientation):
        held = wrenches / units[:, None]
        if joint.reflected_inertia and joint.facts.driven:
            along = along_coordinate(scene, joint, joint.facts.driven, position, orientation)
            held = np.column_stack([held, along])  # a force or a moment alone
        assert run.reactions is not None
        wrench = run.reactions[joint.name][k] / units
        left.append(wrench - held @ np.linalg.lstsq(held, wrench, rcond=RANK)[0])
    return float(np.abs(left).max())


def _scale(scene: Scene, wanted: np.ndarray) -> float:
    weight = sum(body.mass or 0.0 for body in scene.body)
    return max(float(np.abs(wanted).max()), LEAST * weight)
