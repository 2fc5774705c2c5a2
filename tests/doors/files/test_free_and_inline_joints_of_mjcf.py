"""MJCF: springs along free joints and couplings of inline joints; damping of free and ball joints."""

import mujoco
import numpy as np
import pytest

from crosscheck.engines.mujoco.files import FORMAT
from crosscheck.engines.mujoco.importing.reading import source
from mbref import Scene, simulate
from mbref.formats import ImportOptions
from tests.helpers.parts import joint

AXIS = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
PLACE = (0.5, 0.2, -0.1)
BODY = {"name": "b", "mass": 2.0, "inertia": [0.3, 0.4, 0.5], "position": PLACE}
ENDS = [("ground", "b"), ("b", "ground")]


def exported(scene: Scene) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(FORMAT.write(scene).text)


@pytest.mark.parametrize("bodies", ENDS)
def test_a_spring_along_a_free_joint_pulls_a_body_along_the_joint_s_axis(bodies):
    """The spring of 3 N/m is 0.2 m shorter than its natural length, at the centre of mass of a body of 2 kg:
    0.3 m/s² along the axis, towards positive displacements of the second body."""
    free = joint("F", "free", *bodies, PLACE, axis=tuple(AXIS))
    spring = {"type": "slide_spring", "joint": "F", "stiffness": 3.0, "natural_displacement": 0.2}
    model = exported(Scene(name="free", body=[BODY], joint=[free], load=[spring]))
    data, rows = mujoco.MjData(model), np.zeros((6, model.nv))
    mujoco.mj_forward(model, data)
    mujoco.mj_jac(model, data, rows[:3], rows[3:], data.xipos[1], 1)
    sign = 1.0 if bodies[1] == "b" else -1.0
    assert np.allclose(rows @ data.qacc, [*(sign * 0.3 * AXIS), 0.0, 0.0, 0.0], rtol=0, atol=1e-14)


@pytest.mark.parametrize("bodies", ENDS)
def test_a_coupling_of_an_inline_joint_moves_its_point_along_its_line(bodies):
    """A hinge turns an arm, whose slider's displacement on its line is 0.3 m/rad of the angle."""
    arm, slider = {**BODY, "name": "arm"}, {**BODY, "position": (0.6, 0.4, 0.0)}
    hinge = joint("A", "revolute", "ground", "arm", (0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    ends = tuple("arm" if name == "ground" else name for name in bodies)
    line = joint("B", "inline", *ends, (0.7, 0.1, 0.0), axis=tuple(AXIS))
    coupling = {"name": "C", "joints": ["A", "B"], "ratio": 0.3}
    model = exported(Scene(name="wire", body=[arm, slider], joint=[hinge, line], coupling=[coupling]))
    follower, leader = model.joint(int(model.eq_obj1id[0])), model.joint(int(model.eq_obj2id[0]))
    assert leader.name == "A" and model.eq_data[0, 1] == 0.3
    assert follower.type[0] == mujoco.mjtJoint.mjJNT_SLIDE
    assert np.allclose(follower.axis, AXIS if ends[1] == "b" else -AXIS, rtol=0, atol=1e-15)


def test_a_slide_behind_a_ball_joint_of_one_body_is_imported_with_its_spring(tmp_path):
    """In the scene a massless link stands between both joints. The import compares velocity terms with
    MuJoCo's bias forces; by ``mj_jacDot``, which is wrong here, it would refuse the scene."""
    text = """<mujoco><worldbody><body name="leg"><joint name="hip" type="ball"/>
    <joint name="shin" type="slide" axis="0 0 1" stiffness="50" springref="0.1"/>
    <inertial mass="2" pos="0.1 0.2 -0.4" diaginertia="0.3 0.4 0.5"/></body></worldbody></mujoco>"""
    (tmp_path / "leg.xml").write_text(text)
    scene = FORMAT.read(tmp_path / "leg.xml", ImportOptions()).scene
    assert [(each.type, each.bodies) for each in scene.joint] == [
        ("spherical", ("ground", "leg link hip")),
        ("translational", ("leg link hip", "leg")),
    ]
    [spring] = scene.load
    assert (spring.joint, spring.stiffness, spring.natural_displacement) == ("shin", 50.0, 0.1)


DAMPED = """<mujoco><option gravity="0 0 0"/><worldbody><body name="base"><joint type="free" damping=".4"/>
<inertial mass="2" pos="CENTRE" diaginertia=".3 .4 .5"/><body name="arm" pos=".3 0 0"><inertial mass="1"
pos=".2 0 .1" diaginertia=".3 .4 .5"/><joint type="ball" damping=".07"/></body></body></worldbody><keyframe>
<key name="k" qpos=".1 .2 .3 .5 .5 -.5 .5 .8 0 .6 0" qvel="1 2 -1 3 -2 1 2 1 -3"/></keyframe></mujoco>"""
BALL = DAMPED.replace("free", "ball").replace(".1 .2 .3 .5", ".5").replace("1 2 -1 3", "3")


@pytest.mark.parametrize("text", [DAMPED, BALL.replace(".4", ".4' armature='.6".replace("'", '"'), 1)])
def test_damped_free_and_ball_joints_accelerate_as_in_mujoco_and_are_written_again(text, tmp_path):
    """A free joint damps its body's rotation and origin. MJCF is written if this is the centre of mass.
    MuJoCo adds the armature of a ball joint, 0.6 kg m², to the diagonal of its mass matrix."""
    path, theirs = tmp_path / "a.xml", np.zeros(6)
    path.write_text(text.replace("CENTRE", ".1 -.2 .3"))
    found = source(path, ImportOptions(keyframe="k"))
    model, data = found.original, mujoco.MjData(found.original)
    data.qpos[:], data.qvel[:] = found.qpos, found.qvel
    mujoco.mj_forward(model, data)
    mujoco.mj_rnePostConstraint(model, data)
    for name in (mine := simulate(found.imported.scene, times=[0.0])):
        mujoco.mj_objectAcceleration(model, data, mujoco.mjtObj.mjOBJ_BODY, model.body(name).id, theirs, 0)
        own = np.hstack([mine[name].angular_acceleration[0], mine[name].acceleration[0]])
        assert np.allclose(own, theirs, rtol=0, atol=1e-10)
    path.write_text(text.replace("CENTRE", "0 0 0"))
    scene = FORMAT.read(path, ImportOptions()).scene
    path.write_text(FORMAT.write(scene).text)
    assert FORMAT.read(path, ImportOptions()).scene.load == scene.load
