"""Equivalent forms of a mechanism / names, exchanged fields and halves worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from crosscheck.conformance import rewritings
from crosscheck.conformance.trial import Outside
from mbref import rotations
from mbref.scene import Body, Distance, Driver, Fixed, Revolute, Scene, Spherical, Spring, Universal
from mbref.scene_fields import SMALLEST
from mbref.trajectory import Trajectory

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
ORIGIN = (0.0, 0.0, 0.0)


def body(name: str = "b", **parts: Any) -> Body:
    given = {"mass": 3.0, "inertia": (0.3, 0.4, 0.5), "position": (1.0, 2.0, 0.0), "velocity": ORIGIN}
    return Body(name=name, **{**given, "angular_velocity": ORIGIN, **parts})


def scene(*bodies: Body, **parts: Any) -> Scene:
    return Scene(**{"name": "s", "body": bodies or (body(),), "gravity": ORIGIN, "duration": 1.0, **parts})


def test_names_of_more_than_26_parts():
    """Letters fall from z to a, and begin again, so that the alphabet does not keep the order."""
    many = scene(
        *(body(f"b{k}", position=(float(k), 0.0, 0.0)) for k in range(28)),
        joint=tuple(Spherical(name=f"j{k}", bodies=("ground", f"b{k}"), anchor=ORIGIN) for k in range(28)),
    )
    named = rewritings.relabelled(many)
    assert [each.name for each in named.body[24:]] == ["part b24", "part a25", "part z26", "part y27"]
    assert [each.name for each in named.joint[24:]] == ["joint b24", "joint a25", "joint z26", "joint y27"]
    assert named.joint[25].bodies == ("ground", "part a25")
    assert len({each.name for each in named.body}) == 28 and named.body[3].position == (3.0, 0.0, 0.0)


def test_names_in_springs_with_two_bodies():
    spring = Spring(bodies=("b", "ground"), points=(X, Y), stiffness=1.0, natural_length=1.0)
    assert rewritings.relabelled(scene(load=(spring,))).load[0].bodies == ("part z0", "ground")


def test_pairs_of_a_joint_are_exchanged_with_its_bodies():
    rod = Distance(name="rod", bodies=("ground", "b"), anchors=(X, Y))
    cross = Universal(name="cross", bodies=("b", "ground"), anchor=X, axes=(Y, Z))
    first, second = rewritings.swapped(scene(joint=(rod, cross))).joint
    assert (first.bodies, first.anchors) == (("b", "ground"), (Y, X))
    assert (second.bodies, second.axes, second.anchor) == (("ground", "b"), (Z, Y), X)


def test_both_axes_of_a_universal_joint_are_longer():
    cross = Universal(name="cross", bodies=("b", "ground"), anchor=X, axes=(Y, Z))
    ball = Spherical(name="ball", bodies=("b", "ground"), anchor=X)
    found = rewritings.stretched(scene(joint=(ball, cross))).joint
    assert found[1].axes == ((0, 1000, 0), (0, 0, 1000)) and found[1].anchor == X and found[0] == ball


def test_a_sleeve_is_put_on_the_first_revolute_joint():
    ball = Spherical(name="ball", bodies=("b", "ground"), anchor=X)
    hinges = [
        Revolute(name=f"J{k}", bodies=("ground", "b"), anchor=(1.0, 2.0, 3.0 + k), axis=(0.0, 3.0, 4.0))
        for k in range(2)
    ]
    *_, sleeve = rewritings.satisfied(scene(joint=(ball, *hinges))).joint
    assert sleeve.anchor == pytest.approx((1.0, 2.18, 3.24)) and sleeve.axis == pytest.approx((0.0, 0.6, 0.8))


def test_a_motion_keeps_its_arrays_under_other_names():
    run = motion(2)
    found = rewritings.renamed(scene(), replace(run, bodies=("b",)))
    assert found.bodies == ("part z0",) and found.position is run.position


# --- two halves -------------------------------------------------------------------------------------------
def test_the_distance_of_the_halves():
    """A fifth of the middle moment of 0.4 kg m² comes from the distance: 3 kg · a² = 0.08 kg m²."""
    scene_of_halves = rewritings.split(scene())
    first, second = scene_of_halves.body
    arm = math.sqrt(0.08 / 3)
    assert first.position == pytest.approx((1.0 + arm, 2.0, 0.0))
    assert second.position == pytest.approx((1.0 - arm, 2.0, 0.0))
    assert (first.name, second.name, first.mass, second.mass) == ("b", "b half", 1.5, 1.5)
    for half in (first, second):
        assert np.array(half.inertia) == pytest.approx(np.diag([0.15, 0.16, 0.21]))
    weld = scene_of_halves.joint[-1]
    assert isinstance(weld, Fixed) and (weld.name, weld.bodies) == ("weld", ("b", "b half"))
    assert weld.anchor == (1.0, 2.0, 0.0)


@pytest.mark.parametrize("smallest", [0, 1, 2])
def test_the_halves_are_along_the_axis_of_the_least_moment(smallest):
    """The body is turned by 90° about z, so that its x is along y of the world, and its y along -x."""
    moments = np.array([0.5, 0.5, 0.5])
    moments[smallest] = 0.3
    turned = body(inertia=tuple(moments), orientation=(math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)))
    first, _ = rewritings.split(scene(turned)).body
    along = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])[smallest]
    arm = math.sqrt(0.1 / 3)
    assert np.subtract(first.position, (1.0, 2.0, 0.0)) == pytest.approx(arm * along, abs=1e-12)


@pytest.mark.parametrize("axis", [(3.0, 4.0, 0.0), (-4.0, 3.0, 0.0), (4.0, -3.0, 0.0), (0.0, 3.0, -4.0)])
def test_the_largest_component_of_the_arm_is_positive(axis):
    """Inertia 0.5 kg m² across an axis and 0.3 along it, as a matrix."""
    unit = np.array(axis) / 5.0
    inertia = 0.5 * np.eye(3) - 0.2 * np.outer(unit, unit)
    first, _ = rewritings.split(scene(body(inertia=inertia.tolist()))).body
    wanted = math.sqrt(0.1 / 3) * unit * (1.0 if max(unit, key=abs) > 0 else -1.0)
    assert np.subtract(first.position, (1.0, 2.0, 0.0)) == pytest.approx(wanted, abs=1e-12)


def test_velocities_of_halves():
    """1.2 rad/s about z: the halves move at ±1.2 a along y against their centre."""
    spun = body(velocity=(5.0, 6.0, 7.0), angular_velocity=(0.0, 0.0, 1.2))
    first, second = rewritings.split(scene(spun)).body
    swing = 1.2 * math.sqrt(0.08 / 3)
    assert first.velocity == pytest.approx((5.0, 6.0 + swing, 7.0))
    assert second.velocity == pytest.approx((5.0, 6.0 - swing, 7.0))
    assert first.angular_velocity == second.angular_velocity == (0.0, 0.0, 1.2)


def test_halves_that_are_no_bodies_of_the_scene():
    taken = rewritings.split(scene(body("b half", position=ORIGIN), body()))
    assert isinstance(taken, Outside) and taken.reason.startswith("the halves are not valid bodies: ")
    assert "b half" in taken.reason
    thin = rewritings.split(scene(body(inertia=(1.5 * SMALLEST, 0.4, 0.4))))
    assert isinstance(thin, Outside) and "too thin" in thin.reason
    rod, _ = rewritings.split(scene(body(inertia=(0.0, 0.4, 0.4)))).body
    assert np.array(rod.inertia) == pytest.approx(np.diag([0.0, 0.16, 0.16])), "a rod has no moment along it"


@pytest.mark.parametrize(("off", "is_split"), [(0.5e-12, True), (2e-12, False)])
def test_velocities_that_differ_from_the_joints_by_rounding(off, is_split):
    """A hinge at the origin, 2 rad/s: the centre at (1, 2, 0) moves at (-4, 2, 0) m/s, so that 4e-12 m/s are
    rounding."""
    hinge = Revolute(name="J", bodies=("ground", "b"), anchor=ORIGIN, axis=Z)
    spun = body(velocity=(-4.0, 2.0 + 4 * off, 0.0), angular_velocity=(0.0, 0.0, 2.0))
    found = rewritings.split(scene(spun, joint=(hinge,)))
    assert isinstance(found, Scene) is is_split


@pytest.mark.parametrize("rate", [0.0, 2.0])
def test_the_motion_of_halves_has_their_start(rate):
    spun = body(velocity=(5.0, 6.0, 7.0), angular_velocity=(0.0, 0.0, rate))
    whole = scene(body("a", position=ORIGIN), spun)
    halves, run = rewritings.split(whole).body, motion(1)
    run = replace(
        run,
        bodies=("a", "b"),
        position=np.array([[each.position for each in whole.body]]),
        orientation=np.tile([1.0, 0.0, 0.0, 0.0], (1, 2, 1)),
        velocity=np.array([[each.velocity for each in whole.body]]),
        angular_velocity=np.array([[each.angular_velocity for each in whole.body]]),
        acceleration=np.zeros((1, 2, 3)),
        angular_acceleration=np.zeros((1, 2, 3)),
    )
    found = rewritings.of_halves(whole, run)
    assert found.bodies == ("a", "b", "b half")
    assert found.acceleration is None and found.angular_acceleration is None
    for field in ("position", "velocity", "orientation", "angular_velocity"):
        wanted = np.array([getattr(each, field) for each in halves])
        assert getattr(found, field)[0] == pytest.approx(wanted, abs=1e-14), field


def motion(samples: int) -> Trajectory:
    zero = np.zeros((samples, 1, 3))
    turn = np.tile([1.0, 0.0, 0.0, 0.0], (samples, 1, 1))
    return Trajectory("s", "e", "1", "m", {}, np.arange(samples) * 1.0, ("b",), zero, turn, zero, zero)


def test_negative_quaternions_turn_alike():
    turned = body(orientation=(0.5, 0.5, -0.5, 0.5))
    [found] = rewritings.negated(scene(turned)).body
    assert found.orientation == (-0.5, -0.5, 0.5, -0.5)
    assert rotations.rotate(np.array(found.orientation), np.array(X)) == pytest.approx(
        rotations.rotate(np.array(turned.orientation), np.array(X))
    )


def test_a_scene_without_joints_is_split():
    driver = Driver(joint="J", polynomial=(0.0, 1.0))
    hinge = Revolute(name="J", bodies=("ground", "b"), anchor=(1.0, 2.0, 0.0), axis=Z)
    still = rewritings.split(scene(body(angular_velocity=Z), joint=(hinge,), driver=(driver,)))
    assert [each.name for each in still.joint] == ["J", "weld"] and still.driver == (driver,)
