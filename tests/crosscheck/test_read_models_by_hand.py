"""Reading of MJCF and URDF files from the file to the scene / small files, worked out by hand."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco")

from crosscheck.engines.mujoco.importing import reading  # noqa: E402
from crosscheck.engines.mujoco.importing.agreement import Agreement  # noqa: E402
from crosscheck.engines.mujoco.importing.reading import Source, source  # noqa: E402
from mbref.formats import ImportOptions  # noqa: E402
from mbref.scene import SceneError, SlideSpring, TorsionSpring  # noqa: E402

LUMP = '<inertial pos="0.5 0 0" mass="1" diaginertia="1 1.5 2"/>'
ARM = f'<body name="arm"><joint name="A" axis="0 0 1" {{}}/>{LUMP}{{}}</body>'
CART = f'<body name="cart" pos="0 3 0"><joint name="S" type="slide" axis="1 0 0" {{}}/>{LUMP}</body>'


def text(*bodies: str, more: str = "", head: str = "") -> str:
    parts = "".join(bodies)
    return f'<mujoco><compiler angle="radian"/>{head}<worldbody>{parts}</worldbody>{more}</mujoco>'


def read(tmp_path: Path, file: str, name: str = "m.xml", **options: Any) -> Source:
    (tmp_path / name).write_text(file)
    return source(tmp_path / name, ImportOptions(**options))


def faults(tmp_path: Path, file: str, name: str = "m.xml", **options: Any) -> list[str]:
    with pytest.raises(SceneError) as caught:
        read(tmp_path, file, name, **options)
    return [fault.replace(f"{tmp_path}/", "") for fault in caught.value.faults]


# --- files without a scene --------------------------------------------------------------------------------
def test_files_without_a_scene(tmp_path: Path) -> None:
    assert faults(tmp_path, "<mujoco/>") == ["m.xml: has no body"]
    still = f'<body name="block">{LUMP}</body>'
    assert faults(tmp_path, text(still)) == ["m.xml: has no body that moves"]
    [fault] = faults(tmp_path, "<mujoco><nothing/></mujoco>")
    assert fault.startswith("m.xml: MuJoCo cannot read it: XML Error: Schema violation") and "\n" not in fault
    first, *_ = faults(tmp_path, '<robot name="r"><link name="a"/><joint name="J"/></robot>', "r.urdf")
    assert first.startswith("joint 'J': its parent link")
    for name in ("none.xml", "none.urdf"):
        with pytest.raises(FileNotFoundError, match=name):
            source(tmp_path / name, ImportOptions())


def test_bodies_that_deform_are_refused_first(tmp_path: Path) -> None:
    """Dry friction in the same file is named in the second reading."""
    cloth = '<flexcomp name="f" type="grid" dim="1" count="3 1 1" spacing="1 1 1" mass="1" radius="0.1"/>'
    file = text(ARM.format('frictionloss="1"', ""), cloth)
    [fault] = faults(tmp_path, file)
    assert fault == "1 flexible body: it changes the motion; --without flexible-bodies leaves it out"
    [fault, *_] = faults(tmp_path, file, without=["flexible-bodies"])
    assert "dry friction of 'A'" in fault


# --- parts of the model -----------------------------------------------------------------------------------
def test_parts_that_are_left_out_come_before_parts_without_effect(tmp_path: Path) -> None:
    """Friction, armature and damping leave the model that moves; its flags are the file's own."""
    file = text(
        ARM.format('frictionloss="1" armature="0.5" range="0 1" limited="true"', ""),
        CART.format('armature="2"'),
        more='<actuator><motor name="m" joint="A" armature="0.25" gear="2"/></actuator>',
    )
    found = read(tmp_path, file, "two.xml", without=["friction"])
    assert found.imported.scene.name == "two" and found.imported.scene.body[0].velocity is None
    assert found.imported.left_out == (
        "dry friction of 'A' (--without friction)",
        "1 actuator: only motors with a control value in the keyframe act",
        "1 limit of a joint",
    )
    assert [joint.armature for joint in found.imported.scene.joint] == [0.5 + 4 * 0.25, 2.0]
    for model in (found.model, found.original):
        assert not model.dof_frictionloss.any() and model.dof_armature.tolist() == [1.5, 2.0]
    limits = int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
    assert found.original.opt.disableflags == 0 and found.model.opt.disableflags & limits
    assert (found.qpos == 0).all() and (found.qvel == 0).all() and len(found.groups.pieces) == 2
    bare = read(tmp_path, file, without=["friction", "armature"])
    assert [joint.armature for joint in bare.imported.scene.joint] == [0.0, 0.0]
    assert bare.imported.left_out[:2] == (
        "armature of 'A', 'S' (--without armature)",
        "dry friction of 'A' (--without friction)",
    )
    assert not bare.model.dof_armature.any()
    assert faults(tmp_path, file) == [
        "dry friction of 'A': it changes the motion; --without friction leaves it out"
    ]


