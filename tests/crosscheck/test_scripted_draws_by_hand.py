"""Random mechanisms of the suite / scripted generators, whose draws are known, and the scenes that follow.

A scripted generator returns the number a quarter of the way between the ends of a uniform draw, and lists of
the numbers that `random`, `integers` and `choice` give.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest

from crosscheck.conformance import geared_mechanisms, moving, random_mechanisms, random_scenes
from crosscheck.conformance.random_mechanisms import Comparison
from mbref.scene import (
    GROUND,
    Body,
    Coupling,
    Cylindrical,
    Driver,
    Fixed,
    Force,
    JointForce,
    JointTorque,
    Moment,
    Revolute,
    Scene,
    SlideSpring,
    Spherical,
    Spring,
    TorsionSpring,
    Translational,
)
from mbref.trajectory import Outcome

O, X, Z = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


class Script:
    """A generator with known draws; ``asked`` lists the arguments of whole numbers and choices."""

    def __init__(
        self, random: Iterable[float] = (), integers: Iterable[int] = (), choice: Iterable[Any] = ()
    ) -> None:
        self._random, self._integers, self._choice = iter(random), iter(integers), iter(choice)
        self.asked: list[tuple[Any, ...]] = []

    def uniform(self, low: Any, high: Any, size: Any = None) -> Any:
        found = np.asarray(low, float) + 0.25 * (np.asarray(high, float) - np.asarray(low, float))
        return found + np.zeros(() if size is None else size) if found.ndim or size else float(found)

    def random(self) -> float:
        return next(self._random)

    def integers(self, *ends: int) -> int:
        self.asked.append(ends)
        return next(self._integers)

    def normal(self, size: Any) -> np.ndarray:
        return np.arange(1.0, 1.0 + np.prod(size)).reshape(size)

    def choice(self, items: Any, *more: Any, **options: Any) -> Any:
        self.asked.append((items, *more, options))
        return next(self._choice)

    def permutation(self, items: Any) -> Any:
        return items


def block(name: str = "b", x: float = 0.0, **more: Any) -> Body:
    return Body(name=name, mass=1.0, inertia=(1.0, 1.0, 1.0), position=(x, 0.0, 0.0), **more)


def hinge(
    name: str = "A", bodies: tuple[str, str] = (GROUND, "b"), anchor: Any = O, axis: Any = Z
) -> Revolute:
    return Revolute(name=name, bodies=bodies, anchor=anchor, axis=axis)


def slide(name: str = "S", bodies: tuple[str, str] = (GROUND, "b"), axis: Any = X) -> Translational:
    return Translational(name=name, bodies=bodies, anchor=O, axis=axis)


def scene(*joint: Any, bodies: tuple[Body, ...] = (block(),), **more: Any) -> Scene:
    return Scene(name="s", body=bodies, joint=joint, **more)


def drawn_from(monkeypatch: pytest.MonkeyPatch, module: Any, base: Scene, script: Script) -> list[Any]:
    """Make a module draw from a script on a scene, and return the list of its seeds."""
    seeds: list[Any] = []
    monkeypatch.setattr(module, "random_mechanism", lambda seed: base)
    monkeypatch.setattr(np.random, "default_rng", lambda seed: seeds.append(seed) or script)
    return seeds


# --- velocities that joints allow ---------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("joint", "free"),
    [((), 6), ((hinge(),), 1), ((slide(),), 1), ((hinge(), slide()), 0), ((hinge(), hinge("B")), 1)],
)
def test_null_space_of_joints(joint, free):
    found = random_mechanisms.null_space(scene(*joint))
    assert found.shape == (6, free) and np.allclose(found.T @ found, np.eye(free), atol=1e-14)


def test_null_space_is_at_the_start(monkeypatch):
    asked = []
    real = random_mechanisms.jacobian
    monkeypatch.setattr(random_mechanisms, "jacobian", lambda s, t, p, q: asked.append(t) or real(s, t, p, q))
    random_mechanisms.null_space(scene(hinge()))
    assert asked == [0.0]


def test_velocities_that_joints_allow():
    """A hinge about z through the centre keeps the turning about z, a slide the velocity along x; a driver
    does not matter, and a free body keeps all."""
    twist = np.array([[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]])
    for joint, wanted in (
        (scene(hinge()), [0, 0, 0, 0, 0, 6]),
        (scene(slide()), [1, 0, 0, 0, 0, 0]),
        (scene(), [1, 2, 3, 4, 5, 6]),
        (scene(hinge(), driver=(Driver(joint="A", polynomial=(0.0, 1.0)),)), [0, 0, 0, 0, 0, 6]),
    ):
        [body] = moving.consistent(joint, twist).body
        assert [*body.velocity, *body.angular_velocity] == pytest.approx(wanted, abs=1e-13)


def test_the_crank_of_the_dead_end():
    """A crank of 0.3 m and a rod of 0.25 m: the rod is perpendicular to the line at asin(0.25 / 0.3)."""
    found = moving.dead_end()
    crank, rod, *_ = found.body
    assert found.name == "dead end" and found.duration == 0.5
    assert found.driver == (Driver(joint=found.joint[0].name, polynomial=(0.0, 4.0)),)
    assert found.joint[0].name == "A" and found.joint[0].bodies == ("ground", crank.name)
    first, second = (np.array(joint.anchor_pair[0]) for joint in found.joint[:2])
    third = np.array(found.joint[2].anchor_pair[0])
    assert np.linalg.norm(second - first) == pytest.approx(0.3)
    assert np.linalg.norm(third - second) == pytest.approx(0.25)
    assert rod.position == pytest.approx((second + third) / 2)
    assert np.arctan2(*(second - first)[1::-1]) == pytest.approx(0.2)
    reached = np.arctan2(*(second - first)[1::-1]) + 4.0 * found.duration
    assert reached > np.arcsin(0.25 / 0.3) > np.arctan2(*(second - first)[1::-1])


# --- armatures and couplings --------------------------------------------------------------------------------
def test_half_of_the_joints_have_an_armature(monkeypatch):
    """A quarter of the way from 0.02 to 0.5 kg m²; one half is none; a ball joint has none."""
    ball = Spherical(name="C", bodies=(GROUND, "b"), anchor=O)
    base = scene(hinge("A"), hinge("B"), ball)
    seeds = drawn_from(
        monkeypatch, geared_mechanisms, base, Script(random=[0.499, 0.5], choice=[[0, 1]] * 40)
    )
    monkeypatch.setattr(
        geared_mechanisms, "_coupling", lambda *of: Coupling(name="g", joints=("A", "B"), ratio=2.0)
    )
    monkeypatch.setattr(geared_mechanisms, "_moving", lambda scene, rng: None)
    found = geared_mechanisms.geared_mechanism(7)
    assert seeds == [[7, 1]] and found.name == "geared_7" and not found.coupling
    assert [getattr(joint, "armature", None) for joint in found.joint] == [pytest.approx(0.14), 0.0, None]


@pytest.mark.parametrize(
    ("joints", "tries"), [((slide(),), 0), ((slide(), hinge()), 40), ((hinge("A"), hinge("B"), slide()), 40)]
)
def test_couplings_are_tried_forty_times(monkeypatch, joints, tries):
    script = Script(random=[0.9] * 3, choice=[(1, 0)] * tries)
    drawn_from(monkeypatch, geared_mechanisms, scene(*joints), script)
    pairs = []
    monkeypatch.setattr(
        geared_mechanisms,
        "_coupling",
        lambda first, second, rng: (
            pairs.append((first[0].name, second[0].name)) or Coupling(name="g", joints=pairs[-1], ratio=2.0)
        ),
    )
    monkeypatch.setattr(geared_mechanisms, "_moving", lambda scene, rng: None)
    assert not geared_mechanisms.geared_mechanism(1).coupling
    assert pairs == [(joints[1].name, joints[0].name)] * tries if tries else pairs == []
    assert script.asked == [(len(joints), 2, {"replace": False})] * tries


def test_the_first_coupling_that_leaves_a_motion(monkeypatch):
    drawn_from(monkeypatch, geared_mechanisms, scene(hinge(), slide()), Script([0.9] * 2, (), [(0, 1)] * 2))
    monkeypatch.setattr(
        geared_mechanisms, "_coupling", lambda *of: Coupling(name="g", joints=("A", "S"), ratio=2.0)
    )
    answers = iter([None, "moving"])
    monkeypatch.setattr(geared_mechanisms, "_moving", lambda scene, rng: scene.coupling and next(answers))
    assert geared_mechanisms.geared_mechanism(1) == "moving"


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_coupling_of_two_coordinates(sign):
    """A quarter of the way from 0.3 to 3."""
    script = Script(choice=[sign])
    found = geared_mechanisms._coupling((hinge("A"), "angle"), (slide("S"), "displacement"), script)
    assert found.joints == ("A", "S") and found.coordinates == ("angle", "displacement")
    assert found.ratio == pytest.approx(sign * 0.975) and script.asked == [([-1.0, 1.0], {})]


@pytest.mark.parametrize(
    ("joint", "wanted"),
    [(hinge(), (0.0, 0.5**0.5, 0.0, 0.0, 0.0, 0.5**0.5 / 4)), (slide(), (1.0, 0.0, 0.0, 0.0, 0.0, 0.0))],
)
def test_velocities_of_geared_mechanisms(joint, wanted):
    """The draw 1 along the free direction, for velocities and for angular ones times the length of 4 m: both
    parts are equal at 4 m from a hinge."""
    [body] = geared_mechanisms._moving(scene(joint, bodies=(block(x=4.0),)), Script()).body
    assert np.abs([*body.velocity, *body.angular_velocity]) == pytest.approx(wanted, abs=1e-12)


def test_geared_mechanisms_without_a_motion(monkeypatch):
    assert geared_mechanisms._moving(scene(Fixed(name="F", bodies=(GROUND, "b"), anchor=O)), Script()) is None
    asked = []
    monkeypatch.setattr(geared_mechanisms, "goes_on", lambda scene, within: asked.append(within) or False)
    assert geared_mechanisms._moving(scene(hinge()), Script()) is None and asked == [1e-9]


# --- random mechanisms --------------------------------------------------------------------------------------
def drawing(**parts: Any) -> Any:
    made = random_mechanisms._Drawing.__new__(random_mechanisms._Drawing)
    given = {"rng": Script(), "axis": np.array(Z), "planar": False, "bodies": (block(),), "joints": []}
    for name, value in {**given, **parts}.items():
        setattr(made, name, value)
    return made


@pytest.mark.parametrize(("draw", "planar"), [(0.649, True), (0.65, False)])
def test_parts_of_a_drawing(draw, planar):
    script = Script(random=[draw], integers=[3])
    made = random_mechanisms._Drawing(script)
    assert made.planar is planar and script.asked == [(3, 9)] and made.joints == []
    assert [body.name for body in made.bodies] == ["b0", "b1", "b2"]
    assert made.axis == pytest.approx(np.array([1.0, 2.0, 3.0]) / np.sqrt(14))
    body = made.bodies[0]
    assert body.mass == pytest.approx(0.5 + 2.5 / 4) and body.position == pytest.approx((-0.5,) * 3)
    values = np.linalg.eigvalsh(np.array(body.inertia))
    assert values == pytest.approx([2 * 0.0175] * 3), "sums of two moments a quarter of the way to 0.04"


def test_a_thousand_mechanisms_are_drawn_at_most(monkeypatch):
    made = []
    monkeypatch.setattr(random_mechanisms._Drawing, "__init__", lambda self, rng: None)
    monkeypatch.setattr(random_mechanisms._Drawing, "scene", lambda self, name: made.append(name))
    with pytest.raises(RuntimeError, match="seed 5: no mechanism that moves in 1000 draws"):
        random_mechanisms.random_mechanism.__wrapped__(5)
    assert made == ["random_5"] * 1000


@pytest.mark.parametrize(("second", "kind"), [(0.29, Spherical), (0.3, Revolute), (0.31, Revolute)])
def test_a_second_hinge(second, kind):
    """A quarter of the way from 0.2 to 0.6 m along the axis."""
    made = drawing(rng=Script(random=[second, 0.49]), joints=[0, 1])
    found = made.second_hinge(hinge("A", anchor=(1.0, 2.0, 3.0)))
    assert isinstance(found, kind) and found.name == "J2" and found.bodies == (GROUND, "b")
    assert found.anchor == pytest.approx((1.0, 2.0, 3.3))


def test_a_second_hinge_that_slides():
    found = drawing(rng=Script(random=[0.9, 0.5])).second_hinge(hinge("A"))
    assert isinstance(found, Cylindrical) and found.axis == Z


def closed(
    monkeypatch: pytest.MonkeyPatch, freedoms: list[int], joints: list[Any], random: list[float]
) -> Any:
    """Try to close a loop with joints that leave these freedoms; return drawing, answer and joints."""
    script = Script(random, [0] * 99, [("b", "c")] * 99)
    made, tried = drawing(rng=script, joints=joints), []
    answers = iter(freedoms)
    made.second_hinge = lambda hinge: tried.append("hinge") or slide("again")
    made.joint = lambda first, second, places, weights: tried.append(weights) or slide("new")
    monkeypatch.setattr(random_mechanisms, "_freedoms", lambda scene: next(answers))
    return made, made.close([GROUND, "b", "c"], {}), tried


def test_a_loop_that_leaves_a_motion(monkeypatch):
    made, answer, tried = closed(monkeypatch, [0, 1], [slide()], [])
    assert answer is True and tried == [random_mechanisms.CLOSING] * 2, "there is no hinge"
    assert [joint.name for joint in made.joints] == ["S", "new"]
    assert made.rng.asked == [([GROUND, "b", "c"], 2, {"replace": False})] * 2


def test_a_loop_that_cannot_be_closed(monkeypatch):
    made, answer, tried = closed(monkeypatch, [0] * 99, [], [])
    assert answer is False and len(tried) == 60 and made.joints == []


@pytest.mark.parametrize(("draw", "name"), [(0.249, "again"), (0.25, "new")])
def test_a_quarter_of_the_loops_are_second_hinges(monkeypatch, draw, name):
    made, answer, _ = closed(monkeypatch, [1], [hinge()], [draw])
    assert answer is True and made.joints[-1].name == name
    assert (1,) in made.rng.asked if name == "again" else (1,) not in made.rng.asked


def test_loads_of_a_drawing():
    """At the second and the first body, a quarter of the way from -0.3 to 0.3 m beside their centres."""
    made = drawing(rng=Script(choice=[(1, 0)]), bodies=(block("b"), block("c", 2.0)))
    moment, force, spring = made.loads()
    assert moment == Moment(body="c", moment=(1.0, 2.0, 3.0))
    assert force == Force(body="b", point=(-0.15, -0.15, -0.15), force=(1.0, 2.0, 3.0))
    assert spring == Spring(
        bodies=("c", "b"),
        points=((1.85, -0.15, -0.15), (-0.15, -0.15, -0.15)),
        stiffness=20.0,
        damping=0.5,
        natural_length=0.3,
    )
    assert made.rng.asked == [(2, 2, {"replace": False})]


def test_a_mechanism_without_all_its_loops(monkeypatch):
    def drawn(closing: list[bool]) -> Any:
        answers = iter(closing)
        made = drawing(rng=Script((), [2], ["ground", "b"]), bodies=(block("b"), block("c", 2.0)))
        made.joint = lambda first, second, places, weights: (first, second, weights)
        made.close = lambda names, places: next(answers) if places[names[2]][0] == 2.0 else None
        made.moving = lambda name: (name, made.joints)
        return made.scene("n"), made.rng.asked

    tree = random_mechanisms.TREE
    found, asked = drawn([True, True])
    assert found == ("n", [("ground", "b", tree), ("b", "c", tree)])
    assert asked == [(["ground"], {}), (["ground", "b"], {}), (1, 4)]
    assert drawn([True, False])[0] is None and drawn([False, False])[0] is None


@pytest.mark.parametrize("kind", random_mechanisms.KINDS)
def test_a_joint_between_two_bodies(kind):
    """Near the middle; a draw (1, 2, 3) is across the planar axis z: z × (1, 2, 3) = (-2, 1, 0)."""
    made = drawing(rng=Script(choice=[kind]), planar=True, joints=[0])
    found = made.joint("b", "c", {"b": np.zeros(3), "c": np.array([2.0, 4.0, 6.0])}, (0.5,))
    assert (found.type, found.name, found.bodies) == (kind, "J1", ("b", "c"))
    assert made.rng.asked == [(random_mechanisms.KINDS, {"p": (0.5,)})]
    middle, across = np.array([0.85, 1.85, 2.85]), np.array([-2.0, 1.0, 0.0]) / np.sqrt(5)
    assert found.anchor_pair[0] == pytest.approx(middle)
    if kind == "distance":
        assert found.anchor_pair[1] == pytest.approx(middle + 0.425 * across)
    elif kind == "universal":
        assert found.axes[0] == Z and found.axes[1] == pytest.approx(across)
    elif kind in ("revolute", "cylindrical", "planar"):
        assert found.axis == Z
    elif kind == "translational":
        assert found.axis == pytest.approx(across)


def test_a_skew_joint_between_two_bodies():
    """Of a spatial mechanism, the axis is drawn, and so is the direction across it."""
    made, draws = drawing(rng=Script(choice=["universal"])), iter([(0.0, 2.0, 0.0), (0.0, 1.0, 1.0)])
    made.rng.normal = lambda size: np.array(next(draws))
    found = made.joint("b", "c", {"b": np.zeros(3), "c": np.zeros(3)}, (1,))
    assert found.axes == ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0))


# --- initial accelerations ----------------------------------------------------------------------------------
def test_the_comparison_of_initial_accelerations(monkeypatch):
    """The largest acceleration is 5 m/s², the largest difference 1 m/s²; two of five rows are redundant."""
    given = {
        "mbref": np.array([[3.0, 0.0, 4.0], [0.0, 0.0, 0.0]]),
        "e": np.array([[3.0, 0.0, 4.0], [0.6, 0.8, 0.0]]),
        "none": None,
    }
    asked = []
    monkeypatch.setattr(random_mechanisms, "initial_accelerations", lambda scene, name: given[name])
    monkeypatch.setattr(random_mechanisms, "gauss", lambda scene: given["mbref"] + 0.5 * np.eye(2, 3))
    monkeypatch.setattr(
        random_mechanisms, "singular_values", lambda scene: np.array([4.0, 2.0, 0.5, 0.0, 0.0])
    )
    monkeypatch.setattr(
        random_mechanisms, "jacobian", lambda s, t, p, q: asked.append((s, t)) or (np.zeros((5, 6)), None)
    )
    base = scene(hinge("A"))
    found = random_mechanisms.compare(base, ("e", "none"))
    wanted = {"e": pytest.approx(0.2), "none": np.inf, random_mechanisms.PRINCIPLE: pytest.approx(0.1)}
    assert isinstance(found, Comparison) and found.scene is base and found.errors == wanted
    assert (found.redundant, found.distance) == (2, 0.5) and asked == [(base, 0.0)]
    given["mbref"] = None
    with pytest.raises(RuntimeError, match="s: mbref gives no initial acceleration"):
        random_mechanisms.compare(base, ())


def test_initial_accelerations_of_an_engine(monkeypatch):
    """The finest of the best settings runs for a hundredth of the duration."""

    class Simulator:
        outcome, acceleration = Outcome.COMPLETED, "a"
        asked: tuple[Any, ...] = ()

        def best_settings(self, scene: Scene) -> list[str]:
            return ["coarse", "middle", "fine"]

        def run(self, scene: Scene, times: np.ndarray, setting: str) -> Any:
            self.asked = scene, times.tolist(), setting
            return self

    simulator, base = Simulator(), scene(hinge(), duration=0.5)
    monkeypatch.setattr(random_mechanisms, "engine", lambda name: simulator)
    monkeypatch.setattr(random_mechanisms, "stacked", lambda scene, run, sample: (scene, run, sample))
    assert random_mechanisms.initial_accelerations(base, "e") == (base, simulator, 0)
    assert simulator.asked == (base, [0.0, 0.005], "fine")
    simulator.acceleration = None
    assert random_mechanisms.initial_accelerations(base, "e") is None
    simulator.acceleration, simulator.outcome = "a", Outcome.CRASHED
    assert random_mechanisms.initial_accelerations(base, "e") is None


# --- loads, drivers, rotors ---------------------------------------------------------------------------------
def test_loads_of_each_coordinate(monkeypatch):
    """Numbers a quarter of the way between the ends of their ranges; a joint with a torsion spring gets no
    second one."""
    drawn_from(monkeypatch, random_scenes, scene(), Script())
    sleeve = Cylindrical(name="C", bodies=(GROUND, "b"), anchor=O, axis=Z)
    sprung = TorsionSpring(joint="A", stiffness=2.0)
    ball = Spherical(name="D", bodies=(GROUND, "b"), anchor=O)
    found = random_scenes.with_loads_of_joints(scene(hinge("A"), slide("S"), sleeve, ball, load=(sprung,)), 3)
    line = random_scenes._factor(Script(), False)
    twist = TorsionSpring(joint="C", stiffness=3.0, damping=0.05, natural_angle=-0.5)
    pull = [
        SlideSpring(joint=name, stiffness=21.75, damping=0.5, natural_displacement=-0.15) for name in "SC"
    ]
    torque = [JointTorque(joint=name, torque=-0.5, factor=line) for name in "AC"]
    push = [JointForce(joint=name, force=-2.5, factor=line) for name in "SC"]
    assert list(found.load) == [sprung, torque[0], pull[0], push[0], twist, torque[1], pull[1], push[1]]


def test_factors_of_loads():
    """A line and a wave; a switched one has a table too, from 0.1 to 0.4 of 0.05 s on, until 0.6 to 0.9."""
    plain, switched = (random_scenes._factor(Script(), switched) for switched in (False, True))
    for factor in (plain, switched):
        assert factor.polynomial == pytest.approx((0.75, -10.0))
        wave = factor.sine
        assert (wave.amplitude, wave.frequency, wave.phase) == pytest.approx((0.4, 35.0, -1.5))
    assert not plain.table and not plain.stop
    times, values = np.array(switched.table).T
    assert times == pytest.approx([0.0, 0.015, 0.025, 0.04, 0.055]) and values == pytest.approx([-0.5] * 5)
    assert (switched.start, switched.stop) == pytest.approx((0.00875, 0.03375))


def test_forces_of_a_scene_get_factors(monkeypatch):
    seeds = drawn_from(monkeypatch, random_scenes, scene(), Script())
    push, spring = (
        Moment(body="b", moment=X),
        Spring(bodies=(GROUND, "b"), points=(O, X), stiffness=1.0, natural_length=1.0),
    )
    found = random_scenes.with_loads_of_joints(scene(load=(push, spring)), 3, switched=True)
    assert found.load == (push.model_copy(update={"factor": random_scenes._factor(Script(), True)}), spring)
    assert seeds == [[3, 4]]


@pytest.mark.parametrize(
    ("seed", "kinds"), [(4, {"joint"}), (9, {"joint", "driver"}), (3, {"driver"}), (8, set())]
)
def test_kinds_of_seeds(monkeypatch, seed, kinds):
    """Loads of joints for the seeds 4, 9, …, a driver for odd ones, no damping for even ones."""
    seeds = drawn_from(monkeypatch, random_scenes, scene(name := hinge()), Script(random=[0.9] * 9))
    monkeypatch.setattr(random_scenes, "_driven", lambda scene, rng: scene.with_(duration=9.0))
    monkeypatch.setattr(random_scenes, "_undamped", lambda scene: scene.with_(duration=8.0))
    monkeypatch.setattr(
        random_scenes,
        "with_loads_of_joints",
        lambda scene, seed: scene.with_(load=(JointTorque(joint=name.name, torque=float(seed)),)),
    )
    found = random_scenes.mechanism(seed)
    assert found.name == f"drawn_{seed}" and seeds == [[seed, 1]]
    assert found.duration == (9.0 if "driver" in kinds else 8.0)
    assert [load.torque for load in found.load] == ([seed] if "joint" in kinds else [])
    assert found.gravity == pytest.approx(9.81 * np.array([1, 2, 3]) / np.sqrt(14))


@pytest.mark.parametrize(("draw", "count"), [(0.66, 1), (2 / 3, 0), (0.9, 0)])
def test_two_of_three_mechanisms_have_a_torsion_spring(draw, count):
    script = Script(random=[draw], choice=["A"])
    found = list(random_scenes._torsion(scene(slide(), hinge()), script))
    wanted = TorsionSpring(joint="A", stiffness=3.0, damping=0.05, natural_angle=-0.5)
    assert found == [wanted] * count and script.asked == [(["A"], {})] * count
    assert list(random_scenes._torsion(scene(slide()), Script())) == []


def test_dampers_are_left_out():
    springs = TorsionSpring(joint="A", stiffness=3.0, damping=0.5), Moment(body="b", moment=X)
    found = random_scenes._undamped(scene(hinge(), load=springs)).load
    assert found == (TorsionSpring(joint="A", stiffness=3.0), springs[1])


def test_a_driver_begins_at_the_joints_rate():
    """a = -0.05, w = 7.25, p = -1.5: the driver starts at the angle 0 and at the hinge's 2 rad/s."""
    turning = block(angular_velocity=(0.0, 0.0, 2.0))
    found = random_scenes._driver(scene(hinge(), bodies=(turning,)), hinge(), Script())
    assert found.joint == "A"
    assert (found.sine.amplitude, found.sine.frequency, found.sine.phase) == pytest.approx(
        (-0.05, 7.25, -1.5)
    )
    first, rate, second = found.polynomial
    assert first == pytest.approx(0.05 * np.sin(-1.5)) and second == pytest.approx(-0.5)
    assert abs(rate + found.sine.amplitude * 7.25 * np.cos(-1.5)) == pytest.approx(2.0)


