"""Loads along joints and over time / closed forms, both formulations of the reference, MuJoCo, MJCF."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from crosscheck.conformance.mechanisms.features import FACTORS, feature_scenes
from crosscheck.engine import Owner, Setting, engine
from crosscheck.engines.mujoco.files import FORMAT
from crosscheck.engines.shared.spanning_tree import spanning_tree
from crosscheck.judge.arithmetic import EXTENDED, doubles
from crosscheck.judge.energy import energy_drift
from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.reference.tree import tree_motion
from mbref.formats import ImportOptions
from mbref.scene import Factor, Scene, SceneError, TorsionSpring
from mbref.scenes import SCENES
from tests.helpers import loads_over_time as scenes
from tests.helpers.loads_over_time import AXIS

TIMES = np.array([0.0, 0.3, 0.8, 0.9, 1.3, 1.45, 2.0])
FORMULATIONS = {"A": natural_motion, "B": lambda *args: tree_motion(*args, seconds=100.0)}
PROBES = {name: scene for name, scene in feature_scenes().items() if "time" in name or "_" in name}


ROUNDED = 1e-15  # m: positions of up to 1 m, integrated in long double and rounded to double


@pytest.mark.parametrize("name", FORMULATIONS)
def test_reference_formulations_move_joint_loads_as_the_closed_forms(name):
    """A sprung and damped slide, a slide under a force that is switched, and a wheel under a sinusoidal
    torque, whose angle is compared modulo a full turn (rad, up to 4 roundings)."""

    def moved(scene: Scene) -> np.ndarray:
        motion = FORMULATIONS[name](scene, TIMES, EXTENDED)
        assert not motion.reason
        return doubles(motion.position[:, 0])

    start = np.array(scenes.sprung_slide().body[0].position)
    along = (moved(scenes.sprung_slide()) - start) @ AXIS
    assert np.abs(along - scenes.sprung_displacement(TIMES)).max() < ROUNDED
    assert np.abs(moved(scenes.thrown()) @ AXIS - scenes.switched(TIMES)).max() < ROUNDED
    motion = FORMULATIONS[name](scenes.wheel(), TIMES, EXTENDED)
    turned = 2 * np.arctan2(*doubles(motion.orientation)[:, 0, [3, 0]].T)
    apart = turned - scenes.turned(TIMES)
    assert np.abs(apart - 2 * np.pi * np.round(apart / 2 / np.pi)).max() < 4 * ROUNDED


def test_motion_under_constant_joint_loads_keeps_its_energy():
    """Undamped springs, constant forces and constant torques of joints have a potential."""
    scene = scenes.arm()
    still = [
        load.model_copy(update={"damping": 0.0} if load.action.stiffness else {"factor": None})
        for load in scene.load
        if hasattr(load, "joint")
    ]
    scene = scene.with_(load=still)
    motion = gauss_motion(scene, tuple(np.linspace(0.0, 1.0, 41)))
    assert energy_drift(scene, motion).max() < 1e-8
    assert energy_drift(scenes.arm(), motion) is None, "dampers and loads over time have no potential"


@pytest.mark.parametrize("name", ("slide_spring load", "joint_torque load", "joint_force load"))
@pytest.mark.parametrize(("of", "within"), [("mujoco", 1e-12), ("exudyn", 1e-10), ("pinocchio", 1e-10)])
def test_engine_moves_joint_loads_as_the_reference(of, within, name):
    """A spring, torque or force of a joint; ``within`` is the allowed difference (m)."""
    assert gap(of, PROBES[name]) < within


SMOOTH = ("slide_spring load", "joint_torque load", "joint_force load", "polynomial loads over time")


@pytest.mark.parametrize("name", SMOOTH)
@pytest.mark.parametrize("on_terms", ["drake", "dart"])
def test_integrated_accelerations_of_drake_and_dart_move_joint_loads_as_the_reference(on_terms, name):
    """Crosscheck integrates the accelerations of their own mass matrices and forces."""
    pytest.importorskip({"drake": "pydrake", "dart": "dartpy"}[on_terms])
    assert gap(on_terms, PROBES[name].with_(duration=0.2)) < 1e-10


@pytest.mark.parametrize("name", SMOOTH)
@pytest.mark.parametrize(
    ("of", "module", "family", "options"),
    [
        ("drake", "pydrake", "discrete", {}),
        ("dart", "dartpy", "balls", {"erp": 0.5}),
        ("bullet", "pybullet", "iterated", {"iterations": 1000}),
    ],
)
def test_first_order_steps_with_joint_loads_converge_to_the_reference(of, module, family, options, name):
    """A tenth of the step leaves at most a fifth of the error; a lost or reversed load would leave all."""
    pytest.importorskip(module)
    scene, times = PROBES[name].with_(duration=0.2), np.array([0.0, 0.2])
    exact = doubles(natural_motion(scene, times, EXTENDED).position)
    moved = np.abs(exact[1] - exact[0]).max()
    coarse, fine = (
        np.abs(engine(of).run(scene, times, Setting(family, {"step": h, **options})).position - exact).max()
        for h in (1e-3, 1e-4)
    )
    assert fine < 1e-3 * moved and fine < 0.2 * coarse + 1e-9, (coarse, fine, moved)


def test_hinge_with_a_load_keeps_its_coordinate_when_a_loop_is_cut():
    """Bennett's loop is cut at a hinge, which a closure of type "revolute" replaces, without a coordinate.
    With a spring on every hinge the loop is cut in a body ("weld") and each hinge keeps its coordinate."""
    scene = SCENES["bennett"]()
    springs = [TorsionSpring(joint=joint.name, stiffness=1.0) for joint in scene.joint]
    (whole,) = spanning_tree(scene, ("revolute",)).closures
    loaded = spanning_tree(scene.with_(load=springs), ("revolute",))
    assert whole.kind == "revolute" and [closure.kind for closure in loaded.closures] == ["weld"]
    assert len({loaded.coordinate(scene, spring.joint) for spring in springs}) == len(springs)


@pytest.mark.parametrize("kind", FACTORS)
def test_mujoco_moves_loads_over_time_as_the_reference(kind):
    assert gap("mujoco", PROBES[f"{kind} loads over time"].with_(duration=0.12)) < 1e-11


def test_exudyn_moves_polynomial_loads_over_time_as_the_reference():
    assert gap("exudyn", PROBES["polynomial loads over time"].with_(duration=0.1)) < 1e-10


def gap(name: str, scene: Scene) -> float:
    """Return the largest difference of positions by an engine's best setting from the reference (m), or a
    hundredth of that of accelerations, over the largest one and at least 1 m/s², if that is larger."""
    times, simulator = np.linspace(0.0, scene.duration, 4), engine(name)
    run = simulator.run(scene, times, simulator.best_settings(scene)[-1])
    exact = natural_motion(scene, times, EXTENDED)
    assert run.outcome.name == "COMPLETED"
    largest = np.abs(doubles(exact.acceleration)).max()
    off = np.abs(run.acceleration - doubles(exact.acceleration)).max() / max(largest, 1.0)
    return max(np.abs(run.position - doubles(exact.position)).max(), off / 100)


def test_engines_refuse_functions_of_time_that_they_lack():
    """Pinocchio's adapter maps none, Exudyn's polynomials only; MuJoCo's maps all."""
    assert not engine("mujoco").cannot(PROBES["table loads over time"])
    for name, kind in (("pinocchio", "sine"), ("exudyn", "table"), ("exudyn", "switched")):
        refused = engine(name).cannot(PROBES[f"{kind} loads over time"])
        assert refused.owner is Owner.ADAPTER and "load[0]" in refused.reason


