"""Velocities given to bodies that a joint forbids are refused; the error names the joint and the amount."""

import numpy as np
import pytest

import mbref
from crosscheck.conformance.changes.units import in_other_units
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


@pytest.mark.parametrize("length", [1e-6, 1.0, 1e6])
def test_rounding_of_velocities_at_rest_is_no_contradiction(length):
    """A program wrote 4e-19 lengths a second, by which hinge A opens; 4e-10 is a contradiction."""
    at_rest = in_other_units(MOTIONS["arm with revolute"](), length, 1.0)
    at_rest = at_rest.with_(
        body=[body.model_copy(update={"velocity": None, "angular_velocity": None}) for body in at_rest.body]
    )
    arm, load = at_rest.body

    def given(speed: float) -> mbref.Motion:
        velocity = {"velocity": (speed * length, speed * length, 0.0), "angular_velocity": (0.0, 0.0, 0.0)}
        rounded = at_rest.with_(body=[arm.model_copy(update=velocity), load.model_copy(update=velocity)])
        return mbref.simulate(rounded, times=[0.1])

    exact, motion = mbref.simulate(at_rest, times=[0.1]), given(4e-19)
    assert motion.message == exact.message
    assert np.allclose(motion.position, exact.position, rtol=0.0, atol=1e-14 * length)  # m; 50 roundings
    with pytest.raises(SceneError, match="velocities given to bodies violate it"):
        given(4e-10)
