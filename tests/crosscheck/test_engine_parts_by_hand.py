"""Parts that adapters share / steps, samples, frames, coordinates and refusals worked out by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.engines import driver_motion, fixed_steps, sampling
from crosscheck.engines.compiler import Compiler, NoLibrary
from crosscheck.engines.fixed_steps import FixedSteps, held_points, steps, unended_piece
from crosscheck.engines.geometry import cross_matrix, in_body, joint_frame, point_in_body, unit
from crosscheck.engines.joint_coordinates import JointCoordinates, joint_coordinates
from crosscheck.engines.pieces import pieces
from crosscheck.engines.sampling import Counts, Failed, Sample, rk4, run_through, step_count
from crosscheck.engines.spanning_tree import BALL_JOINT, FREE, SLIDE, TURN, Closure, Mobility
from crosscheck.engines.written import Written
from crosscheck.judge.constraints import scene_length
from crosscheck.refusals import FACTOR, TABLE, Cannot, Owner, Supports
from mbref import rotations
from mbref.scene import (
    Body,
    Coupling,
    Cylindrical,
    Driver,
    Factor,
    Force,
    JointTorque,
    Moment,
    Revolute,
    Scene,
    Sine,
    SlideSpring,
    Spherical,
    Spring,
    TorsionSpring,
    Translational,
)
from mbref.trajectory import Outcome

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
HALF = math.sqrt(0.5)
HINGE = Revolute(name="H", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 2.0))


def body(name: str = "b", **parts: Any) -> Body:
    return Body(
        **{"name": name, "mass": 4.0, "inertia": (1.0, 2.0, 3.0), "position": (1.0, 2.0, 3.0), **parts}
    )


def scene(*bodies: Body, **parts: Any) -> Scene:
    return Scene(**{"name": "s", "body": bodies or (body(),), "joint": (HINGE,), "duration": 2.0, **parts})


# --- frames -----------------------------------------------------------------------------------------------
def test_vectors_and_matrices():
    assert unit((0.0, 3.0, -4.0)).tolist() == [0.0, 0.6, -0.8]
    assert (cross_matrix(np.array([1.0, 2.0, 3.0])) @ [4.0, 5.0, 6.0]).tolist() == [-3.0, 6.0, -3.0]


@pytest.mark.parametrize("axis", [X, Y, Z, (1.0, 2.0, 2.0), (-3.0, 0.1, 4.0)])
def test_a_joint_frame_has_its_axis_last(axis):
    frame = joint_frame(axis)
    assert frame[:, 2] == pytest.approx(np.array(axis) / np.linalg.norm(axis))
    assert frame.T @ frame == pytest.approx(np.eye(3)) and np.linalg.det(frame) == pytest.approx(1.0)
    least = np.argmin(np.abs(axis))
    assert frame[least, 0] == pytest.approx(0.0, abs=1e-15), "the first column is across the least component"


def test_world_vectors_in_the_axes_of_a_body():
    """The body is turned by 90° about z: X of the world is -y of the body, Y is x."""
    turned = scene(body(orientation=(HALF, 0.0, 0.0, HALF)))
    assert in_body(turned, "b", np.array([X, Y])) == pytest.approx(np.array([[0, -1, 0], [1, 0, 0.0]]))
    assert point_in_body(turned, "b", (2.0, 2.0, 4.0)) == pytest.approx([0.0, -1.0, 1.0])
    assert in_body(turned, "ground", np.array([X])).tolist() == [list(X)]
    assert point_in_body(turned, "ground", (2.0, 2.0, 4.0)).tolist() == [2.0, 2.0, 4.0]


# --- steps ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("t0", "t1", "step", "count"),
    [
        (0.0, 1.0, 0.25, 4),
        (0.0, 1.0, 0.3, 4),
        (1.0, 2.0, 5.0, 1),
        (0.0, 0.3, 0.1, 3),
        (0.0, 1.0, 0.25 - 1e-8, 5),
    ],
)
def test_equal_steps_between_samples(t0, t1, step, count):
    assert step_count(t0, t1, step) == count


@pytest.mark.parametrize("count", [1, 2, 4])
def test_the_classical_runge_kutta_method(count):
    """One step of y' = y multiplies by 1 + h + h²/2 + h³/6 + h⁴/24; a step of y' = 3 t² is exact."""
    counts, h = Counts(), 0.5 / count
    found = rk4(lambda t, y: y, lambda t, y: y, np.ones(1), 0.0, 0.5, 0.5 / count, counts)
    assert found[0] == pytest.approx((1 + h + h**2 / 2 + h**3 / 6 + h**4 / 24) ** count, rel=1e-14)
    assert (counts.steps, counts.rhs, counts.rejected) == (count, 4 * count, 0)
    asked: list[float] = []
    found = rk4(
        lambda t, y: asked.append(t) or 3 * t**2 + 0 * y, lambda t, y: y, np.ones(1), 1.0, 2.0, 1.0, counts
    )
    assert found[0] == pytest.approx(8.0) and asked == [1.0, 1.5, 1.5, 2.0]


def test_each_state_is_settled_and_must_be_finite():
    settled: list[float] = []

    def settle(t: float, y: np.ndarray) -> np.ndarray:
        settled.append(t)
        return y + 1.0

    assert rk4(lambda t, y: 0 * y, settle, np.zeros(1), 0.0, 1.0, 0.5, Counts())[0] == 2.0
    assert settled == [0.5, 1.0]
    with pytest.raises(Failed, match=r"not finite after the step from 0\.5 s") as caught:
        rk4(
            lambda t, y: y + (math.inf if t > 0.5 else 0.0),
            lambda t, y: y,
            np.ones(1),
            0.0,
            1.0,
            0.5,
            Counts(),
        )
    assert caught.value.outcome is Outcome.NOT_FINITE and caught.value.t == 0.5


@pytest.mark.parametrize(
    ("error", "factor"),
    [
        (0.0, 10.0),
        (1.0, 0.9),
        (256.0, 0.45),
        (1e9, 0.2),
        (1e-20, 10.0),
        (math.nan, 0.2),
        (math.inf, 0.2),
        (0.5**8, 1.8),
    ],
)
def test_the_factor_for_the_next_step(error, factor):
    assert sampling._growth(error) == pytest.approx(factor)


def test_steps_of_a_scene():
    """Angles of 0.15 to 0.0015 rad at 3 rad/s; a run takes at most 250 000 steps."""
    assert steps(scene(), 3.0) == [0.05, 0.017, 0.005, 0.0017, 0.0005]
    assert steps(scene(), 3.0, most=400) == [0.05, 0.017, 0.005] and steps(scene(), 3.0, most=1) == [0.05]
    assert steps(scene(), 3.0, finer=2)[-2:] == [0.00017, 5.6e-05]
    assert steps(scene(duration=500.0), 3.0) == [0.05, 0.017, 0.005]
    assert steps(scene(duration=1250.0), 3.0) == [0.05, 0.017, 0.005], "250 000 steps of 5 ms"
    assert steps(scene(duration=1251.0), 3.0) == [0.05, 0.017]
    assert steps(scene(duration=1e6), 3.0) == [0.05], "one step is kept in any case"


class Stepper:
    """A stepper whose motion is not finite after a time."""

    def __init__(self, end: float = math.inf) -> None:
        self.end, self.taken, self.now = end, [], 0.0

    def step(self, t: float, h: float, count: int) -> None:
        self.taken.append((t, h, count))
        self.now = t + h * count

    def motion(self) -> Any:
        return SimpleNamespace(position=np.array([[math.nan if self.now > self.end else 0.0, 1.0]]))


def test_fixed_steps_are_counted_and_end_where_the_state_is_lost():
    stepper = Stepper(1.5)
    run = FixedSteps(scene(), None, stepper, 0.3)
    run.advance(0.0, 1.0)
    assert stepper.taken == [(0.0, 0.25, 4)] and (run.counts.steps, run.counts.rhs) == (4, 4)
    with pytest.raises(Failed, match="became infinite or NaN between 1 s and 2 s") as caught:
        run.advance(1.0, 2.0)
    assert caught.value.t == 1.0 and caught.value.outcome is Outcome.NOT_FINITE and run.counts.steps == 8


def test_an_unknown_family_is_refused():
    engine = SimpleNamespace(families={"a": ""}, name="e")
    with pytest.raises(ValueError, match="e has no family of settings 'b'"):
        fixed_steps.simulated(engine, scene(), np.zeros(1), Setting("b"), lambda: None)


def test_loads_that_change_between_steps():
    table = Factor(table=((0.0, 0.0), (1.0, 1.0), (2.0, 3.0), (3.0, 4.0)))
    smooth = Moment(body="b", moment=Z, factor=Factor(sine=Sine(amplitude=1.0)))
    switched = Force(body="b", point=X, force=Z, factor=Factor(start=0.5))
    assert unended_piece(scene(load=(smooth, Moment(body="b", moment=Z)))) is None
    for load in (switched, Moment(body="b", moment=Z, factor=table)):
        found = unended_piece(scene(load=(smooth, load)))
        assert found.owner is Owner.ADAPTER and found.reason.startswith(
            "load[1] follows a table or is switched"
        )


@pytest.mark.parametrize(
    ("loads", "is_constant"),
    [
        ((), True),
        ((Moment(body="b", moment=Z),), True),
        ((Moment(body="b", moment=Z, factor=Factor(start=1.0)),), False),
        ((Moment(body="b", moment=Z), Force(body="b", point=X, force=Z)), False),
    ],
)
def test_constant_loads_are_found_once(monkeypatch, loads, is_constant):
    asked: list[Any] = []
    monkeypatch.setattr(fixed_steps, "applied", lambda *given: asked.append(given[2]) or [len(asked)])
    monkeypatch.setattr(fixed_steps, "replace", lambda motion, time: (motion, time))
    held = fixed_steps.Loads(scene(load=loads), "tree", lambda: "motion")
    found = held.at(0.25), held.at(0.5)
    assert asked == (["motion"] if is_constant else [("motion", 0.25), ("motion", 0.5)])
    assert found == (([1], [1]) if is_constant else ([1], [2]))


def test_points_that_close_a_loop():
    """One of a ball, two at 0.1 of the scene's length from the anchor of a hinge, three of a weld."""
    given = scene()
    arm = 0.1 * scene_length(given)
    place = np.array([1.0, 2.0, 3.0])

    def points(kind: str) -> list[list[float]]:
        closure = Closure(kind, 0, (0, 1), place)
        return [list(point - place) for point in held_points(given, closure)]

    assert points("point") == [[0.0, 0.0, 0.0]]
    assert np.array(points("revolute")) == pytest.approx(np.array([[0, 0, -arm], [0, 0, arm]]))
    assert np.array(points("weld")) == pytest.approx(arm * np.eye(3))


