"""The judge's joint equations / finite differences of themselves, and motions put into poses."""

import numpy as np
import pytest

from crosscheck.judge import constraints
from mbref import rotations
from mbref.scene import JOINT_TYPES, Body, Driver, Scene, SceneError, Sine, Spherical
from mbref.scenes import SCENES
from tests.crosscheck.truth_scenes import CLOSED

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
