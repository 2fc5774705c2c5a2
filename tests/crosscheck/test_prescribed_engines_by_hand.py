"""OndselSolver's assemblies and Simbody's models of small scenes / numbers and parts worked out by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.engine import Owner, Setting
from crosscheck.engines.geometry import joint_frame
from crosscheck.engines.ondsel import adapter as ondsel
from crosscheck.engines.ondsel import model as assemblies
from crosscheck.engines.sampling import Failed
from crosscheck.engines.simbody import adapter as simbody
from crosscheck.engines.simbody import model as simbodies
from crosscheck.engines.spanning_tree import Closure, Link
from mbref import rotations
from mbref.scene import (
    Body,
    Cylindrical,
    Distance,
    Driver,
    Fixed,
    Force,
    Moment,
    Planar,
    Revolute,
    Scene,
    Spring,
    TorsionSpring,
    Universal,
)
from mbref.trajectory import Outcome

BODY = Body(name="b", mass=4.0, inertia=(2.0, 1.0, 2.5), position=(1.0, 0.0, 0.0))
HINGE = Revolute(name="H", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 2.0))
DRIVER = Driver(joint="H", polynomial=(0.0, 2.0, 3.0))
HALF = math.sqrt(0.5)


def scene(**parts: Any) -> Scene:
    given = {"name": "s", "body": (BODY,), "joint": (HINGE,), "driver": (DRIVER,), "duration": 2.0}
    return Scene(**{"gravity": (0.0, -9.0, 0.0), **given, **parts})


# --- OndselSolver's tables --------------------------------------------------------------------------------
ANSWER = (
    "x\nTimeSeries\nNumber\t2\nTime\t0\t1\n"
    "AsmtPart\t/scene/b0\nX\t9\t1\t2\t3\t\nY\t9\t4\t5\t6\nJoint\t/scene/j1\nFX\t9\t7\t8\t9.5\n"
)


def test_rows_of_a_result_without_the_given_poses() -> None:
    """The first column is the given pose; two frames follow it after the start."""
    found = assemblies.table(ANSWER, 2)
    assert found.series["b0"]["X"].tolist() == [1.0, 2.0, 3.0] and found.series["j1"]["FX"].tolist() == [
        7,
        8,
        9.5,
    ]
    assert found.three("b0", "X", "Y", "X").tolist() == [[1, 4, 1], [2, 5, 2], [3, 6, 3]]
    assert found.three("d1", "FX", "FX", "FX").tolist() == [[0.0] * 3] * 3
    with pytest.raises(ValueError, match="the analysis ended after 2 of 3 steps"):
        assemblies.table(ANSWER, 3)
    with pytest.raises(ValueError, match="the analysis ended after 0 of 2 steps"):
        assemblies.table(ANSWER.replace("\t9\t1\t2\t3\t", ""), 2)


def test_principal_axes_have_the_one_nearest_to_an_axis_last() -> None:
    moments, axes = assemblies._principal(np.diag([2.0, 1.0, 2.5]), np.array([0.1, 0.9, 0.2]))
    assert moments[2] == 1.0 and abs(axes[1, 2]) == 1.0 and np.linalg.det(axes) == pytest.approx(1.0)
    assert axes @ np.diag(moments) @ axes.T == pytest.approx(np.diag([2.0, 1.0, 2.5]))
    for axis in np.eye(3):
        moments, axes = assemblies._principal(np.diag([2.0, 1.0, 2.5]), -axis)
        assert abs(axes[:, 2]) == pytest.approx(axis) and np.linalg.det(axes) == pytest.approx(1.0)
        assert axes @ np.diag(moments) @ axes.T == pytest.approx(np.diag([2.0, 1.0, 2.5]))


def test_a_marker_is_turned_back_about_its_third_axis() -> None:
    name, point, axes = assemblies._turned_back("b", np.array([1.0, 2.0, 3.0]), np.eye(3), math.pi / 2)
    assert name == "b" and point.tolist() == [1.0, 2.0, 3.0]
    assert axes == pytest.approx(np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), abs=1e-15)


def test_expressions_of_drivers() -> None:
    text = assemblies._expression(DRIVER, 0.5, 0.25, 1.0)
    t = "(time + 0.5)"
    assert text == f"(0.0) + (2.0)*{t} + (3.0)*{t}*{t} + (-0.25)"
    sine = {"amplitude": 0.5, "frequency": 4.0, "phase": math.pi}
    text = assemblies._expression(Driver(joint="H", sine=sine), 0.0, 0.0, -1.0)
    assert text.endswith(f"(-0.5)*sin((4.0)*(time + 0.0) + ({math.pi!r})) + (-0.0)")


def test_joints_that_begin_at_a_moving_body_are_reversed() -> None:
    for kind, is_reversed in ((Cylindrical, True), (Planar, True), (Revolute, False)):
        given = {"name": "J", "anchor": (0.0, 0.0, 0.0), "axis": (0.0, 0.0, 1.0)}
        assert assemblies.is_reversed(kind(bodies=("b", "ground"), **given)) is is_reversed
        assert not assemblies.is_reversed(kind(bodies=("ground", "b"), **given))


def test_frames_of_markers_are_of_the_first_and_the_last_axis() -> None:
    cross = Universal(name="U", bodies=("ground", "b"), anchor=(0, 0, 0), axes=((1.0, 0, 0), (0, 1.0, 0)))
    first, second = assemblies._frames(cross)
    assert first[:, 2].tolist() == [1.0, 0.0, 0.0] and second[:, 2].tolist() == [0.0, 1.0, 0.0]
    assert [f.tolist() for f in assemblies._frames(HINGE)] == [joint_frame((0, 0, 1)).tolist()] * 2
    fixed = Fixed(name="F", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0))
    assert [f.tolist() for f in assemblies._frames(fixed)] == [np.eye(3).tolist()] * 2


def test_the_world_of_an_assembly_has_the_driver_s_axis_up() -> None:
    across = HINGE.model_copy(update={"axis": (3.0, 0.0, 0.0)})
    found = assemblies.Assembly(scene(joint=(across,)))
    assert rotations.rotate(found.world, np.array([1.0, 0.0, 0.0])) == pytest.approx([0.0, 0.0, 1.0])
    assert abs(found.axes[0][:, 2]) == pytest.approx([1.0, 0.0, 0.0]) and found.moments[0][2] == 2.0
    tilted = assemblies.Assembly(scene(joint=(across,)), tilted=True)
    turned = rotations.multiply(rotations.from_vector(np.array([0.5, -0.4, 0.3])), found.world)
    assert tilted.world == pytest.approx(turned)
    bare = scene(body=(BODY.model_copy(update={"mass": None, "inertia": None}),))
    assert assemblies.Assembly(bare).moments[0].tolist() == [1.0, 1.0, 1.0]


def test_ends_of_a_joint_are_in_principal_axes() -> None:
    """The hinge is 1 m from the body's centre, against x."""
    found = assemblies.Assembly(scene())
    ground, own = found.ends(HINGE)
    assert ground[0] == "ground" and ground[1].tolist() == [0.0, 0.0, 0.0]
    assert found.axes[0] @ own[1] == pytest.approx([-1.0, 0.0, 0.0])
    assert found.axes[0] @ own[2] == pytest.approx(joint_frame((0.0, 0.0, 1.0)))


