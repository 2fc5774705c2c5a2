"""DART's readers of URDF, SDF and MJCF."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engines.loaders.loader import MJCF, SDF, URDF, Loaded, Loader
from crosscheck.engines.loaders.machine import (
    FIXED,
    REVOLUTE,
    SCALAR,
    TRANSLATIONAL,
    UNLIMITED_IN_SDF,
    WORLD,
    Body,
    Coupling,
    Joint,
    Loop,
    Machine,
    Statics,
    Vector,
    coefficients,
    limits,
    matrix,
    vector,
)
from crosscheck.engines.loaders.placing import Place
from crosscheck.engines.loaders.posed import Pose

TYPES = {
    "WeldJoint": FIXED,
    "RevoluteJoint": REVOLUTE,
    "PrismaticJoint": TRANSLATIONAL,
    "FreeJoint": "free",
    "BallJoint": "spherical",
    "UniversalJoint": "universal",
    "PlanarJoint": "planar",
    "ScrewJoint": "screw",
}
INSTANT = 1e-12  # s; dampers and springs act at the end of a step
LOOPS = {
    "WeldJointConstraint": FIXED,
    "BallJointConstraint": "spherical",
    "RevoluteJointConstraint": REVOLUTE,
}


class Dart(Loader):
    """DART's readers with default options, except that the root link of a URDF is fixed."""

    name = "dart"
    package = "dartpy"
    version = "6.20.0"
    formats = (URDF, SDF, MJCF)
    convention = "a URDF's root link is fixed to the world by RootJointType.FIXED"

    def load(self, path: Path, form: str) -> Loaded:
        """Read the skeletons of the file; raises ValueError if DART returns none."""
        import dartpy

        if form == URDF:
            options = dartpy.utils.DartLoader.Options()
            options.mDefaultRootJointType = dartpy.utils.DartLoader.RootJointType.FIXED
            reader = dartpy.utils.DartLoader()
            reader.setOptions(options)
            skeleton = reader.parseSkeleton(str(path))
            skeletons, world = [skeleton] if skeleton else [], None
        else:
            world = {SDF: dartpy.utils.SdfParser, MJCF: dartpy.utils.MjcfParser}[form].readWorld(str(path))
            number = world.getNumSkeletons() if world else 0
            skeletons = [world.getSkeleton(k) for k in range(number)]
        if not skeletons:
            raise ValueError("DART returns no skeleton")
        return Skeletons(dartpy, skeletons, world)


