"""The judge's joint equations, lengths, start velocities and counts of rows / differences and sums by
hand."""

import math
from typing import Any

import numpy as np
import pytest

import mbref
from crosscheck.judge import constraints
from crosscheck.judge.mobility import mobility
from mbref import rotations
from mbref.scene import (
    GROUND,
    JOINT_TYPES,
    Body,
    Cylindrical,
    Distance,
    Driver,
    Revolute,
    Scene,
    SceneError,
    Sine,
    Spherical,
)
from mbref.scenes import SCENES
from tests.crosscheck.truth_scenes import CLOSED
from tests.helpers.coupled_mechanisms import coupled_loops, gear_pair, pendulum, screw

AXIS = (0.3, -0.5, 0.8)
SIDE = (0.8, 0.0, -0.3)  # perpendicular to AXIS
POINT = (0.2, 0.7, -0.4)
PAIR = ("first", "second")
# 6 minus the freedoms of the joint
ROWS = {"fixed": 6, "revolute": 5, "translational": 5, "universal": 4, "cylindrical": 4}
ROWS |= {"spherical": 3, "planar": 3, "inline": 2, "distance": 1}
ROUNDED = 1e-14  # m or rad; some roundings of lengths up to 1.4 m
H = 1e-5  # s, half the interval of central differences
SLOPE, SLOPE_OF_RATES = 4e-9, 2e-8  # ten times the errors of order H² measured, of Φ' and Φ''


def tilted(*vector):
    return tuple(rotations.from_vector(np.array(vector)).tolist())


def jointed(kind, bodies=PAIR, driver=()):
    """Two bodies in general position, and a joint of each type between them."""
    places = {"anchor": POINT, "anchors": (POINT, (1.0, 0.1, 0.3)), "axis": AXIS, "axes": (AXIS, SIDE)}
    joint = JOINT_TYPES[kind].at("j", bodies, **places)
    bodies = (
        Body(name="first", position=(0.1, 0.2, 0.3), orientation=tilted(0.4, -0.2, 0.9)),
        Body(name="second", position=(0.9, -0.4, 0.5), orientation=tilted(-0.7, 0.5, 0.1)),
    )
    return Scene(name=kind, body=bodies, joint=(joint,), driver=driver)


def constrained_motion(scene, seed):
    """Poses, twists and twist rates at t = 0 that satisfy the joints at velocity and acceleration level."""
    rng = np.random.default_rng(seed)
    pose = constraints.initial_poses(scene)
    j, b = constraints.jacobian(scene, 0.0, *pose)
    start = rng.normal(size=j.shape[1])
    twist = (start + np.linalg.pinv(j) @ (b - j @ start)).reshape(-1, 6)
    return (*pose, twist[:, :3], twist[:, 3:]), rng.normal(size=(2, len(scene.body), 3))


def moved(motion, rates, h):
    """The motion h seconds later, exact to second order in h."""
    position, orientation, velocity, spin = motion
    turn = rotations.from_vector(h * spin + h**2 / 2 * rates[1])
    later = rotations.multiply(turn, orientation)
    return position + h * velocity + h**2 / 2 * rates[0], later, velocity + h * rates[0], spin + h * rates[1]


DRIVERS = {
    "revolute": Driver(joint="j", polynomial=(0.0, 1.3, -0.7), sine=Sine(amplitude=0.4, frequency=2.0)),
    "cylindrical": Driver(joint="j", polynomial=(0.0, -2.1)),
    "translational": Driver(joint="j", polynomial=(0.0, 0.3, 0.5, 0.1)),
}
CASES = [*((kind, False) for kind in ROWS), *((kind, True) for kind in DRIVERS)]


