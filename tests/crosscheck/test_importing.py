"""Imported scenes / the file's own compiled model: accelerations, idioms of robot files, open loops."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import mbref
from crosscheck.engines.mujoco.importing.reading import Source, source
from crosscheck.judge.gauss_principle import gauss, rank
from mbref.formats import ImportOptions
from mbref.scene import SceneError
from tests.crosscheck import random_models

SAME = 1e-8  # of the largest acceleration; worst measured 2e-10


def accelerations(found: Source, loops=()) -> np.ndarray:
    """(2 nb, 3) of the scene's bodies at its pose, by MuJoCo's matrices; ``loops`` are spherical closures."""
    model, data = found.model, mujoco.MjData(found.model)
    data.qpos[:], data.qvel[:] = found.qpos, found.qvel
    for stage in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_tendon, mujoco.mj_makeM):
        stage(model, data)
    mujoco.mj_makeConstraint(model, data)
    mujoco.mj_fwdVelocity(model, data)
    rows = data.efc_type[: data.nefc] == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    jacobian = [data.efc_J[: data.nefc * model.nv].reshape(data.nefc, model.nv)[rows]]
    for first, a, second, b in loops:
        ends = [point_jacobian(model, data, name, p) for name, p in ((first, a), (second, b))]
        jacobian.append(ends[1] - ends[0])
    held = constrained(model, data, np.vstack(jacobian))
    twists = np.array([found.groups.placed(data, piece).jacobian @ held for piece in found.groups.pieces])
    return np.vstack([twists[:, :3], twists[:, 3:]])


def point_jacobian(model, data, name, local) -> np.ndarray:
    b = model.body(name).id
    found = np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, found, None, data.xpos[b] + data.xmat[b].reshape(3, 3) @ local, b)
    return found


def constrained(model, data, rows) -> np.ndarray:
    """q̈ at rest: the least in the metric of the masses beside the free one, with rows q̈ = 0."""
    rows = rows[np.linalg.norm(rows, axis=1) > 1e-10]  # others are rounding, of parts fixed together
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    idle = np.diag(mass) == 0
    mass[idle, idle] = 1.0
    free = np.linalg.solve(mass, data.qfrc_passive - data.qfrc_bias)
    inverse = np.linalg.solve(mass, rows.T)
    return free - inverse @ np.linalg.pinv(rows @ inverse, rcond=1e-9) @ (rows @ free)


def same(found: Source, loops=()) -> None:
    from crosscheck.judge.constraints import scene_length

    scene, theirs = found.imported.scene, accelerations(found, loops)
    theirs[len(scene.body) :] *= scene_length(scene)
    ours = gauss(scene)
    scale = max(np.abs(theirs).max(), 1.0)  # m/s²: rounding of the weight, where the loops leave no motion
    assert np.abs(ours - theirs).max() < SAME * scale, (np.abs(ours - theirs).max(), scale)


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


def test_an_open_site_connect_keeps_both_anchors(tmp_path):
    found = read(tmp_path, OPEN_LOOP.replace("EQUALITY", CONNECT))
    scene = found.imported.scene
    at = np.array(scene.joint_named("C").anchor)
    for other, length in (("B", 0.6), ("D", 0.5)):
        assert np.linalg.norm(at - scene.joint_named(other).anchor) == pytest.approx(length, abs=1e-11)
    assert np.linalg.norm(np.subtract(scene.joint_named("B").anchor, (0, 0, 1))) == pytest.approx(0.25)
    assert any("'C' was open by 0.5" in note for note in found.imported.notes)
    assert 6 * len(scene.body) - rank(scene) == 1
    same(found)


def test_loops_close_from_a_keyframe_or_a_given_pose(tmp_path):
    text = OPEN_LOOP.replace("EQUALITY", CONNECT)
    by_key = read(tmp_path, text, keyframe="low")
    by_pose = read(tmp_path, text, pose={"A": 0.4})
    assert by_pose.qpos[0] == 0.4 and abs(by_key.qpos[0] - 0.5) < 0.3
    for found in (by_key, by_pose):
        same(found)
    with pytest.raises(SceneError, match="no keyframe 'lo'; known: low; did you mean 'low'"):
        read(tmp_path, text, keyframe="lo")
    with pytest.raises(SceneError, match="--pose: no joint 'E'; known: A, B, D"):
        read(tmp_path, text, pose={"E": 1.0})


def test_a_loop_that_cannot_be_closed_is_refused_with_its_gap(tmp_path):
    text = OPEN_LOOP.replace("EQUALITY", CONNECT).replace('pos="0.7 0 1"', 'pos="1.6 0 1"')
    with pytest.raises(SceneError, match=r"'C': cannot be closed.*least gap found is 0.2[0-9]* m or rad"):
        read(tmp_path, text)


def test_a_weld_without_torque_is_a_ball_and_one_with_relative_pose_is_assembled(tmp_path):
    weld = '<weld name="C" site1="tip" site2="toe" torquescale="0"/>'
    found = read(tmp_path, OPEN_LOOP.replace("EQUALITY", weld))
    assert found.imported.scene.joint_named("C").type == "spherical"
    same(found)
    two = f"""<mujoco><worldbody><body name="a" pos="0 0 1">{hinge("A")}{hinge("A2", "1 0 0")}{LUMP}</body>
    <body name="b" pos="0.4 0 1"><freejoint/>{LUMP}</body></worldbody>
    <equality><weld name="W" body1="a" body2="b"
    relpose="0.3 0.1 0 0.9689124217106447 0 0.24740395925452294 0"/>
    </equality></mujoco>"""
    held = read(tmp_path, two)
    joint = held.imported.scene.joint_named("W")
    assert joint.type == "fixed" and any("'W' was open by" in note for note in held.imported.notes)
    a, b = held.imported.scene.body
    angle = 2 * np.arccos(abs(np.dot(a.orientation, b.orientation)))
    assert angle == pytest.approx(0.5, abs=1e-9)
    same(held)


def test_links_fixed_together_are_one_body(tmp_path):
    text = """<robot name="r"><link name="base"/><link name="frame"/>
    <link name="arm"><inertial><origin xyz="0.2 0 0"/><mass value="0.5"/>
    <inertia ixx="0.0002" iyy="0.004" izz="0.004" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <link name="lamp"><inertial><mass value="0.1"/>
    <inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <link name="mark"/>
    <joint name="j" type="continuous"><parent link="base"/><child link="frame"/><axis xyz="0 1 0"/></joint>
    <joint name="k" type="fixed"><parent link="frame"/><child link="arm"/><origin xyz="0.1 0 0"/></joint>
    <joint name="m" type="fixed"><parent link="arm"/><child link="lamp"/><origin xyz="0.4 0 0"/></joint>
    <joint name="n" type="fixed"><parent link="lamp"/><child link="mark"/></joint></robot>"""
    found = read(tmp_path, text, "lamp.urdf")
    (body,) = found.imported.scene.body
    assert body.name == "arm" and body.mass == pytest.approx(0.6)
    assert body.position == pytest.approx(((0.5 * 0.3 + 0.1 * 0.5) / 0.6, 0.0, 0.0))
    about = 0.004 + 0.5 * 0.3**2 + 0.1 * 0.5**2 - 0.6 * body.position[0] ** 2
    assert np.array(body.inertia).ravel()[4 if len(np.shape(body.inertia)) == 2 else 1] == pytest.approx(
        about
    )
    same(found)


def middle(first: str, second: str, apart: str = "0 0 0", more: str = "") -> str:
    return f"""<robot name="r"><link name="base"/><link name="mid"/>{more}
    <link name="l"><inertial><origin xyz="0.15 0 0.02"/><mass value=".4"/>
    <inertia ixx=".0001" iyy=".003" izz=".003" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <joint name="j1" type="continuous"><parent link="base"/><child link="mid"/><axis xyz="{first}"/></joint>
    <joint name="j2" type="continuous"><parent link="mid"/><child link="l"/><origin xyz="{apart}"/>
    <axis xyz="{second}"/></joint></robot>"""


def test_hinges_about_a_link_without_mass(tmp_path):
    crossing = read(tmp_path, middle("0 1 0", "0 0 1"), "u.urdf")
    assert [joint.type for joint in crossing.imported.scene.joint] == ["universal"]
    same(crossing)
    apart = read(tmp_path, middle("0 1 0", "0 1 0", "0.3 0 0"), "p.urdf")
    assert [joint.type for joint in apart.imported.scene.joint] == ["planar", "distance"]
    assert 6 - rank(apart.imported.scene) == 2
    same(apart)
    skew = read(tmp_path, middle("0 1 0", "0 0 1", "0.3 0 0"), "s.urdf")
    assert [(body.name, body.mass) for body in skew.imported.scene.body] == [("mid", 0.0), ("l", 0.4)]
    same(skew)


def test_a_link_without_mass_that_carries_two_is_kept_and_one_that_carries_none_is_named(tmp_path):
    more = """<link name="o"><inertial><mass value="1"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
    </inertial></link>
    <joint name="j3" type="continuous"><parent link="mid"/><child link="o"/><axis xyz="1 0 0"/></joint>"""
    both = read(tmp_path, middle("0 1 0", "0 0 1", more=more), "two.urdf")
    assert [body.name for body in both.imported.scene.body if not body.mass] == ["mid"]
    same(both)
    idle = """<link name="horn"/>
    <joint name="j3" type="continuous"><parent link="l"/><child link="horn"/></joint>"""
    found = read(tmp_path, middle("0 1 0", "0 0 1", more=idle), "idle.urdf")
    assert any("'horn' has no mass and carries none" in note for note in found.imported.notes)
    same(found)


@pytest.mark.parametrize(
    "turn", ['<joint type="ball"/>', hinge("r") + hinge("p", "0 0 1") + hinge("y", "1 0 0")]
)
def test_three_slides_and_turns_at_the_root_are_a_free_body(turn, tmp_path):
    slides = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
    text = (
        f'<mujoco><worldbody><body name="pelvis" pos="0 0 1">{slides}{turn}{LUMP}</body></worldbody></mujoco>'
    )
    found = read(tmp_path, text)
    assert not found.imported.scene.joint
    same(found)


def test_coincident_frames_are_named_and_closed_on_request(tmp_path):
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
    text = text.replace("LINKS", "".join(link.format(n) for n in ("one", "two", "three")))
    loose = read(tmp_path, text, "loose.urdf")
    assert any(
        "'end_a' (on 'two') and 'end_b' (on 'three') coincide" in note for note in loose.imported.notes
    )
    closed = read(tmp_path, text, "closed.urdf", close=["end_a=end_b"])
    assert 18 - rank(closed.imported.scene) == 1 and not closed.imported.notes
    same(closed, [("end_a", np.zeros(3), "end_b", np.zeros(3))])
    about = read(tmp_path, text, "about.urdf", close=["end_a=end_b:revolute:y"]).imported.scene
    assert about.joint[-1].type == "revolute" and about.joint[-1].axis == pytest.approx((0.0, 1.0, 0.0))
    (tmp_path / "loops.yaml").write_text("closed_loop: [[end_a, end_b]]\ntype: [3d]\n")
    assert read(tmp_path, text, "y.urdf", close=[str(tmp_path / "loops.yaml")]).imported.scene.joint == (
        closed.imported.scene.joint
    )
    for wish, says in (
        ("end_a", "must be frame_a=frame_b"),
        ("end_a=end_c", "did you mean 'end_b'"),
        ("end_a=end_b:gear", "type 'gear' is none of"),
        ("end_a=end_b:revolute:w", "axis 'w' is none of"),
    ):
        with pytest.raises(SceneError, match=says):
            read(tmp_path, text, "wish.urdf", close=[wish])


def follower(mimic: str) -> str:
    """A URDF whose second hinge follows the first."""
    text = middle("0 1 0", "0 0 1", "0.2 0 0")
    moments = 'ixx="1e-3" ixy="0" ixz="0" iyy="2e-3" iyz="0" izz="2e-3"'
    mass = f'<inertial><mass value="0.4"/><inertia {moments}/></inertial>'
    text = text.replace('<link name="mid"/>', f'<link name="mid">{mass}</link>')
    return text.replace('<axis xyz="0 0 1"/>', f'<axis xyz="0 0 1"/>{mimic}')


def test_mimic_joints_are_couplings(tmp_path):
    found = read(tmp_path, follower('<mimic joint="j1" multiplier="-1.5" offset="0.3"/>'), "mimic.urdf")
    scene = found.imported.scene
    (coupling,) = scene.coupling
    assert (coupling.joints, coupling.ratio) == (("j1", "j2"), -1.5)
    first, second = found.qpos
    assert second == pytest.approx(0.3 - 1.5 * first, abs=1e-12), "the pose is assembled"
    plain = read(tmp_path, follower('<mimic joint="j1"/>'), "plain.urdf", without=["couplings"])
    assert len(plain.imported.scene.coupling) == 1, "a scene has it"


def test_a_mimic_of_no_joint_is_refused(tmp_path):
    with pytest.raises(SceneError, match="joint 'j2' mimics 'j9': the file has no such joint"):
        read(tmp_path, follower('<mimic joint="j9"/>'), "mimic.urdf")


GEARS = """<mujoco><option gravity="0 0 -9.81"/><worldbody>
<body name="w1" pos="0 0 1"><joint name="g1" axis="0 1 0" armature="0.02"/>
<inertial pos="0.05 0 0" mass="1" diaginertia=".01 .01 .01"/></body>
<body name="w2" pos="0.3 0 1"><joint name="g2" axis="0 1 0"/>
<inertial pos="0 0.02 0.1" mass="1" diaginertia=".02 .02 .02"/></body>
</worldbody><equality><joint name="gears" joint1="g2" joint2="g1" polycoef="POLY"/></equality></mujoco>"""


def test_equalities_of_joints_are_couplings(tmp_path):
    found = read(tmp_path, GEARS.replace("POLY", "0 -2 0 0 0"))
    same(found)
    (coupling,) = found.imported.scene.coupling
    assert (coupling.name, coupling.joints, coupling.ratio) == ("gears", ("g1", "g2"), -2.0)
    assert found.imported.scene.joint[0].armature == 0.02 and not found.imported.left_out[1:]
    fallen = mbref.simulate(found.imported.scene, times=[0.0, 0.2], method="alf-dual+projection/dop853")
    turned = [fallen.joint(name).angle[-1] for name in ("g1", "g2")]
    assert turned[1] == pytest.approx(-2 * turned[0], rel=1e-9) and turned[0] > 0.01


def test_an_offset_of_a_coupling_moves_the_pose(tmp_path):
    found = read(tmp_path, GEARS.replace("POLY", "0.4 -2 0 0 0"))
    same(found)
    assert found.qpos[1] == pytest.approx(0.4 - 2 * found.qpos[0], abs=1e-12)
    assert any("'gears' was open by 0.4" in note for note in found.imported.notes)


def test_a_polynomial_coupling_is_refused_by_name(tmp_path):
    text = GEARS.replace("POLY", "0 -2 0.1 0 0")
    with pytest.raises(SceneError, match=r"equality 'gears' of type joint, whose polynomial is not linear.*"):
        read(tmp_path, text)
    assert not read(tmp_path, text, without=["couplings"]).imported.scene.coupling


def test_armature_and_couplings_of_a_scene_stay(tmp_path):
    found = read(tmp_path, GEARS.replace("POLY", "0 -2 0 0 0"), without=["armature", "couplings"])
    assert found.imported.scene.coupling and found.imported.scene.joint[0].armature
    same(found)


def test_armature_of_a_hinge_is_of_its_joint(tmp_path):
    """(I + armature) θ'' = m g l; the file's matrices have the armature too."""
    rotor = 'armature="0.005"'
    inertial = '<inertial pos="0.05 0 0" mass="0.01" diaginertia="2e-6 2e-6 2e-6"/>'
    body = f'<body name="f">{hinge("j", more=rotor)}{inertial}</body>'
    text = f"<mujoco><worldbody>{body}</worldbody></mujoco>"
    found = read(tmp_path, text)
    same(found)
    turning = np.linalg.norm(gauss(found.imported.scene)[0]) / 0.05
    assert turning == pytest.approx(0.01 * 9.81 * 0.05 / (2e-6 + 0.01 * 0.05**2 + 0.005), rel=1e-12)
    assert found.imported.scene.joint[0].armature == 0.005


