"""Inline joints keep a point on a line: motions against closed form and reference, in mbref and engines."""

import numpy as np
import pytest

import mbref
from crosscheck.engine import engine
from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import truth_for
from mbref.scene import Scene
from tests.helpers.measured import MARGIN
from tests.helpers.parts import Z, joint

TIMES = np.array([0.0, 0.2, 0.5])
ROUNDING = 1e-13  # m, m/s² or rad/s²; 500 roundings of numbers near 1
BEAD = {"name": "bead", "mass": 1.3, "inertia": [0.02, 0.03, 0.04], "position": [0.1, 0.0, 0.2]}
WIRE = (0.6, 0.0, -0.8)


def bead(bodies: tuple[str, str], **more) -> Scene:
    """Return a body on a wire: an inline joint keeps a point of one of ``bodies`` on a line of the other."""
    wire = joint("J", "inline", *bodies, (0.3, 0.1, 0.0), axis=WIRE)
    return Scene(name="bead", gravity=(0.0, 0.0, -9.81), body=[{**BEAD, **more}], joint=[wire])


def shaft(*kinds: str) -> Scene:
    """Return a shaft in two bearings on one axis, joints of two types."""
    body = {"name": "shaft", "mass": 2.0, "inertia": [0.1, 0.12, 0.02], "position": [0.05, 0.0, 0.4]}
    axes = [{} if kind == "spherical" else {"axis": Z} for kind in kinds]
    bearings = [joint("AB"[k], kinds[k], "ground", "shaft", (0.0, 0.0, k), **axes[k]) for k in range(2)]
    turning = {**body, "angular_velocity": [0.0, 0.0, 5.0]}
    return Scene(name="shaft", gravity=(-9.81, 0.0, 0.0), body=[turning], joint=bearings)


SCENES = {
    "wire on the ground": bead(("ground", "bead")),
    "wire on the body": bead(("bead", "ground"), angular_velocity=[0.5, 1.0, -2.0]),
    "beside a spherical joint": shaft("spherical", "inline"),
}


def test_a_body_on_a_wire_through_its_centre_slides_as_on_an_incline():
    """s = g t² / 2 times 0.8, the sine of the wire's slope: up to 1 m, to 1e-13 m, 500 roundings."""
    scene = bead(("ground", "bead"), position=[0.3, 0.1, 0.0])
    motion = mbref.simulate(scene, times=TIMES)
    way = 9.81 * 0.8 * TIMES**2 / 2
    assert np.abs(motion.position[:, 0] - [0.3, 0.1, 0.0] - way[:, None] * np.array(WIRE)).max() < ROUNDING
    assert motion.joint("J").displacement == pytest.approx(way, abs=ROUNDING)


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
@pytest.mark.parametrize(("name", "family"), [("mujoco", "projected"), ("exudyn", "tuned")])
def test_engine_moves_an_inline_joint_as_the_reference(scene, name, family):
    """Errors from the truth, of the length or rad, are up to ten times 1.3e-10, the largest measured."""
    found = engine(name)
    assert found.cannot(scene) is None
    run = found.run(scene, TIMES, found.settings_of(scene, family)[-1])
    errors = measure(scene, run, truth_for(scene))
    assert errors["error"] < MARGIN * 1.3e-10, errors


def test_an_inline_joint_in_place_of_a_second_bearing_leaves_fewer_redundant_rows():
    """Five rows hold a shaft to one freedom; a hinge has five, a ball joint three, an inline joint two.
    Redundant are five of two hinges, two of hinge and inline, none of ball and inline."""
    assert mbref.diagnose(shaft("revolute", "revolute")).counts.redundant == 5
    cured = mbref.diagnose(shaft("revolute", "inline")).counts
    assert (cured.redundant, cured.degrees_of_freedom) == (2, 1)
    ball = mbref.diagnose(SCENES["beside a spherical joint"]).counts
    assert (ball.redundant, ball.degrees_of_freedom) == (0, 1)