@pytest.mark.parametrize("bodies", [PAIR, ("second", "ground")])
@pytest.mark.parametrize(("kind", "driven"), CASES)
def test_jacobian_is_finite_difference_of_closure(kind, bodies, driven):
    """J u - b is the central difference of Φ(q, t) along a random direction u, to 4e-9: ten times the
    measured error of order h², with h = 1e-5 s."""
    scene = jointed(kind, bodies, (DRIVERS[kind],) if driven else ())
    motion, rates = constrained_motion(scene, 3)
    j, b = constraints.jacobian(scene, 0.0, *motion[:2])
    direction = np.random.default_rng(5).normal(size=(len(scene.body), 6))
    ends = [moved((*motion[:2], direction[:, :3], direction[:, 3:]), 0 * rates, s * H)[:2] for s in (1, -1)]
    plus, minus = (constraints.closure(scene, s * H, *pose)["j"] for s, pose in ((1, ends[0]), (-1, ends[1])))
    difference, predicted = (plus - minus) / (2 * H), j @ direction.ravel() - b
    assert np.abs(difference - predicted).max() < SLOPE, f"{kind}: {difference} against {predicted}"


@pytest.mark.parametrize("bodies", [PAIR, ("ground", "second")])
@pytest.mark.parametrize(("kind", "driven"), CASES)
def test_acceleration_residual_is_finite_difference_of_velocity_residual(kind, bodies, driven):
    """Φ'' is the central difference of Φ' along a motion with random accelerations, to 2e-8: ten times the
    measured error of order h², with h = 1e-5 s."""
    scene = jointed(kind, bodies, (DRIVERS[kind],) if driven else ())
    motion, rates = constrained_motion(scene, 11)
    plus, minus = (
        constraints.closure_rates(scene, s * H, *moved(motion, rates, s * H))["j"] for s in (1, -1)
    )
    difference = (plus - minus) / (2 * H)
    residual = constraints.closure_accelerations(scene, 0.0, *motion, *rates)["j"]
    assert np.abs(difference - residual).max() < SLOPE_OF_RATES, f"{kind}: {difference} against {residual}"


@pytest.mark.parametrize("name", CLOSED)
def test_initial_velocities_satisfy_joints_and_drivers(name):
    """Rates of their residuals are below 4e-14 of the largest spin of a body, or of 1 rad/s: rounding."""
    scene = SCENES[name]()
    velocity, spin = constraints.initial_twists(scene)
    rates = constraints.closure_rates(scene, 0.0, *constraints.initial_poses(scene), velocity, spin)
    worst = {joint: np.abs(r).max() for joint, r in rates.items()}
    assert max(worst.values()) < 4 * ROUNDED * max(1.0, np.abs(spin).max()), f"{name}: {worst}"


@pytest.mark.parametrize("name", [n for n in CLOSED if SCENES[n]().body[0].angular_velocity is not None])
def test_initial_velocities_keep_given_angular_velocities(name):
    """Angular velocities of the scene file, which its joints allow, change by less than 1e-13 of the largest,
    or of 1 rad/s: rounding."""
    scene = SCENES[name]()
    _, spin = constraints.initial_twists(scene)
    given = {k: body.angular_velocity for k, body in enumerate(scene.body) if body.angular_velocity}
    change = np.abs(spin[list(given)] - list(given.values())).max()
    assert change < 10 * ROUNDED * max(1.0, np.abs(spin).max())


def test_initial_velocities_that_are_not_given_minimise_the_kinetic_energy():
    """The tip of a rod is given 1 m/s. An impulse p = 1 m/s / (1/m + r²/I) at the tip costs least energy: v =
    p / m and ω = p r / I, with m = 2 kg, I = 0.4 kg m² and the tip r = 0.5 m from the centre. The tip's own
    mass, 1e-9 kg, changes them by less than 1e-8."""
    rod = Body(name="rod", mass=2.0, inertia=(0.3, 0.3, 0.4), position=(0.5, 0.0, 0.0))
    tip = Body(name="tip", mass=1e-9, inertia=(1e-12,) * 3, position=(1, 0, 0), velocity=(0, 1, 0))
    ball = Spherical(name="ball", bodies=("rod", "tip"), anchor=(1.0, 0.0, 0.0))
    velocity, spin = constraints.initial_twists(Scene(name="pushed", body=(rod, tip), joint=(ball,)))
    impulse = 1 / (1 / 2.0 + 0.25 / 0.4)
    assert np.allclose(velocity[0], [0, impulse / 2, 0], atol=1e-8), f"{velocity[0]} against {impulse / 2}"
    assert np.allclose(spin[0], [0, 0, impulse * 0.5 / 0.4], atol=1e-8), f"{spin[0]} against {impulse * 1.25}"


