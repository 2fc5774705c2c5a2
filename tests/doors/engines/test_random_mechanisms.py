"""Random loop mechanisms: initial accelerations of mbref, of engines and by Gauss's principle agree."""

import functools
from collections import Counter
from collections.abc import Sequence

import pytest

from crosscheck.conformance.initial_accelerations import PRINCIPLE, Comparison, compare
from crosscheck.conformance.mechanisms import random_scenes
from crosscheck.conformance.mechanisms.random_mechanisms import KINDS, random_mechanism
from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.judge.metrics import violation_series
from mbref.scene import GROUND
from mbref.scene.loads import LOAD_TYPES
from tests.helpers.measured import MARGIN

ENGINES = ("mujoco", "pinocchio", "exudyn")
# largest error of accelerations on 124 mechanisms, times their distance to a singular position
MEASURED = {"mujoco": 4.8e-10, "pinocchio": 1.7e-13, "exudyn": 2.1e-8, PRINCIPLE: 9.3e-14}
SOME = (1, 3, 9, 10, 15, 16)  # all of KINDS, one to three loops; the last is near a singular position


@functools.cache
def compared(seed: int) -> Comparison:
    return compare(random_mechanism(seed), ENGINES)


def excess(seeds: Sequence[int]) -> float:
    """Return the largest error of accelerations over MARGIN times the measured one of its engine; an error
    grows as the distance from a singular position falls."""
    pairs = [(found, name) for found in map(compared, seeds) for name in found.errors]
    return max(found.errors[name] / (MARGIN * MEASURED[name] / found.distance) for found, name in pairs)


@pytest.mark.parametrize("seeds", [SOME, pytest.param(range(200), marks=pytest.mark.slow)], ids=["6", "200"])
def test_engines_accelerate_random_mechanisms_as_mbref(seeds):
    """Initial accelerations by three engines and Gauss's principle; joints of KINDS, one to three loops.
    ``excess`` is the largest difference from mbref over ten times the measured one of the engine, which grows
    near singular positions as the reciprocal of their distance."""
    assert excess(seeds) <= 1


def test_random_mechanisms_have_eight_joint_types_and_up_to_three_loops():
    """40 seeds have 3 to 8 bodies and all KINDS of joints; each joint beyond a tree's ones closes a loop."""
    scenes = [random_mechanism(seed) for seed in range(40)]
    kinds = Counter(joint.type for scene in scenes for joint in scene.joint)
    assert set(kinds) == set(KINDS), f"no {set(KINDS) - set(kinds)}"
    sizes = {len(scene.body) for scene in scenes}
    loops = {len(scene.joint) - len(scene.body) for scene in scenes}
    assert sizes == set(range(3, 9)) and loops == {1, 2, 3}, (sizes, loops)


LOADED = range(4, 40, 5)  # seeds of mechanisms with loads of joints and over time


def test_random_scenes_have_every_load_type_and_functions_of_time():
    """Seeds 4, 9, 14, … have loads of joints, in each two on one joint, and loads times a polynomial and
    sine; seeds 0 to 3 have none over time. Dampers between bodies are added to any of them."""
    scenes = [random_scenes.mechanism(seed) for seed in LOADED]
    loads = [load for scene in scenes for load in random_scenes.with_dampers(scene, 1).load]
    assert {load.type for load in loads} == set(LOAD_TYPES)
    timed = {load.type for load in loads if load.over_time}
    assert timed == {"force", "moment", "joint_torque", "joint_force"}
    joints = [[load.joint for load in scene.load if load.acts_on == "joint"] for scene in scenes]
    assert all(len(names) > len(set(names)) for names in joints), "no joint has two loads"
    assert all(load.factor.polynomial and load.factor.sine for load in loads if load.over_time)
    assert not any(load.over_time for seed in range(4) for load in random_scenes.mechanism(seed).load)


def test_floating_mechanisms_have_no_joint_to_the_ground():
    """Mechanisms of five seeds have joints to the ground; the floating ones have as many, none to it."""
    for seed in range(5):
        grounded, floating = random_scenes.random_mechanism(seed), random_scenes.floating(seed)
        assert any(GROUND in joint.bodies for joint in grounded.joint)
        assert len(floating.joint) == len(grounded.joint)
        assert not any(GROUND in joint.bodies for joint in floating.joint)


@pytest.mark.parametrize("seed", [1001, 1005])
def test_gausss_principle_keeps_redundant_joints_of_random_mechanisms_closed(seed):
    """Gauss's principle leaves redundant rows out, by a choice at the start; without a correction these rows
    would drift. Over 0.1 s the violation of all joints, measured up to 3e-12 of the length, is below 1e-9."""
    scene = random_scenes.random_mechanism(seed).with_(duration=0.1)
    motion = gauss_motion(scene, (0.0, 0.05, 0.1))
    assert violation_series(scene, motion).max() < 1e-9
