"""Accelerations of a machine that is a tree of hinges and slides, and their differences from an engine's.

M a = -g - c - Σ dₙ v |v|ⁿ - Σ kₙ xⁿ⁺¹: mass matrix M and gravity torques g, dampers d, springs k stretched by
x, and velocity terms c = Ṁ v - ½ ∂(vᵀ M v)/∂q, from differences of order four of M along the coordinates.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from crosscheck.engines.loaders.machine import FIXED, REVOLUTE, SCALAR, Machine, Vector
from crosscheck.files.differences import WRONG, Difference
from crosscheck.files.matching import Match, ending
from crosscheck.files.statics import Pose, statics_of

SPEED, SEED = 1.0, 11  # largest rates: rad/s, and machine's sizes per s
MOST = 30  # joints; the differences of M need four evaluations for each joint
UNUSED = ("read, and not used by its dynamics", "read, and used by its dynamics in the first number only")
STEP = 1e-3  # rad or m, of the differences, whose error is about STEP^4
NONE = (0.0, 0.0, 0.0)  # m/s²
FACTORS = ((-2.0, 1 / 12), (-1.0, -8 / 12), (1.0, 8 / 12), (2.0, -1 / 12))  # displacement / STEP, weight


def moves_alone(machine: Machine) -> bool:
    """Return whether the machine is a tree of at most MOST hinges and slides."""
    moving = [joint for joint in machine.joints if joint.type != FIXED]
    is_tree = not machine.loops and not machine.couplings
    return is_tree and 0 < len(moving) <= MOST and all(joint.type in SCALAR for joint in moving)


def random_rates(machine: Machine, size: float, number: int) -> list[Pose]:
    """Return random rates of the joints, one set for each of several poses."""
    random = np.random.default_rng(SEED)
    joints = [joint for joint in machine.joints if joint.type in SCALAR]
    most = {joint.name: SPEED if joint.type == REVOLUTE else SPEED * size for joint in joints}
    return [{n: float(random.uniform(-m, m)) for n, m in most.items()} for _ in range(number)]


class State(NamedTuple):
    """Displacements and rates of joints, with mass matrix (n, n) and -g - c (n,) of the machine."""

    pose: Pose
    rates: Pose
    joints: tuple[str, ...]
    mass: np.ndarray
    force: np.ndarray


def states_of(machine: Machine, poses: Sequence[Pose], size: float, gravity: Vector) -> list[State]:
    """Return a state with random rates at each pose; none for a machine that does not move alone."""
    if not moves_alone(machine):
        return []
    rates = random_rates(machine, size, len(poses))
    return [_state(machine, pose, speed, gravity) for pose, speed in zip(poses, rates, strict=True)]


def _state(machine: Machine, pose: Pose, rates: Pose, gravity: Vector) -> State:
    found = statics_of(machine, pose, gravity)
    v = np.array([rates[name] for name in found.joints])
    slopes = [_slope(machine, pose, name) for name in found.joints]
    change = sum(rate * slope for rate, slope in zip(v, slopes, strict=True))
    force = -np.array(found.gravity) - change @ v + np.array([v @ slope @ v for slope in slopes]) / 2
    return State(pose, rates, found.joints, np.array(found.mass), force)


def accelerations_of(machine: Machine, state: State) -> dict[str, float]:
    """Return the accelerations (rad/s² or m/s²) with the dampers and springs of a machine."""
    joints, force = {joint.name: joint for joint in machine.joints}, state.force.copy()
    for k, name in enumerate(state.joints):
        joint, v = joints[name], state.rates[name]
        stretched = state.pose[name] + (joint.reference or 0.0) - (joint.rest or 0.0)
        force[k] -= sum(d * v * abs(v) ** n for n, d in enumerate(joint.damping or ()))
        force[k] -= sum(c * stretched ** (n + 1) for n, c in enumerate(joint.stiffness or ()))
    return dict(zip(state.joints, np.linalg.solve(state.mass, force).tolist(), strict=True))


def _slope(machine: Machine, pose: Mapping[str, float], name: str) -> np.ndarray:
    """Return the derivative of the mass matrix by a coordinate."""
    parts = [
        weight / STEP * np.array(statics_of(machine, {**pose, name: pose[name] + factor * STEP}, NONE).mass)
        for factor, weight in FACTORS
    ]
    return np.asarray(sum(parts))


def of_dynamics(
    match: Match, own: Sequence[Mapping[str, float]], states: Sequence[State], tolerance: float
) -> list[Difference]:
    """Return the largest difference of accelerations, relative to the largest acceleration.

    If they are the accelerations without dampers or springs, or with the linear ones alone, the numbers of
    these are returned.
    """
    size, found = _worst(match.file, own, states)
    if found is None or size <= tolerance:
        return []
    for field, (kept, words) in itertools.product(("damping", "stiffness"), enumerate(UNUSED)):
        having = [joint for joint in match.file.joints if len(getattr(joint, field) or ()) > kept]
        less: dict[str, Any] = {j.name: {field: getattr(j, field)[:kept]} for j in having}
        joints = tuple(replace(joint, **less.get(joint.name, {})) for joint in match.file.joints)
        if having and _worst(replace(match.file, joints=joints), own, states)[0] <= tolerance:
            return [Difference(WRONG, "joint", j.name, field, getattr(j, field), words) for j in having]
    return [found]


def _worst(
    machine: Machine, own: Sequence[Mapping[str, float]], states: Sequence[State]
) -> tuple[float, Difference | None]:
    """Return the largest relative difference of accelerations; none if the reader lacks a joint."""
    pairs: list[tuple[str, float, float]] = []
    for found, state in zip(own, states, strict=False):
        named = {ending(name): value for name, value in found.items()}
        expected = accelerations_of(machine, state)
        if expected.keys() - named.keys():
            return 0.0, None
        pairs += [(name, value, named[name]) for name, value in expected.items()]
    if not pairs:
        return 0.0, None
    scale = max(abs(value) for _, *both in pairs for value in both) or 1.0
    name, value, other = max(pairs, key=lambda pair: abs(pair[2] - pair[1]))
    return abs(other - value) / scale, Difference(WRONG, "motion", name, "acceleration", value, other)
