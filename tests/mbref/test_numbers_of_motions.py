"""Energies, joints, drivers and loads of a motion; turning frames; units / numbers worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mbref import rotations
from mbref.actuation import driver_motion, largest_force, load_motion
from mbref.design.turning import Turning, turning
from mbref.energy import kinetic, potential
from mbref.joint_motion import joint_motion, position_of, velocity_of
from mbref.scene import (
    Body,
    Cylindrical,
    Driver,
    Force,
    Inline,
    Moment,
    Revolute,
    Scene,
    SceneError,
    Sine,
    Spherical,
    Spring,
    TorsionSpring,
    Translational,
)
from mbref.scene_units import dimension_of, echoed, in_si
from mbref.trajectory import Trajectory

T = np.array([0.0, 0.5, 1.0])
ANGLE, RATE = 0.2 + 4.0 * T, np.full(3, 4.0)  # of the arm, from the scene's pose at 0.2 rad
SLID, SPEED = 0.3 * T, np.full(3, 0.3)
Z = (0.0, 0.0, 1.0)


def about_z(angle: float) -> tuple[float, ...]:
    return math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)


def out(angle) -> np.ndarray:
    return np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)


def across(angle) -> np.ndarray:
    return np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=-1)


def scene(**parts: object) -> Scene:
    """An arm from the origin, its centre at 1 m, at 0.2 rad, and a block that slides along it from 3 m."""
    along = out(np.array(0.2))
    arm = Body(name="arm", mass=2.0, inertia=(0.2, 0.4, 0.5), position=tuple(along), orientation=about_z(0.2))
    full = ((0.4, 0.0, 0.0), (0.0, 0.5, 0.0), (0.0, 0.0, 0.7))
    block = Body(name="block", mass=1.0, inertia=full, position=tuple(3 * along), orientation=about_z(0.2))
    hinge = Revolute(name="A", bodies=("ground", "arm"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 2.0))
    rail = Translational(name="B", bodies=("arm", "block"), anchor=tuple(2 * along), axis=tuple(3 * along))
    given = {"body": (arm, block), "joint": (hinge, rail), "gravity": (0.0, -10.0, 0.0), **parts}
    return Scene(name="s", duration=1.0, **given)


def motion(**parts: object) -> Trajectory:
    distance = 3.0 + SLID
    q = np.stack([np.cos(ANGLE / 2), 0 * T, 0 * T, np.sin(ANGLE / 2)], axis=-1)
    speed = SPEED[:, None] * out(ANGLE) + (distance * RATE)[:, None] * across(ANGLE)
    spin = np.zeros((3, 2, 3)) + np.array([0.0, 0.0, 4.0])
    made = {
        "position": np.stack([out(ANGLE), distance[:, None] * out(ANGLE)], axis=1),
        "orientation": np.stack([q, -q], axis=1),
        "velocity": np.stack([RATE[:, None] * across(ANGLE), speed], axis=1),
        "angular_velocity": spin,
        **parts,
    }
    return Trajectory("s", "e", "1", "m", {}, T, ("arm", "block"), **made)


# --- joints -----------------------------------------------------------------------------------------------
def test_angle_and_displacement_since_the_start():
    hinge, rail = joint_motion(scene(), motion(), "A"), joint_motion(scene(), motion(), "B")
    assert hinge.angle == pytest.approx([0.0, 2.0, 4.0]) and hinge.rate == pytest.approx(RATE)
    assert hinge.displacement is hinge.displacement_rate is hinge.force is hinge.moment is hinge.open is None
    assert hinge.rotation[:, 2] == pytest.approx([0.0, 2.0, 4.0 - 2 * math.pi])
    assert rail.displacement == pytest.approx([0.0, 0.15, 0.3]) and rail.displacement_rate == pytest.approx(
        SPEED
    )
    assert rail.angle is rail.rate is None and rail.rotation == pytest.approx(np.zeros((3, 3)), abs=1e-15)
    assert repr(rail) == "<JointMotion of 'B': 3 samples of displacement, rotation>"
    with pytest.raises(KeyError, match="no joint 'C'; joints: A, B"):
        joint_motion(scene(), motion(), "C")


def test_full_turns_are_counted_and_the_first_body_carries_the_axis():
    """In reversed order of bodies the angle has the other sign; 26 rad need four turns."""
    fast = motion(angular_velocity=np.zeros((3, 2, 3)) + np.array([0.0, 0.0, 26.0]))
    q = np.stack([np.cos(0.1 + 13 * T), 0 * T, 0 * T, np.sin(0.1 + 13 * T)], axis=-1)
    fast.orientation[:, 0] = q
    joint = scene().joint[0].model_copy(update={"bodies": ("arm", "ground")})
    found = joint_motion(scene(joint=(joint, scene().joint[1])), fast, "A")
    assert found.angle == pytest.approx([0.0, -13.0, -26.0]) and found.rate == pytest.approx([-26.0] * 3)
    later = Trajectory(
        "s",
        "e",
        "1",
        "m",
        {},
        T[1:],
        ("arm", "block"),
        fast.position[1:],
        fast.orientation[1:],
        fast.velocity[1:],
        fast.angular_velocity[1:],
    )
    assert joint_motion(scene(), later, "A").angle == pytest.approx([13 - 4 * math.pi, 26 - 4 * math.pi])


def test_a_cylindrical_joint_has_both_and_a_ball_neither():
    kinds = {"bodies": ("ground", "arm"), "anchor": (0.0, 0.0, 0.0)}
    sleeve, ball = Cylindrical(name="A", axis=Z, **kinds), Spherical(name="A", **kinds)
    lifted = motion()
    lifted.position[:, 0, 2] += 0.5 * T
    lifted.velocity[:, 0, 2] += 0.5
    found = joint_motion(scene(joint=(sleeve,)), lifted, "A")
    assert found.angle == pytest.approx([0.0, 2.0, 4.0]) and found.displacement == pytest.approx(0.5 * T)
    assert found.displacement_rate == pytest.approx([0.5] * 3)
    ball_motion = joint_motion(scene(joint=(ball,)), motion(), "A")
    assert ball_motion.angle is ball_motion.displacement is None


def test_points_of_bodies_and_of_the_ground():
    point = tuple(2 * out(np.array(0.2)))
    assert position_of(scene(), motion(), "arm", point) == pytest.approx(2 * out(ANGLE))
    assert velocity_of(scene(), motion(), "arm", point) == pytest.approx(8 * across(ANGLE))
    assert position_of(scene(), motion(), "ground", (1.0, 2.0, 3.0)).tolist() == [[1.0, 2.0, 3.0]] * 3
    assert not velocity_of(scene(), motion(), "ground", (1.0, 2.0, 3.0)).any()


# --- drivers and loads ------------------------------------------------------------------------------------
def test_torque_force_and_power_of_drivers():
    """The axis of the rail turns with the arm; a component across it is not the driver's."""
    wrench = np.zeros((3, 6)) + np.array([0.0, 0.0, 9.0, 7.0, 8.0, 5.0])
    along = np.concatenate([6.0 * out(ANGLE) + 2.0 * across(ANGLE), np.zeros((3, 3))], axis=1)
    driven = scene(
        driver=(Driver(joint="A", polynomial=(0.0, 4.0)), Driver(joint="B", polynomial=(0.0, 0.3)))
    )
    run = motion(reactions={"A": wrench, "B": along})
    hinge, rail = (driver_motion(driven, run, name) for name in "AB")
    assert hinge.torque == pytest.approx([5.0] * 3) and hinge.power == pytest.approx([20.0] * 3)
    assert rail.force == pytest.approx([6.0] * 3) and rail.power == pytest.approx([1.8] * 3)
    assert hinge.force is rail.torque is None
    assert driver_motion(driven, motion(), "A").power is None
    with pytest.raises(KeyError, match="driven joints: A, B"):
        driver_motion(driven, run, "C")
    with pytest.raises(KeyError, match="driven joints: none"):
        driver_motion(scene(), run, "A")
    assert largest_force(run) == pytest.approx([9.0] * 3) and largest_force(motion()) is None
    assert largest_force(motion(reactions={})).tolist() == [0.0] * 3


