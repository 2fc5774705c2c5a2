"""Torques of motors that replace the drivers of a tool: virtual work, replays, refusals, singular positions.

The 5R arm of examples has hinges A and E on the ground, and its tool at P, which drivers move along a circle.
"""

import functools
from pathlib import Path

import numpy as np
import pytest

import mbref
from crosscheck.conformance.mechanisms.random_scenes import mechanism
from crosscheck.judge.driver_forces import driver_forces
from crosscheck.judge.gauss_principle import rank
from mbref.cli.commands import main
from mbref.scene import Driver, Factor, Free, JointTorque, Scene
from tests.helpers import parts
from tests.helpers.changed_scenes import in_another_order, in_other_units
from tests.helpers.statics import DOWN, G, hinge

ARM = Path(__file__).parents[3] / "examples" / "five_bar_arm.toml"
INNER, OUTER, BASE, TOOL = 0.3, np.sqrt(0.08), 0.4, (0.2, 0.5)  # m
SQUARES = np.array([0.3, 0.2828427]) ** 2 / 12  # m², moments of inertia of the rods over their masses
MASSES = 1.0, 0.8  # kg, of an inner and an outer rod
RADIUS, SPEED, DURATION = 0.05, np.pi, 2.0  # m, rad/s, of the tool's circle; s
TIMES = np.linspace(0.0, DURATION, 7)
CLOSE = 1e-11  # of the largest torque or power


def cross(a: np.ndarray, b: np.ndarray) -> float:
    """Return a₁ b₂ - a₂ b₁."""
    return a[0] * b[1] - a[1] * b[0]


class Half:
    """The inner and outer rod on one side at a place p of the tool (2,), m, with its elbow to the left (1) or
    right (-1) of the way to the tool: angles, and their rates, which are linear in p'.

    The outer rod w = p - o - l u has a constant length; u is along the inner rod and n across it.
    """

    def __init__(self, base: float, side: int, p: np.ndarray):
        reach, toward = np.hypot(p[0] - base, p[1]), np.arctan2(p[1], p[0] - base)
        inner = np.arccos((INNER**2 + reach**2 - OUTER**2) / (2 * INNER * reach))
        self.angle = toward + side * inner
        self.u = np.array([np.cos(self.angle), np.sin(self.angle)])
        self.n = np.array([-self.u[1], self.u[0]])
        self.elbow = np.array([base, 0.0]) + INNER * self.u
        self.w = p - self.elbow

    def rates(self, v: np.ndarray) -> tuple[float, np.ndarray, float]:
        """Return the rate of the inner rod, w', and the rate of the outer rod, for the tool's velocity."""
        turn = self.w @ v / (INNER * (self.w @ self.n))
        moved = v - INNER * turn * self.n
        return turn, moved, cross(self.w, moved) / OUTER**2

    def virtual_work(self, v: np.ndarray, a: np.ndarray, e: np.ndarray) -> float:
        """Return Σ m (r'' - g)·δr + J φ'' δφ of both rods for the tool's motion and displacement e."""
        turn, moved, _ = self.rates(v)
        along = moved @ moved + self.w @ a + INNER * turn**2 * (self.w @ self.u)
        second = along / (INNER * (self.w @ self.n))
        curved = a - INNER * (second * self.n - turn**2 * self.u)  # w''
        bent = cross(self.w, curved) / OUTER**2
        by_inner, by_w, by_outer = self.rates(e)
        up = np.array([0.0, G])
        inner = INNER / 2 * (second * self.n - turn**2 * self.u) + up
        outer = a - curved / 2 + up
        of_inner = inner @ (INNER / 2 * by_inner * self.n) + SQUARES[0] * second * by_inner
        of_outer = outer @ (e - by_w / 2) + SQUARES[1] * bent * by_outer
        return MASSES[0] * of_inner + MASSES[1] * of_outer


def arm() -> Scene:
    """Return the arm with its drivers."""
    return Scene.from_file(ARM)


@functools.cache
def moved() -> mbref.Motion:
    """Return the motion of the tool along its circle."""
    return mbref.simulate(arm(), times=TIMES, rtol=1e-13)


def demand(t: float) -> tuple[np.ndarray, np.ndarray]:
    """Return derivatives (3, 2) of angles by the tool's place, and its force (2,) by d'Alembert."""
    s, c = np.sin(SPEED * t), np.cos(SPEED * t)
    p, v = np.array(TOOL) + RADIUS * np.array([s, c - 1]), RADIUS * SPEED * np.array([c, -s])
    a = -RADIUS * SPEED**2 * np.array([s, c])
    left, right = Half(0.0, 1, p), Half(BASE, -1, p)
    jacobian, force = np.zeros((3, 2)), np.zeros(2)
    for k, e in enumerate(np.eye(2)):
        (one, _, outer), (other, _, last) = left.rates(e), right.rates(e)
        jacobian[:, k] = one, other, last - outer
        force[k] = left.virtual_work(v, a, e) + right.virtual_work(v, a, e)
    return jacobian, force


