"""Torques of motors that replace the drivers of a tool: virtual work, replays, refusals, singular positions.

A 5R arm in a vertical plane has hinges A and E on the ground, elbows B and D, and the tool at P, which
drivers move along a circle.
"""

import functools

import numpy as np
import pytest

import mbref
from crosscheck.conformance.mechanisms.random_scenes import mechanism
from crosscheck.judge.driver_forces import driver_forces
from crosscheck.judge.gauss_principle import rank
from mbref.cli.commands import main
from mbref.scene import Driver, Factor, Free, JointTorque, Scene
from tests.helpers.changed_scenes import in_another_order, in_other_units
from tests.helpers.parts import hinge, rod, slide
from tests.helpers.statics import DOWN, G

INNER, OUTER, BASE, TOOL = 0.3, 0.45, 0.35, (0.2, 0.5)  # m
RADIUS, SPEED = 0.06, 4.0  # m, rad/s, of the tool's circle
MASSES = {"a": 1.0, "b": 0.8, "d": 0.7, "e": 1.1}  # kg
DURATION = 2 * np.pi / SPEED
TIMES = np.linspace(0.0, DURATION, 7)
CIRCLE = (
    {"sine": {"amplitude": RADIUS, "frequency": SPEED}},
    {"polynomial": [-RADIUS], "sine": {"amplitude": RADIUS, "frequency": SPEED, "phase": np.pi / 2}},
)
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

    def virtual_work(self, v: np.ndarray, a: np.ndarray, e: np.ndarray, masses: tuple[float, float]) -> float:
        """Return Σ m (r'' - g)·δr + J φ'' δφ of both rods for the tool's velocity, acceleration and virtual
        displacement e."""
        turn, moved, _ = self.rates(v)
        along = moved @ moved + self.w @ a + INNER * turn**2 * (self.w @ self.u)
        second = along / (INNER * (self.w @ self.n))
        curved = a - INNER * (second * self.n - turn**2 * self.u)  # w''
        bent = cross(self.w, curved) / OUTER**2
        by_inner, by_w, by_outer = self.rates(e)
        up = np.array([0.0, G])
        inner = INNER / 2 * (second * self.n - turn**2 * self.u) + up
        outer = a - curved / 2 + up
        of_inner = inner @ (INNER / 2 * by_inner * self.n) + INNER**2 / 12 * second * by_inner
        of_outer = outer @ (e - by_w / 2) + OUTER**2 / 12 * bent * by_outer
        return masses[0] * of_inner + masses[1] * of_outer


def halves(p: np.ndarray) -> tuple[Half, Half]:
    """Return the rods at A and at E."""
    return Half(0.0, 1, p), Half(BASE, -1, p)


@functools.cache
def arm() -> Scene:
    """Return the arm with its drivers."""
    b, d = ((*half.elbow.tolist(), 0.0) for half in halves(np.array(TOOL)))
    p, a, e = (*TOOL, 0.0), (0.0, 0.0, 0.0), (BASE, 0.0, 0.0)
    ends = {"a": (a, b), "b": (b, p), "d": (d, p), "e": (e, d)}
    bodies = [rod(name, *pair, MASSES[name]) for name, pair in ends.items()]
    places: dict = {"A": ("ground", "a", a), "B": ("a", "b", b), "P": ("b", "d", p), "D": ("d", "e", d)}
    joints = [hinge(name, *of) for name, of in places.items()] + [hinge("E", "ground", "e", e)]
    tool = [
        {"name": f"tool {n}", "body": "b", "point": p, "along": along, **law}
        for n, along, law in zip("xy", ((1, 0, 0), (0, 1, 0)), CIRCLE, strict=True)
    ]
    return Scene(name="arm", gravity=DOWN, duration=DURATION, body=bodies, joint=joints, driver=tool)


@functools.cache
def moved() -> mbref.Motion:
    """Return the motion of the tool along its circle."""
    return mbref.simulate(arm(), times=TIMES, rtol=1e-13)


