"""Wheels that roll without slip, against closed forms, balances, invariances and Gauss's principle."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

import mbref
from crosscheck.engine import BUILT_IN, ON_REQUEST, OPTIONAL, engine
from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.judge.reference.reference import NoReference, reference
from crosscheck.judge.small_motions.equilibria import steady_poses
from crosscheck.judge.state_derivatives import bounded_derivatives
from crosscheck.judge.truth import closed_form
from crosscheck.judge.violations import violation_series
from crosscheck.recorded.judgement import judge_motion
from mbref import Outcome, formats, rotations
from mbref.scene import Scene, SceneError
from tests.helpers.parts import X, Y, Z, hinge, joint, slide

EXAMPLE = Path(__file__).parents[3] / "examples" / "rolling_disc.toml"
METHODS = ("alf-dual+projection", "lm1+projection", "lm1+none", "mpi-svd+baumgarte", "lm1+partitioning")
R, MASS, G = 0.3, 2.0, 9.81  # m, kg, m/s²
AXIAL, ACROSS = MASS * R**2 / 2, MASS * R**2 / 4  # kg m², of a thin disc
TINY = 1e-5  # rad, of motions near an upright disc
TOP = (0.0, 0.0, R)
HUB, WHEEL, OWN = 1.5, 2.0, 0.08  # kg, kg, kg m²; a trolley
EFFECTIVE = HUB + WHEEL + OWN / R**2


def tread(name, plane, wheel, at, **fields):
    """Return a wheel of radius R on a horizontal plane."""
    return joint(name, "rolling", plane, wheel, at, **{"axis": Y, "normal": Z, "radius": R, **fields})


def disc(lean, spin):
    """Return a thin disc on the floor z = 0 whose axis encloses an angle (rad) with the vertical, with an
    angular velocity; its lowest point is the origin."""
    axis = np.array([np.sin(lean), 0.0, np.cos(lean)])
    up = np.array([-np.cos(lean), 0.0, np.sin(lean)])
    start = {"velocity": np.cross(spin, R * up).tolist(), "angular_velocity": list(spin)}
    start["orientation"] = rotations.from_vector(np.array([0.0, lean, 0.0])).tolist()
    body = {"name": "disc", "mass": MASS, "inertia": [ACROSS, ACROSS, AXIAL], "position": (R * up).tolist()}
    floor = tread("floor", "ground", "disc", (R * up).tolist(), axis=axis.tolist())
    return Scene(name="disc", gravity=(0.0, 0.0, -G), body=[body | start], joint=[floor])


def trolley(*more, speed=None, body=(), **parts):
    """Return a hub on a slide along x, with a wheel on a rail below it, and more joints and bodies."""
    along = {"stop": parts.pop("stop")} if "stop" in parts else {}
    start = {} if speed is None else {"velocity": [speed, 0.0, 0.0]}
    hub = {"name": "hub", "mass": HUB, "inertia": [0.1, 0.1, 0.1], "position": TOP, **start}
    wheel = {"name": "wheel", "mass": WHEEL, "inertia": [0.05, OWN, 0.05], "position": TOP, **start}
    rail = {**tread("rail", "ground", "wheel", TOP), "type": "rolling_line", "along": X}
    joints = [slide("track", "ground", "hub", TOP, **along), hinge("axle", "hub", "wheel", TOP, Y), rail]
    return Scene(name="trolley", body=[hub, wheel, *body], joint=[*joints, *more], **parts)


def cart(turning):
    """Return a cart on two wheels of one axle that turns about the vertical (rad/s) about its middle; a
    planar joint without friction holds it level."""
    track, back = 0.5, 0.2
    chassis = {"name": "chassis", "mass": 5.0, "inertia": [0.2, 0.3, 0.4], "position": [back, 0.0, R]}
    chassis |= {"velocity": [0.0, turning * back, 0.0], "angular_velocity": [0.0, 0.0, turning]}
    bodies, joints = [chassis], [joint("level", "planar", "ground", "chassis", (back, 0.0, R), axis=Z)]
    for side, y in (("left", track), ("right", -track)):
        spin = {"velocity": [-turning * y, 0.0, 0.0], "angular_velocity": [0.0, -turning * y / R, turning]}
        place, inertia = (0.0, y, R), [0.0225, 0.045, 0.0225]
        bodies.append({"name": side, "mass": 1.0, "inertia": inertia, "position": place, **spin})
        joints.append(hinge(f"{side} hinge", "chassis", side, place, Y))
        joints.append(tread(f"{side} tread", "ground", side, place))
    return Scene(name="cart", body=bodies, joint=joints)


WOBBLING, TIMES = disc(0.9, np.array([0.4, 1.1, 6.0])), np.linspace(0.0, 1.0, 11)


@pytest.fixture(scope="module")
def wobbling():
    """The motion of a disc without symmetry in its start."""
    return mbref.simulate(WOBBLING, times=TIMES, rtol=1e-11)


@pytest.mark.parametrize("method", METHODS)
def test_leaning_disc_of_the_example_rolls_on_its_circle_by_five_methods(method):
    """By Newton and Euler, a thin disc whose axis has the cosine c and sine s from the vertical turns
    steadily at Ω if its centre is on a circle of ρ = c (g - r Ω² s / 4) / (3/2 Ω² s); met to ten rtol (m)."""
    motion = mbref.simulate(EXAMPLE, method, times=[0.0, 0.5, 1.0], rtol=1e-10)
    assert motion.outcome is Outcome.COMPLETED, motion.message
    r, c, s, rate = 0.15, 0.28, 0.96, 2.5  # m and rad/s; values of the file
    path, turned = c * (G - r * rate**2 * s / 4) / (1.5 * rate**2 * s), rate * motion.times
    circle = [path * (np.cos(turned) - 1) - r * c, path * np.sin(turned), r * s + 0 * turned]
    assert np.abs(motion.position[:, 0] - np.transpose(circle)).max() < 1e-9


@pytest.mark.parametrize("spin", [0.0, 2.0, 9.0])
def test_upright_disc_falls_or_oscillates_as_routh_says(spin):
    """The lean θ obeys (A + m R²) θ'' = m g R θ - k (θ - θ0), k = C (C + m R²) n² / A for the spin n, to 1e-6
    of itself, as it is small (TINY): above √(g / 3 R) = 3.3 rad/s it oscillates."""
    start = disc(np.pi / 2 - TINY, spin * np.array([np.cos(TINY), 0.0, np.sin(TINY)]))
    motion = mbref.simulate(start, times=(times := np.linspace(0.0, 0.6, 7)), rtol=1e-12)
    stiff = AXIAL * (AXIAL + MASS * R**2) * spin**2 / ACROSS - MASS * G * R
    middle = (1 + MASS * G * R / stiff) * TINY
    swing = np.cos(np.sqrt(complex(stiff / (ACROSS + MASS * R**2))) * times).real
    lean = np.arcsin(rotations.rotate(motion.orientation[:, 0], np.array(Z))[:, 2])
    assert lean == pytest.approx(middle + (TINY - middle) * swing, rel=1e-6)


@pytest.mark.parametrize("share", [0.5, 0.4, 1.0], ids=["disc", "ball", "hoop"])
def test_wheel_rolls_down_an_incline(share):
    """With I = share · m R² about its axis, the wheel rolls by x = ½ g sin α t² / (1 + share), to ten rtol,
    and the friction -m g sin α share / (1 + share) accelerates its spin."""
    wheel = {"name": "wheel", "mass": MASS, "inertia": [share * MASS * R**2] * 3, "position": TOP}
    pull = (G * np.sin(0.4), 0.0, -G * np.cos(0.4))
    scene = Scene(name="slope", gravity=pull, body=[wheel], joint=[tread("slope", "ground", "wheel", TOP)])
    motion = mbref.simulate(scene, times=[0.0, 0.5, 1.0], rtol=1e-11)
    assert motion.position[1:, 0, 0] * (1 + share) == pytest.approx([pull[0] / 8, pull[0] / 2], rel=1e-10)
    assert motion.reactions["slope"][:, 0] * (1 + share) == pytest.approx(-MASS * pull[0] * share, rel=1e-10)


@pytest.mark.parametrize(
    ("method", "turning", "rtol"),
    [
        *(
            (each, 3.0, 1e-10)
            for each in ("alf-dual+projection", "mpi-svd+projection", "mpi-qr+partitioning")
        ),
        ("mpi-qr+partitioning/adams", 20.0, 1e-9),
    ],
)
def test_cart_turns_as_chaplygins_sleigh(method, turning, rtol):
    """With the effective mass A, inertia B about the axle's middle and k = m b of the chassis behind it, A u'
    = k Ω², B Ω' = -k u Ω: u = c tanh(s) / √A, Ω = c / (√B cosh(s)), s' = k c / (B √A), to 100 rtol. Contacts
    and the axle's lateral rows are redundant three times."""
    scene = cart(turning)
    assert (mbref.counts(scene).redundant, mbref.counts(scene).degrees_of_freedom) == (3, 2)
    mass = 5.0 + 2 * (1.0 + 0.045 / R**2)
    inertia = 0.4 + 5.0 * 0.2**2 + 2 * (0.0225 + 0.5**2 + 0.045 * 0.5**2 / R**2)
    pace = 5.0 * 0.2 * turning / np.sqrt(inertia * mass)
    motion = mbref.simulate(scene, method, times=np.linspace(0.0, 1.0, 5), rtol=rtol)
    assert motion.outcome is Outcome.COMPLETED, motion.message
    s = pace * motion.times
    assert motion.angular_velocity[:, 0, 2] == pytest.approx(turning / np.cosh(s), rel=100 * rtol)
    heading = 2 * np.arctan2(motion.orientation[:, 0, 3], motion.orientation[:, 0, 0])
    assert heading == pytest.approx(turning / pace * 2 * np.arctan(np.tanh(s / 2)), rel=100 * rtol)
    way = np.sqrt(inertia / mass) * turning / pace * np.log(np.cosh(s)) - 0.5 * heading
    assert motion.joint("left hinge").angle == pytest.approx(way / R, abs=100 * rtol)
    speed = np.linalg.norm((motion.velocity[:, 1] + motion.velocity[:, 2]) / 2, axis=1)
    assert speed == pytest.approx(np.sqrt(inertia / mass) * turning * np.tanh(s), abs=100 * rtol)


