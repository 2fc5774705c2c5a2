"""Adapters without their engines / the calls of DART's model and the runs of code generators, worked out by
hand."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.engine import Owner, Setting
from crosscheck.engines import own_steps
from crosscheck.engines import pieces as pieces_module
from crosscheck.engines.dart import adapter as dart_adapter
from crosscheck.engines.dart.adapter import ENGINE as DART
from crosscheck.engines.dart.adapter import Dart
from crosscheck.engines.dart.model import Mechanism
from crosscheck.engines.drake import adapter as drake_adapter
from crosscheck.engines.joint_coordinates import JointCoordinates
from crosscheck.engines.pieces import Piece, assembled
from crosscheck.engines.sampling import UNKNOWN, Failed, Sample
from crosscheck.engines.spanning_tree import BALL_JOINT, FREE, SLIDE, TURN, Closure, Mobility, spanning_tree
from crosscheck.engines.symbolic import generator
from crosscheck.engines.symbolic.generator import Generator, sweep
from crosscheck.engines.tree_reactions import LinkMotion
from mbref.scene import Body, Cylindrical, Driver, Force, Moment, Revolute, Scene, Spherical
from mbref.trajectory import Cost, Outcome

HINGE = Revolute(name="H", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 2.0))
BODY = Body(name="b", mass=4.0, inertia=(1.0, 2.0, 2.5), position=(1.0, 0.0, 0.0))
PULL = Force(body="b", point=(1.0, 0.0, 0.0), force=(0.0, 1.0, 0.0))
ANCHOR = np.array([1.0, 2.0, 3.0])


def scene(**parts: Any) -> Scene:
    return Scene(**{"name": "s", "body": (BODY,), "joint": (HINGE,), "duration": 2.0, **parts})


def mechanism(**parts: Any) -> Any:
    """A model without its skeleton, with some attributes."""
    found: Any = Mechanism.__new__(Mechanism)
    for name, value in parts.items():
        setattr(found, name, value)
    return found


def free(first: int, nv: int) -> JointCoordinates:
    """Coordinates with single joints before and after one free link at velocity ``first``."""
    before, after = np.arange(first), np.arange(first + 6, nv)
    return JointCoordinates(
        nv,
        nv + 1,
        np.concatenate([before, after]),
        np.concatenate([before, after + 1]),
        ((first + 3, first + 3),),
        ((first, first),),
        True,
    )


# --- DART's constraints -----------------------------------------------------------------------------------
def called(name: str) -> Any:
    return lambda *given: (name, *(list(g) if isinstance(g, np.ndarray) else g for g in given))


CONSTRAINT = SimpleNamespace(
    WeldJointConstraint=called("weld"),
    BallJointConstraint=called("ball"),
    RevoluteJointConstraint=called("hinge"),
)


def constraints(kind: str, links: tuple[int, int], as_balls: bool) -> list[Any]:
    given = mechanism(dart=SimpleNamespace(constraint=CONSTRAINT), scene=scene(), nodes=["n0", "n1"])
    return given.constraints(Closure(kind, 0, links, ANCHOR), as_balls)


@pytest.mark.parametrize("as_balls", [False, True])
def test_dart_closes_welds_and_points_alike_in_both_families(as_balls: bool) -> None:
    assert constraints("weld", (1, 0), as_balls) == [("weld", "n1", "n0")]
    assert constraints("point", (0, 1), as_balls) == [("ball", "n0", "n1", [1.0, 2.0, 3.0])]
    assert constraints("point", (-1, 1), as_balls) == [("ball", "n1", [1.0, 2.0, 3.0])]


def test_dart_closes_a_hinge_with_one_axis_for_each_body() -> None:
    axis = [0.0, 0.0, 1.0]
    found = constraints("revolute", (0, 1), as_balls=False)
    assert found == [("hinge", "n0", "n1", [1.0, 2.0, 3.0], axis, axis)]
    assert constraints("revolute", (0, -1), as_balls=False) == [("hinge", "n0", [1.0, 2.0, 3.0], axis)]


def test_dart_closes_a_hinge_with_two_balls_on_its_axis() -> None:
    one, other = constraints("revolute", (0, 1), as_balls=True)
    assert one[:3] == ("ball", "n0", "n1") and other[:3] == ("ball", "n0", "n1")
    assert one[3][:2] == other[3][:2] == [1.0, 2.0]
    assert one[3][2] + other[3][2] == pytest.approx(6.0) and one[3][2] < 3.0 < other[3][2]


# --- DART's order of coordinates --------------------------------------------------------------------------
def test_dart_has_the_angular_velocity_of_a_free_link_first() -> None:
    given = mechanism(tree=SimpleNamespace(nv=8), coordinates=free(1, 8))
    assert list(given._order()) == [0, 4, 5, 6, 1, 2, 3, 7]
    given.order = given._order()
    assert list(given._in_order(np.arange(10.0, 18.0))) == [10, 14, 15, 16, 11, 12, 13, 17]


def test_dart_is_given_rotation_vectors_before_places() -> None:
    put: dict[str, Any] = {}
    skeleton = SimpleNamespace(
        setPositions=lambda q: put.update(q=list(q)), setVelocities=lambda v: put.update(v=list(v))
    )
    given = mechanism(tree=SimpleNamespace(nv=8), coordinates=free(1, 8), skeleton=skeleton)
    given.order = given._order()
    half = math.sqrt(0.5)
    given._put(np.array([0.5, 1, 2, 3, half, 0, half, 0, 0.25]), np.arange(8.0))
    assert put["q"] == pytest.approx([0.5, 0.0, math.pi / 2, 0.0, 1.0, 2.0, 3.0, 0.25])
    assert put["v"] == [0, 4, 5, 6, 1, 2, 3, 7]


def node(**answers: Any) -> Any:
    return SimpleNamespace(**{name: lambda *_, value=value: value for name, value in answers.items()})


def frame(x: float) -> Any:
    return node(rotation=np.eye(3) * x, translation=np.array([x, 0.0, 0.0]))


def test_dart_gives_terms_in_the_order_of_the_tree() -> None:
    order = np.array([0, 4, 5, 6, 1, 2, 3])
    put: list[Any] = []
    skeleton = SimpleNamespace(
        setPositions=lambda q: None,
        setVelocities=lambda v: None,
        setAccelerations=lambda a: put.append(list(a)),
        getMassMatrix=lambda: np.arange(49.0).reshape(7, 7),
        getCoriolisAndGravityForces=lambda: np.arange(7.0),
    )
    one = node(
        getNumDependentGenCoords=2,
        getLinearJacobian=np.array([[1.0, 2.0]] * 3),
        getAngularJacobian=np.array([[3.0, 4.0]] * 3),
        getLinearAcceleration=np.array([1.0, 2.0, 3.0]),
        getAngularAcceleration=np.array([4.0, 5.0, 6.0]),
        getWorldTransform=frame(2.0),
    )
    one.getDependentGenCoordIndex = lambda i: (0, 4)[i]
    given = mechanism(tree=SimpleNamespace(nv=7), coordinates=free(1, 7), skeleton=skeleton, order=order)
    given.nodes = [one]
    q = np.zeros(8)
    q[4] = 1.0
    found = given.terms(q, np.zeros(7))
    assert put == [[0.0] * 7]
    assert list(found.mass[1]) == [28.0, 32.0, 33.0, 34.0, 29.0, 30.0, 31.0]
    assert list(found.bias) == [0, 4, 5, 6, 1, 2, 3]
    assert list(found.jacobian[0][0]) == [1, 2, 0, 0, 0, 0, 0]
    assert list(found.jacobian[0][5]) == [3, 4, 0, 0, 0, 0, 0]
    assert list(found.drift[0]) == [1, 2, 3, 4, 5, 6]
    assert found.rotation.tolist() == [(2 * np.eye(3)).tolist()] and found.position.tolist() == [[2, 0, 0]]


def test_dart_gives_the_motion_of_links_without_accelerations() -> None:
    given = mechanism(tree=SimpleNamespace(nv=8), coordinates=free(1, 8))
    given.order = given._order()
    given.skeleton = node(getPositions=np.arange(1.0, 9.0), getVelocities=np.arange(10.0, 18.0))
    velocity, spin = np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0])
    given.nodes = [node(getWorldTransform=frame(3.0), getLinearVelocity=velocity, getAngularVelocity=spin)]
    found = given.motion()
    assert list(found.coordinates) == [1, 0, 0, 0, 0, 0, 0, 8]
    assert list(found.rates) == [10, 14, 15, 16, 11, 12, 13, 17]
    assert found.velocity.tolist() == [[1, 2, 3]] and found.angular_velocity.tolist() == [[4, 5, 6]]
    assert found.position.tolist() == [[3, 0, 0]] and found.rotation[0][1, 1] == 3.0
    assert found.acceleration is UNKNOWN and found.angular_acceleration is UNKNOWN


# --- DART's bodies and joints -----------------------------------------------------------------------------
class Skeleton:
    """Records the pairs of joints and bodies that are created."""

    def __init__(self) -> None:
        self.made: list[Any] = []

    def __getattr__(self, name: str) -> Any:
        def create(*parent: Any) -> Any:
            record: dict[str, Any] = {"kind": name, "parent": parent}
            self.made.append(record)
            joint = SimpleNamespace(
                setAxis=lambda axis: record.update(axis=list(axis)),
                setTransformFromParentBodyNode=lambda at: record.update(above=at.place),
                setTransformFromChildBodyNode=lambda at: record.update(below=at.place),
            )
            body = SimpleNamespace(
                setCollidable=lambda on: record.update(collides=on),
                setInertia=lambda inertia: record.update(inertia=inertia),
            )
            record.update(joint=joint, body=body)
            return joint, body

        return create


class Isometry:
    def set_translation(self, place: np.ndarray) -> None:
        self.place = list(place)


def piece(parent: int, mobility: Mobility | None, velocity: int) -> Piece:
    place, anchor = np.array([1.0, 2.0, 3.0]) + 10 * parent, np.array([4.0, 4.0, 4.0])
    return Piece(0, parent, mobility, velocity, place, anchor, 5.0, np.zeros(3), np.eye(3))


@pytest.mark.parametrize(
    ("kind", "name", "axis"),
    [
        (SLIDE, "createPrismaticJointAndBodyNodePair", [0.0, 0.0, 1.0]),
        (TURN, "createRevoluteJointAndBodyNodePair", [0.0, 0.0, 1.0]),
        (BALL_JOINT, "createBallJointAndBodyNodePair", None),
        (FREE, "createFreeJointAndBodyNodePair", None),
        (None, "createWeldJointAndBodyNodePair", None),
    ],
)
def test_dart_adds_a_body_with_its_joint(kind: Any, name: str, axis: list[float] | None) -> None:
    dart = SimpleNamespace(
        math=SimpleNamespace(Isometry3=Isometry),
        dynamics=SimpleNamespace(Inertia=lambda mass, offset, inertia: (mass, list(offset), inertia[1, 1])),
    )
    given = mechanism(dart=dart, skeleton=Skeleton())
    moving = piece(0, kind and Mobility(kind, np.array([0.0, 0.0, 2.0])), 7)
    pair = given._add("1", moving, "parent", np.array([13.0, 12.0, 11.0]), np.array([3.0, 2.0, 1.0]))
    [made] = given.skeleton.made
    assert pair == (made["joint"], made["body"])
    assert made["kind"] == name and made["parent"] == ("parent",) and made.get("axis") == axis
    assert made["above"] == [13.0, 12.0, 11.0] and made["below"] == [3.0, 2.0, 1.0]
    assert made["collides"] is False and made["inertia"] == (5.0, [0.0, 0.0, 0.0], 1.0)


@pytest.mark.parametrize("kind", [SLIDE, None])
def test_pieces_are_added_with_their_joints_places(kind: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first piece has its origin at (-9, -8, -7), the second at (1, 2, 3); anchors are at (4, 4, 4)."""
    first, second = piece(-1, None, 0), piece(0, kind and Mobility(kind, np.zeros(3)), 7)
    auxiliary = replace(piece(1, Mobility(TURN, np.zeros(3)), 9), link=-1)
    monkeypatch.setattr(pieces_module, "pieces", lambda tree, share: [first, second, auxiliary])
    added: list[Any] = []

    def add(name: str, one: Piece, parent: Any, above: np.ndarray, below: np.ndarray) -> tuple[str, str]:
        added.append((name, one, parent, above.tolist(), below.tolist()))
        return f"joint {name}", f"body {name}"

    found = assembled("tree", 0.5, "ground", add)  # type: ignore[arg-type]
    assert added == [
        ("0", first, "ground", [4.0, 4.0, 4.0], [13.0, 12.0, 11.0]),
        ("1", second, "body 0", [13.0, 12.0, 11.0], [3.0, 2.0, 1.0]),
        ("2", auxiliary, "body 1", [3.0, 2.0, 1.0], [-7.0, -8.0, -9.0]),
    ]
    joints = {9: "joint 2"} if kind is None else {7: "joint 1", 9: "joint 2"}
    assert found == (["body 0", "body 1"], joints)