MOTORS = """<mujoco><option timestep="0.001" integrator="RK4"/><worldbody>
<body name="arm" pos="0.3 0 0"><inertial mass="1.5" pos="0 0 0" diaginertia="0.02 0.05 0.06"/>
<joint name="turn" type="hinge" axis="0 0 1" pos="-0.3 0 0" damping="0.1"/>
<body name="head" pos="0.4 0.1 0"><inertial mass="0.5" pos="0 0 0" diaginertia="0.01 0.02 0.03"/>
<joint name="slide" type="slide" axis="1 0.5 0" stiffness="40" damping="0.7" springref="0.05"/></body></body>
</worldbody><actuator><motor name="m" joint="turn" gear="20"/>
<general name="p" joint="slide" gainprm="3" gear="-2" ctrllimited="true" ctrlrange="-1 1"/>
SERVO</actuator><keyframe><key name="on" ctrl="0.05 4SERVED"/></keyframe></mujoco>"""


def read(tmp_path: Path, text: str, **options: object):
    (tmp_path / "model.xml").write_text(text)
    return FORMAT.read(tmp_path / "model.xml", ImportOptions(**options))


def test_slide_springs_and_keyframe_motors_are_imported_as_loads(tmp_path):
    """Torque = gear 20 · ctrl 0.05 = 1 N m. Force = gain 3 · gear -2 · ctrl 4, clipped to 1, = -6 N.
    The scene moves as MuJoCo's RK4 moves the model; without the keyframe no motor acts."""
    plain = MOTORS.replace("SERVO", "").replace("SERVED", "")
    scene = read(tmp_path, plain, keyframe="on").scene
    found = {load.type: load for load in scene.load}
    assert found["slide_spring"].natural_displacement == 0.05 and found["slide_spring"].damping == 0.7
    assert found["joint_torque"].torque == pytest.approx(1.0) and found["joint_force"].force == -6.0
    model = mujoco.MjModel.from_xml_string(plain)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_step(model, data, 500)
    mujoco.mj_forward(model, data)
    exact = natural_motion(scene, np.array([0.0, 0.5]), EXTENDED)
    assert np.abs(doubles(exact.position)[-1] - data.xipos[1:]).max() < 1e-9
    assert not {"joint_torque", "joint_force"} & {load.type for load in read(tmp_path, plain).scene.load}


