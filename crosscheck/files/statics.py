"""Mass matrix and gravity torques of a machine, from its bodies and joints alone.

M = Σ m Jᵀ J + Rᵀ I R + armature and g = -Σ m Jᵀ γ over bodies with mass m, inertia I, Jacobians J of the
centre of mass and R of rotation, and the gravity γ.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from crosscheck.engines.loaders.machine import (
    REVOLUTE,
    SCALAR,
    Coupling,
    Machine,
    Statics,
    Vector,
    matrix,
    vector,
)
from crosscheck.engines.loaders.posed import Pose, Posed

TURN, SHIFT, SEED = 0.7, 0.2, 7  # largest displacements: rad, and parts of the machine's size
POSES = 3


def poses(machine: Machine, size: float) -> list[Pose]:
    """Return the reference pose and random poses as displacements of joints; followers obey their leaders."""
    random = np.random.default_rng(SEED)
    found: list[Pose] = [{} for _ in range(1 + POSES)]
    for number, pose in enumerate(found):
        for joint in machine.joints:
            if joint.type in SCALAR:
                most = TURN if joint.type == REVOLUTE else SHIFT * size
                pose[joint.name] = float(random.uniform(-most, most)) if number else 0.0
        for coupling in in_order(machine.couplings or ()):
            if coupling.leader in pose or not coupling.leader:
                pose[coupling.follower] = coupling.value(pose)
    return found


def in_order(couplings: Sequence[Coupling]) -> list[Coupling]:
    """Return the couplings so that a follower comes before those that follow it."""
    waiting, found = list(couplings), list[Coupling]()
    while waiting:
        open_ones = {coupling.follower for coupling in waiting}
        ready = [c for c in waiting if open_ones.isdisjoint(c.slopes({}))] or waiting[:1]
        found += ready
        waiting = [c for c in waiting if c not in ready]
    return found


def statics_of(machine: Machine, pose: Mapping[str, float], gravity: Vector) -> Statics:
    """Return the statics of the tree at a pose; joints with several coordinates stay at the reference."""
    at = Posed(machine, pose)
    rotors = {joint.name: joint.armature or 0.0 for joint in machine.joints}
    mass = np.diag([rotors[name] for name in at.joints]).reshape(len(at.joints), len(at.joints))
    torque, centres = np.zeros(len(at.joints)), dict[str, Vector]()
    for moving in moving_bodies(machine, at):
        centres[moving.name] = vector(moving.centre)
        shift, turn = moving.columns[:3], moving.columns[3:]
        mass += moving.mass * shift.T @ shift + turn.T @ moving.inertia @ turn
        torque -= moving.mass * shift.T @ np.array(gravity)
    return Statics(at.joints, matrix(mass), vector(torque), centres)


class Moving(NamedTuple):
    """A body at a pose: mass, centre of mass (3,), inertia (3, 3) and the columns (6, n) of its centre."""

    name: str
    mass: float
    centre: np.ndarray
    inertia: np.ndarray
    columns: np.ndarray


def moving_bodies(machine: Machine, at: Posed) -> Iterator[Moving]:
    """Yield the bodies with known masses, centres and inertias."""
    for body in machine.bodies:
        if body.centre is not None and body.inertia is not None and body.mass is not None:
            place = at.places[body.name]
            centre = np.array(place.point(body.centre))
            inertia = place.turn @ np.array(body.inertia) @ place.turn.T
            yield Moving(body.name, body.mass, centre, inertia, at.columns(body.name, centre))


def reduced(
    statics: Statics, kept: Sequence[str], couplings: Sequence[Coupling], pose: Mapping[str, float]
) -> Statics:
    """Return statics in the joints ``kept``, whose followers move with them: GᵀMG and Gᵀg."""
    if statics.mass is None or statics.gravity is None:
        return statics
    columns = {name: np.eye(len(kept))[k] for k, name in enumerate(kept)}
    for coupling in in_order(couplings):
        if coupling.follower not in columns and coupling.leader in columns:
            slopes = coupling.slopes(pose).items()
            parts = [slope * columns[n] for n, slope in slopes if n in columns]
            columns[coupling.follower] = np.sum(parts, axis=0)
    map_ = np.array([columns.get(name, np.zeros(len(kept))) for name in statics.joints])
    map_ = map_.reshape(len(statics.joints), len(kept))
    mass, torque = map_.T @ np.array(statics.mass) @ map_, map_.T @ np.array(statics.gravity)
    return Statics(tuple(kept), matrix(mass), vector(torque), statics.centres)
