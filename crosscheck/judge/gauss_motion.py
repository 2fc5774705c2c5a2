"""Motion of any scene by Gauss's principle with the judge's own equations, integrated at 1e-10 by SciPy.

The conformance suite uses it as the exact motion of scenes without a truth. The error of this motion follows
from the difference of integrations at two tolerances, and from the joint residuals. The rank of the joints'
rows is the rank at the start, because rows that are redundant at the start stay redundant.
"""

from __future__ import annotations

import functools

import numpy as np
from scipy.integrate import solve_ivp

from crosscheck.judge.constraints import (
    closure_accelerations,
    inertia_matrices,
    initial_twists,
    jacobian,
)
from crosscheck.judge.deadline import ask
from crosscheck.judge.energy import kinetic_energy
from crosscheck.judge.gauss_principle import rank as rank_at_start
from crosscheck.judge.joint_coordinates import reflected
from crosscheck.judge.joint_loads import State, applied, turning_loads
from crosscheck.judge.loads import mass_matrix, world_inertia
from crosscheck.judge.time_functions import next_end
from crosscheck.judge.tolerances import RANK
from mbref import rotations
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Scene

NAME = "Gauss's principle"
RTOL = 1e-10
WITHOUT_INERTIA = 1e-13  # fraction of the trace; a smaller least moment of inertia is rounding of zero


@functools.lru_cache(maxsize=128)
def gauss_motion(scene: Scene, times: tuple[float, ...], rtol: float = RTOL) -> Trajectory:
    """Return poses, velocities and accelerations at increasing times (s).

    Raises RuntimeError if the integration ends early, as at a singular position, and TimeIsUp after the
    limit of CPU time.
    """
    velocity, spin = initial_twists(scene)
    position = np.array([body.position for body in scene.body])
    orientation = np.array([body.orientation for body in scene.body])
    parts = (position, orientation, velocity, spin, np.zeros(len(turning_loads(scene))))
    start = np.concatenate([np.ravel(part) for part in parts])
    rank = rank_at_start(scene)
    if times[-1] == 0:
        samples = np.repeat(start[None], len(times), axis=0)
    else:
        samples = _samples(scene, np.array(times), start, rtol, rank)
    return _trajectory(scene, np.array(times), samples, rtol, rank)


def _samples(scene: Scene, times: np.ndarray, y: np.ndarray, rtol: float, rank: int) -> np.ndarray:
    """Return states (k, n) at times (k,), integrated from one end of a function's piece to the next.

    Raises RuntimeError if the integration ends before the last time.
    """
    t, found = 0.0, [y for _ in times[times == 0.0]]
    while t < times[-1]:
        end = min(next_end(scene, t), float(times[-1]))
        asked = times[(times > t) & (times <= end)]
        done = solve_ivp(
            _rates,
            (t, end),
            y,
            "DOP853",
            np.union1d(asked, [end]),
            rtol=rtol,
            atol=rtol,
            args=(scene, rank, t),
        )
        if not done.success:
            raise RuntimeError(f"{scene.name}: {done.message}")
        found += [*done.y.T[: len(asked)]]
        t, y = end, done.y[:, -1]
    return np.array(found)


def accelerations(
    scene: Scene, t: float, state: State, rank: int | None = None, since: float | None = None
) -> np.ndarray:
    """Return accelerations and angular accelerations (nb, 6), world, at a state.

    The state is position (nb, 3), unit orientation (nb, 4), velocity, spin (nb, 3), and angles of the loads
    about joints' axes. Among all accelerations that joints and drivers allow, the result is nearest to the
    unconstrained accelerations in the mass metric. ``rank`` is the rank of the rows if it is known; functions
    of time are of the piece that acts from ``since`` (s) on.
    """
    position, orientation, velocity, spin, _ = state
    force = applied(scene, t, state, since)
    is_singular = has_singular_mass(scene)
    if is_singular or any(joint.reflected_inertia for joint in scene.joint):
        return _with_coupled_masses(scene, t, state, force, rank, is_singular)
    roots = np.zeros((len(scene.body), 6, 6))  # W with WᵀW the mass matrix
    roots[:, :3, :3] = np.sqrt([body.mass or 0.0 for body in scene.body])[:, None, None] * np.eye(3)
    inertia = world_inertia(scene, rotations.to_matrix(orientation))
    roots[:, 3:, 3:] = np.swapaxes(np.linalg.cholesky(inertia), 1, 2)
    inverses = np.linalg.inv(roots)
    unbound = np.einsum("bji,bj->bi", inverses, force)
    rows, _ = jacobian(scene, t, position, orientation)
    by_body = rows.reshape(len(rows), len(position), 6)
    weighted = np.einsum("rbi,bij->rbj", by_body, inverses).reshape(rows.shape)
    still = np.zeros_like(position)
    bias = closure_accelerations(scene, t, position, orientation, velocity, spin, still, still)
    wanted = -np.concatenate([np.zeros(0), *bias.values()]) - weighted @ unbound.ravel()
    found = unbound.ravel() + (_least(weighted, wanted, rank) if len(rows) else 0.0)
    return np.einsum("bij,bj->bi", inverses, found.reshape(-1, 6))


@functools.lru_cache(maxsize=64)
def has_singular_mass(scene: Scene) -> bool:
    """Return whether a body lacks mass, or inertia about an axis, as points and thin rods do."""
    least = np.linalg.eigvalsh(inertia_matrices(scene))[:, 0]
    thin = least <= WITHOUT_INERTIA * np.trace(inertia_matrices(scene), axis1=1, axis2=2)
    return bool(thin.any()) or any(body.mass == 0 for body in scene.body)