def test_board_on_a_fixed_log_keeps_its_energy():
    """The wheel may be of the ground: a board without thickness touches the log at R θ from its centre, on an
    involute, E = ½ (I + m R² θ²) θ'² + m g R (cos θ + θ sin θ). Errors are rtol, and ten rtol (m)."""
    start = {"angular_velocity": [0.0, 0.9, 0.0]}
    board = {"name": "board", "mass": 2.0, "inertia": [0.1, 0.5, 0.5], "position": [0.0, 0.0, 0.0], **start}
    log = tread("log", "board", "ground", (0.0, 0.0, -R), normal=(0.0, 0.0, -1.0))
    upright = joint("upright", "planar", "ground", "board", axis=Y)
    scene = Scene(name="board", gravity=(0.0, 0.0, -G), body=[board], joint=[log, upright])
    assert mbref.idle_freedoms(scene) == ["board can roll and moves nothing else"]
    board["angular_velocity"] = [0.0, 0.0, 0.9]
    flat = Scene(name="flat", body=[board], joint=[log, joint("table", "planar", "ground", "board", axis=Z)])
    assert "board can turn about the normal of a contact" in mbref.idle_freedoms(flat)[0]
    motion = mbref.simulate(scene, times=TIMES, rtol=1e-11)
    lean = 2 * np.arctan2(motion.orientation[:, 0, 2], motion.orientation[:, 0, 0])
    kinetic = (0.5 + 2.0 * R**2 * lean**2) * motion.angular_velocity[:, 0, 1] ** 2 / 2
    energy = kinetic + 2.0 * G * R * (np.cos(lean) + lean * np.sin(lean))
    assert np.ptp(energy) < 1e-11 * energy[0] and np.ptp(lean) > 0.3
    assert motion.position[:, 0, 0] == pytest.approx(R * (np.sin(lean) - lean * np.cos(lean)), abs=1e-10)


