"""Scenes imported from MJCF and URDF move as MuJoCo's compiled model of the file."""

import re
from pathlib import Path

import numpy as np
import pytest

from crosscheck.engines.mujoco.importing.reading import Source, source
from crosscheck.judge.gauss_principle import rank
from mbref.formats import ImportOptions
from mbref.scene import SceneError
from tests.helpers import originals

SAME = 1e-8  # allowed difference of motions, of the largest way moved; 6e-11 is measured on robots' files


def difference(found: Source) -> float:
    """Return the largest difference over 20 ms of the scene's motion, by Gauss's principle, from the motion
    of MuJoCo's model of the file, by its masses, forces and rows; relative to the largest way moved."""
    return originals.apart(found.model, found, 0.02)


def read(tmp_path: Path, text: str, name: str = "model.xml", **options) -> Source:
    (tmp_path / name).write_text(text)
    return source(tmp_path / name, ImportOptions(**options))


def hinge(name: str, axis: str = "0 1 0", more: str = "") -> str:
    return f'<joint name="{name}" type="hinge" axis="{axis}" {more}/>'


LUMP = '<inertial pos="0.1 0.02 0" mass="0.7" diaginertia="0.002 0.003 0.004"/>'
OPEN_LOOP = f"""<mujoco><worldbody>
<body name="left" pos="0 0 1">{hinge("A")}<inertial pos="0.1 0 0" mass="0.3" diaginertia="1e-4 1e-3 1e-3"/>
<body name="bar" pos="0.25 0 0">{hinge("B")}<inertial pos="0.3 0 0" mass="0.5" diaginertia="1e-4 1e-2 1e-2"/>
<site name="tip" pos="0.6 0 0"/></body></body>
<body name="right" pos="0.7 0 1">{hinge("D")}
<inertial pos="0 0 -0.2" mass="0.4" diaginertia="5e-3 5e-3 1e-4"/>
<site name="toe" pos="0 0 -0.5"/></body></worldbody>
<equality>EQUALITY</equality><keyframe><key name="low" qpos="0.5 0.6 0.1"/></keyframe></mujoco>"""
CONNECT = '<connect name="C" site1="tip" site2="toe"/>'


def test_an_open_connect_of_sites_is_closed_with_the_lengths_of_the_file(tmp_path):
    """By the file, the sites of C are 0.6 m from hinge B and 0.5 m from hinge D, and B is 0.25 m from A, at
    (0, 0, 1) m. A note states the gap at the file's zero angles, √(0.15² + 0.5²) = 0.522 m, to one
    digit. The scene moves as MuJoCo's model."""
    found = read(tmp_path, OPEN_LOOP.replace("EQUALITY", CONNECT))
    scene = found.imported.scene
    at = np.array(scene.joint_named("C").anchor)
    for other, length in (("B", 0.6), ("D", 0.5)):
        assert np.linalg.norm(at - scene.joint_named(other).anchor) == pytest.approx(length, abs=1e-11)  # m
    assert np.linalg.norm(np.subtract(scene.joint_named("B").anchor, (0, 0, 1))) == pytest.approx(0.25)
    assert any("'C' was open by 0.5" in note for note in found.imported.notes)
    assert difference(found) < SAME


def test_loop_that_a_keyframe_almost_closes_is_closed_near_it(tmp_path):
    """In a pose with a closed loop A is at 0.4 rad; each angle of the keyframe is 0.01 rad larger. The loop
    is closed by the least motion from the keyframe, within 0.05 rad of this pose. From the file's zero
    angles, A would have to move by 0.4 rad."""
    text = OPEN_LOOP.replace("EQUALITY", CONNECT)
    closed = read(tmp_path, text, pose={"A": 0.4}).qpos
    keyframe = " ".join(map(repr, (closed + 0.01).tolist()))
    found = read(tmp_path, text.replace("0.5 0.6 0.1", keyframe), keyframe="low")
    assert np.abs(found.qpos - closed).max() < 0.05
    assert difference(found) < SAME


