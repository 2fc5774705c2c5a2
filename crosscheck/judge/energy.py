"""Energy balance of a trajectory: kinetic energy and the potentials of gravity and loads over its samples.

Every conservative load has a potential, so that energy minus work is one sum that stays constant.  A constant
moment has a potential if joints let its body turn only about a fixed direction parallel to the moment.
Otherwise its work is the integral of the power over the samples (cubic spline).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.interpolate import CubicSpline

from crosscheck.judge import constraints
from crosscheck.judge.joint_coordinates import COORDINATES, counted
from crosscheck.judge.loads import attachment, world_inertia
from crosscheck.judge.tolerances import AT_REST, PARALLEL
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import GROUND, Force, Joint, JointLoad, Moment, Scene, Spring

SHORTEST = 1e-100  # s; the energy of crossing a mechanism in less time may not be finite


def energy_series(scene: Scene, trajectory: Trajectory) -> np.ndarray | None:
    """Return the drift (k,) of energy minus work since t = 0, divided by the largest energy of the motion.

    None if a driver, a damper or a load over time does work, if the scene has no masses, if the samples are
    too far apart to count a body's turns, or if all energies are at rounding level. The drift is infinite if
    a state is not finite.
    """
    gain = energy_gain(scene, trajectory)
    return None if gain is None else np.abs(gain)


def energy_gain(scene: Scene, trajectory: Trajectory) -> np.ndarray | None:
    """Return `energy_series` (k,) with its sign: positive where the run has gained energy."""
    balance = energy_balance(scene, trajectory)
    if balance is None:
        return None
    gain, scale = balance
    return None if scale <= AT_REST * _possible(scene, trajectory) else gain / scale


def energy_drift(scene: Scene, trajectory: Trajectory) -> np.ndarray | None:
    """Return the drift (k,) of energy minus work since t = 0 in J.

    The result is None or infinite as in `energy_series`, but a number if all energies are at rounding level.
    """
    balance = energy_balance(scene, trajectory)
    return None if balance is None else np.abs(balance[0])


def energy_balance(scene: Scene, trajectory: Trajectory) -> tuple[np.ndarray, float] | None:
    """Return the gain (k,) in J, and the largest energy of the motion (J); None if there is no energy
    balance."""
    works = any(load.is_damped or load.over_time for load in scene.load)
    if scene.driver or works or not scene.has_mass() or not len(trajectory.times):
        return None
    if not all(np.isfinite(array).all() for array in _motion(trajectory)):
        return np.full(len(trajectory.times), np.inf), float(np.finfo(float).max)
    kinetic = kinetic_energy(scene, *_motion(trajectory))
    start = kinetic_energy(scene, *(a[None] for a in _initial(scene)))[0]
    gains = np.array([kinetic - start, *_potential_gains(scene, trajectory)])
    scale = max(start, kinetic.max(), np.abs(gains).max())
    return None if np.isnan(gains).any() else (gains.sum(axis=0), float(scale))


def _possible(scene: Scene, trajectory: Trajectory) -> float:
    """Return the energy (J) that weight and loads have over the scene's length, plus the kinetic energy of
    crossing it in the motion's time.

    It is the scale for rounding errors of positions and velocities.
    """
    length, mass = constraints.scene_length(scene), sum(body.mass or 0.0 for body in scene.body)
    time = max(SHORTEST, float(trajectory.times[-1]) or scene.duration)
    forces = mass * float(np.linalg.norm(scene.gravity))
    forces += sum(float(np.linalg.norm(load.force)) for load in scene.load if isinstance(load, Force))
    return length * forces + mass * (length / time) ** 2 / 2


def kinetic_energy(
    scene: Scene,
    position: np.ndarray,
    orientation: np.ndarray,
    velocity: np.ndarray,
    angular_velocity: np.ndarray,
) -> np.ndarray:
    """Return the kinetic energy (k,) of bodies and armatures, J, from trajectory arrays (k, nb, ·)."""
    mass = np.array([body.mass for body in scene.body])
    inertia = world_inertia(scene, rotations.to_matrix(orientation))
    turning = np.einsum("kbi,kbij,kbj->k", angular_velocity, inertia, angular_velocity)
    rates = constraints.joint_rates(scene, position, orientation, velocity, angular_velocity)
    total = np.sum(mass[:, None] * velocity**2, axis=(1, 2)) + turning
    for joint in scene.joint:
        if joint.reflected_inertia:
            column = COORDINATES.index(joint.facts.driven)
            total = total + joint.reflected_inertia * rates[joint.name][:, column] ** 2
    return np.asarray(total / 2)


def potential_energy(scene: Scene, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
    """Return the potential energy (k,) in J of gravity (zero at the origin) and springs, at poses (k, nb,
    ·)."""
    mass = np.array([body.mass for body in scene.body])
    energy = -(position @ np.array(scene.gravity)) @ mass
    for load in scene.load:
        if isinstance(load, Spring):
            ends = zip(load.bodies, load.points, strict=True)
            first, second = (_point(scene, *end, position, orientation) for end in ends)
            stretch = np.linalg.norm(second - first, axis=-1) - load.natural_length
            energy = energy + load.stiffness * stretch**2 / 2
    return energy


def _motion(trajectory: Trajectory) -> tuple[np.ndarray, ...]:
    return trajectory.position, trajectory.orientation, trajectory.velocity, trajectory.angular_velocity


def _initial(scene: Scene) -> tuple[np.ndarray, ...]:
    return (*constraints.initial_poses(scene), *constraints.initial_twists(scene))


def _potential_gains(scene: Scene, trajectory: Trajectory) -> Iterator[np.ndarray]:
    """Return the increase (k,) of each potential since t = 0."""
    position, orientation, _, angular_velocity = _motion(trajectory)
    start = (a[None] for a in constraints.initial_poses(scene))
    yield potential_energy(scene, position, orientation) - potential_energy(scene, *start)
    angles = constraints.joint_coordinates(
        scene, trajectory.times, position, orientation, angular_velocity, trajectory.angles
    )
    for load in scene.load:
        if isinstance(load, Force):
            moved = _point(scene, load.body, load.point, position, orientation) - np.array(load.point)
            yield -moved @ np.array(load.force)
        elif isinstance(load, JointLoad):
            moved, action = angles[load.joint][:, COORDINATES.index(load.coordinate)], load.action
            stretch = (moved - action.natural) ** 2 - action.natural**2
            yield action.stiffness * stretch / 2 - action.amount * moved
        elif isinstance(load, Moment):
            yield -_work_of_moment(scene, load, trajectory)


def _point(
    scene: Scene, name: str, point: Sequence[float], position: np.ndarray, orientation: np.ndarray
) -> np.ndarray:
    body, local = attachment(scene, name, point)
    fixed = np.broadcast_to(local, position[:, 0].shape)
    return fixed if body < 0 else position[:, body] + rotations.rotate(orientation[:, body], local)


def _work_of_moment(scene: Scene, load: Moment, trajectory: Trajectory) -> np.ndarray:
    moment, body = np.array(load.moment), scene.body_index(load.body)
    size = np.linalg.norm(moment)
    if size == 0:
        return np.zeros(len(trajectory.times))
    angular_velocity = trajectory.angular_velocity[:, body]
    if load.body in _turning_about(scene, moment / size):
        turn = rotations.multiply(
            trajectory.orientation[:, body], rotations.conjugate(np.array(scene.body[body].orientation))
        )
        twist = 2 * np.arctan2(turn[:, 1:] @ moment / size, turn[:, 0])
        return size * counted(trajectory.times, twist, angular_velocity @ moment / size)
    start = constraints.initial_twists(scene)[1][body]
    later = trajectory.times > 0
    times = np.concatenate([[0.0], trajectory.times[later]])
    power = np.concatenate([start[None], angular_velocity[later]]) @ moment
    return CubicSpline(times, power).antiderivative()(trajectory.times) if len(times) > 1 else 0 * power


def _turning_about(scene: Scene, direction: np.ndarray) -> set[str]:
    """Return the bodies whose joints to the ground allow rotation only about the given direction."""
    reached, grew = {GROUND}, True
    while grew:
        links = [set(joint.bodies) for joint in scene.joint if _keeps(joint, direction)]
        new = {name for pair in links if pair & reached for name in pair} - reached
        reached |= new
        grew = bool(new)
    return reached


def _keeps(joint: Joint, direction: np.ndarray) -> bool:
    """Return whether a joint allows relative rotation only about a direction (3,), a unit vector."""
    if not joint.facts.free_rotations:
        return True
    if joint.facts.free_rotations > 1:
        return False
    axis = np.array(joint.directions[0])
    return bool(np.linalg.norm(np.cross(axis, direction)) <= PARALLEL * np.linalg.norm(axis))
