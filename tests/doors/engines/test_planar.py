"""Planar joints in seven engines, and in the judge's reference, against closed forms."""

import numpy as np
import pytest

import mbref
from crosscheck.engine import Setting, engine
from crosscheck.judge.reference.bound import differences
from crosscheck.judge.reference.reference import Reference, judged, runs
from mbref import rotations
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Body, Cylindrical, Driver, Planar, Revolute, Scene, SceneError, TorsionSpring
from mbref.scenes import SCENES
from tests.helpers.measured import MARGIN

FINE = {
    "mbref": Setting("alf-dual+projection", {"rtol": 1e-10}),
    "mujoco": Setting("tuned", {"step": 5e-4, "beta": 50.0, "hard": 1e-8}),
    "pinocchio": Setting("tuned", {"rtol": 1e-10, "min_step": 1e-4}),
    "exudyn": Setting("tuned", {"step": 1e-3}),
    "simbody": Setting("merson", {"accuracy": 1e-8}),
    "sundials": Setting("ggl", {"rtol": 1e-8}),
    "ondsel": Setting("kinematics", {"step": 1e-3}),
}
FREE = [name for name in FINE if name != "ondsel"]  # engines that move what is not driven
PACKAGES = {"simbody": "opensim", "sundials": "sksundae", "ondsel": "pyondsel"}
MEASURED = {  # largest error (m, rad), and of the block's reactions (N, N m)
    "mbref": (1.3e-12, 1.1e-12),
    "mujoco": (3e-9, 1.7e-13),
    "pinocchio": (3.3e-12, 2.8e-11),
    "exudyn": (9.9e-11, 4.6e-7),
    "simbody": (5.3e-9, 6.4e-8),
    "sundials": (1.4e-7, 7.6e-7),
    "ondsel": (3.3e-12, 0.0),
}
CLOSE = {name: MARGIN * measured[0] for name, measured in MEASURED.items()}  # allowed errors (m, rad)
AGREE, BOUND = 1e-15, 1e-12  # of the length: between formulations, and of the reference's bound

NORMAL = np.array([0.3, 0.9, -0.2]) / np.linalg.norm([0.3, 0.9, -0.2])
ALONG = np.cross(NORMAL, [1.0, 0.0, 0.0])
SPEED, RATE = 0.7, 4.0  # m/s along the plane, rad/s about its normal
PLACE, ANCHOR = np.array([0.1, 0.4, -0.2]), np.array([0.2, 0.25, 0.1])
MASS, INERTIA = 2.0, np.array([[0.02, 0.002, -0.001], [0.002, 0.03, 0.003], [-0.001, 0.003, 0.025]])
TURNED = rotations.from_vector(np.array([0.3, -0.5, 0.8]))
GRAVITY = np.array([0.5, -9.81, 1.0])
TIMES = np.linspace(0, 0.5, 6)
ORDERS = (("ground", "block"), ("block", "ground"))


def run_fine(name: str, scene: Scene, times: np.ndarray) -> Trajectory:
    pytest.importorskip(PACKAGES.get(name, name))
    run = engine(name).run(scene, times, FINE[name])
    assert run.outcome is Outcome.COMPLETED, f"{name}: {run.outcome.label} {run.message}"
    return run


def incline(bodies: tuple[str, str], joints: int = 1) -> Scene:
    """A block that slides on an inclined plane and spins about the normal, held off its centre of mass."""
    twist = {"velocity": SPEED * ALONG, "angular_velocity": RATE * NORMAL}
    block = Body(name="block", mass=MASS, inertia=INERTIA, position=PLACE, orientation=TURNED, **twist)
    given = {"bodies": bodies, "axis": NORMAL}
    planes = tuple(Planar(name=f"plane{k}", anchor=ANCHOR + k * ALONG, **given) for k in range(joints))
    return Scene(name="incline", gravity=GRAVITY, duration=0.5, body=(block,), joint=planes)