def test_dart_builds_the_pieces_of_a_tree_and_keeps_the_nodes_of_its_links(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    names: list[str] = []
    put: dict[str, Any] = {}

    def created(name: str) -> Any:
        names.append(name)
        skeleton.setGravity = lambda g: put.update(gravity=list(g))
        skeleton.setVelocities = lambda v: put.update(v=list(v))
        return skeleton

    skeleton: Any = Skeleton()
    dart = ModuleType("dartpy")
    vars(dart).update(
        math=SimpleNamespace(Isometry3=Isometry),
        dynamics=SimpleNamespace(Skeleton=created, Inertia=lambda mass, *_: mass),
    )
    monkeypatch.setitem(sys.modules, "dartpy", dart)
    turn = Cylindrical(name="C", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 2.0))
    ball = Spherical(name="B", bodies=("b", "c"), anchor=(1.0, 0.0, 0.0))
    second = BODY.model_copy(update={"name": "c", "mass": 7.0})
    given = scene(body=(BODY, second), joint=(turn, ball), gravity=(0.0, 0.0, -9.0))
    found = Mechanism(given, spanning_tree(given))
    assert skeleton.made[0]["parent"] == (None,)
    assert names == ["s"] and put == {"gravity": [0.0, 0.0, -9.0], "v": [0.0] * 5}
    light, first, last = (record["inertia"] for record in skeleton.made)
    assert 0 < light < 1e-20 and (first, last) == (4.0, 7.0)
    assert found.nodes == [record["body"] for record in skeleton.made[1:]]
    assert list(found.joints) == [0, 1, 2] and found.coordinates.in_child
    assert skeleton.made[2]["parent"] == (skeleton.made[1]["body"],)


