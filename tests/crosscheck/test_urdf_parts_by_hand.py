"""Parts of a URDF and closures of a model / numbers by hand, and MuJoCo's own residuals and Jacobians."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from crosscheck.engines.mujoco.importing import urdf
from crosscheck.engines.mujoco.importing.closures import TYPES, Closure, Frame, of_equalities
from mbref import rotations
from mbref.scene import Revolute, SceneError, Spherical


def around(axis: int, angle: float) -> np.ndarray:
    return rotations.to_matrix(rotations.from_vector(angle * np.eye(3)[axis]))


def test_roll_pitch_and_yaw_turn_about_fixed_axes():
    found = urdf._roll_pitch_yaw(np.array([0.3, -0.7, 1.1]))
    assert found == pytest.approx(around(2, 1.1) @ around(1, -0.7) @ around(0, 0.3))


@pytest.mark.parametrize("axis", [(0.0, 0.0, 2.0), (1.0, -2.0, 2.0), (-3.0, 0.0, 0.0), (0.0, 0.6, 0.8)])
def test_a_frame_along_an_axis(axis):
    frame = urdf.along(np.array(axis))
    assert frame[:, 2] == pytest.approx(np.array(axis) / np.linalg.norm(axis))
    assert frame.T @ frame == pytest.approx(np.eye(3)) and np.linalg.det(frame) == pytest.approx(1.0)


# --- inertia ----------------------------------------------------------------------------------------------
def enough(inside: str) -> tuple[tuple[float, float], ET.Element]:
    link = ET.fromstring(f"<link name='a'>{inside}</link>")
    return urdf._enough(link), link


def inertia(ixx: float, iyy: float, izz: float, ixy: float = 0.0, more: str = "<mass value='2'/>") -> str:
    moments = f"<inertia ixx='{ixx!r}' ixy='{ixy!r}' ixz='0' iyy='{iyy!r}' iyz='0' izz='{izz!r}'/>"
    return f"<inertial>{more}{moments}</inertial>"


@pytest.mark.parametrize(
    ("inside", "added"),
    [
        (inertia(0.1, 0.2, 0.3), (0.0, 0.0)),
        ("", (1.0, 1.0)),
        ("<inertial/>", (1.0, 1.0)),
        ("<inertial><mass/><inertia/></inertial>", (1.0, 1.0)),
        ("<inertial><mass value=''/><inertia ixx='2' iyy='2' izz='3'/></inertial>", (1.0, 0.0)),
        (inertia(0.1, 0.2, 0.3, more="<mass value='1e-12'/>"), (0.0, 0.0)),
        (inertia(0.1, 0.2, 0.3, more="<mass value='0.9e-12'/>"), (1.0, 0.0)),
        (inertia(0.0, 0.2, 0.3), (0.0, 0.3)),
        (inertia(4.1e-10, 0.2, 0.4), (0.0, 0.0)),
        (inertia(3.9e-10, 0.2, 0.4), (0.0, 0.4)),
        (inertia(1.1e-12, 2e-12, 3e-12), (0.0, 0.0)),
        (inertia(0.9e-12, 2e-12, 3e-12), (0.0, 3e-12)),
        (inertia(0.25, 0.25, 0.3, ixy=0.25), (0.0, 0.5)),
    ],
)
def test_inertia_that_mujoco_needs(inside, added):
    """A kilogram without a mass; the largest moment where the least is a billionth of it, or 1e-12 kg m²."""
    found, link = enough(inside)
    assert found == pytest.approx(added, rel=1e-9)
    given = ET.fromstring(f"<link>{inside}</link>")

    def number(root: ET.Element, tag: str, key: str) -> float:
        element = root.find(f"inertial/{tag}")
        return 0.0 if element is None else float(element.get(key) or 0.0)

    assert number(link, "mass", "value") == pytest.approx(number(given, "mass", "value") + added[0])
    for key in ("ixx", "iyy", "izz"):
        wanted = number(given, "inertia", key) + added[1]
        assert number(link, "inertia", key) == pytest.approx(wanted, rel=1e-12), key
    assert number(link, "inertia", "ixy") == number(given, "inertia", "ixy")


def test_the_least_moment_that_is_no_rounding(monkeypatch):
    monkeypatch.setattr(urdf, "LEAST", 0.25)
    fake = SimpleNamespace(mjtObj=SimpleNamespace(mjOBJ_BODY=1), mj_name2id=lambda *given: 1)
    model = SimpleNamespace(
        nbody=2,
        body_mass=np.array([0.0, 3.0]),
        body_inertia=np.array([[0.0] * 3, [2.5, 2.500001, 4.0]]),
        body_subtreemass=np.zeros(2),
        body_parentid=np.array([0, 0]),
    )
    urdf.Text("", {"a": (1.0, 2.0)}, ET.Element("robot")).take_back(fake, model)
    assert model.body_inertia[1].tolist() == pytest.approx([0.0, 0.500001, 2.0])


def test_a_frame_is_made_with_the_axis_that_is_least_along_it():
    """x is along that axis times z."""
    from crosscheck.engines.geometry import joint_frame

    for axis, x, y in (
        ((0.0, 0.0, 2.0), (0, -1, 0), (1, 0, 0)),
        ((0.0, 3.0, 0.0), (0, 0, 1), (1, 0, 0)),
        ((1.0, 0.0, 0.0), (0, 0, -1), (0, 1, 0)),
    ):
        z = np.array(axis) / np.linalg.norm(axis)
        for made in (urdf.along(np.array(axis)), joint_frame(axis)):
            assert made == pytest.approx(np.column_stack([x, y, z]))


def test_added_inertia_is_taken_back():
    """Of the first body all, of the second one a part; a link without a body is left out. Masses of a tree
    add up towards the world."""
    names = {"a": 1, "b": 2, "world": 0, "none": -1}
    fake = SimpleNamespace(
        mjtObj=SimpleNamespace(mjOBJ_BODY=1), mj_name2id=lambda model, kind, name: names[name]
    )
    model = SimpleNamespace(
        nbody=4,
        body_mass=np.array([0.5, 1.0, 3.0, 4.0]),
        body_inertia=np.array([[9.0] * 3, [2.0, 2.0 + 1e-13, 2.5], [1.0, 2.0, 3.0], [7.0, 8.0, 9.0]]),
        body_subtreemass=np.zeros(4),
        body_parentid=np.array([0, 0, 1, 1]),
    )
    added = {"a": (1.0, 2.0), "b": (1.0, 0.25), "world": (9.0, 9.0), "none": (9.0, 9.0)}
    urdf.Text("", added, ET.Element("robot")).take_back(fake, model)
    assert model.body_mass.tolist() == [0.5, 0.0, 2.0, 4.0]
    assert model.body_inertia.tolist() == [[9.0] * 3, [0.0, 0.0, 0.5], [0.75, 1.75, 2.75], [7.0, 8.0, 9.0]]
    assert model.body_subtreemass.tolist() == [6.5, 6.0, 2.0, 4.0]
    model.body_mass[2] = 0.5
    urdf.Text("", {"b": (1.0, 0.0)}, ET.Element("robot")).take_back(fake, model)
    assert model.body_mass[2] == 0.0, "no mass is negative"


ROBOT = """<robot name="r">
  <link name="base"><visual/><collision/></link>
  <link name="arm"><inertial><mass value="2"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="j" type="floating"><parent link="base"/><child link="arm"/><mimic joint="k"/></joint>
  <gazebo/><transmission/><loop/><coupling name="c"/>