def exact_poses() -> tuple[np.ndarray, np.ndarray]:
    """Positions (k, 3) and orientations (k, 4): the fall along the plane, and a constant spin."""
    fall = GRAVITY - (GRAVITY @ NORMAL) * NORMAL
    position = PLACE + np.outer(TIMES, SPEED * ALONG) + np.outer(TIMES**2 / 2, fall)
    return position, rotations.multiply(rotations.from_vector(np.outer(RATE * TIMES, NORMAL)), TURNED)


def exact_wrenches(bodies: tuple[str, str]) -> np.ndarray:
    """Forces and moments (k, 6) on the second body at the anchor on it, by Newton's and Euler's equations."""
    position, orientation = exact_poses()
    turn = rotations.to_matrix(orientation)
    momentum = RATE * turn @ INERTIA @ np.swapaxes(turn, 1, 2) @ NORMAL
    force = np.broadcast_to(-MASS * (GRAVITY @ NORMAL) * NORMAL, position.shape)
    arm = ANCHOR - position
    if bodies[1] == "block":
        arm = rotations.rotate(orientation, rotations.rotate(rotations.conjugate(TURNED), ANCHOR - PLACE))
    moment = np.cross(RATE * NORMAL, momentum) - np.cross(arm, force)
    return np.hstack([force, moment]) * (1 if bodies[1] == "block" else -1)


def error(run: Trajectory) -> float:
    """Largest distance (m) or angle (rad) from the closed form."""
    position, orientation = exact_poses()
    turned = rotations.angle_between(run.orientation[:, 0], orientation).max()
    return float(max(np.abs(run.position[:, 0] - position).max(), turned))


@pytest.mark.parametrize("bodies", ORDERS, ids="-".join)
@pytest.mark.parametrize("name", FREE)
def test_block_on_an_incline_moves_and_reacts_as_its_closed_form(name: str, bodies: tuple[str, str]) -> None:
    """The centre falls along the plane, the block spins about the normal. The reaction is -m (g · n) n, of 18
    N, with the moment at the anchor by Euler's equations. Errors are at most ten times MEASURED."""
    run = run_fine(name, incline(bodies), TIMES)
    assert error(run) < CLOSE[name]
    assert np.abs(run.reactions["plane0"] - exact_wrenches(bodies)).max() < MARGIN * MEASURED[name][1]


@pytest.mark.parametrize("name", FREE)
def test_second_planar_joint_in_one_plane_changes_no_motion(name: str) -> None:
    """The second joint's three rows are redundant; the motion stays the closed form of the block on one
    plane, to ten times the engine's error on one plane (MEASURED)."""
    scene = incline(ORDERS[0], joints=2)
    assert mbref.counts(scene).redundant == 3
    assert error(run_fine(name, scene, TIMES)) < CLOSE[name]


def guided() -> tuple[Scene, Scene]:
    """A slider-crank of three hinges and a guide, and one with a plane as the guide. Of 18 coordinates one is
    free: of 3 · 5 + 5 rows 3 are redundant, and of 3 · 5 + 3 rows 1."""
    base = SCENES["planar_slider_crank_gravity"]()
    a, b, c, d = base.joint
    end = Revolute(name="C", bodies=c.bodies, anchor=c.anchor, axis=(0.0, 0.0, 1.0))
    plane = Planar(name="D", bodies=d.bodies, anchor=d.anchor, axis=(0.0, 1.0, 0.0))
    return base.with_(joint=(a, b, end, d)), base.with_(joint=(a, b, end, plane))


def at_rest(scene: Scene) -> tuple[Body, ...]:
    """The bodies, their velocities left to the driver."""
    return tuple(body.model_copy(update={"angular_velocity": None}) for body in scene.body)