# --- samples ----------------------------------------------------------------------------------------------
def sampled(t: float, **parts: Any) -> Sample:
    zero = np.zeros((1, 3))
    given = {"position": zero + t, "orientation": np.array([[1.0, 0, 0, 0]]), "acceleration": zero}
    made = {"velocity": zero, "angular_velocity": zero, "angular_acceleration": zero, **given, **parts}
    return Sample(**made)


LABELS = {"engine": "e", "version": "1", "method": "m", "settings": {}}


def test_a_run_from_sample_to_sample():
    moved: list[tuple[float, float]] = []
    found = run_through(
        scene(),
        np.array([0.0, 0.5, 2.0]),
        lambda t0, t1: moved.append((t0, t1)),
        lambda t: sampled(t, reactions={"H": np.full(6, t)}),
        Counts(3, 2, 1),
        0.25,
        LABELS,
    )
    assert moved == [(0.0, 0.5), (0.5, 2.0)], "nothing is advanced to the start"
    assert found.outcome is Outcome.COMPLETED and (found.t_end, found.message) == (2.0, "")
    assert found.position[:, 0, 0].tolist() == [0.0, 0.5, 2.0] and found.bodies == ("b",)
    assert found.reactions["H"][:, 5].tolist() == [0.0, 0.5, 2.0]
    cost = found.cost
    assert (cost.build_seconds, cost.steps, cost.rejected, cost.rhs) == (0.25, 3, 2, 1) and cost.seconds >= 0


