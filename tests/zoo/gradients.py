"""Engines whose derivatives of accelerations have one fault, in the twists of the bodies as coordinates. The
acceleration and the multipliers solve M a + Jᵀ λ = f and J a + J̇ v + 2 β J v + β² Φ = 0; derivatives solve
the same matrix, with the changes of all terms at constant a and λ on the right. A fault changes terms,
columns, the rows that are solved, or the result."""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from crosscheck.derivatives.compare import derivative
from crosscheck.differentiating import Differentiating, OwnDerivatives
from crosscheck.engine import Engine, Setting, Supports
from crosscheck.judge.constraints import (
    closure,
    closure_accelerations,
    inertia_matrices,
    initial_poses,
    initial_twists,
    jacobian,
)
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import HOLONOMIC_JOINTS, Scene

STEP = 2e-3  # m, rad, m/s or rad/s, of differences of the terms
BETA = 10.0  # 1/s
FORCES, ROWS, RATES = "constraint forces", "rows", "velocity terms"
STABILISATION, INERTIA, GYROSCOPIC = "stabilisation", "inertia", "gyroscopic moments"
TERMS = (FORCES, ROWS, RATES, STABILISATION, INERTIA, GYROSCOPIC)


class Fault(NamedTuple):
    """Factors on the changes of terms, and on columns of rotations; whether multipliers are kept, whether
    forces act on free bodies, and whether the matrix by positions is transposed; the matrix that is NaN."""

    factors: Mapping[str, float] = {}
    turning: float = 1.0
    keeps_multipliers: bool = False
    frees_bodies: bool = False
    transposes: bool = False
    nan: str = ""


FAULTS = {
    "NONE": Fault(),
    "VELOCITY_SIGN": Fault({RATES: -1.0}),
    "NO_VELOCITY_TERMS": Fault({RATES: 0.0}),
    "HALF_VELOCITY_TERMS": Fault({RATES: 0.5}),  # J̇ v is quadratic in v, and is taken as linear
    "CONSTANT_JACOBIAN": Fault({FORCES: 0.0}),  # ∂(Jᵀ λ)/∂q is missing
    "FORCE_SIGN": Fault({FORCES: -1.0}),
    "CONSTANT_ROWS": Fault({ROWS: 0.0}),  # ∂(J a)/∂q is missing
    "CONSTANT_MULTIPLIERS": Fault(keeps_multipliers=True),
    "CONSTANT_INERTIA": Fault({INERTIA: 0.0}),  # inertia tensors do not turn with the bodies
    "NO_GYROSCOPIC": Fault({GYROSCOPIC: 0.0}),
    "UNSTABILISED": Fault({STABILISATION: 0.0}),
    "QUATERNION": Fault(turning=0.5),
    "FREE_BODIES": Fault(frees_bodies=True),
    "TRANSPOSED": Fault(transposes=True),
    "NAN": Fault(nan="by_velocity"),
    "NAN_BY_FORCE": Fault(nan="by_force"),
}


WAYS = {"own": "derivatives of each term"}


class Faulty(Differentiating, Engine):
    """An engine with correct accelerations and a fault of their derivatives."""

    package = ""
    supports = Supports(joints=tuple(HOLONOMIC_JOINTS), couplings=("angle", "displacement"), powers=2)
    differentiates_by = WAYS

    def __init__(self, fault: str):
        self.name, self.fault = fault, FAULTS[fault]

    def version(self) -> str:
        return "1.0"

    def settings(self, scene: Scene) -> Sequence[Setting]:
        return []

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        raise ValueError("no setting serves the scene")

    def own_derivatives(self, scene: Scene, function: str, away: np.ndarray | None = None) -> OwnDerivatives:
        v = np.hstack(initial_twists(scene)).ravel()
        none = 0 * v
        at = none if away is None else away
        matrix, rest = _terms(scene, at, v)
        a, multipliers = _solved(matrix, sum(rest.values()), none)
        fault = self.fault
        factors = np.array([fault.factors.get(name, 1.0) for name in TERMS])

        def by(place: np.ndarray, rate: np.ndarray) -> np.ndarray:
            """Return the change of the acceleration along a displacement and a rate."""
            along = STEP * np.array([place, rate])
            parts = derivative(lambda s: _residuals(scene, at + s[0], v + s[1], a, multipliers), along) / STEP
            if fault.keeps_multipliers:
                return np.linalg.solve(matrix[: len(v), : len(v)], -(factors @ parts)[: len(v)])
            return _solved(matrix, factors @ parts, none)[0]

        unit = np.eye(len(v))
        columns = np.array([by(e, none) for e in unit]).T
        columns[:, [k for k in range(len(v)) if k % 6 > 2]] *= fault.turning
        by_force = np.array([_solved(matrix, 0 * sum(rest.values()), e)[0] for e in unit]).T
        if fault.frees_bodies:
            by_force = np.linalg.inv(matrix[: len(v), : len(v)])
        found = OwnDerivatives(
            coordinates=tuple(f"{body.name}[{k}]" for body in scene.body for k in range(6)),
            velocity=v,
            acceleration=a,
            by_position=columns.T if fault.transposes else columns,
            by_velocity=np.array([by(none, e) for e in unit]).T,
            by_force=by_force,
            bodies=lambda step, rate, change: (rate, change),
            opening=lambda step, rate: jacobian(scene, 0.0, *_pose(scene, at + step))[0] @ rate,
            own=lambda step, rate, force: _accelerations(scene, at + step, rate, force),
        )
        return replace(found, **{fault.nan: np.nan * found.by_position}) if fault.nan else found


