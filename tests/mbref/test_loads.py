"""Loads on two bodies that turn and move in space / forces and moments written down in world axes.

Body a is turned by 90° about z, and body b by 90° about x. Both move, and their angular velocities are given
in world axes. Each load's wrench is worked out from the places and velocities of its points.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from mbref import rotations
from mbref.equations.functions import functions_of, numbers_of, pieces_of
from mbref.equations.model import Model
from mbref.scene import (
    Body,
    Cylindrical,
    Driver,
    Factor,
    Force,
    JointForce,
    JointTorque,
    Moment,
    Revolute,
    Scene,
    Sine,
    SlideSpring,
    Spring,
    TorsionSpring,
)

HALF = math.sqrt(0.5)
INERTIA = np.array([0.3, 0.4, 0.5])
PLACES = {"a": np.array([1.0, 2.0, 3.0]), "b": np.array([-1.0, 0.5, 2.0])}
TURNS = {"a": np.array([HALF, 0.0, 0.0, HALF]), "b": np.array([HALF, HALF, 0.0, 0.0])}
SPEEDS = {"a": np.array([0.3, -0.2, 0.1]), "b": np.array([-0.5, 0.4, 0.7])}
SPINS = {"a": np.array([0.2, 0.5, -0.4]), "b": np.array([-0.3, 0.6, 0.9])}  # world axes
FIRST, SECOND = np.array([1.5, 2.0, 2.0]), np.array([0.0, 1.0, 4.0])  # points of a and b
STILL = np.zeros(3)


def body(name: str) -> Body:
    return Body(
        name=name,
        mass=2.0,
        inertia=INERTIA.tolist(),
        position=PLACES[name].tolist(),
        orientation=TURNS[name].tolist(),
    )


def forces(*loads: Any, t: float = 0.0, gravity: Any = (0.0, 0.0, 0.0), **parts: Any) -> np.ndarray:
    """Force and moment (2, 6) of both bodies in world axes, without the gyroscopic moments."""
    scene = Scene(name="s", body=(body("a"), body("b")), load=loads, gravity=gravity, duration=4.0, **parts)
    model = Model(scene)
    own = {n: rotations.rotate(rotations.conjugate(TURNS[n]), SPINS[n]) for n in "ab"}
    v = np.concatenate([part for n in "ab" for part in (SPEEDS[n], own[n])])
    g = model.terms(t, model.start(), v).force.reshape(2, 6).copy()
    for k, n in enumerate("ab"):
        moment = g[k, 3:] + np.cross(own[n], INERTIA * own[n])
        g[k, 3:] = rotations.rotate(TURNS[n], moment)
    return g


def moved(name: str, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Place and velocity of a point of a body or of the ground."""
    if name == "ground":
        return point, STILL
    return point, SPEEDS[name] + np.cross(SPINS[name], point - PLACES[name])


def wrench(**acting: tuple[np.ndarray, np.ndarray, np.ndarray]) -> np.ndarray:
    """Force, its point, and a further moment on each named body, as force and moment about its centre."""
    found = np.zeros((2, 6))
    for name, (force, point, moment) in acting.items():
        found["ab".index(name)] = [*force, *(moment + np.cross(point - PLACES[name], force))]
    return found


def near(wanted: np.ndarray) -> Any:
    return pytest.approx(wanted, abs=1e-13)


def test_weights():
    assert forces(gravity=(0.5, -1.0, 2.0)) == near(np.tile([1.0, -2.0, 4.0, 0.0, 0.0, 0.0], (2, 1)))


@pytest.mark.parametrize("name", ["a", "b"])
def test_a_force_and_a_moment_in_world_axes(name):
    push = np.array([2.0, -3.0, 5.0])
    point = {"a": FIRST, "b": SECOND}[name]
    assert forces(Force(body=name, point=point.tolist(), force=push.tolist())) == near(
        wrench(**{name: (push, point, STILL)})
    )
    assert forces(Moment(body=name, moment=push.tolist())) == near(wrench(**{name: (STILL, STILL, push)}))


def test_loads_add_up():
    push, turn = (
        Force(body="a", point=FIRST.tolist(), force=(1.0, 2.0, 3.0)),
        Moment(body="a", moment=(4.0, 5.0, 6.0)),
    )
    assert forces(push, turn, push) == near(2 * forces(push) + forces(turn))