def test_a_run_that_ends_early_keeps_its_samples():
    def advance(t0: float, t1: float) -> None:
        if t1 > 1.0:
            raise Failed(Outcome.STEP_FAILED, 0.75, "no step")

    times = np.array([0.0, 0.5, 2.0])
    found = run_through(scene(), times, advance, sampled, Counts(), 0.0, LABELS)
    assert (found.outcome, found.t_end, found.message) == (Outcome.STEP_FAILED, 0.75, "no step")
    assert (
        found.times.tolist() == [0.0, 0.5] and found.position.shape == (2, 1, 3) and found.reactions is None
    )
    lost = run_through(
        scene(), times, lambda *_: None, lambda t: sampled(math.nan if t > 1 else t), Counts(), 0.0, LABELS
    )
    assert (lost.outcome, lost.t_end, len(lost.times)) == (Outcome.NOT_FINITE, 0.5, 2)
    assert lost.message == "the motion is not finite at 2 s"


def test_accelerations_that_an_engine_does_not_give():
    without = run_through(
        scene(),
        np.array([0.0]),
        lambda *_: None,
        lambda t: sampled(t, acceleration=sampling.UNKNOWN, angular_acceleration=sampling.UNKNOWN),
        Counts(),
        0.0,
        LABELS,
    )
    assert without.acceleration is None and without.angular_acceleration is None
    empty = run_through(scene(), np.zeros(0), lambda *_: None, sampled, Counts(), 0.0, LABELS)
    assert empty.position.shape == (0, 1, 3) and empty.orientation.shape == (0, 1, 4)