def test_wheel_adds_the_inertia_of_its_turn_to_a_spring_a_motor_a_stop_and_a_latch():
    """The mass m = m1 + m2 + I/R² swings on a spring and bounces with e = 0.5; its driver has the force m
    x'', and a motor of its axle this times R. A block of 3 kg that a bar takes hold of shares its momentum. A
    rope tears at 0.5 s, by 10 t = 5 N; then x'' = 10 t / m leads to 5/6 N s² / m at 1 s."""
    spring = {"type": "slide_spring", "joint": "track", "stiffness": 200.0, "damping": 0.0}
    rate = np.sqrt(200.0 / EFFECTIVE)
    swing = mbref.simulate(trolley(speed=0.5, load=[spring]), times=TIMES, rtol=1e-11)
    assert swing.position[:, 0, 0] == pytest.approx(0.5 / rate * np.sin(rate * TIMES), abs=1e-11)
    driven = trolley(driver=[{"joint": "track", "polynomial": [0.0, 0.3, 0.2]}])
    motion, force = mbref.simulate(driven, times=[0.0, 1.0]), 0.4 * EFFECTIVE  # N, with x'' = 2 · 0.2 m/s²
    assert mbref.inverse_dynamics(motion, ["track"]).motors["track"].force == pytest.approx(force, 1e-12)
    assert mbref.inverse_dynamics(motion, ["axle"]).motors["axle"].torque == pytest.approx(force * R, 1e-12)
    bounce = mbref.simulate(trolley(speed=0.8, stop={"upper": 0.4, "restitution": 0.5}), times=[0.4, 0.6])
    speeds = bounce.velocity[:, 0, 0], bounce.angular_velocity[:, 1, 1] * R  # m/s, of hub and rim
    assert np.abs(np.array(speeds) - [0.8, -0.4]).max() < 1e-12
    block = {"name": "block", "mass": 3.0, "inertia": [1.0, 1.0, 1.0], "position": [1.0, 0.0, R]}
    bar = joint("bar", "distance", "hub", "block", anchors=[TOP, (1.0, 0.0, R)], active=[[0.4, 2.0]])
    way = slide("way", "ground", "block", (1.0, 0.0, R))
    held = trolley(way, {**bar, "engages": "anywhere"}, body=[block], speed=0.8)
    caught = mbref.simulate(held, times=[0.2, 0.6]).velocity[:, 0, 0]
    assert caught == pytest.approx([0.8, 0.8 * EFFECTIVE / (EFFECTIVE + 3.0)], rel=1e-12)
    rope = joint("rope", "distance", "ground", "hub", anchors=[(-1.0, 0.0, R), TOP], release={"force": 5.0})
    pull = {"type": "force", "body": "hub", "point": TOP, "force": X, "factor": {"polynomial": [0.0, 10.0]}}
    torn = mbref.simulate(trolley(rope, load=[pull]), times=[0.4, 1.0]).position[:, 0, 0]
    assert torn == pytest.approx([0.0, 5.0 / 6.0 / EFFECTIVE], abs=1e-9)


