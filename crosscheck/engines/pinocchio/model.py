"""A scene's spanning tree as a Pinocchio model: joints, closures, drivers and loads.

Every joint frame has its origin at the joint's anchor and world-aligned axes at t = 0, so the neutral
configuration is the scene's.  Joints are added depth first: in any other order Pinocchio's Cholesky
factorisation is wrong without a message.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from crosscheck.engines.shared.driver_motion import motion
from crosscheck.engines.shared.everything import EVERYTHING
from crosscheck.engines.shared.initial_velocities import initial_rates, twist_maps
from crosscheck.engines.shared.spanning_tree import (
    BALL_JOINT,
    FREE,
    GROUND_LINK,
    SLIDE,
    TURN,
    Closure,
    Link,
    Mobility,
    Tree,
    spanning_tree,
)
from crosscheck.engines.shared.spring_force import spring_force
from mbref.scene import Force, JointLoad, Moment, PointDamper, RotationalDamper, Scene, Spring
from mbref.scene.loads import Action

# the engine refuses couplings with a reason
SUPPORTS = replace(EVERYTHING, over_time=(), massless_links=True)
# kg m² or kg; armature of a driven coordinate, so large that only its own torque moves it
DRIVEN_ARMATURE = 1e18


class Mechanism:
    """A scene in Pinocchio: ``model``, ``closures`` (RigidConstraintModels), and its state at t = 0.

    For each link, ``joint`` is the Pinocchio joint that carries it, and ``origin`` the position (world, t =
    0) of that joint's frame.
    """

    def __init__(self, scene: Scene):
        import pinocchio as pin

        self.pin, self.scene = pin, scene
        self.tree = spanning_tree(scene)
        self.model = pin.Model()
        self.model.gravity = pin.Motion(np.array(scene.gravity), np.zeros(3))
        self.joint: list[int] = []
        self.motions: list[Mobility] = []  # elementary motions of Pinocchio's joints
        self.origin: dict[int, np.ndarray] = {0: np.zeros(3)}
        for k, link in enumerate(self.tree.links):
            self._add(k, link)
        models = [(k, self._closure(closure)) for k, closure in enumerate(self.tree.closures)]
        self.closed = [k for k, model in models if model is not None]  # indices of the tree's closures
        self.closures: list[Any] = [model for _, model in models if model is not None]
        self.driven = self.tree.driven(scene)
        self._make_heavy([i for i, _ in self.driven])
        joints = self.model.joints
        simple = [joints[j] for j in range(1, self.model.njoints) if joints[j].nq == 1]
        self.q_of_v = {joint.idx_v: joint.idx_q for joint in simple}
        self.q0 = pin.neutral(self.model)
        self.v0 = initial_rates(scene, self.tree)

    def _add(self, k: int, link: Link) -> None:
        pin, model = self.pin, self.model
        joint = self.joint[link.parent] if link.parent != GROUND_LINK else 0
        for i, motions in enumerate(_joint_models(pin, link)):
            placement = pin.SE3(np.eye(3), link.anchor - self.origin[joint])
            joint = model.addJoint(joint, motions, placement, f"{k}.{i}")
            self.origin[joint] = link.anchor
        self.motions += link.mobilities
        lever = link.position + link.offset - self.origin[joint]
        model.appendBodyToJoint(joint, pin.Inertia(link.mass, lever, link.inertia), pin.SE3.Identity())
        self.joint.append(joint)

    def _closure(self, closure: Closure) -> Any | None:
        """Return the RigidConstraintModel of a closure; None if one joint carries both links."""
        pin = self.pin
        joints = [self.joint[k] if k != GROUND_LINK else 0 for k in closure.links]
        if joints[0] == joints[1]:
            return None
        kind = pin.ContactType.CONTACT_3D if closure.kind == "point" else pin.ContactType.CONTACT_6D
        first, second = (pin.SE3(np.eye(3), closure.anchor - self.origin[j]) for j in joints)
        return pin.RigidConstraintModel(
            kind, self.model, joints[0], first, joints[1], second, pin.ReferenceFrame.LOCAL
        )

    def _make_heavy(self, coordinates: list[int]) -> None:
        armature = self.model.armature.copy()
        for i, inertia in self.tree.armatures(self.scene):
            armature[i] = inertia
        armature[coordinates] = DRIVEN_ARMATURE
        self.model.armature = armature

    def frame(self, link: int) -> tuple[int, np.ndarray]:
        """Return the joint that carries a link (or the ground), and the position (3,) of the link's frame in
        the joint's frame."""
        if link == GROUND_LINK:
            return 0, np.zeros(3)
        joint = self.joint[link]
        return joint, self.tree.links[link].position - self.origin[joint]

    def coordinates(self, q: np.ndarray) -> np.ndarray:
        """Return coordinates (nv,) in the order of the velocities; zero for joints without angles."""
        coordinates = np.zeros(self.model.nv)
        for iv, iq in self.q_of_v.items():
            coordinates[iv] = q[iq]
        return coordinates


