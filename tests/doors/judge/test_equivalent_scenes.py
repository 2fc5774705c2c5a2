"""Equivalent scenes: a driver replaced by its constant moment, and a body split in halves."""

import math
from typing import Any

import numpy as np
import pytest

from crosscheck.conformance.changes import replays, rewritings
from crosscheck.conformance.changes.copies import Outside
from mbref.motions.trajectory import Trajectory
from mbref.scene import Body, Cylindrical, Driver, Moment, Revolute, Scene, Translational
from mbref.scene.fields import SMALLEST

X, Z = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
TURNED = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))  # by 90° about z
SHAFT = Cylindrical(name="shaft", bodies=("ground", "b"), anchor=(1.0, 2.0, 0.0), axis=Z)


def scene(**parts: Any) -> Scene:
    bodies = (
        Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 2.0, 0.0), orientation=TURNED),
        Body(name="c", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 1.0, 0.0)),
    )
    return Scene(**{"name": "s", "body": bodies, "joint": (SHAFT,), "duration": 4.0, **parts})


def motion(**parts: Any) -> Trajectory:
    """Return two samples at 0 and 2 s: b, at (1, 2, 0) and (4, 0, 5) m, turns from 90° to 180° about z."""
    place = np.array([[[1.0, 2.0, 0.0], [0.0, 1.0, 0.0]], [[4.0, 0.0, 5.0], [0.0, 1.0, 1.0]]])
    turn = np.array([[TURNED, (1.0, 0.0, 0.0, 0.0)], [(0.0, 0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0)]])
    velocity = np.array([[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], [[2.0, 3.0, 4.0], [5.0, 6.0, 7.0]]])
    spin = np.array([[[0.0, 0.0, 0.5], [0.0, 0.0, 0.0]]] * 2)
    times = np.array([0.0, 2.0])
    return Trajectory("s", "e", "1", "m", {}, times, ("b", "c"), place, turn, velocity, spin, **parts)


CRANK = Revolute(name="crank", bodies=("ground", "b"), anchor=(1.0, 2.0, 0.0), axis=(0.0, 0.0, 2.0))
DRIVER = Driver(joint="crank", polynomial=(0.0, 1.0))


def replayed(*moments: float, **parts: Any) -> Scene | Outside:
    """Return the scene in which the driver of hinge "crank" is replaced by its moment in a run, whose samples
    have these moments about z. Reactions of the shaft are other ones."""
    given = {"joint": (SHAFT, CRANK), "driver": (DRIVER,), **parts}
    pull = np.array([[1.0, 2.0, 3.0, 40.0, 50.0, moment] for moment in moments])
    return replays.replayed(scene(**given), motion(reactions={"shaft": 7 * pull, "crank": pull}))


@pytest.mark.parametrize("size", [4.0, -4.0, 0.0])
def test_constant_driving_moment_replaces_the_driver(size):
    """The driver's moment is 4, -4 or 0 N m about z and varies by 0.9e-6 of itself (1e-6 is allowed): its
    mean replaces the driver. Other loads stay, and bodies start with the velocities of the run. That the
    hinge's axis has the length 2 has no effect."""
    found = replayed(size, size * (1 + 0.9e-6), load=(Moment(body="c", moment=X),))
    assert [load.body for load in found.load] == ["c", "b"] and not found.driver
    assert found.load[1].moment == pytest.approx((0.0, 0.0, size * (1 + 0.45e-6)), rel=1e-9)
    assert [body.velocity for body in found.body] == [(1.0, 2.0, 3.0), (4.0, 5.0, 6.0)]
    assert [body.angular_velocity for body in found.body] == [(0.0, 0.0, 0.5), (0.0, 0.0, 0.0)]


@pytest.mark.parametrize("size", [4.0, -4.0])
def test_driving_moment_that_varies_by_over_1e_6_is_refused(size):
    """The moments at both samples differ by 1.1e-6 of themselves."""
    assert "varies" in replayed(size, size * (1 + 1.1e-6)).reason


def test_drivers_that_a_moment_on_the_ground_cannot_replace_are_refused():
    """A slide's driver, one between moving bodies, two drivers and a run without reactions are refused."""
    slide = Translational(name="crank", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=Z)
    turned = CRANK.model_copy(update={"bodies": ("c", "b")})
    for joint in (slide, turned):
        assert "about an axis on the ground" in replayed(4.0, 4.0, joint=(SHAFT, joint)).reason
    both = (DRIVER, Driver(joint="shaft", polynomial=(0.0, 1.0)))
    assert "exactly one driver" in replayed(4.0, 4.0, driver=both).reason
    assert "no reactions" in replays.replayed(scene(joint=(CRANK,), driver=(DRIVER,)), motion()).reason


def block(name: str = "b", **parts: Any) -> Body:
    """Return a body at rest at (1, 2, 0) m, or with other fields."""
    given = {"mass": 3.0, "inertia": (0.3, 0.4, 0.5)}
    given |= {"position": (1.0, 2.0, 0.0), "velocity": (0.0, 0.0, 0.0)}
    return Body(name=name, **{**given, "angular_velocity": (0.0, 0.0, 0.0), **parts})


def still(*bodies: Body, **parts: Any) -> Scene:
    return Scene(name="s", body=bodies, **{"gravity": (0.0, 0.0, 0.0), "duration": 1.0, **parts})


def test_a_body_is_not_split_if_a_name_is_taken_or_a_half_is_too_thin():
    """The half of body b is named "b half", which another body has. The thin body has 1.5 times the smallest
    moment of inertia that a scene takes (SMALLEST, kg m²); its half would have 0.75 times."""
    taken = rewritings.split(still(block("b half"), block()))
    assert isinstance(taken, Outside) and taken.reason.startswith("the halves are not valid bodies: ")
    assert "b half" in taken.reason
    thin = rewritings.split(still(block(inertia=(1.5 * SMALLEST, 0.4, 0.4))))
    assert isinstance(thin, Outside) and "halves are not valid bodies: inertia" in thin.reason


@pytest.mark.parametrize(("off", "is_split"), [(2e-12, True), (8e-12, False)])  # m/s
def test_a_body_is_split_only_if_its_velocity_meets_the_joint_to_rounding(off, is_split):
    """On a hinge at the origin at 2 rad/s, the centre at (1, 2, 0) m moves at (-4, 2, 0) m/s. The body's
    velocity is ``off`` from this; up to 1e-12 of the largest component, 4e-12 m/s, counts as rounding."""
    hinge = Revolute(name="J", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=Z)
    spun = block(velocity=(-4.0, 2.0 + off, 0.0), angular_velocity=(0.0, 0.0, 2.0))
    found = rewritings.split(still(spun, joint=(hinge,)))
    assert isinstance(found, Scene) is is_split