def test_wheel_on_a_plank_that_swings_in_space_follows_gauss_s_principle():
    """The judge integrates its equations at 1e-10; positions agree to ten, accelerations to 1000 of this."""
    plank = {"name": "plank", "mass": 4.0, "inertia": [0.2, 1.0, 1.1], "position": [0.1, 0.0, -0.2]}
    wheel = {"name": "wheel", "mass": 2.0, "inertia": [0.045, 0.09, 0.05], "position": [0.1, 0.1, R]}
    plank["angular_velocity"], axis = [0.7, -0.4, 0.5], [0.2, 1.0, 0.1]
    rolls = tread("tread", "plank", "wheel", (0.1, 0.1, R), axis=axis, normal=(0.1, 0.0, 1.0))
    joints = [joint("pin", "spherical", "ground", "plank"), rolls]
    scene = Scene(name="plank", gravity=(0.0, 0.0, -G), body=[plank, wheel], joint=joints)
    exact = gauss_motion(scene, (0.0, 0.1, 0.2))
    for method in (None, "lm1+partitioning", "mpi-svd+baumgarte"):
        motion = mbref.simulate(scene, method, times=exact.times, rtol=1e-11)
        assert np.abs(motion.position - exact.position).max() < 1e-9, method
        assert motion.acceleration == pytest.approx(exact.acceleration, abs=1e-7), method


