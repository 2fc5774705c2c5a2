"""Files of other programs as scenes of crosscheck: the file's own model in MuJoCo / its own stepping loop."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

from crosscheck.cli.scene_request import RequestError, find_scenes, held
from crosscheck.engine import Setting, engine
from crosscheck.engines.mujoco.original import FAMILIES, FINER, STIFFER, STIFFER_RK4
from crosscheck.judge.constraints import initial_poses, scene_length
from crosscheck.judge.free_fall import falls_freely
from crosscheck.judge.metrics import violation_series
from crosscheck.setting import AS_IN_FILE
from crosscheck.study.command import command
from crosscheck.study.file_sentences import as_in_file, free_falls
from crosscheck.study.grid import Case, run_here
from crosscheck.study.search.offers import of_file, offer
from crosscheck.study.search.selection import of_few_families
from crosscheck.study.verdict import Judged
from mbref.formats import ImportOptions
from mbref.scene import SceneError
from mbref.scenes import SCENES
from mbref.trajectory import Trajectory

FOUR_BAR = """<mujoco><compiler angle="radian"/><option timestep="0.004" integrator="implicitfast"/>
<worldbody>
<body name="left" pos="0 0 1"><joint name="A" axis="0 1 0" range="-0.01 0.01" limited="true"/>
<inertial pos="0 0 0.1" mass="0.3" diaginertia="1e-3 1e-3 1e-4"/><geom size="0.3" mass="0"/>
<body name="bar" pos="0 0 0.2"><joint name="B" axis="0 1 0"/>
<inertial pos="0.25 0 0.05" mass="0.5" diaginertia="1e-4 1e-2 1e-2"/>
<site name="tip" pos="0.5 0 0.1"/></body></body>
<body name="right" pos="0.5 0 1"><joint name="D" axis="0 1 0" damping="0.01"/>
<inertial pos="0 0 0.15" mass="0.4" diaginertia="5e-3 5e-3 1e-4"/>
<geom size="0.3" mass="0"/><site name="toe" pos="0 0 0.32"/></body></worldbody>
<equality><connect name="C" site1="tip" site2="toe" solref="0.03 1"/></equality>
<actuator><position joint="A" kp="50"/></actuator>
<keyframe><key name="tilted" qpos="0.5 -0.5 0.5"/></keyframe></mujoco>"""
DOG = """<mujoco><compiler angle="radian"/><worldbody><frame pos="0 0 0.1">
<body name="trunk" pos="0 0 0.5"><freejoint/><geom type="box" size=".2 .1 .05" mass="4"/>
<body name="leg" pos="0.2 0 0"><joint name="hip" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0.05 0 -.2" size=".02" mass="0.5"/></body></body></frame></worldbody>
<keyframe><key name="high" qpos="1 0 2 1 0 0 0 0.3" qvel="0 0 0 0 0 0 2"/></keyframe></mujoco>"""
TILTED = ImportOptions(keyframe="tilted", without=["limits"])


def found(tmp_path, text: str, options: ImportOptions | None = None):
    path = tmp_path / "robot.xml"
    path.write_text(text)
    return find_scenes([str(path)], options or ImportOptions())[0]


def setting_of(scene, family: str) -> Setting:
    return [s for s in of_file("mujoco", scene) if s.family == family][-1]


def own_loop(model, start, times) -> np.ndarray:
    """(k, nq) of MuJoCo's steps with the parts off that a scene does not have."""
    for name in ("CONTACT", "LIMIT"):
        model.opt.disableflags |= getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}")
    data = mujoco.MjData(model)
    data.qpos[:], steps, reached = start, 0, []
    for t in times:
        whole = math.floor(t / model.opt.timestep + 1e-9)
        mujoco.mj_step(model, data, nstep=whole - steps) if whole > steps else None
        steps, last = whole, mujoco.MjData(model)
        mujoco.mj_copyData(last, model, data)
        step, rest = model.opt.timestep, t - whole * model.opt.timestep
        if rest > 1e-9:
            model.opt.timestep = rest
            mujoco.mj_step(model, last)
            model.opt.timestep = step
        mujoco.mj_kinematics(model, last)
        reached.append(last.xipos[1:].copy())
    return np.array(reached)


