"""Scenes of robot files, and of random ones, move as MuJoCo's matrices of the file, integrated finely.
The motion of the scene is the judge's, by Gauss's principle. Loops and mimic joints that MuJoCo does not read
from a URDF are added to its model here, by MjSpec."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

import mbref
from crosscheck.engines.mujoco.importing.reading import Source, source
from crosscheck.engines.mujoco.importing.urdf import prepared
from mbref.formats import ImportOptions
from mbref.scene import SceneError
from tests.helpers import random_models
from tests.helpers.originals import apart

ROBOTS = Path(__file__).parent / "models" / "robots"
SAME = 1e-9  # of the largest distance moved; worst measured 6e-11
ENDS = [(f"tip{k}", f"plat{k}") for k in range(3)]  # of the rods of delta.urdf
OPTIONS = {
    "delta.urdf": ImportOptions(close=[f"{tip}={plate}" for tip, plate in ENDS]),
    "digger.urdf": ImportOptions(close=["boom_eye=boom_pin:revolute:y", "bucket_eye=bucket_pin:revolute:y"]),
    "walker.xml": ImportOptions(hold=["trunk"], keyframe="crouched"),
    "hexapod.xml": ImportOptions(without=["damping"]),
    "kangaroo_leg.xml": ImportOptions(without=["damping"]),
}
FREEDOMS = {
    "ankle.xml": 4,  # two of them are turns of rods about their own axes
    "arm.urdf": 6,
    "delta.urdf": 6,
    "delta.xml": 9,  # six are turns of rods
    "digger.urdf": 2,
    "gripper.xml": 3,
    "hand.urdf": 3,
    "hexapod.xml": 6,
    "kangaroo_leg.xml": 3,
    "parallel_gripper.urdf": 1,
    "rod_leg.xml": 4,
    "walker.xml": 8,
}
REFUSALS = (
    "cannot be closed",
    "joints hinge, hinge in a row",
    "no body that moves",
    "the file has no such joint that moves",
    "which is not a single hinge or slide",
)
SLOW = {"delta.urdf", "delta.xml", "gripper.xml", "hexapod.xml", "kangaroo_leg.xml", "walker.xml"}
END, BRIEF = 0.05, 0.02  # s, of the compared motions


def read(name: str) -> Source:
    return source(ROBOTS / name, OPTIONS.get(name, ImportOptions()))


def with_equalities(text: str, loops=(), mimics=()) -> mujoco.MjModel:
    """The model of a URDF with connects between pairs of links at their origins, and coupled joints."""
    made = prepared(text)
    spec = mujoco.MjSpec.from_string(made.text)
    kinds, objects = mujoco.mjtEq, mujoco.mjtObj
    for first, a, second, b in loops:
        names = [f"end {first} {second} {k}" for k in range(2)]
        for link, point, name in zip((first, second), (a, b), names, strict=True):
            spec.body(link).add_site(name=name, pos=point)
        spec.add_equality(type=kinds.mjEQ_CONNECT, objtype=objects.mjOBJ_SITE, name1=names[0], name2=names[1])
    for joint, other, ratio in mimics:
        row = spec.add_equality(type=kinds.mjEQ_JOINT, objtype=objects.mjOBJ_JOINT, name1=joint, name2=other)
        row.data[:5] = 0.0, ratio, 0.0, 0.0, 0.0
    model = spec.compile()
    made.take_back(mujoco, model)
    return model


def original(name: str, found: Source) -> mujoco.MjModel:
    """MuJoCo's model of a robot file, with all of its loops."""
    text, zero = (ROBOTS / name).read_text(), np.zeros(3)
    if name == "digger.urdf":
        pairs = [(f"{part}_eye", zero, f"{part}_pin", zero) for part in ("boom", "bucket")]
        return with_equalities(text, pairs)
    if name == "delta.urdf":
        return with_equalities(text, [(tip, zero, plate, zero) for tip, plate in ENDS])
    if name == "parallel_gripper.urdf":
        return with_equalities(text, mimics=[("fr", "finger", 1.0), ("kn", "finger", -12.5)])
    if name == "hand.urdf":
        pairs = [(f, *pair) for f in ("index", "thumb") for pair in (("b", "a", 0.8), ("c", "b", 0.6))]
        return with_equalities(text, mimics=[(f"{f}_{j}", f"{f}_{o}", ratio) for f, j, o, ratio in pairs])
    return found.original


@pytest.mark.parametrize("name", sorted(FREEDOMS))
def test_robot_file_gives_its_freedoms_and_leaves_out_dampings_only(name):
    """Joints, loops and mimic joints leave the freedoms counted by hand; no other part changes the motion."""
    found = read(name)
    scene, left_out = found.imported.scene, found.imported.left_out
    assert mbref.counts(scene).degrees_of_freedom == FREEDOMS[name]
    changing = [part for part in left_out if "--without" in part]
    assert all(part.startswith("damping of joint") for part in changing), changing


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] * (n in SLOW)) for n in FREEDOMS])
def test_scene_of_a_robot_file_moves_as_mujoco_s_model(name):
    """The judge moves the scene; MuJoCo's terms of the file are integrated finely, with loops added that it
    does not read. Centres of mass differ by less than 1e-9 of the largest way."""
    found = read(name)
    assert apart(original(name, found), found, END) < SAME


def test_error_of_1e_4_in_a_mass_or_armature_shows_in_the_motion():
    """A foot's mass or a motor's armature in MuJoCo's model is multiplied by 1.0001. The motion then differs
    from the scene's by over 1e-7 of the way, 100 times the allowed difference."""
    found = read("ankle.xml")
    model = found.original
    rotor = int(model.joint("left_motor").dofadr[0])
    for change, k in ((model.body_mass, model.body("foot").id), (model.dof_armature, rotor)):
        kept = float(change[k])
        change[k] = kept * 1.0001
        assert apart(model, found, BRIEF) > 100 * SAME
        change[k] = kept


def random_file_moves_alike(make, seed: int, folder: Path) -> bool:
    """Return whether a random file is read; if so, its motion is the original's, with its couplings."""
    file = make(seed)
    path = folder / f"random{file.suffix}"
    path.write_text(file.text)
    try:
        found = source(path, replace(file.options, without=()))
    except SceneError as error:
        assert any(says in str(error) for says in REFUSALS), str(error)
        return False
    model = found.original if file.suffix == ".xml" else with_equalities(file.text, file.loops, file.mimics)
    assert apart(model, found, BRIEF) < SAME, (make.__name__, seed)
    return True


MAKERS = (random_models.mjcf, random_models.urdf)


@pytest.mark.parametrize(
    ("seeds", "least"), [(range(1000, 1003), 1), pytest.param(range(100), 60, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("make", MAKERS, ids=["mjcf", "urdf"])
def test_scenes_of_random_files_move_as_mujoco_s_models(make, seeds, least, tmp_path):
    """At least ``least`` files are read and move as MuJoCo's, to SAME; REFUSALS has the others' reasons."""
    assert sum(random_file_moves_alike(make, seed, tmp_path) for seed in seeds) >= least