def test_an_assembly_as_text() -> None:
    pytest.importorskip("pyondsel")
    found = assemblies.Assembly(scene())
    text = found.text(0.5, 1.0, 4, np.array([[1.0, 0.0, 0.0]]), np.array([[1.0, 0.0, 0.0, 0.0]]))
    for word in ("b0", "j0", "d0", "m00", "m01", "(time + 0.5)", "(-1.75)"):
        assert word in text, word  # 2 t + 3 t² is 1.75 rad at 0.5 s
    still = found.text(0.0, 1.0, 4, np.array([[1.0, 0.0, 0.0]]), np.array([[1.0, 0.0, 0.0, 0.0]]))
    assert "(-0.0)" in still and "(time + 0.0)" in still


# --- OndselSolver's analyses ------------------------------------------------------------------------------
def analysis(times: Any, analyse: Any, **more: Any) -> Any:
    found: Any = object.__new__(ondsel._OndselSimulation)
    vars(found).update(
        times=np.array(times, float), samples={}, hindered=False, step=0.1, _analyse=analyse, **more
    )
    return found


def test_equally_spaced_samples_are_one_analysis() -> None:
    asked: list[Any] = []
    found = analysis([0.1, 0.2, 0.3, 0.5], lambda t0, many: asked.append((t0, many.tolist())))
    found.advance(0.0, 0.1)
    assert asked == [(0.0, [0.1, 0.2, 0.3])]
    found.advance(0.3, 0.5)
    assert asked[1] == (0.3, [0.5])
    found.samples[0.1] = "sample"
    found.advance(0.0, 0.1)
    assert len(asked) == 2
    whole = analysis([0.1, 0.2, 0.3], lambda t0, many: asked.append(many.tolist()))
    whole.advance(0.0, 0.1)
    assert asked[2] == [0.1, 0.2, 0.3]


