"""A Scene as an Exudyn system: nodes and bodies, native joints, driver constraints, loads, sensors.

Body frames are parallel to the world in the assembled configuration (the inertia is rotated instead):
a relative rotation marker measures the angle between body frames, and must read zero at the start.
Special joint classes are preferred to Exudyn's generic joint, whose rows for free axes make the scaled Newton
matrix ill-conditioned at small steps.  The functions take the exudyn module and do not import it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.engines.exudyn.joints import JOINTS, marker_frame
from crosscheck.engines.shared.driver_motion import motion, moving
from crosscheck.judge.constraints import initial_poses, initial_twists
from crosscheck.judge.joint_coordinates import coordinate_jacobian
from mbref import rotations
from mbref.rotations import unit
from mbref.scene import GROUND, Coupling, Driver, Joint, Load, Scene

SENSED = ("Coordinates", "Coordinates_t", "Coordinates_tt")


@dataclass(frozen=True)
class System:
    """An assembled Exudyn system and the numbers of its items, in the order of the scene."""

    mbs: Any
    nodes: list[int]
    sensors: list[list[int]]  # sensors of each node: coordinates (7), their rates and second rates
    drivers: list[int]  # object numbers of the driver constraints
    # sensors of the outputs of JOINTS for each joint; then of the forces of drivers, couplings and rotors
    joint_sensors: list[int]
    redundant: int  # number of redundant constraints in the assembled configuration

    def samples(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the records of the last run: times (k,), node coordinates (3, k, nb, 7) as values, rates and
        second rates, and the outputs (k, ·) of the joints' sensors side by side."""
        rows = np.array([[self.mbs.GetSensorStoredData(s) for s in node] for node in self.sensors])
        times = rows[0, 0, :, 0]
        outputs = [self.mbs.GetSensorStoredData(s)[:, 1:] for s in self.joint_sensors]
        forces = np.concatenate([np.zeros((len(times), 0)), *outputs], axis=1)
        return times, rows[..., 1:].transpose(1, 2, 0, 3), forces


def build(exu: Any, scene: Scene, forces: bool) -> System:
    """Return the scene's system at t = 0; without ``forces`` it has no mass, load or velocity."""
    items = exu.itemInterface
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    parts = _Parts(exu, items, scene, mbs, mbs.AddObject(items.ObjectGround()))
    nodes = parts.bodies(forces)
    joints = [parts.joint(joint) for joint in scene.joint]
    drivers = [parts.driver(driver) for driver in scene.driver]
    of_joints = [
        parts.sensor(number, output)
        for joint, number in zip(scene.joint, joints, strict=True)
        for output in JOINTS[joint.type].outputs
    ]
    couplings = [parts.coupling(coupling) for coupling in scene.coupling]
    rotors = [parts.rotor(joint) for joint in scene.joint if joint.reflected_inertia] if forces else []
    of_joints += [parts.sensor(number, "Force") for number in (*drivers, *couplings, *rotors)]
    if forces:
        for load in scene.load:
            parts.load(load)
    sensors = [parts.sensors(node) for node in nodes]
    mbs.Assemble()
    redundant = int(mbs.ComputeSystemDegreeOfFreedom()["redundantConstraints"])
    return System(mbs, nodes, sensors, drivers, of_joints, redundant)