def test_a_file_runs_at_its_own_settings(tmp_path):
    scene = found(tmp_path, FOUR_BAR, TILTED)
    setting, times = setting_of(scene, AS_IN_FILE), np.array([0.0, 0.04, 0.25, 0.301, 0.4])
    assert {k: setting.options[k] for k in ("step", "integrator", "solref")} == {
        "step": 0.004,
        "integrator": "implicitfast",
        "solref": "0.03 1",
    }
    run = engine("mujoco").run(scene, times, setting)
    model = mujoco.MjModel.from_xml_string(FOUR_BAR)
    start = mujoco.MjData(model)
    start.qpos[:] = 0.5, -0.5, 0.5
    mujoco.mj_kinematics(model, start)
    gap = np.abs(start.site("tip").xpos - start.site("toe").xpos).max()
    assert gap > 1e-3, "the keyframe leaves the loop open, so that it is assembled"
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    from crosscheck.engines.mujoco.importing.reading import source

    read = source(tmp_path / "robot.xml", TILTED)
    assert np.abs(run.position - own_loop(model, read.qpos, times)).max() < 1e-12
    assert np.abs(run.position[0] - [b.position for b in scene.body]).max() < 1e-12
    assert violation_series(scene, run).max() * scene_length(scene) > 1e-5, "soft closures open"


def test_rates_of_the_original_are_derivatives(tmp_path):
    """Velocities and accelerations at a sample / differences over the sample."""
    scene, h = found(tmp_path, FOUR_BAR, TILTED), 1e-5
    setting = setting_of(scene, STIFFER_RK4)
    run = engine("mujoco").run(scene, np.array([0.1 - h, 0.1, 0.1 + h]), setting)
    slope = (run.position[2] - run.position[0]) / (2 * h)
    assert np.abs(slope - run.velocity[1]).max() < 1e-5 * np.abs(run.velocity[1]).max()
    change = (run.velocity[2] - run.velocity[0]) / (2 * h)
    assert np.abs(change - run.acceleration[1]).max() < 1e-3 * np.abs(run.acceleration[1]).max()


def test_smaller_steps_and_stiffer_closures_reach_the_scene_s_motion(tmp_path):
    """The finest stiff run of the original is the tuned run of the scene; the softness stays at any step."""
    scene = found(tmp_path, FOUR_BAR, TILTED).with_(duration=0.4)
    times, simulator = np.linspace(0, 0.4, 5), engine("mujoco")
    true = simulator.run(scene, times, Setting("tuned", {"step": 2e-4, "beta": 150.0, "hard": 1e-7}))
    off = {
        family: np.abs(simulator.run(scene, times, setting_of(scene, family)).position - true.position).max()
        for family in (AS_IN_FILE, FINER, STIFFER, STIFFER_RK4)
    }
    assert off[STIFFER_RK4] < 1e-7 < off[STIFFER] < 2e-4 < off[FINER], off
    assert 1e-3 < off[AS_IN_FILE] < 0.1, off


def test_settings_of_the_file_come_first_and_only_its_own_at_quick_depth(tmp_path):
    scene = found(tmp_path, FOUR_BAR, TILTED).with_(duration=0.3)
    families = list(dict.fromkeys(s.family for s in offer("mujoco", scene)))
    assert families[: len(FAMILIES)] == list(FAMILIES) and "tuned" in families
    cases = [Case(scene, np.array([0.0, 0.3]), "mujoco", s) for s in offer("mujoco", scene)]
    few = {case.setting.family for case in of_few_families(cases)}
    assert few == {AS_IN_FILE, "defaults", "tuned", "forward, compiled"}
    assert not of_file("exudyn", scene) and not of_file("mujoco", SCENES["four_bar"]())


def test_the_command_of_a_run_reads_the_file_again(tmp_path):
    scene = found(tmp_path, FOUR_BAR, TILTED)
    times = np.linspace(0, scene.duration, 3)
    record = run_here(Case(scene, times, "mujoco", setting_of(scene, AS_IN_FILE), 5.0, 0.0))
    said = command(record, "robot.xml --without limits --keyframe tilted")
    assert said.startswith(
        "crosscheck run robot.xml --without limits --keyframe tilted --engine mujoco --setting 'as in file'"
    )
    assert "solref=" in said and "file=" not in said


