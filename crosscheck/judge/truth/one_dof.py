"""Motion of a mechanism with one degree of freedom: the poses along its path, and the path coordinate as a
function of time.

A family of mechanisms gives the path: every body's pose as a function of one coordinate q, with first and
second derivatives. All families have the motion along the path in common: either a driver prescribes q(t), or
q follows from the reduced equation of motion I(q) q'' + ½ I'(q) q'² = Q, whose terms are sums over the
bodies.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from crosscheck.judge import constraints
from crosscheck.judge.loads import Motion, world_inertia, wrenches
from crosscheck.judge.reference.start_velocities import given
from crosscheck.judge.reference.vectors import apply
from crosscheck.judge.time_functions import value
from crosscheck.judge.tolerances import FREEDOM, ON_PATH, PARALLEL, TRUTH_DRIVEN, TRUTH_DYNAMIC
from crosscheck.judge.truth.picard import REAL, NoSolution, Solution
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import Cylindrical, Driver, Revolute, Scene, TorsionSpring

EYE = np.eye(3)
TURNS = (Revolute, Cylindrical)  # joint types that can have a torsion spring
Pair = tuple[np.ndarray, np.ndarray]  # linear and angular rates, (k, nb, 3) each
TURN = 8 * np.arctan(REAL(1))
REPEATED = 64 * float(
    np.finfo(REAL).eps
)  # relative difference of poses and slopes that count as equal after a turn
# path coordinates (rad, or fractions of the scene's length) at which a path is checked
PROBES = (0.0, 0.31, -0.83)


@dataclass(frozen=True)
class Pose:
    """Poses of all bodies at coordinates q (k,): position, rotation matrix, turn, and derivatives by q.

    With primes for d/dq, the velocity at rate q' is ``dposition`` q', the angular velocity ``spin`` q';
    (k, nb, 3), rotation (k, nb, 3, 3), turn (k, nb) as in Motion.
    """

    position: np.ndarray
    rotation: np.ndarray
    turn: np.ndarray
    dposition: np.ndarray
    ddposition: np.ndarray
    spin: np.ndarray
    dspin: np.ndarray


# sign with which a driver changes q; None for a driver of another kind
DrivenSign = Callable[[Driver], float | None]


@dataclass(frozen=True)
class Path:
    """A possible path of a scene: poses at q (q = 0 at t = 0), the rotation axis of the turns, and the sign
    with which a driver of a joint changes q.

    The sign is None for a driver that does not move the mechanism along the path.
    """

    family: str
    poses: Callable[[np.ndarray], Pose]
    axis: np.ndarray
    driven_sign: DrivenSign


class OneDof:
    """Truth of a scene that moves along a path; ``rate`` is q' at t = 0, None if q is driven."""

    def __init__(self, scene: Scene, path: Path, rate: float | None):
        self.name = path.family
        self.accuracy = TRUTH_DRIVEN if scene.driver else TRUTH_DYNAMIC
        self._scene, self._path = scene, path
        self._reduced = None if rate is None else Reduced(scene, path, rate)

    def poses(self, times: np.ndarray) -> Trajectory:
        """Return the trajectory at times (k,) ≥ 0; raises NoSolution if the motion ends at a singular
        position before."""
        times = np.asarray(times, dtype=float)
        q, dq, ddq = self._coordinate(times)
        pose = self._path.poses(q)
        dq, ddq = dq[:, None, None], ddq[:, None, None]
        return trajectory(
            self._scene,
            self.name,
            times,
            pose.position,
            pose.rotation,
            (pose.dposition * dq, pose.spin * dq),
            (pose.dposition * ddq + pose.ddposition * dq**2, pose.spin * ddq + pose.dspin * dq**2),
        )

    def coordinate(self, times: np.ndarray) -> np.ndarray:
        """Return the path coordinate and its rate (k, 2) at times (k,)."""
        return np.stack(self._coordinate(np.asarray(times, dtype=float))[:2], axis=-1).astype(float)

    def _coordinate(self, times: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return q, q', q'' (k,) at times (k,)."""
        if self._reduced is None:
            driver = self._scene.driver[0]
            sign = self._path.driven_sign(driver)
            return tuple(sign * value(driver, times, order) for order in (0, 1, 2))
        return self._reduced(times)


class Reduced:
    """Solution q(t) of the reduced equation of motion, integrated along σ with dt = sqrt(I) dσ.

    Then dq/dσ = s and ds/dσ = Q with s = sqrt(I) q': the inertia is eliminated, and the time follows from a
    quadrature. The motion is periodic if s is equal after a full turn of q.
    """

    def __init__(self, scene: Scene, path: Path, rate: float):
        self._scene, self._path = scene, path
        self._damped = any(getattr(load, "damping", 0.0) for load in scene.load)
        self._mass = np.array([body.mass for body in scene.body])[:, None]
        root, push, _ = self._terms(np.zeros(1, dtype=REAL), np.array([rate], dtype=REAL))
        pace = abs(rate) + np.sqrt(abs(push[0])) / root[0] + 1 / scene.duration
        start = np.array([0, root[0] * rate, 0], dtype=REAL)
        self._solution = Solution(self._derivative, start, 0.3 / (pace * root[0]))

    def __call__(self, times: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return q, q', q'' (k,) at times (k,) ≥ 0; raises NoSolution with the time at which the motion
        ends."""
        try:
            turns, rest = self._turns(np.asarray(times, dtype=REAL))
            q, s, _ = self._solution.where(2, rest).T
        except NoSolution as found:  # the error contains σ instead of the time
            end = float(self._solution.reach(lambda _: True)[2])
            raise NoSolution.ending(found.reason, end) from None
        root = self._terms(q, s)[0]
        rate = s / root
        _, push, half_slope = self._terms(q, rate)
        return q + TURN * turns, rate, (push - half_slope * rate**2) / root**2

    def _turns(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the number (k,) of full turns of q before times (k,), and the times since then, if the
        motion is periodic."""
        reached = self._solution.reach(lambda y: y[2] >= times.max(initial=0) or y[0] >= TURN)
        if reached[0] < TURN or not self._repeats():
            return np.zeros_like(times), times
        period = self._solution.where(0, np.array([TURN]))[0, 2]
        turns = np.floor(times / period)
        return turns, times - turns * period

    def _repeats(self) -> bool:
        """Return whether everything on which the motion depends is equal after one turn of q."""
        if self._damped or any(isinstance(load, TorsionSpring) for load in self._scene.load):
            return False
        before, after = (self._path.poses(np.array([q], dtype=REAL)) for q in (REAL(0), TURN))
        same = all(
            np.allclose(a, b, rtol=0, atol=REPEATED)
            for a, b in ((before.position, after.position), (before.rotation, after.rotation))
        )
        _, start, _ = self._solution(np.zeros(1))[0]
        _, end, _ = self._solution.where(0, np.array([TURN]))[0]
        return bool(same and abs(end - start) <= REPEATED * abs(start))

    def _derivative(self, y: np.ndarray) -> np.ndarray:
        q, s, _ = y.T
        root, push, _ = self._terms(q, s)
        if self._damped:
            push = self._terms(q, s / root)[1]
        return np.stack([s, push, root], axis=-1)

    def _terms(self, q: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return sqrt(I), Q and I'/2 (n,) at coordinates q and rates (n,)."""
        pose = self._path.poses(q)
        dq = rate[:, None, None]
        motion = Motion(pose.position, pose.rotation, pose.dposition * dq, pose.spin * dq, pose.turn)
        force, moment = wrenches(self._scene, motion, self._path.axis)
        inertias = world_inertia(self._scene, pose.rotation)
        momentum, momentum_rate = apply(inertias, pose.spin), apply(inertias, pose.dspin)
        mass = self._mass
        inertia = np.sum(mass * pose.dposition**2 + pose.spin * momentum, axis=(1, 2))
        half_slope = np.sum(mass * pose.dposition * pose.ddposition + pose.spin * momentum_rate, axis=(1, 2))
        push = np.sum(force * pose.dposition + moment * pose.spin, axis=(1, 2))
        return np.sqrt(inertia), push, half_slope


def one_dof(scene: Scene, path: Path | None) -> OneDof | None:
    """Return the truth along a path, or None if the scene can move in another way."""
    if path is None or not _fits(scene, path):
        return None
    if scene.driver:
        alone = len(scene.driver) == 1
        known = alone and path.driven_sign(scene.driver[0]) is not None
        return OneDof(scene, path, None) if known else None
    if not scene.has_mass() or not _torsion_angles_known(scene, path):
        return None
    rate = initial_rate(scene, path)
    return None if rate is None else OneDof(scene, path, rate)


def initial_rate(scene: Scene, path: Path) -> float | None:
    """Return q' at t = 0 from the scene's velocities; None if the velocities are not along the path."""
    velocity, spin = constraints.initial_twists(scene)
    pose = path.poses(np.zeros(1, dtype=REAL))
    length = constraints.scene_length(scene)
    along = np.concatenate([pose.dposition[0], length * pose.spin[0]])
    wanted = np.concatenate([velocity, length * spin])
    asked = given(scene)
    nearest = np.hstack(np.split(along, 2)).ravel()[asked.components]
    square = np.sum(nearest**2)
    rate = float(np.sum(nearest * asked.values * asked.weights) / square) if square else 0.0
    off = np.abs(wanted - rate * along.astype(float)).max()
    return rate if off <= ON_PATH * np.abs(wanted).max() else None


def trajectory(
    scene: Scene,
    family: str,
    times: np.ndarray,
    position: np.ndarray,
    rotation: np.ndarray,
    rates: Pair,
    accelerations: Pair,
) -> Trajectory:
    """Return a Trajectory of engine "truth" in double precision; rates and accelerations are pairs (k, nb,
    3)."""
    velocity, spin = (np.asarray(a, dtype=float) for a in rates)
    acceleration, spin_rate = (np.asarray(a, dtype=float) for a in accelerations)
    return Trajectory(
        scene=scene.name,
        engine="truth",
        version="",
        method=family,
        settings={},
        times=times,
        bodies=tuple(body.name for body in scene.body),
        position=np.asarray(position, dtype=float),
        orientation=rotations.from_matrix(rotation),
        velocity=velocity,
        angular_velocity=spin,
        acceleration=acceleration,
        angular_acceleration=spin_rate,
        t_end=float(times[-1]) if len(times) else 0.0,
    )


def _fits(scene: Scene, path: Path) -> bool:
    """Return whether the path satisfies every joint, and no other motion does."""
    undriven = scene.with_(driver=())
    length = constraints.scene_length(scene)
    with np.errstate(invalid="ignore"):
        pose = path.poses(np.array(PROBES))
    orientation = rotations.from_matrix(np.nan_to_num(pose.rotation))
    if not np.isfinite(pose.position).all() or not np.isfinite(pose.rotation).all():
        return False
    residuals = constraints.closure(undriven, np.zeros(len(PROBES)), pose.position, orientation)
    gap = max((np.abs(r).max(initial=0.0) for r in residuals.values()), default=0.0)
    freedoms = freedoms_at(undriven, pose.position[1].astype(float), orientation[1])
    return gap <= ON_PATH * max(length, 1.0) and freedoms == 1


def freedoms_at(scene: Scene, position: np.ndarray, orientation: np.ndarray) -> int:
    """Return the number of degrees of freedom of a scene without drivers at a pose (nb, 3), (nb, 4)."""
    rows, _ = constraints.jacobian(scene, 0.0, position, orientation)
    values = np.linalg.svd(rows, compute_uv=False)
    return 6 * len(scene.body) - int(np.sum(values > FREEDOM * values.max(initial=1.0)))


def _torsion_angles_known(scene: Scene, path: Path) -> bool:
    known = np.isfinite(path.poses(np.zeros(1)).turn[0].astype(float))
    for load in scene.load:
        if isinstance(load, TorsionSpring):
            joint = next(j for j in scene.joint if isinstance(j, TURNS) and j.name == load.joint)
            indices = [scene.body_index(name) for name in joint.bodies]
            aligned = abs(abs(np.dot(joint.axis, path.axis)) - np.linalg.norm(joint.axis)) < PARALLEL
            if not aligned or not all(known[i] for i in indices if i >= 0):
                return False
    return True


def turned(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return rotation matrices (k, 3, 3) by angles (k,) about a unit axis."""
    skew = np.cross(axis, EYE).T
    sine, versine = np.sin(angle)[:, None, None], (2 * np.sin(angle / 2) ** 2)[:, None, None]
    return EYE + sine * skew + versine * (skew @ skew)


def circle(axis: np.ndarray, angle: np.ndarray, arm: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return a vector (k, 3) that rotates about a unit axis, and its first and second derivative by the
    angle."""
    along = axis * (axis @ arm)
    radial, ahead = arm - along, np.cross(axis, arm)
    cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
    now = cosine * radial + sine * ahead
    return now + along, cosine * ahead - sine * radial, -now
