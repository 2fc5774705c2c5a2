"""Equivalent forms of a mechanism / names, exchanged fields and halves worked out by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from crosscheck.conformance import rewritings
from crosscheck.conformance.trial import Outside
from mbref import rotations
from mbref.scene import Body, Driver, Revolute, Scene, Spherical
from mbref.scene_fields import SMALLEST

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


# --- two halves -------------------------------------------------------------------------------------------


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