def driven(monkeypatch: pytest.MonkeyPatch, values: list[float], goes_on: bool = True) -> tuple[str, ...]:
    """The joints that get a driver, where the driven scene has these singular values and its own two."""
    monkeypatch.setattr(random_scenes, "rank", lambda scene: 2)
    monkeypatch.setattr(random_scenes, "singular_values", lambda scene: np.array(values))
    monkeypatch.setattr(random_scenes, "goes_on", lambda scene: goes_on)
    monkeypatch.setattr(
        random_scenes, "_driver", lambda scene, joint, rng: Driver(joint=joint.name, polynomial=Z)
    )
    ball = Spherical(name="D", bodies=(GROUND, "b"), anchor=O)
    found = random_scenes._driven(scene(ball, hinge("A"), hinge("B")), Script())
    return tuple(driver.joint for driver in found.driver)


def test_a_joint_that_can_be_driven(monkeypatch):
    """One independent row more, not nearly dependent (1e-3), and a motion that goes on."""
    assert driven(monkeypatch, [2.0, 1.0, 1.01e-3]) == ("A",)
    assert driven(monkeypatch, [2.0, 1.0, 1e-3]) == ()
    assert driven(monkeypatch, [2.0, 1.0, 0.0]) == ()
    assert driven(monkeypatch, [2.0, 1.0, 0.5, 0.4]) == ()
    assert driven(monkeypatch, [2.0, 1.0, 0.5], goes_on=False) == ()