def test_parts_of_actuators_and_equalities_are_refused(tmp_path: Path) -> None:
    file = text(
        ARM.format("", '<site name="s"/>'),
        CART.format('actuatorgravcomp="false"'),
        more='<tendon><fixed name="t"><joint joint="S" coef="1"/></fixed></tendon>'
        '<actuator><motor name="m" tendon="t" armature="1"/></actuator>'
        '<equality><joint name="e" joint1="A" joint2="S" polycoef="0 1 1 0 0"/></equality>',
    )
    assert faults(tmp_path, file) == [
        "armature of 'm', which is no actuator of a hinge or slide: it changes the motion; "
        "--without armature leaves it out",
        "equality 'e' of type joint, whose polynomial is not linear: it changes the motion; "
        "--without couplings leaves it out",
    ]


def test_a_scene_is_compared_with_its_model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The comparison has the joints of the tree, without the closure; a difference refuses the file."""
    seen: list[Any] = []

    def check(self: Any, scene: Any, tree: Any) -> None:
        seen.append((self.model, [joint.name for joint in scene.joint], list(tree)))
        raise SceneError(["differs"])

    monkeypatch.setattr(Agreement, "check", check)
    more = '<equality><connect name="c" body1="arm" body2="cart" anchor="0 3 0"/></equality>'
    file = text(ARM.format('armature="1"', ""), CART.format(""), more=more)
    assert faults(tmp_path, file) == ["differs"]
    [(model, joints, tree)] = seen
    assert joints == ["A", "S", "c"] and tree == ["A", "S"] and model.dof_armature.tolist() == [1.0, 0.0]


# --- joints -----------------------------------------------------------------------------------------------
def test_armatures_of_a_row_of_joints(tmp_path: Path) -> None:
    """A sleeve takes the armature of its hinge; a slide with one keeps a link of its own."""
    pair = f"""<body name="b"><joint name="S" type="slide" axis="0 0 1" {{}}/>
    <joint name="H" axis="0 0 1" {{}}/>{LUMP}</body>"""
    sleeve = read(tmp_path, text(pair.format("", 'armature="3"'))).imported.scene
    assert [(j.type, j.name, j.armature) for j in sleeve.joint] == [("cylindrical", "S", 3.0)]
    both = read(tmp_path, text(pair.format('armature="2"', 'armature="3"'))).imported.scene
    assert [(j.type, j.name, j.armature) for j in both.joint] == [
        ("translational", "S", 2.0),
        ("revolute", "H", 3.0),
    ]
    ball = f'<body name="b"><joint name="B" type="ball" armature="1"/>{LUMP}</body>'
    [fault] = faults(tmp_path, text(ball))
    assert fault.startswith("armature of 'B': it changes the motion")
    plain = read(tmp_path, text(pair.format("", ""))).imported.scene
    assert [j.armature for j in plain.joint] == [0.0]


def test_couplings_name_their_coordinates_where_a_joint_has_two(tmp_path: Path) -> None:
    """The slide of a sleeve follows the arm's angle; a hinge and a slide of two joints need no names."""
    sleeve = f"""<body name="b" pos="5 0 0"><joint name="T" type="slide" axis="0 0 1"/>
    <joint name="H" axis="0 0 1"/>{LUMP}</body>"""
    for first, second, kinds in (
        ("T", "A", ("angle", "displacement")),
        ("H", "A", None),
        ("A", "T", ("displacement", "angle")),
    ):
        more = (
            f'<equality><joint name="T" joint1="{first}" joint2="{second}" polycoef="0 3 0 0 0"/></equality>'
        )
        [coupling] = read(tmp_path, text(ARM.format("", ""), sleeve, more=more)).imported.scene.coupling
        assert coupling.name == "coupling T" and coupling.ratio == 3.0
        assert coupling.joints == (("A", "T") if second == "A" else ("T", "A"))
        assert coupling.coordinates == kinds
    more = '<equality><joint name="A" joint1="T" joint2="H"/></equality>'
    [coupling] = read(tmp_path, text(ARM.format("", ""), sleeve, more=more)).imported.scene.coupling
    assert coupling.joints == ("T", "T") and coupling.coordinates == ("angle", "displacement")
    two = """<equality><joint name="A" joint1="T" joint2="A"/><joint name="A2" joint1="H" joint2="A"/>
    </equality>""".replace("A2", "coupling A")
    first, second = read(tmp_path, text(ARM.format("", ""), sleeve, more=two)).imported.scene.coupling
    assert (first.name, second.name) == ("coupling A", "coupling coupling A")
    ball = f'<body name="o" pos="0 9 0"><joint name="B" type="ball"/>{LUMP}</body>'
    lock = '<equality><joint name="L" joint1="{}"/></equality>'
    scene = read(tmp_path, text(ARM.format("", ""), ball, more=lock.format("A"))).imported.scene
    assert [(driver.joint, driver.polynomial) for driver in scene.driver] == [("A", (0.0,))]
    assert not scene.coupling