def test_reaction_has_no_power_and_accelerates_the_disc(wobbling):
    """The force acts at the lowest point, which is at rest: F = m (a - g) to 1e-9 N, without power to rtol,
    and the energy is constant to 1e-8 J. Violations are rounding at each level."""
    force, moment = np.split(wobbling.reactions["floor"], 2, axis=1)
    assert force == pytest.approx(MASS * (wobbling.acceleration[:, 0] + np.array([0.0, 0.0, G])), abs=1e-9)
    power = (force * wobbling.velocity[:, 0] + moment * wobbling.angular_velocity[:, 0]).sum(axis=1)
    assert np.abs(power).max() < 1e-11 * np.abs(force).max()
    assert np.ptp(wobbling.columns()["energy"]) < 1e-8
    for level, size in enumerate((1e-14, 1e-13, 1e-11)):
        assert np.abs(violation_series(WOBBLING, wobbling, level)).max() < size, level


@pytest.mark.parametrize(
    ("change", "method"),
    [*((each, None) for each in ("turned", "millimetres", "later")), ("millimetres", "lm1+partitioning")],
)
def test_motion_does_not_depend_on_frame_units_and_start(wobbling, change, method):
    """Turned and moved, in millimetres and tonnes, or from half time on, the disc moves alike to 100 rtol."""
    turn, shift, size, begin = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), 1.0, 0
    (body,), (floor,) = WOBBLING.to_dict()["body"], WOBBLING.to_dict()["joint"]
    if change == "turned":
        turn, shift = rotations.from_vector(np.array([0.4, -1.1, 0.7])), np.array([0.3, -2.0, 0.5])
    if change == "millimetres":
        size = 1e3
        body |= {"mass": MASS / size, "inertia": [size * x for x in body["inertia"]]}
        floor["radius"] *= size

    def moved(vector, by=0.0, scale=1.0):
        return (rotations.rotate(turn, np.array(vector) * scale) + by).tolist()

    body |= {"position": moved(body["position"], shift, size), "velocity": moved(body["velocity"], 0.0, size)}
    body["angular_velocity"] = moved(body["angular_velocity"])
    body["orientation"] = rotations.multiply(turn, np.array(body["orientation"])).tolist()
    floor |= {"axis": moved(floor["axis"]), "normal": moved(floor["normal"])}
    floor["anchor"] = moved(floor["anchor"], shift, size)
    gravity = moved(WOBBLING.gravity, 0.0, size)
    scene = Scene(name="other", gravity=gravity, body=[body], joint=[floor])
    if change == "later":
        scene, begin = wobbling.scene_at(0.5), 5
    motion = mbref.simulate(scene, method, times=TIMES[begin:] - TIMES[begin], rtol=1e-11)
    expected = rotations.rotate(turn, wobbling.position[begin:, 0] * size) + shift
    assert np.abs(motion.position[:, 0] - expected).max() < 1e-9 * size


