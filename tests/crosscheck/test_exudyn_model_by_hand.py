"""A scene as Exudyn's items, its reactions and its runs / recorded items, every number worked out by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.engines.exudyn import adapter, model, static
from crosscheck.engines.exudyn.dynamic import Motion
from crosscheck.engines.exudyn.joints import marker_frame
from crosscheck.engines.exudyn.reactions import reactions
from mbref.scene import (
    Body,
    Coupling,
    Cylindrical,
    Distance,
    Driver,
    Fixed,
    Force,
    JointForce,
    JointTorque,
    Moment,
    Planar,
    Revolute,
    Scene,
    SlideSpring,
    Spherical,
    Spring,
    TorsionSpring,
    Translational,
    Universal,
)
from mbref.trajectory import Cost, Outcome

BODY = Body(
    name="b",
    mass=4.0,
    inertia=(1.0, 2.0, 2.5),
    position=(1.0, 0.0, 0.0),
    velocity=(0.0, 3.0, 0.0),
    angular_velocity=(0.0, 0.0, 3.0),
)
OTHER = Body(name="c", mass=2.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 5.0, 0.0))
HINGE = Revolute(name="H", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 2.0))
SLIDE = Translational(name="S", bodies=("ground", "c"), anchor=(0.0, 4.0, 0.0), axis=(0.0, 3.0, 0.0))
RISING = {"polynomial": (1.0, 2.0)}  # 1 + 2 t


def scene(**parts: Any) -> Scene:
    given = {"name": "s", "body": (BODY, OTHER), "joint": (HINGE, SLIDE), "duration": 2.0}
    return Scene(**{"gravity": (0.0, 0.0, 0.0), **given, **parts})


class Items:
    """Every item is its name and its arguments."""

    def __getattr__(self, name: str) -> Any:
        return lambda **given: (name, given)


class System:
    """Records the items that are added; each kind is numbered from 0."""

    def __init__(self) -> None:
        self.added: dict[str, list[Any]] = {}

    def __getattr__(self, name: str) -> Any:
        def add(item: Any) -> int:
            self.added.setdefault(name.removeprefix("Add"), []).append(item)
            return len(self.added[name.removeprefix("Add")]) - 1

        return add

    def Assemble(self) -> None:
        self.added["Assembled"] = []

    def ComputeSystemDegreeOfFreedom(self) -> dict[str, int]:
        return {"redundantConstraints": 3}


EXU: Any = SimpleNamespace(
    itemInterface=Items(),
    HT=lambda rotation, translation: (np.asarray(rotation).tolist(), np.asarray(translation).tolist()),
    OutputVariableType=SimpleNamespace(
        **{n: n for n in ("ForceLocal", "TorqueLocal", "Force", *model.SENSED)}
    ),
)


def parts(given: Scene, forces: bool = True) -> tuple[Any, dict[str, list[Any]]]:
    """The adder of parts, after the bodies, and the items added so far."""
    system = System()
    found: Any = model._Parts(EXU, Items(), given, system, system.AddObject(("ground", {})))
    assert found.bodies(forces) == list(range(len(given.body)))
    return found, system.added


def plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    return float(value) if isinstance(value, np.floating) else value


# --- Bodies and joints ------------------------------------------------------------------------------------
def test_bodies_have_nodes_masses_and_weights() -> None:
    _, added = parts(scene(gravity=(0.0, -9.0, 0.0)))
    name, node = added["Node"][0]
    assert name == "NodeRigidBodyEP" and plain(node["referenceCoordinates"]) == [1.0, 0.0, 0.0, 1, 0, 0, 0]
    assert plain(node["initialVelocities"]) == pytest.approx([0.0, 3.0, 0.0, 0, 0.0, 0.0, 1.5])
    name, body = added["Object"][1]
    assert name == "ObjectRigidBody" and body["mass"] == 4.0 and body["nodeNumber"] == 0
    assert plain(body["inertia"]) == [1.0, 2.0, 2.5, 0.0, 0.0, 0.0]
    assert added["Marker"] == [("MarkerBodyMass", {"bodyNumber": 1}), ("MarkerBodyMass", {"bodyNumber": 2})]
    assert added["Load"][1] == ("LoadMassProportional", {"markerNumber": 1, "loadVector": (0.0, -9.0, 0.0)})
    _, still = parts(scene(gravity=(0.0, -9.0, 0.0)), forces=False)
    assert "Load" not in still and still["Object"][1][1]["mass"] == 0.0
    assert not np.any(still["Object"][1][1]["inertia"])
    assert plain(still["Node"][0][1]["initialVelocities"]) == [0.0, 0.0, 0.0, 0, 0.0, 0.0, 0.0]
    assert "Load" not in parts(scene())[1]


def test_inertia_is_along_the_world_axes() -> None:
    """Half a turn about (1, 1, 0) exchanges x and y, and reverses z."""
    half = math.sqrt(0.5)
    full = ((1.0, 0.5, 0.25), (0.5, 2.0, 0.125), (0.25, 0.125, 2.5))
    turned = BODY.model_copy(update={"orientation": (0.0, half, half, 0.0), "inertia": full})
    assert model._world_inertia(turned) == pytest.approx([2.0, 1.0, 2.5, -0.25, -0.125, 0.5])


def test_markers_are_at_points_of_bodies() -> None:
    found, added = parts(scene())
    assert found.marker("c", (1.0, 5.0, 2.0)) == 0 and found.marker("ground", (1.0, 2.0, 3.0)) == 1
    eye = np.eye(3).tolist()
    assert added["Marker"][0] == ("MarkerBodyRigid", {"bodyNumber": 2, "localHT": (eye, [1.0, 0.0, 2.0])})
    assert added["Marker"][1] == ("MarkerBodyRigid", {"bodyNumber": 0, "localHT": (eye, [1.0, 2.0, 3.0])})


PAIR: dict[str, Any] = {"name": "J", "bodies": ("ground", "b"), "anchor": (0.5, 0.0, 0.0)}
ALONG: dict[str, Any] = {**PAIR, "axis": (0.0, 0.0, 1.0)}


@pytest.mark.parametrize(
    ("joint", "name", "given"),
    [
        (Fixed(**PAIR), "ObjectJointGeneric", {"constrainedAxes": [1, 1, 1, 1, 1, 1]}),
        (Revolute(**ALONG), "ObjectJointRevoluteZ", {}),
        (
            Universal(**PAIR, axes=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))),
            "ObjectJointGeneric",
            {"constrainedAxes": [1, 1, 1, 0, 0, 1]},
        ),
        (Spherical(**PAIR), "ObjectJointSpherical", {}),
        (Translational(**ALONG), "ObjectJointPrismaticX", {}),
        (Cylindrical(**ALONG), "ObjectJointGeneric", {"constrainedAxes": [1, 1, 0, 1, 1, 0]}),
        (Planar(**ALONG), "ObjectJointGeneric", {"constrainedAxes": [0, 0, 1, 1, 1, 0]}),
        (
            Distance(name="J", bodies=("ground", "b"), anchors=((0.0, 0.0, 0.0), (3.0, 4.0, 0.0))),
            "ObjectConnectorDistance",
            {"distance": 5.0},
        ),
    ],
)
def test_joints_are_items_between_two_markers(joint: Any, name: str, given: dict[str, Any]) -> None:
    found, added = parts(scene(joint=(joint,)), forces=False)
    assert found.joint(joint) == 3
    kind, options = added["Object"][3]
    assert (kind, options) == (name, {"markerNumbers": [0, 1], **given})
    frame = marker_frame(joint).tolist()
    ends = joint.anchor_pair
    assert added["Marker"][0][1] == {"bodyNumber": 0, "localHT": (frame, list(ends[0]))}
    assert added["Marker"][1][1]["bodyNumber"] == 1
    assert added["Marker"][1][1]["localHT"][1] == [ends[1][0] - 1.0, *ends[1][1:]]


def test_frames_of_markers_have_the_axis_where_the_item_needs_it() -> None:
    assert marker_frame(HINGE)[:, 2].tolist() == [0.0, 0.0, 1.0] and marker_frame(SLIDE)[:, 0].tolist() == [
        0,
        1,
        0,
    ]
    assert marker_frame(Spherical(**PAIR)).tolist() == np.eye(3).tolist()
    cross = Universal(**PAIR, axes=((0.0, 0.0, 2.0), (3.0, 0.0, 0.0)))
    assert marker_frame(cross).T.tolist() == [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    for joint in (HINGE, SLIDE, cross):
        assert np.linalg.det(marker_frame(joint)) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("joint", "marker", "bodies", "local"),
    [
        ("H", "MarkerBodiesRelativeRotationCoordinate", [0, 1], [[0.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]),
        ("S", "MarkerBodiesRelativeTranslationCoordinate", [0, 2], [[0.0, 4.0, 0.0], [0.0, -1.0, 0.0]]),
    ],
)
def test_drivers_prescribe_a_relative_coordinate(joint: str, marker: str, bodies: Any, local: Any) -> None:
    """3 t² is 0.75 at 0.5 s, with a rate of 3."""
    given = scene(driver=(Driver(joint=joint, polynomial=(0.0, 0.0, 3.0)),))
    found, added = parts(given, forces=False)
    assert found.driver(given.driver[0]) == 3
    kind, options = added["Object"][3]
    assert kind == "ObjectConnectorCoordinate" and options["markerNumbers"] == [0, 1]
    assert options["offsetUserFunction"](None, 0.5, 0, 0.0) == 0.75
    assert options["offsetUserFunction_t"](None, 0.5, 0, 0.0) == 3.0
    assert added["Marker"][0] == ("MarkerNodeCoordinate", {"nodeNumber": 2, "coordinate": 0})
    assert added["Node"][2] == ("NodePointGround", {})
    name, relative = added["Marker"][1]
    assert name == marker and relative["bodyNumbers"] == bodies
    assert [plain(relative[f"localPosition{k}"]) for k in (0, 1)] == local
    assert plain(relative["axis0"]) == ([0.0, 0.0, 1.0] if joint == "H" else [0.0, 1.0, 0.0])
    if joint == "H":
        assert relative["nodeNumber"] == 3
        assert added["Node"][3] == (
            "NodeGenericData",
            {"initialCoordinates": [0], "numberOfDataCoordinates": 1},
        )


def test_couplings_and_rotors_are_coordinate_constraints() -> None:
    coupling = Coupling(name="K", joints=("H", "S"), ratio=2.5)
    geared = HINGE.model_copy(update={"armature": 0.5})
    given = scene(coupling=(coupling,), joint=(geared, SLIDE))
    found, added = parts(given)
    assert found.coupling(coupling) == 3
    kinds = [name for name, _ in added["Marker"]]
    assert kinds == ["MarkerBodiesRelativeRotationCoordinate", "MarkerBodiesRelativeTranslationCoordinate"]
    assert added["Object"][3] == ("ObjectConnectorCoordinate", {"markerNumbers": [1, 0], "factor1": 2.5})
    assert found.rotor(geared) == 5
    name, node = added["Node"][3]
    assert name == "Node1D" and plain(node["initialVelocities"]) == pytest.approx([3.0])
    assert (node["referenceCoordinates"], node["initialCoordinates"]) == ([0], [0])
    assert added["Object"][4] == ("ObjectMass1D", {"mass": 0.5, "nodeNumber": 3})
    assert added["Marker"][2] == ("MarkerNodeCoordinate", {"nodeNumber": 3, "coordinate": 0})
    assert added["Object"][5] == ("ObjectConnectorCoordinate", {"markerNumbers": [2, 3]})


def test_a_rotor_of_a_slide_moves_with_its_displacement() -> None:
    sliding = OTHER.model_copy(update={"velocity": (0.0, 7.0, 0.0)})
    geared = SLIDE.model_copy(update={"armature": 0.5})
    found, added = parts(scene(body=(BODY, sliding), joint=(HINGE, geared)))
    found.rotor(geared)
    assert plain(added["Node"][2][1]["initialVelocities"]) == pytest.approx([7.0])
    assert added["Marker"][1][0] == "MarkerBodiesRelativeTranslationCoordinate"


# --- Loads ------------------------------------------------------------------------------------------------
def loaded(load: Any) -> tuple[str, dict[str, Any], dict[str, list[Any]]]:
    found, added = parts(scene(load=(load,)))
    found.load(load)
    kind, given = added["Load"][-1] if "Load" in added else added["Object"][-1]
    return kind, given, added


@pytest.mark.parametrize(
    ("load", "kind", "vector", "place"),
    [
        (Moment(body="b", moment=(1.0, 2.0, 3.0)), "LoadTorqueVector", (1.0, 2.0, 3.0), [0.0, 0.0, 0.0]),
        (
            Force(body="b", point=(3.0, 0.5, 0.0), force=(0.0, 6.0, 0.0)),
            "LoadForceVector",
            (0.0, 6.0, 0.0),
            [2.0, 0.5, 0.0],
        ),
    ],
)
def test_moments_and_forces(load: Any, kind: str, vector: Any, place: Any) -> None:
    name, given, added = loaded(load)
    assert (name, given) == (kind, {"markerNumber": 0, "loadVector": vector})
    assert added["Marker"][0][1]["localHT"][1] == place and added["Marker"][0][1]["bodyNumber"] == 1
    _, given, _ = loaded(load.model_copy(update={"factor": _factor()}))
    assert given["loadVectorUserFunction"](None, 1.5, None) == [4.0 * x for x in vector]


def _factor() -> Any:
    return Moment(body="b", moment=(1.0, 0.0, 0.0), factor=RISING).factor


@pytest.mark.parametrize(
    ("load", "amount", "marker"),
    [
        (JointTorque(joint="H", torque=7.0), 7.0, "MarkerBodiesRelativeRotationCoordinate"),
        (JointForce(joint="S", force=-5.0), -5.0, "MarkerBodiesRelativeTranslationCoordinate"),
    ],
)
def test_forces_and_torques_along_joints(load: Any, amount: float, marker: str) -> None:
    name, given, added = loaded(load)
    assert (name, given) == ("LoadCoordinate", {"markerNumber": 0, "load": amount})
    assert added["Marker"][0][0] == marker
    _, given, _ = loaded(load.model_copy(update={"factor": _factor()}))
    assert given["loadUserFunction"](None, 1.5, 0.0) == 4.0 * amount


def test_springs_between_points_and_along_joints() -> None:
    ends = {"bodies": ("ground", "b"), "points": ((0.0, 1.0, 0.0), (1.0, 1.0, 0.0))}
    name, given, added = loaded(Spring(**ends, stiffness=3.0, damping=0.5, natural_length=0.25))
    wanted = {"markerNumbers": [0, 1], "referenceLength": 0.25, "stiffness": 3.0, "damping": 0.5}
    assert (name, given) == ("ObjectConnectorSpringDamper", wanted)
    assert [marker["localHT"][1] for _, marker in added["Marker"]] == [[0, 1, 0], [0, 1, 0]]
    name, given, added = loaded(TorsionSpring(joint="H", stiffness=3.0, damping=0.5, natural_angle=0.25))
    wanted = {"markerNumbers": [0, 1], "nodeNumber": 2, "stiffness": 3.0, "damping": 0.5, "offset": 0.25}
    assert (name, given) == ("ObjectConnectorTorsionalSpringDamper", wanted)
    assert [marker["localHT"][1] for _, marker in added["Marker"]] == [[0, 0, 0], [-1, 0, 0]]
    name, given, added = loaded(SlideSpring(joint="S", stiffness=3.0, damping=0.5, natural_displacement=0.25))
    wanted = {"markerNumbers": [0, 1], "stiffness": 3.0, "damping": 0.5, "offset": 0.25}
    assert (name, given) == ("ObjectConnectorCoordinateSpringDamper", wanted)
    assert added["Marker"][0] == ("MarkerNodeCoordinate", {"nodeNumber": 2, "coordinate": 0})


def test_a_system_has_sensors_of_joints_drivers_couplings_and_rotors() -> None:
    system = System()
    exu: Any = SimpleNamespace(**vars(EXU), SystemContainer=lambda: SimpleNamespace(AddSystem=lambda: system))
    geared = SLIDE.model_copy(update={"armature": 0.5})
    ball = Spherical(name="B", bodies=("b", "c"), anchor=(0.0, 0.0, 0.0))
    still = BODY.model_copy(update={"velocity": None, "angular_velocity": None})
    given = scene(
        body=(still, OTHER),
        joint=(HINGE, geared, ball),
        driver=(Driver(joint="H"),),
        coupling=(Coupling(name="K", joints=("H", "S"), ratio=2.0),),
        load=(Moment(body="b", moment=(1.0, 0.0, 0.0)),),
    )
    found = model.build(exu, given, forces=True)
    outputs = [
        given["outputVariableType"] for name, given in system.added["Sensor"] if name == "SensorObject"
    ]
    assert outputs == [
        "ForceLocal",
        "TorqueLocal",
        "ForceLocal",
        "TorqueLocal",
        "Force",
        "Force",
        "Force",
        "Force",
    ]
    numbers = [given["objectNumber"] for name, given in system.added["Sensor"] if name == "SensorObject"]
    assert (
        numbers == [3, 3, 4, 4, 5, 6, 7, 9] and found.drivers == [6] and found.joint_sensors == list(range(8))
    )
    assert all(g["storeInternal"] and not g["writeToFile"] for _, g in system.added["Sensor"])
    nodes = [
        (g["nodeNumber"], g["outputVariableType"]) for n, g in system.added["Sensor"] if n == "SensorNode"
    ]
    assert nodes == [(node, kind) for node in (0, 1) for kind in model.SENSED]
    assert found.sensors == [[8, 9, 10], [11, 12, 13]] and found.nodes == [0, 1] and found.redundant == 3
    assert len(system.added["Load"]) == 1 and "Assembled" in system.added
    system.added.clear()
    bare = model.build(exu, given, forces=False)
    assert "Load" not in system.added and len(bare.joint_sensors) == 7


def test_records_of_sensors_side_by_side() -> None:
    """Two nodes with three sensors each, at two times; two sensors of joints with 2 and 1 outputs."""
    stored = {s: np.column_stack([[0.0, 0.5], np.full((2, 7), float(s))]) for s in range(6)}
    stored |= {6: np.array([[0.0, 1.0, 2.0], [0.5, 3.0, 4.0]]), 7: np.array([[0.0, 5.0], [0.5, 6.0]])}
    mbs: Any = SimpleNamespace(GetSensorStoredData=stored.__getitem__)
    times, values, forces = model.System(mbs, [0, 1], [[0, 1, 2], [3, 4, 5]], [], [6, 7], 0).samples()
    assert times.tolist() == [0.0, 0.5] and values.shape == (3, 2, 2, 7)
    assert values[:, 0, :, 0].tolist() == [[0.0, 3.0], [1.0, 4.0], [2.0, 5.0]]
    assert forces.tolist() == [[1.0, 2.0, 5.0], [3.0, 4.0, 6.0]]
    assert model.System(mbs, [0], [[0, 1, 2]], [], [], 0).samples()[2].shape == (2, 0)


# --- Reactions --------------------------------------------------------------------------------------------
def test_reactions_of_joints_drivers_couplings_and_rotors() -> None:
    """Drivers, couplings and rotors act along the joints' axes: z of H, y of S."""
    geared = SLIDE.model_copy(update={"armature": 0.5})
    given = scene(
        joint=(HINGE, geared),
        driver=(Driver(joint="H"), Driver(joint="S")),
        coupling=(Coupling(name="K", joints=("H", "S"), ratio=2.0),),
    )
    still = np.zeros((1, 2, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (1, 2, 1))
    nothing = np.zeros(12)
    for place, joint, wanted in (
        (12, "H", [0, 0, 0, 0, 0, -1]),  # its driver
        (13, "S", [0, -1, 0, 0, 0, 0]),
        (15, "S", [0, -1, 0, 0, 0, 0]),  # its rotor
    ):
        forces = np.zeros((1, 16))
        forces[0, place] = 1.0
        found = reactions(given, *still, forces)
        assert found[joint] == pytest.approx(np.array([wanted], float)), place
        assert not np.any(found["S" if joint == "H" else "H"])
    forces = np.concatenate([nothing, [0, 0, 1.0, 0]])[None]
    found = reactions(given, *still, forces)
    assert found["H"] == pytest.approx(np.array([[0, 0, 0, 0, 0, -2.0]]))
    assert found["S"] == pytest.approx(np.array([[0, 1.0, 0, 0, 0, 0]]))


def test_forces_of_joints_are_on_the_first_body_in_its_frame() -> None:
    """The first body b has turned by a quarter turn about x: the axes of the marker turn with it."""
    joint = Revolute(name="J", bodies=("b", "c"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    half = math.sqrt(0.5)
    turned = np.array([[[half, half, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]]])
    frame = marker_frame(joint)
    quarter = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]) @ frame
    forces = np.array([[1.0, 2.0, 3.0, 5.0, 7.0, 11.0]])
    found = reactions(scene(joint=(joint,)), np.zeros((1, 2, 3)), turned, forces)["J"][0]
    assert found[:3] == pytest.approx(-quarter @ [1.0, 2.0, 3.0])
    z = quarter[:, 2]
    wanted = 5.0 * np.cross(z, frame[:, 0]) + 7.0 * np.cross(z, frame[:, 1])
    assert found[3:] == pytest.approx(wanted)


def test_forces_of_balls_rods_and_universal_joints() -> None:
    still = np.tile([1.0, 0.0, 0.0, 0.0], (1, 2, 1))
    ball = Spherical(name="J", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0))
    found = reactions(scene(joint=(ball,)), np.zeros((1, 2, 3)), still, np.array([[1.0, 2.0, 3.0]]))["J"]
    assert found.tolist() == [[-1.0, -2.0, -3.0, 0.0, 0.0, 0.0]]
    rod = Distance(name="J", bodies=("ground", "b"), anchors=((0.0, 0.0, 0.0), (1.0, 1.0, 0.0)))
    moved = np.array([[[-1.0, 3.0, 0.0], [0.0, 0.0, 0.0]]])  # the end is at (0, 4, 0)
    found = reactions(scene(joint=(rod,)), moved, still, np.array([[2.0]]))["J"]
    assert found.tolist() == [[0.0, -2.0, 0.0, 0.0, 0.0, 0.0]]
    half = math.sqrt(0.5)
    turned = np.array([[[half, 0.0, 0.0, half], [1.0, 0.0, 0.0, 0.0]]])  # (0, 1, 0) of b becomes (-1, 0, 0)
    lifted = np.array([[[0.0, 3.0, 0.0], [0.0, 0.0, 0.0]]])  # the end is at (0, 3, 0)
    found = reactions(scene(joint=(rod,)), lifted, turned, np.array([[2.0]]))["J"]
    assert found == pytest.approx(np.array([[0.0, -2.0, 0.0, 0.0, 0.0, 0.0]]), abs=1e-15)
    cross = Universal(**PAIR, axes=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    forces = np.array([[0.0, 0.0, 0.0, 3.0, 5.0, 7.0]])
    found = reactions(scene(joint=(cross,)), np.zeros((1, 2, 3)), still, forces)["J"]
    assert found.tolist() == [[0.0, 0.0, 0.0, 0.0, 0.0, 7.0]]


# --- Runs -------------------------------------------------------------------------------------------------
COST = Cost(1.0, 2.0, 3)


def motion(seconds: bool = True, **more: Any) -> Motion:
    """Body b has moved by (0, 1, 0) and turned by half a turn about z, and turns with 3 rad/s."""
    coordinates = np.zeros((3, 1, 2, 7))
    coordinates[0, 0, 0] = [0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 1.0]
    coordinates[1, 0, 0] = [4.0, 5.0, 6.0, -1.5, 0.0, 0.0, 0.0]
    coordinates[2, 0, 0] = [7.0, 8.0, 9.0, -1.0, 0.0, 0.0, 0.0]
    forces = np.zeros((1, 12)) if seconds else None
    return Motion(np.array([0.5]), coordinates, forces, COST, 0.5, **more)


def test_a_trajectory_has_poses_rates_and_second_rates() -> None:
    found = adapter.ENGINE._trajectory(scene(), Setting("alpha", {"step": 0.1}), motion(message="m"))
    assert found.position[0].tolist() == [[1.0, 1.0, 0.0], [0.0, 5.0, 0.0]]
    assert found.orientation[0, 0] == pytest.approx([0.0, 0.0, 0.0, 1.0])
    assert found.velocity[0, 0].tolist() == [4.0, 5.0, 6.0] and found.angular_velocity[0, 0] == pytest.approx(
        [0, 0, 3]
    )
    assert found.acceleration is not None and found.acceleration[0, 0].tolist() == [7.0, 8.0, 9.0]
    assert found.angular_acceleration is not None and found.angular_acceleration[0, 0] == pytest.approx(
        [0, 0, 2]
    )
    assert found.reactions is not None and set(found.reactions) == {"H", "S"}
    assert (found.engine, found.method, found.settings) == ("exudyn", "alpha", {"step": 0.1})
    assert (found.message, found.cost, found.t_end, found.times.tolist()) == ("m", COST, 0.5, [0.5])


def test_accelerations_are_left_out_where_a_driver_accelerates() -> None:
    driven = scene(driver=(Driver(joint="H", polynomial=(0.0, 2.0, 1.0)),))
    setting = Setting("alpha", {"step": 0.1})
    for found in (
        adapter.ENGINE._trajectory(driven, setting, motion()),
        adapter.ENGINE._trajectory(scene(), setting, motion(False)),
    ):
        assert found.acceleration is None and found.angular_acceleration is None and found.reactions is None
    steady = scene(driver=(Driver(joint="H", polynomial=(0.0, 2.0)), Driver(joint="S")))
    wide = motion()
    object.__setattr__(wide, "forces", np.zeros((1, 14)))
    assert adapter.ENGINE._trajectory(steady, setting, wide).acceleration is not None


@pytest.mark.parametrize("family", ["static", "tuned", "alpha"])
def test_families_run_by_their_functions(family: str, monkeypatch: pytest.MonkeyPatch) -> None:
    import contextlib

    asked: list[Any] = []

    @contextlib.contextmanager
    def warnings(exu: Any) -> Any:
        yield ["WARNING: a", "WARNING: b"]

    said = ""
    monkeypatch.setattr(adapter, "_exudyn", lambda: "exu")
    monkeypatch.setattr(adapter, "_warnings", warnings)
    for name in ("drive", "extrapolate", "integrate"):
        monkeypatch.setattr(
            adapter, name, lambda *given, name=name: asked.append((name, *given)) or motion(message=said)
        )
    for given_message, message in (("", "WARNING: a; WARNING: b"), ("m", "m; WARNING: a; WARNING: b")):
        said = given_message
        found = adapter.ENGINE.run(scene(), np.array([0.5]), Setting(family, {"step": 0.1}))
        assert found.message == message
        name, exu, given, times, step, *more = asked.pop()
        wanted = {
            "static": ("drive", []),
            "tuned": ("extrapolate", [adapter._trapezoidal]),
            "alpha": ("integrate", [adapter._alpha]),
        }
        assert (name, more) == wanted[family]
        assert (exu, given, times.tolist(), step) == ("exu", scene(), [0.5], 0.1)


def test_steps_of_the_extrapolated_family_are_chosen_by_the_coarse_run(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Seen(adapter.Exudyn):
        def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Any:
            return times, setting

    times, setting = Seen()._coarse(scene(), 0.25)  # type: ignore[misc]
    assert times == pytest.approx(np.linspace(0.0, 2.0, len(times))) and len(times) == 26
    assert setting == Setting("alpha", {"step": 0.25})


# --- Static analysis --------------------------------------------------------------------------------------
def driven(**more: Any) -> Any:
    """A drive of one body without its system."""
    found: Any = object.__new__(static.Drive)
    found.now, found.steps, found.newton, found.factorisations = 0.0, 0, 0, 0
    found.state = np.zeros((2, 7))
    vars(found).update(more)
    return found


def test_the_analysis_moves_in_equal_steps() -> None:
    reached: list[float] = []
    found = driven(_step=reached.append)
    found.advance(0.5, 0.2)
    assert reached == pytest.approx([0.5 / 3, 1.0 / 3, 0.5])
    found.now = 0.5
    reached.clear()
    found.advance(0.5, 0.2)
    assert reached == []


@pytest.mark.parametrize(("moved", "stops"), [(0.24, False), (0.26, True), (0.06, False), (0.04, True)])
def test_a_pose_that_jumps_to_another_branch(moved: float, stops: bool) -> None:
    """At 1 and 2 m/s for 0.1 s the trapezoidal rule moves by 0.15 m; half of 0.2 m may be missed at most."""
    position = np.zeros(7)
    position[0] = moved
    data = SimpleNamespace(GetODE2Coordinates=position.tolist)
    rates = np.array([2.0, *[0.0] * 6])
    found = driven(_solve=lambda t, h: None, _rates=lambda t: rates)
    found.system = SimpleNamespace(mbs=SimpleNamespace(systemData=data))
    found.state[1, 0], found.now = 1.0, 0.4
    if stops:
        with pytest.raises(
            static.Stopped, match=r"the pose jumped to another branch before t = 0\.5 s"
        ) as stopped:
            found._step(0.5)
        assert stopped.value.outcome is Outcome.STEP_FAILED and found.now == 0.4
    else:
        found._step(0.5)
        assert (found.now, found.steps) == (0.5, 1) and found.state[:, 0].tolist() == [position[0], 2.0]


def test_rates_of_a_pose_follow_from_the_drivers() -> None:
    """[[2, 0], [0, 4]] q' = (6, 2); a tiny singular value, or too few rows, makes a pose singular."""
    found = driven(_jacobian=lambda: np.diag([2.0, 4.0]), _driver_rates=lambda t: np.array([6.0, 2.0]))
    assert found._rates(0.5) == pytest.approx([3.0, 0.5])
    for matrix in (np.diag([2.0, 1e-12]), np.ones((1, 2))):
        found._jacobian = lambda matrix=matrix: matrix
        found._driver_rates = lambda t, matrix=matrix: np.ones(len(matrix))
        with pytest.raises(
            static.Stopped, match=r"the constraint Jacobian loses rank at t = 0\.5 s"
        ) as stopped:
            found._rates(0.5)
        assert stopped.value.outcome is Outcome.SINGULAR_MATRIX


def test_rates_of_drivers_are_in_their_rows() -> None:
    drivers = (Driver(joint="H", polynomial=(0.0, 2.0, 3.0)), Driver(joint="S", polynomial=(0.0, 7.0)))
    data = SimpleNamespace(AEsize=lambda: 4, GetObjectLTGAE=lambda number: {8: 3, 9: 1}[number])
    found = driven(scene=scene(driver=drivers))
    found.system = SimpleNamespace(mbs=SimpleNamespace(systemData=data), drivers=[8, 9])
    assert found._driver_rates(0.5).tolist() == [0.0, 7.0, 0.0, 5.0]


def test_a_load_step_is_solved_and_counted() -> None:
    class Lost(Exception):
        pass

    settings = SimpleNamespace(staticSolver=SimpleNamespace())
    it = SimpleNamespace(newtonStepsCount=5, newtonJacobiCount=2)
    solved: list[Any] = []

    def solve(given: Any, updateInitialValues: bool) -> None:
        solved.append(
            (given.staticSolver.loadStepStart, given.staticSolver.loadStepDuration, updateInitialValues)
        )
        if len(solved) > 2:
            raise Lost("no")

    found = driven(_settings=lambda: settings, exu=SimpleNamespace(SolverError=Lost, InternalError=Lost))
    found.system = SimpleNamespace(
        mbs=SimpleNamespace(SolveStatic=solve, sys={"staticSolver": SimpleNamespace(it=it)})
    )
    found.now = 0.25
    found._solve(0.5, 0.125)
    found._solve(0.5, 0.125)
    assert solved == [(0.25, 0.125, True)] * 2 and (found.newton, found.factorisations) == (10, 4)
    with pytest.raises(static.Stopped, match=r"no pose was found for t = 0\.5 s: ") as stopped:
        found._solve(0.5, 0.125)
    assert stopped.value.outcome is Outcome.NOT_CONVERGED and found.newton == 10


@pytest.mark.parametrize("stops", [None, 0.5])
def test_a_run_of_the_static_analysis(stops: float | None, monkeypatch: pytest.MonkeyPatch) -> None:
    class Moving:
        def __init__(self, exu: Any, scene: Scene) -> None:
            self.state, self.now = np.zeros((2, 14)), 0.0
            self.steps, self.factorisations, self.newton = 3, 4, 5

        def start(self) -> None:
            self.state = np.ones((2, 14))

        def advance(self, t: float, step: float) -> None:
            assert step == 0.25
            if t == stops:
                raise static.Stopped(Outcome.STEP_FAILED, "lost")
            self.state, self.now = np.full((2, 14), t), t

    monkeypatch.setattr(static, "Drive", Moving)
    found = static.drive("exu", scene(), np.array([0.0, 0.25, 0.5]), 0.25)
    count = 2 if stops else 3
    assert found.times.tolist() == [0.0, 0.25, 0.5][:count] and found.coordinates.shape == (2, count, 2, 7)
    assert found.coordinates[1, 1, 1, 6] == 0.25 and found.forces is None
    assert (found.outcome, found.message) == (
        (Outcome.STEP_FAILED, "lost") if stops else (Outcome.COMPLETED, "")
    )
    cost = found.cost
    assert (cost.steps, cost.rejected, cost.rhs, found.t_end) == (3, 0, 0, 0.25 if stops else 0.5)
    assert 0 <= cost.seconds < 60 and 0 <= cost.build_seconds < 60
    monkeypatch.setattr(
        Moving, "start", lambda self: (_ for _ in ()).throw(static.Stopped(Outcome.SINGULAR_MATRIX, "s"))
    )
    assert static.drive("exu", scene(), np.array([0.0]), 0.25).outcome is Outcome.SINGULAR_MATRIX