</robot>"""


def test_a_robot_is_prepared():
    made = urdf.prepared(ROBOT)
    root = ET.fromstring(made.text)
    assert made.added == {"world": (1.0, 1.0)}, "of the base, on which a joint floats"
    assert [link.get("name") for link in root.findall("link")] == ["world", "arm"]
    assert root.find("joint/parent").get("link") == "world" and root.find("joint/child").get("link") == "arm"
    tags = {element.tag for element in root.iter()}
    assert not tags & {"visual", "collision", "gazebo", "transmission", "loop", "coupling", "mimic"}
    compiler = root.find("mujoco/compiler").attrib
    assert compiler == {"fusestatic": "false", "discardvisual": "true", "balanceinertia": "false"}
    assert made.root.find("loop") is not None and made.root.find("link").get("name") == "base"
    held = ET.fromstring(urdf.prepared(ROBOT, ["arm"]).text)
    assert held.find("joint").get("type") == "fixed" and held.find("link").get("name") == "base"
    [part] = urdf.couplings(made.root)
    assert (part.kind, part.sentence) == ("couplings", "coupling 'c'")
    with pytest.raises(SceneError, match="URDF: is no XML"):
        urdf.prepared("<robot>")


def test_joints_that_follow_others():
    text = """<robot><joint name="a"><mimic joint="b" multiplier="-1.5" offset="0.3"/></joint>
        <joint name="b"/><joint name="c"><mimic joint="a"/></joint></robot>"""
    numbers = {"a": 4, "b": 0, "c": 7}
    first, second = urdf.mimics(ET.fromstring(text), numbers.__getitem__)
    assert (first.name, first.joints, first.offset, first.ratio) == ("a mimics b", (4, 0), 0.3, -1.5)
    assert (second.name, second.joints, second.offset, second.ratio) == ("c mimics a", (7, 4), 0.0, 1.0)
    for missing in ("a", "b"):
        with pytest.raises(SceneError, match="joint 'a' mimics 'b': the file has no such joint"):
            list(urdf.mimics(ET.fromstring(text), lambda name, m=missing: -1 if name == m else 0))


def test_loops_of_a_robot():
    """The axis is given in the predecessor's origin frame, which is turned by 0.3 rad about x of the link."""
    text = """<robot><loop name="l" type="revolute">
        <predecessor link="p"><origin xyz="1 2 3" rpy="0.3 0 0"/></predecessor>
        <successor link="s"><origin xyz="4 5 6"/></successor><axis xyz="0 0 2"/></loop></robot>"""
    turns = rotations.to_matrix(
        rotations.from_vector(np.array([[0.0, 0, 0], [0.1, 0.7, -0.4], [0.9, 0, 0.2]]))
    )
    data = SimpleNamespace(xmat=turns.reshape(3, 9), xpos=np.zeros((3, 3)))
    [found] = urdf.loops(ET.fromstring(text), {"p": 1, "s": 2}.__getitem__, data)
    first, second = found.frames
    assert (found.name, found.type, first.body, second.body) == ("l", Revolute, 1, 2)
    assert first.origin.tolist() == [1, 2, 3] and second.origin.tolist() == [4, 5, 6]
    assert first.axes[:, 2] == pytest.approx(around(0, 0.3) @ [0.0, 0.0, 1.0])
    assert second.turn(data) == pytest.approx(first.turn(data)), "closed at the reference"
    with pytest.raises(SceneError, match="loop 'l': type 'screw' is none of spherical"):
        list(urdf.loops(ET.fromstring(text.replace("revolute", "screw")), {}.__getitem__, data))
    with pytest.raises(SceneError, match="loop 'l': names no successor"):
        list(urdf.loops(ET.fromstring(text.replace("successor", "other")), {"p": 1}.__getitem__, data))
    plain = '<robot><loop type="ball"><predecessor link="p"/><successor link="s"/></loop></robot>'
    [ball] = urdf.loops(ET.fromstring(plain), {"p": 1, "s": 2}.__getitem__, data)
    assert (ball.name, ball.type) == ("loop", Spherical) and ball.frames[0].origin.tolist() == [0, 0, 0]
    assert ball.frames[0].axes[:, 2] == pytest.approx([1.0, 0.0, 0.0]), "the axis is x by default"


