"""Velocities given to bodies that a joint forbids are refused; the error names the joint and the amount."""

import numpy as np
import pytest

import mbref
from crosscheck.conformance.changes.units import in_other_units
from mbref.scene import Body, SceneError
from tests.helpers.short_motions import MOTIONS

ARM, LOAD = MOTIONS["arm with revolute"]().body


def faster(body: Body) -> Body:
    """Return a body with a further 0.5 m/s along x."""
    return body.model_copy(update={"velocity": (body.velocity[0] + 0.5, *body.velocity[1:])})


def free(body: Body) -> Body:
    """Return a body without given velocities."""
    return body.model_copy(update={"velocity": None, "angular_velocity": None})


@pytest.mark.parametrize("method", ["taylor", "lm2+projection"])
@pytest.mark.parametrize(("bodies", "joint"), [((ARM, faster(LOAD)), "B"), ((faster(ARM), free(LOAD)), "A")])
def test_error_names_the_joint_that_given_velocities_violate_and_by_how_much(bodies, joint, method):
    """Hinge A connects arm and ground, B load and arm; the given velocities fit both. With 0.5 m/s added to
    the load's velocity, B would open at 0.5 m/s. With 0.5 m/s added to the arm's velocity, and none given to
    the load, which can follow, A would."""
    wrong = MOTIONS["arm with revolute"]().with_(body=bodies)
    says = rf"joint\[{joint}\]: velocities given to bodies violate it by 0\.5 m/s"
    with pytest.raises(SceneError, match=says):
        mbref.simulate(wrong, method, times=[0.1])


@pytest.mark.parametrize("length", [1e-6, 1.0, 1e6])
def test_rounding_of_velocities_at_rest_is_no_contradiction(length):
    """The bodies are given 4e-19 lengths a second, as a program may write in place of zero: they move as from
    rest. 4e-10 lengths a second, by which hinge A would open, are a contradiction."""
    at_rest = in_other_units(MOTIONS["arm with revolute"](), length, 1.0)
    at_rest = at_rest.with_(body=[free(body) for body in at_rest.body])
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