def test_after_a_failure_samples_are_analysed_alone() -> None:
    asked: list[Any] = []

    def analyse(t0: float, many: np.ndarray) -> None:
        asked.append(many.tolist())
        if len(many) > 1 or t0 > 0.2:
            raise Failed(Outcome.NOT_CONVERGED, t0, "no pose")

    found = analysis([0.1, 0.2, 0.3, 0.4], analyse)
    found.advance(0.0, 0.1)
    assert asked == [[0.1, 0.2, 0.3, 0.4], [0.1]] and found.hindered
    found.advance(0.1, 0.2)
    assert asked[2:] == [[0.2]]
    with pytest.raises(Failed):
        found.advance(0.3, 0.4)


def test_joints_and_motions_that_ondsel_refuses() -> None:
    rod = Distance(name="R", bodies=("ground", "b"), anchors=((0.0, 5.0, 0.0), (1.0, 0.0, 0.0)))
    found = ondsel.ENGINE.cannot(scene(joint=(HINGE, rod)))
    assert found is not None and found.owner is Owner.ENGINE and "joint of constant distance" in found.reason
    assert ondsel.ENGINE.refuses(scene()) is None
    free = Body(name="f", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(5.0, 0.0, 0.0))
    for given in (scene(driver=()), scene(body=(BODY, free))):
        found = ondsel.ENGINE.refuses(given)
        assert found is not None and "offers no forward dynamics" in found.reason
    steps = [setting.options["step"] for setting in ondsel.ENGINE.settings(scene())]
    assert steps == pytest.approx([0.02, 0.005, 0.00125])


# --- Simbody's frames -------------------------------------------------------------------------------------
@pytest.mark.parametrize("angles", [(0.3, -0.5, 0.8), (-2.0, 1.2, -3.0), (0.4, math.pi / 2, 0.0)])
def test_angles_about_axes_of_the_body(angles: tuple[float, float, float]) -> None:
    x, y, z = (
        rotations.to_matrix(rotations.from_vector(a * e)) for a, e in zip(angles, np.eye(3), strict=True)
    )
    found = simbodies._angles(x @ y @ z)
    again = [rotations.to_matrix(rotations.from_vector(a * e)) for a, e in zip(found, np.eye(3), strict=True)]
    assert again[0] @ again[1] @ again[2] == pytest.approx(x @ y @ z, abs=1e-12)
    assert found == pytest.approx(angles, abs=1e-8)


@pytest.mark.parametrize(("cosine", "third"), [(1.5e-12, 0.3), (0.9e-12, 0.0)])
def test_angles_near_a_quarter_turn_of_the_second(cosine: float, third: float) -> None:
    """Below a cosine of 1e-12 the first and the third axis count as one."""
    (sx, sz), (cx, cz) = np.sin([0.4, 0.3]), np.cos([0.4, 0.3])
    matrix = np.array(
        [
            [cosine * cz, -cosine * sz, 1.0],
            [cx * sz + sx * cz, cx * cz - sx * sz, -sx * cosine],
            [sx * sz - cx * cz, sx * cz + cx * sz, cx * cosine],
        ]
    )
    assert simbodies._angles(matrix) == pytest.approx((0.7 - third, math.pi / 2, third), abs=1e-9)