def demand(t: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the derivatives (3, 2) of the angles at A, E and P by the tool's place, and the force (2,) that
    the tool needs, by d'Alembert's principle."""
    s, c = np.sin(SPEED * t), np.cos(SPEED * t)
    p, v = np.array(TOOL) + RADIUS * np.array([s, c - 1]), RADIUS * SPEED * np.array([c, -s])
    a = -RADIUS * SPEED**2 * np.array([s, c])
    left, right = halves(p)
    jacobian, force = np.zeros((3, 2)), np.zeros(2)
    for k, e in enumerate(np.eye(2)):
        (one, _, outer), (other, _, last) = left.rates(e), right.rates(e)
        jacobian[:, k] = one, other, last - outer
        force[k] = left.virtual_work(v, a, e, (MASSES["a"], MASSES["b"]))
        force[k] += right.virtual_work(v, a, e, (MASSES["e"], MASSES["d"]))
    return jacobian, force


@pytest.mark.parametrize("motors", [("A", "E"), ("E", "A"), ("A", "P"), ("A", "E", "P")])
def test_torques_of_the_arm_do_the_virtual_work_that_its_tool_needs(motors):
    """Jᵀ τ = F with the angles' derivatives J by the tool's place; three motors have the least Σ τ²."""
    found = mbref.inverse_dynamics(moved(), motors).motors
    rows = [("A", "E", "P").index(name) for name in motors]
    exact = np.array([np.linalg.pinv(j[rows].T) @ f for j, f in map(demand, TIMES)])
    torques = np.array([found[name].torque for name in motors]).T
    assert np.abs(torques - exact).max() < CLOSE * np.abs(exact).max()
    assert all((found[name].open == (len(motors) > 2)).all() and found[name].force is None for name in motors)


def test_powers_of_motors_are_the_powers_of_the_drivers_that_they_replace():
    """Also where three motors share the work; motors at the drivers' joints have the drivers' forces."""
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
    """401 rows of a cubic spline: the places differ by its error. The spline of a torque T sin(4 t + …) at a
    distance h has an error of T (4 h)⁴ / 100, about 1e-9 T; 1e-7 m leaves room for its growth in a turn."""
    dense = np.linspace(0.0, DURATION, 401)
    found = mbref.inverse_dynamics(mbref.simulate(arm(), times=dense, rtol=1e-13), ["A", "E"])
    start = moved()
    bodies = [
        body.model_copy(
            update={
                "velocity": tuple(start.velocity[0, k].tolist()),
                "angular_velocity": tuple(start.angular_velocity[0, k].tolist()),
            }
        )
        for k, body in enumerate(arm().body)
    ]
    rows = {n: list(zip(dense.tolist(), m.torque.tolist(), strict=True)) for n, m in found.motors.items()}
    loads = [JointTorque(joint=n, torque=1.0, factor=Factor(table=rows[n])) for n in rows]
    free = mbref.simulate(arm().with_(body=bodies, driver=(), load=loads), times=TIMES, rtol=1e-12)
    assert np.abs(free.position - start.position).max() < 1e-7


def test_torques_do_not_depend_on_units_and_order():
    """In units of half a kg, mm and 10 ms: forces have other numbers, and the least norm is the same, also
    of motors with torques and a motor with a force. Bodies, joints and drivers in reverse order."""
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
    return [
        Free(
            name=f"motor {body.name} {k}",
            bodies=("ground", body.name),
            anchor=tuple((np.array(body.position) + rng.uniform(-0.5, 0.5, 3)).tolist()),
            axis=tuple(rng.normal(size=3).tolist()),
        )
        for body in scene.body
        for k in range(6)
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


def slider_crank(*drivers: dict) -> Scene:
    """Return a crank of 0.2 m and a rod of 0.5 m that move a block along x, at a dead centre at t = 0."""
    bodies = [
        rod("crank", (0.0, 0.0, 0.0), (0.2, 0.0, 0.0)),
        rod("rod", (0.2, 0.0, 0.0), (0.7, 0.0, 0.0)),
        rod("block", (0.7, 0.0, 0.0), (0.8, 0.0, 0.0)),
    ]
    joints = [
        hinge("A", "ground", "crank", (0.0, 0.0, 0.0)),
        hinge("B", "crank", "rod", (0.2, 0.0, 0.0)),
        hinge("C", "rod", "block", (0.7, 0.0, 0.0)),
        slide("D", "ground", "block", (0.7, 0.0, 0.0)),
    ]
    return Scene(name="slider_crank", gravity=DOWN, body=bodies, joint=joints, driver=drivers)


def test_motor_at_the_slide_of_a_driven_crank_is_undecided_at_dead_centres_only():
    """The crank turns by π rad/s: dead centres at 0 s and 1 s. Elsewhere the force times the slide's speed is
    the crank's power."""
    times = np.array([0.0, 0.3, 0.6, 0.9, 1.0])
    scene = slider_crank({"joint": "A", "polynomial": [0.0, np.pi]})
    motion = mbref.simulate(scene, times=times, rtol=1e-13)
    motor, drive = mbref.inverse_dynamics(motion, ["D"]).motors["D"], motion.driver("A")
    assert np.isnan(motor.force).tolist() == [True, False, False, False, True]
    regular = ~np.isnan(motor.force)
    work = motor.force[regular] * motion.joint("D").displacement_rate[regular]
    assert work == pytest.approx(drive.power[regular], rel=1e-9)


@pytest.mark.parametrize(
    ("motors", "sentence"),
    [
        (["A"], "t = 0 s; with all of them at rest b, d, e can still move: 2 degrees of freedom"),
        (["A", "Q"], "no joint 'Q'; joints: A, B, P, D, E, tool x, tool y"),
        (["A", "A"], "needs at least one joint, and each joint once"),
        ([], "needs at least one joint"),
    ],
)
def test_motors_that_cannot_cause_the_motion_are_refused(motors, sentence):
    """One motor for two degrees of freedom; unknown joints; no joint."""
    with pytest.raises(mbref.InputError) as refusal:
        mbref.inverse_dynamics(moved(), motors)
    assert sentence in str(refusal.value)


def test_scenes_without_drivers_or_masses_have_no_inverse_dynamics():
    """The message says what is missing."""
    scene = arm()
    bare = [body.model_copy(update={"mass": None, "inertia": None}) for body in scene.body]
    cases = ((scene.with_(driver=()), "no driver"), (scene.with_(body=bare), "needs masses"))
    for changed, sentence in cases:
        motion = mbref.simulate(changed, times=[0.0, 0.01])
        with pytest.raises(mbref.InputError) as refusal:
            mbref.inverse_dynamics(motion, ["A", "E"])
        assert sentence in str(refusal.value)


def test_command_writes_torques_of_motors_and_says_which_share_the_work(tmp_path, capsys):
    """Columns of a CSV file have the numbers of Python; JSON, which lacks them, is refused."""
    arm().save(tmp_path / "arm.toml")
    run = ["run", str(tmp_path / "arm.toml"), "--samples", "7", "--estimate", "no", "--motors"]
    out = str(tmp_path / "arm.csv")
    assert main([*run, "A", "E", "--columns", "motor(A).torque", "motor(E)", "--out", out]) == 0
    table = np.genfromtxt(out, delimiter=",", names=True, deletechars="")
    found = mbref.inverse_dynamics(moved(), ["A", "E"])
    assert table["motor(A).torque"] == pytest.approx(found.motors["A"].torque, rel=1e-8)
    assert table["motor(E).power"] == pytest.approx(
        found.columns("motor(E).power")["motor(E).power"], rel=1e-8
    )
    capsys.readouterr()
    assert main([*run, "A", "E", "P"]) == 0
    shown = capsys.readouterr().out
    assert "motors A, E, P can replace each other; their torques have the least norm" in shown
    assert main([*run, "A", "E", "--json"]) == 2
    assert "--motors: JSON has no numbers of motors" in capsys.readouterr().err
