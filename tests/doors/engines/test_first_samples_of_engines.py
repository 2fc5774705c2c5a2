"""First samples of engines have the velocities, accelerations and reactions of the judge's equations. At t =
0, Gauss's principle gives the accelerations, and a balance of each body the reactions. The scenes have every
load, drivers, and every joint except inline and free ones; with bodies exchanged, reactions are opposite."""

import functools
from dataclasses import replace

import numpy as np
import pytest

from crosscheck.engine import Engine, Setting, engine, installed
from crosscheck.judge.joint_reactions import compare
from crosscheck.judge.metrics import in_scene_order
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Joint, JointForce, JointTorque, Scene, SlideSpring, Spring, TorsionSpring
from mbref.scenes import SCENES as SHIPPED
from tests.helpers.driven_arm import driven_arm
from tests.helpers.exact_motions import exact_start
from tests.helpers.measured import MARGIN
from tests.helpers.parts import hinge, joint, slide
from tests.helpers.tree_scenes import body, driven, every_joint, ring

# engine: a setting, and the allowed relative difference of its first sample, MARGIN times the largest one
# measured: Exudyn's by its first step, MuJoCo's by its soft rows (hard), others by rounding
WAYS = {
    "mujoco": (
        Setting("forward", {"rtol": 1e-9, "min_step": 1e-4, "beta": 100.0, "hard": 1e-7}),
        MARGIN * 5.2e-10,
    ),
    "simbody": (Setting("merson", {"accuracy": 1e-9}), MARGIN * 1.6e-13),
    "sundials": (Setting("ggl", {"rtol": 1e-8}), MARGIN * 1.6e-13),
    "dart": (Setting("terms", {"rtol": 1e-9, "min_step": 1e-4}), MARGIN * 1.7e-13),
    "exudyn": (Setting("trapezoidal", {"step": 1e-5}), MARGIN * 1.2e-8),
    "ondsel": (Setting("kinematics", {"step": 1e-5}), MARGIN * 1.7e-14),
    "pinocchio": (Setting("tuned", {"rtol": 1e-9, "min_step": 1e-4}), MARGIN * 1.6e-13),
}
TIMES = np.array([0.0, 1e-4])  # s
FIELDS = ["velocity", "angular_velocity", "acceleration", "angular_acceleration"]


def swapped(scene: Scene) -> Scene:
    """Exchange the bodies, anchors and axes of every joint on which no driver or load acts."""
    acting = {d.joint for d in scene.driver} | {getattr(load, "joint", "") for load in scene.load}
    joints = [each if each.name in acting else _exchanged(each) for each in scene.joint]
    return scene.with_(name=f"{scene.name} swapped", joint=tuple(joints))


def _exchanged(given: Joint) -> Joint:
    changes = {"bodies": given.bodies[::-1]}
    for name in ("anchors", "axes"):
        if hasattr(given, name):
            changes[name] = getattr(given, name)[::-1]
    return given.model_copy(update=changes)


SINE = {"amplitude": 2.0, "frequency": 3.0, "phase": 0.4}
ENDS = ((0.3, 1.4, 0.1), (-0.7, 0.3, 0.2))  # m, of the spring between wheel and puck


def loaded() -> Scene:
    """Return a scene with every load of a joint, and two springs along two coordinates each; two have other
    factors."""
    bodies = (
        body("arm", (0.5, 0.1, 0.0), (0.1, 0.2, 0.3), 1.3, angular_velocity=(0.0, 0.0, 2.0)),
        body("sled", (0.0, 1.0, 0.3), (0.4, -0.2, 0.1), 0.8, velocity=(0.3, 0.4, 0.0)),
        body("wheel", (0.2, 1.4, 0.2), (0.2, 0.3, -0.6), 0.5),
        body("puck", (-0.8, 0.2, 0.1), (0.3, 0.1, 0.2), 0.7, velocity=(0.5, -0.2, 0.0)),
    )
    joints = (
        hinge("A", "ground", "arm", (0.0, 0.0, 0.0)),
        slide("C", "sled", "ground", (0.0, 1.0, 0.3), (0.6, 0.8, 0.0)),
        joint("D", "cylindrical", "sled", "wheel", (0.1, 1.2, 0.2), axis=(0.0, 0.6, 0.8)),
        joint("P", "planar", "ground", "puck", (-0.8, 0.2, 0.1), axis=(0.0, 0.0, 1.0)),
    )
    loads = (
        TorsionSpring(joint="A", stiffness=4.0, damping=0.3, natural_angle=0.4),
        JointTorque(joint="D", torque=0.7, factor={"polynomial": (1.5, 2.0)}),
        TorsionSpring(joint="A", stiffness=2.5, damping=0.1, natural_angle=-0.7),
        SlideSpring(joint="D", stiffness=40.0, damping=0.8, natural_displacement=-0.1),
        SlideSpring(joint="D", stiffness=15.0, damping=0.2, natural_displacement=0.3),
        JointForce(joint="C", force=-5.0, factor={"sine": SINE}),
        Spring(bodies=("wheel", "puck"), points=ENDS, stiffness=30.0, damping=0.5, natural_length=1.0),
    )
    return Scene(name="loaded", gravity=(0.5, -9.81, 1.0), body=bodies, joint=joints, load=loads)