@pytest.mark.parametrize("pair", [("a", "b"), ("b", "a"), ("ground", "b"), ("a", "ground")])
@pytest.mark.parametrize(("stiffness", "damping"), [(7.0, 0.0), (0.0, 3.0), (7.0, 3.0)])
def test_a_spring_between_two_points(pair, stiffness, damping):
    points = [{"a": FIRST, "b": SECOND, "ground": np.array([0.2, -0.4, 1.0])}[name] for name in pair]
    (p, u), (q, v) = (moved(name, point) for name, point in zip(pair, points, strict=True))
    length = np.linalg.norm(q - p)
    along = (q - p) / length
    pull = (stiffness * (length - 0.6) + damping * (v - u) @ along) * along
    spring = Spring(
        bodies=pair,
        points=[point.tolist() for point in points],
        stiffness=stiffness,
        damping=damping,
        natural_length=0.6,
    )
    acting = {name: (sign * pull, x, STILL) for name, x, sign in zip(pair, points, (1, -1), strict=True)}
    acting.pop("ground", None)
    assert forces(spring) == near(wrench(**acting))


def test_a_spring_without_length_has_no_force():
    spring = Spring(bodies=("ground", "a"), points=(FIRST.tolist(),) * 2, stiffness=7.0, natural_length=0.0)
    assert not forces(spring).any()


# --- loads of joints --------------------------------------------------------------------------------------
AXIS = np.array([2.0, 1.0, 2.0]) / 3.0
ANCHOR = np.array([0.5, 1.5, 2.5])


def shaft(pair: tuple[str, str]) -> Cylindrical:
    return Cylindrical(name="J", bodies=pair, anchor=ANCHOR.tolist(), axis=(5 * AXIS).tolist())


PAIRS = [("a", "b"), ("b", "a"), ("ground", "b"), ("a", "ground")]


def about_axis(pair: tuple[str, str], torque: float) -> np.ndarray:
    acting = {n: (STILL, STILL, s * torque * AXIS) for n, s in zip(pair, (-1, 1), strict=True)}
    acting.pop("ground", None)
    return wrench(**acting)


def along_axis(pair: tuple[str, str], force: float) -> np.ndarray:
    acting = {n: (s * force * AXIS, ANCHOR, STILL) for n, s in zip(pair, (-1, 1), strict=True)}
    acting.pop("ground", None)
    return wrench(**acting)


def spin(name: str) -> np.ndarray:
    return SPINS.get(name, STILL)


@pytest.mark.parametrize("pair", PAIRS)
def test_springs_and_torques_about_an_axis(pair):
    """The angle is zero at the start, and the natural angle 0.25 rad."""
    rate = (spin(pair[1]) - spin(pair[0])) @ AXIS
    twist = TorsionSpring(joint="J", stiffness=8.0, damping=0.5, natural_angle=0.25)
    assert forces(twist, joint=(shaft(pair),)) == near(about_axis(pair, 8.0 * 0.25 - 0.5 * rate))
    motor = JointTorque(joint="J", torque=-3.0)
    assert forces(motor, joint=(shaft(pair),)) == near(about_axis(pair, -3.0))


@pytest.mark.parametrize("pair", PAIRS)
def test_springs_and_forces_along_an_axis(pair):
    """The displacement is zero at the start, the natural one 0.4 m; both anchors are at one place, so that
    the axis, which turns with the first body, does not matter to the rate."""
    rate = (moved(pair[1], ANCHOR)[1] - moved(pair[0], ANCHOR)[1]) @ AXIS
    spring = SlideSpring(joint="J", stiffness=6.0, damping=0.7, natural_displacement=0.4)
    assert forces(spring, joint=(shaft(pair),)) == near(along_axis(pair, 6.0 * 0.4 - 0.7 * rate))
    assert forces(JointForce(joint="J", force=-3.0), joint=(shaft(pair),)) == near(along_axis(pair, -3.0))


@pytest.mark.parametrize("slid", [0.3, -0.8])
def test_a_slide_spring_after_a_displacement(slid):
    """Body b has slid along the axis of body a, and both turn with a: the force acts along the turned axis at
    the place of b, and the rate counts the axis's turning."""
    model = Model(
        Scene(
            name="s",
            body=(body("a"), body("b")),
            joint=(shaft(("a", "b")),),
            load=(SlideSpring(joint="J", stiffness=6.0, damping=0.7, natural_displacement=0.4),),
        )
    )
    start = model.start().reshape(2, 7)
    start[1, :3] += slid * AXIS
    place = ANCHOR + slid * AXIS
    u = SPEEDS["a"] + np.cross(SPINS["a"], ANCHOR - PLACES["a"])
    v = SPEEDS["b"] + np.cross(SPINS["b"], place - PLACES["b"] - slid * AXIS)
    rate = (v - u) @ AXIS + slid * AXIS @ np.cross(SPINS["a"], AXIS)
    force = (-6.0 * (slid - 0.4) - 0.7 * rate) * AXIS
    own = {n: rotations.rotate(rotations.conjugate(TURNS[n]), SPINS[n]) for n in "ab"}
    velocity = np.concatenate([part for n in "ab" for part in (SPEEDS[n], own[n])])
    g = model.terms(0.0, start.ravel(), velocity).force.reshape(2, 6)
    assert g[:, :3] == near(np.array([-force, force]))
    for k, (n, at, sign) in enumerate(
        (("a", place - PLACES["a"], -1), ("b", place - PLACES["b"] - slid * AXIS, 1))
    ):
        moment = rotations.rotate(TURNS[n], g[k, 3:] + np.cross(own[n], INERTIA * own[n]))
        assert moment == near(np.cross(at, sign * force))