def link(kind: str, *axes: Any) -> Link:
    eye = np.eye(3)
    return Link(0, np.zeros(3), 1.0, np.zeros(3), eye, kind=kind, axes=np.array(axes, float).reshape(-1, 3))


def test_joints_of_simbody_with_their_axes_and_coordinates() -> None:
    kind, frame, order = simbodies._joint(link("universal", (1, 0, 0), (0.6, 0.8, 0)))
    assert (kind, order) == ("UniversalJoint", (0, 1))
    assert frame == pytest.approx(np.eye(3))
    kind, frame, order = simbodies._joint(link("translational", (0, 1, 0)))
    assert (kind, order, frame[:, 0].tolist()) == ("SliderJoint", (0,), [0, 1, 0])
    kind, frame, order = simbodies._joint(link("cylindrical", (0, 1, 0)))
    assert (kind, order, frame[:, 2].tolist()) == ("CylindricalJoint", (1, 0), [0, 1, 0])
    kind, frame, order = simbodies._joint(link("planar", (1, 0, 0)))
    assert (kind, order, frame[:, 2].tolist()) == ("PlanarJoint", (1, 2, 0), [1, 0, 0])
    kind, frame, order = simbodies._joint(link("free"))
    assert (kind, order, frame.tolist()) == ("FreeJoint", (3, 4, 5, 0, 1, 2), np.eye(3).tolist())
    assert simbodies._joint(link("spherical"))[2] == (0, 1, 2) and simbodies._joint(link("fixed"))[2] == ()


class Made:
    """An object of OpenSim that records its calls."""

    def __init__(self, kind: str, given: Any) -> None:
        self.kind, self.given, self.calls = kind, given, []

    def __getattr__(self, name: str) -> Any:
        if name == "getName":
            return lambda: next(
                (call[1] for call in reversed(self.calls) if call[0] == "setName"), self.given[0]
            )
        return lambda *given: self.calls.append((name, *given))

    def __getitem__(self, k: int) -> float:
        return self.given[k]

    def set(self, k: int, value: float) -> None:
        self.calls.append(("set", k, value))


class OpenSim:
    def __getattr__(self, name: str) -> Any:
        return lambda *given: Made(name, given)


def mechanism(**more: Any) -> Any:
    found: Any = object.__new__(simbodies.Mechanism)
    links = [SimpleNamespace(position=np.array([1.0, 2.0, 3.0])), SimpleNamespace(position=np.zeros(3))]
    tree = SimpleNamespace(links=links, link_of=lambda body: body, coordinate=lambda scene, joint: 0)
    constraints: list[Any] = []
    model = SimpleNamespace(getGround=lambda: "ground", addConstraint=constraints.append)
    vars(found).update(
        opensim=OpenSim(), tree=tree, scene=scene(), model=model, constraints=constraints, **more
    )
    found.bodies = [Made("Body", ("one",)), Made("Body", ("two",))]
    return found


def vector(made: Made) -> list[float]:
    assert made.kind == "Vec3"
    return list(made.given)


def test_places_are_from_the_origin_of_a_link() -> None:
    found = mechanism()
    assert vector(found.place(0, (1.5, 2.0, 2.0))) == [0.5, 0.0, -1.0]
    assert vector(found.place(-1, (1.5, 2.0, 2.0))) == [1.5, 2.0, 2.0]
    assert found.frame(-1) == "ground" and found.frame(1) is found.bodies[1]


def test_closures_of_simbody() -> None:
    found = mechanism()
    point = found._close(3, Closure("point", 0, (0, -1), np.array([1.0, 2.0, 4.0])))
    first, place, second, other = point.given
    assert point.kind == "PointConstraint" and (first, second) == (found.bodies[0], "ground")
    assert vector(place) == [0.0, 0.0, 1.0] and vector(other) == [1.0, 2.0, 4.0]
    weld = found._close(4, Closure("weld", 0, (0, 1), np.array([1.0, 2.0, 4.0])))
    name, first, place, zero, second, other, zero_again = weld.given
    assert weld.kind == "WeldConstraint" and name == "closure4" and (first, second) == tuple(found.bodies)
    assert vector(place) == [0.0, 0.0, 1.0] and vector(other) == [1.0, 2.0, 4.0]
    assert vector(zero) == vector(zero_again) == [0.0, 0.0, 0.0]
    assert found.constraints == [point, weld] and point.calls == [("setName", "closure3")]