@pytest.mark.parametrize("motors", [("A", "E"), ("E", "A"), ("A", "P"), ("A", "E", "P")])
def test_torques_of_the_arm_do_the_virtual_work_that_its_tool_needs(motors):
    """Jᵀ τ = F with the angles' derivatives J by the tool's place. Three motors for two freedoms have the
    least Σ τ² and are ``open``: their torques are not determined."""
    found = mbref.inverse_dynamics(moved(), motors).motors
    rows = [("A", "E", "P").index(name) for name in motors]
    exact = np.array([np.linalg.pinv(j[rows].T) @ f for j, f in map(demand, TIMES)])
    torques = np.array([found[name].torque for name in motors]).T
    assert np.abs(torques - exact).max() < CLOSE * np.abs(exact).max()
    assert all((found[name].open == (len(motors) > 2)).all() and found[name].force is None for name in motors)


def test_powers_of_motors_are_the_powers_of_the_drivers_that_they_replace():
    """Powers are compared as sums, also of three motors; motors at the drivers' joints have their forces."""
    motion = moved()
    drives = [motion.driver(name) for name in ("tool x", "tool y")]
    total = sum(drive.power for drive in drives)
    for motors in (("A", "E"), ("B", "D"), ("A", "E", "P"), ("tool x", "A")):
        powers = sum(each.power for each in mbref.inverse_dynamics(motion, motors).motors.values())
        assert np.abs(powers - total).max() < CLOSE * np.abs(total).max(), motors
    own = mbref.inverse_dynamics(motion, ["tool x", "tool y"]).motors
    for drive in drives:
        assert own[drive.joint].force == pytest.approx(drive.force, rel=1e-11)


def test_torques_as_tables_move_the_free_arm_along_the_circle():
    """Tables of 401 rows of torques move the unstable arm for 0.5 s. The spline of a torque T sin(π t) at a
    distance h has an error of T (π h)⁴ / 384, about 2e-10 T; gravity magnifies it by 100. Limit: 1e-7 m."""
    times, dense = np.linspace(0.0, 0.5, 6), np.linspace(0.0, DURATION, 401)
    found = mbref.inverse_dynamics(mbref.simulate(arm(), times=dense, rtol=1e-13), ["A", "E"]).motors
    rows = {n: list(zip(dense.tolist(), m.torque.tolist(), strict=True)) for n, m in found.items()}
    loads = [JointTorque(joint=n, torque=1.0, factor=Factor(table=rows[n])) for n in rows]
    start = mbref.simulate(arm(), times=times, rtol=1e-13)
    free = mbref.simulate(start.scene_at(0.0).with_(driver=(), load=loads), times=times, rtol=1e-12)
    assert np.abs(free.position - start.position).max() < 1e-7


def test_torques_do_not_depend_on_units_and_order():
    """In units of half a kg, mm and 10 ms forces have other numbers, and the least norm is the same, also of
    motors with torques and a motor with a force. Reverse order of bodies, joints and drivers changes none."""
    motors = ["A", "E", "tool x"]
    mass, length, time = 2.0, 1e3, 100.0
    own = mbref.inverse_dynamics(moved(), motors).motors
    changed = in_other_units(arm(), mass, length, time)
    other = mbref.inverse_dynamics(mbref.simulate(changed, times=TIMES * time, rtol=1e-13), motors).motors
    torque, force = mass * length**2 / time**2, mass * length / time**2
    reverse = mbref.simulate(in_another_order(arm()), times=TIMES, rtol=1e-13)
    turned = mbref.inverse_dynamics(reverse, motors[::-1]).motors
    for name in ("A", "E"):
        assert other[name].torque == pytest.approx(torque * own[name].torque, rel=1e-9)
        assert turned[name].torque == pytest.approx(own[name].torque, rel=1e-9)
    assert other["tool x"].force == pytest.approx(force * own["tool x"].force, rel=1e-9)
    assert turned["tool x"].force == pytest.approx(own["tool x"].force, rel=1e-9)


def directions(scene: Scene, rng: np.random.Generator) -> list[Free]:
    """Return free joints in random directions at points of all bodies, six for each body."""
    pairs = [(body, k) for body in scene.body for k in range(6)]
    axes = rng.normal(size=(len(pairs), 3)).tolist()
    places = (rng.normal(size=(len(pairs), 3)) + [body.position for body, _ in pairs]).tolist()
    return [
        Free(name=f"{body.name} {k}", bodies=("ground", body.name), anchor=place, axis=axis)
        for (body, k), place, axis in zip(pairs, places, axes, strict=True)
    ]