def _pose(scene: Scene, step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and quaternions, displaced by step (6 nb,) along twists."""
    position, orientation = initial_poses(scene)
    moves = step.reshape(-1, 6)
    return position + moves[:, :3], rotations.multiply(rotations.from_vector(moves[:, 3:]), orientation)


def _terms(scene: Scene, step: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return [M Jᵀ; J 0] and the terms of (-f, J̇ v + …) by name."""
    return _terms_at(scene, step.tobytes(), v.tobytes())


@functools.cache
def _terms_at(scene: Scene, place: bytes, rate: bytes) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    step, v = np.frombuffer(place), np.frombuffer(rate)
    pose, twists = _pose(scene, step), v.reshape(-1, 6)
    rows, still = jacobian(scene, 0.0, *pose)[0], np.zeros((len(twists), 3))
    turn = rotations.to_matrix(pose[1])
    inertia = turn @ inertia_matrices(scene) @ np.swapaxes(turn, 1, 2)
    (m, n), spin = rows.shape, twists[:, 3:]
    matrix, force, spun = np.zeros((n + m, n + m)), np.zeros((len(twists), 6)), np.zeros((len(twists), 6))
    for b, body in enumerate(scene.body):
        matrix[6 * b : 6 * b + 3, 6 * b : 6 * b + 3] = body.mass * np.eye(3)
        matrix[6 * b + 3 : 6 * b + 6, 6 * b + 3 : 6 * b + 6] = inertia[b]
        force[b, :3] = body.mass * np.array(scene.gravity)
        spun[b, 3:] = np.cross(spin[b], inertia[b] @ spin[b])
    matrix[n:, :n], matrix[:n, n:] = rows, rows.T
    bias = closure_accelerations(scene, 0.0, *pose, twists[:, :3], spin, still, still)
    gaps = np.zeros(m)  # couplings are not stabilised
    closed = np.concatenate([*closure(scene, 0.0, *pose).values()])
    gaps[: len(closed)] = closed
    none, right = np.zeros(n), np.zeros(m)
    stabilised = 2 * BETA * rows @ v + BETA**2 * gaps
    return matrix, {
        RATES: np.concatenate([none, np.concatenate([*bias.values()])]),
        STABILISATION: np.concatenate([none, stabilised]),
        GYROSCOPIC: np.concatenate([spun.ravel(), right]),
        INERTIA: np.concatenate([-force.ravel(), right]),
    }


def _residuals(
    scene: Scene, step: np.ndarray, v: np.ndarray, a: np.ndarray, multipliers: np.ndarray
) -> np.ndarray:
    """Return the TERMS (6, n + m) of the residual of the equations; inertia has M a and gravity."""
    matrix, rest = _terms(scene, step, v)
    n = len(a)
    found = {
        **rest,
        FORCES: np.concatenate([matrix[:n, n:] @ multipliers, 0 * multipliers]),
        ROWS: np.concatenate([0 * a, matrix[n:, :n] @ a]),
        INERTIA: rest[INERTIA] + np.concatenate([matrix[:n, :n] @ a, 0 * multipliers]),
    }
    return np.array([found[name] for name in TERMS])


def _solved(matrix: np.ndarray, rest: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a and λ with [M Jᵀ; J 0] (a, λ) + rest = (force, 0)."""
    right = -rest
    right[: len(force)] += force
    found = np.linalg.lstsq(matrix, right, rcond=1e-11)[0]  # rows may be redundant
    return found[: len(force)], found[len(force) :]


def _accelerations(scene: Scene, step: np.ndarray, v: np.ndarray, force: np.ndarray) -> np.ndarray:
    matrix, rest = _terms(scene, step, v)
    return _solved(matrix, sum(rest.values()), force)[0]


ENGINES = {name: Faulty(name) for name in FAULTS}
NONE, VELOCITY_SIGN, NAN = (ENGINES[name] for name in ("NONE", "VELOCITY_SIGN", "NAN"))