# --- DART's world -----------------------------------------------------------------------------------------
class World:
    """Records what is set, added and stepped."""

    def __init__(self) -> None:
        self.log: list[Any] = []
        self.asleep = SimpleNamespace(mEnabled=True)

    def __getattr__(self, name: str) -> Any:
        return lambda *given: self.log.append((name, *map(float, given)))

    def addSkeleton(self, skeleton: Any) -> None:
        self.log.append(skeleton)

    def setGravity(self, gravity: np.ndarray) -> None:
        self.log.append(list(gravity))

    def getDeactivationOptions(self) -> Any:
        return self.asleep

    def setDeactivationOptions(self, asleep: Any) -> None:
        self.log.append(asleep.mEnabled)

    def getConstraintSolver(self) -> Any:
        return SimpleNamespace(addConstraint=self.log.append)


class Joint:
    rate = 0.0

    def __init__(self) -> None:
        self.log: list[Any] = []

    def setActuatorType(self, kind: str) -> None:
        self.log.append(kind)

    def setVelocity(self, index: int, rate: float) -> None:
        self.log.append((index, rate))
        self.rate = rate

    def getVelocity(self, index: int) -> float:
        return self.rate + 10 * index

    def setCommand(self, index: int, command: float) -> None:
        self.log.append((index, command))