@pytest.mark.parametrize("seed", [1, 3])
def test_forces_of_motors_of_random_mechanisms_are_those_of_the_judge(seed):
    """The judge computes forces of drivers at the motors' places, by its own equations, for the motion of
    mbref with another driver. Limit: 1e-9 of the largest force; random motors can be ill-conditioned."""
    base = mechanism(seed)
    rng = np.random.default_rng(seed)
    freedoms = mbref.counts(base.with_(driver=())).degrees_of_freedom
    free = directions(base, rng)
    scene = base.with_(joint=(*base.joint, *free))
    draws = (rng.permutation([joint.name for joint in free])[:freedoms].tolist() for _ in range(20))
    tried = ((names, scene.with_(driver=[Driver(joint=name) for name in names])) for names in draws)
    motors, replaced = next(each for each in tried if rank(each[1]) == 6 * len(scene.body))
    motion = mbref.simulate(scene, times=np.linspace(0.0, base.duration, 4), rtol=1e-12)
    found = mbref.inverse_dynamics(motion, motors).motors
    exact = driver_forces(replaced, motion)
    largest = max(np.abs(exact[name]).max() for name in motors)
    for name in motors:
        assert np.abs(found[name].force - exact[name]).max() < 1e-9 * largest


@pytest.mark.parametrize(
    ("name", "motors", "undecided"),
    [("planar_slider_crank", ["D"], [0.0, 1.0]), ("planar_slider_crank_equal", ["D", "A"], [0.5])],
)
def test_motors_of_a_driven_crank_are_undecided_at_singular_positions_only(name, motors, undecided):
    """The crank A turns by π rad/s. The slide D alone is at dead centres at 0 s and 1 s; a rod as long as the
    crank lies on it at 0.5 s. Elsewhere the sum of the powers is the crank's power."""
    driver = Driver(joint="A", polynomial=(0.0, np.pi))
    scene = mbref.find_scene(name).with_(gravity=DOWN, load=(), driver=[driver])
    times = np.array([0.0, 0.3, 0.5, 0.6, 1.0])
    motion = mbref.simulate(scene, times=times, rtol=1e-13)
    found, power = mbref.inverse_dynamics(motion, motors).motors, motion.driver("A").power
    regular = ~np.isin(times, undecided)
    for motor in found.values():
        assert (np.isnan(motor.amount) == ~regular).all()
    total = sum(motor.power for motor in found.values())
    assert total[regular] == pytest.approx(power[regular], rel=1e-9)


@pytest.mark.parametrize("times", [0.25 - np.geomspace(1e-4, 1e-7, 7), np.array([0.2499999, 0.25000001])])
@pytest.mark.parametrize("motor", "AD")
def test_motor_near_a_folded_crank_has_its_limit_or_is_undecided(motor, times):
    """The rod is as long as the crank A, which turns by 2 π rad/s and is upright at 0.25 s. Nearby the power
    is in proportion to the time left: met to 1e-3 up to 20 µs before, and NaN in the last half µs."""
    driver = Driver(joint="A", polynomial=(0.0, 2 * np.pi))
    scene = mbref.find_scene("planar_slider_crank_equal").with_(gravity=DOWN, load=(), driver=[driver])
    slope = mbref.simulate(scene, times=[0.249], rtol=1e-13).driver("A").power[0] / 0.001  # W/s
    motion = mbref.simulate(scene, times=times, rtol=1e-13)
    power = mbref.inverse_dynamics(motion, [motor]).motors[motor].power
    decided = ~np.isnan(power)
    assert power[decided] == pytest.approx(slope * (0.25 - times[decided]), rel=1e-3)
    assert decided[times < 0.25 - 2e-5].all() and not decided[times > 0.25 - 5e-7].any()


def geared_sled() -> Scene:
    """Return a rod geared to a wheel with an offset of 0.6 rad, and a sled driven along it (tip)."""
    rod, wheel, sled = (
        {"name": name, "mass": 1.0, "inertia": [0.1] * 3, "position": [x, 0.0, 0.0]}
        for name, x in (("rod", 0.5), ("wheel", 3.0), ("sled", 0.8))
    )
    path = {"polynomial": [0.0, 0.1, 0.2]}
    joints = [
        hinge("A", ("ground", "rod")),
        hinge("W", ("ground", "wheel"), (3.0, 0.0, 0.0)),
        parts.slide("S", "rod", "sled", (0.8, 0.0, 0.0), (1.0, 0.0, 0.0)),
    ]
    gears = {"name": "gears", "joints": ["W", "A"], "ratio": 1.0, "offset": 0.6}
    tip = {"name": "tip", "body": "sled", "point": [0.8, 0.0, 0.0], "along": [1.0, 0.0, 0.0], **path}
    given = {"body": [rod, wheel, sled], "joint": joints, "coupling": [gears]}
    return Scene(name="sled", gravity=DOWN, duration=0.5, driver=[{"joint": "W", **path}, tip], **given)


