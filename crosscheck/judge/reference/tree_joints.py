"""The spanning tree of a scene: joint coordinates, and the motion of the bodies, propagated outwards from the
ground.

One joint carries each body, or the body moves freely; all other joints close loops. A body's frame equals the
world frame at t = 0, so that the scene's directions and points need no conversion. A twist about the world's
origin is the sum of the joint twists (Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 2).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.judge.arithmetic import Arithmetic
from crosscheck.judge.reference.vectors import apply, cross, matrices, product, unit
from mbref.scene import JointLoad, Scene

AXES = np.eye(3)
RIGIDITY = {
    "fixed": 6,
    "revolute": 5,
    "translational": 5,
    "universal": 4,
    "cylindrical": 4,
    "planar": 3,
    "spherical": 3,
}
PREFERRED = 10  # weight of joints whose coordinate is used, so that they are in the tree


@dataclass(frozen=True)
class Link:
    """A body on its parent (-1: ground) by a joint (None: free); ``sign`` is -1 if the joint's second body is
    the parent."""

    body: int
    parent: int
    joint: Any
    sign: int

    def slides(self, numbers: Arithmetic) -> list[np.ndarray]:
        """Return the directions of displacement, fixed to the parent."""
        kind = self.joint.type if self.joint else "free"
        frame = self.sign * joint_frame(numbers, self.joint)
        among = {"free": frame, "planar": frame[:2], "translational": frame[2:], "cylindrical": frame[2:]}
        return list(among.get(kind, ()))

    def turns(self, numbers: Arithmetic) -> list[np.ndarray]:
        """Return the axes of rotation: the first axis is fixed to the parent, a second axis to the body."""
        kind = self.joint.type if self.joint else "free"
        if kind == "universal":
            return list(unit(numbers.array(self.joint.axes))[:: self.sign])
        turning = kind in ("revolute", "cylindrical", "planar")
        return [self.sign * joint_frame(numbers, self.joint)[2]] if turning else []

    def is_ball(self) -> bool:
        """Return whether all rotations are free."""
        return self.joint is None or self.joint.type == "spherical"


@dataclass(frozen=True)
class Placed:
    """Bodies at K times, the ground last.

    Fields are ``position`` (K, nb + 1, 3) of the centres of mass, quaternions and matrices of the ``turn``
    since t = 0, and twists ``velocity`` and ``spin``. ``drift`` and ``spin_drift`` are the rates of both
    without joint accelerations. ``columns`` (K, nb + 1, nv, 6) are the twists for unit joint rates.
    """

    position: np.ndarray
    turn: np.ndarray
    rotation: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray
    drift: np.ndarray
    spin_drift: np.ndarray
    columns: np.ndarray


class Tree:
    """A spanning tree with its joint coordinates.

    ``scalars`` are displacements and angles, then follows one unit quaternion for each of the ``balls``.
    Joint rates have this order, too, with three rates for a ball.
    """

    def __init__(self, scene: Scene, arithmetic: Arithmetic):
        self.scene, self.arithmetic = scene, arithmetic
        self.links = spanning_tree(scene)
        self.cut = [j for j in scene.joint if not any(link.joint is j for link in self.links)]
        self.start = arithmetic.array([*(b.position for b in scene.body), (0.0, 0.0, 0.0)])
        self.balls = [n for n, link in enumerate(self.links) if link.is_ball()]
        self._list_coordinates()
        self._list_arms()
        self.unmoved = np.array([1, 0, 0, 0]) + arithmetic.zeros(4)

    def _list_coordinates(self) -> None:
        """Store axes, carriers and kinds of the joint rates, and the scalars of each joint, slides first."""
        self.coordinate: dict[str, list[int]] = {}
        # axis, body that carries the axis, whether it is a rotation, link
        rates: list[tuple[np.ndarray, int, bool, int]] = []
        for n, link in enumerate(self.links):
            first, carriers = len(rates), (link.parent, link.body)
            rates += [(axis, link.parent, False, n) for axis in link.slides(self.arithmetic)]
            turns = zip(link.turns(self.arithmetic), carriers, strict=False)
            rates += [(axis, carrier, True, n) for axis, carrier in turns]
            if link.joint:
                self.coordinate[link.joint.name] = list(range(first, len(rates)))
        self.scalars = len(rates)
        ball = self.arithmetic.array(AXES)
        rates += [(axis, self.links[n].parent, True, n) for n in self.balls for axis in ball]
        self.axis = self.arithmetic.array([rate[0] for rate in rates]).reshape(-1, 3)
        self.carrier = np.array([rate[1] for rate in rates], dtype=int)
        self.turning = np.array([rate[2] for rate in rates], dtype=bool)
        self.link = np.array([rate[3] for rate in rates], dtype=int)
        slides = [[not rate[2] and rate[3] == n for rate in rates] for n in range(len(self.links))]
        self.slides = np.array(slides, dtype=int).reshape(len(self.links), len(rates))[:, : self.scalars]

    def _list_arms(self) -> None:
        """Store the vectors at t = 0 from a parent's centre to the joint, and from the joint to the body's
        centre."""
        nb = len(self.scene.body)
        self.body = np.array([link.body for link in self.links])
        self.parent = np.array([link.parent for link in self.links])
        anchors = [
            link.joint.anchor if link.joint else self.scene.body[link.body].position for link in self.links
        ]
        anchor = self.arithmetic.array(anchors)
        self.inner, self.outer = anchor - self.start[self.parent], self.start[self.body] - anchor
        # entry is 1 if the link carries the body, directly or through other links
        self.carried = np.zeros((nb + 1, len(self.links)), dtype=int)
        for n, link in enumerate(self.links):
            self.carried[link.body] = self.carried[link.parent]
            self.carried[link.body, n] = 1
        self.moved = self.carried[:, self.link]  # shape (nb + 1, nv)

    def placed(self, scalar: np.ndarray, ball: np.ndarray, rate: np.ndarray) -> Placed:
        """Return the bodies for joint coordinates (K, scalars) and (K, balls, 4) and joint rates (K, nv)."""
        turn = self._turns(scalar, ball)
        rotation = matrices(turn)
        axis = apply(rotation[:, self.carrier], self.axis)
        outer = apply(rotation[:, self.body], self.outer)
        inner = apply(rotation[:, self.parent], self.inner)
        slid = self.slides @ (axis[:, : self.scalars] * scalar[..., None])
        position = self.carried @ (inner + slid + outer)
        turning, weight = self.turning[:, None], rate[..., None]
        joint = (position[:, self.body] - outer)[:, self.link]
        angular = axis * turning
        linear = np.where(turning, cross(joint, axis), axis)
        spin = self.moved @ (angular * weight)
        velocity = self.moved @ (linear * weight) + cross(spin, position)
        passing = (velocity[:, self.body] - cross(spin[:, self.body], outer))[:, self.link]
        axis_rate = cross(spin[:, self.carrier], axis)
        bending = np.where(turning, cross(passing, axis) + cross(joint, axis_rate), axis_rate)
        spin_drift = self.moved @ (axis_rate * turning * weight)
        drift = self.moved @ (bending * weight) + cross(spin_drift, position) + cross(spin, velocity)
        arms = linear[:, None] + cross(angular[:, None], position[:, :, None])
        columns = np.concatenate([arms, angular[:, None] + 0 * arms], axis=-1) * self.moved[..., None]
        return Placed(position, turn, rotation, velocity, spin, drift, spin_drift, columns)

    def _turns(self, scalar: np.ndarray, ball: np.ndarray) -> np.ndarray:
        """Return quaternions (K, nb + 1, 4) of the bodies' rotations since t = 0."""
        half = scalar[..., None] / 2
        single = np.concatenate([np.cos(half), np.sin(half) * self.axis[: self.scalars]], axis=-1)
        turn = np.repeat((0 * ball.sum(axis=(1, 2)))[:, None, None] + self.unmoved, len(self.carried), axis=1)
        for n, link in enumerate(self.links):
            here = turn[:, link.parent]
            for k in np.flatnonzero(self.turning[: self.scalars] & (self.link[: self.scalars] == n)):
                here = product(here, single[:, k])
            if n in self.balls:
                here = product(here, ball[:, self.balls.index(n)])
            turn[:, link.body] = here
        return turn


