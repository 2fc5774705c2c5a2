"""Scenes made from a motion / places, directions, springs and functions of time worked out by hand.

Body b turns from 90° to 180° about z, while its centre moves from (1, 2, 0) to (4, 0, 5): a vector on it
turns by 90°. Body c moves by (0, 0, 1) without turning.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from crosscheck.conformance import replays
from crosscheck.conformance.trial import Outside
from mbref.scene import (
    Body,
    Cylindrical,
    Distance,
    Driver,
    Factor,
    Fixed,
    Force,
    JointTorque,
    Moment,
    Revolute,
    Scene,
    SlideSpring,
    Spherical,
    Spring,
    TorsionSpring,
    Translational,
    Universal,
)
from mbref.trajectory import Trajectory

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
HALF = math.sqrt(0.5)
SHAFT = Cylindrical(name="shaft", bodies=("ground", "b"), anchor=(1.0, 2.0, 0.0), axis=Z)
ARM = (1.0, 3.0, 0.0)  # 1 m from the centre of b, and at (3, 0, 5) later


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


def started(sense: float = 1.0, sample: int = 1, **parts: Any) -> Scene:
    return replays.started(scene(**parts), motion(), sample, sense)


# --- bodies, joints and loads at a later sample -----------------------------------------------------------
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_bodies_at_a_sample(sense):
    b, c = started(sense).body
    assert (b.name, b.position, c.position) == ("b", (4.0, 0.0, 5.0), (0.0, 1.0, 1.0))
    assert b.orientation == pytest.approx((0.0, 0.0, 0.0, 1.0)) and c.orientation == (1.0, 0.0, 0.0, 0.0)
    assert b.velocity == (2.0 * sense, 3.0 * sense, 4.0 * sense) and c.velocity[2] == 7.0 * sense
    assert b.angular_velocity == (0.0, 0.0, 0.5 * sense) and (b.mass, c.mass) == (1.0, 1.0)
    assert started(sense, 0).body[0].position == (1.0, 2.0, 0.0)


@pytest.mark.parametrize(
    ("joint", "places"),
    [
        (Revolute(name="J", bodies=("ground", "b"), anchor=ARM, axis=X), {"anchor": ARM, "axis": X}),
        (Revolute(name="J", bodies=("b", "ground"), anchor=ARM, axis=X), {"anchor": (3, 0, 5), "axis": Y}),
        (Revolute(name="J", bodies=("c", "b"), anchor=ARM, axis=X), {"anchor": (1, 3, 1), "axis": X}),
        (Spherical(name="J", bodies=("b", "c"), anchor=ARM), {"anchor": (3, 0, 5)}),
        (Fixed(name="J", bodies=("c", "ground"), anchor=ARM), {"anchor": (1, 3, 1)}),
        (
            Universal(name="J", bodies=("b", "c"), anchor=ARM, axes=(X, Z)),
            {"anchor": (3, 0, 5), "axes": (Y, Z)},
        ),
        (
            Universal(name="J", bodies=("ground", "b"), anchor=ARM, axes=(Z, Y)),
            {"anchor": ARM, "axes": (Z, (-1, 0, 0))},
        ),
        (Distance(name="J", bodies=("ground", "b"), anchors=(Z, ARM)), {"anchors": (Z, (3, 0, 5))}),
        (
            Distance(name="J", bodies=("b", "c"), anchors=((3.0, 2.0, 1.0), Z)),
            {"anchors": ((4, 2, 6), (0, 0, 2))},
        ),
    ],
    ids=lambda value: "" if isinstance(value, dict) else f"{value.type} of {' and '.join(value.bodies)}",
)
def test_joints_at_a_sample(joint, places):
    """A place moves with its body; the anchor and the axis of both bodies move with the first one."""
    found = started(joint=(SHAFT, joint)).joint[1]
    assert (found.type, found.name, found.bodies) == (joint.type, joint.name, joint.bodies)
    for name, wanted in places.items():
        assert np.array(getattr(found, name)) == pytest.approx(np.array(wanted, dtype=float), abs=1e-12), name


def test_springs_of_joints_at_a_sample():
    """The shaft has turned by 90° and has moved by 5 m, so much less is left to the natural position."""
    loads = (
        TorsionSpring(joint="shaft", stiffness=3.0, damping=0.5, natural_angle=0.25),
        SlideSpring(joint="shaft", stiffness=2.0, damping=0.1, natural_displacement=7.0),
    )
    torsion, slide = started(load=loads).load
    assert torsion.natural_angle == pytest.approx(0.25 - math.pi / 2)
    assert slide.natural_displacement == pytest.approx(2.0)
    assert (torsion.stiffness, torsion.damping, slide.stiffness) == (3.0, 0.5, 2.0)


def test_loads_at_a_sample():
    loads = (
        Spring(bodies=("b", "ground"), points=(ARM, Z), stiffness=1.0, natural_length=0.4),
        Force(body="b", point=ARM, force=X, factor=Factor(polynomial=(1.0, 3.0))),
        Moment(body="b", moment=X),
        JointTorque(joint="shaft", torque=2.0, factor=Factor(start=3.0)),
    )
    spring, force, moment, torque = started(load=loads).load
    assert np.array(spring.points) == pytest.approx(np.array([[3.0, 0.0, 5.0], Z]), abs=1e-12)
    assert spring.natural_length == 0.4
    assert force.point == pytest.approx((3.0, 0.0, 5.0), abs=1e-12)
    assert force.force == X, "a force has world axes"
    assert force.factor.polynomial == (7.0, 3.0), "1 + 3 (t + 2)"
    assert moment == loads[2]
    assert torque.factor.start == 1.0 and torque.torque == 2.0


def test_drivers_at_a_sample():
    """t + t² two seconds later, from there: 5 t + t²."""
    driver = Driver(joint="shaft", polynomial=(0.0, 1.0, 1.0))
    assert started(driver=(driver,)).driver[0].polynomial == pytest.approx((0.0, 5.0, 1.0), abs=1e-14)
    assert started(driver=(driver,)).driver[0].joint == "shaft"


# --- the second half and the motion backwards -------------------------------------------------------------
RUN = motion((0.0, 1.0, 2.5, 4.0, 6.0))


@pytest.mark.parametrize(("times", "first"), [((0.0, 1.0, 2.5, 4.0, 6.0), 2), ((0.0, 1.0, 2.5, 4.0), 2)])
def test_the_second_half_begins_at_its_middle_sample(times, first):
    again, run = replays.RESTARTED
    half = again(scene(), motion(times))
    assert half.duration == times[-1] - times[first]
    assert half.body[0].position == (1.0 + 3.0 * first, 2.0 - 2.0 * first, 5.0 * first)
    assert half.body[0].velocity == (1.0 + first, 2.0 + first, 3.0 + first), "forwards"
    samples = run(scene(), motion(times))
    assert samples.times.tolist() == [t - times[first] for t in times[first:]]
    assert samples.position[:, 0, 2].tolist() == [5.0 * k for k in range(first, len(times))]
    assert samples.velocity[0, 0].tolist() == [1.0 + first, 2.0 + first, 3.0 + first]


def test_a_motion_backwards_begins_at_its_last_sample():
    back, samples = replays.REVERSED
    found = back(scene(), RUN)
    assert found.body[0].position == (13.0, -6.0, 20.0) and found.body[0].velocity == (-5.0, -6.0, -7.0)
    assert found.body[0].angular_velocity == (0.0, 0.0, -0.5) and found.duration == 4.0
    run = samples(scene(), RUN)
    assert run.times.tolist() == RUN.times.tolist()
    assert run.position[:, 0, 2].tolist() == [20.0, 15.0, 10.0, 5.0, 0.0]
    assert run.velocity[:, 0, 0].tolist() == [-5.0, -4.0, -3.0, -2.0, -1.0]
    assert (run.angular_velocity == -RUN.angular_velocity).all()
    assert (run.orientation == RUN.orientation[::-1]).all()
    assert run.acceleration is None and run.angular_acceleration is None and run.reactions is None


# --- a driver replaced by its moment ----------------------------------------------------------------------
CRANK = Revolute(name="crank", bodies=("ground", "b"), anchor=(1.0, 2.0, 0.0), axis=(0.0, 0.0, 2.0))
DRIVER = Driver(joint="crank", polynomial=(0.0, 1.0))


def replayed(*moments: float, **parts: Any) -> Scene | Outside:
    given = {"joint": (SHAFT, CRANK), "driver": (DRIVER,), **parts}
    pull = np.array([[1.0, 2.0, 3.0, 40.0, 50.0, moment] for moment in moments])
    return replays.replayed(scene(**given), motion(reactions={"shaft": 7 * pull, "crank": pull}))


@pytest.mark.parametrize("size", [4.0, -4.0])
def test_a_moment_about_an_axis_of_any_length(size):
    found = replayed(size, size * (1 + 0.9e-6), load=(Moment(body="c", moment=X),))
    assert [load.body for load in found.load] == ["c", "b"] and not found.driver
    assert found.load[1].moment == pytest.approx((0.0, 0.0, size * (1 + 0.45e-6)), rel=1e-9)
    assert [body.velocity for body in found.body] == [(1.0, 2.0, 3.0), (4.0, 5.0, 6.0)]
    assert [body.angular_velocity for body in found.body] == [(0.0, 0.0, 0.5), (0.0, 0.0, 0.0)]


def test_a_replayed_motion_has_the_velocities_of_its_first_sample():
    spin = np.arange(12.0).reshape(2, 2, 3)
    run = motion(angular_velocity=spin, reactions={"crank": np.ones((2, 6))})
    found = replays.replayed(scene(joint=(SHAFT, CRANK), driver=(DRIVER,)), run)
    assert [body.angular_velocity for body in found.body] == [(0.0, 1.0, 2.0), (3.0, 4.0, 5.0)]


@pytest.mark.parametrize("size", [4.0, -4.0])
def test_a_moment_that_varies(size):
    assert "varies" in replayed(size, size * (1 + 1.1e-6)).reason


def test_a_driver_without_a_moment():
    assert replayed(0.0, 0.0).load[-1].moment == (0.0, 0.0, 0.0)


def test_drivers_that_no_constant_moment_replaces():
    slide = Translational(name="crank", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=Z)
    turned = CRANK.model_copy(update={"bodies": ("c", "b")})
    for joint in (slide, turned):
        assert "about an axis on the ground" in replayed(4.0, 4.0, joint=(SHAFT, joint)).reason
    both = (DRIVER, Driver(joint="shaft", polynomial=(0.0, 1.0)))
    assert "exactly one driver" in replayed(4.0, 4.0, driver=both).reason
    assert "no reactions" in replays.replayed(scene(joint=(CRANK,), driver=(DRIVER,)), motion()).reason
