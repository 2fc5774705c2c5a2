"""MJCF files as scenes of crosscheck: MuJoCo's run of the file's own model, and bodies held by ``--hold``."""

import math
import re

import mujoco
import numpy as np
import pytest

from crosscheck.cli.scene_request import RequestError, find_scenes, held
from crosscheck.engine import Setting, engine
from crosscheck.engines.mujoco.importing.reading import source
from crosscheck.engines.mujoco.original import FAMILIES, FINER, STIFFER, STIFFER_RK4
from crosscheck.judge.constraints import initial_poses, scene_length
from crosscheck.judge.free_fall import falls_freely
from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.setting import AS_IN_FILE
from crosscheck.study.command import command
from crosscheck.study.grades import Judged
from crosscheck.study.grid import Case, run_here
from crosscheck.study.search.offers import of_file, offer
from crosscheck.study.search.selection import of_few_families
from crosscheck.study.words.file import as_in_file, free_falls
from mbref import rotations
from mbref.formats import ImportOptions
from mbref.motions.trajectory import Trajectory
from mbref.scenes import SCENES

# four-bar whose last pin is a soft connect; the keyframe leaves the loop open
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
# box on a free joint with one leg
DOG = """<mujoco><compiler angle="radian"/><worldbody><frame pos="0 0 0.1">
<body name="trunk" pos="0 0 0.5"><freejoint/><geom type="box" size=".2 .1 .05" mass="4"/>
<body name="leg" pos="0.2 0 0"><joint name="hip" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0.05 0 -.2" size=".02" mass="0.5"/></body></body></frame></worldbody>
<keyframe><key name="high" qpos="1 0 2 1 0 0 0 0.3" qvel="0 0 0 0 0 0 2"/></keyframe></mujoco>"""
TILTED = ImportOptions(keyframe="tilted", without=["limits"])
ROUNDING = 1e-12  # m; of positions of 1 m over 100 steps, 2e-16 is measured


def imported(tmp_path, text: str, options: ImportOptions | None = None):
    path = tmp_path / "robot.xml"
    path.write_text(text)
    return find_scenes([str(path)], options or ImportOptions())[0]


def setting_of(scene, family: str) -> Setting:
    return [s for s in of_file("mujoco", scene) if s.family == family][-1]


def stepped_by_mujoco(model, start, times) -> np.ndarray:
    """Return centres of mass (k, nb, 3) by MuJoCo's mj_step, with a shortened last step before samples."""
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


def test_run_as_in_file_equals_steps_of_mujoco_on_its_own_model_of_the_file(tmp_path):
    """`stepped_by_mujoco` calls mj_step itself, from the pose at which the import has closed the loop. The
    setting states step, integrator and solref of FOUR_BAR."""
    scene = imported(tmp_path, FOUR_BAR, TILTED)
    options = setting_of(scene, AS_IN_FILE).options
    assert (options["step"], options["integrator"], options["solref"]) == (0.004, "implicitfast", "0.03 1")
    times = np.array([0.0, 0.04, 0.25, 0.301, 0.4])  # s; 0.25 and 0.301 lie between steps of 0.004
    run = engine("mujoco").run(scene, times, setting_of(scene, AS_IN_FILE))
    start = source(tmp_path / "robot.xml", TILTED).qpos
    stepped = stepped_by_mujoco(mujoco.MjModel.from_xml_string(FOUR_BAR), start, times)
    assert np.abs(run.position - stepped).max() < ROUNDING


def test_velocities_and_accelerations_of_the_files_model_are_differences_of_its_motion(tmp_path):
    """Central differences over 2e-5 s are the truth. 2e-6 and 6.6e-4 of the largest are measured, the latter
    from the fast vibration of the file's closures; 1e-5 and 1e-3 are allowed."""
    scene, h = imported(tmp_path, FOUR_BAR, TILTED), 1e-5
    setting = setting_of(scene, STIFFER_RK4)
    run = engine("mujoco").run(scene, np.array([0.1 - h, 0.1, 0.1 + h]), setting)
    slope = (run.position[2] - run.position[0]) / (2 * h)
    assert np.abs(slope - run.velocity[1]).max() < 1e-5 * np.abs(run.velocity[1]).max()
    change = (run.velocity[2] - run.velocity[0]) / (2 * h)
    assert np.abs(change - run.acceleration[1]).max() < 1e-3 * np.abs(run.acceleration[1]).max()