def test_motions_of_drivers_of_simbody() -> None:
    """Coefficients are descending."""
    found = mechanism()
    made = found._motion(DRIVER)
    [descending] = made.given
    assert made.kind == "PolynomialFunction" and descending.given == (3, 0.0)
    assert descending.calls == [("set", 0, 3.0), ("set", 1, 2.0), ("set", 2, 0.0)]
    sine = {"amplitude": 0.5, "frequency": 4.0, "phase": 0.0}
    made = found._motion(Driver(joint="H", sine=sine, polynomial=(0.0,)))
    assert (made.kind, made.given) == ("Sine", (0.5, 4.0, 0.0, 0.0))
    coordinate = Made("Coordinate", ("q",))
    found.coordinates = {0: coordinate}
    found._motion = lambda driver: "motion"
    found._drive(DRIVER)
    assert coordinate.calls == [("setPrescribedFunction", "motion"), ("setDefaultIsPrescribed", True)]


def test_a_coupler_of_simbody() -> None:
    found = mechanism()
    found.coordinates = {2: Made("Coordinate", ("first",)), 5: Made("Coordinate", ("second",))}
    found.tree.coupled = lambda scene, coupling: (2, 5)
    found._couple(7, SimpleNamespace(ratio=2.5))
    [made] = found.constraints
    calls = dict((call[0], call[1]) for call in made.calls)
    assert made.kind == "CoordinateCouplerConstraint" and calls["setName"] == "coupling7"
    assert calls["setDependentCoordinateName"] == "second"
    assert calls["setIndependentCoordinateNames"].calls == [("append", "first")]
    assert (calls["setFunction"].kind, calls["setFunction"].given) == ("LinearFunction", (2.5, 0.0))


def of(call: str, made: Made) -> list[Any]:
    return [list(found[1:]) for found in made.calls if found[0] == call]


def test_loads_of_simbody() -> None:
    found = mechanism(link_of=lambda body: {"ground": -1, "b": 0}[body])
    made = found._force("load0", Moment(body="b", moment=(1.0, 2.0, 3.0)))
    assert made.kind == "PrescribedForce" and made.given == ("load0", found.bodies[0])
    assert [c.given for c in of("setTorqueFunctions", made)[0]] == [(1.0,), (2.0,), (3.0,)]
    made = found._force("load1", Force(body="b", point=(1.0, 2.0, 4.0), force=(5.0, 6.0, 7.0)))
    assert [c.given for c in of("setForceFunctions", made)[0]] == [(5.0,), (6.0,), (7.0,)]
    assert [c.given for c in of("setPointFunctions", made)[0]] == [(0.0,), (0.0,), (1.0,)]
    found.bodies[0].getAbsolutePathString = lambda: "/b"
    found.model.getGround = lambda: SimpleNamespace(getAbsolutePathString=lambda: "/ground")
    spring = Spring(
        bodies=("ground", "b"),
        points=((0.0, 0.0, 1.0), (1.0, 2.0, 4.0)),
        stiffness=3.0,
        damping=0.5,
        natural_length=0.25,
    )
    made = found._force("load2", spring)
    assert of("setBody1Name", made) == [["/ground"]] and of("setBody2Name", made) == [["/b"]]
    assert vector(of("setPoint1", made)[0][0]) == [0.0, 0.0, 1.0] == vector(of("setPoint2", made)[0][0])
    assert of("setExpression", made) == [["(3.0)*(d-(0.25))+(0.5)*ddot"]] and of("setName", made) == [
        ["load2"]
    ]
    found.coordinates = {0: Made("Coordinate", ("q0",))}
    made = found._force("load3", TorsionSpring(joint="H", stiffness=3.0, damping=0.5, natural_angle=0.25))
    assert made.kind == "SpringGeneralizedForce" and made.given == ("q0",)
    values = [of(f"set{name}", made) for name in ("Stiffness", "RestLength", "Viscosity", "Name")]
    assert values == [[[3.0]], [[0.25]], [[0.5]], [["load3"]]]