LOADS = (
    TorsionSpring(joint="A", stiffness=5.0, damping=0.5, natural_angle=0.5),
    Spring(
        bodies=("ground", "block"),
        points=((0.0, 0.0, 0.0), tuple(3 * out(np.array(0.2)))),
        stiffness=8.0,
        damping=2.0,
        natural_length=1.0,
    ),
    Moment(body="arm", moment=(0.0, 0.0, 1.0)),
    Force(body="arm", point=(0.0, 0.0, 0.0), force=(1.0, 0.0, 0.0)),
)


def test_lengths_angles_forces_and_powers_of_loads():
    loaded = scene(load=LOADS)
    twist, spring, moment, _ = (load_motion(loaded, motion(), k) for k in range(4))
    torque = -5.0 * (np.array([0.0, 2.0, 4.0]) - 0.5) - 0.5 * 4.0
    assert (
        twist.place == 0
        and twist.angle == pytest.approx([0.0, 2.0, 4.0])
        and twist.rate == pytest.approx(RATE)
    )
    assert twist.torque == pytest.approx(torque) and twist.power == pytest.approx(4.0 * torque)
    assert spring.length == pytest.approx(3.0 + SLID) and spring.length_rate == pytest.approx(SPEED)
    pull = 8.0 * (2.0 + SLID) + 2.0 * 0.3
    assert spring.force == pytest.approx(pull) and spring.power == pytest.approx(-0.3 * pull)
    assert twist.length is twist.force is spring.angle is spring.torque is moment.power is None
    assert moment.place == 2
    for place in (-1, 4):
        with pytest.raises(IndexError, match="the scene has 4 loads"):
            load_motion(loaded, motion(), place)


