"""A scene's spanning tree as a MultibodyPlant of Drake: bodies, joints of one degree of freedom each,
closures.

Every body frame has the link's origin and world-aligned axes at t = 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crosscheck.engines.shared.elementary_joints import Piece, assembled
from crosscheck.engines.shared.fixed_steps import held_points
from crosscheck.engines.shared.initial_velocities import initial_rates
from crosscheck.engines.shared.joint_coordinates import joint_coordinates
from crosscheck.engines.shared.spanning_tree import BALL_JOINT, FREE, SLIDE, TURN, Closure, Tree
from crosscheck.engines.shared.terms import Terms
from crosscheck.engines.shared.tree_reactions import LinkMotion
from mbref import rotations
from mbref.rotations import unit
from mbref.scene import Scene

NEGLIGIBLE = 1e-24  # mass of auxiliary bodies in chains of joints / mass of the links
ANGULAR_FIRST = [3, 4, 5, 0, 1, 2]  # order of Drake's components of a twist


class Mechanism:
    """A scene in Drake: the ``plant``, its ``context``, and the ``bodies`` of the tree's links.

    With a ``time_step`` of 0 the plant is continuous and has no closures.
    """

    def __init__(self, scene: Scene, tree: Tree, time_step: float = 0.0, contact: str = ""):
        from pydrake import math
        from pydrake.multibody import plant
        from pydrake.multibody import tree as parts

        self.math, self.parts, self.scene, self.tree = math, parts, scene, tree
        self.coordinates = joint_coordinates(tree, in_child=False)
        self.plant = plant.MultibodyPlant(time_step)
        if contact:
            kinds = plant.DiscreteContactApproximation
            self.plant.set_discrete_contact_approximation(getattr(kinds, f"k{contact.capitalize()}"))
        if time_step:
            self.plant.SetUseSampledOutputPorts(False)  # so that an update computes discrete states only
        self.plant.mutable_gravity_field().set_gravity_vector(scene.gravity)
        self.bodies, self.joints = assembled(tree, NEGLIGIBLE, self.plant.world_body(), self._add)
        if time_step:
            self._constrain()
        self.plant.Finalize()
        self.context = self.plant.CreateDefaultContext()
        self._number()
        self.put(self.coordinates.start(), initial_rates(scene, tree))

    def _constrain(self) -> None:
        """Add closures, couplings and armatures, the parts of a discrete plant."""
        for closure in self.tree.closures:
            self._close(closure)
        for coupling in self.scene.coupling:
            first, second = (self.joints[i] for i in self.tree.coupled(self.scene, coupling))
            self.plant.AddCouplerConstraint(second, first, coupling.gear_ratio)
        for i, inertia in self.tree.armatures(self.scene):
            self.plant.AddJointActuator(str(i), self.joints[i]).set_default_rotor_inertia(inertia)

    def _add(
        self, name: str, piece: Piece, parent: Any, on_parent: np.ndarray, on_child: np.ndarray
    ) -> tuple[Any, Any]:
        body = self.plant.AddRigidBody(name, self._inertia(piece))
        frames = [
            self.plant.AddFrame(
                self.parts.FixedOffsetFrame(f"{name} {end}", of.body_frame(), self._at(place))
            )
            for end, of, place in (("parent", parent, on_parent), ("child", body, on_child))
        ]
        return self.plant.AddJoint(self._joint(name, piece, frames)), body

    def _inertia(self, piece: Piece) -> Any:
        c = piece.offset
        i = piece.inertia / piece.mass + (c @ c) * np.eye(3) - np.outer(c, c)
        of_unit = self.parts.UnitInertia(i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2])
        return self.parts.SpatialInertia(piece.mass, c, of_unit, skip_validity_check=True)

    def _joint(self, name: str, piece: Piece, frames: list[Any]) -> Any:
        parts, mobility = self.parts, piece.mobility
        if mobility is None:
            return parts.WeldJoint(name, *frames, self._at(np.zeros(3)))
        if mobility.kind in (BALL_JOINT, FREE):
            kind = parts.BallRpyJoint if mobility.kind == BALL_JOINT else parts.QuaternionFloatingJoint
            return kind(name, *frames)
        kind = {SLIDE: parts.PrismaticJoint, TURN: parts.RevoluteJoint}[mobility.kind]
        return kind(name, *frames, unit(mobility.axis))

    def _at(self, place: np.ndarray) -> Any:
        return self.math.RigidTransform(place)

    def _close(self, closure: Closure) -> None:
        first, second = (self.bodies[k] for k in closure.links)
        starts = [self.tree.links[k].position for k in closure.links]
        if closure.kind == "weld":
            places = [self._at(closure.anchor - start) for start in starts]
            self.plant.AddWeldConstraint(first, places[0], second, places[1])
            return
        for point in held_points(self.scene, closure):
            self.plant.AddBallConstraint(first, point - starts[0], second, point - starts[1])

    def _number(self) -> None:
        """Store Drake's indices of the tree's positions and velocities."""
        at, joints = self.coordinates, self.joints
        self.v_index = np.zeros(self.tree.nv, dtype=int)
        for iv, joint in joints.items():
            span = np.arange(joint.num_velocities()) + joint.velocity_start()
            self.v_index[iv : iv + len(span)] = span[ANGULAR_FIRST] if len(span) == 6 else span
        self.q_single = np.array([joints[int(v)].position_start() for v in at.single], dtype=int)
        self.q_free = [(joints[iv].position_start(), iq) for iq, iv in at.places]
        self.q_ball = [(joints[iv].position_start(), iq) for iq, iv in at.quaternions if iv in joints]

    def put(self, q: np.ndarray, v: np.ndarray) -> None:
        """Set the state to positions and velocities of the tree."""
        found, rates = np.zeros(self.plant.num_positions()), np.empty_like(v)
        found[self.q_single] = q[self.coordinates.single_q]
        for start, iq in self.q_ball:
            turned = self.math.RotationMatrix(rotations.to_matrix(q[iq : iq + 4]))
            found[start : start + 3] = self.math.RollPitchYaw(turned).vector()
        for start, iq in self.q_free:
            found[start : start + 7] = [*q[iq + 3 : iq + 7], *q[iq : iq + 3]]
        rates[self.v_index] = v
        self.plant.SetPositions(self.context, found)
        self.plant.SetVelocities(self.context, rates)

    def terms(self, q: np.ndarray, v: np.ndarray) -> Terms:
        """Return Drake's terms of the equations, with velocities in the tree's order."""
        self.put(q, v)
        plant, context, world = self.plant, self.context, self.plant.world_frame()
        by_v, at = self.parts.JacobianWrtVariable.kV, self.v_index
        jacobian = np.zeros((len(self.bodies), 6, self.tree.nv))
        drift = np.zeros((len(self.bodies), 6))
        for k, body in enumerate(self.bodies):
            of = context, by_v, body.body_frame(), np.zeros(3), world, world
            jacobian[k] = plant.CalcJacobianSpatialVelocity(*of)[ANGULAR_FIRST]
            left = plant.CalcBiasSpatialAcceleration(*of)
            drift[k] = [*left.translational(), *left.rotational()]
        mass = plant.CalcMassMatrix(context)[np.ix_(at, at)]
        bias = plant.CalcBiasTerm(context) - plant.CalcGravityGeneralizedForces(context)
        return Terms(mass, bias[at], *self._poses(), jacobian[:, :, at], drift)

    def _poses(self) -> tuple[np.ndarray, np.ndarray]:
        frames = [self.plant.EvalBodyPoseInWorld(self.context, body) for body in self.bodies]
        return np.array([f.rotation().matrix() for f in frames]), np.array([f.translation() for f in frames])

    def motion(self) -> LinkMotion:
        """Return the motion of the links."""
        plant, context, coordinates = self.plant, self.context, np.zeros(self.tree.nv)
        found = [plant.EvalBodySpatialVelocityInWorld(context, body) for body in self.bodies]
        linear, angular = np.array([[v.translational(), v.rotational()] for v in found]).swapaxes(0, 1)
        coordinates[self.coordinates.single] = plant.GetPositions(context)[self.q_single]
        rates = plant.GetVelocities(context)[self.v_index]
        return LinkMotion(*self._poses(), linear, angular, coordinates, rates)
