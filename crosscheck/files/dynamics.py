"""Accelerations and a short motion of hinges and slides, with loops and couplings or ball and free joints.

M a = -g - c - Σ dₙ v |v|ⁿ - Σ kₙ xⁿ⁺¹ + Gᵀλ and G a = -Ġ v: mass matrix M and gravity torques g, dampers d,
springs k stretched by x, rows G, and velocity terms c = Σ m Jᵀ J̇ v + Rᵀ (I Ṙ v + ω × I ω) of bodies.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from crosscheck.engines.loaders.constrained import DEPENDENT, accelerations, along
from crosscheck.engines.loaders.loader import DURATION
from crosscheck.engines.loaders.machine import FIXED, REVOLUTE, SCALAR, Joint, Machine, Vector
from crosscheck.engines.loaders.posed import Pose, Posed, in_single_axes
from crosscheck.files.constraints import closed, projected, rows_of, scales, unknown
from crosscheck.files.statics import moving_bodies, statics_of

SPEED, SEED = 1.0, 11  # largest rates: rad/s, and machine's sizes per s
MOST = 60  # joints; the motion of a machine with more takes seconds
REGULAR = 1e-4  # smallest singular value of independent rows / largest one, away from singular positions
MASSIVE = 1e-10  # least eigenvalue of a mass matrix with a unit diagonal; less is rounding of a massless link
RTOL = 1e-6  # relative tolerance of the motion; the error found is 1e-8 and less
SINGULAR = 0.1  # least singular value of the rows / that at the start; less is near a singular position
MOST_WORK = 3000  # evaluations times joints of a motion: at most twenty seconds; a stiff one takes minutes


class State(NamedTuple):
    """Displacements and rates of joints, with mass matrix (n, n), -g - c (n,), rows G (m, n) and Ġ v (m,)."""

    pose: Pose
    rates: Pose
    joints: tuple[str, ...]
    mass: np.ndarray
    force: np.ndarray
    rows: np.ndarray
    drift: np.ndarray


def closed_poses(machine: Machine, poses: Sequence[Pose], size: float) -> list[Pose]:
    """Return the poses near to random ones that obey loops and couplings; singular positions are left out."""
    if not (machine.loops or machine.couplings) or unknown(machine):
        return []
    found = [pose for pose in (closed(machine, pose, size) for pose in poses) if pose is not None]
    ranks = [_rank(machine, pose, size) for pose in found]
    return [pose for pose, rank in zip(found, ranks, strict=True) if rank and rank == max(ranks)]


def _rank(machine: Machine, pose: Pose, size: float) -> int:
    """Return the rank of the rows; 0 if it is not clear."""
    rows = rows_of(machine, pose, size)
    values = np.linalg.svd(rows.of(rows.joints) * scales(machine, size), compute_uv=False)
    rank = int(np.sum(values > REGULAR * values[0]))
    return rank if rank == np.sum(values > REGULAR**2 * values[0]) else 0


def states_of(machine: Machine, poses: Sequence[Pose], size: float, gravity: Vector) -> list[State]:
    """Return a state with random rates of hinges and slides at each pose; ball and free joints begin at rest.

    There is none for a machine with other joints, with a joint that moves no mass, with constraints whose
    rows are unknown, or with constraints and a ball or free joint.
    """
    random, held = np.random.default_rng(SEED), bool(machine.loops or machine.couplings)
    whole = machine if held else in_single_axes(machine)
    moving = [joint for joint in whole.joints if joint.type != FIXED]
    if not 0 < len(moving) <= MOST or any(joint.type not in SCALAR for joint in moving) or unknown(machine):
        return []
    single = [joint for joint in machine.joints if joint.type in SCALAR]
    most = {joint.name: SPEED if joint.type == REVOLUTE else SPEED * size for joint in single}
    found, still = [], {joint.name: 0.0 for joint in moving}
    for pose in closed_poses(machine, poses, size) if held else poses:
        rates = {name: float(random.uniform(-m, m)) for name, m in most.items()}
        rates = projected(machine, pose, rates, size) if held else rates
        found.append(state_at(whole, still | pose, still | rates, size, gravity))
    return found if all(_moves(state.mass) for state in found) else []


def _moves(mass: np.ndarray) -> bool:
    """Return whether a mass matrix is regular: each joint moves some mass."""
    sizes = np.sqrt(np.diag(mass))
    if not np.all(sizes > 0.0):
        return False
    return bool(np.linalg.eigvalsh(mass / np.outer(sizes, sizes))[0] > MASSIVE)


def state_at(machine: Machine, pose: Pose, rates: Pose, size: float, gravity: Vector) -> State:
    """Return the state of a machine with its terms."""
    found = statics_of(machine, pose, gravity)
    v = np.array([rates[name] for name in found.joints])

    def twists(at: Pose) -> np.ndarray:
        return np.array([body.columns @ v for body in moving_bodies(machine, Posed(machine, at))])

    def rows(at: Pose) -> np.ndarray:
        return rows_of(machine, at, size).of(found.joints)

    force, drifts = -np.array(found.gravity), along(twists, pose, rates)
    for body, drift in zip(moving_bodies(machine, Posed(machine, pose)), drifts, strict=True):
        spin = body.columns[3:] @ v
        moment = body.inertia @ drift[3:] + np.cross(spin, body.inertia @ spin)
        force -= body.columns.T @ np.concatenate([body.mass * drift[:3], moment])
    change = along(lambda at: rows(at) @ v, pose, rates)
    return State(pose, rates, found.joints, np.array(found.mass), force, rows(pose), change)


def accelerations_of(machine: Machine, state: State) -> dict[str, float]:
    """Return the accelerations of hinges and slides (rad/s² or m/s²) with the dampers and springs of a
    machine."""
    found, single = _accelerations(machine, state), _single(machine)
    return {name: found[k] for k, name in enumerate(state.joints) if name in single}


def _single(machine: Machine) -> dict[str, Joint]:
    return {joint.name: joint for joint in machine.joints if joint.type in SCALAR}


def _accelerations(machine: Machine, state: State) -> list[float]:
    """Return the accelerations of all joints of a state (n)."""
    joints, force = _single(machine), state.force.copy()
    for k, name in enumerate(state.joints):
        if name not in joints:
            continue
        joint, v = joints[name], state.rates[name]
        stretched = state.pose[name] + (joint.reference or 0.0) - (joint.rest or 0.0)
        force[k] -= sum(d * v * abs(v) ** n for n, d in enumerate(joint.damping or ()))
        force[k] -= sum(c * stretched ** (n + 1) for n, c in enumerate(joint.stiffness or ()))
    made: list[float] = accelerations(state.mass, force, state.rows, state.drift).tolist()
    return made


class NoTruth(Exception):
    """The reason for which the end of a motion is not known, or is no test of engines."""


def end_of(machine: Machine, start: State, size: float, gravity: Vector) -> dict[str, float]:
    """Return the displacements of hinges and slides after ``DURATION``, by DOP853.

    Raises NoTruth for a motion that takes more than MOST_WORK, and for one that comes near a singular
    position, where small errors of engines grow and the motion may branch.
    """
    names, number, evaluated = start.joints, len(start.joints), itertools.count(1)
    single = _single(machine)
    whole = machine if len(single) == number else in_single_axes(machine)
    at_start = _singular_values(whole, start, size)
    rank = int(np.sum(at_start > DEPENDENT * at_start.max(initial=0.0)))

    def change(_: float, y: np.ndarray) -> np.ndarray:
        if next(evaluated) * number > MOST_WORK:
            raise NoTruth("the file's motion is too stiff for the reference")
        pose, rates = (dict(zip(names, half.tolist(), strict=True)) for half in np.split(y, 2))
        now = state_at(whole, pose, rates, size, gravity)
        if rank and _singular_values(whole, now, size)[rank - 1] < SINGULAR * at_start[rank - 1]:
            raise NoTruth("the file's motion comes near a singular position")
        return np.append(y[number:], _accelerations(machine, now))

    y = np.array([part[name] for part in (start.pose, start.rates) for name in names])
    run = solve_ivp(change, (0.0, DURATION), y, method="DOP853", rtol=RTOL, atol=RTOL)
    return {name: float(q) for name, q in zip(names, run.y[:number, -1], strict=True) if name in single}


def _singular_values(machine: Machine, state: State, size: float) -> np.ndarray:
    """Return the singular values of the constraint rows at a state; none without rows."""
    if not len(state.rows):
        return np.zeros(0)
    return np.asarray(np.linalg.svd(state.rows * scales(machine, size), compute_uv=False))