def world(family: str, monkeypatch: pytest.MonkeyPatch) -> tuple[Any, Joint, list[Any]]:
    """A world of a scene with one driver and one closure, its driven joint, and the errors per step set."""
    errors: list[Any] = []
    asked: list[bool] = []

    def constraints(closure: str, as_balls: bool) -> list[Any]:
        asked.append(as_balls)
        record = SimpleNamespace(setErrorReductionParameter=lambda erp: errors.append((closure, erp)))
        return [record]

    driven, other = Joint(), Joint()
    driver = Driver(joint="H", polynomial=(0.0, 2.0, 3.0))
    given = scene(driver=(driver,), load=(PULL,), gravity=(0.0, -9.0, 0.0))
    tree = SimpleNamespace(closures=("closure",), driven=lambda scene: [(1, scene.driver[0])])
    dart = SimpleNamespace(
        simulation=SimpleNamespace(World=World),
        dynamics=SimpleNamespace(ActuatorType=SimpleNamespace(ACCELERATION="acceleration")),
    )
    model = SimpleNamespace(
        scene=given,
        tree=tree,
        dart=dart,
        skeleton="skeleton",
        joints={0: other, 1: driven},
        constraints=constraints,
        nodes=["n0", Pushed(errors)],
    )
    monkeypatch.setattr(own_steps, "Loads", lambda *given: SimpleNamespace(at=loads_at))
    found = dart_adapter._World(model, family == "balls", 0.25)  # type: ignore[arg-type]
    assert asked == [family == "balls"] and other.log == []
    return found, driven, errors


