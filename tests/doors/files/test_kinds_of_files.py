"""One MJCF or URDF file for each kind of part: it moves as MuJoCo's own model, or is refused by name."""

import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from crosscheck.engines.loaders.loader import DOUBLE, built
from crosscheck.engines.loaders.pinocchio import Pinocchio
from crosscheck.engines.mujoco.importing.reading import Source, source
from crosscheck.files.matching import matched
from crosscheck.files.reading import differences, file_of
from mbref.formats import ImportOptions
from mbref.scene import SceneError
from tests.doors.files.test_importing import LUMP, hinge, read
from tests.helpers.originals import apart

KINDS = Path(__file__).parent / "models" / "kinds"
SAME = 1e-9  # of the largest distance moved, and of the largest entry of a matrix; worst measured 9e-11
END = 0.005  # s, of the compared motions
OPTIONS = {
    "close.urdf": ImportOptions(close=["fb=fc"]),
    "close_revolute.urdf": ImportOptions(close=["fb=fc:revolute:y"]),
    "close_unknown.urdf": ImportOptions(close=["fb=fd"]),
    "gripper_2f.xml": ImportOptions(without=frozenset({"limits"})),  # they act at the start
    "gripper_coupled_by_springs.xml": ImportOptions(without=frozenset({"motors"})),  # one acts on a tendon
    "hold_floating.urdf": ImportOptions(hold=["base"]),
}
UNSUPPORTED = {  # file: its element, and the option that leaves it out, if any
    "actuator_armature_on_a_ball.xml": "armature of 'd', which is no actuator of a hinge or slide",
    "ball_with_armature.xml": "armature of 'x'.*--without armature",
    "ball_with_damper.xml": "stiffness of joint 'x'.*--without springs",
    "fixed_tendon_spring.xml": "tendon 't', which is not a spring between two sites",
    "flexcomp.xml": "1 flexible body.*--without flexible-bodies",
    "floating_on_a_moving_link.urdf": "joint 'F': floats on link 'a', which is not the base of the file",
    "fluid.xml": "the fluid around the bodies.*--without fluid",
    "friction.urdf": "dry friction of 'A'.*--without friction",
    "frictionloss.xml": "dry friction of 'B'.*--without friction",
    "gravcomp.xml": "compensation of the weight of b.*--without gravity-compensation",
    "motor_of_tendon.xml": "actuator 's', which acts on no single hinge or slide.*--without motors",
    "motor_with_filter.xml": "actuator 0, whose input changes over time",
    "plastic_spring.xml": "plastic spring of joint 'B'.*--without springs",
    "site_transmission.xml": "actuator 0, which acts on no single hinge or slide",
    "slack_tendon.xml": "tendon 't', whose spring is slack over a range.*--without springs",
    "spatial_tendon_equality.xml": "type tendon, of a tendon that no fixed sum of joint coordinates gives",
    "stiffness_arrays.xml": "polynomial springs of joint 'A'.*polynomial damping of joint 'A'",
    "tendon_armature.xml": "armature of tendons t.*--without armature",
    "tendon_limits_and_friction.xml": "friction of tendons t.*--without friction",
    "tendon_through_a_pulley.xml": "tendon 's', which is not a spring between two sites",
    "xacro_macro.urdf": "element <xacro:macro>: is a macro of xacro; write the URDF with",
    "xacro_property.urdf": r"<mass value='\$\{m\}'>: is an expression of xacro",
}
FAULTY = {  # file: its fault
    "circle.urdf": "the joints form a circle",
    "close_unknown.urdf": "no link, body, site or joint 'fd'; known: world",
    "mimic_of_a_fixed_joint.urdf": "joint 'C' mimics 'A': the file has no such joint that moves",
    "missing_mesh_inertia.xml": "body 'link2': its inertia follows from the shape 'link2', whose file",
    "negative_mass.urdf": "link 'a': its mass must not be negative, got -1",
    "no_inertia.urdf": "joint 'A': its bodies have no inertia about or along its axis",
    "parallel_slides.xml": "body 'a': joints slide, slide in a row have dependent motions",
    "straight_without_gravity.xml": "closure 'e': cannot be closed from this pose; the least gap found",
    "two_parents.urdf": "link 'c': is the child of two joints, 'C' and 'D'",
    "two_roots.urdf": "links 'base', 'stray': no joint carries them",
    "unknown_link.urdf": "joint 'C': its parent link 'nothing' is not in the file",
}
ROWS_OF_OUR_OWN = ("close", "mimic")  # MuJoCo reads none from a URDF; see test_robot_files.py
SLOW = (  # 1 to 16 s
    *("excavator_with_springs.xml", "gripper_2f.xml", "gripper_coupled_by_springs.xml"),
    *("hand_of_tendons.xml", "kangaroo_leg.xml", "leg_with_shin_spring.xml", "stewart.xml"),
    *("stewart_with_cylinders.xml", "wheel_with_gearbox.xml"),
)
READ = sorted(path.name for path in KINDS.iterdir() if path.name not in UNSUPPORTED | FAULTY)


def found(name: str) -> Source:
    """Return what the import makes of a file, with its OPTIONS or at its keyframe "k"."""
    text = (KINDS / name).read_text()
    options = OPTIONS.get(name, ImportOptions(keyframe="k" if "<keyframe>" in text else ""))
    return source(KINDS / name, options)


