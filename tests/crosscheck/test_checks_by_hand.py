"""Checks of the conformance suite / a wheel on a hinge whose exact motion has one known defect a time."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.conformance import properties, rewritings
from crosscheck.conformance.trial import NEIGHBOURS, Outside
from crosscheck.judge.constraints import closure_rates, initial_poses, initial_twists, scene_length
from crosscheck.judge.tolerances import LIKE_TRUTH, REACTIONS, STAYS_CLOSED, UNIT_NORM
from mbref import rotations
from mbref.scene import Body, Cylindrical, Driver, Force, Moment, Revolute, Scene, Spherical, TorsionSpring
from mbref.trajectory import Outcome, Trajectory

RATE, LENGTH = 2.0, 4.0  # rad/s, m
WHEEL = Body(
    name="wheel",
    mass=3.0,
    inertia=(1.0, 1.5, 2.0),
    position=(4.0, 0.0, 0.0),
    angular_velocity=(0.0, 0.0, RATE),
)
HINGE = Revolute(name="A", bodies=("ground", "wheel"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 2.0))
SCENE = Scene(name="turning", body=(WHEEL,), joint=(HINGE,), duration=0.5)
TIMES = np.linspace(0.0, 0.5, 9)


def exact(times: np.ndarray = TIMES) -> Trajectory:
    """The wheel turns at 2 rad/s about z: its centre on a circle of 4 m."""
    angle, zero = RATE * times, np.zeros(len(times))
    place = LENGTH * np.stack([np.cos(angle), np.sin(angle), zero], axis=1)[:, None]
    spin = np.tile([0.0, 0.0, RATE], (len(times), 1, 1))
    turn = np.stack([np.cos(angle / 2), zero, zero, np.sin(angle / 2)], axis=1)[:, None]
    made = Trajectory(
        "turning", "e", "1", "m", {}, times.copy(), ("wheel",), place, turn, np.cross(spin, place), spin
    )
    pull = {"A": np.concatenate([-3.0 * RATE**2 * place[:, 0], np.zeros((len(times), 3))], axis=1)}
    return replace(
        made,
        acceleration=-(RATE**2) * place,
        angular_acceleration=np.zeros_like(place),
        reactions=pull,
        t_end=float(times[-1]),
    )


def bench(motion: Trajectory | None = None, **more: Any) -> SimpleNamespace:
    made = {"scene": SCENE, "motion": motion or exact(), "exact": exact(), "times": TIMES, "rounding": 1e-16}
    return SimpleNamespace(**{**made, **more})


def changed(name: str, by: Any, sample: int = 4) -> Trajectory:
    """The exact motion with an array that is off at one sample."""
    run = exact()
    array = getattr(run, name).copy()
    array[sample, 0] += by
    return replace(run, **{name: array})


def test_an_exact_motion_passes_each_check():
    near = exact(0.25 + 1e-3 * np.arange(-NEIGHBOURS, NEIGHBOURS + 1))
    good = bench(close=near)
    for check in (
        properties.sample_times,
        properties.unit_orientations,
        properties.closure,
        properties.rates_closed,
        properties.truth,
        properties.true_velocities,
        properties.true_accelerations,
        properties.energy,
        properties.balanced,
        properties.workless,
        properties.velocities,
    ):
        found = check(good)
        assert found.measured <= min(found.allowed, 1e-5), (check.__name__, found)
    assert isinstance(properties.momentum(good), Outside), "the hinge is fixed to the ground"


def test_times_of_samples():
    late = exact()
    late.times[3] += 1e-9
    assert properties.sample_times(bench(late)).measured == pytest.approx(1e-9, rel=1e-6)
    assert properties.sample_times(bench(replace(exact(), t_end=0.4))).measured == pytest.approx(0.1)
    assert properties.sample_times(bench(exact(TIMES[:-1]))).measured == math.inf
    assert properties.sample_times(bench()).allowed == 0.0


def test_length_of_quaternions():
    long = exact()
    long = replace(long, orientation=long.orientation * (1 + 1e-9))
    found = properties.unit_orientations(bench(long))
    assert found.measured == pytest.approx(1e-9, rel=1e-5) and found.allowed == UNIT_NORM
    assert properties.unit_orientations(bench(rounding=1e-7)).allowed == pytest.approx(4e-7)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_joint_that_opens(axis):
    found = properties.closure(bench(changed("position", 0.004 * np.eye(3)[axis])))
    assert found.measured == pytest.approx(1e-3, rel=1e-6) and found.allowed == STAYS_CLOSED


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_velocities_that_leave_the_joint(axis):
    """0.02 m/s over 4 m and 2 rad/s; a moment of turning about another axis opens the hinge."""
    off = bench(changed("velocity", 0.02 * np.eye(3)[axis]))
    assert properties.rates_closed(off).measured == pytest.approx(0.0025, rel=1e-2)
    assert properties.true_velocities(off).measured == pytest.approx(0.0025, rel=1e-2)
    assert properties.true_velocities(off).allowed == LIKE_TRUTH


def test_angular_velocities_and_accelerations_that_are_off():
    spin = bench(changed("angular_velocity", (0.0, 0.3, 0.0)))
    assert properties.true_velocities(spin).measured == pytest.approx(0.3 / math.hypot(2.0, 0.3))
    linear = bench(changed("acceleration", (0.0, 0.0, 1.6)))
    assert properties.true_accelerations(linear).measured == pytest.approx(0.1), "of 16 m/s²"
    angular = bench(changed("angular_acceleration", (0.0, 0.0, 0.4)))
    assert properties.true_accelerations(angular).measured == pytest.approx(0.1), "times 4 m"
    assert properties.true_accelerations(angular).allowed == REACTIONS
    still = replace(exact(), acceleration=None)
    assert isinstance(properties.true_accelerations(bench(still)), Outside)
    assert isinstance(properties.true_accelerations(bench(exact=still)), Outside)
    unknown = replace(exact(), velocity=np.full((9, 1, 3), np.nan))
    assert isinstance(properties.true_velocities(bench(exact=unknown)), Outside)


def test_poses_against_the_truth():
    found = properties.truth(bench(changed("position", (0.0, 0.0, 0.04))))
    assert found.measured == pytest.approx(0.01) and found.allowed == LIKE_TRUTH and found.remark == "e"
    turned = exact()
    turn = rotations.from_vector(np.array([0.0, 0.3, 0.0]))
    turned.orientation[5, 0] = rotations.multiply(turn, turned.orientation[5, 0])
    assert properties.truth(bench(turned)).measured == pytest.approx(0.3)


def test_velocities_agree_with_differences_of_poses():
    near = exact(0.25 + 1e-3 * np.arange(-NEIGHBOURS, NEIGHBOURS + 1))
    velocity, spin = near.velocity.copy(), near.angular_velocity.copy()
    velocity[NEIGHBOURS, 0, 2] += 0.8
    found = properties.velocities(bench(close=replace(near, velocity=velocity)))
    speed = math.hypot(8.0, 0.8)
    assert found.measured == pytest.approx(0.8 / speed, rel=1e-4) and found.allowed == LIKE_TRUTH
    spin[NEIGHBOURS, 0, 0] += 0.2
    found = properties.velocities(bench(close=replace(near, angular_velocity=spin)))
    assert found.measured == pytest.approx(0.8 / math.hypot(8.0, 0.8), rel=1e-4), "0.2 rad/s times 4 m"
    negative = replace(near, orientation=near.orientation * np.resize([1.0, -1.0], (len(near.times), 1, 1)))
    assert properties.velocities(bench(close=negative)).measured < 1e-5, "a quaternion and its negative"
    coarse = properties.velocities(bench(close=near, rounding=1e-7))
    assert coarse.allowed == pytest.approx(16 * 1e-7 / (1e-3 * RATE), rel=1e-9)


def test_energy_that_is_lost():
    """½ (3 · 16 + 2) 4 = 100 J; 0.8 m/s more along the path of 8 m/s are 20.16 J more."""
    along = exact().velocity[4, 0] / 8.0
    drift = properties.energy(bench(changed("velocity", 0.8 * along))).measured
    assert drift == pytest.approx(20.16 / 120.16)
    rest = exact(np.zeros(9))
    assert isinstance(properties.energy(bench(rest)), Outside), "nothing moves"
    driven = SCENE.with_(driver=(Driver(joint="A", polynomial=(0.0, RATE)),))
    assert isinstance(properties.energy(bench(scene=driven)), Outside)
    asked = []

    def run(scene: Scene, times: np.ndarray) -> Trajectory:
        asked.append(len(times))
        return exact(times)

    pushed = SCENE.with_(load=(Moment(body="wheel", moment=(1.0, 0.0, 0.0)),))
    assert properties.energy(bench(scene=pushed, run=run)).measured < 1e-12 and asked == [properties.DENSE]


def test_reactions_that_are_off_or_missing():
    """The hinge pulls with 48 N."""
    run = exact()
    run.reactions["A"][4, 2] += 4.8
    assert properties.balanced(bench(run)).measured == pytest.approx(0.1, rel=0.05)
    turning = exact()
    turning.reactions["A"][4, 5] += 19.2
    assert properties.workless(bench(turning)).measured > 0.05, "a moment about the axis does work"
    assert isinstance(properties.balanced(bench(replace(run, reactions=None))), Outside)
    assert isinstance(properties.balanced(bench(exact=replace(exact(), acceleration=None))), Outside)
    missing = properties.workless(bench(replace(run, reactions={"B": run.reactions["A"]})))
    assert missing.measured == math.inf and missing.remark == "no reaction is given in A"


def observation(value: Any = None, printed: str = "", files: tuple[str, ...] = ()) -> SimpleNamespace:
    return SimpleNamespace(value=value, printed=printed, files=list(files))


def test_a_run_that_prints_or_leaves_files_twice():
    def seen(first: SimpleNamespace, second: SimpleNamespace) -> Any:
        return properties.silence(
            bench(finest=first, settings=["s"], observed=lambda scene, times, setting: second)
        )

    quiet, loud = observation(), observation(printed="one\ntwo\n", files=("a", "b", "c", "d"))
    assert seen(quiet, loud).measured == 0.0 and seen(loud, quiet).measured == 0.0
    found = seen(loud, loud)
    assert (found.measured, found.allowed, found.remark) == (6.0, 0.0, "printed 'one'; a; b; c")


def test_repeated_runs_have_equal_bits():
    def found(*others: Trajectory) -> float:
        first, *shared = others
        return properties.determinism(bench(run=lambda scene, times: first, shared_runs=shared)).measured

    same = exact()
    assert found(same, same) == 0.0
    assert found(same, changed("velocity", (0.0, 1e-16 + 2**-40, 0.0))) == pytest.approx(2**-40)
    assert found(replace(same, acceleration=None), same) == math.inf
    off = exact()
    off.reactions["A"][0, 0] += 0.5
    assert found(same, off) == pytest.approx(0.5) and found(replace(same, reactions=None)) == math.inf


def test_a_motion_depends_on_no_other_samples():
    asked: list[np.ndarray] = []

    def run(scene: Scene, times: np.ndarray) -> Trajectory:
        asked.append(times)
        made = exact(np.array(times))
        return made if len(times) > 1 else replace(made, position=made.position + np.array([0.0, 0.0, 0.4]))

    found = properties.other_times(bench(run=run, own_accuracy=1e-7, floors="f"))
    many, last = asked
    assert len(many) == 16 and last.tolist() == [0.5] and set(TIMES[1:]) <= set(many)
    assert many[0] == pytest.approx(0.3 / 16) and many[2] == pytest.approx(1.7 / 16), (
        "at 0.3 and 0.7 of the gaps"
    )
    assert found == (pytest.approx(0.1), 1e-7, "f")
    assert (
        properties.other_times(bench(run=lambda s, t: exact(np.array(t)), own_accuracy=0, floors="")).measured
        == 0
    )


def test_the_end_of_a_driven_mechanism():
    def ended(outcome: Outcome, motion: Trajectory) -> Any:
        value = replace(motion, outcome=outcome, message="it locks")
        return properties.honest_end(bench(finest=observation(value)))

    found = ended(Outcome.NOT_CONVERGED, exact())
    assert found.measured < 1e-15 and found.allowed == STAYS_CLOSED and found.remark == "NOT_CONVERGED"
    for outcome in (Outcome.COMPLETED, Outcome.CRASHED, Outcome.TIMED_OUT):
        found = ended(outcome, exact())
        assert found.measured == math.inf and found.remark == f"{outcome.label} it locks"
    assert ended(Outcome.NOT_CONVERGED, changed("position", (0.0, 0.0, 0.004))).measured == pytest.approx(
        1e-3
    )
    lost = ended(Outcome.NOT_CONVERGED, changed("position", (np.nan, 0.0, 0.0)))
    assert lost.measured == math.inf


def test_an_error_above_what_the_order_explains():
    def found(**more: Any) -> Any:
        made = {
            "settings": ["c", "f"],
            "resolution": 1e-4,
            "exact_bound": 1e-3,
            "floors": "f",
            "contraction": 0.5,
        }
        return properties.convergence(bench(changed("position", (0.0, 0.0, 0.04)), **{**made, **more}))

    assert isinstance(found(settings=["f"]), Outside)
    assert found() == (pytest.approx(0.01), pytest.approx(1.1e-3), "f, 5.0e-01 of the difference before")
    assert found(resolution=0.02).allowed == 0.02


def test_checks_have_their_scenes_and_versions():
    kinds = {
        name: (p.of(SimpleNamespace(dead_end=False, related=True, scene=SCENE)), p.version)
        for name, p in properties.PROPERTIES.items()
    }
    assert kinds["dead end"] == (False, 1) and kinds["refined"] == (False, 1) and kinds["truth"] == (True, 2)
    assert kinds["repeated"] == (True, 2) and kinds["resampled"] == (True, 3)
    end = SimpleNamespace(dead_end=True, related=False, scene=SCENE.with_(joint=()))
    assert {name for name, p in properties.PROPERTIES.items() if p.of(end)} == {"dead end", "refined"}


PIN = Spherical(name="B", bodies=("wheel", "rod"), anchor=(5.0, 0.0, 0.0))
ROD = Body(
    name="rod",
    mass=2.0,
    inertia=(0.1, 0.4, 0.45),
    position=(6.0, 0.0, 0.0),
    velocity=(0.0, 12.0, 0.0),
    angular_velocity=(0.0, 0.0, RATE),
)
LOADS = (
    TorsionSpring(joint="A", stiffness=2.0),
    Force(body="rod", force=(1.0, 0.0, 0.0), point=(6.0, 1.0, 0.0)),
)
PAIR = SCENE.with_(
    body=(WHEEL.model_copy(update={"velocity": (0.0, 8.0, 0.0)}), ROD),
    joint=(HINGE, PIN),
    load=LOADS,
)


def test_other_names():
    scene = rewritings.relabelled(PAIR.with_(driver=(Driver(joint="A", polynomial=(0.0, RATE)),)))
    assert [b.name for b in scene.body] == ["part z0", "part y1"]
    assert [(j.name, j.bodies) for j in scene.joint] == [
        ("joint z0", ("ground", "part z0")),
        ("joint y1", ("part z0", "part y1")),
    ]
    assert scene.driver[0].joint == scene.load[0].joint == "joint z0" and scene.load[1].body == "part y1"
    motion = rewritings.renamed(SCENE, exact())
    assert motion.bodies == ("part z0",) and list(motion.reactions) == ["joint z0"]
    assert rewritings.renamed(SCENE, replace(exact(), reactions=None)).reactions is None


def test_exchanged_bodies_and_longer_axes():
    scene = rewritings.swapped(PAIR)
    assert [j.bodies for j in scene.joint] == [("wheel", "ground"), ("rod", "wheel")]
    assert scene.joint[0].axis == (0, 0, -2) and scene.joint[1].anchor == PIN.anchor
    assert rewritings.stretched(PAIR).joint[0].axis == (0, 0, 2000)
    for change in (rewritings.swapped, rewritings.stretched, rewritings.duplicated, rewritings.satisfied):
        assert isinstance(change(PAIR.with_(joint=(), load=())), Outside)
    assert isinstance(rewritings.stretched(PAIR.with_(joint=(PIN,), load=())), Outside), "a ball has no axis"
    assert isinstance(rewritings.satisfied(PAIR.with_(joint=(PIN,), load=())), Outside)
    again = rewritings.duplicated(PAIR).joint
    assert [j.name for j in again] == ["A", "B", "again"] and again[2].bodies == PIN.bodies
    *_, sleeve = rewritings.satisfied(PAIR).joint
    assert isinstance(sleeve, Cylindrical) and sleeve.bodies == HINGE.bodies
    assert sleeve.anchor == pytest.approx((0.0, 0.0, 0.3)) and sleeve.axis == pytest.approx((0.0, 0.0, 1.0))


def test_negative_quaternions():
    assert [b.orientation for b in rewritings.negated(PAIR).body] == [(-1, 0, 0, 0)] * 2


def test_a_body_in_two_halves():
    """Both halves together have the mass, the momentum and the inertia of the rod."""
    scene = rewritings.split(PAIR)
    _, first, second = scene.body
    assert (first.name, second.name, first.mass, second.mass) == ("rod", "rod half", 1.0, 1.0)
    weld = scene.joint[-1]
    assert (weld.type, weld.bodies, weld.anchor) == ("fixed", ("rod", "rod half"), ROD.position)
    inertia = np.zeros((3, 3))
    for half in (first, second):
        r = np.subtract(half.position, ROD.position)
        given = np.array(half.inertia)
        own = np.diag(given) if given.ndim == 1 else given
        inertia += own + half.mass * (r @ r * np.eye(3) - np.outer(r, r))
        assert half.velocity == pytest.approx(np.add(ROD.velocity, np.cross(ROD.angular_velocity, r)))
        assert half.angular_velocity == ROD.angular_velocity and np.linalg.norm(r) > 0.05
    assert np.allclose(inertia, np.diag(ROD.inertia), atol=1e-15)
    assert np.add(first.position, second.position) / 2 == pytest.approx(ROD.position)
    poses, twists = initial_poses(scene), initial_twists(scene)
    rates = closure_rates(scene, np.zeros(1), *(a[None] for a in (*poses, *twists)))
    assert max(np.abs(r).max() for r in rates.values()) < 1e-14


def test_motion_of_two_halves():
    scene = SCENE.with_(body=(WHEEL.model_copy(update={"velocity": (0.0, 8.0, 0.0)}),))
    halves, motion = rewritings.split(scene), exact()
    found = rewritings.of_halves(scene, motion)
    assert found.bodies == ("wheel", "wheel half") and found.acceleration is None
    assert found.position.mean(axis=1) == pytest.approx(motion.position[:, 0])
    assert found.position[0] == pytest.approx(np.array([b.position for b in halves.body]))
    assert found.velocity[0] == pytest.approx(np.array([b.velocity for b in halves.body]))
    arm = found.position[:, 0] - motion.position[:, 0]
    assert np.linalg.norm(arm, axis=1) == pytest.approx(np.linalg.norm(arm[0]))
    assert found.velocity[:, 1] == pytest.approx(
        motion.velocity[:, 0] - np.cross(motion.angular_velocity[:, 0], arm)
    )


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"mass": None, "inertia": None}, "no mass to split"),
        ({"velocity": None}, "are not given"),
        ({"angular_velocity": None}, "are not given"),
        ({"velocity": (0.0, 12.1, 0.0)}, "contradict the joints"),
        ({"inertia": (0.0, 0.4, 0.4)}, "halves"),
    ],
)
def test_a_body_that_is_not_split(change, says):
    loads = () if change.get("mass", 1) is None else LOADS
    found = rewritings.split(PAIR.with_(body=(PAIR.body[0], ROD.model_copy(update=change)), load=loads))
    assert (isinstance(found, Outside) and says in str(found)) or says == "halves", found


def test_length_of_the_scene():
    assert scene_length(SCENE) == LENGTH