class Pushed:
    def __init__(self, log: list[Any]) -> None:
        self.log = log

    def addExtForce(self, force: Any, at: Any, is_local: bool, is_local_point: bool) -> None:
        self.log.append((force, list(at), is_local, is_local_point))

    def addExtTorque(self, moment: Any, is_local: bool) -> None:
        self.log.append((moment, is_local))


def loads_at(t: float) -> list[Any]:
    return [(1, f"force {t:g}", f"moment {t:g}")]


@pytest.mark.parametrize("family", ["defaults", "balls"])
def test_dart_steps_a_world_with_drivers_and_loads(family: str, monkeypatch: pytest.MonkeyPatch) -> None:
    found, driven, log = world(family, monkeypatch)
    begun = ["skeleton", [0.0, -9.0, 0.0]]
    assert found.world.log[:2] == begun and log == [("closure", 0.25)]
    assert found.world.log[3:] == ([] if family == "defaults" else [False])
    assert driven.log == ["acceleration", (0, 2.0)]  # the rate of 2 t + 3 t² at t = 0
    for recorded in (found.world.log, driven.log, log):
        recorded.clear()
    found.step(1.0, 0.5, 2)
    assert found.world.log == [("setTimeStep", 0.5), ("step",), ("step",)]
    # mean rates 2 + 3 (2 t + h) of the steps from 1 s and 1.5 s are 9.5 and 12.5; the joint's rate stays at 2
    assert driven.log == [(0, pytest.approx(15.0)), (0, pytest.approx(21.0))]
    assert log == [
        ("force 1", [0.0, 0.0, 0.0], False, True),
        ("moment 1", False),
        ("force 1.5", [0.0, 0.0, 0.0], False, True),
        ("moment 1.5", False),
    ]


# --- DART's families --------------------------------------------------------------------------------------
GEARED = scene(joint=(HINGE.model_copy(update={"armature": 0.5}),))


def test_dart_runs_gears_and_armatures_only_by_its_terms() -> None:
    assert [DART.serves(scene(), family) for family in ("terms", "defaults", "balls", "none")] == [1, 1, 1, 0]
    assert [DART.serves(GEARED, family) for family in ("terms", "defaults", "balls", "none")] == [1, 0, 0, 0]
    with pytest.raises(ValueError) as raised:
        DART.run(GEARED, np.array([0.0]), Setting("defaults", {"step": 0.1, "erp": 0.01}))
    assert str(raised.value) == "family 'defaults' of dart cannot run the scene 's'"