def test_second_driver_of_a_four_bar_at_another_rate_is_refused():
    """A rhombus' other crank turns as the driven one, at -124.8 rad/s: reversed and 1 % faster contradict."""
    scene = SCENES["four_bar"]()
    for rate in (124.8, -124.8 * 1.01):
        second = Driver(joint="D", polynomial=(0.0, rate))
        with pytest.raises(SceneError, match=r"joint\[\d\] '[ABCD]': drivers contradict it: off by"):
            constraints.initial_twists(scene.with_(driver=(*scene.driver, second)))


@pytest.mark.parametrize("order", [("ground", "second"), ("second", "ground")])
def test_coordinates_of_a_cylindrical_joint_count_its_full_turns(order):
    """A body turns about its axis by 9 t + 3 sin 4 t, up to 21 rad, and slides by 0.4 t², up to 1.6 m. Both
    are found to 1e-12: rounding of 21 rad."""
    scene, times = jointed("cylindrical", order), np.linspace(0.0, 2.0, 81)
    angle, shift = 9.0 * times + 3 * np.sin(4 * times), 0.4 * times**2
    axis = np.array(AXIS) / np.linalg.norm(AXIS)
    turn = rotations.from_vector(angle[:, None] * axis)
    position, orientation = constraints.initial_poses(scene)
    place = POINT + rotations.rotate(turn, position[1] - POINT) + shift[:, None] * axis
    poses = np.stack([np.broadcast_to(position[0], place.shape), place], axis=1)
    turned = rotations.multiply(turn, orientation[1])
    frames = np.stack([np.broadcast_to(orientation[0], turned.shape), turned], axis=1)
    spin = np.stack([0 * place, (9.0 + 12 * np.cos(4 * times))[:, None] * axis], axis=1)
    sign = 1 if order[0] == "ground" else -1
    found = constraints.joint_coordinates(scene, times, poses, frames, spin)["j"]
    assert np.abs(found - sign * np.stack([angle, shift], axis=1)).max() < 100 * ROUNDED


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


@pytest.mark.parametrize("make", [gear_pair, screw, pendulum, coupled_loops])
def test_coupling_is_a_constraint_row_and_an_armature_is_none(make):
    """The judge's rows, redundant rows and freedoms are mbref's, except for rows of rotors: in mbref each
    armature is a hidden body with six coordinates and as many rows."""
    scene = make()
    counts, found = mbref.counts(scene), mobility(scene)
    rotors = sum(bool(joint.armature) for joint in scene.joint if hasattr(joint, "armature"))
    assert found.degrees_of_freedom == counts.degrees_of_freedom and found.redundant == counts.redundant
    assert found.rows == counts.rows - 6 * rotors


def test_mobility_of_four_small_scenes_is_as_counted_by_hand():
    """(rows, redundant rows, freedoms): a free body; a pendulum, by five rows; a boom that a rope holds; a
    hinge and its copy, whose five rows are redundant."""
    body = Body(name="rod", mass=1.0, inertia=(0.1, 0.1, 0.1), position=(1.0, 0.0, 0.0))
    free = Scene(name="free", body=[body])
    hinge = Revolute(name="A", bodies=(GROUND, "rod"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 1.0, 0.0))
    rope = Distance(name="rope", bodies=(GROUND, "rod"), anchors=((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)))
    assert mobility(free) == (0, 0, 6)
    assert mobility(free.with_(joint=[hinge])) == (5, 0, 1)
    assert mobility(free.with_(joint=[hinge, rope])) == (6, 0, 0)
    assert mobility(free.with_(joint=[hinge, hinge.model_copy(update={"name": "B"})])) == (10, 5, 1)