BY_MUJOCO = [name for name in READ if not name.startswith(ROWS_OF_OUR_OWN)]


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] * (n in SLOW)) for n in BY_MUJOCO])
def test_imported_scene_moves_as_mujoco_s_model_of_the_file(name):
    """``apart`` is the difference of two motions over 0.005 s: the judge's of the scene, and MuJoCo's masses,
    forces and rows of the file, with the controls of its last keyframe, integrated finely."""
    read_file = found(name)
    assert apart(read_file.original, read_file, END, read_file.original.nkey - 1) < SAME


@pytest.mark.parametrize(("name", "said"), (UNSUPPORTED | FAULTY).items(), ids=UNSUPPORTED | FAULTY)
def test_file_with_an_unsupported_element_or_a_fault_is_refused_with_its_name(name, said):
    """The tables give the words of the refusal, which name the part that is the cause."""
    with pytest.raises(SceneError) as refusal:
        found(name)
    assert re.search(said, " ".join(str(refusal.value).split()))


@pytest.mark.parametrize("name", [n for n in READ if n.endswith(".urdf") and "mimic" not in n])
def test_pinocchio_builds_the_machine_of_the_urdf(name):
    """A machine's bodies, joints and couplings, and its mass matrix and weight at four poses, equal the
    file's. Files with mimic elements are left out, as Pinocchio loses some of them."""
    pytest.importorskip("pinocchio")
    file = file_of(KINDS / name)
    reading = built(Pinocchio(), file.path, file.form, replace(file.asked, states=(), starts=()))
    match = matched(file.machine, reading.machine, DOUBLE)
    assert differences(match, file, reading, DOUBLE) == [] and not reading.faults


def test_loop_is_closed_between_joints_as_between_their_child_links():
    """YAML files of parallel robots name joints. Both ways close the loop by a ball joint at one place."""
    elements = ET.parse(KINDS / "close.urdf").getroot().findall("joint")
    joints = {joint.find("child").get("link"): joint.get("name") for joint in elements}
    pair = ImportOptions(close=[f"{joints['fb']}={joints['fc']}"])
    by_joints = source(KINDS / "close.urdf", pair).imported.scene
    by_links = found("close.urdf").imported.scene
    ends = [scene.joint[-1].anchor_pair for scene in (by_joints, by_links)]
    assert by_joints.joint[-1].type == "spherical" and np.allclose(*ends, rtol=0, atol=1e-14)  # m: roundings


def test_each_further_attempt_to_close_a_loop_is_announced():
    """The straight chain without gravity closes from none of four poses."""
    said: list[str] = []
    with pytest.raises(SceneError):
        source(KINDS / "straight_without_gravity.xml", ImportOptions(say=said.append))
    begun = [text.partition(":")[0] for text in said]
    assert begun == [f"closing the loops, attempt {k} of 4" for k in (2, 3, 4)]


def test_attribute_of_an_older_mujoco_is_named_with_the_version_that_lacks_it(tmp_path):
    """MuJoCo 2 had the attribute collision of <option>; MuJoCo 3 has not."""
    (tmp_path / "old.xml").write_text('<mujoco><option collision="all"/></mujoco>')
    with pytest.raises(SceneError, match=r"'collision'.*'option'.*MuJoCo \d.* does not have it, older"):
        source(tmp_path / "old.xml", ImportOptions())


def test_included_and_attached_bodies_are_imported_with_their_prefix(tmp_path):
    """An included file gives body "arm"; the file attached with prefix "left/" gives "left/arm"."""
    arm = f'<body name="arm" pos="0 0 0.5">{hinge("A")}{LUMP}</body>'
    (tmp_path / "arm.xml").write_text(f"<mujoco><worldbody>{arm}</worldbody></mujoco>")
    both = """<mujoco><include file="arm.xml"/><asset><model name="other" file="arm.xml"/></asset><worldbody>
    <frame pos="1 0 0" euler="0 0 30"><attach model="other" body="arm" prefix="left/"/></frame>
    </worldbody></mujoco>"""
    read_file = read(tmp_path, both)
    assert [body.name for body in read_file.imported.scene.body] == ["arm", "left/arm"]
    assert apart(read_file.original, read_file, END) < SAME


def test_straight_chain_is_closed_below_its_straight_line():
    """The file's chain is straight at a height of 1 m and can close upward or downward. The import closes it
    to the side to which gravity points: its joint C is below 1 m."""
    scene = found("connect_by_sites.xml").imported.scene
    assert scene.joint_named("C").anchor[2] < 1.0


def test_missing_shape_files_are_named_in_the_notes():
    """The file has masses, and three shapes and textures whose files do not exist."""
    notes = found("missing_mesh.xml").imported.notes
    assert "files that are missing: link1.stl, link2.obj, skin.png; these shapes have no effect" in notes


def test_motion_capture_body_stands_at_its_place_in_the_keyframe():
    """The keyframe has mpos="0.6 0.1 1.5"; the file's own place of the body is (0.5, 0, 1.4)."""
    scene = found("mocap_in_a_keyframe.xml").imported.scene
    assert np.allclose(scene.joint_named("e").anchor, (0.6, 0.1, 1.5))