def test_dart_offers_its_own_steps_from_a_scouted_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []

    def scouted(engine: Any, given: Scene, family: str, **options: float) -> float:
        asked.append((engine.name, given.name, family, options))
        return 3.0

    monkeypatch.setattr(own_steps, "scouted_rate", scouted)
    monkeypatch.setattr(
        own_steps, "steps", lambda given, rate, finer, most: [rate / 100, rate / 1000 * finer]
    )
    monkeypatch.setattr(Dart, "default_steps", {"defaults": 0.01})
    monkeypatch.setattr(own_steps.terms, "sweep", lambda rate: [Setting("terms", {"rtol": rate})])
    found = [(s.family, dict(s.options)) for s in DART.settings(scene())]
    assert asked == [("dart", "s", "defaults", {"erp": 0.01})]
    assert found == [
        ("terms", {"rtol": 3.0}),
        ("defaults", {"step": 0.03, "erp": 0.01}),
        ("defaults", {"step": 0.01, "erp": 0.01}),
        ("defaults", {"step": 0.006, "erp": 0.01}),
        ("balls", {"step": 0.03, "erp": 0.5}),
        ("balls", {"step": 0.006, "erp": 0.5}),
    ]
    monkeypatch.setattr(own_steps, "stated_rate", lambda given: 7.0)
    assert [(s.family, dict(s.options)) for s in DART.settings(GEARED)] == [("terms", {"rtol": 7.0})]