# --- Simbody's runs ---------------------------------------------------------------------------------------
def test_settings_and_statements_of_simbody() -> None:
    settings = simbody.ENGINE.settings(scene())
    assert [s.family for s in settings] == ["merson"] * 6 + ["feldberg"] * 6 + ["cpodes"] * 6
    assert [s.options["accuracy"] for s in settings[:6]] == [1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10]
    code = simbody.ENGINE.own_code(scene(), Setting("cpodes", {"accuracy": 1e-3}))
    kind = "opensim.Manager.IntegratorMethod_CPodes"
    assert code == f"manager.setIntegratorMethod({kind}); manager.setIntegratorAccuracy(0.001)"


def test_scenes_that_simbody_refuses() -> None:
    geared = scene(joint=(HINGE.model_copy(update={"armature": 0.5}),))
    found = simbody.ENGINE.refuses(geared)
    assert found is not None and found.reason.startswith("joint 'H' has an armature")
    sine = {"amplitude": 0.5, "frequency": 4.0, "phase": 0.0}
    mixed = scene(driver=(Driver(joint="H", polynomial=(0.0, 2.0), sine=sine),))
    found = simbody.ENGINE.refuses(mixed)
    assert found is not None and found.reason.endswith("it would drive H")
    assert simbody.ENGINE.refuses(scene(driver=(Driver(joint="H", sine=sine),))) is None
    assert simbody.ENGINE.refuses(scene()) is None


def test_the_line_that_states_an_error() -> None:
    for text, line in (
        ("first\n  could not advance\nlast", "could not advance"),
        ("first\nAn Error came", "An Error came"),
        ("\n first \nsecond", "first"),
    ):
        assert simbody._sentence(RuntimeError(text)) == line


def test_a_step_of_simbody_that_fails() -> None:
    def integrate(t: float) -> str:
        if t > 0.5:
            raise RuntimeError("no advance")
        return f"state {t}"

    found: Any = object.__new__(simbody._SimbodySimulation)
    state = SimpleNamespace(getTime=lambda: 0.625)
    found.manager = SimpleNamespace(integrate=integrate, getState=lambda: state)
    found.advance(0.0, 0.5)
    assert found.state == "state 0.5"
    with pytest.raises(Failed, match="no advance") as failed:
        found.advance(0.5, 0.75)
    assert failed.value.outcome is Outcome.STEP_FAILED and failed.value.t == 0.625


def test_the_wrench_of_a_closure_is_on_its_second_link() -> None:
    """OpenSim records force (1, 2, 3) and moment (4, 5, 6) of the second frame, behind the first one's."""
    names = [*(f"c_one_{k}" for k in ("Fx", "Fy", "Fz", "Mx", "My", "Mz")), "c_two_Fx", *"abcde"]
    labels = SimpleNamespace(getSize=lambda: len(names), get=names.__getitem__)
    values = SimpleNamespace(get=[*[9.0] * 6, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0].__getitem__)
    constraint = SimpleNamespace(getRecordLabels=lambda: labels, getRecordValues=lambda state: values)
    found: Any = object.__new__(simbody._SimbodySimulation)
    found.state = "state"
    frames = {1: SimpleNamespace(getName=lambda: "two"), -1: SimpleNamespace(getName=lambda: "two")}
    motion: Any = SimpleNamespace(position=np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))
    for second, arm in ((1, [1.0, 0.0, 0.0]), (-1, [0.0, 0.0, 0.0])):
        closure = Closure("weld", 0, (0, second), np.zeros(3))
        tree = SimpleNamespace(closures=[closure])
        found.mechanism = SimpleNamespace(tree=tree, closures=[constraint], frame=frames.__getitem__)
        [wrench] = found._closing(motion)
        moment = np.array([4.0, 5.0, 6.0]) + np.cross(arm, [1.0, 2.0, 3.0])
        assert wrench == pytest.approx([-1.0, -2.0, -3.0, *-moment])