def test_run_ends_where_a_wheel_lies_flat_has_to_slip_or_is_at_a_singular_position():
    """A disc at rest at θ = 1.2 rad falls by (A + m R²) θ'² / 2 = m g R (sin 1.2 - sin θ) until it is flat. A
    driver turns an axle faster than another one moves its hub. A crank and a rod in line push a hub."""
    motion = mbref.simulate(disc(1.2, np.zeros(3)), times=[0.0, 0.4, 1.0])
    assert motion.outcome is not Outcome.COMPLETED and len(motion.times) == 2
    pace = np.sqrt(2 * MASS * G * R / (ACROSS + MASS * R**2))  # 1/s
    fall, _ = quad(lambda lean: 1 / (pace * np.sqrt(np.sin(1.2) - np.sin(lean))), 0.0, 1.2)
    assert f"the wheel of joint 'floor' lies flat on its plane, at t = {fall:.6g} s" in motion.message
    paths = {"track": [0.0, 0.3], "axle": [0.0, 1.0, 0.0, 0.2]}
    drivers = [{"joint": joint, "polynomial": path} for joint, path in paths.items()]
    for method, why in (
        ("mpi-svd+projection", "the wheel of joint 'rail' has to slip at t = 0.01 s"),
        ("mpi-svd+partitioning", "the rate of joint 'axle' contradicts a wheel that does not slip"),
        ("mpi-svd+baumgarte", "contradicts a wheel that does not slip"),
    ):
        motion = mbref.simulate(trolley(driver=drivers), method, times=[0.0, 0.5, 1.0])
        assert motion.outcome is Outcome.VIOLATION and why in motion.message, motion.message
        drivers[1]["polynomial"][3] = 1e-3  # rad/s³; then the rates differ by 2e-3
    bar = {"mass": 1.0, "inertia": [0.1, 0.1, 0.1]}
    links = [{"name": n, "position": [x, 0.0, R], **bar} for n, x in (("crank", -0.75), ("rod", -0.25))]
    links[0]["angular_velocity"] = [0.0, 0.0, 5.0]
    pins = [hinge("P", "ground", "crank", (-1.0, 0.0, R)), hinge("Q", "crank", "rod", (-0.5, 0.0, R))]
    motion = mbref.simulate(trolley(*pins, joint("S", "spherical", "rod", "hub", TOP), body=links))
    assert motion.outcome is Outcome.SINGULAR_POSITION
    assert motion.message.endswith("projection does not cross it")


def test_slip_flat_wheels_and_requests_that_need_positions_are_refused_with_the_joint():
    """Given velocities slip, a wheel lies flat, or a method or function needs constraints of positions."""
    slipping = trolley(speed=0.5).to_dict()
    slipping["body"][1]["angular_velocity"] = [0.0, 9.0, 0.0]
    with pytest.raises(SceneError, match=r"joint\[.*\]: velocities given to bodies violate it"):
        mbref.simulate(Scene(**slipping), times=[0.0])
    with pytest.raises(SceneError, match=r"joint\[floor\]: the wheel lies flat on its plane"):
        disc(0.0, np.zeros(3))
    with pytest.raises(mbref.MethodError, match=r"joint\[floor\].* no series; use alf-dual"):
        mbref.simulate(WOBBLING, "taylor")
    number = ["body[disc].mass"]
    for refusing in (
        lambda: mbref.equilibria(WOBBLING),
        lambda: mbref.sensitivities(WOBBLING, ["disc.position.x"], number),
        lambda: mbref.state_derivatives(WOBBLING),
        lambda: mbref.equilibrium_sensitivities(WOBBLING, ["disc.position.x"], number),
        lambda: mbref.eigenvalue_sensitivities(WOBBLING, number),
        lambda: mbref.synthesise(WOBBLING, number, least=["disc.position.x"]),
        lambda: mbref.fit(WOBBLING, {"time": TIMES, "disc.position.x": TIMES}, number),
    ):
        with pytest.raises(SceneError, match=r"joint\[floor\]: a wheel that rolls without slip"):
            refusing()


def test_other_engines_the_reference_the_judge_and_files_refuse_a_wheel_by_its_joint(tmp_path):
    """No engine but mbref knows wheels. No closed form of a free body is taken for the truth."""
    for name in sorted({*BUILT_IN, *OPTIONAL, *ON_REQUEST} - {"mbref"}):
        assert "'floor' is of type 'rolling'" in str(engine(name).cannot(WOBBLING)), name
    found = reference(WOBBLING, TIMES)
    assert isinstance(found, NoReference) and "the wheel of joint 'floor'" in found.reason
    assert closed_form(WOBBLING) is None
    table = {"time": TIMES, "disc.position.x": TIMES, "floor.force.z": TIMES}
    with pytest.raises(SceneError, match="disc: has no reference: the wheel of joint 'floor'"):
        judge_motion(WOBBLING, table)
    for refusing in (
        lambda: formats.write(WOBBLING, tmp_path / "disc.xml"),
        lambda: steady_poses(WOBBLING),
        lambda: bounded_derivatives(WOBBLING),
    ):
        with pytest.raises(SceneError, match=r"joint\[floor\]: a wheel that rolls without slip"):
            refusing()
