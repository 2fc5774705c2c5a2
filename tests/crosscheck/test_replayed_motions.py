"""Drivers that a constant moment replaces, and motions that have none. Body b turns from 90° to 180° about z,
while its centre moves from (1, 2, 0) to (4, 0, 5): a vector on it turns by 90°. Body c moves by (0, 0, 1)
without turning."""

import math
from typing import Any

import numpy as np
import pytest

from crosscheck.conformance.changes import replays
from crosscheck.conformance.changes.copies import Outside
from mbref.motions.trajectory import Trajectory
from mbref.scene import Body, Cylindrical, Driver, Moment, Revolute, Scene, Translational

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
HALF = math.sqrt(0.5)
SHAFT = Cylindrical(name="shaft", bodies=("ground", "b"), anchor=(1.0, 2.0, 0.0), axis=Z)


def scene(**parts: Any) -> Scene:
    bodies = (
        Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 2.0, 0.0), orientation=TURNED),
        Body(name="c", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 1.0, 0.0)),
    )
    return Scene(**{"name": "s", "body": bodies, "joint": (SHAFT,), "duration": 4.0, **parts})


TURNED = (HALF, 0.0, 0.0, HALF)


def motion(times: tuple[float, ...] = (0.0, 2.0), **parts: Any) -> Trajectory:
    """Positions and velocities of sample k are k times the values of the second sample; c moves along z."""
    k = np.arange(len(times), dtype=float)[:, None, None]
    place = np.array([[1.0, 2.0, 0.0], [0.0, 1.0, 0.0]]) + k * np.array([[3.0, -2.0, 5.0], [0.0, 0.0, 1.0]])
    half_angle = math.pi / 4 * (1 + k[:, 0, 0])
    turn = np.stack([np.cos(half_angle), 0 * half_angle, 0 * half_angle, np.sin(half_angle)], axis=1)
    given = {
        "position": place,
        "orientation": np.stack([turn, np.tile([1.0, 0.0, 0.0, 0.0], (len(times), 1))], axis=1),
        "velocity": k + np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]),
        "angular_velocity": 0 * k + np.array([[0.0, 0.0, 0.5], [0.0, 0.0, 0.0]]),
        **parts,
    }
    return Trajectory("s", "e", "1", "m", {}, np.array(times), ("b", "c"), **given)


CRANK = Revolute(name="crank", bodies=("ground", "b"), anchor=(1.0, 2.0, 0.0), axis=(0.0, 0.0, 2.0))
DRIVER = Driver(joint="crank", polynomial=(0.0, 1.0))


def replayed(*moments: float, **parts: Any) -> Scene | Outside:
    given = {"joint": (SHAFT, CRANK), "driver": (DRIVER,), **parts}
    pull = np.array([[1.0, 2.0, 3.0, 40.0, 50.0, moment] for moment in moments])
    return replays.replayed(scene(**given), motion(reactions={"shaft": 7 * pull, "crank": pull}))


@pytest.mark.parametrize("size", [4.0, -4.0, 0.0])
def test_constant_driving_moment_replaces_the_driver(size):
    """Moments of ±4 or 0 N m about z vary by 0.9e-6 (1e-6 is allowed): their mean replaces the driver. The
    axis's length of 2 has no effect. Other loads stay; bodies start with the run's velocities."""
    found = replayed(size, size * (1 + 0.9e-6), load=(Moment(body="c", moment=X),))
    assert [load.body for load in found.load] == ["c", "b"] and not found.driver
    assert found.load[1].moment == pytest.approx((0.0, 0.0, size * (1 + 0.45e-6)), rel=1e-9)
    assert [body.velocity for body in found.body] == [(1.0, 2.0, 3.0), (4.0, 5.0, 6.0)]
    assert [body.angular_velocity for body in found.body] == [(0.0, 0.0, 0.5), (0.0, 0.0, 0.0)]


@pytest.mark.parametrize("size", [4.0, -4.0])
def test_driving_moment_that_varies_by_over_1e_6_is_refused(size):
    """Moments at two samples differ by 1.1e-6 of themselves."""
    assert "varies" in replayed(size, size * (1 + 1.1e-6)).reason


def test_drivers_that_a_moment_on_the_ground_cannot_replace_are_refused():
    """A slide's driver, a hinge between two moving bodies, two drivers, and a run without reactions."""
    slide = Translational(name="crank", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=Z)
    turned = CRANK.model_copy(update={"bodies": ("c", "b")})
    for joint in (slide, turned):
        assert "about an axis on the ground" in replayed(4.0, 4.0, joint=(SHAFT, joint)).reason
    both = (DRIVER, Driver(joint="shaft", polynomial=(0.0, 1.0)))
    assert "exactly one driver" in replayed(4.0, 4.0, driver=both).reason
    assert "no reactions" in replays.replayed(scene(joint=(CRANK,), driver=(DRIVER,)), motion()).reason
