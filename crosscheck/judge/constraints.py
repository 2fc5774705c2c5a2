"""Joint equations of a scene, evaluated from poses: residuals at three levels, Jacobian, initial velocities.

The formulas (see joint_residuals.py) do not depend on mbref's formulas and use numpy only, so that a
trajectory is judged without the model that produced it.  Arrays may have any leading shape (…): one pose, or
the samples of a trajectory.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping

import numpy as np

from crosscheck.judge import joint_residuals
from crosscheck.judge.coupling_laws import Law, coupled_rows, law_value, slope_at
from crosscheck.judge.joint_coordinates import (
    coordinate_accelerations,
    coordinate_rates,
    coordinates,
    reflected,
)
from crosscheck.judge.joint_residuals import JointFrames, grounded, with_ground
from crosscheck.judge.tolerances import CONTRADICTED, CONTRADICTION, RANK
from mbref import rotations
from mbref.scene import Scene, SceneError
from mbref.scene.joints import DISPLACEMENT

Residuals = dict[str, np.ndarray]

KEPT = 64  # scenes whose initial velocities and length are kept: each run of a comparison asks for them
HELD = 1e-14  # residual / largest sum of terms; a smaller residual is rounding
MET = 1e-9  # distance / radius of gyration; bodies at a smaller distance have met up to errors of a motion
COINCIDENT = 1e-14  # distance / largest coordinate; points at a smaller distance differ by rounding


def closure(scene: Scene, t: np.ndarray | float, position: np.ndarray, orientation: np.ndarray) -> Residuals:
    """Return position residuals (…, rows) by joint name, m and rad, for positions (…, nb, 3) and unit
    quaternions (…, nb, 4) at times t (…). A driver's residual is the last one of its joint.

    Couplings are left out, since one pose does not determine the number of full turns (see
    ``coupling_gaps``)."""
    pose = with_ground(position, orientation)
    return {
        joint.name: joint_residuals.position_rows(joint, np.asarray(t, float), *pose)
        for joint in joint_residuals.joint_frames(scene)
    }


def closure_rates(
    scene: Scene,
    t: np.ndarray | float,
    position: np.ndarray,
    orientation: np.ndarray,
    velocity: np.ndarray,
    angular_velocity: np.ndarray,
) -> Residuals:
    """Return velocity residuals (…, rows), m/s and rad/s, for world velocities (…, nb, 3).

    The residuals are the forbidden components of the relative twist of the joint frames. If the pose
    satisfies the joints, the residuals are the time derivative of `closure`. Couplings follow the joints, by
    name.
    """
    motion = (*with_ground(position, orientation), grounded(velocity), grounded(angular_velocity))
    found = {
        joint.name: joint_residuals.velocity_rows(joint, np.asarray(t, float), *motion)
        for joint in joint_residuals.joint_frames(scene)
    }

    def rate(joint: JointFrames, law: Law, column: int) -> np.ndarray:
        return slope_at(joint, law, column, motion) * coordinate_rates(joint, *motion)[..., column]

    return found | coupled_rows(scene, rate)


def closure_accelerations(
    scene: Scene,
    t: np.ndarray | float,
    position: np.ndarray,
    orientation: np.ndarray,
    velocity: np.ndarray,
    angular_velocity: np.ndarray,
    acceleration: np.ndarray,
    angular_acceleration: np.ndarray,
) -> Residuals:
    """Return acceleration residuals (…, rows), m/s² and rad/s²: the time derivative of `closure_rates`."""
    rates = (velocity, angular_velocity, acceleration, angular_acceleration)
    motion = (*with_ground(position, orientation), *map(grounded, rates))
    found = {
        joint.name: joint_residuals.acceleration_rows(joint, np.asarray(t, float), *motion)
        for joint in joint_residuals.joint_frames(scene)
    }

    def second_rate(joint: JointFrames, law: Law, column: int) -> np.ndarray:
        second = coordinate_accelerations(joint, *motion)[..., column]
        rate = coordinate_rates(joint, *motion[:4])[..., column]
        bend = slope_at(joint, law, column, motion, 2) * rate**2
        return slope_at(joint, law, column, motion) * second + bend

    return found | coupled_rows(scene, second_rate)


def coupling_gaps(
    scene: Scene,
    times: np.ndarray,
    position: np.ndarray,
    orientation: np.ndarray,
    angular_velocity: np.ndarray,
    counts: Mapping[str, np.ndarray] | None = None,
) -> Residuals:
    """Return position residuals (k, 1) of couplings by name, the sum of their laws minus the offset in m or
    rad, with the arguments of ``joint_coordinates``.

    The residuals are NaN from the first sample on at which the samples are too far apart to count turns.
    """
    motion = (np.asarray(times, float), *with_ground(position, orientation), grounded(angular_velocity))

    def value(joint: JointFrames, law: Law, column: int) -> np.ndarray:
        return np.asarray(law_value(law, coordinates(joint, *motion, counts)[:, column]))

    found = coupled_rows(scene, value)
    return {c.name: found[c.name] - c.offset for c in scene.coupling}


def length_rows(scene: Scene) -> dict[str, np.ndarray]:
    """Return masks (rows,) of the residuals by name of joint or coupling: True for lengths (m), False for
    angles (rad)."""
    found = {joint.name: joint_residuals.are_lengths(joint) for joint in joint_residuals.joint_frames(scene)}
    ends = {coupling.name: scene.coupled(coupling)[-1][1] for coupling in scene.coupling}
    return found | {name: np.array([coordinate == DISPLACEMENT]) for name, coordinate in ends.items()}


def joint_coordinates(
    scene: Scene,
    times: np.ndarray,
    position: np.ndarray,
    orientation: np.ndarray,
    angular_velocity: np.ndarray,
    counts: Mapping[str, np.ndarray] | None = None,
) -> dict[str, np.ndarray]:
    """Return angle (rad) and displacement (m) since t = 0 (k, 2) of every joint with a coordinate, by name.

    Arguments are trajectory arrays (k, nb, ·), and the angles (k,) by joint of an engine that counts full
    turns. Without these, the angle is NaN from the first sample on at which the samples are too far apart to
    count turns.
    """
    motion = (np.asarray(times, float), *with_ground(position, orientation), grounded(angular_velocity))
    with_axis = [joint for joint in joint_residuals.joint_frames(scene) if joint.facts.coordinates]
    if not len(motion[0]):
        return {joint.name: np.zeros((0, 2)) for joint in with_axis}
    return {joint.name: coordinates(joint, *motion, counts) for joint in with_axis}


def joint_rates(
    scene: Scene,
    position: np.ndarray,
    orientation: np.ndarray,
    velocity: np.ndarray,
    angular_velocity: np.ndarray,
) -> dict[str, np.ndarray]:
    """Return rates of angle (rad/s) and displacement (m/s) (…, 2) of every joint with a coordinate, by
    name."""
    motion = (*with_ground(position, orientation), grounded(velocity), grounded(angular_velocity))
    joints = [joint for joint in joint_residuals.joint_frames(scene) if joint.facts.coordinates]
    return {joint.name: coordinate_rates(joint, *motion) for joint in joints}


def jacobian(
    scene: Scene, t: float, position: np.ndarray, orientation: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return (J, b) of the velocity equations J x = b: J (rows, 6 nb), b (rows,), first the rows of the
    joints in their order, then the rows of the couplings.

    x holds (velocity of the centre of mass, angular velocity), world, body after body; `position` (nb, 3)
    and `orientation` (nb, 4) are one pose.
    """
    n = 6 * len(scene.body)
    twists = np.vstack([np.zeros(n), np.eye(n)]).reshape(n + 1, -1, 6)
    rates = closure_rates(scene, t, position, orientation, twists[..., :3], twists[..., 3:])
    rows = np.concatenate([np.zeros((n + 1, 0)), *rates.values()], axis=1)
    return (rows[1:] - rows[0]).T, -rows[0]