def test_dart_closes_a_plane_scene_by_balls_with_the_fewest_coordinates(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ran: list[Any] = []

    def simulated(engine: Any, given: Scene, times: Any, setting: Setting, create: Any) -> Any:
        ran.append((given.name, create()))

    def simulation(engine: Any, given: Scene, times: Any, setting: Setting) -> Any:
        return given.name, setting.family

    monkeypatch.setattr(own_steps, "simulated", simulated)
    monkeypatch.setattr(Dart, "simulation", simulation)
    monkeypatch.setattr(own_steps, "planar_scene", lambda given: given.with_(name="planar"))
    for family in ("balls", "defaults"):
        DART.run(scene(), np.array([0.0]), Setting(family, {"step": 0.1, "erp": 0.5}))
    assert ran == [("planar", ("planar", "balls")), ("s", ("s", "defaults"))]


# --- engines with own steps -------------------------------------------------------------------------------
class Steps:
    """A world that records the lengths of its steps."""

    tree = "tree"

    def __init__(self) -> None:
        self.begun: list[float] = []

    def begin(self, h: float) -> None:
        self.begun.append(h)


@pytest.mark.parametrize(
    ("times", "begun"),
    [([0.0, 0.5, 2.0], [0.25]), ([0.75], [0.25]), ([0.1], [0.1]), ([0.0], [])],
)
def test_the_first_step_is_prepared_before_the_timed_run(
    times: list[float], begun: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    world = Steps()
    monkeypatch.setattr(Dart, "world", lambda engine, given, setting: world)
    run = DART.simulation(scene(), np.array(times), Setting("balls", {"step": 0.3, "erp": 0.5}))
    assert world.begun == pytest.approx(begun)
    assert (run.stepper, run.tree, run.longest) == (world, "tree", 0.3)  # type: ignore[attr-defined]


def test_a_world_without_drivers_names_its_module() -> None:
    with pytest.raises(NotImplementedError, match=r"drake\.adapter moves no joint"):
        drake_adapter._Plant.drive(drake_adapter._Plant.__new__(drake_adapter._Plant), None, 1.0, 0.1)


@pytest.mark.parametrize("sends_new", [False, True])
def test_drake_receives_loads_again_if_they_or_the_plant_change(
    sends_new: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Constant loads are one list; each length of step has one plant, which takes over the state."""
    fixed: list[Any] = []
    modules = {
        "pydrake.common.value": {"Value": {list[SimpleNamespace]: lambda found: found}},
        "pydrake.multibody.math": {"SpatialForce": lambda tau, f: (tau, f)},
        "pydrake.multibody.plant": {"ExternallyAppliedSpatialForce": SimpleNamespace},
    }
    for name, content in modules.items():
        vars(stand_in := ModuleType(name)).update(content)
        monkeypatch.setitem(sys.modules, name, stand_in)

    class Made:
        scene, joints, coordinates = scene(load=(PULL,)), {}, None
        tree = SimpleNamespace(driven=lambda given: [])
        bodies = (None, SimpleNamespace(index=lambda: 7))

        def __init__(self, given: Any, tree: Any, step: float) -> None:
            port = SimpleNamespace(
                FixValue=lambda context, value: fixed.append((step, value[0].body_index, value[0].F_Bq_W))
            )
            states = ["start"]
            self.context = SimpleNamespace(
                state=states,
                SetDiscreteState=states.append,
                get_discrete_state=lambda: SimpleNamespace(Clone=lambda: states[-1]),
            )
            self.plant = SimpleNamespace(
                time_step=lambda: step,
                get_applied_spatial_force_input_port=lambda: port,
                EvalUniquePeriodicDiscreteUpdate=lambda context: f"{context.state[-1]}, {step:g}",
            )

    loads = [(1, "force", "moment")]
    monkeypatch.setattr(drake_adapter, "Mechanism", Made)
    monkeypatch.setattr(
        own_steps,
        "Loads",
        lambda *given: SimpleNamespace(at=lambda t: list(loads) if sends_new else loads),
    )
    found = drake_adapter._Plant(Made(None, None, 0.5))  # type: ignore[arg-type]
    found.step(0.0, 0.5, 2)
    found.step(1.0, 0.25, 1)
    found.step(1.25, 0.25, 1)
    one, other = (0.5, 7, ("moment", "force")), (0.25, 7, ("moment", "force"))
    assert fixed == ([one, one] if sends_new else [one]) + [other, other]
    assert list(found.plants) == [0.5, 0.25] and found.mechanism is found.plants[0.25]
    assert found.mechanism.context.state[-1] == "start, 0.5, 0.5, 0.25, 0.25"


# --- code generators --------------------------------------------------------------------------------------
FAMILIES = {"explicit": "about"}


class Stub(Generator):
    name = "stub"
    package = "numpy"
    families = FAMILIES

    def settings(self, scene: Scene) -> list[Setting]:
        return []

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Any:
        raise NotImplementedError


def sampled(_: Scene, y: np.ndarray) -> Sample:
    """A sample whose first place is the first number of the state."""
    row = np.full((1, 3), y[0])
    return Sample(row, np.full((1, 4), y[0]), row, row, row, row, {"H": np.full(6, y[0])})


def trajectory(states: list[float], failure: Failed | None) -> Any:
    cost = Cost(1.5, 2.5, 10, 4, 70)
    given = Setting("explicit", {"rtol": 1e-6})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(generator, "_sample", sampled)
        times = np.array([0.0, 0.5, 1.0])[: max(len(states), 1) if failure is None else 3]
        return Stub()._trajectory(scene(), times, given, np.array(states).reshape(-1, 1), failure, cost)


def test_a_run_of_generated_code_has_a_sample_for_each_state() -> None:
    found = trajectory([1.0, 2.0, 3.0], None)
    assert list(found.times) == [0.0, 0.5, 1.0] and found.position[:, 0, 0].tolist() == [1.0, 2.0, 3.0]
    assert found.reactions["H"][:, 5].tolist() == [1.0, 2.0, 3.0]
    assert (found.engine, found.method, found.settings) == ("stub", "explicit", {"rtol": 1e-6})
    assert found.version == np.__version__
    assert (found.outcome, found.t_end, found.message) == (Outcome.COMPLETED, 1.0, "")
    assert found.cost == Cost(1.5, 2.5, 10, 4, 70)


def test_a_run_of_generated_code_ends_with_its_failure() -> None:
    found = trajectory([1.0, 2.0], Failed(Outcome.STEP_FAILED, 0.75, "the step failed"))
    assert found.position[:, 0, 0].tolist() == [1.0, 2.0]
    assert (found.outcome, found.t_end, found.message) == (Outcome.STEP_FAILED, 0.75, "the step failed")
    assert found.cost == Cost(1.5, 2.5, 10, 4, 70)


def test_generated_code_without_states_names_the_time() -> None:
    with pytest.raises(ValueError) as raised:
        trajectory([], None)
    assert str(raised.value) == "stub gave no state at 0 s"


def test_a_sample_of_generated_code_has_the_bodies_of_the_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    half = math.sqrt(0.5)
    turned = scene(body=(BODY.model_copy(update={"orientation": (half, half, 0.0, 0.0)}),))
    rows = np.arange(6.0).reshape(2, 3)
    motion = LinkMotion(
        np.array([np.eye(3), [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]]),
        rows,
        rows + 10,
        rows + 20,
        UNKNOWN,
        UNKNOWN,
        rows + 30,
        rows + 40,
    )
    equations = SimpleNamespace(
        tree=SimpleNamespace(own=(1,)), link_motion=lambda y: (motion, [y]), has_own_joints=True
    )
    monkeypatch.setattr(generator, "equations_of", lambda given: equations)
    monkeypatch.setattr(generator, "joint_reactions", lambda *given: {"H": given[1:]})
    found = generator._sample(turned, np.array([9.0]))
    assert found.position.tolist() == [[3, 4, 5]] and found.velocity.tolist() == [[13, 14, 15]]
    assert found.angular_velocity.tolist() == [[23, 24, 25]]
    assert found.acceleration.tolist() == [[33, 34, 35]]
    assert found.angular_acceleration.tolist() == [[43, 44, 45]]
    assert found.orientation[0] == pytest.approx([0.5, 0.5, 0.5, 0.5])
    assert found.reactions == {"H": (equations.tree, motion, [np.array([9.0])])}
    equations.has_own_joints = False
    assert generator._sample(turned, np.array([9.0])).reactions == {}


LINE = "its equations in joint coordinates are not derived: "
BALL = Spherical(name="B", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        (scene(), None),
        (scene(load=(Moment(body="b", moment=(0.0, 0.0, 1.0)),)), None),
        (
            scene(load=(Force(body="b", point=(0.0, 0.0, 0.0), force=(0.0, 0.0, 1.0)),)),
            "it has drivers, or loads other than moments",
        ),
        (scene(joint=(HINGE.model_copy(update={"bodies": ("b", "ground")}),)), None),
        (
            scene(joint=(BALL,)),
            "its tree has free or ball joints, or loops that points do not close",
        ),
    ],
)
def test_a_generator_refuses_equations_that_are_not_derived(given: Scene, reason: str | None) -> None:
    found = Stub().refuses(given)
    assert (found and (found.owner, found.reason)) == (reason and (Owner.ADAPTER, LINE + reason))


def test_a_generator_knows_its_families_and_its_tolerances() -> None:
    assert Stub().serves(scene(), "explicit") and not Stub().serves(scene(), "implicit")
    Stub()._known(Setting("explicit", {}))
    with pytest.raises(ValueError) as raised:
        Stub()._known(Setting("implicit", {}))
    assert str(raised.value) == "stub has no family of settings 'implicit'"
    assert sweep("explicit", (1e-3, 1e-6), beta=2.0) == [
        Setting("explicit", {"rtol": 1e-3, "beta": 2.0}),
        Setting("explicit", {"rtol": 1e-6, "beta": 2.0}),
    ]


def test_the_origin_of_code_changes_with_the_scene_and_every_part() -> None:
    keys = [generator.origin(scene(), *parts) for parts in ((), ("a",), ("b",), ("a", "b"))]
    keys.append(generator.origin(scene(name="t"), "a"))
    assert len(set(keys)) == 5 and keys[1] == generator.origin(scene(), "a")
