"""A scene's spanning tree as multibodies of PyBullet: one multibody for every link that is joined to the
ground or floats.

A link's frame has its origin at the joint's anchor and world-aligned axes at t = 0; states are of the frame
of its centre of mass and principal axes.  Links are listed depth first, since PyBullet renumbers links in any
other order without a message. Inertias are set in a separate last call, since PyBullet ignores them in a call
that also sets damping.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from crosscheck.engines.shared.elementary_joints import Piece, pieces
from crosscheck.engines.shared.fixed_steps import held_points
from crosscheck.engines.shared.initial_velocities import initial_rates
from crosscheck.engines.shared.spanning_tree import BALL_JOINT, FREE, GROUND_LINK, SLIDE, TURN, Closure, Tree
from crosscheck.engines.shared.tree_reactions import LinkMotion
from mbref import rotations
from mbref.rotations import unit
from mbref.scene import Coupling, Scene

NEGLIGIBLE = 1e-12  # mass of auxiliary bodies in chains of joints / mass of the links
STRONGEST, FASTEST = 1e9, 1e9  # N, limit of a closure force; rad/s or m/s, limit of a joint rate
BASE = -1  # PyBullet's number of a multibody's base
O, UNIT = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]


class Place(NamedTuple):
    """Place of a link in PyBullet: its multibody and number, the offset of its centre of mass from the link's
    frame (3,), and its principal axes (3, 3)."""

    body: int
    link: int
    offset: np.ndarray
    axes: np.ndarray


class Mechanism:
    """A scene in PyBullet: the ``places`` of the tree's links, and the numbers of slides and turns."""

    def __init__(self, scene: Scene, tree: Tree):
        import pybullet

        self.p, self.scene, self.tree = pybullet, scene, tree
        self.places: dict[int, Place] = {}
        self.joints: dict[int, tuple[int, int]] = {}  # joints, keyed by joint velocity of the tree
        self.rates = initial_rates(scene, tree)
        pybullet.setGravity(*scene.gravity)
        parts = pieces(tree, NEGLIGIBLE)
        roots = [n for n, piece in enumerate(parts) if piece.parent < 0]
        for start, end in zip(roots, [*roots[1:], len(parts)], strict=True):
            self._add(parts[start:end], start)
        for closure in tree.closures:
            self._close(closure)
        for coupling in scene.coupling:
            self._couple(coupling)

    def _add(self, parts: list[Piece], start: int) -> None:
        """Add a multibody of connected pieces; the first piece has the number ``start``."""
        floats = parts[0].mobility is not None and parts[0].mobility.kind == FREE
        first, links = (parts[0], parts[1:]) if floats else (None, parts)
        up = start if floats else start - 1  # offset from numbers of pieces to PyBullet's link numbers
        base: dict[str, Any] = {"baseMass": 0.0}
        if first:
            centre = (first.origin + first.offset).tolist()
            base = {"baseMass": first.mass, "basePosition": centre, "baseOrientation": _xyzw(_axes(first))}
        body = self.p.createMultiBody(**base, **self._links(links, up, first))
        for j in range(BASE, len(links)):
            self.p.changeDynamics(body, j, linearDamping=0.0, angularDamping=0.0, jointDamping=0.0)
            self.p.changeDynamics(body, j, maxJointVelocity=FASTEST)
        for j, piece in enumerate(links):
            self._settle(body, j, piece)
        if first:
            self._settle(body, BASE, first)
            v = self.rates[first.velocity :][:6]
            linear = v[:3] + np.cross(v[3:], first.offset)
            self.p.resetBaseVelocity(body, linear.tolist(), v[3:].tolist())

    def _links(self, links: list[Piece], up: int, base: Piece | None) -> dict[str, Any]:
        """Return PyBullet's arguments for links; on a floating base they are placed in the frame of its
        centre of mass."""
        p = self.p
        kinds = {SLIDE: p.JOINT_PRISMATIC, TURN: p.JOINT_REVOLUTE, BALL_JOINT: p.JOINT_SPHERICAL}
        of_base = (base.origin + base.offset, _axes(base)) if base else (np.zeros(3), np.eye(3))
        parents = [max(0, piece.parent - up) for piece in links]
        frames = [(links[n - 1].anchor, np.eye(3)) if n else of_base for n in parents]
        moved = [piece.mobility for piece in links]
        return {
            "linkMasses": [piece.mass for piece in links],
            "linkCollisionShapeIndices": [-1] * len(links),
            "linkVisualShapeIndices": [-1] * len(links),
            "linkPositions": [
                (axes.T @ (k.anchor - place)).tolist() for k, (place, axes) in zip(links, frames, strict=True)
            ],
            "linkOrientations": [_xyzw(axes.T) for _, axes in frames],
            "linkInertialFramePositions": [(k.origin + k.offset - k.anchor).tolist() for k in links],
            "linkInertialFrameOrientations": [_xyzw(_axes(piece)) for piece in links],
            "linkParentIndices": parents,
            "linkJointTypes": [kinds[m.kind] if m else p.JOINT_FIXED for m in moved],
            "linkJointAxis": [unit(m.axis).tolist() if m and m.kind in (SLIDE, TURN) else O for m in moved],
        }

    def _settle(self, body: int, j: int, piece: Piece) -> None:
        """Set inertia and initial velocity of a link, and switch its motor off."""
        p, kind = self.p, piece.mobility.kind if piece.mobility else ""
        moments = np.linalg.eigvalsh(piece.inertia)
        p.changeDynamics(body, j, localInertiaDiagonal=moments.tolist())
        kept = p.getDynamicsInfo(body, j)[2]
        if not np.allclose(kept, moments, rtol=1e-12, atol=0.0):
            raise AssertionError(f"PyBullet keeps the moments of inertia {kept} instead of {moments}")
        if piece.link >= 0:
            self.places[piece.link] = Place(body, j, piece.offset, _axes(piece))
        if kind == BALL_JOINT:
            p.setJointMotorControlMultiDof(body, j, p.POSITION_CONTROL, targetPosition=UNIT, force=O)
            # the frame of a ball joint has the principal axes
            spin = _axes(piece).T @ self.rates[piece.velocity :][:3]
            p.resetJointStateMultiDof(body, j, UNIT, spin.tolist())
        elif kind in (SLIDE, TURN):
            p.setJointMotorControl2(body, j, p.VELOCITY_CONTROL, force=0.0)
            p.resetJointState(body, j, 0.0, float(self.rates[piece.velocity]))
            self.joints[piece.velocity] = (body, j)

    def _close(self, closure: Closure) -> None:
        p, links = self.p, closure.links
        first, second = links if links[0] != GROUND_LINK else links[::-1]
        weld = closure.kind == "weld"
        points = [closure.anchor] if weld else held_points(self.scene, closure)
        frames = [_xyzw(self.places[k].axes.T) for k in (first, second)] if weld else []
        for point in points:
            one, other = self._end(first, point), self._end(second, point)
            kind = p.JOINT_FIXED if weld else p.JOINT_POINT2POINT
            c = p.createConstraint(*one[0], *other[0], kind, O, one[1], other[1], *frames)
            p.changeConstraint(c, maxForce=STRONGEST)

    def _couple(self, coupling: Coupling) -> None:
        """Couple the rates of two joints: PyBullet's gear keeps q₁' + (gear ratio) q₂' = 0."""
        first, second = (self.joints[i] for i in self.tree.coupled(self.scene, coupling))
        gear = self.p.createConstraint(*first, *second, self.p.JOINT_GEAR, [0.0, 0.0, 1.0], O, O)
        self.p.changeConstraint(gear, gearRatio=-1 / coupling.gear_ratio, maxForce=STRONGEST)

    def _end(self, link: int, point: np.ndarray) -> tuple[tuple[int, int], list[float]]:
        """Return multibody and link, and a point (world at t = 0) in the frame of the link's centre of
        mass."""
        if link == GROUND_LINK:
            return (-1, -1), point.tolist()
        place, tree = self.places[link], self.tree.links[link]
        return (place.body, place.link), (place.axes.T @ (point - tree.position - place.offset)).tolist()

    def motion(self) -> LinkMotion:
        """Return the motion of the links."""
        found = [self._state(self.places[k]) for k in range(len(self.tree.links))]
        rotation, position, velocity, omega = (np.array(part) for part in zip(*found, strict=True))
        coordinates, rates = np.zeros((2, self.tree.nv))
        for v, (body, j) in self.joints.items():
            coordinates[v], rates[v] = self.p.getJointState(body, j)[:2]
        return LinkMotion(rotation, position, velocity, omega, coordinates, rates)

    def _state(self, place: Place) -> tuple[np.ndarray, ...]:
        if place.link == BASE:
            centre, turn = self.p.getBasePositionAndOrientation(place.body)
            velocity, omega = self.p.getBaseVelocity(place.body)
        else:
            state = self.p.getLinkState(place.body, place.link, 1, 1)
            centre, turn, velocity, omega = state[0], state[1], state[6], state[7]
        rotation = rotations.to_matrix(np.roll(turn, 1)) @ place.axes.T
        arm = rotation @ place.offset
        return rotation, np.array(centre) - arm, np.array(velocity) - np.cross(omega, arm), np.array(omega)


def _axes(piece: Piece) -> np.ndarray:
    """Return the principal axes (3, 3) of a piece, right-handed, in the order of increasing moments."""
    axes = np.linalg.eigh(piece.inertia)[1]
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return axes


def _xyzw(matrix: np.ndarray) -> list[float]:
    return np.roll(rotations.from_matrix(matrix), -1).tolist()
