"""Random mechanisms of the conformance suite: their joints, drivers and motions."""

import pytest

from crosscheck.conformance.mechanisms import random_scenes
from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.judge.metrics import violation_series
from mbref.scene import GROUND


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