# --- coordinates of a tree --------------------------------------------------------------------------------
def link(*kinds: str, parent: int = -1, at: float = 0.0) -> Any:
    place = np.array([at, 0.0, 0.0])
    return SimpleNamespace(
        mobilities=tuple(Mobility(kind, np.array(Z)) for kind in kinds),
        parent=parent,
        anchor=place,
        position=place + np.array(Y),
        mass=2.0,
        offset=np.array(Z),
        inertia=np.diag([1.0, 2.0, 3.0]),
    )


def test_positions_and_velocities_of_a_tree():
    """A slide and a turn, a ball, and a free link: 2 + 4 + 7 positions, 2 + 3 + 6 velocities."""
    tree = SimpleNamespace(links=(link(SLIDE, TURN), link(BALL_JOINT), link(FREE)))
    found = joint_coordinates(tree, True)
    assert (found.nq, found.nv) == (13, 11)
    assert found.single.tolist() == found.single_q.tolist() == [0, 1]
    assert found.quaternions == ((2, 2), (9, 8)) and found.places == ((6, 5),)
    assert found.start().tolist() == [0, 0, 1, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0]
    q = np.arange(13.0)
    assert found.of_velocities(q).tolist() == [0.0, 1.0, *[0.0] * 9]
    empty = joint_coordinates(SimpleNamespace(links=()), True)
    assert (empty.nq, empty.nv, empty.single.shape) == (0, 0, (0,)) and empty.start().size == 0


def one_ball(in_child: bool, places: tuple[Any, ...] = ()) -> JointCoordinates:
    none = np.zeros(0, dtype=int)
    return JointCoordinates(3, 4, none, none, ((0, 0),), places, in_child)


@pytest.mark.parametrize("in_child", [True, False])
def test_rates_of_a_quaternion(in_child):
    """Half of the product with the angular velocity, in the axes of the child or of the parent."""
    q, spin = np.array([HALF, HALF, 0.0, 0.0]), np.array([0.0, 2.0, 0.0])
    other = rotations.multiply
    wanted = other(q, np.array([0.0, *spin])) / 2 if in_child else other(np.array([0.0, *spin]), q) / 2
    assert one_ball(in_child).rates(3 * q, spin) == pytest.approx(wanted), "of a unit quaternion"
    moved = one_ball(in_child).moved(q, np.array([0.0, math.pi / 2, 0.0]))
    turn = np.array([HALF, 0.0, HALF, 0.0])
    assert moved == pytest.approx(other(q, turn) if in_child else other(turn, q))
    assert one_ball(in_child).normalised(5 * q) == pytest.approx(q)


def test_a_free_link_turns_about_axes_of_the_world():
    none = np.zeros(0, dtype=int)
    free = JointCoordinates(6, 7, none, none, ((3, 3),), ((0, 0),), True)
    q = np.array([1.0, 2.0, 3.0, HALF, HALF, 0.0, 0.0])
    v = np.array([4.0, 5.0, 6.0, 0.0, 2.0, 0.0])
    spin = np.array([0.0, 0.0, 2.0, 0.0])
    assert free.rates(q, v)[:3].tolist() == [4.0, 5.0, 6.0]
    assert free.rates(q, v)[3:] == pytest.approx(rotations.multiply(spin, q[3:]) / 2)
    assert free.moved(q, v)[:3].tolist() == [5.0, 7.0, 9.0]
    line = JointCoordinates(1, 1, np.array([0]), np.array([0]), (), (), False)
    same = np.array([3.0])
    assert line.normalised(same) is same and line.moved(same, np.array([0.5])).tolist() == [3.5]


