"""Offsets of couplings in crosscheck: the start that the judge checks, engines, tables, refusals."""

import numpy as np
import pytest

import mbref
from crosscheck.cli.scene_request import find_scenes, read_scenes
from crosscheck.engine import Setting, engine
from crosscheck.judge.metrics import measure
from crosscheck.judge.start import checked_start, started
from crosscheck.judge.truth import truth_for
from crosscheck.recorded.exact import reference_table
from crosscheck.recorded.judgement import judge_motion
from mbref import formats
from mbref.scene import Scene, SceneError
from tests.helpers.coupled_mechanisms import coupled_loops, gear_pair, rack

TIMES = np.array([0.0, 0.2, 0.4])
FINE = {
    "mbref": Setting("taylor", {"rtol": 1e-12}),
    "mujoco": Setting("tuned", {"step": 2e-4, "beta": 2500.0, "hard": 1.0}),
    "exudyn": Setting("tuned", {"step": 1e-3}),
}
ROUNDED = 1e-13  # m or rad; of angles and lengths up to 20 rad and 1 m


def shifted(make, name: str, offset: float) -> Scene:
    return make().with_(f"coupling[{name}].offset", offset)


@pytest.mark.parametrize("factor", [0.5, -1.0, 1.0 + 1e-9], ids=["half", "opposite", "1e-9 more"])
def test_start_with_another_offset_is_refused(factor):
    """The scene's offset is 0.4 rad; poses assembled for another one violate the judge's equation."""
    scene, other = (shifted(gear_pair, "teeth", share * 0.4) for share in (1.0, factor))
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
    modules = {"simbody": "opensim", "drake": "pydrake", "dart": "dartpy"}
    pytest.importorskip(modules.get(name, name))
    scene, simulator = shifted(coupled_loops, "gears", 0.1).with_(duration=0.2), engine(name)
    given, times = started(scene), np.array([0.0, 0.1, 0.2])
    assert simulator.cannot(given) is None
    run = simulator.run(given, times, FINE.get(name) or simulator.best_settings(given)[-1])
    found = measure(scene, run, truth_for(scene))
    assert found["error"] <= 1e-8, (found, run.message)


def test_engines_refuse_a_scene_that_is_not_assembled():
    """The coupling's offset does not hold in the file's poses; the reason names it and the remedy."""
    refusal = engine("mujoco").cannot(shifted(gear_pair, "teeth", 0.4))
    assert refusal is not None
    assert refusal.reason == (
        "coupling 'teeth' has an offset (mbref.assembled(scene) has none), which the adapter does not map"
    )


def test_coordinates_of_a_reference_table_count_from_the_file_s_poses():
    """The coupling's equation s = 0.003 m + 0.05 m · φ holds for displacement and angle of the table to 1e-13
    m; the angle is also mbref's, to 1e-11 rad."""
    scene = shifted(rack, "teeth", 0.003)
    table = reference_table(scene, TIMES)
    motion = mbref.simulate(scene, times=TIMES, rtol=1e-13)
    assert np.abs(table["B.displacement"] - 0.003 - 0.05 * table["A.angle"]).max() < ROUNDED
    assert np.abs(table["A.angle"] - motion.joint("A").angle).max() < 100 * ROUNDED


def test_recorded_angle_that_counts_from_the_assembled_pose_is_judged_wrong():
    """The reference's table, which counts from the file's pose, is judged right; one whose angle begins at
    zero in the assembled pose is not."""
    scene = shifted(rack, "teeth", 0.003)
    table = reference_table(scene, TIMES)
    recorded = {key: table[key] for key in ("time", "A.angle", "B.displacement", "rack.position.y")}
    assert judge_motion(scene, recorded).is_right
    assert not judge_motion(scene, recorded | {"A.angle": table["A.angle"] - table["A.angle"][0]}).is_right


def test_find_scenes_assembles_offsets_and_read_scenes_does_not(tmp_path):
    """Both read a scene file with an offset of 0.4 rad in its coupling."""
    scene, path = shifted(gear_pair, "teeth", 0.4), str(tmp_path / "gears.toml")
    scene.save(path)
    assert find_scenes([path]) == [mbref.assembled(scene)] and read_scenes([path]) == [scene]


def test_mjcf_keeps_the_offset_of_a_coupling(tmp_path):
    """The rack returns from its MJCF with its motion by mbref, to 1e-12 m; the motion without the offset of 3
    mm is over 2 mm away."""
    pytest.importorskip("mujoco")
    scene, path = shifted(rack, "teeth", 0.003), tmp_path / "rack.xml"
    formats.write(scene, path)
    back = formats.read(path).scene
    one, other = (mbref.simulate(each, times=TIMES, rtol=1e-12) for each in (scene, back))
    assert np.abs(one["rack"].position - other["rack"].position).max() < 10 * ROUNDED
    assert np.abs(one["rack"].position - mbref.simulate(rack(), times=TIMES)["rack"].position).max() > 2e-3