def swash_plate(bodies: tuple[str, str]) -> tuple[Scene, np.ndarray]:
    """A driven inclined plate that lifts a pin beside it, and the heights (k,) of the pin."""
    inertia, slope, radius, rate = (0.01, 0.02, 0.03), 0.3, 0.5, 3.0
    foot = (radius, 0.0, 0.0)
    plate = Body(name="plate", mass=1.0, inertia=inertia, position=(0.0, 0.0, 0.0))
    pin = Body(name="pin", mass=1.0, inertia=inertia, position=(radius, 0.0, 0.2))
    joints = (
        Revolute(name="A", bodies=("ground", "plate"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0)),
        Cylindrical(name="B", bodies=("ground", "pin"), anchor=foot, axis=(0.0, 0.0, 1.0)),
        Planar(name="P", bodies=bodies, anchor=foot, axis=(slope, 0.0, 1.0)),
    )
    driver = Driver(joint="A", polynomial=(0.0, rate))
    scene = Scene(name="swash_plate", duration=1.0, body=(plate, pin), joint=joints, driver=(driver,))
    return scene, 0.2 + slope * radius * (1 - np.cos(rate * TIMES))


@pytest.mark.parametrize("bodies", [("plate", "pin"), ("pin", "plate")], ids="-".join)
@pytest.mark.parametrize("name", FINE)
def test_swash_plate_lifts_a_pin_as_its_closed_form(name: str, bodies: tuple[str, str]) -> None:
    """z = 0.2 m + 0.3 · 0.5 m · (1 - cos ω t) with ω = 3 rad/s, slope 0.3 and the pin 0.5 m off the axis. The
    error is at most ten times the engine's in MEASURED."""
    scene, heights = swash_plate(bodies)
    assert np.abs(run_fine(name, scene, TIMES).position[:, 1, 2] - heights).max() < CLOSE[name]


def test_ondsel_s_accelerations_of_a_plane_between_moving_bodies_are_left_out() -> None:
    """OndselSolver's values are wrong there, and left out; with a plane of the ground they are given."""
    scene, _ = swash_plate(("plate", "pin"))
    grounded = guided()[1]
    driven = grounded.with_(body=at_rest(grounded), driver=(Driver(joint="A", polynomial=(0.0, 30.0)),))
    assert run_fine("ondsel", scene, TIMES[:2]).acceleration is None
    assert run_fine("ondsel", driven, np.array([0.0, 0.1])).acceleration is not None


def referred(scene: Scene) -> Reference:
    """The reference at TIMES, of formulations A and B that differ by less than AGREE, with its bound."""
    a, second, b = runs(scene, TIMES, 60.0)
    assert differences(scene, a, b).max() < AGREE, f"A and B differ by {differences(scene, a, b).max():.1e}"
    found, reason = judged(scene, TIMES, a, second, b)
    assert not reason and found.both.all() and found.bound.max() <= BOUND
    return found


@pytest.mark.parametrize("joints", [1, 2])
@pytest.mark.parametrize("bodies", ORDERS, ids="-".join)
def test_reference_of_a_block_on_an_incline_is_the_closed_form(bodies: tuple[str, str], joints: int) -> None:
    """Off by at most its bound, up to 1e-12, also where a second joint closes a loop of formulation B."""
    found, (position, orientation) = referred(incline(bodies, joints)), exact_poses()
    allowed = found.bound.max()
    assert np.abs(found.position[:, 0] - position).max() <= allowed
    sign = np.sign((found.orientation[:, 0] * orientation).sum(axis=-1, keepdims=True))
    assert np.abs(found.orientation[:, 0] - sign * orientation).max() <= allowed


@pytest.mark.parametrize("bodies", [("plate", "pin"), ("pin", "plate")], ids="-".join)
def test_reference_of_a_swash_plate_is_the_closed_form(bodies: tuple[str, str]) -> None:
    """The pin is at z = 0.2 m + 0.3 · 0.5 m · (1 - cos 3 t), within the stated bound, at most 1e-12."""
    scene, heights = swash_plate(bodies)
    found = referred(scene)
    assert np.abs(found.position[:, 1, 2] - heights).max() <= found.bound.max()


def test_planar_joint_takes_no_torsion_spring() -> None:
    """The error names the part, the joint, its type and what is possible."""
    scene = incline(ORDERS[0])
    with pytest.raises(SceneError, match=r"load\[0\].joint: 'plane0' is planar; only .* torsion_spring"):
        scene.with_(load=(TorsionSpring(joint="plane0", stiffness=1.0),))