# --- closures ---------------------------------------------------------------------------------------------
BODIES = """<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody>
    <body name="one" pos="0.1 0.2 0.3" quat="0.8 0.1 -0.5 0.3"><freejoint/>
      <geom size="0.1" mass="1"/><site name="s1" pos="0.3 -0.2 0.1" quat="0.9 0.2 0.1 -0.4"/></body>
    <body name="two" pos="-0.4 0.5 0.1" quat="0.7 -0.3 0.2 0.6"><freejoint/>
      <geom size="0.1" mass="2"/><site name="s2" pos="-0.1 0.4 0.2" quat="0.6 0.3 -0.7 0.2"/></body>
    </worldbody><equality>{}</equality></mujoco>"""
EQUALITIES = {
    "connect": '<connect body1="one" body2="two" anchor="0.3 -0.1 0.2"/>',
    "connect with the world": '<connect body1="two" anchor="0.3 -0.1 0.2"/>',
    "connect of sites": '<connect site1="s1" site2="s2"/>',
    "weld": '<weld body1="one" body2="two" anchor="0.1 0.3 -0.2" relpose="0.2 -0.3 0.1 0.9 0.1 0.3 -0.2"/>',
    "weld of sites": '<weld site1="s2" site2="s1"/>',
    "weld that holds no rotation": '<weld body1="one" body2="two" anchor="0.1 0.3 -0.2" torquescale="0"/>',
}


def model_of(equality: str) -> tuple:
    model = mujoco.MjModel.from_xml_string(BODIES.format(equality))
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    return model, mujoco.MjData(model)


