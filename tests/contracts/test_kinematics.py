"""The judge's lengths, start velocities, coordinates and counts of rows against sums by hand."""

import math
from typing import Any

import numpy as np
import pytest

from crosscheck.judge import constraints
from mbref import rotations
from mbref.scene import Body, Cylindrical, Distance, Driver, Revolute, Scene, SceneError
from mbref.scenes import SCENES
from tests.helpers.truth_scenes import CLOSED

AXIS = (0.3, -0.5, 0.8)
POINT = (0.2, 0.7, -0.4)
ROUNDED = 1e-14  # m or rad; some roundings of lengths up to 1.4 m


def tilted(*vector):
    return tuple(rotations.from_vector(np.array(vector)).tolist())


def on_a_cylinder(*bodies):
    """Return two bodies in general position, with a cylindrical joint on ``bodies``."""
    joint = Cylindrical(name="j", bodies=bodies, anchor=POINT, axis=AXIS)
    bodies = (
        Body(name="first", position=(0.1, 0.2, 0.3), orientation=tilted(0.4, -0.2, 0.9)),
        Body(name="second", position=(0.9, -0.4, 0.5), orientation=tilted(-0.7, 0.5, 0.1)),
    )
    return Scene(name="cylinder", body=bodies, joint=(joint,))


@pytest.mark.parametrize("name", CLOSED)
def test_initial_velocities_satisfy_joints_and_drivers_and_keep_given_angular_velocities(name):
    """Rates of the residuals of joints and drivers are below 4e-14, and changes of given angular velocities
    below 1e-13 of the largest spin of a body, or of 1 rad/s: rounding."""
    scene = SCENES[name]()
    velocity, spin = constraints.initial_twists(scene)
    rates = constraints.closure_rates(scene, 0.0, *constraints.initial_poses(scene), velocity, spin)
    worst, size = {joint: np.abs(r).max() for joint, r in rates.items()}, max(1.0, np.abs(spin).max())
    assert max(worst.values()) < 4 * ROUNDED * size, f"{name}: {worst}"
    given = [(spin[k], each.angular_velocity) for k, each in enumerate(scene.body) if each.angular_velocity]
    assert all(np.abs(found - wanted).max() < 10 * ROUNDED * size for found, wanted in given), given


def test_second_driver_of_a_four_bar_at_another_rate_is_refused():
    """Both cranks of a parallelogram turn at the driver's rate. A second driver that turns the other crank
    the other way, or 1 % faster, contradicts it; one at the driver's rate does not."""
    four_bar = SCENES["four_bar"]()
    rate = four_bar.driver[0].polynomial[1]
    right, reversed_one, faster = (
        four_bar.with_(driver=(*four_bar.driver, Driver(joint="D", polynomial=(0.0, other))))
        for other in (rate, -rate, 1.01 * rate)
    )
    constraints.initial_twists(right)
    for wrong in (reversed_one, faster):
        with pytest.raises(SceneError, match=r"joint\[\d\] '[ABCD]': drivers contradict it: off by"):
            constraints.initial_twists(wrong)


@pytest.mark.parametrize("order", [("ground", "second"), ("second", "ground")])
def test_coordinates_of_a_cylindrical_joint_count_its_full_turns(order):
    """A body turns about the axis by 9 t + 3 sin 4 t, up to 21 rad, and slides by 0.4 t². Both are found to
    1e-12, rounding of 21 rad; with the ground as second body they have the opposite sign."""
    given, times = on_a_cylinder(*order), np.linspace(0.0, 2.0, 81)
    angle, shift = 9.0 * times + 3 * np.sin(4 * times), 0.4 * times**2
    axis = np.array(AXIS) / np.linalg.norm(AXIS)
    turn = rotations.from_vector(angle[:, None] * axis)
    position, orientation = constraints.initial_poses(given)
    place = POINT + rotations.rotate(turn, position[1] - POINT) + shift[:, None] * axis
    poses = np.stack([np.broadcast_to(position[0], place.shape), place], axis=1)
    turned = rotations.multiply(turn, orientation[1])
    frames = np.stack([np.broadcast_to(orientation[0], turned.shape), turned], axis=1)
    spin = np.stack([0 * place, (9.0 + 12 * np.cos(4 * times))[:, None] * axis], axis=1)
    sign = 1 if order[0] == "ground" else -1
    found = constraints.joint_coordinates(given, times, poses, frames, spin)["j"]
    assert np.abs(found - sign * np.stack([angle, shift], axis=1)).max() < 100 * ROUNDED


O, X, Y, Z = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def body(name: str = "b", *place: float, **parts: Any) -> Body:
    given = {"mass": 2.0, "inertia": (0.5, 0.3, 0.2), "position": place or O, **parts}
    return Body(name=name, **given)


def scene(*bodies: Body, **parts: Any) -> Scene:
    return Scene(name="s", body=bodies, **{"gravity": O, **parts})


def hinge(name: str = "A", first: str = "ground", second: str = "b", **parts: Any) -> Revolute:
    return Revolute(name=name, bodies=(first, second), **{"anchor": O, "axis": Z, **parts})


def test_scene_length_is_the_largest_distance_of_anchors_and_centres():
    """Points (3, 4, 0) and the origin are 5 m apart; (3, 4, 0) and (0, 0, -6) √(5² + 6²) m; centres 7 m."""
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
    """The length is the larger of the way v t + g t² / 2 over the duration, of 1 s unless given, and the
    radius of gyration √(0.5 kg m² / 2 kg) = 0.5 m, which counts as 1 m for a body without mass."""
    assert constraints.scene_length(scene(body(**parts), **{"duration": 1, **more})) == pytest.approx(length)


JOINTS = (hinge("A"), Cylindrical(name="C", bodies=("ground", "c"), anchor=O, axis=X))
PARTS = scene(body("b", 1.0, 0.0, 0.0), body("c", 3.0, 0.0, 0.0), joint=JOINTS)
POSE = constraints.initial_poses(PARTS)


def test_joint_rates_are_spin_about_and_velocity_along_the_axis():
    """b spins at 3 rad/s about z, A's axis; c at 1 rad/s about x, C's axis, along which it moves at 2 m/s."""
    rates = constraints.joint_rates(PARTS, *POSE, np.array([O, (2.0, 5.0, 0.0)]), np.array([(0, 0, 3.0), X]))
    assert rates["A"] == pytest.approx([3.0, 0.0]) and rates["C"] == pytest.approx([1.0, 2.0])


def test_initial_velocity_off_a_hinge_is_rounded_up_to_five_percent_and_refused_above():
    """A body at 3 m/s has 4 or 6 % of this speed along the hinge's axis, 0.12 or 0.18 m/s, which the hinge
    forbids. Up to 5 % the judge takes for rounding."""
    moved = (body("b", 2.0, 0.0, 0.0, velocity=(0.0, 3.0, along)) for along in (0.12, 0.18))
    rounded, refused = (scene(each, joint=(hinge(),)) for each in moved)
    assert constraints.initial_twists(rounded)[0][0] == pytest.approx([0.0, 3.0, 0.0])
    with pytest.raises(SceneError, match=r"joint\[0\] 'A': the given velocities contradict it: off by 0.18"):
        constraints.initial_twists(refused)
