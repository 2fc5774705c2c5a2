"""Forces and torques of drivers from reactions of joints: inverse dynamics of driven and coupled coordinates.

Along a joint coordinate q, the reaction on the second body is R = Σ driver + Σ coupling - I q'', with the
armature I. A driver gives its force or torque to one coordinate; a coupling q₂ - f(q₁) = 0 gives μ to q₂
and -f'(q₁) μ to q₁, so that its power is zero.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mbref import rotations
from mbref.equations.couplings import largest_factor
from mbref.motions.joint_motion import (
    acceleration_of,
    along,
    angular_acceleration_of,
    angular_velocity_of,
    joint_motion,
    position_of,
    turned_since_start,
    velocity_of,
)
from mbref.motions.pieces import is_intermittent, parts_of
from mbref.motions.trajectory import Trajectory
from mbref.scene import Coupling, Joint, Scene
from mbref.scene.joints import ANGLE, Coordinate

# singular value / largest one below which drivers replace each other; ratios of couplings are scaled to 1
REPLACEABLE = 1e-12


def driving_forces(scene: Scene, motion: Trajectory) -> dict[str, np.ndarray]:
    """Return force (N) or torque (N m) (k,) of the driver of each driven joint, on the joint's second body.

    Drivers that can replace each other share the load with the least sum of squares. The result is empty if
    the motion lacks a reaction or an acceleration that it needs.
    """
    if is_intermittent(scene):
        parts = [driving_forces(*part) for part in parts_of(scene, motion) if part[1].times.size]
        names = [driver.joint for driver in scene.driver]  # without contacts at end stops
        known = names if parts and all(parts) else ()
        return {name: np.concatenate([part[name] for part in parts]) for name in known}
    driven = [scene.joint_named(driver.joint) for driver in scene.driver if not driver.turn]
    unknown: list[dict[Any, Any]] = [{(joint.name, joint.facts.driven): 1.0} for joint in driven]
    unknown += [_slopes(scene, motion, coupling) for coupling in scene.coupling]
    coordinates = list(dict.fromkeys(coordinate for shares in unknown for coordinate in shares))
    found = [_demanded(scene, motion, scene.joint_named(name), kind or ANGLE) for name, kind in coordinates]
    if any(each is None for each in found) or not driven:
        return {}
    each = np.ones(len(motion.times) if any(coupling.powers > 1 for coupling in scene.coupling) else 1)
    rows = [[shares.get(coordinate, 0.0) * each for shares in unknown] for coordinate in coordinates]
    shares_of = np.linalg.pinv(np.moveaxis(np.array(rows), 2, 0), rcond=REPLACEABLE)
    forces = np.moveaxis(shares_of @ np.array(found).T[:, :, None], 0, 1)[..., 0]
    return {joint.name: size for joint, size in zip(driven, forces, strict=False)}


def driving_moment(motion: Trajectory, name: str) -> np.ndarray | None:
    """Return the moment (k, 3), N m, world axes, of the driver of a ball joint's orientation on the second
    body: the joint's own reaction has no moment. None without reactions."""
    wrench = (motion.reactions or {}).get(name)
    return None if wrench is None else wrench[:, 3:]


def _slopes(scene: Scene, motion: Trajectory, coupling: Coupling) -> dict[Any, Any]:
    """Return by joint and coordinate the derivative of a coupling's row, a number or (k,), over its largest
    factor."""
    found, size = {}, largest_factor(coupling)
    for (joint, kind), law in zip(scene.coupled(coupling), coupling.laws, strict=True):
        slope = np.polynomial.Polynomial([0.0, *law]).deriv()
        bent = len(law) > 1
        at = along(joint_motion(scene, motion, joint.name), kind)[0] if bent else 0.0
        found[joint.name, kind] = slope(at) / size
    return found


def _demanded(scene: Scene, motion: Trajectory, joint: Joint, coordinate: Coordinate) -> np.ndarray | None:
    """Return R + I q'' (k,) of a joint coordinate, N or N m; None without reaction or accelerations."""
    wrench = (motion.reactions or {}).get(joint.name)
    if wrench is None:
        return None
    part = wrench[:, 3:] if coordinate == ANGLE else wrench[:, :3]
    size = _dot(part, _axis(scene, motion, joint))
    if not joint.reflected_inertia or coordinate != joint.facts.driven:
        return size
    if motion.acceleration is None or motion.angular_acceleration is None:
        return None
    second = coordinate_acceleration(scene, motion, joint, coordinate)
    return np.asarray(size + joint.reflected_inertia * second)


def coordinate_acceleration(
    scene: Scene, motion: Trajectory, joint: Joint, coordinate: Coordinate
) -> np.ndarray:
    """Return the second derivative (k,) of an angle, (ω₂ - ω₁)·a, or of a displacement, (r₂ - r₁)·a, with the
    axis a on the first body."""
    spins = [angular_velocity_of(scene, motion, name) for name in joint.bodies]
    spin_rates = [angular_acceleration_of(scene, motion, name) for name in joint.bodies]
    axis = _axis(scene, motion, joint)
    axis_rate = rotations.cross(spins[0], axis)
    if coordinate == ANGLE:
        return _dot(spin_rates[1] - spin_rates[0], axis) + _dot(spins[1] - spins[0], axis_rate)
    ends = list(zip(joint.bodies, joint.anchor_pair, strict=True))
    apart, rate, second = (
        of(scene, motion, *ends[1]) - of(scene, motion, *ends[0])
        for of in (position_of, velocity_of, acceleration_of)
    )
    axis_second = rotations.cross(spin_rates[0], axis) + rotations.cross(spins[0], axis_rate)
    return _dot(second, axis) + 2 * _dot(rate, axis_rate) + _dot(apart, axis_second)


def _axis(scene: Scene, motion: Trajectory, joint: Joint) -> np.ndarray:
    """Return the joint's axis (k, 3), a unit vector that the first body carries, in the world."""
    first = turned_since_start(scene, motion, joint.bodies[0])
    return rotations.rotate(first, rotations.unit(joint.directions[0])[None])


def _dot(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.asarray(np.einsum("ki,ki->k", one, other))
