"""Actuators of an MJCF file: joints of the imported scene accelerate as in MuJoCo (qacc)."""

import mujoco
import numpy as np
import pytest

import mbref

ROUNDED = 1e-9  # relative to the largest acceleration; stiffnesses of 1e3 magnify rounding of angles


def pendulum(k: int) -> str:
    """A pendulum about y with the joint ``j<k>``; every third one is a slide along x."""
    kind = "slide" if k % 3 == 2 else "hinge"
    axis = "1 0 0" if kind == "slide" else "0 1 0"
    joint = f"<joint name='j{k}' type='{kind}' axis='{axis}' ref='{0.1 * k}'/>"
    inertial = "<inertial pos='0.1 0 -0.3' mass='0.7' diaginertia='.01 .02 .015'/>"
    return f"<body name='b{k}' pos='{k} 0 0'>{joint}{inertial}</body>"


def model_of(actuators: list[str], key: str = "", more: str = "") -> str:
    """One pendulum for each actuator, whose joint is written as JOINT."""
    bodies = "".join(pendulum(k) for k in range(len(actuators)))
    texts = "".join(text.replace("JOINT", f"j{k}") for k, text in enumerate(actuators))
    keyframe = f"<keyframe><key name='other'/><key {key}/></keyframe>" if key else ""
    world = f"<compiler angle='radian'/><worldbody>{bodies}</worldbody>"
    return f"<mujoco>{world}{more}<actuator>{texts}</actuator>{keyframe}</mujoco>"


def accelerations(text: str, key: int) -> np.ndarray:
    """MuJoCo's accelerations of the joints at a keyframe, or at the reference (-1)."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    if key >= 0:
        mujoco.mj_resetDataKeyframe(model, data, key)
    mujoco.mj_forward(model, data)
    return data.qacc.copy()


def of_scene(scene: mbref.Scene) -> np.ndarray:
    """mbref's accelerations of the joints at the start of the scene."""
    motion = mbref.simulate(scene, times=[0.0, 1e-3])
    found = []
    for joint in scene.joint:
        body = motion[joint.bodies[1]]
        rates = body.acceleration if joint.type == "translational" else body.angular_acceleration
        found.append(rates[0] @ np.array(joint.axis))
    return np.array(found)


SERVOS = [
    "<position joint='JOINT' kp='50' kv='3'/>",
    "<position joint='JOINT' kp='20' dampratio='0.5' gear='-2'/>",
    "<velocity joint='JOINT' kv='4'/>",
    "<motor joint='JOINT' gear='3'/>",
    "<general joint='JOINT' gainprm='7' biastype='affine' biasprm='0.3 -11 -0.2'/>",
    "<damper joint='JOINT' kv='2' ctrlrange='0 1'/>",
    "<intvelocity joint='JOINT' kp='6' actrange='-3 3'/>",
    "<general joint='JOINT' dyntype='integrator' gainprm='5'/>",
    "<position joint='JOINT' kp='9' ctrllimited='true' ctrlrange='-0.1 0.1'/>",
]
CONTROLS = [0.4, -0.7, 0.5, 1.2, -0.3, 0.8, 0.0, 0.0, 0.9]


def test_servos_of_a_keyframe_accelerate_their_joints_as_in_mujoco(files):
    """MuJoCo's qacc at a keyframe with random angles and speeds is the truth. The keyframe is chosen by its
    name, or by its number if it has none; ``act`` has the states of the two integrating actuators."""
    random = np.random.default_rng(3)
    for name in ("pose", ""):
        qpos = " ".join(map(str, random.uniform(-4, 4, len(SERVOS))))
        qvel = " ".join(map(str, random.uniform(-2, 2, len(SERVOS))))
        ctrl = " ".join(map(str, CONTROLS))
        text = model_of(SERVOS, f"name='{name}' qpos='{qpos}' qvel='{qvel}' ctrl='{ctrl}' act='0.6 0.7'")
        scene, out = files.scene(text, "servos.xml", "--keyframe", name or "1")
        theirs = accelerations(text, 1)
        assert "actuator" not in out, "every actuator is in the scene"
        assert of_scene(scene) == pytest.approx(theirs, abs=ROUNDED * np.abs(theirs).max())


def test_servos_without_a_keyframe_accelerate_their_joints_as_in_mujoco(files):
    """Without controls position servos hold 0; the import leaves out motor, damper and integrator, which give
    no force. MuJoCo's qacc at the reference pose is the truth."""
    text = model_of(SERVOS)  # one motor, damper and integrator, and six servos
    scene, out = files.scene(text, "servos.xml")
    theirs = accelerations(text, -1)
    assert "left out: 3 actuators without a control value: no force" in out
    assert of_scene(scene) == pytest.approx(theirs, abs=ROUNDED * np.abs(theirs).max())


