"""Crossing a singular position: Exudyn's states before it are extrapolated and projected onto the joints."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BarycentricInterpolator
from scipy.linalg import block_diag

from crosscheck.engines.exudyn.dynamic import Samples
from crosscheck.judge.constraints import closure, inertia_matrices, initial_poses, jacobian
from crosscheck.judge.tolerances import RANK
from mbref import rotations
from mbref.scene import Scene

CLOSED = 1e-15  # m and rad; residual at which a projection ends
ITERATIONS = 8  # Newton iterations at most; two are usual
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])  # Euler parameters of an unrotated node


def extrapolated_states(scene: Scene, nodes: Samples, times: np.ndarray) -> Samples:
    """Return samples at ``times`` (k,) after the nodes, extrapolated by one polynomial through all nodes.

    Coordinates and rates are then moved to the nearest values that satisfy the judge's joint equations.
    """
    known, values, forces = nodes
    unit = np.ptp(known)
    at, wanted = (known - known[-1]) / unit, (times - known[-1]) / unit
    weights = _weights(at)  # SciPy's own weights are rounded in a random order
    values = BarycentricInterpolator(at, values, axis=1, wi=weights)(wanted)
    forces = BarycentricInterpolator(at, forces, wi=weights)(wanted)
    for k, t in enumerate(times):
        values[:2, k] = projected(scene, float(t), *values[:2, k])
    return times, values, forces


def _weights(at: np.ndarray) -> np.ndarray:
    """Return the barycentric weights 1 / Π (tᵢ - tⱼ) of nodes (n,)."""
    apart = at[:, None] - at
    np.fill_diagonal(apart, 1.0)
    return 1 / np.prod(apart, axis=1)


def projected(
    scene: Scene, t: float, coordinates: np.ndarray, rates: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the nearest node coordinates and rates (nb, 7) that satisfy joints and drivers at time t (s)."""
    start, orientation = initial_poses(scene)
    position, turn = start + coordinates[:, :3], coordinates[:, 3:] + UPRIGHT
    turn = turn / np.linalg.norm(turn, axis=1, keepdims=True)
    for _ in range(ITERATIONS):
        pose = (position, rotations.multiply(turn, orientation))
        residual = np.concatenate(list(closure(scene, t, *pose).values()))
        if np.abs(residual).max(initial=0.0) < CLOSED:
            break
        rows = jacobian(scene, t, *pose)[0][: len(residual)]  # without couplings, which are the last rows
        moved = _least(scene, pose[1], rows, -residual)
        position = position + moved[:, :3]
        turn = rotations.multiply(rotations.from_vector(moved[:, 3:]), turn)
    spin = 2 * rotations.multiply(rates[:, 3:], rotations.conjugate(turn))[:, 1:]
    twist = np.hstack([rates[:, :3], spin])
    oriented = rotations.multiply(turn, orientation)
    rows, wanted = jacobian(scene, t, position, oriented)
    twist = twist + _least(scene, oriented, rows, wanted - rows @ twist.ravel())
    pure = np.hstack([np.zeros((len(twist), 1)), twist[:, 3:]])
    turning = rotations.multiply(pure, turn) / 2
    return np.hstack([position - start, turn - UPRIGHT]), np.hstack([twist[:, :3], turning])


def _least(scene: Scene, orientation: np.ndarray, rows: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return the change (nb, 6) of the bodies' twists of least kinetic energy for which the rows have the
    wanted values.

    With kinetic energy as metric, rounding errors of a light body do not move a heavy body.
    """
    root = np.zeros((len(scene.body), 6, 6))  # square root of M⁻¹, one block for each body
    masses = np.array([body.mass for body in scene.body], dtype=float)
    for k, (mass, inertia) in enumerate(zip(masses, inertia_matrices(scene), strict=True)):
        moments, principal = np.linalg.eigh(inertia)
        root[k, :3, :3] = np.eye(3) / np.sqrt(mass)
        root[k, 3:, 3:] = rotations.to_matrix(orientation[k]) @ principal / np.sqrt(moments)
    spread = block_diag(*root)
    return (spread @ np.linalg.lstsq(rows @ spread, wanted, rcond=RANK)[0]).reshape(-1, 6)