def test_unknown_keyframe_or_joint_of_a_pose_is_refused_with_the_known_names(tmp_path):
    """The file has the keyframe "low" and joints A, B and D."""
    text = OPEN_LOOP.replace("EQUALITY", CONNECT)
    with pytest.raises(SceneError, match="no keyframe 'lo'; known: low; did you mean 'low'"):
        read(tmp_path, text, keyframe="lo")
    with pytest.raises(SceneError, match="--pose: no joint 'E'; known: A, B, D"):
        read(tmp_path, text, pose={"E": 1.0})


@pytest.mark.parametrize("span", [1.6, 2.5])  # m, between the pivots A and D
def test_refusal_of_a_loop_that_is_too_short_states_the_least_gap(span, tmp_path):
    """Links of 0.25, 0.6 and 0.5 m reach 1.35 m when they are stretched: the least gap is span - 1.35 m. The
    message has three digits of the least gap of the poses that were tried, which come within 2 %."""
    text = OPEN_LOOP.replace("EQUALITY", CONNECT).replace('pos="0.7 0 1"', f'pos="{span} 0 1"')
    with pytest.raises(SceneError, match="'C': cannot be closed") as caught:
        read(tmp_path, text)
    printed, least = float(re.search(r"least gap found is (\S+) m", str(caught.value))[1]), span - 1.35
    assert least - 0.005 < printed < 1.02 * least


def middle(first: str, second: str, offset: str = "0 0 0", more: str = "") -> str:
    """Return a URDF: hinge about the axis ``first``, link ``mid`` without mass, hinge about ``second`` at an
    offset (m) from the first, link ``l`` of 0.4 kg."""
    return f"""<robot name="r"><link name="base"/><link name="mid"/>{more}
    <link name="l"><inertial><origin xyz="0.15 0 0.02"/><mass value=".4"/>
    <inertia ixx=".0001" iyy=".003" izz=".003" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <joint name="j1" type="continuous"><parent link="base"/><child link="mid"/><axis xyz="{first}"/></joint>
    <joint name="j2" type="continuous"><parent link="mid"/><child link="l"/><origin xyz="{offset}"/>
    <axis xyz="{second}"/></joint></robot>"""


@pytest.mark.parametrize(
    ("second", "offset", "joints", "masses"),
    [
        ("0 0 1", "0 0 0", ["universal"], [0.4]),  # axes that cross
        ("0 1 0", "0.3 0 0", ["planar", "distance"], [0.4]),  # parallel axes
        ("0 0 1", "0.3 0 0", ["revolute", "revolute"], [0.0, 0.4]),  # skew axes: the link stays
    ],
)
def test_two_hinges_of_a_massless_link_leave_two_freedoms(second, offset, joints, masses, tmp_path):
    """If joints of a scene can replace both hinges, they do and the link is left out; otherwise it stays,
    with mass 0. Freedoms are six a body less the judge's rank. The scene moves as MuJoCo's model."""
    found = read(tmp_path, middle("0 1 0", second, offset), "hinges.urdf")
    scene = found.imported.scene
    assert [joint.type for joint in scene.joint] == joints and [body.mass for body in scene.body] == masses
    assert 6 * len(scene.body) - rank(scene) == 2
    assert difference(found) < SAME


def test_a_massless_link_that_carries_nothing_is_left_out_with_a_note(tmp_path):
    """The link "horn" is on a hinge at the end of the chain. The scene is the one of the file without it."""
    idle = """<link name="horn"/>
    <joint name="j3" type="continuous"><parent link="l"/><child link="horn"/></joint>"""
    found = read(tmp_path, middle("0 1 0", "0 0 1", more=idle), "idle.urdf")
    assert any("'horn' has no mass and carries none" in note for note in found.imported.notes)
    assert found.imported.scene == read(tmp_path, middle("0 1 0", "0 0 1"), "idle.urdf").imported.scene


@pytest.mark.parametrize(
    "turn", ['<joint type="ball"/>', hinge("r") + hinge("p", "0 0 1") + hinge("y", "1 0 0")]
)
def test_a_root_with_three_slides_and_three_rotations_is_a_free_body(turn, tmp_path):
    """The rotations are a ball joint or three hinges. The scene has no joint, and moves as MuJoCo's model."""
    slides = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
    pelvis = f'<body name="pelvis" pos="0 0 1">{slides}{turn}{LUMP}</body>'
    text = f"<mujoco><worldbody>{pelvis}</worldbody></mujoco>"
    found = read(tmp_path, text)
    assert not found.imported.scene.joint
    assert difference(found) < SAME