def _with_coupled_masses(
    scene: Scene, t: float, state: State, force: np.ndarray, rank: int | None, is_singular: bool
) -> np.ndarray:
    """Return the ``accelerations`` of a scene whose armatures couple the bodies in the mass matrix, or whose
    mass matrix is singular because of massless links, points or thin rods."""
    position, orientation, velocity, spin, _ = state
    armatures = reflected(scene, position, orientation, velocity, spin)
    inertia = world_inertia(scene, rotations.to_matrix(orientation))
    mass = armatures.mass + mass_matrix(scene, inertia)
    rows, _ = jacobian(scene, t, position, orientation)
    still = np.zeros_like(position)
    bias = closure_accelerations(scene, t, position, orientation, velocity, spin, still, still)
    coasting, push = np.concatenate([np.zeros(0), *bias.values()]), force.ravel() + armatures.force
    if is_singular:
        return _along_free_directions(mass, push, rows, coasting, rank).reshape(-1, 6)
    inverse = np.linalg.inv(np.linalg.cholesky(mass).T)
    unbound = inverse.T @ push
    weighted = rows @ inverse
    wanted = -coasting - weighted @ unbound
    found = unbound + (_least(weighted, wanted, rank) if len(rows) else 0.0)
    return (inverse @ found).reshape(-1, 6)


def _along_free_directions(
    mass: np.ndarray, push: np.ndarray, rows: np.ndarray, coasting: np.ndarray, rank: int | None
) -> np.ndarray:
    """Return a (n,) with J a = -coasting, and M a - f without a component along directions that J leaves
    free."""
    if not np.isfinite(rows).all():
        return np.full(len(mass), np.nan)
    u, s, vt = np.linalg.svd(rows)
    r = int(np.sum(s > RANK * s[0])) if rank is None else rank
    held, free = vt[:r].T @ (u[:, :r].T @ -coasting / s[:r]), vt[r:].T
    step = np.linalg.lstsq(free.T @ mass @ free, free.T @ (push - mass @ held), rcond=None)[0]
    found: np.ndarray = held + free @ step
    return found


def _least(matrix: np.ndarray, wanted: np.ndarray, rank: int | None) -> np.ndarray:
    """Return the least-norm solution (n,) for a matrix (m, n) of known rank, otherwise with singular values
    above RANK."""
    if not (np.isfinite(matrix).all() and np.isfinite(wanted).all()):
        return np.full(matrix.shape[1], np.nan)  # not finite, so that the integrator rejects the step
    u, s, vt = np.linalg.svd(matrix, full_matrices=False)
    r = int(np.sum(s > RANK * s[0])) if rank is None else rank
    return vt[:r].T @ (u[:, :r].T @ wanted / s[:r])


def power(scene: Scene, t: float, state: State) -> float:
    """Return the power (W) of gravity and loads at a state at time t (s)."""
    twist = np.hstack([state[2], state[3]])
    return float(np.sum(applied(scene, t, state) * twist))  # gyroscopic moments have no power


def kinetic(scene: Scene, state: State) -> float:
    """Return the kinetic energy (J) of a state."""
    return float(kinetic_energy(scene, *(part[None] for part in state[:4]))[0])


def _rates_about(scene: Scene, orientation: np.ndarray, spin: np.ndarray) -> np.ndarray:
    """Return the rates (l,) of the joint angles on which loads act; the first body carries each axis."""
    found = []
    for load in turning_loads(scene):
        joint = scene.joint_named(load.joint)
        first, second = (scene.body_index(name) for name in joint.bodies)
        axis = rotations.unit(joint.directions[0])
        if first >= 0:
            start = rotations.conjugate(np.array(scene.body[first].orientation))
            axis = rotations.rotate(rotations.multiply(orientation[first], start), axis)
        spins = np.vstack([spin, np.zeros(3)])
        found.append(axis @ (spins[second] - spins[first]))
    return np.array(found)


def _state(scene: Scene, y: np.ndarray) -> State:
    n = len(scene.body)
    position, rest = y[: 3 * n].reshape(n, 3), y[3 * n :]
    orientation = rest[: 4 * n].reshape(n, 4)
    velocity, spin = rest[4 * n : 10 * n].reshape(2, n, 3)
    unit = orientation / np.linalg.norm(orientation, axis=1, keepdims=True)
    return position, unit, velocity, spin, rest[10 * n :]


def _rates(t: float, y: np.ndarray, scene: Scene, rank: int, since: float) -> np.ndarray:
    ask()
    state = _state(scene, y)
    _, orientation, velocity, spin, _ = state
    second = accelerations(scene, t, state, rank, since)
    pure = np.concatenate([np.zeros((len(spin), 1)), spin], axis=1)
    n = len(spin)
    turning = rotations.multiply(pure, y[3 * n : 7 * n].reshape(n, 4)) / 2
    parts = velocity, turning, second[:, :3], second[:, 3:], _rates_about(scene, orientation, spin)
    return np.concatenate([np.ravel(part) for part in parts])


def _trajectory(scene: Scene, times: np.ndarray, samples: np.ndarray, rtol: float, rank: int) -> Trajectory:
    states = [_state(scene, y) for y in samples]
    second = np.array([accelerations(scene, t, state, rank) for t, state in zip(times, states, strict=True)])
    position, orientation, velocity, spin = (np.array([state[k] for state in states]) for k in range(4))
    names = tuple(body.name for body in scene.body)
    return Trajectory(
        scene.name,
        NAME,
        "",
        "",
        {"rtol": rtol},
        times,
        names,
        position,
        orientation,
        velocity,
        spin,
        second[..., :3],
        second[..., 3:],
        outcome=Outcome.COMPLETED,
        t_end=float(times[-1]),
    )