@pytest.mark.parametrize("goes_on", [True, False])
def test_a_mechanism_in_flight(monkeypatch, goes_on):
    """A body replaces the ground; forces at points and dampers are left out; velocities are drawn."""
    loads = (
        Force(body="b", point=O, force=X),
        Spring(bodies=(GROUND, "b"), points=(O, X), stiffness=1.0, natural_length=1.0),
    )
    base = scene(hinge(), load=(loads[0], Moment(body="b", moment=X)))
    seeds = drawn_from(monkeypatch, random_scenes, base, Script())
    asked = []
    monkeypatch.setattr(random_scenes, "consistent", lambda scene, twists: asked.append(twists) or scene)
    monkeypatch.setattr(random_scenes, "goes_on", lambda scene: goes_on)
    found = random_scenes.floating(6)
    assert found.name == "floating_6" and found.duration == 0.05 and seeds == [[6, 2]]
    assert [body.name for body in found.body] == ["frame", "b"] and found.joint[0].bodies == ("frame", "b")
    assert [load.type for load in found.load] == ["moment"]
    assert asked[0].tolist() == np.arange(1.0, 13.0).reshape(2, 6).tolist()
    assert [twists.any() for twists in asked] == ([True] if goes_on else [True, False])
    frame = found.body[0]
    assert (frame.mass, frame.inertia, frame.position) == (4.0, (0.3, 0.4, 0.5), (0.1, -0.2, 0.05))