def geared() -> Scene:
    """Return a wheel that turns a second one by a ratio of -2.5 and a slide by 0.2 m/rad, with armatures."""
    bodies = (
        body("first", (0.0, 0.0, 0.1), (0.1, 0.5, -0.2), angular_velocity=(0.0, 0.0, 2.0)),
        body("second", (1.0, 0.2, -0.1), (0.3, 0.2, 0.4), 2.0, angular_velocity=(0.0, 0.0, -5.0)),
        body("rack", (0.0, 2.0, 0.3), (0.2, -0.3, 0.1), 1.5, velocity=(0.4, 0.0, 0.0)),
    )
    joints = (
        hinge("A", "ground", "first", (0.02, 0.0, 0.0), armature=0.3),
        hinge("B", "ground", "second", (1.0, 0.0, 0.0)),
        slide("C", "ground", "rack", (0.0, 2.0, 0.0), armature=0.4),
    )
    ratios = {"AB": -2.5, "AC": 0.2}
    gears = [{"name": pair, "joints": tuple(pair), "ratio": ratio} for pair, ratio in ratios.items()]
    load = (JointTorque(joint="B", torque=1.25),)
    parts = {"body": bodies, "joint": joints, "coupling": gears, "load": load}
    return Scene(name="geared", gravity=(0.5, -9.0, 1.0), **parts)


SCENES = {
    scene.name: scene
    for scene in (
        every_joint(),
        swapped(every_joint()),
        driven(),
        driven_arm(),
        driven_arm().with_(name="reversed arm", joint=tuple(map(_exchanged, driven_arm().joint))),
        SHIPPED["spatial_slider_crank_driven"](),
        loaded(),
        geared(),
        *(ring(kind) for kind in ("revolute", "cylindrical", "universal", "spherical")),
        swapped(ring("spherical")),
    )
}


def able(name: str, scene: Scene) -> Engine:
    if not installed(name):
        pytest.skip(f"{name} is not installed")
    if reason := engine(name).cannot(scene):
        pytest.skip(str(reason))
    return engine(name)


@functools.cache
def short_run(way: str, name: str) -> Trajectory:
    """Return the completed run of an engine over TIMES, with bodies in the order of the scene."""
    scene = SCENES[name]
    run = in_scene_order(scene, able(way, scene).run(scene, TIMES, WAYS[way][0]))
    assert run.outcome is Outcome.COMPLETED, run.message
    return run


def largest_difference(run: Trajectory, name: str, fields: list[str]) -> float:
    """Return the largest difference of the first sample from `exact_start`, over the largest value or 1."""
    pairs = [(getattr(run, field)[0], getattr(exact_start(SCENES[name]), field)[0]) for field in fields]
    return float(np.max([abs(found - true).max() / max(1.0, abs(true).max()) for found, true in pairs]))


NO_DRIVEN_FORCES = ("exudyn",)  # gives neither accelerations nor reactions of a driven scene
CASES = [(way, name) for way in WAYS for name in SCENES]
FORCED = [(way, name) for way, name in CASES if way not in NO_DRIVEN_FORCES or not SCENES[name].driver]


@pytest.mark.parametrize(("way", "name"), CASES)
def test_first_sample_has_the_judges_velocities_and_accelerations_of_gauss_s_principle(way, name) -> None:
    """The judge's velocities minimise the kinetic energy where the scene leaves them open. WAYS states the
    allowed difference over the largest velocity or acceleration, or over 1 (m/s, rad/s and per s)."""
    for fields in (FIELDS[:2], FIELDS[2:]) if (way, name) in FORCED else (FIELDS[:2],):
        assert largest_difference(short_run(way, name), name, fields) < WAYS[way][1], fields


@pytest.mark.parametrize(("way", "name"), FORCED)
def test_first_sample_of_an_engine_has_the_reactions_that_balance_every_body(way: str, name: str) -> None:
    """The exact reactions follow from Newton's and Euler's equations of each body. WAYS states the allowed
    difference over the largest reaction; where redundant rows leave reactions open, bodies' resultants."""
    compared = compare(SCENES[name], exact_start(SCENES[name]), first(short_run(way, name)))
    off = [compared.resultant, *(reaction.unique for reaction in compared.joints.values())]
    assert all(each < WAYS[way][1] for each in off), off


def first(run: Trajectory) -> Trajectory:
    """Return the first sample of a run."""
    arrays = ("times", "position", "orientation", "velocity", "angular_velocity", "acceleration")
    parts = {field: getattr(run, field)[:1] for field in (*arrays, "angular_acceleration")}
    return replace(run, **parts, reactions={name: found[:1] for name, found in run.reactions.items()})