def test_motors_move_a_rod_and_sled_that_an_offset_turns_at_the_start_by_newtons_equations():
    """The force of S is m (r'' - g) of the sled along the rod. The torque of A about the origin is that of
    rod and sled, Σ (r × m (r'' - g) + J ω'), and J ω' of the wheel, which turns with the rod."""
    motion = mbref.simulate(geared_sled(), times=[0.0, 0.2, 0.4], rtol=1e-12)
    found = mbref.inverse_dynamics(motion, ["A", "S"]).motors
    bodies = [motion["rod"], motion["sled"]]
    lift = [body.acceleration[:, :2] + [0.0, G] for body in bodies]
    turning = sum(motion[name].angular_acceleration[:, 2] for name in ("rod", "sled", "wheel"))
    moments = (cross(b.position[:, :2].T, a.T) for b, a in zip(bodies, lift, strict=True))
    along = bodies[0].position[:, :2] / 0.5
    assert found["S"].force == pytest.approx((along * lift[1]).sum(axis=1), rel=1e-9)
    assert found["A"].torque == pytest.approx(sum(moments) + 0.1 * turning, rel=1e-9)


def test_hand_of_a_gram_on_an_arm_of_a_hundred_kilograms_needs_its_own_motor():
    """The hand's driver exerts 5e-5 N m, a ten-millionth of the arm's torque; the hand would swing freely."""
    arm = {"name": "arm", "position": [0.5, 0.0, 0.0], "mass": 100.0, "inertia": [0.01, 8.3, 8.3]}
    hand = {"name": "hand", "position": [1.005, 0.0, 0.0], "mass": 1e-3, "inertia": [1e-9, 8e-9, 8e-9]}
    joints = [hinge("A", ("ground", "arm")), hinge("B", ("arm", "hand"), (1.0, 0.0, 0.0))]
    sines = {"A": (0.3, 3.0), "B": (0.5, 5.0)}
    drivers = [{"joint": n, "sine": {"amplitude": a, "frequency": f}} for n, (a, f) in sines.items()]
    scene = Scene(name="arm", gravity=DOWN, body=[arm, hand], joint=joints, driver=drivers)
    motion = mbref.simulate(scene, times=np.linspace(0.0, 1.0, 5))
    with pytest.raises(mbref.InputError, match="at rest hand can still move"):
        mbref.inverse_dynamics(motion, ["A"])


BARE = [body.model_copy(update={"mass": None, "inertia": None}) for body in arm().body]
RESTING = "left arm, right arm, right can still move: the motors hold 1 of 2 degrees of freedom"


@pytest.mark.parametrize(
    ("motors", "changes", "sentence"),
    [
        (["A"], {}, RESTING),
        (["A", "Q"], {}, "no joint 'Q'; joints: A, B, P, D, E, tool x, tool y"),
        (["A", "A"], {}, "needs at least one joint, and each joint once"),
        ("AE", {}, "needs a list of names, such as ['AE'], not a text"),
        (["A", "E"], {"driver": ()}, "no driver"),
        (["A", "E"], {"body": BARE}, "needs masses"),
    ],
)
def test_motors_that_cannot_cause_the_motion_are_refused(motors, changes, sentence):
    """One motor for two degrees of freedom; an unknown joint; a motor named twice; a text in place of a list;
    no drivers that motors could replace; no masses."""
    motion = mbref.simulate(arm().with_(**changes), times=[0.0, 0.01])
    with pytest.raises(mbref.InputError) as refusal:
        mbref.inverse_dynamics(motion, motors)
    assert sentence in str(refusal.value)


def test_command_writes_torques_of_motors_and_says_which_share_the_work(tmp_path, capsys):
    """Columns of a CSV file have the numbers of Python; JSON, which lacks them, is refused."""
    arm().save(tmp_path / "arm.toml")
    run = ["run", str(tmp_path / "arm.toml"), "--samples", "7", "--estimate", "no", "--motors"]
    out = str(tmp_path / "arm.csv")
    assert main([*run, "A", "E", "--columns", "motor(A).torque", "motor(E)", "--out", out]) == 0
    table = np.genfromtxt(out, delimiter=",", names=True, deletechars="")
    found = mbref.inverse_dynamics(moved(), ["A", "E"]).columns()
    for name in ("motor(A).torque", "motor(E).power"):
        assert table[name] == pytest.approx(found[name], rel=1e-8)
    capsys.readouterr()
    assert main([*run, "A", "E", "P"]) == 0
    shown = capsys.readouterr().out
    assert "motors A, E, P can replace each other; their torques have the least norm" in shown
    assert main([*run, "A", "E", "--json"]) == 2
    assert "--motors: JSON has no numbers of motors" in capsys.readouterr().err