def test_pieces_of_a_chain():
    """A slide and a turn need an auxiliary body of a thousandth; a welded link has no joint velocity."""
    tree = SimpleNamespace(
        links=(link(SLIDE, TURN, at=1.0), link(parent=0, at=2.0), link(BALL_JOINT, parent=1, at=3.0)),
        starts=(0, 2, 2),
    )
    aux, first, welded, ball = pieces(tree, 1e-3)
    assert [p.link for p in (aux, first, welded, ball)] == [-1, 0, 1, 2]
    assert [p.parent for p in (aux, first, welded, ball)] == [-1, 0, 1, 2]
    assert [p.velocity for p in (aux, first, welded, ball)] == [0, 1, 2, 2]
    assert aux.mobility.kind == SLIDE and first.mobility.kind == TURN and welded.mobility is None
    assert aux.mass == pytest.approx(2e-3) and aux.inertia == pytest.approx(6e-3 * np.eye(3))
    assert aux.origin.tolist() == aux.anchor.tolist() == [1.0, 0.0, 0.0] and not aux.offset.any()
    assert first.origin.tolist() == [1.0, 1.0, 0.0] and first.anchor.tolist() == [1.0, 0.0, 0.0]
    assert first.mass == 2.0 and first.offset.tolist() == list(Z) and first.inertia[2, 2] == 3.0
    assert ball.origin.tolist() == [3.0, 1.0, 0.0]
    three = SimpleNamespace(links=(link(SLIDE, SLIDE, TURN),), starts=(4,))
    assert [(p.velocity, p.parent, p.link) for p in pieces(three, 1e-3)] == [
        (4, -1, -1),
        (5, 0, -1),
        (6, 1, 0),
    ]


# --- drivers ----------------------------------------------------------------------------------------------
def test_value_rate_and_acceleration_of_a_driver():
    """1 + 2 t + 3 t² + t³, and 0.5 sin(4 t + 0.3), at 2 s."""
    wave = Sine(amplitude=0.5, frequency=4.0, phase=0.3)
    factor = Factor(polynomial=(1.0, 2.0, 3.0, 1.0), sine=wave, start=1.0, stop=3.0)
    s, c = math.sin(8.3), math.cos(8.3)
    wanted = (25.0 + 0.5 * s, 26.0 + 2.0 * c, 18.0 - 8.0 * s)
    assert driver_motion.motion(factor, 2.0) == pytest.approx(wanted)
    assert driver_motion.motion(factor, 0.999) == driver_motion.motion(factor, 3.0) == (0.0, 0.0, 0.0)
    assert driver_motion.motion(factor, 3.0, since=2.0)[0] > 0, "the piece before acts until its end"
    cubic = Driver(joint="H", table=tuple((t, t**3) for t in (0.0, 1.0, 2.0, 3.0)))
    assert driver_motion.motion(cubic, 1.5) == pytest.approx((3.375, 6.75, 9.0))
    assert driver_motion.mean_rate(cubic, 1.0, 0.5) == pytest.approx(4.75)
    at = driver_motion.moving(cubic)
    assert at(1.5) is at(1.5) and at(1.0) == pytest.approx((1.0, 3.0, 6.0))


@pytest.mark.parametrize(
    ("parts", "rate"),
    [
        ({}, 0.5),
        ({"driver": (Driver(joint="H", polynomial=(0.0, 0.0, -2.0)),)}, 8.0),
        ({"driver": (Driver(joint="H", sine=Sine(amplitude=0.01, frequency=-9.0)),)}, 9.0),
        ({"load": (Spring(bodies=("b", "ground"), points=(X, Y), stiffness=36.0, natural_length=1.0),)}, 3.0),
        (
            {
                "load": (
                    Spring(
                        bodies=("b", "ground"), points=(X, Y), stiffness=0.0, damping=8.0, natural_length=1.0
                    ),
                )
            },
            2.0,
        ),
        ({"load": (TorsionSpring(joint="H", stiffness=18.0),)}, 3.0),
        ({"load": (TorsionSpring(joint="H", stiffness=0.0, damping=8.0),)}, 4.0),
        ({"load": (SlideSpring(joint="S", stiffness=36.0),)}, 3.0),
        (
            {"load": (Moment(body="b", moment=Z, factor=Factor(sine=Sine(amplitude=1.0, frequency=-7.0))),)},
            7.0,
        ),
        ({"load": (JointTorque(joint="H", torque=99.0),)}, 0.5),
    ],
)
def test_the_fastest_rate_that_is_stated(parts, rate):
    """One over the duration of 2 s; springs act on the least mass, 4 kg, or middle moment, 2 kg m²."""
    slide = Translational(name="S", bodies=("ground", "c"), anchor=(1.0, 2.0, 3.0), axis=X)
    given = scene(body(), body("c", mass=5.0, inertia=(9.0, 9.0, 9.0)), joint=(HINGE, slide), **parts)
    assert driver_motion.stated_rate(given) == pytest.approx(rate)
    turning = given.with_(body=(body(angular_velocity=(6.0, 0.0, 8.0)), given.body[1]))
    assert driver_motion.stated_rate(turning) == pytest.approx(10.0)