def test_stiff_closures_and_small_steps_together_reach_the_motion_of_exact_joints(tmp_path):
    """Errors of positions (m) after 0.05 s by Gauss's principle with exact joints: 8e-3 as in the file, 6e-4
    with smaller steps, whose closures are soft, and 4e-10 with stiff closures and RK4 too (measured). Limits
    are wide, over 1e-4 and under 1e-7, as other processors and versions of MuJoCo change these errors."""
    scene, times = imported(tmp_path, FOUR_BAR, TILTED), np.array([0.0, 0.05])
    true = gauss_motion(scene, tuple(times.tolist())).position
    off = {
        family: np.abs(engine("mujoco").run(scene, times, setting_of(scene, family)).position - true).max()
        for family in (AS_IN_FILE, FINER, STIFFER, STIFFER_RK4)
    }
    assert off[STIFFER_RK4] < 1e-7 and off[FINER] > 1e-4, off
    assert off[STIFFER_RK4] < off[STIFFER] < off[FINER] < off[AS_IN_FILE], off


def test_families_of_a_file_are_offered_first_and_for_mujoco_and_scenes_from_files_alone(tmp_path):
    """A family is a named set of settings. FAMILIES, which take the file's options, come before others such
    as `tuned`. Exudyn reads no MJCF, and the built-in four-bar is from no file."""
    scene = imported(tmp_path, FOUR_BAR, TILTED)
    families = list(dict.fromkeys(setting.family for setting in offer("mujoco", scene)))
    assert families[: len(FAMILIES)] == list(FAMILIES) and "tuned" in families[len(FAMILIES) :]
    assert not of_file("exudyn", scene) and not of_file("mujoco", SCENES["four_bar"]())


def test_quick_depth_runs_the_files_own_settings_as_the_only_family_of_the_file(tmp_path):
    """Quick depth has AS_IN_FILE of FAMILIES; smaller steps and stiffer closures are left to depth whole."""
    scene = imported(tmp_path, FOUR_BAR, TILTED).with_(duration=0.3)
    cases = [Case(scene, np.array([0.0, 0.3]), "mujoco", s) for s in offer("mujoco", scene)]
    few = {case.setting.family for case in of_few_families(cases)}
    assert few & set(FAMILIES) == {AS_IN_FILE} and "tuned" in few, few


def test_printed_command_of_a_run_names_the_file_with_its_import_options(tmp_path):
    """The path is the command's argument. The setting's option ``file``, which repeats it, is not printed."""
    scene = imported(tmp_path, FOUR_BAR, TILTED)
    times = np.linspace(0, scene.duration, 3)
    record = run_here(Case(scene, times, "mujoco", setting_of(scene, AS_IN_FILE), 5.0, 0.0))
    said = command(record, "robot.xml --without limits --keyframe tilted")
    read = "crosscheck run robot.xml --without limits --keyframe tilted"
    assert said.startswith(f"{read} --engine mujoco --setting 'as in file'")
    assert "solref=" in said and "file=" not in said


def sentence(scene, tilt: float = 0.0, **changes) -> str:
    """Return the verdict on a made-up run of the file, off by 20 mm and 0.03 rad. Its last body, and so the
    closure, is 1.2 mm aside, and is tilted by an angle (rad) about the world's x axis. ``changes`` are other
    fields of its record."""
    settings = {"step": 0.004, "integrator": "Euler", "solref": "0.03 1", "file": "/my robots/robot.xml"}
    metrics = {"error": 0.2, "position_error": 0.02 / scene_length(scene), "rotation_error": 0.03}
    places, turns = initial_poses(scene)
    places[-1] += [0.0, 0.0012, 0.0]
    turns[-1] = rotations.multiply(rotations.from_vector(np.array([tilt, 0.0, 0.0])), turns[-1])
    still = np.zeros_like(places)[None]
    run = Trajectory(
        scene.name, "mujoco", "3", AS_IN_FILE, settings, np.array([0.0]), tuple(b.name for b in scene.body),
        places[None], turns[None], still, still,
    )  # fmt: skip
    record = run.to_record() | {"scene": scene.name, "family": AS_IN_FILE, "metrics": metrics, "t_end": 1.0}
    return as_in_file([Judged(scene, {}, [record | changes])])


def test_verdict_on_a_files_own_settings_states_errors_and_the_opening_of_closures(tmp_path):
    """The run is off by 20 mm and 0.03 rad, its closure open by 1.2 mm: a tenth, rounded, is 0.1 mm."""
    assert sentence(imported(tmp_path, FOUR_BAR, TILTED)) == (
        "robot at its own settings (time step 0.004 s, Euler, solref 0.03 1) is wrong: bodies are off by "
        "up to 20 mm and 0.03 rad, and its closures open by up to 1.2 mm. `crosscheck tune mujoco "
        "'/my robots/robot.xml' --closure 0.1mm` finds a solref and a time step that are ten times better. "
        "Contacts, limits and dry friction are off, as in the scene."
    )