def test_kinetic_and_potential_energy():
    """Arm: 2 kg at 4 m/s and 0.5 kg m² at 4 rad/s; block: 1 kg at 4 d m/s and 0.3 m/s, and 0.7 kg m²."""
    d = 3.0 + SLID
    moving = (2.0 * 16 + 0.5 * 16 + (4 * d) ** 2 + 0.09 + 0.7 * 16) / 2
    assert kinetic(scene(), motion()) == pytest.approx(moving)
    height = 10.0 * (2.0 * np.sin(ANGLE) + d * np.sin(ANGLE))
    assert potential(scene(), motion()) == pytest.approx(height)
    springs = 5.0 * (np.array([0.0, 2.0, 4.0]) - 0.5) ** 2 / 2 + 8.0 * (d - 1.0) ** 2 / 2
    assert potential(scene(load=LOADS), motion()) == pytest.approx(height + springs)
    geared = scene().joint[0].model_copy(update={"armature": 0.25})
    assert kinetic(scene(joint=(geared, scene().joint[1])), motion()) == pytest.approx(moving + 0.25 * 16 / 2)
    bare = [body.model_copy(update={"mass": None, "inertia": None}) for body in scene().body]
    for energy in (kinetic, potential):
        with pytest.raises(ValueError, match="body 'arm' has no mass"):
            energy(scene(body=bare), motion())


# --- turning frames ---------------------------------------------------------------------------------------
TURNED = Turning(np.array([0.0, 0.0, 3.0]), np.array([1.0, 0.0, 0.0]), "A")


def one_body(**parts: object) -> Scene:
    body = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(3.0, 0.0, 0.0))
    hinge = Revolute(name="A", bodies=("ground", "b"), anchor=(1.0, 0.0, 5.0), axis=(0.0, 0.0, 2.0))
    given = {
        "body": (body,),
        "joint": (hinge,),
        "driver": (Driver(joint="A", polynomial=(0.0, 3.0)),),
        **parts,
    }
    return Scene(name="s", gravity=(0.0, 0.0, -9.81), **given)


def test_bodies_of_a_turning_mechanism_and_of_one_at_rest():
    [moving] = TURNED.bodies(one_body())
    assert moving.velocity == pytest.approx((0.0, 6.0, 0.0)) and moving.angular_velocity == (0.0, 0.0, 3.0)
    [still] = Turning(np.zeros(3), np.zeros(3), "").bodies(one_body(body=(moving,)))
    assert still.velocity is still.angular_velocity is None


def test_the_frame_of_a_driver():
    found = turning(one_body())
    assert (
        found.spin.tolist() == [0.0, 0.0, 3.0]
        and found.point.tolist() == [1.0, 0.0, 5.0]
        and found.joint == "A"
    )
    back = one_body().joint[0].model_copy(update={"bodies": ("b", "ground")})
    assert turning(one_body(joint=(back,))).spin.tolist() == [0.0, 0.0, -3.0]
    rest = turning(one_body(driver=(Driver(joint="A", polynomial=(0.0,)),)))
    assert rest.rate == 0.0 and rest.joint == "" and not rest.point.any()