@pytest.mark.parametrize("turned", [0.9, -2.5, 3.4, 7.0])
def test_a_torsion_spring_counts_the_angle_nearest_to_the_last_one(turned):
    """The last angle is zero: 3.4 rad and 7 rad are 2π less."""
    hinge = Revolute(name="J", bodies=("a", "b"), anchor=ANCHOR.tolist(), axis=AXIS.tolist())
    twist = TorsionSpring(joint="J", stiffness=2.0)
    model = Model(Scene(name="s", body=(body("a"), body("b")), joint=(hinge,), load=(twist,)))
    q = model.start().reshape(2, 7)
    q[1, 3:] = rotations.multiply(rotations.from_vector(turned * AXIS), q[1, 3:])
    g = model.terms(0.0, q.ravel()).force.reshape(2, 6)
    angle = (turned + math.pi) % (2 * math.pi) - math.pi
    assert rotations.rotate(q[1, 3:], g[1, 3:]) == near(-2.0 * angle * AXIS)
    assert rotations.rotate(q[0, 3:], g[0, 3:]) == near(2.0 * angle * AXIS)


# --- functions of time ------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("factor", "t", "value"),
    [
        (Factor(polynomial=(1.0, -2.0, 0.5)), 1.5, 1.0 - 3.0 + 1.125),
        (Factor(sine=Sine(amplitude=0.5, frequency=4.0, phase=0.3)), 0.7, 0.5 * math.sin(3.1)),
        (Factor(polynomial=(2.0,), sine=Sine(amplitude=1.0, frequency=2.0)), 0.5, 2.0 + math.sin(1.0)),
        (Factor(table=tuple((t, t**3 - t) for t in (0.0, 1.0, 2.0, 3.0, 5.0))), 1.5, 1.5**3 - 1.5),
        (Factor(start=1.0, stop=2.0), 0.5, 0.0),
        (Factor(start=1.0, stop=2.0), 1.0, 1.0),
        (Factor(start=1.0, stop=2.0), 1.5, 1.0),
        (Factor(start=1.0, stop=2.0), 2.0, 0.0),
        (Factor(polynomial=(0.0, 3.0), start=1.0), 2.5, 7.5),
        (Factor(stop=2.0), 3.0, 0.0),
    ],
)
def test_factors_over_time(factor, t, value):
    load = Force(body="a", point=FIRST.tolist(), force=(2.0, 0.0, 0.0), factor=factor)
    steady = Moment(body="b", moment=(0.0, 1.0, 0.0))
    found = forces(steady, load, t=t)
    assert found[0, 0] == pytest.approx(2.0 * value, abs=1e-12) and found[1, 4] == pytest.approx(1.0)
    torque = JointTorque(joint="J", torque=4.0, factor=factor)
    assert forces(torque, t=t, joint=(shaft(("a", "b")),)) == near(about_axis(("a", "b"), 4.0 * value))


def test_numbers_of_functions():
    wave = Factor(polynomial=(1.0, 2.0), sine=Sine(amplitude=0.5, frequency=4.0, phase=0.3))
    assert numbers_of(wave, 4) == (0.5, 4.0, 0.3, 1.0, 2.0, 0.0, 0.0)
    assert numbers_of(Factor(polynomial=(3.0,)), 1) == (0.0, 0.0, 0.0, 3.0)
    assert pieces_of(Factor(start=1.0)) == [(0.0, 0.0, 0, 0, 0, 0), (1.0, 1.0, 0, 0, 0, 0)]


def test_functions_of_drivers_come_before_functions_of_loads():
    driver = Driver(joint="J", polynomial=(0.0, 1.0))
    factor = Factor(start=1.0)
    parts = {
        "joint": (shaft(("a", "b")),),
        "driver": (driver,),
        "load": (
            Moment(body="a", moment=(1.0, 0.0, 0.0)),
            Moment(body="a", moment=(1.0, 0.0, 0.0), factor=factor),
        ),
    }
    scene = Scene(name="s", body=(body("a"), body("b")), **parts)
    assert functions_of(scene) == [driver, factor]
    without = tuple(Body(name=n, position=PLACES[n].tolist()) for n in "ab")
    assert functions_of(scene.with_(body=without)) == [driver], "loads do not act without masses"
