"""The judge's scenes / lengths, masses, rows and initial velocities of small scenes worked out by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from crosscheck.judge import constraints
from mbref.scene import (
    Body,
    Cylindrical,
    Distance,
    Driver,
    Revolute,
    Scene,
    SceneError,
    Spherical,
    Translational,
)

O, X, Y, Z = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def body(name: str = "b", *place: float, **parts: Any) -> Body:
    given = {"mass": 2.0, "inertia": (0.5, 0.3, 0.2), "position": place or O, **parts}
    return Body(name=name, **given)


def scene(*bodies: Body, **parts: Any) -> Scene:
    return Scene(name="s", body=bodies, **{"gravity": O, **parts})


def hinge(name: str = "A", first: str = "ground", second: str = "b", **parts: Any) -> Revolute:
    return Revolute(name=name, bodies=(first, second), **{"anchor": O, "axis": Z, **parts})


# --- lengths ----------------------------------------------------------------------------------------------
def test_the_length_is_the_largest_distance_of_anchors_and_centres():
    bar = Distance(name="D", bodies=("ground", "b"), anchors=((0.0, 0.0, -6.0), (3.0, 4.0, 0.0)))
    assert constraints.scene_length(scene(body("b", 3.0, 4.0, 0.0), joint=(hinge(),))) == 5.0
    assert constraints.scene_length(scene(body("b", 3.0, 4.0, 0.0), joint=(bar,))) == math.hypot(5.0, 6.0)
    assert constraints.scene_length(scene(body("a", 1.0, 0.0, 0.0), body("b", 1.0, 0.0, 7.0))) == 7.0


@pytest.mark.parametrize(
    ("parts", "more", "length"),
    [
        ({}, {}, 0.5),
        ({"velocity": (3.0, 4.0, 0.0)}, {"duration": 2.0}, 10.0),
        ({}, {"gravity": (0.0, -6.0, 8.0), "duration": 2.0}, 20.0),
        ({"velocity": X}, {"gravity": (0.0, 0.0, 3.0), "duration": 2.0}, 8.0),
        ({"velocity": (0.2, 0.0, 0.0)}, {}, 0.5),
        ({"mass": None, "inertia": None}, {}, 1.0),
        ({"mass": None, "inertia": None, "velocity": (0.0, 3.0, 0.0)}, {"duration": 0.5}, 1.5),
    ],
)
def test_the_length_of_one_point(parts, more, length):
    """The way v t + g t² / 2, or a radius of gyration: the root of 0.5 kg m² over 2 kg; else one."""
    assert constraints.scene_length(scene(body(**parts), **{"duration": 1.0, **more})) == pytest.approx(
        length
    )


# --- masses -----------------------------------------------------------------------------------------------


# --- rows -------------------------------------------------------------------------------------------------
PARTS = scene(
    body("b", 1.0, 0.0, 0.0),
    body("c", 3.0, 0.0, 0.0),
    joint=(
        hinge("A"),
        Spherical(name="S", bodies=("b", "c"), anchor=(2.0, 0.0, 0.0)),
        Cylindrical(name="C", bodies=("ground", "c"), anchor=O, axis=X),
        Translational(name="T", bodies=("b", "c"), anchor=O, axis=Y),
    ),
)
POSE = constraints.initial_poses(PARTS)


def test_joints_with_coordinates():
    still = np.zeros((2, 2, 3))
    poses = (np.stack([POSE[0]] * 2), np.stack([POSE[1]] * 2))
    found = constraints.joint_coordinates(PARTS, np.array([0.0, 1.0]), *poses, still)
    assert list(found) == ["A", "C", "T"] and all((x == np.zeros((2, 2))).all() for x in found.values())
    none = constraints.joint_coordinates(PARTS, np.zeros(0), still[:0], np.zeros((0, 2, 4)), still[:0])
    assert {name: x.shape for name, x in none.items()} == dict.fromkeys("ACT", (0, 2))
    rates = constraints.joint_rates(PARTS, *POSE, np.array([O, (2.0, 5.0, 0.0)]), np.array([(0, 0, 3.0), X]))
    assert list(rates) == ["A", "C", "T"]
    assert rates["A"] == pytest.approx([3.0, 0.0]) and rates["C"] == pytest.approx([1.0, 2.0])


def test_rows_of_velocities_and_their_right_sides():
    """A driven hinge: v + ω × (-r) = 0 and the spin about z is the driver's rate."""
    driven = scene(
        body("b", 2.0, 0.0, 0.0), joint=(hinge(),), driver=(Driver(joint="A", polynomial=(0, 3.0)),)
    )
    rows, right = constraints.jacobian(driven, 0.0, *constraints.initial_poses(driven))
    assert rows.shape == (6, 6) and right == pytest.approx([0.0] * 5 + [3.0])
    turning = np.array([0.0, 6.0, 0.0, 0.0, 0.0, 3.0])
    assert rows @ turning == pytest.approx(right)
    free, none = constraints.jacobian(scene(body()), 0.0, *constraints.initial_poses(scene(body())))
    assert free.shape == (0, 6) and none.shape == (0,)


def test_a_driver_moves_a_chain_with_the_least_energy():
    """2 T = 2 u² + (3 u + w)² + (u + w)² with w = 2 rad/s is least for u = -w / 3."""
    even = {"mass": 1.0, "inertia": (1.0, 1.0, 1.0)}
    chain = scene(
        body("a", 1.0, 0.0, 0.0, **even),
        body("b", 3.0, 0.0, 0.0, **even),
        joint=(hinge("A", "ground", "a"), hinge("B", "a", "b", anchor=(2.0, 0.0, 0.0))),
        driver=(Driver(joint="B", polynomial=(0, 2.0)),),
    )
    velocity, spin = constraints.initial_twists(chain)
    assert spin[:, 2] == pytest.approx([-2 / 3, 4 / 3]) and velocity[:, 1] == pytest.approx([-2 / 3, 0.0])


@pytest.mark.parametrize(("off", "is_refused"), [(0.06, True), (0.04, False)])
def test_given_velocities_that_miss_a_joint(off, is_refused):
    """Along the hinge's axis by a part of 3 m/s: 5 % of it is rounding."""
    thrown = scene(body("b", 2.0, 0.0, 0.0, velocity=(0.0, 3.0, 3.0 * off)), joint=(hinge(),))
    if is_refused:
        with pytest.raises(
            SceneError, match=r"joint\[0\] 'A': the given velocities contradict it: off by 0.18"
        ):
            constraints.initial_twists(thrown)
    else:
        assert constraints.initial_twists(thrown)[0][0] == pytest.approx([0.0, 3.0, 0.0])


# --- tables -----------------------------------------------------------------------------------------------
