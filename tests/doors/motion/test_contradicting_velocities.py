"""Velocities given to bodies that a joint forbids are refused; the error names the joint and the amount."""

from __future__ import annotations

import pytest

import mbref
from mbref.scene import SceneError
from tests.helpers.short_motions import MOTIONS


@pytest.mark.parametrize("method", ["taylor", "lm2+projection"])
@pytest.mark.parametrize("joint", ["A", "B"])
def test_error_names_the_joint_that_given_velocities_violate_and_by_how_much(joint, method):
    """A hinge keeps its anchor: a further 0.5 m/s of one body violate the first hinge, or the second. Without
    the velocity of the arm the joints determine it."""
    scene = MOTIONS["arm with revolute"]()
    arm, load = scene.body
    faster = load.model_copy(update={"velocity": (load.velocity[0] + 0.5, *load.velocity[1:])})
    free = arm.model_copy(update={"velocity": None, "angular_velocity": None})
    only = arm.model_copy(update={"velocity": (arm.velocity[0] + 0.5, *arm.velocity[1:])})
    bodies = (only, load.model_copy(update={"velocity": None, "angular_velocity": None}))
    wrong = scene.with_(body=bodies if joint == "A" else (arm, faster))
    with pytest.raises(
        SceneError, match=rf"joint\[{joint}\]: velocities given to bodies violate it by 0\.5 m/s"
    ):
        mbref.simulate(wrong, method, times=[0.1])
    assert mbref.simulate(scene.with_(body=(free, load)), method, times=[0.01]).outcome.name == "COMPLETED"
