"""Scenes in which a body is split in halves."""

from typing import Any

import pytest

from crosscheck.conformance.changes import rewritings
from crosscheck.conformance.changes.copies import Outside
from mbref.scene import Body, Revolute, Scene
from mbref.scene.fields import SMALLEST

ORIGIN = (0.0, 0.0, 0.0)


def body(name: str = "b", **parts: Any) -> Body:
    given = {"mass": 3.0, "inertia": (0.3, 0.4, 0.5), "position": (1.0, 2.0, 0.0), "velocity": ORIGIN}
    return Body(name=name, **{**given, "angular_velocity": ORIGIN, **parts})


def scene(*bodies: Body, **parts: Any) -> Scene:
    return Scene(**{"name": "s", "body": bodies or (body(),), "gravity": ORIGIN, "duration": 1.0, **parts})


def test_a_body_is_not_split_if_a_name_is_taken_or_a_half_is_too_thin():
    """Another body has the name "b half". Half of the thin body would have a moment below SMALLEST, kg m²."""
    taken = rewritings.split(scene(body("b half", position=ORIGIN), body()))
    assert isinstance(taken, Outside) and taken.reason.startswith("the halves are not valid bodies: ")
    assert "b half" in taken.reason
    thin = rewritings.split(scene(body(inertia=(1.5 * SMALLEST, 0.4, 0.4))))
    assert isinstance(thin, Outside) and "halves are not valid bodies: inertia" in thin.reason


@pytest.mark.parametrize(("off", "is_split"), [(2e-12, True), (8e-12, False)])  # m/s
def test_a_body_is_split_only_if_its_velocity_meets_the_joint_to_rounding(off, is_split):
    """A hinge at the origin, 2 rad/s: the centre at (1, 2, 0) moves at (-4, 2, 0) m/s. Up to 1e-12 of its
    largest component, 4 m/s, counts as rounding."""
    hinge = Revolute(name="J", bodies=("ground", "b"), anchor=ORIGIN, axis=(0.0, 0.0, 1.0))
    spun = body(velocity=(-4.0, 2.0 + off, 0.0), angular_velocity=(0.0, 0.0, 2.0))
    found = rewritings.split(scene(spun, joint=(hinge,)))
    assert isinstance(found, Scene) is is_split