@pytest.mark.parametrize("name", EQUALITIES)
def test_an_imported_closure_has_mujoco_s_residual_and_jacobian(name):
    """Lengths of the residuals of an open pose, and the velocities that a closed one allows."""
    model, data = model_of(EQUALITIES[name])
    [closure] = of_equalities(mujoco, model)
    rng = np.random.default_rng(4)
    data.qpos[:] = model.qpos0 + 0.1 * rng.normal(size=model.nq)
    mujoco.mj_forward(model, data)
    gap, theirs = closure.gap(data), data.efc_pos[: data.ne]
    assert np.linalg.norm(gap[:3]) == pytest.approx(np.linalg.norm(theirs[:3]), rel=1e-9)
    assert len(gap) == (6 if name in ("weld", "weld of sites") else 3)
    first, second = closure.frames
    start, turn = first.place(data), first.turn(data)
    shift = second.place(data) - start
    target = first.turn(data)  # move the second body so that both frames coincide
    b = second.body
    if name == "connect with the world":
        b, shift = first.body, -shift
        moved = data.xpos[b] - shift
    else:
        own = data.xmat[b].reshape(3, 3)
        turned = target @ second.axes.T if len(gap) == 6 else own
        moved = start - turned @ second.origin
        data.qpos[7 * b - 4 : 7 * b] = rotations.from_matrix(turned)
    data.qpos[7 * (b - 1) : 7 * (b - 1) + 3] = moved
    mujoco.mj_forward(model, data)
    assert np.abs(closure.gap(data)).max() < 1e-12 and np.abs(data.efc_pos[:3]).max() < 1e-12
    rows = closure.rows(mujoco, model, data)
    jacobian = data.efc_J.reshape(-1, model.nv)[: data.ne]
    count = len(rows)
    held = jacobian[:count] if count == data.ne else jacobian[:3]
    assert np.linalg.matrix_rank(rows) == np.linalg.matrix_rank(np.vstack([rows, held])) == count
    assert turn == pytest.approx(first.turn(data)) or name == "connect with the world"


@pytest.mark.parametrize("kind", sorted(set(TYPES) - {"ball", "continuous", "prismatic"}))
def test_rows_of_a_closure_are_the_slopes_of_its_residual(kind):
    """At a closed pose, by small moves of every velocity."""
    model, data = model_of("")
    mujoco.mj_forward(model, data)
    axes = around(1, 0.4) @ around(0, -0.9)
    first = Frame(1, np.array([0.2, -0.1, 0.3]), axes)
    turn, own = first.turn(data), data.xmat[2].reshape(3, 3)
    second = Frame(2, own.T @ (first.place(data) - data.xpos[2]), own.T @ turn)
    closure = Closure("c", TYPES[kind], (first, second))
    facts = TYPES[kind].facts
    assert closure.gap(data) == pytest.approx(np.zeros(facts.rows), abs=1e-14)
    rows, h = closure.rows(mujoco, model, data), 1e-6
    slopes = np.zeros_like(rows)
    for k in range(model.nv):
        ends = []
        for side in (h, -h):
            moved = mujoco.MjData(model)
            moved.qpos[:] = data.qpos
            mujoco.mj_integratePos(model, moved.qpos, side * np.eye(model.nv)[k], 1.0)
            mujoco.mj_kinematics(model, moved)
            ends.append(closure.gap(moved))
        slopes[:, k] = (ends[0] - ends[1]) / (2 * h)
    assert rows == pytest.approx(slopes, abs=1e-8)


def test_residuals_of_a_closure_by_hand():
    """The second frame 1, 2 and 3 m along the first one's axes, and turned by 0.5 rad about its z."""
    data = SimpleNamespace(
        xpos=np.array([[0.0, 0, 0], [5.0, 6, 7]]),
        xmat=np.array([np.eye(3).ravel(), around(2, math.pi / 2).ravel()]),
    )
    first = Frame(1, np.array([1.0, 0, 0]), np.eye(3))
    apart = around(2, math.pi / 2) @ [1.0, 2.0, 3.0]
    second = Frame(0, first.place(data) + apart, around(2, math.pi / 2 + 0.5))
    assert first.place(data) == pytest.approx([5.0, 7.0, 7.0])
    found = {kind: Closure("c", TYPES[kind], (first, second)).gap(data) for kind in TYPES}
    assert found["fixed"] == pytest.approx([1, 2, 3, 0, 0, 0.5])
    assert found["ball"] == pytest.approx([1, 2, 3]) and found["revolute"] == pytest.approx([1, 2, 3, 0, 0])
    assert found["cylindrical"] == pytest.approx([1, 2, 0, 0])
    assert found["prismatic"] == pytest.approx([1, 2, 0, 0, 0.5])