def test_servo_with_a_force_range_is_refused_by_name_or_left_out(tmp_path):
    """With ``--without motors`` the other motors of the file remain loads."""
    servo = '<position name="s" joint="turn" kp="3" forcerange="-1 1"/>'
    text = MOTORS.replace("SERVO", servo).replace("SERVED", " 0.2")
    with pytest.raises(SceneError, match=r"'s', whose range of forces.*--without motors"):
        read(tmp_path, text, keyframe="on")
    left = read(tmp_path, text, keyframe="on", without=("motors",)).scene
    plain = MOTORS.replace("SERVO", "").replace("SERVED", "")
    assert left.load == read(tmp_path, plain, keyframe="on").scene.load


def test_joint_loads_return_from_exported_mjcf_with_their_motion(tmp_path):
    """Motors are written with keyframe "loads"; the notes say this, and that a load over time is left out."""
    plain = MOTORS.replace("SERVO", "").replace("SERVED", "")
    scene = read(tmp_path, plain, keyframe="on").scene
    exported = FORMAT.write(scene)
    assert "its motor is controlled in keyframe 'loads'" in " ".join(exported.left_out)
    again = read(tmp_path, exported.text, keyframe="loads").scene
    kinds = sorted(load.type for load in scene.load)
    assert sorted(load.type for load in again.load) == kinds
    motions = [natural_motion(each, np.array([0.0, 0.5]), EXTENDED) for each in (scene, again)]
    assert np.abs(doubles(motions[0].position - motions[1].position)).max() < 1e-9
    timed = scene.with_("load[2].factor", Factor(start=0.2))
    assert "MJCF has no loads over time" in " ".join(FORMAT.write(timed).left_out)
