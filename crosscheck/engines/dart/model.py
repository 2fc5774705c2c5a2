"""A scene's spanning tree as a DART skeleton: bodies, joints of one degree of freedom each, closures.

Every body frame has the link's origin and world-aligned axes at t = 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crosscheck.engines.shared.elementary_joints import Piece, assembled
from crosscheck.engines.shared.fixed_steps import held_points
from crosscheck.engines.shared.initial_velocities import initial_rates
from crosscheck.engines.shared.joint_coordinates import joint_coordinates, rotation_vector
from crosscheck.engines.shared.spanning_tree import BALL_JOINT, FREE, GROUND_LINK, SLIDE, TURN, Closure, Tree
from crosscheck.engines.shared.terms import Terms
from crosscheck.engines.shared.tree_reactions import LinkMotion
from mbref.rotations import unit
from mbref.scene import Scene

NEGLIGIBLE = 1e-24  # mass of auxiliary bodies in chains of joints / mass of the links
PAIRS = {SLIDE: "Prismatic", TURN: "Revolute", BALL_JOINT: "Ball", FREE: "Free"}


class Mechanism:
    """A scene in DART: ``skeleton``, the ``nodes`` of the tree's links, and the state at t = 0."""

    def __init__(self, scene: Scene, tree: Tree):
        import dartpy

        self.dart, self.scene, self.tree = dartpy, scene, tree
        self.coordinates = joint_coordinates(tree, in_child=True)
        self.skeleton = dartpy.dynamics.Skeleton(scene.name)
        self.nodes, self.joints = assembled(tree, NEGLIGIBLE, None, self._add)
        self.skeleton.setGravity(np.array(scene.gravity))
        self.order = self._order()
        self.skeleton.setVelocities(self._in_order(initial_rates(scene, tree)))

    def _in_order(self, v: np.ndarray) -> np.ndarray:
        found = np.empty_like(v)
        found[self.order] = v
        return found

    def _order(self) -> np.ndarray:
        """Return DART's index of every velocity of the tree; DART has angular before linear velocities."""
        order = np.arange(self.tree.nv)
        for _, iv in self.coordinates.places:
            order[iv : iv + 6] = [*range(iv + 3, iv + 6), *range(iv, iv + 3)]
        return order

    def _add(
        self, name: str, piece: Piece, parent: Any, on_parent: np.ndarray, on_child: np.ndarray
    ) -> tuple[Any, Any]:
        kind = PAIRS[piece.mobility.kind] if piece.mobility else "Weld"
        joint, node = getattr(self.skeleton, f"create{kind}JointAndBodyNodePair")(parent)
        if piece.mobility and piece.mobility.kind in (SLIDE, TURN):
            joint.setAxis(unit(piece.mobility.axis))
        joint.setTransformFromParentBodyNode(self._place(on_parent))
        joint.setTransformFromChildBodyNode(self._place(on_child))
        node.setCollidable(False)
        node.setInertia(self.dart.dynamics.Inertia(piece.mass, piece.offset, piece.inertia))
        return joint, node

    def _place(self, place: np.ndarray) -> Any:
        frame = self.dart.math.Isometry3()
        frame.set_translation(place)
        return frame

    def constraints(self, closure: Closure, as_balls: bool) -> list[Any]:
        """Return DART's constraints of a closure; with ``as_balls`` a hinge becomes two ball constraints on
        its axis."""
        constraint, anchor = self.dart.constraint, closure.anchor
        pair = [self.nodes[k] for k in closure.links if k != GROUND_LINK]
        if closure.kind == "weld":
            return [constraint.WeldJointConstraint(*pair)]
        if closure.kind == "point" or as_balls:
            points = held_points(self.scene, closure)
            return [constraint.BallJointConstraint(*pair, point) for point in points]
        axis = unit(self.scene.joint[closure.joint].directions[0])
        return [constraint.RevoluteJointConstraint(*pair, anchor, *[axis] * len(pair))]

    def terms(self, q: np.ndarray, v: np.ndarray) -> Terms:
        """Return DART's terms of the equations, with velocities in the tree's order."""
        self._put(q, v)
        skeleton, order = self.skeleton, self.order
        skeleton.setAccelerations(np.zeros(self.tree.nv))
        jacobian = np.zeros((len(self.nodes), 6, self.tree.nv))
        drift = np.zeros((len(self.nodes), 6))
        for k, node in enumerate(self.nodes):
            own = [node.getDependentGenCoordIndex(i) for i in range(node.getNumDependentGenCoords())]
            jacobian[k][:, own] = np.vstack([node.getLinearJacobian(), node.getAngularJacobian()])
            drift[k] = np.concatenate([node.getLinearAcceleration(), node.getAngularAcceleration()])
        mass = skeleton.getMassMatrix()[np.ix_(order, order)]
        bias = skeleton.getCoriolisAndGravityForces()[order]
        return Terms(mass, bias, *self._poses(), jacobian[:, :, order], drift)

    def _put(self, q: np.ndarray, v: np.ndarray) -> None:
        at, positions = self.coordinates, np.empty(self.tree.nv)
        positions[at.single] = q[at.single_q]
        for iq, iv in at.quaternions:
            positions[iv : iv + 3] = rotation_vector(q[iq : iq + 4])
        for iq, iv in at.places:  # DART's coordinates begin with the rotation vector
            positions[iv : iv + 6] = [*positions[iv + 3 : iv + 6], *q[iq : iq + 3]]
        self.skeleton.setPositions(positions)
        self.skeleton.setVelocities(self._in_order(v))

    def _poses(self) -> tuple[np.ndarray, np.ndarray]:
        frames = [node.getWorldTransform() for node in self.nodes]
        return np.array([f.rotation() for f in frames]), np.array([f.translation() for f in frames])

    def motion(self) -> LinkMotion:
        """Return the motion of the links."""
        single, coordinates = self.coordinates.single, np.zeros(self.tree.nv)
        coordinates[single] = self.skeleton.getPositions()[single]
        linear = np.array([node.getLinearVelocity() for node in self.nodes])
        angular = np.array([node.getAngularVelocity() for node in self.nodes])
        rates = self.skeleton.getVelocities()[self.order]
        return LinkMotion(*self._poses(), linear, angular, coordinates, rates)
