"""Drake's readers of URDF, SDF and MJCF."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
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
    "weld": FIXED,
    "revolute": REVOLUTE,
    "continuous": REVOLUTE,
    "prismatic": TRANSLATIONAL,
    "ball_rpy": "spherical",
    "quaternion_floating": "free",
    "rpy_floating": "free",
}
STEP = 1e-3  # s, of the discrete plant: a continuous plant refuses constraints
NUDGE = 0.1  # rad or m, displacement at which the force of a spring is measured


class Drake(Loader):
    """Drake's parser into a discrete plant; the root link of a URDF is welded to the world."""

    name = "drake"
    package = "drake"
    version = "1.51.1"
    formats = (URDF, SDF, MJCF)
    convention = "a URDF's root link is welded to the world"

    def load(self, path: Path, form: str) -> Loaded:
        """Parse the file."""
        return Plant(path, form)


class Plant(Loaded):
    """A plant at its default positions; a ``step`` (s) of 0 makes it continuous."""

    def __init__(
        self,
        path: Path,
        form: str,
        gravity: Vector | None = None,
        step: float = STEP,
        limited: bool = True,
    ):
        from pydrake.multibody.parsing import Parser
        from pydrake.multibody.plant import MultibodyPlant

        self.path, self.form = path, form
        self.plant = plant = MultibodyPlant(step)
        models = Parser(plant).AddModels(str(path))
        bodies = [plant.get_body(i) for model in models for i in plant.GetBodyIndices(model)]
        if form == URDF and (root := _root_link(path)) != WORLD:
            plant.WeldFrames(plant.world_frame(), plant.GetBodyByName(root, models[0]).body_frame())
        if gravity is not None:
            plant.mutable_gravity_field().set_gravity_vector(gravity)
        for joint in [] if limited else [plant.get_joint(i) for i in plant.GetJointIndices()]:
            endless = np.full(joint.num_positions(), np.inf)
            if TYPES.get(joint.type_name()) in SCALAR:
                joint.set_position_limits(-endless, endless)
        plant.Finalize()
        self.context = plant.CreateDefaultContext()
        self.bodies = bodies
        self.joints = [plant.get_joint(i) for i in plant.GetJointIndices()]

    def machine(self) -> Machine:
        number = self.plant.num_constraints()  # their kinds cannot be asked
        laws = number if self.form == URDF else min(number, _own_mimics(self.path))
        return Machine(
            bodies=tuple(map(self._body, self.bodies)),
            joints=tuple(map(self._joint, self.joints)),
            loops=tuple(Loop("", "", ("", "")) for _ in range(number - laws)),
            couplings=tuple(Coupling("", "", "", ()) for _ in range(laws)),
            gravity=vector(self.plant.gravity_field().gravity_vector()),
        )

    def _place(self, frame: Any) -> Place:
        found = frame.CalcPoseInWorld(self.context)
        return Place(np.array(found.translation()), np.array(found.rotation().matrix()))

    def _body(self, body: Any) -> Body:
        spatial = body.CalcSpatialInertiaInBodyFrame(self.context)
        centre = np.array(spatial.get_com())
        central = spatial.Shift(centre).CalcRotationalInertia().CopyToFullMatrix3()
        return self._place(body.body_frame()).body(body.name(), spatial.get_mass(), centre, central)

    def _joint(self, joint: Any) -> Joint:
        at, plant = self._place(joint.frame_on_parent()), self.plant
        parent, child = joint.parent_body(), joint.child_body()
        world = plant.world_body().index()
        pair = WORLD if parent.index() == world else parent.name(), child.name()
        kind = TYPES.get(joint.type_name(), joint.type_name())
        name, anchor = joint.name(), vector(at.position)
        if kind == "screw":
            return Joint(name, kind, pair, anchor, pitch=float(joint.screw_pitch()))  # no access to its axis
        if kind == "planar":
            return Joint(name, kind, pair, anchor, at.direction([0.0, 0.0, 1.0]))
        if kind not in SCALAR:
            return Joint(name, kind, pair, anchor)
        local = joint.revolute_axis() if kind == REVOLUTE else joint.translation_axis()
        stiffness, rest = self._spring(joint)
        return Joint(
            name,
            kind,
            pair,
            anchor,
            at.direction(local),
            damping=coefficients(*joint.default_damping_vector()),
            stiffness=stiffness,
            rest=rest,
            armature=sum(self._rotors(joint)),
            friction=0.0,
            reference=float(joint.default_positions()[0]),
            **limits(joint.position_lower_limits()[0], joint.position_upper_limits()[0], UNLIMITED_IN_SDF),
        )

    def _rotors(self, joint: Any) -> Iterator[float]:
        for number in self.plant.GetJointActuatorIndices():
            actuator = self.plant.get_joint_actuator(number)
            if actuator.joint().index() == joint.index():
                yield float(actuator.default_rotor_inertia() * actuator.default_gear_ratio() ** 2)

    def _spring(self, joint: Any) -> tuple[Vector, float | None]:
        """Return stiffness and rest of the joint's springs, from their forces at two displacements."""
        from pydrake.multibody.tree import MultibodyForces

        v, context = joint.velocity_start(), self.plant.CreateDefaultContext()
        start, forces = float(joint.default_positions()[0]), list[float]()
        for value in (start, start + NUDGE):
            self._put(context, {joint.position_start(): value})
            found = MultibodyForces(self.plant)
            self.plant.CalcForceElementsContribution(context, found)
            forces.append(float(found.generalized_forces()[v]))
        stiffness = (forces[0] - forces[1]) / NUDGE
        if abs(stiffness) < 1e-12:  # N m/rad or N/m; rounding
            return (), None
        return (stiffness,), start + forces[0] / stiffness

    def _put(self, context: Any, values: Mapping[int, float]) -> None:
        """Set coordinates by their numbers."""
        q = np.array(self.plant.GetPositions(context))
        for place, value in values.items():
            q[place] = value
        self.plant.SetPositions(context, q)

    def accelerations(self, pose: Pose, rates: Pose, gravity: Vector) -> dict[str, float]:
        if self.plant.num_constraints():
            raise NotImplementedError("Drake has constraints in discrete steps alone")
        found = Plant(self.path, self.form, gravity, step=0.0)
        plant, context = found.plant, found.moving(pose, rates)
        change = plant.EvalTimeDerivatives(context).CopyToVector()[plant.num_positions() :]
        return {joint.name(): float(change[joint.velocity_start()]) for joint in found.single()}

    def motion(
        self, pose: Pose, rates: Pose, gravity: Vector, duration: float, step: float
    ) -> dict[str, float]:
        """Simulate the discrete plant without limits of joints."""
        from pydrake.systems.analysis import Simulator

        found = Plant(self.path, self.form, gravity, step, limited=False)
        simulator = Simulator(found.plant, found.moving(pose, rates))
        simulator.AdvanceTo(duration)
        q = found.plant.GetPositions(simulator.get_context())
        return {j.name(): float(q[j.position_start()] - j.default_positions()[0]) for j in found.single()}

    def single(self) -> list[Any]:
        """Return the hinges and slides."""
        return [joint for joint in self.joints if TYPES.get(joint.type_name()) in SCALAR]

    def moving(self, pose: Pose, rates: Pose) -> Any:
        """Return a context at a pose and rates."""
        context, v = self.plant.CreateDefaultContext(), np.zeros(self.plant.num_velocities())
        starts = {joint: float(joint.default_positions()[0]) for joint in self.single()}
        self._put(context, {j.position_start(): q + pose.get(j.name(), 0.0) for j, q in starts.items()})
        for joint in self.single():
            v[joint.velocity_start()] = rates.get(joint.name(), 0.0)
        self.plant.SetVelocities(context, v)
        return context

    def statics(self, pose: Pose, gravity: Vector) -> Statics:
        if vector(self.plant.gravity_field().gravity_vector()) != tuple(gravity):
            self.__init__(self.path, self.form, gravity)  # type: ignore[misc]
        plant, context = self.plant, self.moving(pose, {})
        single = self.single()
        dofs = [joint.velocity_start() for joint in single]
        mass, torque = plant.CalcMassMatrix(context), -plant.CalcGravityGeneralizedForces(context)
        self.context = context
        centres = {body.name(): vector(self._body(body).centre or ()) for body in self.bodies}
        names = tuple(joint.name() for joint in single)
        return Statics(names, matrix(mass[np.ix_(dofs, dofs)]), vector(torque[dofs]), centres)


def _own_mimics(path: Path) -> int:
    """Return the number of Drake's own <drake:mimic> elements in a file."""
    return sum(1 for _ in ET.parse(path).getroot().iter("{drake.mit.edu}mimic"))


def _root_link(path: Path) -> str:
    """Return the link of a URDF that no joint carries."""
    root = ET.parse(path).getroot()
    carried = {child.get("link") for child in root.iterfind("joint/child")}
    return next(str(link.get("name")) for link in root.iter("link") if link.get("name") not in carried)