def test_velocities_of_a_keyframe_are_the_scene_s(tmp_path):
    text = OPEN_LOOP.replace("EQUALITY", CONNECT).replace('0.1"/></key', '0.1" qvel="1 2 3"/></key')
    found = read(tmp_path, text, keyframe="low")
    crank = found.imported.scene.body[0]
    assert crank.angular_velocity == pytest.approx((0.0, found.qvel[0], 0.0)) and found.qvel[0] != 0


REFUSALS = ("cannot be closed", "in a row have dependent motions", "no body that moves")


def agree_or_refuse(tmp_path, file: random_models.File) -> bool:
    try:
        found = read(
            tmp_path,
            file.text,
            f"random{file.suffix}",
            without=file.options.without,
            close=file.options.close,
        )
    except SceneError as error:
        assert any(says in str(error) for says in REFUSALS), str(error)
        return False
    same(found, file.loops)
    return True


@pytest.mark.parametrize(
    "seeds", [range(30), pytest.param(range(30, 100), marks=pytest.mark.slow)], ids=["few", "many"]
)
@pytest.mark.parametrize("make", [random_models.mjcf, random_models.urdf], ids=["mjcf", "urdf"])
def test_random_files_agree_with_the_compiled_model_or_are_refused(make, seeds, tmp_path):
    agreed = [agree_or_refuse(tmp_path, make(seed)) for seed in seeds]
    assert sum(agreed) >= 0.6 * len(seeds), sum(agreed)
