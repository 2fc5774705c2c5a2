"""Couplings, offsets and armatures: engines and mbref move as the judge's reference, or refuse."""

import numpy as np
import pytest

import mbref
from crosscheck.cli.scene_request import find_scenes, read_scenes
from crosscheck.engine import Owner, Setting, engine, installed
from crosscheck.judge.arithmetic import EXTENDED, doubles
from crosscheck.judge.metrics import measure
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.start import checked_start, started
from crosscheck.judge.truth import truth_for
from crosscheck.recorded.exact import reference_table
from crosscheck.recorded.judgement import judge_motion
from mbref import formats
from mbref.scene import SceneError
from tests.helpers.coupled_mechanisms import (
    EVERY,
    coupled_loops,
    gear_pair,
    pendulum,
    planetary,
    rack,
    shifted,
    spatial_chain,
)

ENGINES = 1e-8  # error (relative to the scene's length, or rad) of engines at fine settings
TERMS = Setting("terms", {"rtol": 1e-11, "min_step": 1e-4})
FINE = {
    "drake": TERMS,
    "dart": TERMS,
    "pinocchio": Setting("tuned", {"rtol": 1e-11, "min_step": 1e-4}),
    "simbody": Setting("merson", {"accuracy": 1e-10}),
}
FAMILIES = {"mujoco": "projected", "exudyn": "tuned"}  # whose finest settings are used
LACKS = {"pinocchio": "coupling", "simbody": "armature", "bullet": "armature"}  # missing in the engines


@pytest.mark.parametrize("name", ["sundials", "ondsel", "casadi", "heyoka"])
def test_adapters_without_couplings_and_armatures_refuse_them_by_name(name):
    """The refusals name coupling 'teeth' of two gears, and joint 'A' of a pendulum with a rotor."""
    for scene, part in ((gear_pair(), "coupling 'teeth'"), (pendulum(), "joint 'A' has an armature")):
        refusal = engine(name).cannot(scene)
        assert refusal is not None and refusal.owner is Owner.ADAPTER and part in refusal.reason, refusal


def test_armatures_count_in_the_start_velocities_of_least_kinetic_energy():
    """Velocities that the scene leaves open minimise the energy of bodies and rotors: mbref's are the
    judge's, in long doubles, to rounding (1e-13 m/s). Without rotors they are over 1 cm/s different."""
    scene = spatial_chain()
    joints = [joint.model_copy(update={"armature": 0.0}) for joint in scene.joint]
    scenes = scene, scene.with_(joint=joints)
    motions = (natural_motion(each, np.zeros(1), EXTENDED, seconds=60.0) for each in scenes)
    exact, bare = (doubles(motion.velocity[0]) for motion in motions)
    assert np.abs(mbref.simulate(scene, times=[0.0]).velocity[0] - exact).max() < 1e-13
    assert np.abs(bare - exact).max() > 0.01


def needs_what_is_missing(name, make):
    """Return whether a scene has what an engine lacks by LACKS, couplings or armatures."""
    scene = make()
    parts = {"coupling": bool(scene.coupling), "armature": any(j.reflected_inertia for j in scene.joint)}
    return name in LACKS and parts[LACKS[name]]


OF_ENGINES = [(name, make) for name in (*FINE, *FAMILIES) for make in EVERY]
PAIRS = [pytest.param(name, make, id=f"{name}-{make.__name__}") for name, make in OF_ENGINES]


@pytest.mark.parametrize(("name", "make"), [pair for pair in PAIRS if needs_what_is_missing(*pair.values)])
def test_refusal_of_an_engine_names_the_coupling_or_armature_that_it_lacks(name, make):
    """LACKS names what each engine lacks. The engine, and not its adapter, owns the refusal."""
    refusal = engine(name).cannot(make())
    assert refusal is not None and refusal.owner is Owner.ENGINE and LACKS[name] in refusal.reason


@pytest.mark.parametrize(("name", "make"), [p for p in PAIRS if not needs_what_is_missing(*p.values)])
def test_engines_move_coupled_joints_as_the_reference(name, make):
    """Errors from the judge's truth and violations are below 1e-8 of the length or rad. Reactions differ from
    the truth's by less than 1e-6 of the largest reaction; MuJoCo's by less than 1e-4, since a compliance of
    1e-9 magnifies rounding to forces. Settings are fine: FINE, or a sweep's finest."""
    if not installed(name):
        pytest.skip(f"{name} is not installed")
    scene, simulator = make().with_(duration=0.4), engine(name)
    fine = FINE[name] if name in FINE else simulator.settings_of(scene, FAMILIES[name])[-1]
    run = simulator.run(scene, np.array([0.0, 0.2, 0.4]), fine)
    found = measure(scene, run, truth_for(scene))
    assert found["error"] <= ENGINES and found["violation_position"] <= ENGINES, (found, run.message)
    assert found["reaction_error"] <= (1e-4 if name == "mujoco" else 1e-6), found


def test_drakes_own_stepping_keeps_couplings_and_armatures():
    """Drake's own steps of 1e-4 s are of first order. A lost coupling or armature would give an error above
    0.1; a hundredth of that, 1e-3 of the length or rad, is allowed."""
    pytest.importorskip("pydrake")
    scene = planetary().with_(duration=0.2)
    run = engine("drake").run(scene, np.array([0.0, 0.2]), Setting("discrete", {"step": 1e-4}))
    found = measure(scene, run, truth_for(scene))
    assert found["error"] < 1e-3 and found["violation_position"] < 1e-3, found


