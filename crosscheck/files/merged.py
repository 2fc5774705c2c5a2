"""A machine with bodies that are fixed to each other as one body, so that readers that merge them compare."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from crosscheck.engines.loaders.machine import FIXED, WORLD, Body, Joint, Machine

NO_MASS = 1e-9  # mass / mass of the whole machine; auxiliary bodies of readers have less


@dataclass(frozen=True)
class Group:
    """Bodies that are fixed to each other: total mass, centre of mass (3,), inertia about it (3, 3).

    ``centre`` and ``inertia`` are None if the reader does not report them.
    """

    names: frozenset[str]
    mass: float | None
    centre: np.ndarray | None
    inertia: np.ndarray | None

    @property
    def name(self) -> str:
        """Return the first name of the bodies."""
        return min(self.names)


@dataclass(frozen=True)
class Merged:
    """Moving groups, the number of each body's group (-1 for the world) and the joints between groups."""

    groups: Sequence[Group]
    group_of: dict[str, int]
    joints: Sequence[Joint]

    def pair(self, bodies: Sequence[str]) -> tuple[int, ...]:
        """Return the groups of bodies."""
        return tuple(self.group_of.get(name, -1) for name in bodies)


def merged(machine: Machine) -> Merged:
    """Return the machine's groups."""
    root = {body.name: body.name for body in machine.bodies} | {WORLD: WORLD}

    def end(name: str) -> str:
        return name if root.setdefault(name, name) == name else end(root[name])

    for joint in machine.joints:
        if joint.type == FIXED:
            first, second = map(end, joint.bodies)
            root[second if second != WORLD else first] = first if second != WORLD else second
    members: dict[str, list[Body]] = {}
    for body in machine.bodies:
        members.setdefault(end(body.name), []).append(body)
    static = {body.name: -1 for body in members.pop(WORLD, [])}
    groups = [_group(bodies) for bodies in members.values()]
    numbers = {name: k for k, group in enumerate(groups) for name in group.names}
    joints = [joint for joint in machine.joints if joint.type != FIXED]
    return Merged(groups, {WORLD: -1} | static | numbers, joints)


def _group(bodies: Sequence[Body]) -> Group:
    names = frozenset(body.name for body in bodies)
    masses = [body.mass for body in bodies if body.mass is not None]
    total = float(sum(masses)) if masses else None
    if any(body.centre is None or body.inertia is None for body in bodies) or total is None:
        return Group(names, total, None, None)
    centres = [np.array(body.centre) for body in bodies]
    centre = sum(m * c for m, c in zip(masses, centres, strict=True)) / total if total else centres[0]
    inertia = np.zeros((3, 3))
    for body, mass, place in zip(bodies, masses, centres, strict=True):
        apart = place - centre
        inertia += np.array(body.inertia) + mass * (apart @ apart * np.eye(3) - np.outer(apart, apart))
    return Group(names, total, np.asarray(centre), inertia)


def size_of(machine: Machine) -> float:
    """Return the largest distance along an axis between centres of mass and anchors (m); 1 m without any."""
    points = [body.centre for body in machine.bodies if body.centre is not None and body.mass]
    points += [joint.anchor for joint in machine.joints if joint.anchor is not None]
    found = float(np.ptp(np.array(points), axis=0).max()) if points else 0.0
    return found or 1.0