def test_a_coordinate_that_a_scene_does_not_have() -> None:
    """Of a cylindrical joint only couplings may name a coordinate."""
    reader: Any = object.__new__(reading._Reader)
    reader.mujoco, names = mujoco, {0: "h", 1: "s"}
    kinds = [int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)]
    reader.model = SimpleNamespace(
        jnt_type=kinds,
        jnt_bodyid=[1, 1],
        joint=lambda j: SimpleNamespace(name=names[j]),
        body=lambda b: SimpleNamespace(name="b"),
    )
    couples = SimpleNamespace(name="e", joints=(0, 1))
    locks = SimpleNamespace(name="e", joints=(0, -1))
    sleeve = SimpleNamespace(type="cylindrical", facts=SimpleNamespace(driven="angle"))
    hinge = SimpleNamespace(type="revolute", facts=SimpleNamespace(driven="angle"))
    ball = SimpleNamespace(type="spherical", facts=SimpleNamespace(driven=None))
    reader.joint_of = {0: sleeve, 1: sleeve}
    assert reader._coordinate(couples, 0) == (sleeve, "angle")
    assert reader._coordinate(couples, 1) == (sleeve, "displacement")
    reader.joint_of = {0: hinge}
    assert reader._coordinate(couples, 0) == reader._coordinate(locks, 0) == (hinge, "angle")
    for known, row, j, says in (
        ({0: sleeve}, locks, 0, "equality 'e': locks 'h', which is not a single hinge or slide"),
        ({0: ball}, couples, 0, "equality 'e': couples 'h', which is not a single hinge or slide"),
        ({}, couples, 1, "equality 'e': couples 's', which is not a single hinge or slide"),
    ):
        reader.joint_of = known
        with pytest.raises(SceneError) as caught:
            reader._coordinate(row, j)
        assert list(caught.value.faults) == [says]