class _Parts:
    """Adds items to a system; ``number`` maps a body's name to its object."""

    def __init__(self, exu: Any, items: Any, scene: Scene, mbs: Any, ground: int):
        self.exu, self.items, self.scene, self.mbs = exu, items, scene, mbs
        self.number = {GROUND: ground}
        self.position = {GROUND: np.zeros(3)} | {b.name: np.array(b.position) for b in scene.body}

    def bodies(self, forces: bool) -> list[int]:
        nb = len(self.scene.body)
        v, w = initial_twists(self.scene) if forces else (np.zeros((nb, 3)), np.zeros((nb, 3)))
        nodes = []
        for k, body in enumerate(self.scene.body):
            node = self.items.NodeRigidBodyEP(
                referenceCoordinates=[*body.position, 1, 0, 0, 0], initialVelocities=[*v[k], 0, *w[k] / 2]
            )
            nodes.append(self.mbs.AddNode(node))
            inertia = _world_inertia(body) if forces else np.zeros(6)
            rigid = self.items.ObjectRigidBody(
                mass=body.mass if forces else 0.0, inertia=inertia, nodeNumber=nodes[-1]
            )
            self.number[body.name] = self.mbs.AddObject(rigid)
            if forces and any(self.scene.gravity):
                self._gravity(self.number[body.name])
        return nodes

    def _gravity(self, body: int) -> None:
        marker = self.mbs.AddMarker(self.items.MarkerBodyMass(bodyNumber=body))
        self.mbs.AddLoad(self.items.LoadMassProportional(markerNumber=marker, loadVector=self.scene.gravity))

    def marker(self, body: str, point: Any, frame: np.ndarray | None = None) -> int:
        """Return a marker on a body at a world point; the columns of its frame are the given world axes."""
        frame = np.eye(3) if frame is None else frame
        local = self.exu.HT(rotation=frame, translation=np.asarray(point) - self.position[body])
        return self.mbs.AddMarker(self.items.MarkerBodyRigid(bodyNumber=self.number[body], localHT=local))

    def joint(self, joint: Joint) -> int:
        item, frame = JOINTS[joint.type], marker_frame(joint)
        given: dict[str, Any] = {}
        ends = zip(joint.bodies, joint.anchor_pair, strict=True)
        markers = [self.marker(body, point, frame) for body, point in ends]
        if item.constrained:
            given["constrainedAxes"] = list(item.constrained)
        elif joint.facts.condition == "constant distance":
            given["distance"] = float(np.linalg.norm(np.subtract(*joint.anchor_pair)))
        return self.mbs.AddObject(getattr(self.items, item.name)(markerNumbers=markers, **given))

    def sensor(self, number: int, output: str) -> int:
        """Return a sensor of an output variable of a joint or constraint."""
        kind = getattr(self.exu.OutputVariableType, output)
        sensor = self.items.SensorObject(
            objectNumber=number, outputVariableType=kind, storeInternal=True, writeToFile=False
        )
        return self.mbs.AddSensor(sensor)

    def driver(self, driver: Driver) -> int:
        """Add a coordinate constraint: relative coordinate of the joint's bodies = the driver's value."""
        fixed = self.mbs.AddNode(self.items.NodePointGround())
        markers = [self.mbs.AddMarker(self.items.MarkerNodeCoordinate(nodeNumber=fixed, coordinate=0))]
        joint = self.scene.joint_named(driver.joint)
        turning = joint.facts.driven == "angle"
        markers.append(self._rotation(joint) if turning else self._translation(joint))
        at = moving(driver)
        constraint = self.items.ObjectConnectorCoordinate(
            markerNumbers=markers,
            offsetUserFunction=lambda mbs, t, item, offset: at(t)[0],
            offsetUserFunction_t=lambda mbs, t, item, offset: at(t)[1],
        )
        return self.mbs.AddObject(constraint)

    def coupling(self, coupling: Coupling) -> int:
        """Add a coordinate constraint, ratio · q₁ - q₂ = 0, of relative coordinates of the joints' bodies."""
        first, second = (
            self._rotation(joint) if kind == "angle" else self._translation(joint)
            for joint, kind in self.scene.coupled(coupling)
        )
        constraint = self.items.ObjectConnectorCoordinate(
            markerNumbers=[second, first], factor1=coupling.gear_ratio
        )
        return self.mbs.AddObject(constraint)

    def rotor(self, joint: Joint) -> int:
        """Add the armature of a joint: a mass of one coordinate that a constraint holds equal to the
        joint's."""
        rates = coordinate_jacobian(self.scene, joint.name, *initial_poses(self.scene))
        rates = rates @ np.hstack(initial_twists(self.scene)).ravel()
        turning = joint.facts.driven == "angle"
        node = self.mbs.AddNode(
            self.items.Node1D(
                referenceCoordinates=[0],
                initialCoordinates=[0],
                initialVelocities=[rates[0 if turning else 1]],
            )
        )
        self.mbs.AddObject(self.items.ObjectMass1D(mass=joint.reflected_inertia, nodeNumber=node))
        ends = [self.mbs.AddMarker(self.items.MarkerNodeCoordinate(nodeNumber=node, coordinate=0))]
        ends.append(self._rotation(joint) if turning else self._translation(joint))
        return self.mbs.AddObject(self.items.ObjectConnectorCoordinate(markerNumbers=ends))

    def _relative(self, joint: Joint) -> dict[str, Any]:
        ends = zip(joint.bodies, joint.anchor_pair, strict=True)
        local = [np.asarray(point) - self.position[body] for body, point in ends]
        return {
            "bodyNumbers": [self.number[body] for body in joint.bodies],
            "localPosition0": local[0],
            "localPosition1": local[1],
            "axis0": unit(joint.directions[0]),
        }

    def _turns(self) -> int:
        """Return a data node with which a relative angle continues beyond half a turn."""
        return self.mbs.AddNode(self.items.NodeGenericData(initialCoordinates=[0], numberOfDataCoordinates=1))

    def _rotation(self, joint: Joint) -> int:
        marker = self.items.MarkerBodiesRelativeRotationCoordinate(
            nodeNumber=self._turns(), **self._relative(joint)
        )
        return self.mbs.AddMarker(marker)

    def _translation(self, joint: Joint) -> int:
        return self.mbs.AddMarker(
            self.items.MarkerBodiesRelativeTranslationCoordinate(**self._relative(joint))
        )

    def load(self, load: Load) -> None:
        getattr(self, f"_{load.type}")(load)

    def _moment(self, load: Any) -> None:
        marker, over_time = self.marker(load.body, self.position[load.body]), _vector_over_time(load)
        self.mbs.AddLoad(
            self.items.LoadTorqueVector(markerNumber=marker, loadVector=load.moment, **over_time)
        )

    def _force(self, load: Any) -> None:
        marker, over_time = self.marker(load.body, load.point), _vector_over_time(load)
        self.mbs.AddLoad(self.items.LoadForceVector(markerNumber=marker, loadVector=load.force, **over_time))

    def _spring(self, load: Any) -> None:
        spring = self.items.ObjectConnectorSpringDamper(
            markerNumbers=[self.marker(b, p) for b, p in zip(load.bodies, load.points, strict=True)],
            referenceLength=load.natural_length,
            stiffness=load.stiffness,
            damping=load.damping,
        )
        self.mbs.AddObject(spring)

    def _torsion_spring(self, load: Any) -> None:
        joint = self.scene.joint_named(load.joint)
        frame = marker_frame(joint)
        ends = zip(joint.bodies, joint.anchor_pair, strict=True)
        spring = self.items.ObjectConnectorTorsionalSpringDamper(
            markerNumbers=[self.marker(body, point, frame) for body, point in ends],
            nodeNumber=self._turns(),
            stiffness=load.stiffness,
            damping=load.damping,
            offset=load.natural_angle,
        )
        self.mbs.AddObject(spring)

    def _slide_spring(self, load: Any) -> None:
        fixed = self.mbs.AddNode(self.items.NodePointGround())
        ends = [self.mbs.AddMarker(self.items.MarkerNodeCoordinate(nodeNumber=fixed, coordinate=0))]
        ends.append(self._translation(self.scene.joint_named(load.joint)))
        spring = self.items.ObjectConnectorCoordinateSpringDamper(
            markerNumbers=ends,
            stiffness=load.stiffness,
            damping=load.damping,
            offset=load.natural_displacement,
        )
        self.mbs.AddObject(spring)

    def _rotational_damper(self, load: Any) -> None:
        self._resist(load, [self.position[body] for body in load.bodies], slice(3, 6))

    def _point_damper(self, load: Any) -> None:
        self._resist(load, [load.point] * 2, slice(0, 3))

    def _resist(self, load: Any, points: Sequence[Any], components: slice) -> None:
        """Add damping of components of the relative motion of two markers."""
        damping = np.zeros((6, 6))
        damping[components, components] = load.damping * np.eye(3)
        markers = [self.marker(*end) for end in zip(load.bodies, points, strict=True)]
        self.mbs.AddObject(
            self.items.ObjectConnectorRigidBodySpringDamper(
                markerNumbers=markers, stiffness=np.zeros((6, 6)), damping=damping
            )
        )

    def _joint_torque(self, load: Any) -> None:
        self._push(load, self._rotation(self.scene.joint_named(load.joint)), load.torque)

    def _joint_force(self, load: Any) -> None:
        self._push(load, self._translation(self.scene.joint_named(load.joint)), load.force)

    def _push(self, load: Any, marker: int, amount: float) -> None:
        """A force or torque on a relative coordinate."""
        given: dict[str, Any] = {}
        if load.factor is not None:
            given["loadUserFunction"] = lambda mbs, t, size: amount * motion(load.factor, t)[0]
        self.mbs.AddLoad(self.items.LoadCoordinate(markerNumber=marker, load=amount, **given))

    def sensors(self, node: int) -> list[int]:
        kinds = [getattr(self.exu.OutputVariableType, name) for name in SENSED]
        return [
            self.mbs.AddSensor(
                self.items.SensorNode(
                    nodeNumber=node, outputVariableType=kind, storeInternal=True, writeToFile=False
                )
            )
            for kind in kinds
        ]


def _vector_over_time(load: Any) -> dict[str, Any]:
    """Return the user function of a force or moment over time; None for a constant force or moment."""
    if load.factor is None:
        return {}
    vector = np.array(load.force if load.type == "force" else load.moment)
    return {"loadVectorUserFunction": lambda mbs, t, given: (motion(load.factor, t)[0] * vector).tolist()}


def _world_inertia(body: Any) -> np.ndarray:
    """Return xx, yy, zz, yz, xz, xy of the inertia along the world axes at t = 0."""
    local = np.array(body.inertia)
    turn = rotations.to_matrix(np.array(body.orientation))
    j = turn @ (np.diag(local) if local.ndim == 1 else local) @ turn.T
    return np.array([j[0, 0], j[1, 1], j[2, 2], j[1, 2], j[0, 2], j[0, 1]])
