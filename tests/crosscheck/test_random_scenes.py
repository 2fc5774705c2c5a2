"""Random mechanisms of the conformance suite: their joints, drivers and motions."""

import numpy as np
import pytest

from crosscheck.conformance.mechanisms import random_scenes
from crosscheck.judge.constraints import closure, closure_rates, initial_poses, initial_twists
from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.judge.metrics import violation_series
from mbref.scene import GROUND


def test_random_mechanisms_meet_their_joints_and_drivers_with_the_given_velocities():
    """Residuals of the judge's joint equations (m, rad) and of their rates are rounding, below 1e-12, and so
    is the change of the given velocities (m/s), which are not all zero."""
    for scene in [*map(random_scenes.mechanism, range(24)), *map(random_scenes.floating, range(6))]:
        pose, rates = initial_poses(scene), initial_twists(scene)
        rows = [*closure(scene, 0.0, *pose).values(), *closure_rates(scene, 0.0, *pose, *rates).values()]
        given = np.array([body.velocity for body in scene.body])
        assert max(np.abs(row).max() for row in (*rows, rates[0] - given)) < 1e-12, scene.name
        assert np.abs(given).max() > 0.01, f"{scene.name} rests"


def test_random_mechanisms_have_springs_of_both_kinds_and_odd_seeds_drivers_of_both_kinds():
    """Springs of points and of joints; drivers of angles and displacements, none for even seeds."""
    scenes = list(map(random_scenes.mechanism, range(24)))
    assert {load.type for scene in scenes for load in scene.load} >= {"torsion_spring", "spring"}
    driven = {s.joint_named(driver.joint).facts.driven for s in scenes[1::2] for driver in s.driver}
    assert driven == {"angle", "displacement"}
    assert not any(scene.driver for scene in scenes[::2])


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
    would drift. Over 0.1 s the violation of all joints stays below 1e-9 of the length."""
    scene = random_scenes.random_mechanism(seed).with_(duration=0.1)
    motion = gauss_motion(scene, (0.0, 0.05, 0.1))
    assert violation_series(scene, motion).max() < 1e-9