# --- loads, notes and velocities --------------------------------------------------------------------------
def test_loads_in_their_order_and_motors_of_a_keyframe(tmp_path: Path) -> None:
    keys = '<keyframe><key name="z" ctrl="9"/><key name="k" qpos="0.5 0.25" qvel="0 2" ctrl="2"/></keyframe>'
    file = text(
        '<site name="o" pos="0 0 1"/>',
        ARM.format('stiffness="3" springref="0.5"', '<site name="s" pos="1 0 0"/>'),
        CART.format('stiffness="7" damping="0.5"'),
        more=f"""<tendon><spatial stiffness="9"><site site="o"/><site site="s"/></spatial></tendon>
        <actuator><motor name="m" joint="A" gear="4"/></actuator>{keys}""",
    )
    found = read(tmp_path, file, keyframe="k")
    loads = found.imported.scene.load
    assert [load.type for load in loads] == ["torsion_spring", "slide_spring", "joint_torque", "spring"]
    turn, push, torque, _ = loads
    assert isinstance(turn, TorsionSpring) and isinstance(push, SlideSpring)
    assert turn.natural_angle == pytest.approx(0.0) and push.natural_displacement == pytest.approx(-0.25)
    assert torque.torque == 8.0
    assert found.qpos.tolist() == [0.5, 0.25] and found.qvel.tolist() == [0.0, 2.0]
    arm, cart = found.imported.scene.body
    assert arm.velocity == (0.0, 0.0, 0.0) and cart.velocity == (2.0, 0.0, 0.0)
    assert cart.position == (0.75, 3.0, 0.0) and cart.angular_velocity == (0.0, 0.0, 0.0)
    plain = read(tmp_path, file)
    assert [load.type for load in plain.imported.scene.load] == ["torsion_spring", "slide_spring", "spring"]
    assert any(said.startswith("2 keyframes: --keyframe NAME") for said in plain.imported.left_out)
    without = read(tmp_path, file, keyframe="k", without=["motors"])
    assert [load.type for load in without.imported.scene.load] == [
        "torsion_spring",
        "slide_spring",
        "spring",
    ]
    ball = f'<body name="o" pos="0 9 0"><joint name="B" type="ball" stiffness="1"/>{LUMP}</body>'
    assert faults(tmp_path, text(ball)) == [
        "stiffness of joint 'B': it changes the motion; --without springs leaves it out"
    ]


def test_notes_on_bodies_closures_and_frames(tmp_path: Path) -> None:
    """In the order in which they are found: closures, gaps, bodies, frames."""
    inner = f"""<body name="m" pos="0.5 0 0">{LUMP}</body><body name="n"><joint name="N" pos="9 9 9"/>
    <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body><site name="s" pos="0 4 0"/>"""
    more = """<equality><connect name="w" body1="arm" body2="m" anchor="0 0 0"/>
    <connect name="off" active="false" body1="arm" body2="cart" anchor="0 0 0"/>
    <weld name="open" site1="p" site2="q"/></equality>"""
    sites = '<site name="p" pos="7 0 0"/>'
    block = f'<body name="block" pos="7 0.5 0"><freejoint/>{LUMP}<site name="q" pos="0 0 0"/></body>'
    cart = CART.format("").replace("</body>", '<site name="t" pos="0 1 0"/></body>')
    found = read(tmp_path, text(sites, ARM.format("", inner), cart, block, more=more)).imported
    assert found.notes == (
        "equality 'off' is not active: it is not part of the scene",
        "closure 'w': both sides are on 'arm'",
        "closure 'open' was open by 0.5 m or rad; the joints moved to close it",
        "fixed to 'arm' and part of it: 'm'",
        "frames 's' (on 'arm') and 't' (on 'cart') coincide without a joint; --close s=t closes the loop",
    )
    assert [joint.name for joint in found.scene.joint] == ["A", "N", "S", "open"]
    assert found.scene.body[0].mass == 2.0
    closed = read(
        tmp_path, text(sites, ARM.format("", inner), cart, block, more=more), close=["s=t:revolute"]
    ).imported
    assert [joint.name for joint in closed.scene.joint] == ["A", "N", "S", "open", "s=t"]
    assert not any("coincide" in note for note in closed.notes)


def test_gravity_of_a_file(tmp_path: Path) -> None:
    file = text(ARM.format("", ""), head='<option gravity="1 2 3"/>')
    assert read(tmp_path, file).imported.scene.gravity == (1.0, 2.0, 3.0)
    off = file.replace('3"/>', '3"><flag gravity="disable" energy="enable"/></option>')
    assert read(tmp_path, off).imported.scene.gravity == (0.0, 0.0, 0.0)
    other = file.replace('3"/>', '3"><flag sensor="disable" energy="enable"/></option>')
    assert read(tmp_path, other).imported.scene.gravity == (1.0, 2.0, 3.0)


# --- URDF -------------------------------------------------------------------------------------------------
INERTIA = '<inertial><mass value="{}"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
ROBOT = f"""<robot name="r"><link name="base"/><link name="a">{INERTIA.format(2)}</link>
<link name="b">{INERTIA.format(3)}</link>
<joint name="J" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/></joint>
<joint name="K" type="continuous"><parent link="base"/><child link="b"/><origin xyz="1 0 0"/>
<axis xyz="0 0 1"/>{{}}</joint>{{}}</robot>"""