def test_a_verdict_says_how_wrong_the_file_is(tmp_path):
    scene = found(tmp_path, FOUR_BAR, TILTED)
    settings = {"step": 0.004, "integrator": "Euler", "solref": "0.03 1", "file": "/robots/robot.xml"}
    metrics = {
        "error": 0.2,
        "position_error": 0.02 / scene_length(scene),
        "rotation_error": 0.03,
    }
    places, turns = initial_poses(scene)
    places[-1] += [0.0, 0.0012, 0.0]
    still = np.zeros_like(places)[None]
    run = Trajectory(
        scene.name, "mujoco", "3", AS_IN_FILE, settings, np.array([0.0]), tuple(b.name for b in scene.body),
        places[None], turns[None], still, still,
    )  # fmt: skip
    record = {
        **run.to_record(),
        "scene": scene.name,
        "engine": "mujoco",
        "family": AS_IN_FILE,
        "outcome": "COMPLETED",
        "settings": settings,
        "metrics": metrics,
        "t_end": 1.0,
        "message": "",
    }
    said = as_in_file([Judged(scene, {}, [record])])
    assert said == (
        "robot at its own settings (time step 0.004 s, Euler, solref 0.03 1) is wrong: bodies are off by "
        "up to 20 mm and 0.03 rad, and its closures open by up to 1.2 mm. `crosscheck tune mujoco "
        f"{settings['file']} --closure 0.1mm` finds a solref and a time step that are ten times better. "
        "Contacts, limits and dry friction are off, as in the scene."
    )
    right = as_in_file([Judged(scene, {}, [{**record, "metrics": {**metrics, "error": 1e-9}}])])
    assert "is right:" in right and "tune" not in right
    failed = {**record, "outcome": "NOT_FINITE", "t_end": 0.2, "message": "the state became NaN"}
    assert "is not finite at 0.2 s: the state became NaN" in as_in_file([Judged(scene, {}, [failed])])
    unknown = {**record, "metrics": {"error": None}}
    assert "has no known error: its closures open by up to 1.2 mm." in as_in_file(
        [Judged(scene, {}, [unknown])]
    )
    assert as_in_file([Judged(scene, {}, [{**record, "family": "tuned"}])]) == ""


def test_a_free_base_verifies_nothing_and_is_held_on_request(tmp_path):
    free = found(tmp_path, DOG)
    assert falls_freely(free)
    (said,) = free_falls([Judged(free, {}, [])])
    assert "verifies nothing but gravity: `--hold trunk`" in said
    fixed = found(tmp_path, DOG, ImportOptions(hold=["trunk"], keyframe="high"))
    assert not falls_freely(fixed) and [body.name for body in fixed.body] == ["leg"]
    (joint,) = fixed.joint
    assert joint.anchor == pytest.approx((1.2, 0.0, 2.0)), "at the keyframe's pose"
    run = engine("mujoco").run(fixed, np.array([0.0, 0.2]), setting_of(fixed, STIFFER_RK4))
    assert run.position[0, 0] == pytest.approx(fixed.body[0].position, abs=1e-14)
    assert fixed.body[0].angular_velocity == pytest.approx((0.0, 2.0, 0.0))
    assert "verifies" not in " ".join(free_falls([Judged(fixed, {}, [])]))
    with pytest.raises(RequestError, match="--hold leg: is not a body that a joint connects to the ground"):
        found(tmp_path, DOG, ImportOptions(hold=["leg"]))


@pytest.mark.parametrize(("name", "falls"), [("heavy_top", False), ("point_pendulum", False)])
def test_motions_with_a_joint_to_the_ground_are_no_free_fall(name, falls):
    assert falls_freely(SCENES[name]()) is falls


def test_a_turning_free_body_is_no_mere_fall():
    scene = SCENES["heavy_top"]().with_(joint=(), load=())
    assert not falls_freely(scene) if any(scene.body[0].angular_velocity or ()) else falls_freely(scene)
    spinning = scene.with_("body[0].angular_velocity", (1.0, 2.0, 3.0))
    assert not falls_freely(spinning) and not falls_freely(spinning.with_(gravity=(0.0, 0.0, 0.0)))


def test_a_body_of_a_scene_is_held_by_a_fixed_joint():
    scene = SCENES["four_bar_gravity"]()
    fixed = held(scene, [scene.body[0].name])
    assert fixed.joint[-1].type == "fixed" and fixed.joint[:-1] == scene.joint
    with pytest.raises(SceneError, match="--hold wheel: no such body; known: "):
        held(scene, ["wheel"])


def test_parts_that_a_scene_lacks_are_reported_and_faults_name_the_file(tmp_path):
    said: list[str] = []
    path = tmp_path / "robot.xml"
    path.write_text(FOUR_BAR)
    find_scenes([str(path)], TILTED, said.append)
    assert any("left out: limit of joint 'A', which acts at the start" in sentence for sentence in said)
    assert any("closure 'C' was open by" in sentence for sentence in said)
    path.write_text(FOUR_BAR.replace('damping="0.01"', 'frictionloss="0.1"'))
    with pytest.raises(RequestError, match="dry friction of 'D': it changes the motion; --without friction"):
        find_scenes([str(path)])
    with pytest.raises(RequestError, match=r"none\.xml"):
        find_scenes([str(tmp_path / "none.xml")])


def test_a_file_that_needs_xacro_is_refused_with_the_command(tmp_path):
    (tmp_path / "robot.urdf.xacro").write_text("<robot name='r'/>")
    with pytest.raises(
        RequestError, match=r"no format reads .xacro; known: .*; write a URDF with `xacro FILE"
    ):
        find_scenes([str(tmp_path / "robot.urdf.xacro")])
