"""A machine at displacements of its joints: places and velocities of its bodies, from its joints alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from crosscheck.engines.loaders.machine import REVOLUTE, SCALAR, TRANSLATIONAL, WORLD, Joint, Machine, vector
from crosscheck.engines.loaders.placing import ORIGIN, Place, turned

Pose = dict[str, float]  # displacements of joints from the reference pose, rad or m
SINGLE = {"spherical": (REVOLUTE,), "free": (TRANSLATIONAL, REVOLUTE)}  # types, each along or about 3 axes


class Posed:
    """A machine at a pose; joints with several coordinates stay at the reference.

    ``joints`` are its hinges and slides (n), and ``places`` the displacement of each body from the reference
    pose.
    """

    def __init__(self, machine: Machine, pose: Mapping[str, float]):
        single = [joint for joint in machine.joints if joint.type in SCALAR]
        self.joints = tuple(joint.name for joint in single)
        self.places: dict[str, Place] = {WORLD: ORIGIN}
        number = {name: k for k, name in enumerate(self.joints)}
        self._carrying: dict[str, np.ndarray] = {}  # numbers of the joints between the world and a body
        self._turns = np.array([joint.type == REVOLUTE for joint in single], bool)
        self._axes, self._anchors = np.zeros((2, len(single), 3))
        for body, chain in _chains(machine).items():
            place = ORIGIN
            for joint in chain:
                if joint.name in number and joint.axis is not None and joint.anchor is not None:
                    k = number[joint.name]
                    self._axes[k], self._anchors[k] = place.direction(joint.axis), place.point(joint.anchor)
                    place = place.then(_motion(joint, pose.get(joint.name, 0.0)))
            self.places[body] = place
            self._carrying[body] = np.array([number[j.name] for j in chain if j.name in number], int)

    def columns(self, body: str, point: np.ndarray) -> np.ndarray:
        """Return velocities of a point (3,) of a body, and angular velocities, per unit rates (6, n)."""
        found = np.zeros((6, len(self.joints)))
        k = self._carrying.get(body, np.zeros(0, int))
        axes, turns = self._axes[k], self._turns[k][:, None]
        arms = point - self._anchors[k]
        found[:3, k] = np.where(turns, np.cross(axes, arms), axes).T
        found[3:, k] = np.where(turns, axes, 0.0).T
        return found


def in_single_axes(machine: Machine) -> Machine:
    """Return the machine with slides along and hinges about the world's axes for ball and free joints.

    At the reference pose their rates are velocities. Joints with dampers, springs or armature stay.
    """
    return replace(machine, joints=tuple(part for joint in machine.joints for part in _parts(joint)))


def _parts(joint: Joint) -> Iterator[Joint]:
    forces = *(joint.damping or ()), *(joint.stiffness or ()), joint.armature
    if joint.type not in SINGLE or any(forces):
        yield joint
        return
    for kind in SINGLE[joint.type]:
        for name, axis in zip("xyz", np.eye(3), strict=True):
            anchor = joint.anchor or (0.0, 0.0, 0.0)
            yield Joint(f"{joint.name} {kind} {name}", kind, joint.bodies, anchor, vector(axis))


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


def _motion(joint: Joint, value: float) -> Place:
    assert joint.axis is not None and joint.anchor is not None
    if joint.type == REVOLUTE:
        return turned(joint.anchor, joint.axis, value)
    return Place(np.array(joint.axis) * value, np.eye(3))
