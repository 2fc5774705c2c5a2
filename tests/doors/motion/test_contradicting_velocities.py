"""Velocities given to bodies that a joint forbids are refused; the error names the joint and the amount."""

from __future__ import annotations

import pytest

import mbref
from mbref.scene import SceneError
from tests.helpers.short_motions import MOTIONS


@pytest.mark.parametrize("method", ["taylor", "lm2+projection"])
@pytest.mark.parametrize("joint", ["A", "B"])
def test_error_names_the_joint_that_given_velocities_violate_and_by_how_much(joint, method):
    """Both hinges keep their anchors. A further 0.5 m/s of the load violates hinge B, to the arm; 0.5 m/s of
    the arm violates A, to the ground, where the load has no given velocity."""
    scene = MOTIONS["arm with revolute"]()
    arm, load = scene.body
    fast_load = load.model_copy(update={"velocity": (load.velocity[0] + 0.5, *load.velocity[1:])})
    fast_arm = arm.model_copy(update={"velocity": (arm.velocity[0] + 0.5, *arm.velocity[1:])})
    free_load = load.model_copy(update={"velocity": None, "angular_velocity": None})
    wrong = scene.with_(body=(fast_arm, free_load) if joint == "A" else (arm, fast_load))
    with pytest.raises(
        SceneError, match=rf"joint\[{joint}\]: velocities given to bodies violate it by 0\.5 m/s"
    ):
        mbref.simulate(wrong, method, times=[0.1])
