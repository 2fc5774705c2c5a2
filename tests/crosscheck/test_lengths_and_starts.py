"""The judge's scenes / lengths, rates and initial velocities of small scenes worked out by hand."""

import math
from typing import Any

import numpy as np
import pytest

from crosscheck.judge import constraints
from mbref.scene import Body, Cylindrical, Distance, Revolute, Scene, SceneError

O, X, Z = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def body(name: str = "b", *place: float, **parts: Any) -> Body:
    given = {"mass": 2.0, "inertia": (0.5, 0.3, 0.2), "position": place or O, **parts}
    return Body(name=name, **given)


def scene(*bodies: Body, **parts: Any) -> Scene:
    return Scene(name="s", body=bodies, **{"gravity": O, **parts})


def hinge(name: str = "A", first: str = "ground", second: str = "b", **parts: Any) -> Revolute:
    return Revolute(name=name, bodies=(first, second), **{"anchor": O, "axis": Z, **parts})


def test_scene_length_is_the_largest_distance_of_anchors_and_centres():
    """Points (3, 4, 0) and the origin; (3, 4, 0) and (0, 0, -6), √(5² + 6²) apart; centres 7 m apart."""
    bar = Distance(name="D", bodies=("ground", "b"), anchors=((0.0, 0.0, -6.0), (3.0, 4.0, 0.0)))
    assert constraints.scene_length(scene(body("b", 3.0, 4.0, 0.0), joint=(hinge(),))) == 5.0
    assert constraints.scene_length(scene(body("b", 3.0, 4.0, 0.0), joint=(bar,))) == math.hypot(5.0, 6.0)
    assert constraints.scene_length(scene(body("a", 1.0, 0.0, 0.0), body("b", 1.0, 0.0, 7.0))) == 7.0


@pytest.mark.parametrize(
    ("parts", "more", "length"),
    [
        ({}, {}, 0.5),
        ({"velocity": (3.0, 4.0, 0.0)}, {"duration": 2.0}, 5.0 * 2.0),
        ({}, {"gravity": (0.0, -6.0, 8.0), "duration": 2.0}, 10.0 * 2.0**2 / 2),
        ({"velocity": X}, {"gravity": (0.0, 0.0, 3.0), "duration": 2.0}, 1.0 * 2.0 + 3.0 * 2.0**2 / 2),
        ({"velocity": (0.2, 0.0, 0.0)}, {}, 0.5),
        ({"mass": None, "inertia": None}, {}, 1.0),
        ({"mass": None, "inertia": None, "velocity": (0.0, 3.0, 0.0)}, {"duration": 0.5}, 3.0 * 0.5),
    ],
    ids=["at rest", "thrown", "falling", "thrown and falling", "slow", "massless at rest", "massless thrown"],
)
def test_length_of_a_single_body_is_its_way_or_its_radius_of_gyration(parts, more, length):
    """The larger of the way v t + g t² / 2 over the duration, of 1 s unless given, and the radius of gyration
    √(0.5 kg m² / 2 kg) = 0.5 m; the radius counts as 1 m for a body without mass."""
    assert constraints.scene_length(scene(body(**parts), **{"duration": 1, **more})) == pytest.approx(length)


PARTS = scene(
    body("b", 1.0, 0.0, 0.0),
    body("c", 3.0, 0.0, 0.0),
    joint=(hinge("A"), Cylindrical(name="C", bodies=("ground", "c"), anchor=O, axis=X)),
)
POSE = constraints.initial_poses(PARTS)


def test_joint_rates_are_spin_about_and_velocity_along_the_axis():
    """Body b spins at 3 rad/s about z, hinge A's axis; c has 2 m/s along and 1 rad/s about C's axis x."""
    rates = constraints.joint_rates(PARTS, *POSE, np.array([O, (2.0, 5.0, 0.0)]), np.array([(0, 0, 3.0), X]))
    assert rates["A"] == pytest.approx([3.0, 0.0]) and rates["C"] == pytest.approx([1.0, 2.0])


def thrown_off_a_hinge(off: float) -> Scene:
    """A body at 3 m/s, with a part of that speed along the hinge's axis, which the hinge forbids; the judge
    takes up to 5 % for rounding."""
    return scene(body("b", 2.0, 0.0, 0.0, velocity=(0.0, 3.0, 3.0 * off)), joint=(hinge(),))


def test_initial_velocity_four_percent_off_a_hinge_is_rounded_onto_it():
    """0.12 m/s along the axis, 4 % of 3 m/s, are taken for rounding, as anything up to 5 % is."""
    assert constraints.initial_twists(thrown_off_a_hinge(0.04))[0][0] == pytest.approx([0.0, 3.0, 0.0])


def test_initial_velocity_six_percent_off_a_hinge_is_refused():
    """6 % of 3 m/s are 0.18 m/s along the hinge's axis; up to 5 % would count as rounding."""
    with pytest.raises(SceneError, match=r"joint\[0\] 'A': the given velocities contradict it: off by 0.18"):
        constraints.initial_twists(thrown_off_a_hinge(0.06))