def test_wheel_on_a_spring_and_a_servo_swings_about_their_common_natural_angle(files):
    """q = q∞ + (q₀ - q∞) cos ωt with q∞ = (k qₛ + kₚ u) / (k + kₚ) and ω² = (k + kₚ) / I: spring k = 2 at qₛ
    = 1, servo kₚ = 6 at u = -3, q₀ = 9 rad. Errors are below 1e-8 of q₀, ten tolerances of a run."""
    text = """<mujoco><compiler angle='radian'/><option gravity='0 0 0'/><worldbody><body name='a'>
    <joint name='j' axis='0 0 1' stiffness='2' springref='1'/>
    <inertial pos='0 0 0' mass='1' diaginertia='1 1 .5'/>
    </body></worldbody><actuator><position joint='j' kp='6'/></actuator>
    <keyframe><key qpos='9' ctrl='-3'/></keyframe></mujoco>"""
    scene, _ = files.scene(text, "spun.xml", "--keyframe", "0")
    times = np.linspace(0.0, 2.0, 81)
    start, middle, rate = 9, (2 * 1 + 6 * -3) / (2 + 6), np.sqrt((2 + 6) / 0.5)
    turned = mbref.simulate(scene, times=times).joint("j").angle  # from the angle of the keyframe
    assert turned == pytest.approx((start - middle) * (np.cos(rate * times) - 1), abs=1e-8 * start)


@pytest.mark.parametrize(
    ("actuator", "key", "says"),
    [
        ("position joint='JOINT' kp='5' forcerange='-1 1'", "", "actuator 0, whose range of forces"),
        ("muscle name='m' joint='JOINT' lengthrange='0 1'", "ctrl='1'", "'m', whose force is not linear"),
        ("dcmotor name='s' joint='JOINT' motorconst='1' resistance='2'", "", "'s', whose force is not"),
        ("position name='s' joint='JOINT' kp='5' timeconst='.1'", "ctrl='1'", "'s', whose input changes"),
        ("position name='s' joint='JOINT' kp='-5'", "", "'s', whose stiffness or damping is negative"),
        ("motor name='s' site='there' gear='0 0 1 0 0 0'", "ctrl='1'", "'s', which acts on no single hinge"),
    ],
)
def test_an_actuator_that_a_scene_cannot_have_is_refused_or_left_out_on_request(files, actuator, key, says):
    """The request is --without motors, which the refusal names; the scene then has no load."""
    text = model_of([f"<{actuator}/>"], f"name='k' {key}" if key else "")
    text = text.replace("</worldbody>", "<site name='there'/></worldbody>")
    words = ("--keyframe", "k") if key else ()
    said = files.refusal(text, "a.xml", *words)
    assert says in said and "--without motors" in said
    scene, out = files.scene(text, "a.xml", *words, "--without", "motors")
    assert not scene.load and "(--without motors)" in out


def test_controls_and_forces_of_motors_are_clipped_as_in_mujoco(files):
    """The control of each motor is 3. The first one has a range of controls, the second a range of its force,
    and the joint of the third a range of forces. MuJoCo's qacc is the truth."""
    parts = [
        "<motor joint='JOINT' ctrlrange='-1 1' ctrllimited='true' gear='2'/>",
        "<motor joint='JOINT' forcerange='-0.5 0.5' gear='2'/>",
        "<motor joint='JOINT' gear='2'/>",
    ]
    text = model_of(parts, "name='k' ctrl='3 3 3'")
    text = text.replace("<joint name='j2'", "<joint name='j2' actuatorfrcrange='-1.5 1.5'")
    scene, _ = files.scene(text, "a.xml", "--keyframe", "k")
    theirs = accelerations(text, 1)
    assert of_scene(scene) == pytest.approx(theirs, abs=ROUNDED * np.abs(theirs).max())


def test_keyframes_are_found_by_name_and_by_number_and_an_unknown_one_is_refused_with_both(files):
    """The file has the keyframe "other" at zero, and one at 0.5 rad whose only name is its number, 1. A turn
    of 0.5 rad about y is the quaternion (cos 0.25, 0, sin 0.25, 0). The name "0" comes before the number."""
    text = model_of(["<motor joint='JOINT'/>"], "qpos='0.5'")
    by_number = files.scene(text, "a.xml", "--keyframe", "1")[0]
    assert by_number.body[0].orientation[2] == pytest.approx(np.sin(0.25), rel=1e-12)
    assert files.scene(text, "a.xml", "--keyframe", "other")[0].body[0].orientation[2] == 0.0
    assert "known: other, 1" in files.refusal(text, "a.xml", "--keyframe", "2")
    named = model_of(["<motor joint='JOINT'/>"], "name='0' qpos='0.5'")
    assert files.scene(named, "a.xml", "--keyframe", "0")[0].body == by_number.body


def test_an_actuator_whose_range_of_controls_excludes_0_acts_without_a_keyframe(files):
    """MuJoCo clips the control 0 into the range 2 … 3; the joint's own range of forces then clips 2 N m."""
    acting = "<motor joint='JOINT' ctrlrange='2 3'/>", "<position joint='JOINT' ctrlrange='1 2' kp='9'/>"
    text = model_of([*acting])
    text = text.replace("name='j0'", "name='j0' actuatorfrcrange='-1.5 1.5'")
    scene, _ = files.scene(text, "clipped.xml")
    theirs = accelerations(text, -1)
    assert of_scene(scene) == pytest.approx(theirs, abs=ROUNDED * np.abs(theirs).max())