class Skeletons(Loaded):
    """Skeletons where all coordinates are 0, in a world or without one."""

    def __init__(self, dart: Any, skeletons: list[Any], world: Any):
        self.dart, self.skeletons, self.world = dart, skeletons, world
        self.joints = [s.getJoint(k) for s in skeletons for k in range(s.getNumJoints())]
        self.nodes = [s.getBodyNode(k) for s in skeletons for k in range(s.getNumBodyNodes())]
        self.start = [np.array(s.getPositions()) for s in skeletons]
        self.messages = tuple(self._moved())

    def machine(self) -> Machine:
        return Machine(
            bodies=tuple(map(self._body, self.nodes)),
            joints=tuple(map(self._joint, self.joints)),
            loops=tuple(self._loops()),
            couplings=tuple(self._couplings()),
            gravity=None if self.world is None else vector(self.world.getGravity()),
            messages=self.messages,
        )

    def _moved(self) -> Iterator[str]:
        """Put all coordinates to 0; yield a message for a joint that DART starts elsewhere."""
        for joint in self.joints:
            if joint.getNumDofs() == 1:
                if start := joint.getPosition(0):
                    yield f"starts at {start:.6g} of joint {joint.getName()!r}, between its limits"
                joint.setPosition(0, 0.0)

    def _at(self, node: Any) -> Place:
        frame = node.getWorldTransform()
        return Place(np.array(frame.translation()), np.array(frame.rotation()))

    def _body(self, node: Any) -> Body:
        inertia = node.getInertia()
        moments = inertia.getMoment()
        return self._at(node).body(node.getName(), inertia.getMass(), inertia.getLocalCOM(), moments)

    def _joint(self, joint: Any) -> Joint:
        node, parent = joint.getChildBodyNode(), joint.getParentBodyNode()
        frame = joint.getTransformFromChildBodyNode()
        at = self._at(node).then(Place(np.array(frame.translation()), np.array(frame.rotation())))
        is_still = not joint.getSkeleton().isMobile()
        kind = FIXED if is_still else TYPES.get(joint.getType(), joint.getType())
        pair = parent.getName() if parent else WORLD, node.getName()
        name, anchor = joint.getName(), vector(at.position)
        if kind == "planar":
            return Joint(name, kind, pair, anchor, at.direction(joint.getRotationalAxis()))
        if kind == "screw":
            axis = at.direction(joint.getAxis())
            return Joint(name, kind, pair, anchor, axis, pitch=float(joint.getPitch()))
        if kind not in SCALAR:
            return Joint(name, kind, pair, anchor)
        stiffness = coefficients(0.0, joint.getSpringStiffness(0))[1:]
        return Joint(
            name,
            kind,
            pair,
            anchor,
            at.direction(joint.getAxis()),
            damping=coefficients(joint.getDampingCoefficient(0)),
            stiffness=stiffness,
            rest=float(joint.getRestPosition(0)) if stiffness else None,
            armature=0.0,
            friction=float(joint.getCoulombFriction(0)),
            reference=0.0,
            **limits(joint.getPositionLowerLimit(0), joint.getPositionUpperLimit(0), UNLIMITED_IN_SDF),
        )

    def _loops(self) -> Iterator[Loop]:
        """Yield the world's constraints between bodies, whose bodies and anchors Python cannot ask."""
        if self.world is None:
            return
        solver = self.world.getConstraintSolver()
        for k in range(solver.getNumConstraints()):
            kind = type(solver.getConstraint(k)).__name__
            yield Loop("", LOOPS.get(kind, kind), ("", ""))

    def _couplings(self) -> Iterator[Coupling]:
        mimic = self.dart.dynamics.ActuatorType.MIMIC
        for joint in self.joints:
            if joint.getNumDofs() == 1 and joint.getActuatorType() == mimic:
                yield Coupling(joint.getName(), joint.getName(), "", ())  # Python has no access to the law

    def accelerations(self, pose: Pose, rates: Pose, gravity: Vector) -> dict[str, float]:
        if any(True for _ in (*self._loops(), *self._couplings())):
            raise NotImplementedError("DART has constraints in steps alone")
        self._put(pose, rates)
        for skeleton in self.skeletons:
            skeleton.setGravity(np.array(gravity))
            skeleton.setTimeStep(INSTANT)
            skeleton.computeForwardDynamics()
        return {joint.getName(): float(joint.getAcceleration(0)) for joint in self._single()}

    def motion(
        self, pose: Pose, rates: Pose, gravity: Vector, duration: float, step: float
    ) -> dict[str, float]:
        """Simulate the file's world, or a world for the skeleton of a URDF."""
        world = self.world or self.dart.simulation.World()
        if self.world is None and not world.getNumSkeletons():
            for skeleton in self.skeletons:
                world.addSkeleton(skeleton)
        self._put(pose, rates)
        for joint in self._single():
            joint.setLimitEnforcement(False)
            joint.setCoulombFriction(0, 0.0)
        for node in self.nodes:
            node.setCollidable(False)
        world.setGravity(np.array(gravity))
        world.setTimeStep(step)
        for _ in range(round(duration / step)):
            world.step()
        return {joint.getName(): float(joint.getPosition(0)) for joint in self._single()}

    def _single(self) -> list[Any]:
        return [joint for joint in self.joints if joint.getNumDofs() == 1]

    def _put(self, pose: Pose, rates: Pose) -> None:
        for skeleton, start in zip(self.skeletons, self.start, strict=True):
            skeleton.setPositions(start)
            skeleton.setVelocities(0.0 * start)
        for joint in self._single():
            joint.setPosition(0, pose.get(joint.getName(), 0.0))
            joint.setVelocity(0, rates.get(joint.getName(), 0.0))

    def statics(self, pose: Pose, gravity: Vector) -> Statics:
        self._put(pose, {})
        names, places, size = list[str](), list[int](), sum(s.getNumDofs() for s in self.skeletons)
        mass, torque, start = np.zeros((size, size)), np.zeros(size), 0
        for skeleton in self.skeletons:
            skeleton.setGravity(np.array(gravity))
            skeleton.setVelocities(np.zeros(skeleton.getNumDofs()))
            end = start + skeleton.getNumDofs()
            mass[start:end, start:end] = skeleton.getMassMatrix()
            torque[start:end] = skeleton.getGravityForces()
            for joint in (skeleton.getJoint(k) for k in range(skeleton.getNumJoints())):
                if TYPES.get(joint.getType()) in SCALAR:
                    names.append(joint.getName())
                    places.append(start + joint.getIndexInSkeleton(0))
            start = end
        centres = {node.getName(): vector(node.getCOM()) for node in self.nodes}
        return Statics(tuple(names), matrix(mass[np.ix_(places, places)]), vector(torque[places]), centres)