def test_verdict_on_a_files_own_settings_states_the_tilt_of_an_axis_in_rad_beside_the_gap(tmp_path):
    """The last body is moved by 1.2 mm, and tilted by 0.004 rad about its centre, across the axis of its
    hinge. Its joints, less than 0.2 m from there, open by less than 1.2 mm + 0.004 · 200 mm = 2 mm."""
    said = sentence(imported(tmp_path, FOUR_BAR, TILTED), tilt=0.004)
    gap, angle = re.search(r"its closures open by up to (\S+) mm and (\S+) rad", said).groups()
    assert 1.2 <= float(gap) < 2.0 and angle == "0.004", said


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"metrics": dict.fromkeys(("error", "position_error", "rotation_error"), 1e-9)}, "is right:"),
        ({"outcome": "NOT_FINITE", "t_end": 0.2, "message": "a NaN"}, "is not finite at 0.2 s: a NaN"),
        ({"metrics": {"error": None}}, "has no known error: its closures open by up to 1.2 mm."),
    ],
    ids=["right", "failed", "no truth"],
)
def test_verdict_on_right_failed_and_unjudged_runs_proposes_no_tuning(tmp_path, changes, says):
    """A right record, an early end, and no known error: then the verdict states the closures alone."""
    said = sentence(imported(tmp_path, FOUR_BAR, TILTED), **changes)
    assert says in said and "tune" not in said, said


def test_only_a_run_with_the_files_own_settings_has_a_verdict_on_them(tmp_path):
    """The family "tuned" has settings of crosscheck's own."""
    scene = imported(tmp_path, FOUR_BAR, TILTED)
    assert sentence(scene) and sentence(scene, family="tuned") == ""


def test_a_free_base_is_reported_with_the_option_that_holds_it(tmp_path):
    """Gravity accelerates all parts of the dog on its free joint alike, so that no joint is loaded."""
    free = imported(tmp_path, DOG)
    (said,) = free_falls([Judged(free, {}, [])])
    assert "verifies nothing but gravity: `--hold trunk`" in said


def test_hold_fixes_the_base_at_the_pose_of_the_keyframe(tmp_path):
    """Trunk at (1, 0, 2) m, hip 0.2 m before it with 2 rad/s about y: only the leg is left, where MuJoCo's
    model of the file begins, too."""
    fixed = imported(tmp_path, DOG, ImportOptions(hold=["trunk"], keyframe="high"))
    assert not falls_freely(fixed) and [body.name for body in fixed.body] == ["leg"]
    (joint,) = fixed.joint
    assert joint.anchor == pytest.approx((1.2, 0.0, 2.0))
    assert fixed.body[0].angular_velocity == pytest.approx((0.0, 2.0, 0.0))
    run = engine("mujoco").run(fixed, np.array([0.0, 0.2]), setting_of(fixed, STIFFER_RK4))
    assert run.position[0, 0] == pytest.approx(fixed.body[0].position, abs=ROUNDING)


def test_hold_refuses_a_body_that_hangs_on_another_body(tmp_path):
    """The leg hangs on the trunk, which alone has a joint to the ground."""
    with pytest.raises(RequestError, match="--hold leg: is not a body that a joint connects to the ground"):
        imported(tmp_path, DOG, ImportOptions(hold=["leg"]))


def test_a_body_falls_freely_only_without_joints_and_spin_and_with_gravity():
    """Otherwise a joint holds the body, a spin adds Euler's equations, or nothing makes the body fall."""
    top = SCENES["heavy_top"]()
    still = top.with_(joint=()).with_("body[0].angular_velocity", (0.0, 0.0, 0.0))
    assert falls_freely(still) and not falls_freely(still.with_(joint=top.joint))
    assert not falls_freely(still.with_("body[0].angular_velocity", (1.0, 2.0, 3.0)))
    assert not falls_freely(still.with_(gravity=(0.0, 0.0, 0.0)))


def test_hold_adds_a_fixed_joint_between_a_body_and_the_ground():
    """The other joints of the built-in four-bar stay."""
    scene = SCENES["four_bar_gravity"]()
    name = scene.body[0].name
    *others, joint = held(scene, [name]).joint
    assert joint.type == "fixed" and set(joint.bodies) == {"ground", name} and tuple(others) == scene.joint


def test_reading_a_file_reports_parts_left_out_and_closed_loops(tmp_path):
    """The keyframe has joint A at 0.5 rad, beyond its limit of 0.01 rad, and leaves the loop open at C."""
    said: list[str] = []
    path = tmp_path / "robot.xml"
    path.write_text(FOUR_BAR)
    find_scenes([str(path)], TILTED, said.append)
    assert any("left out: limit of joint 'A', which acts at the start" in sentence for sentence in said)
    assert any("closure 'C' was open by" in sentence for sentence in said)


XACRO = r"no format reads .xacro; known: .*; write a URDF with `xacro FILE"


@pytest.mark.parametrize(("name", "says"), [("none.xml", r"none\.xml"), ("r.urdf.xacro", XACRO)])
def test_a_missing_file_or_one_of_xacro_is_refused_by_its_name_or_with_the_remedy(name, says, tmp_path):
    (tmp_path / "r.urdf.xacro").write_text("<robot name='r'/>")
    with pytest.raises(RequestError, match=says):
        find_scenes([str(tmp_path / name)])