@pytest.mark.parametrize(
    "parts",
    [
        {"driver": (Driver(joint="A", polynomial=(0.0, 3.0, 1e-3)),)},
        {"driver": (Driver(joint="A", polynomial=(0.0, 3.0), sine=Sine(amplitude=0.1, frequency=1.0)),)},
        {"driver": (Driver(joint="A", table=((0.0, 0.0), (1.0, 1.0), (2.0, 3.0), (3.0, 4.0))),)},
        {"joint": (Translational(name="A", bodies=("ground", "b"), anchor=(1.0, 0.0, 0.0), axis=Z),)},
        {
            "joint": (
                Revolute(name="A", bodies=("ground", "b"), anchor=(1.0, 0.0, 0.0), axis=(0.0, 1e-6, 1.0)),
            )
        },
    ],
)
def test_motions_that_are_not_steady(parts):
    with pytest.raises(SceneError, match="driver"):
        turning(one_body(**parts))


def test_two_drivers_or_two_moving_bodies_are_not_steady():
    drivers = Driver(joint="A", polynomial=(0.0, 3.0)), Driver(joint="B", polynomial=(0.0, 1.0))
    upright = Revolute(name="B", bodies=("arm", "block"), anchor=(0.0, 0.0, 0.0), axis=Z)
    for driver in (drivers, drivers[1:]):
        with pytest.raises(SceneError, match="needed are drivers that stand still"):
            turning(scene(driver=driver, joint=(scene().joint[0], upright), gravity=(0.0, 0.0, -9.81)))


# --- units ------------------------------------------------------------------------------------------------
def test_numbers_with_units():
    for text, dimension, wanted in (
        ("300 mm", "length", 0.3),
        ("-1.5cm", "length", -0.015),
        ("2 in", "length", 0.0508),
        ("1ft", "length", 0.3048),
        ("5 um", "length", 5e-6),
        ("1e-3 km", "length", 1.0),
        (".5 m", "length", 0.5),
        ("+2. m", "length", 2.0),
        ("180 deg", "angle", math.pi),
        ("90°", "angle", math.pi / 2),
        ("2 mrad", "angle", 2e-3),
        ("0.5 rev", "angle", math.pi),
        ("3 rad", "angle", 3.0),
    ):
        assert in_si(text, dimension) == pytest.approx(wanted, rel=1e-14), text
        assert dimension_of(text) == dimension
    assert [dimension_of(value) for value in ("3", "3 kg", "mm", 3.0, None)] == [None] * 5
    with pytest.raises(ValueError, match="'deg' is no unit of length, known: m, mm, cm, um, km, in, ft"):
        in_si("3 deg", "length")
    with pytest.raises(ValueError, match='such as "30 deg", got'):
        in_si("three", "angle")


def test_numbers_with_units_of_a_file_are_echoed():
    data = {
        "body": [{"name": "rod", "position": ["300 mm", 0.0]}],
        "driver": [{"joint": "A", "polynomial": [0, " 90 deg"]}],
        "x": [["1 m"]],
    }
    assert list(echoed(data)) == [
        "body[rod].position[0]: 300 mm = 0.3 m",
        "driver[A].polynomial[1]: 90 deg = 1.5708 rad",
        "x[0][0]: 1 m = 1 m",
    ]


def test_rotations_used_above():
    assert rotations.rotate(np.array(about_z(math.pi / 2)), np.array([1.0, 0.0, 0.0])) == pytest.approx(
        [0, 1, 0]
    )


def test_the_sign_of_quaternions_does_not_count():
    """With either sign of all quaternions, or of the later ones, the arm turns by 0, 2 and 4 rad."""
    for signs in ([-1.0, -1.0, -1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0]):
        turned = motion()
        turned.orientation[:, 0] *= np.array(signs)[:, None]
        assert joint_motion(scene(), turned, "A").angle == pytest.approx([0.0, 2.0, 4.0])


def test_a_point_slides_along_an_axis_of_the_first_body_alone():
    """The block turns freely about its point on the arm, which alone turns the axis."""
    along = tuple(3 * out(np.array(0.2)))
    point = Inline(name="B", bodies=("arm", "block"), anchor=along, axis=along)
    free = motion()
    free.angular_velocity[:, 1] = [5.0, -2.0, 7.0]
    found = joint_motion(scene(joint=(scene().joint[0], point)), free, "B")
    assert found.displacement == pytest.approx(SLID) and found.displacement_rate == pytest.approx(SPEED)
    assert found.angle is None