def open_chain() -> str:
    """A URDF of two branches, whose frames end_a and end_b coincide at the reference pose."""
    text = """<robot name="r"><link name="base"/><link name="end_a"/><link name="end_b"/>
    LINKS<joint name="A" type="continuous"><parent link="base"/><child link="one"/><axis xyz="0 1 0"/></joint>
    <joint name="B" type="continuous"><parent link="one"/><child link="two"/>
    <origin xyz="0.2 0 0"/><axis xyz="0 1 0"/></joint>
    <joint name="D" type="continuous"><parent link="base"/><child link="three"/>
    <origin xyz="0.5 0 0.4"/><axis xyz="0 1 0"/></joint>
    <joint name="a" type="fixed"><parent link="two"/><child link="end_a"/><origin xyz="0.3 0 0"/></joint>
    <joint name="b" type="fixed"><parent link="three"/><child link="end_b"/>
    <origin xyz="0 0 -0.4"/></joint></robot>"""
    link = """<link name="{}"><inertial><origin xyz="0.1 0 0"/><mass value=".3"/>
    <inertia ixx=".001" iyy=".002" izz=".0015" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
    return text.replace("LINKS", "".join(link.format(n) for n in ("one", "two", "three")))


def test_note_names_frames_of_two_branches_that_coincide(tmp_path):
    """Frames that coincide may be the ends of a loop, which URDF cannot close."""
    notes = read(tmp_path, open_chain(), "open.urdf").imported.notes
    assert any("'end_a' (on 'two') and 'end_b' (on 'three') coincide" in note for note in notes)


def test_close_reads_pairs_of_frames_from_a_yaml_file(tmp_path):
    """The pair end_a and end_b, of type 3d, closes the chain of three hinges by a ball joint, whether the
    option `close` has it as text or names a file with it."""
    (tmp_path / "loops.yaml").write_text("closed_loop: [[end_a, end_b]]\ntype: [3d]\n")
    closed = [
        read(tmp_path, open_chain(), "closed.urdf", close=[pairs]).imported.scene.joint
        for pairs in (str(tmp_path / "loops.yaml"), "end_a=end_b")
    ]
    assert closed[0] == closed[1] and [j.type for j in closed[0]] == ["revolute"] * 3 + ["spherical"]


@pytest.mark.parametrize(
    ("pair", "says"),
    [
        ("end_a", "must be frame_a=frame_b"),
        ("end_a=end_c", "did you mean 'end_b'"),
        ("end_a=end_b:gear", "type 'gear' is none of"),
        ("end_a=end_b:revolute:w", "axis 'w' is none of"),
    ],
)
def test_faulty_argument_of_close_is_refused(pair, says, tmp_path):
    """The form is frame_a=frame_b:type:axis; the file has frames end_a and end_b."""
    with pytest.raises(SceneError, match=says):
        read(tmp_path, open_chain(), "open.urdf", close=[pair])


def follower(mimic: str) -> str:
    """A URDF whose second hinge follows the first."""
    text = middle("0 1 0", "0 0 1", "0.2 0 0")
    moments = 'ixx="1e-3" ixy="0" ixz="0" iyy="2e-3" iyz="0" izz="2e-3"'
    mass = f'<inertial><mass value="0.4"/><inertia {moments}/></inertial>'
    text = text.replace('<link name="mid"/>', f'<link name="mid">{mass}</link>')
    return text.replace('<axis xyz="0 0 1"/>', f'<axis xyz="0 0 1"/>{mimic}')


def test_a_mimic_joint_is_a_coupling_whose_offset_the_pose_meets(tmp_path):
    """The file says q₂ = 0.3 rad - 1.5 q₁; ``qpos`` are the angles of the scene's pose."""
    found = read(tmp_path, follower('<mimic joint="j1" multiplier="-1.5" offset="0.3"/>'), "mimic.urdf")
    scene = found.imported.scene
    (coupling,) = scene.coupling
    assert (coupling.joints, coupling.ratio) == (("j1", "j2"), -1.5)
    first, second = found.qpos
    assert second == pytest.approx(0.3 - 1.5 * first, abs=1e-12)  # rad
