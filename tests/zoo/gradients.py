"""Engines whose derivatives of accelerations have one fault, in the twists of the bodies as coordinates.

The acceleration and the multipliers solve M a + Jᵀ λ = f and J a + J̇ v + 2 β J v + β² Φ = 0; derivatives
solve the same matrix, with the changes of all terms at constant a and λ on the right.
"""

from collections.abc import Sequence

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
from mbref.scene import JOINT_TYPES, Scene

STEP = 2e-3  # m, rad, m/s or rad/s, of differences of the terms
BETA = 10.0  # 1/s
FORCES, RATES, STABILISATION = "constraint forces", "velocity terms", "stabilisation"
OTHERS = "inertia and forces"
TERMS = (FORCES, RATES, STABILISATION, OTHERS)
FAULTS = {  # factor on the change of a term, and on the columns of rotations
    "none": ({}, 1.0),
    "sign of the velocity terms": ({RATES: -1.0}, 1.0),
    "constant Jacobian in the constraint forces": ({FORCES: 0.0}, 1.0),
    "stabilisation left out": ({STABILISATION: 0.0}, 1.0),
    "quaternion for rotation vector": ({}, 0.5),
}


WAYS = {"own": "derivatives of each term"}


class Faulty(Differentiating, Engine):
    """An engine with correct accelerations and a fault of their derivatives."""

    package = ""
    supports = Supports(joints=tuple(JOINT_TYPES))
    differentiates_by = WAYS

    def __init__(self, fault: str):
        self.name, (self.factors, self.turning) = fault, FAULTS[fault]

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
        factors = np.array([self.factors.get(name, 1.0) for name in TERMS])

        def by(place: np.ndarray, rate: np.ndarray) -> np.ndarray:
            """Return the change of the acceleration along a displacement and a rate."""
            along = STEP * np.array([place, rate])
            parts = derivative(lambda s: _residuals(scene, at + s[0], v + s[1], a, multipliers), along) / STEP
            return _solved(matrix, factors @ parts, none)[0]

        unit = np.eye(len(v))
        columns = np.array([by(e, none) for e in unit]).T
        columns[:, [k for k in range(len(v)) if k % 6 > 2]] *= self.turning
        return OwnDerivatives(
            coordinates=tuple(f"{body.name}[{k}]" for body in scene.body for k in range(6)),
            velocity=v,
            acceleration=a,
            by_position=columns,
            by_velocity=np.array([by(none, e) for e in unit]).T,
            by_force=np.array([_solved(matrix, 0 * sum(rest.values()), e)[0] for e in unit]).T,
            bodies=lambda step, rate, change: (rate, change),
            opening=lambda step, rate: jacobian(scene, 0.0, *_pose(scene, at + step))[0] @ rate,
            own=lambda step, rate, force: _accelerations(scene, at + step, rate, force),
        )


def _pose(scene: Scene, step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and quaternions, displaced by step (6 nb,) along twists."""
    position, orientation = initial_poses(scene)
    moves = step.reshape(-1, 6)
    return position + moves[:, :3], rotations.multiply(rotations.from_vector(moves[:, 3:]), orientation)


def _terms(scene: Scene, step: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return [M Jᵀ; J 0] and the terms of (-f, J̇ v + …) by name."""
    pose, twists = _pose(scene, step), v.reshape(-1, 6)
    rows, still = jacobian(scene, 0.0, *pose)[0], np.zeros((len(twists), 3))
    turn = rotations.to_matrix(pose[1])
    inertia = turn @ inertia_matrices(scene) @ np.swapaxes(turn, 1, 2)
    (m, n), spin = rows.shape, twists[:, 3:]
    matrix, force = np.zeros((n + m, n + m)), np.zeros((len(twists), 6))
    for b, body in enumerate(scene.body):
        matrix[6 * b : 6 * b + 3, 6 * b : 6 * b + 3] = body.mass * np.eye(3)
        matrix[6 * b + 3 : 6 * b + 6, 6 * b + 3 : 6 * b + 6] = inertia[b]
        force[b, :3] = body.mass * np.array(scene.gravity)
        force[b, 3:] = -np.cross(spin[b], inertia[b] @ spin[b])
    matrix[n:, :n], matrix[:n, n:] = rows, rows.T
    bias = closure_accelerations(scene, 0.0, *pose, twists[:, :3], spin, still, still)
    gaps = np.concatenate([*closure(scene, 0.0, *pose).values()])
    none, right = np.zeros(n), np.zeros(m)
    stabilised = 2 * BETA * rows @ v + BETA**2 * gaps
    return matrix, {
        RATES: np.concatenate([none, np.concatenate([*bias.values()])]),
        STABILISATION: np.concatenate([none, stabilised]),
        OTHERS: np.concatenate([-force.ravel(), right]),
    }


def _residuals(
    scene: Scene, step: np.ndarray, v: np.ndarray, a: np.ndarray, multipliers: np.ndarray
) -> np.ndarray:
    """Return the TERMS (4, n + m) of the residual of the equations; the last one has M a, f and J a."""
    matrix, rest = _terms(scene, step, v)
    n = len(a)
    pull = np.concatenate([matrix[:n, n:] @ multipliers, 0 * multipliers])
    return np.array([pull, rest[RATES], rest[STABILISATION], rest[OTHERS] + matrix[:, :n] @ a])


def _solved(matrix: np.ndarray, rest: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a and λ with [M Jᵀ; J 0] (a, λ) + rest = (force, 0)."""
    right = -rest
    right[: len(force)] += force
    found = np.linalg.solve(matrix, right)
    return found[: len(force)], found[len(force) :]


def _accelerations(scene: Scene, step: np.ndarray, v: np.ndarray, force: np.ndarray) -> np.ndarray:
    matrix, rest = _terms(scene, step, v)
    return _solved(matrix, sum(rest.values()), force)[0]


NONE, VELOCITY_SIGN, CONSTANT_JACOBIAN, UNSTABILISED, QUATERNION = (Faulty(fault) for fault in FAULTS)