@pytest.mark.parametrize("make", [make for make in EVERY if not needs_what_is_missing("bullet", make)])
def test_bullet_moves_coupled_joints_to_first_order(make):
    """Half the step gives half the error against the judge's truth, within 5 %. Joints stay closed to 1e-7 of
    the length by 1000 iterations of Bullet's solver a step."""
    pytest.importorskip("pybullet")
    scene, bullet = make().with_(duration=0.2), engine("bullet")
    errors = []
    for step in (2e-3, 1e-3):
        setting = Setting("iterated", {"step": step, "iterations": 1000})
        found = measure(scene, bullet.run(scene, np.array([0.0, 0.1, 0.2]), setting), truth_for(scene))
        errors.append(found["error"])
        assert found["violation_position"] < 1e-7, found
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.1), errors


TIMES = np.array([0.0, 0.2, 0.4])
BEST = {
    "mbref": Setting("taylor", {"rtol": 1e-12}),
    "mujoco": Setting("tuned", {"step": 2e-4, "beta": 2500.0, "hard": 1.0}),
    "exudyn": Setting("tuned", {"step": 1e-3}),
}
ROUNDED = 1e-13  # m or rad; of angles and lengths up to 20 rad and 1 m


@pytest.mark.parametrize("factor", [0.5, -1.0, 1.0 + 1e-9], ids=["half", "opposite", "1e-9 more"])
def test_start_with_another_offset_is_refused(factor):
    """The offset is 0.4 rad; poses assembled for ``factor`` times 0.4 rad violate the judge's equation."""
    scene, other = (shifted(gear_pair, "teeth", offset) for offset in (0.4, factor * 0.4))
    with pytest.raises(SceneError, match="teeth: the poses at the start violate it by"):
        checked_start(scene, mbref.assembled(other), mbref.angles_at_start(scene))


def test_start_that_opens_a_joint_is_refused():
    """The wheel's centre, and hinge B on it, are at x = 0.4 m and are moved by 0.1 mm."""
    scene = shifted(gear_pair, "teeth", 0.4)
    wrong = mbref.assembled(scene).with_("body[wheel].position[0]", 0.4001)
    with pytest.raises(SceneError, match=r"B: the poses at the start violate it by 0\.0001"):
        checked_start(scene, wrong, mbref.angles_at_start(scene))


@pytest.mark.parametrize("name", ["mujoco", "exudyn", "simbody", "drake", "dart"])
def test_engine_moves_a_coupling_with_offset_as_the_reference(name):
    """The offset is 0.1 rad; engine and judge start from the assembled poses. At the engine's finest setting
    the error from the judge's truth is at most 1e-8 of the length or rad."""
    if not installed(name):
        pytest.skip(f"{name} is not installed")
    scene, simulator = shifted(coupled_loops, "gears", 0.1).with_(duration=0.2), engine(name)
    given, times = started(scene), np.array([0.0, 0.1, 0.2])
    assert simulator.cannot(given) is None
    run = simulator.run(given, times, BEST.get(name) or simulator.best_settings(given)[-1])
    found = measure(scene, run, truth_for(scene))
    assert found["error"] <= 1e-8, (found, run.message)


def test_mujocos_adapter_refuses_a_scene_that_is_not_assembled():
    """Poses of the file violate the coupling's offset. The reason names the coupling, and the remedy."""
    refusal = engine("mujoco").cannot(shifted(gear_pair, "teeth", 0.4))
    said = "coupling 'teeth' has an offset (mbref.assembled(scene) has none), which the adapter does not map"
    assert refusal is not None and refusal.reason == said


def test_coordinates_of_a_reference_table_count_from_the_file_s_poses():
    """In coordinates that are zero in the file's poses, s = 0.003 m + 0.05 m · φ. The judge's table obeys it
    to 1e-13 m; its angle is also mbref's, to 1e-11 rad."""
    scene = shifted(rack, "teeth", 0.003)
    table = reference_table(scene, TIMES)
    motion = mbref.simulate(scene, times=TIMES, rtol=1e-13)
    assert np.abs(table["B.displacement"] - 0.003 - 0.05 * table["A.angle"]).max() < ROUNDED
    assert np.abs(table["A.angle"] - motion.joint("A").angle).max() < 100 * ROUNDED


def test_recorded_angle_that_counts_from_the_assembled_pose_is_judged_wrong():
    """The judge's own table, whose angle counts from the file's pose, is judged right. With an angle that is
    zero in the assembled pose, where the motion begins, it is judged wrong."""
    scene = shifted(rack, "teeth", 0.003)
    table = reference_table(scene, TIMES)
    recorded = {key: table[key] for key in ("time", "A.angle", "B.displacement", "rack.position.y")}
    assert judge_motion(scene, recorded).is_right
    assert not judge_motion(scene, recorded | {"A.angle": table["A.angle"] - table["A.angle"][0]}).is_right


def test_find_scenes_assembles_offsets_and_read_scenes_does_not(tmp_path):
    """Poses of an assembled scene obey the offset of its coupling, 0.4 rad; those in the file do not."""
    scene, path = shifted(gear_pair, "teeth", 0.4), str(tmp_path / "gears.toml")
    scene.save(path)
    assert find_scenes([path]) == [mbref.assembled(scene)] and read_scenes([path]) == [scene]


def test_mjcf_keeps_the_offset_of_a_coupling(tmp_path):
    """A rack whose coupling has an offset of 3 mm is written and read again. Both move alike, to 1e-12 m; a
    rack without the offset is more than 2 mm away."""
    scene, path = shifted(rack, "teeth", 0.003), tmp_path / "rack.xml"
    formats.write(scene, path)
    back = formats.read(path).scene
    one, other = (mbref.simulate(each, times=TIMES, rtol=1e-12) for each in (scene, back))
    assert np.abs(one["rack"].position - other["rack"].position).max() < 10 * ROUNDED
    assert np.abs(one["rack"].position - mbref.simulate(rack(), times=TIMES)["rack"].position).max() > 2e-3
