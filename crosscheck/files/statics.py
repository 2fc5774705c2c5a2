"""Mass matrix and gravity torques of a machine, from its bodies and joints alone.

M = Σ m Jᵀ J + Rᵀ I R + armature and g = -Σ m Jᵀ γ over bodies with mass m, inertia I, Jacobians J of the
centre of mass and R of rotation, and the gravity γ.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from crosscheck.engines.loaders.machine import (
    FIXED,
    REVOLUTE,
    SCALAR,
    WORLD,
    Coupling,
    Joint,
    Machine,
    Statics,
    Vector,
    matrix,
    vector,
)
from crosscheck.engines.loaders.placing import ORIGIN, Place, turned

TURN, SHIFT, SEED = 0.7, 0.2, 7  # largest displacements: rad, and parts of the machine's size
POSES = 3
Pose = dict[str, float]


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
                value = pose.get(coupling.leader, 0.0)
                law = enumerate(coupling.coefficients)
                pose[coupling.follower] = sum(c * value**k for k, c in law)
    return found


def in_order(couplings: Sequence[Coupling]) -> list[Coupling]:
    """Return the couplings so that a follower comes before those that follow it."""
    waiting, found = list(couplings), list[Coupling]()
    while waiting:
        open_ones = {coupling.follower for coupling in waiting}
        ready = [c for c in waiting if c.leader not in open_ones] or waiting[:1]
        found += ready
        waiting = [c for c in waiting if c not in ready]
    return found


def statics_of(machine: Machine, pose: Mapping[str, float], gravity: Vector) -> Statics:
    """Return the statics of the tree at a pose; joints with several coordinates stay at the reference."""
    chains, moved = _chains(machine), _moved(machine, pose)
    single = [joint for joint in machine.joints if joint.type in SCALAR]
    number = {joint.name: k for k, joint in enumerate(single)}
    mass = np.diag([joint.armature or 0.0 for joint in single]).reshape(len(single), len(single))
    torque, centres = np.zeros(len(single)), dict[str, Vector]()
    columns = {j.name: _Column(j, moved[_name(j)]) for j in single}
    for body in machine.bodies:
        if body.centre is None or body.inertia is None or body.mass is None:
            continue
        place = moved.get(body.name, ORIGIN)
        centre = np.array(place.point(body.centre))
        centres[body.name] = vector(centre)
        shift, turn = np.zeros((2, 3, len(single)))
        for joint in chains[body.name]:
            if joint.name in number:
                shift[:, number[joint.name]], turn[:, number[joint.name]] = columns[joint.name](centre)
        inertia = place.turn @ np.array(body.inertia) @ place.turn.T
        mass += body.mass * shift.T @ shift + turn.T @ inertia @ turn
        torque -= body.mass * shift.T @ np.array(gravity)
    return Statics(tuple(number), matrix(mass), vector(torque), centres)


def _chains(machine: Machine) -> dict[str, list[Joint]]:
    """Return the joints between the world and each body."""
    onto: dict[str, list[Joint]] = {}
    for joint in machine.joints:
        onto.setdefault(joint.bodies[1], []).append(joint)
    found: dict[str, list[Joint]] = {WORLD: []}
    for body in machine.bodies:
        chain, name = list[Joint](), body.name
        while name in onto and len(chain) <= len(machine.joints):
            chain += reversed(onto[name])
            name = onto[name][0].bodies[0]
        found[body.name] = chain[::-1]
    return found


def _name(joint: Joint) -> str:
    return f"after joint {joint.name}"


def _moved(machine: Machine, pose: Mapping[str, float]) -> dict[str, Place]:
    """Return the displacement from the reference pose of each body, and of the frame of each joint."""
    found: dict[str, Place] = {}
    for body, chain in _chains(machine).items():
        place = ORIGIN
        for joint in chain:
            found[_name(joint)] = place
            if joint.type in SCALAR and joint.axis is not None and joint.anchor is not None:
                place = place.then(_motion(joint, pose.get(joint.name, 0.0)))
        found[body] = place
    return found


def _motion(joint: Joint, value: float) -> Place:
    assert joint.axis is not None and joint.anchor is not None
    if joint.type == REVOLUTE:
        return turned(joint.anchor, joint.axis, value)
    return Place(np.array(joint.axis) * value, np.eye(3))


class _Column:
    """The velocity of a point and the angular velocity per unit rate of a joint, at its displaced frame."""

    def __init__(self, joint: Joint, place: Place):
        assert joint.axis is not None and joint.anchor is not None and joint.type != FIXED
        self.turns = joint.type == REVOLUTE
        self.axis, self.anchor = (
            np.array(f) for f in (place.direction(joint.axis), place.point(joint.anchor))
        )

    def __call__(self, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if self.turns:
            return np.cross(self.axis, point - self.anchor), self.axis
        return self.axis, np.zeros(3)


def reduced(
    statics: Statics, kept: Sequence[str], couplings: Sequence[Coupling], pose: Mapping[str, float]
) -> Statics:
    """Return statics in the joints ``kept``, whose followers move with them: GᵀMG and Gᵀg."""
    if statics.mass is None or statics.gravity is None:
        return statics
    columns = {name: np.eye(len(kept))[k] for k, name in enumerate(kept)}
    for coupling in in_order(couplings):
        if coupling.follower not in columns and coupling.leader in columns:
            at = pose.get(coupling.leader, 0.0)
            slope = sum(k * c * at ** (k - 1) for k, c in enumerate(coupling.coefficients) if k)
            columns[coupling.follower] = slope * columns[coupling.leader]
    map_ = np.array([columns.get(name, np.zeros(len(kept))) for name in statics.joints])
    map_ = map_.reshape(len(statics.joints), len(kept))
    mass, torque = map_.T @ np.array(statics.mass) @ map_, map_.T @ np.array(statics.gravity)
    return Statics(tuple(kept), matrix(mass), vector(torque), statics.centres)