def test_scenes_without_masses_have_a_rate_too():
    """A driver alone turns the four-bar, with 2 pi times one over its duration at least."""
    from mbref.scenes import SCENES

    given = SCENES["four_bar"]()
    assert driver_motion.stated_rate(given) >= 1 / given.duration


@pytest.mark.parametrize(
    ("speeds", "outcomes", "rate", "count"),
    [
        ([9.0], [Outcome.COMPLETED], 9.0, 1),
        ([0.25], [Outcome.COMPLETED], 0.5, 1),
        ([499.0], [Outcome.COMPLETED], 499.0, 1),
        ([500.0, 600.0], [Outcome.COMPLETED] * 2, 600.0, 2),
        ([9.0, 8.0], [Outcome.STEP_FAILED, Outcome.COMPLETED], 8.0, 2),
        ([9.0, 8.0], [Outcome.STEP_FAILED] * 2, 8.0, 2),
        ([1e6, 1e6], [Outcome.COMPLETED] * 2, 4000.0, 2),
        ([None], [Outcome.COMPLETED], 0.5, 1),
    ],
)
def test_the_fastest_rate_of_coarse_runs(speeds, outcomes, rate, count):
    """2000 steps in 2 s, then 16000, where a body turns by half a rad or more in a step; 1 / 2 s at least."""
    asked = []

    def coarse(step):
        k = len(asked)
        asked.append(step)
        turning = np.zeros((0, 2, 3)) if speeds[k] is None else np.zeros((3, 2, 3))
        if speeds[k] is not None:
            turning[1, 1] = 0.6 * speeds[k], 0.0, -0.8 * speeds[k]
        return SimpleNamespace(angular_velocity=turning, outcome=outcomes[k])

    assert driver_motion.fastest_rate(scene(duration=2.0), coarse) == pytest.approx(rate)
    assert asked == [2 / 2000, 2 / 16000][:count]


def test_pieces_of_switched_tables_at_their_ends():
    """The cubic through 0, 1, 8, 27 starts at 1 s where it is switched on, and is zero before."""
    rows = tuple((t, t**3) for t in (0.0, 1.0, 2.0, 3.0))
    factor = Factor(table=rows, start=1.0, stop=2.5)
    assert driver_motion.motion(factor, 0.999) == (0.0, 0.0, 0.0)
    assert driver_motion.motion(factor, 1.0) == pytest.approx((1.0, 3.0, 6.0))
    assert driver_motion.motion(factor, 2.5) == (0.0, 0.0, 0.0)
    assert driver_motion.motion(factor, 2.5, since=2.0) == pytest.approx((15.625, 18.75, 15.0))
    assert driver_motion.motion(factor, 1.0, since=0.5) == (0.0, 0.0, 0.0)


# --- refusals ---------------------------------------------------------------------------------------------
EVERYTHING = Supports(
    joints=("revolute", "cylindrical"),
    drivers=("angle",),
    loads=("moment",),
    couplings=("angle",),
    armatures=("angle",),
    over_time=(TABLE, FACTOR),
)
TABLE_ROWS = ((0.0, 0.0), (1.0, 1.0), (2.0, 3.0), (3.0, 4.0))


def missing(supports: Supports = EVERYTHING, **parts: Any) -> list[str]:
    return list(supports._missing(scene(**parts)))