def test_a_urdf_with_a_mimic_joint_and_a_loop(tmp_path: Path) -> None:
    """K follows J; the loop joins both links where they are at the reference."""
    loop = """<loop name="L" type="spherical"><predecessor link="a"><origin xyz="2 0 0"/></predecessor>
    <successor link="b"><origin xyz="1 0 0"/></successor></loop>"""
    mimic = '<mimic joint="J" multiplier="2"/>'
    found = read(tmp_path, ROBOT.format(mimic, ""), "r.urdf").imported.scene
    [coupling] = found.coupling
    assert (coupling.joints, coupling.ratio, coupling.name) == (("J", "K"), 2.0, "K mimics J")
    assert [(body.name, body.mass) for body in found.body] == [("a", 2.0), ("b", 3.0)]
    assert not read(
        tmp_path, ROBOT.format(mimic, ""), "r.urdf", without=["couplings"]
    ).imported.scene.coupling
    closed = read(tmp_path, ROBOT.format("", loop), "r.urdf").imported.scene
    assert [(joint.name, joint.type) for joint in closed.joint][2:] == [("L", "spherical")]
    assert closed.joint[2].bodies == ("a", "b") and closed.joint[2].anchor == pytest.approx((2.0, 0.0, 0.0))
    to_base = loop.replace('"b"><origin xyz="1 0 0"/>', '"base"><origin xyz="2 0 0"/>')
    ground = read(tmp_path, ROBOT.format("", to_base), "r.urdf").imported.scene
    assert ground.joint[2].bodies == ("a", "ground")
    gear = '<coupling name="c"/>'
    assert faults(tmp_path, ROBOT.format("", gear), "r.urdf") == [
        "coupling 'c': it changes the motion; --without couplings leaves it out"
    ]


def test_links_without_mass_have_none_in_the_model(tmp_path: Path) -> None:
    """MuJoCo needs a mass; it is in neither the scene nor the model."""
    file = ROBOT.format("", "").replace(f'<link name="a">{INERTIA.format(2)}</link>', '<link name="a"/>')
    file = file.replace(
        '"base"/><child link="b"/><origin xyz="1 0 0"/>\n<axis xyz="0 0 1"/>',
        '"a"/>\n<child link="b"/><axis xyz="0 1 0"/>',
    )
    found = read(tmp_path, file, "r.urdf")
    assert [(body.name, body.mass) for body in found.imported.scene.body] == [("b", 3.0)]
    assert [joint.type for joint in found.imported.scene.joint] == ["universal"]
    assert found.model.body("a").mass[0] == 0.0 and not found.model.body("a").inertia.any()


def test_the_least_gap_that_is_noted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reading, "OPEN", 0.25)
    for gap, count in ((1.0, 0), (1.000001, 1)):
        reader: Any = object.__new__(reading._Reader)
        data = SimpleNamespace(qvel=np.zeros(1))
        gaps = {"r": gap, "other": 0.5}
        reader.poses = SimpleNamespace(extent=4.0, gaps=lambda g=gaps: g, close=gaps.clear, data=data)
        reader.notes = []
        reader._close()
        assert len(reader.notes) == count and not gaps


def test_the_root_of_a_urdf() -> None:
    import xml.etree.ElementTree as ET

    from crosscheck.engines.mujoco.importing.urdf import Text

    assert reading._root_link(None) == "ground"
    root = ET.fromstring(ROBOT.format("", ""))
    assert reading._root_link(Text("", {}, root)) == "base"
    assert reading._root_link(Text("", {}, ET.fromstring("<robot/>"))) == "ground"


def test_velocities_are_kept_without_closures(tmp_path: Path) -> None:
    reader: Any = object.__new__(reading._Reader)
    data = SimpleNamespace(qvel=np.array([3.0, 0.0]))
    reader.poses = SimpleNamespace(data=data, jacobian=lambda: np.zeros((0, 2)))
    reader._keep_velocities()
    assert data.qvel.tolist() == [3.0, 0.0]
    reader.poses.jacobian = lambda: np.array([[1.0, 1.0]])
    reader._keep_velocities()
    assert data.qvel == pytest.approx([1.5, -1.5])