def _joint_models(pin: Any, link: Link) -> list[Any]:
    """Return the chain of Pinocchio joints that carries a link."""
    of_kind = {
        SLIDE: pin.JointModelPrismaticUnaligned,
        TURN: pin.JointModelRevoluteUnaligned,
        BALL_JOINT: lambda axis: pin.JointModelSpherical(),
        FREE: lambda axis: pin.JointModelFreeFlyer(),
    }
    return [of_kind[mobility.kind](mobility.axis) for mobility in link.mobilities]


@dataclass(frozen=True)
class _PointForce:
    """A constant world force at a point of a joint's frame."""

    joint: int
    point: Any  # SE3
    force: np.ndarray


class Loads:
    """Generalised forces of a scene's loads, and of its driven coordinates with large armatures.

    Constant loads (along a joint, or a moment on a body that turns about one direction) are evaluated once.
    All other loads are converted to joint torques by Pinocchio's function for static torques, on a model
    without gravity.
    """

    def __init__(self, mechanism: Mechanism):
        pin = self.pin = mechanism.pin
        self.mechanism = mechanism
        self.model = mechanism.model.copy()
        self.model.gravity = pin.Motion.Zero()
        self.data = self.model.createData()
        self.constant = np.zeros(self.model.nv)
        self.moments: list[tuple[int, np.ndarray]] = []
        self.forces: list[_PointForce] = []
        self.springs: list[tuple[Spring, list[tuple[int, Any]]]] = []
        self.turners: list[tuple[float, list[int]]] = []
        self.dampers: list[tuple[float, int, tuple[int, Any]]] = []
        self.joint_springs: list[tuple[int, int, Action]] = []  # indices of q and v
        self.evaluated: list[Any] = []  # loads whose torques depend on the position
        maps = twist_maps(mechanism.tree)
        for load in mechanism.scene.load:
            self._add(load, maps)
        self.fixed = not self.evaluated

    def _add(self, load: Any, maps: np.ndarray) -> None:
        mechanism, scene = self.mechanism, self.mechanism.scene
        if isinstance(load, Moment):
            body = scene.body_index(load.body)
            link = mechanism.tree.link_of(body)
            if _turns_about_one_direction(mechanism.tree, link):
                self.constant += maps[link, 3:].T @ np.array(load.moment)
            else:
                self.evaluated.append(load)
                self.moments.append((mechanism.joint[link], np.array(load.moment)))
        elif isinstance(load, Force):
            self.evaluated.append(load)
            joint, point = self._point(scene.body_index(load.body), load.point)
            self.forces.append(_PointForce(joint, point, np.array(load.force)))
        elif isinstance(load, Spring):
            self.evaluated.append(load)
            pairs = zip(load.bodies, load.points, strict=True)
            self.springs.append((load, [self._point(scene.body_index(b), p) for b, p in pairs]))
        elif isinstance(load, RotationalDamper):
            self.evaluated.append(load)
            links = (mechanism.tree.link_of(scene.body_index(b)) for b in load.bodies)
            self.turners.append((load.damping, [mechanism.frame(link)[0] for link in links]))
        elif isinstance(load, PointDamper):
            self.evaluated.append(load)
            ends = [self._point(scene.body_index(b), load.point) for b in load.bodies]
            self.dampers.append((load.damping, ends[0][0], ends[1]))
        elif isinstance(load, JointLoad):
            i, action = mechanism.tree.coordinate(scene, load.joint, load.coordinate), load.action
            self.constant[i] += action.amount
            if action.stiffness or action.damping:
                self.joint_springs.append((mechanism.q_of_v[i], i, action))

    def _point(self, body: int, point: Any) -> tuple[int, Any]:
        joint, _ = self.mechanism.frame(self.mechanism.tree.link_of(body))
        return joint, self.pin.SE3(np.eye(3), np.array(point) - self.mechanism.origin[joint])

    def torques(self, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return generalised forces (nv,) at time t (s), configuration q and velocity v."""
        tau = self.constant.copy()
        for iq, iv, spring in self.joint_springs:
            tau[iv] -= spring.stiffness * (q[iq] - spring.natural) + spring.damping * v[iv]
        if not self.fixed:
            tau -= self.pin.computeStaticTorque(self.model, self.data, q, self._external(q, v))
        for i, driver in self.mechanism.driven:
            tau[i] = DRIVEN_ARMATURE * motion(driver, t)[2]
        return tau

    def _external(self, q: np.ndarray, v: np.ndarray) -> Any:
        """Return the forces on the joints' frames, each in its own axes."""
        pin, data = self.pin, self.data
        pin.forwardKinematics(self.model, data, q, v)
        external = pin.StdVec_Force()
        external.extend([pin.Force.Zero()] * self.model.njoints)
        for joint, moment in self.moments:
            external[joint] += pin.Force(np.zeros(3), data.oMi[joint].rotation.T @ moment)
        for load in self.forces:
            external[load.joint] += self._pull(load.joint, load.point, load.force)
        for spring, ends in self.springs:
            force = self._tension(spring, ends)
            for (joint, point), sign in zip(ends, (1.0, -1.0), strict=True):
                external[joint] += self._pull(joint, point, sign * force)
        frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        for damping, joints in self.turners:
            first, second = (pin.getVelocity(self.model, data, j, frame).angular for j in joints)
            for joint, sign in zip(joints, (damping, -damping), strict=True):
                moment = sign * data.oMi[joint].rotation.T @ (second - first)
                external[joint] += pin.Force(np.zeros(3), moment)
        for damping, first, (second, point) in self.dampers:
            place = data.oMi[second].act(point.translation)
            same = pin.SE3(np.eye(3), data.oMi[first].actInv(place))  # the place on the first joint's frame
            places = [(first, same), (second, point)]
            rates = [pin.getFrameVelocity(self.model, data, *end, frame).linear for end in places]
            for end, sign in zip(places, (damping, -damping), strict=True):
                external[end[0]] += self._pull(*end, sign * (rates[1] - rates[0]))
        return external

    def _pull(self, joint: int, point: Any, force: np.ndarray) -> Any:
        rotation = self.data.oMi[joint].rotation
        return point.act(self.pin.Force(rotation.T @ force, np.zeros(3)))

    def _tension(self, spring: Spring, ends: list[tuple[int, Any]]) -> np.ndarray:
        """Return the world force (3,) of a spring on its first body."""
        pin, data = self.pin, self.data
        frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        first, second = (data.oMi[j].act(point.translation) for j, point in ends)
        rates = [pin.getFrameVelocity(self.model, data, j, point, frame).linear for j, point in ends]
        return spring_force(spring, second - first, rates[1] - rates[0])


def _turns_about_one_direction(tree: Tree, link: int) -> bool:
    """Return whether every rotation between the ground and a link is about parallel axes."""
    axes: list[np.ndarray] = []
    while link != GROUND_LINK:
        mobilities = tree.links[link].mobilities
        if any(mobility.kind in (BALL_JOINT, FREE) for mobility in mobilities):
            return False
        axes += [mobility.axis for mobility in mobilities if mobility.kind == TURN]
        link = tree.links[link].parent
    return all(abs(a @ axes[0]) > 1 - 1e-14 for a in axes)