def initial_poses(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Return the positions (nb, 3) and orientations (nb, 4) of the scene at t = 0."""
    return np.array([b.position for b in scene.body]), np.array([b.orientation for b in scene.body])


def initial_twists(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Return velocities and angular velocities (nb, 3), world, at t = 0 that satisfy joints and drivers.

    The result is nearest to the given velocities in the sense of least squares, with angular velocities
    multiplied by the scene's length. Velocities that are still free have the least mass-weighted norm (unit
    masses if the scene has none).  Raises SceneError naming the joint when given velocities contradict the
    joints by more than 5 % of the velocities' scale, or drivers by more than 0.1 %.
    """
    velocity, angular_velocity = _initial_twists(scene)
    return velocity.copy(), angular_velocity.copy()


@functools.lru_cache(maxsize=KEPT)
def _initial_twists(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    pose = initial_poses(scene)
    scale = np.tile(np.repeat([1.0, 1 / scene_length(scene)], 3), len(scene.body))
    given, wanted = _given(scene, scale)
    j, b = jacobian(scene, 0.0, *pose)
    j = j * scale
    if given.all() and _holds(j, wanted, b):
        velocity, angular_velocity = np.hsplit((wanted * scale).reshape(-1, 6), 2)
        return velocity, angular_velocity
    x, free = _solve(j, b)
    _refuse(scene, "drivers contradict it", j @ x - b, x, CONTRADICTED)
    step, still_free = _solve(free[given], wanted - x[given])
    x, free = x + free @ step, free @ still_free
    if np.abs(x[given] - wanted).max(initial=0.0) > CONTRADICTION * np.abs(wanted).max(initial=0.0):
        as_given = x.copy()
        as_given[given] = wanted
        _refuse(scene, "the given velocities contradict it", j @ as_given - b, as_given, CONTRADICTION)
    if free.size:
        weight = _root_of_mass(scene) * scale
        x = x - free @ np.linalg.lstsq(weight @ free, weight @ x, rcond=None)[0]
    twists = (x * scale).reshape(-1, 6)
    return twists[:, :3], twists[:, 3:]


@functools.lru_cache(maxsize=KEPT)
def scene_length(scene: Scene) -> float:
    """Return the characteristic length (m): the largest distance between two joint anchors or centres of mass
    at t = 0.

    If all these points coincide up to the rounding of a motion, the length is the distance that a free body
    travels or a radius of gyration, whichever is larger, and 1 if both vanish.
    """
    points = [body.position for body in scene.body]
    for joint in scene.joint:
        points += joint.anchor_pair
    array = np.array(points)
    length = float(np.linalg.norm(array[:, None] - array[None], axis=-1).max())
    rounding = max(COINCIDENT * np.abs(array).max(), MET * _radius_of_gyration(scene))
    return length if length > rounding else _of_one_point(scene) or 1.0


def _of_one_point(scene: Scene) -> float:
    """Return the largest distance (m) that a body without joints travels, or its radius of gyration if that
    is larger."""
    speeds = [np.linalg.norm(body.velocity or 0.0) for body in scene.body]
    way = max(speeds) * scene.duration + np.linalg.norm(scene.gravity) * scene.duration**2 / 2
    return max(float(way), _radius_of_gyration(scene))


def _radius_of_gyration(scene: Scene) -> float:
    """Return the largest radius of gyration (m) of the bodies; 0 without masses."""
    if not scene.has_mass():
        return 0.0
    masses = np.array([body.mass for body in scene.body], dtype=float)
    largest = np.linalg.eigvalsh(inertia_matrices(scene))[:, -1]
    return float(np.sqrt(largest[masses > 0] / masses[masses > 0]).max(initial=0.0))


def inertia_matrices(scene: Scene) -> np.ndarray:
    """Return the inertia matrices (nb, 3, 3) about the centres of mass along the body axes, kg m²; the scene
    must have masses."""
    given = [np.array(body.inertia) for body in scene.body]
    return np.array([np.diag(i) if i.ndim == 1 else i for i in given])


def _given(scene: Scene, scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the mask (6 nb,) of the given velocity components, and their values divided by `scale`."""
    rows = [(*(b.velocity or (np.nan,) * 3), *(b.angular_velocity or (np.nan,) * 3)) for b in scene.body]
    values = np.array(rows, dtype=float).ravel()
    given = ~np.isnan(values)
    return given, values[given] / scale[given]


def _holds(j: np.ndarray, x: np.ndarray, b: np.ndarray) -> bool:
    """Return whether complete velocities x satisfy J x = b to rounding, so that they need no correction."""
    left = np.abs(j @ x - b)
    sizes = np.abs(j) @ np.abs(x) + np.abs(b)
    return bool((left <= HELD * sizes.max(initial=0.0)).all())


def _solve(matrix: np.ndarray, rhs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the least-squares solution of least norm, and a basis (n, k) of the null space."""
    u, s, vt = np.linalg.svd(matrix, full_matrices=True)
    rank = int(np.sum(s > RANK * s.max(initial=0.0)))
    return vt[:rank].T @ ((u[:, :rank].T @ rhs) / s[:rank]), vt[rank:].T


def _refuse(scene: Scene, why: str, residual: np.ndarray, x: np.ndarray, most: float) -> None:
    """Raise SceneError for the joint with the largest residual if the residual exceeds the fraction ``most``
    of the velocities."""
    names = [name for name, rows in length_rows(scene).items() for _ in rows]
    scale = np.abs(x).max(initial=0.0)
    if names and np.abs(residual).max() > most * scale:
        name = names[int(np.abs(residual).argmax())]
        size = np.abs(residual).max()
        raise SceneError(
            [f"{_place(scene, name)} {name!r}: {why}: off by {size:.3g} of {scale:.3g} m/s or rad/s"]
        )


def _place(scene: Scene, name: str) -> str:
    """Return the path of a joint or a coupling in the scene."""
    for key, entries in (("joint", scene.joint), ("coupling", scene.coupling)):
        names = [entry.name for entry in entries]
        if name in names:
            return f"{key}[{names.index(name)}]"
    raise KeyError(name)


def _root_of_mass(scene: Scene) -> np.ndarray:
    """Return W (·, 6 nb) with WᵀW the mass matrix of the twists at t = 0; the identity without masses."""
    n = 6 * len(scene.body)
    root = np.eye(n)
    if scene.has_mass():
        axes = rotations.to_matrix(initial_poses(scene)[1])
        for k, (body, inertia) in enumerate(zip(scene.body, inertia_matrices(scene), strict=True)):
            moments, principal = np.linalg.eigh(inertia)
            half = np.sqrt(np.maximum(moments, 0.0))[:, None] * (axes[k] @ principal).T
            root[6 * k : 6 * k + 3, 6 * k : 6 * k + 3] *= np.sqrt(body.mass or 1.0)
            root[6 * k + 3 : 6 * k + 6, 6 * k + 3 : 6 * k + 6] = half
        still = np.zeros((len(scene.body), 3))
        armatures = reflected(scene, *initial_poses(scene), still, still)
        root = np.vstack([root, np.sqrt(armatures.inertia)[:, None] * armatures.jacobian])
    return root