def test_a_rotor(monkeypatch):
    """Two of three bodies, at rest, on a hinge along the gravity (1, 2, 3)."""
    spun = block("b", velocity=X, angular_velocity=X), block("c", 1.0, velocity=X), block("d", 2.0)
    script = Script(integers=[2])
    seeds = drawn_from(monkeypatch, random_scenes, scene(bodies=spun), script)
    found = random_scenes.rotor(4)
    assert seeds == [[4, 3]] and script.asked == [(1, 5)] and found.name == "rotor_4"
    assert [(b.name, b.velocity, b.angular_velocity) for b in found.body] == [
        ("b", None, None),
        ("c", None, None),
    ]
    turning, weld = found.joint
    assert (turning.type, turning.name, turning.bodies) == ("revolute", "hinge", (GROUND, "b"))
    assert turning.axis == turning.anchor == (1.0, 2.0, 3.0)
    assert (weld.type, weld.name, weld.bodies, weld.anchor) == (
        "fixed",
        "weld c",
        ("b", "c"),
        (1.0, 2.0, 3.0),
    )
    assert found.driver == (Driver(joint="hinge", polynomial=(0.0, -1.5, -1.5)),) and found.duration == 0.05
    assert found.gravity == pytest.approx(9.81 * np.array([1, 2, 3]) / np.sqrt(14))


def test_a_mechanism_without_masses(monkeypatch):
    monkeypatch.setattr(
        random_scenes, "random_mechanism", lambda seed: scene(hinge(), load=(Moment(body="b", moment=X),))
    )
    found = random_scenes.without_masses(1)
    assert found.name == "massless_s" and not found.has_mass() and found.load == ()
    assert found.body[0].inertia is None and found.joint == (hinge(),)


def test_velocities_of_two_geared_bodies():
    pair = geared_mechanisms._moving(scene(hinge(), bodies=(block(x=4.0), block("c"))), Script())
    assert [body.name for body in pair.body] == ["b", "c"] and np.abs(pair.body[1].velocity).max() > 0.1