def used_coordinates(scene: Scene) -> set[tuple[str, str]]:
    """Return kind and joint of the coordinates that drivers, loads of joints, couplings and armatures use."""
    acting = [driver.joint for driver in scene.driver]
    acting += [joint.name for joint in scene.joint if joint.reflected_inertia]
    found = {(str(scene.joint_named(name).facts.driven), name) for name in acting}
    found |= {(load.coordinate, load.joint) for load in scene.load if isinstance(load, JointLoad)}
    return found | {(kind, joint.name) for c in scene.coupling for joint, kind in scene.coupled(c)}


def spanning_tree(scene: Scene) -> list[Link]:
    """Return the links from the ground outwards; joints with more rows are selected first (Kruskal)."""
    favoured = {name for _, name in used_coordinates(scene)}

    def weight(joint: Any) -> int:
        return RIGIDITY[joint.type] + PREFERRED * (joint.name in favoured)

    group = [*range(len(scene.body)), -1]
    kept = []
    for joint in sorted((j for j in scene.joint if j.type in RIGIDITY), key=weight, reverse=True):
        a, b = (group[scene.body_index(name)] for name in joint.bodies)
        if a != b:
            kept.append(joint)
            group = [a if g == b else g for g in group]
    return _outwards(scene, kept)


def _outwards(scene: Scene, kept: list[Any]) -> list[Link]:
    links: list[Link] = []
    reached, waiting = {-1}, list(kept)
    while len(reached) <= len(scene.body):
        joint = next((j for j in waiting if _touches(scene, j, reached)), None)
        if joint is None:
            body = next(b for b in range(len(scene.body)) if b not in reached)
            links.append(Link(body, -1, None, 1))
        else:
            waiting.remove(joint)
            first, second = (scene.body_index(name) for name in joint.bodies)
            forwards = first in reached
            links.append(
                Link(*((second, first) if forwards else (first, second)), joint, 1 if forwards else -1)
            )
        reached.add(links[-1].body)
    return links


def _touches(scene: Scene, joint: Any, reached: set[int]) -> bool:
    return any(scene.body_index(name) in reached for name in joint.bodies)


def joint_frame(numbers: Arithmetic, joint: Any) -> np.ndarray:
    """Return the directions (3, 3) of a joint: two normal to its axis, then the axis; the world axes if it
    has no axis."""
    if not hasattr(joint, "axis"):
        return numbers.array(AXES)
    z = unit(numbers.array(joint.axis))
    x = unit(cross(numbers.array(AXES[np.argmin(np.abs(joint.axis))]), z))
    return np.stack([x, cross(z, x), z])