def test_features_that_an_adapter_does_not_have():
    ball = Spherical(name="B", bodies=("ground", "b"), anchor=X)
    slide = Translational(name="S", bodies=("ground", "b"), anchor=X, axis=X, armature=2.0)
    screw = Cylindrical(name="C", bodies=("ground", "b"), anchor=X, axis=X, armature=2.0)
    assert missing() == [] and missing(joint=(HINGE, screw)) == []
    assert missing(joint=(HINGE, ball)) == ["joint 'B' is of type 'spherical'"]
    assert missing(joint=(slide,)) == ["joint 'S' is of type 'translational'", "joint 'S' has an armature"]
    assert missing(joint=(slide,), driver=(Driver(joint="S", polynomial=(0.0, 1.0)),))[2:] == [
        "the driver of joint 'S' prescribes its displacement"
    ]
    assert missing(load=(Moment(body="b", moment=Z), Force(body="b", point=X, force=Z))) == [
        "load[1] is of type 'force'"
    ]


def test_functions_of_time_that_an_adapter_does_not_have():
    driver = Driver(joint="H", table=TABLE_ROWS)
    load = Moment(body="b", moment=Z, factor=Factor(start=1.0))
    parts = {"driver": (driver,), "load": (Moment(body="b", moment=Z), load)}
    assert missing(**parts) == []
    without = Supports(joints=("revolute",), drivers=("angle",), loads=("moment",))
    assert missing(without, **parts) == [
        "the driver of joint 'H' follows a table",
        "load[1] changes with time",
    ]


def test_couplings_that_an_adapter_does_not_have():
    screw = Cylindrical(name="C", bodies=("ground", "b"), anchor=X, axis=X)
    thread = Coupling(name="T", joints=("C", "C"), ratio=0.1, offset=0.5)
    assert missing(joint=(screw,), coupling=(thread,)) == [
        "coupling 'T' has an offset (scene.assembled() has none)",
        "coupling 'T' couples the displacement of joint 'C'",
    ]
    assert str(Cannot(Owner.ENGINE, "no loops")) == "no loops (missing in the engine)"


def test_the_refusal_of_the_first_missing_feature():
    light = body(mass=0.0, inertia=(0.0, 0.0, 0.0))
    assert missing() == [] and list(EVERYTHING._missing(scene(light))) == ["body 'b' is a massless link"]
    assert Supports(joints=("revolute",), massless_links=True).missing(scene(light)) is None
    refusal = Supports().missing(scene(load=(Moment(body="b", moment=Z),)))
    assert refusal.owner is Owner.ADAPTER
    assert refusal.reason == "joint 'H' is of type 'revolute', which the adapter does not map"


# --- compilers and code -----------------------------------------------------------------------------------
def test_the_compiler_that_is_installed(monkeypatch):
    compiler = Compiler("C", "CC", ("one", "two"))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr("shutil.which", lambda name: None if name == "one" else f"/bin/{name}")
    assert compiler.path() == "/bin/two"
    monkeypatch.setenv("CC", "mine")
    assert compiler.path() == "/bin/mine"
    monkeypatch.setenv("CC", "one")
    with pytest.raises(NoLibrary, match=r"no C compiler is installed \(one\)"):
        compiler.path()
    monkeypatch.setenv("CC", "")
    assert compiler.path() == "/bin/two", "an empty variable names none"


@pytest.mark.parametrize(
    ("status", "stderr", "says"),
    [
        (0, "warning", None),
        (1, "a\nb.c: error: x\nerror: y", "b.c: error: x"),
        (2, " all wrong \n", "all wrong"),
    ],
)
def test_what_a_compiler_says(monkeypatch, status, stderr, says):
    done = SimpleNamespace(returncode=status, stderr=stderr)
    monkeypatch.setattr("subprocess.run", lambda *_, **__: done)
    if says is None:
        Compiler("C", "CC", ()).run(["cc"])
        return
    with pytest.raises(NoLibrary) as caught:
        Compiler("C", "CC", ()).run(["cc"])
    assert str(caught.value) == f"the C compiler failed: {says}"


def test_a_compiler_that_cannot_be_run():
    with pytest.raises(NoLibrary, match="the C compiler could not be run"):
        Compiler("C", "CC", ()).run(["/nowhere/compiler"])


def test_assignments_become_code():
    lines: list[str] = []
    model = Written("model", lines)
    model.opt.timestep = 0.5
    model.name = "a"
    assert lines == ["model.opt.timestep = 0.5", "model.name = 'a'"] and repr(model.opt) == "model.opt"
    with pytest.raises(AttributeError):
        _ = model.__length__
