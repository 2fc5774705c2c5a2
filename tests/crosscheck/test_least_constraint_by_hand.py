"""Gauss's principle at the start, loads, energies and metrics at their limits / worked out by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.judge import constraints, gauss_principle, metrics, precision, time_functions
from crosscheck.judge.energy import energy_drift
from crosscheck.judge.joint_reactions import compare
from crosscheck.judge.loads import Motion, at_time, cross, world_inertia, wrenches
from crosscheck.judge.metrics import METRICS, exact_motion, measure, violation_series
from crosscheck.judge.richardson import _order
from crosscheck.judge.truth import NoSolution
from mbref import rotations
from mbref.scene import (
    Body,
    Distance,
    Factor,
    Force,
    JointTorque,
    Moment,
    Revolute,
    Scene,
    Spherical,
    Spring,
    TorsionSpring,
    Translational,
)
from mbref.trajectory import Trajectory

X, Z, O = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
TURN = (0.8, 0.0, 0.6, 0.0)
LINK = Body(name="b", mass=2.0, inertia=(1.0, 3.0, 3.5), position=(2.0, 0.0, 0.0))
HINGE = Revolute(name="A", bodies=("ground", "b"), anchor=O, axis=Z)


def scene(**parts: Any) -> Scene:
    return Scene(**{"name": "s", "body": (LINK,), "joint": (HINGE,), "gravity": O, "duration": 1.0, **parts})


# --- accelerations at the start ---------------------------------------------------------------------------
def test_the_acceleration_of_a_turning_link():
    """2 kg at 2 m and 3.5 kg m²: 11.5 q'' = 5 N m; ω² r = 18 m/s² at 3 rad/s; the scene's length is 2 m."""
    spun = LINK.model_copy(update={"angular_velocity": (0.0, 0.0, 3.0)})
    given = scene(body=(spun,), load=(Moment(body="b", moment=(0.0, 0.0, 5.0)),))
    second = 5.0 / 11.5
    found = gauss_principle.gauss(given)
    assert found == pytest.approx(np.array([[-18.0, 2 * second, 0.0], [0.0, 0.0, 2 * second]]))
    assert gauss_principle.rank(given) == 5 and gauss_principle.rank(given.with_(joint=())) == 0
    assert gauss_principle.singular_values(given).shape == (5,) and gauss_principle.goes_on(given)


def test_masses_and_forces_of_a_turned_body():
    """Inertia along world axes, ω × Jω, a force at a point, an armature and its spring."""
    spun = LINK.model_copy(update={"orientation": TURN, "angular_velocity": (0.5, -1.0, 2.0), "velocity": O})
    load = Force(body="b", point=(2.0, 1.0, 0.0), force=(0.0, 0.0, 4.0))
    free = scene(body=(spun,), joint=(), load=(load,), gravity=(0.0, -10.0, 0.0))
    mass, force = gauss_principle._unbound(free)
    matrix = rotations.to_matrix(np.array(TURN))
    inertia, spin = matrix @ np.diag([1.0, 3.0, 3.5]) @ matrix.T, np.array([0.5, -1.0, 2.0])
    wanted = np.zeros((6, 6))
    wanted[:3, :3], wanted[3:, 3:] = 2 * np.eye(3), inertia
    assert mass == pytest.approx(wanted)
    assert force == pytest.approx(
        [0.0, -20.0, 4.0, *(np.array([4.0, 0.0, 0.0]) - np.cross(spin, inertia @ spin))]
    )
    geared = scene(
        joint=(HINGE.model_copy(update={"armature": 0.25}),),
        load=(TorsionSpring(joint="A", stiffness=3.0, natural_angle=0.5),),
    )
    mass, force = gauss_principle._unbound(geared)
    assert np.diag(mass) == pytest.approx([2.0, 2.0, 2.0, 1.0, 3.0, 3.75]) and force[5] == pytest.approx(1.5)


@pytest.mark.parametrize("size", [1.0, 1e-4])
def test_least_changes_subject_to_rows(size):
    """a₀ = -3 by the first row; a₁ = (8 + 3) / 4 by M a = f; the third coordinate has the weight 0.5."""
    mass, force = np.array([[2.0, 1.0, 0.0], [1.0, 4.0, 0.0], [0.0, 0.0, 5.0]]), np.array([5.0, 8.0, 10.0])
    rows, coasting = size * np.array([[1.0, 0.0, 0.0], [0.0, 0.9e-9, 0.0]]), size * np.array([3.0, 0.0])
    found = gauss_principle.of_least_constraint(mass, force, rows, coasting, np.array([1.0, 1.0, 0.5]))
    assert found == pytest.approx([-3.0, 2.75, 4.0])
    rows[1, 1] = size * 1.1e-9
    found = gauss_principle.of_least_constraint(mass, force, rows, coasting, np.ones(3))
    assert found == pytest.approx([-3.0, 0.0, 2.0], abs=1e-6)


@pytest.mark.parametrize(
    ("coasting", "within", "goes_on"),
    [
        ([0.0, 1e-8], 1e-8, True),
        ([0.0, 1.1e-8], 1e-8, False),
        ([4.0, 4e-8], 1e-8, True),
        ([4.0, 4.5e-8], 1e-8, False),
        ([4.0, 0.35], 0.1, True),
        ([4.0, 0.45], 0.1, False),
    ],
)
def test_accelerations_that_keep_velocities_consistent(monkeypatch, coasting, within, goes_on):
    """The second row is zero, so that its residual is left; relative to one at least."""
    asked: list[Any] = []

    def jacobian(scene: Any, t: float, position: Any, orientation: Any) -> Any:
        asked.append((scene.name, t))
        return np.array([[2.0, 0.0], [0.0, 0.0]]), None

    monkeypatch.setattr(gauss_principle, "jacobian", jacobian)
    monkeypatch.setattr(gauss_principle, "bias", lambda scene: np.array(coasting))
    assert gauss_principle.goes_on(scene(), within) is goes_on and asked == [("s", 0.0)]
    if within == 1e-8:
        assert gauss_principle.goes_on(scene()) is goes_on


def test_residuals_and_stacked_accelerations():
    """ω² r towards the hinge is missing; angular accelerations count times 2 m."""
    spun = LINK.model_copy(update={"angular_velocity": (0.0, 0.0, 3.0), "velocity": (0.0, 6.0, 0.0)})
    found = gauss_principle.bias(scene(body=(spun,)))
    assert np.abs(found).max() == pytest.approx(18.0) and np.linalg.norm(found) == pytest.approx(18.0)
    assert gauss_principle.bias(scene(joint=())).shape == (0,)
    arrays = np.arange(6.0).reshape(2, 1, 3)
    run = SimpleNamespace(engine="e", acceleration=arrays, angular_acceleration=10 + arrays)
    assert gauss_principle.stacked(scene(), run, 1).tolist() == [[3.0, 4.0, 5.0], [26.0, 28.0, 30.0]]
    for name in ("acceleration", "angular_acceleration"):
        with pytest.raises(ValueError, match="e reports no accelerations"):
            gauss_principle.stacked(scene(), SimpleNamespace(**{**vars(run), name: None}), 1)


# --- loads ------------------------------------------------------------------------------------------------
def test_loads_of_a_piece_of_their_function():
    """A factor 1 + 2 t acts from 0.5 s to 0.75 s."""
    factor = Factor(polynomial=(1.0, 2.0), start=0.5, stop=0.75)
    moment, force = Moment(body="b", moment=(0.0, 3.0, 0.0), factor=factor), Force(body="b", point=X, force=X)
    assert at_time(force, 9.0) is force
    assert (
        at_time(moment, 0.6).moment == pytest.approx((0.0, 6.6, 0.0)) and at_time(moment, 0.6).factor is None
    )
    assert at_time(moment, 0.75).moment == (0.0, 0.0, 0.0)
    assert at_time(moment, 0.75, 0.5).moment == pytest.approx((0.0, 7.5, 0.0)), "the piece before its end"
    pushed = force.model_copy(update={"factor": factor})
    assert at_time(pushed, 0.6).force == pytest.approx((2.2, 0.0, 0.0))
    rest = np.zeros((1, 1, 3))
    motion = Motion(rest, np.eye(3)[None, None], rest, rest, np.zeros((1, 1)))
    _, found = wrenches(scene(load=(moment,)), motion, np.zeros(3), 0.75, 0.5)
    assert found[0, 0] == pytest.approx([0.0, 7.5, 0.0])


def test_inertias_along_world_axes():
    """Two bodies in one pose and in several poses."""
    other = LINK.model_copy(update={"name": "c", "inertia": (2.0, 2.5, 3.0)})
    two = scene(body=(LINK, other), joint=())
    turns = rotations.to_matrix(np.array([[TURN, (0.6, 0.0, 0.0, 0.8)], [(0.0, 0.6, 0.8, 0.0), TURN]]))
    found = world_inertia(two, turns)
    for k in range(2):
        assert world_inertia(two, turns[k]) == pytest.approx(found[k])
        for b, own in enumerate(((1.0, 3.0, 3.5), (2.0, 2.5, 3.0))):
            assert found[k, b] == pytest.approx(turns[k, b] @ np.diag(own) @ turns[k, b].T)


def test_vector_products_of_samples():
    a, b = np.random.default_rng(5).normal(size=(2, 2, 4, 3))
    assert cross(a, b) == pytest.approx(np.cross(a, b))


def test_the_next_end_of_a_piece_is_later():
    """An end nearer than 1e-12 of the time is the present one."""
    for stop, found in ((1 + 1e-12, math.inf), (1 + 1.1e-12, 1 + 1.1e-12)):
        given = scene(load=(Moment(body="b", moment=Z, factor=Factor(stop=stop)),))
        assert time_functions.next_end(given, 1.0) == found


# --- energies and coordinates -----------------------------------------------------------------------------
def run(*angles: float, **parts: Any) -> Trajectory:
    """The link at rest at angles about its hinge."""
    a = np.array(angles)
    place = np.stack([2 * np.cos(a), 2 * np.sin(a), 0 * a], axis=1)[:, None]
    turn = np.stack([np.cos(a / 2), 0 * a, 0 * a, np.sin(a / 2)], axis=1)[:, None]
    rest = np.zeros_like(place)
    made = {"velocity": rest, "angular_velocity": rest, **parts}
    return Trajectory("s", "e", "1", "m", {}, 0.5 * np.arange(len(a)), ("b",), place, turn, **made)


def test_work_of_a_torque_along_a_joint():
    """3 N m over 0.5 rad; a torque that changes, or a damper, has no energy."""
    torque = JointTorque(joint="A", torque=3.0)
    assert energy_drift(scene(load=(torque,)), run(0.0, 0.5)) == pytest.approx([0.0, 1.5])
    fading = torque.model_copy(update={"factor": Factor(polynomial=(1.0, 1.0))})
    assert energy_drift(scene(load=(fading,)), run(0.0, 0.5)) is None
    damper = TorsionSpring(joint="A", stiffness=0.0, damping=1.0)
    assert energy_drift(scene(load=(damper,)), run(0.0, 0.5)) is None


def test_joints_that_have_coordinates():
    ball = Spherical(name="B", bodies=("ground", "b"), anchor=(2.0, 0.0, 0.0))
    both, state = scene(joint=(ball, HINGE)), run(0.0, 0.5)
    pose = state.position, state.orientation
    assert list(constraints.joint_coordinates(both, state.times, *pose, state.angular_velocity)) == ["A"]
    assert list(constraints.joint_rates(both, *pose, state.velocity, state.angular_velocity)) == ["A"]


@pytest.mark.parametrize(("order", "found"), [(0.4, None), (0.6, 0.6), (11.5, 11.5), (12.1, None)])
def test_orders_within_their_limits(order, found):
    got = _order((4.0, 2.0, 1.0), (2.0**order, 1.0))
    assert got is None if found is None else got == pytest.approx(found)


# --- metrics at their limits ------------------------------------------------------------------------------
class Ending:
    """A truth that is known up to a time (s)."""

    name, accuracy = "ending", 1e-9

    def __init__(self, until: float) -> None:
        self.until = until

    def poses(self, times: np.ndarray) -> Trajectory:
        if times.max(initial=0.0) > self.until:
            raise NoSolution("it ends", self.until)
        return run(*(0.0 * times))


def test_a_truth_that_ends_early():
    found = exact_motion(run(0.0, 0.1, 0.2), Ending(0.5))
    assert found is not None and found.times.tolist() == [0.0, 0.5]
    assert exact_motion(run(0.0, 0.1, 0.2), Ending(0.25)) is None, "known at the start alone"
    assert exact_motion(run(0.0), None) is None
    numbers = measure(scene(), run(0.0, 0.3, 0.7), Ending(0.5))
    assert numbers["rotation_error"] == pytest.approx(0.3) and numbers["error_until"] == 0.5
    assert numbers["error_bound"] == 1e-9 and measure(scene(), run(0.0))["error_bound"] is None
    assert METRICS["error"].function(scene(), run(0.0, 0.1, 0.9), run(0.0, 0.0)) == pytest.approx(0.1)


def test_violations_of_a_scene_without_joints():
    free = scene(joint=())
    assert [violation_series(free, run(0.0, 0.5), level).tolist() for level in (0, 1)] == [[0.0, 0.0]] * 2
    assert violation_series(free, run(0.0), 2) is None
    rod = Distance(name="D", bodies=("ground", "b"), anchors=(O, (2.0, 0.0, 0.0)))
    longer = run(0.0, 0.5, velocity=np.array([[[0.5, 0.0, 0.0]], [O]]))
    assert violation_series(scene(joint=(rod,)), longer, 1) == pytest.approx([0.25, 0.0])


def test_reaction_errors_of_a_run(monkeypatch):
    """The exact reactions come first; eleven samples of 21; fifty bodies at most."""
    asked: list[Any] = []

    def compared(scene: Any, true: Any, found: Any) -> Any:
        asked.append((true, found))
        joint = SimpleNamespace(unique=0.5)
        return SimpleNamespace(resultant=0.25, joints={"A": joint})

    monkeypatch.setattr(metrics, "compare", compared)
    monkeypatch.setattr(metrics, "_exact_reactions", lambda scene, exact: ("exact", exact))
    exact, given = run(*[0.0] * 21), run(*[0.1] * 21, reactions={"A": np.zeros((21, 6))})
    assert metrics.reaction_error(scene(), given, exact) == 0.5
    [((name, true), found)] = asked
    assert name == "exact" and len(true.times) == len(found.times) == 11 and true.times[1] == 1.0
    assert found.orientation[0, 0, 3] > 0 and true.orientation[0, 0, 3] == 0
    for changed in (
        (scene(), given, None),
        (scene(), run(0.0), exact),
        (scene(), run(reactions={}), run()),
        (scene(joint=()), given, exact),
        (scene(body=(Body(name="b", position=X),)), given, exact),
    ):
        assert metrics.reaction_error(*changed) is None
    many = scene(body=[LINK.model_copy(update={"name": f"b{k}"}) for k in range(51)], joint=())
    held = many.with_(joint=(HINGE.model_copy(update={"bodies": ("ground", "b0")}),))
    assert metrics.reaction_error(held, given, exact) is None
    fewer = held.with_(body=held.body[:50])
    assert metrics.reaction_error(fewer, given, exact) == 0.5


def test_reactions_without_samples_are_not_compared():
    none = run(reactions={"A": np.zeros((0, 6))})
    with pytest.raises(ValueError, match="common sample times"):
        compare(scene(), none, none)


def test_scales_of_the_precision_of_reactions():
    """No gravity, and 2 m at 1 rad per 10 s: 0.02 m/s², or the largest acceleration."""
    slow = scene(duration=10.0)
    bare = SimpleNamespace(
        acceleration=None, velocity=np.zeros((1, 1, 3)), angular_velocity=np.zeros((1, 1, 3))
    )
    assert precision._acceleration(slow, bare) == pytest.approx(2.0 / 100)
    moving = SimpleNamespace(**{**vars(bare), "acceleration": np.array([[[0.01, 0.0, -0.5]]])})
    assert precision._acceleration(slow, moving) == 0.5
    moving.acceleration = np.array([[[0.01, 0.0, 0.0]]])
    assert precision._acceleration(slow, moving) == pytest.approx(0.02)
    moving.reactions = {
        "A": np.array([[0.01, 0.0, 0.0, 0.0, 0.0, 0.0]]),
        "B": np.array([[0.4, 0, 0, 0, 0, 0.0]]),
    }
    force = 2.0 * 0.02
    scales = [scale for _, _, scale in precision._of_joints(slow, moving)]
    assert scales[0] == pytest.approx(np.repeat([0.4, 0.8], 3)) and force < 0.4
    moving.reactions = {"A": np.array([[0.01, 0.0, 0.0, 0.0, 0.0, 0.0]])}
    [(_, _, scale)] = precision._of_joints(slow, moving)
    assert scale == pytest.approx(np.repeat([force, 2 * force], 3))
    moving.reactions = None
    assert [*precision._of_joints(slow, moving)] == []


# --- parts of the equations at the start ------------------------------------------------------------------
def test_rows_at_the_start(monkeypatch):
    """Rows are of t = 0; lengths count over the scene's length of 2 m, and rows have the length one."""
    asked: list[float] = []
    own = gauss_principle.jacobian
    monkeypatch.setattr(
        gauss_principle, "jacobian", lambda of, t, *pose: asked.append(t) or own(of, t, *pose)
    )
    gauss_principle.gauss(scene())
    found = gauss_principle.singular_values(scene())
    assert asked == [0.0, 0.0]
    rows = own(scene(), 0.0, *constraints.initial_poses(scene()))[0] * [2.0, 2.0, 2.0, 1.0, 1.0, 1.0]
    gram = rows @ rows.T / np.outer(np.linalg.norm(rows, axis=1), np.linalg.norm(rows, axis=1))
    assert np.sort(found**2) == pytest.approx(np.sort(np.linalg.eigvalsh(gram)))


def test_mass_matrix_of_bodies_and_massless_links():
    """3 kg, then a link without mass; inertias stand in the last three rows of each body."""
    heavy = LINK.model_copy(update={"name": "c", "mass": 3.0, "inertia": (4.0, 5.0, 6.0)})
    link = LINK.model_copy(update={"name": "d", "mass": 0.0, "inertia": O})
    mass, _ = gauss_principle._unbound(scene(body=(LINK, heavy, link), joint=()))
    assert mass == pytest.approx(np.diag([2, 2, 2, 1, 3, 3.5, 3, 3, 3, 4, 5, 6, *[0.0] * 6]))


def test_forces_of_joints_at_the_start():
    """A torque of 2 N m times 1 + 3 t, and an armature of a rail that turns at 3 rad/s."""
    torque = JointTorque(joint="A", torque=2.0, factor=Factor(polynomial=(1.0, 3.0)))
    assert gauss_principle._unbound(scene(load=(torque,)))[1] == pytest.approx([0.0] * 5 + [2.0])
    spun = LINK.model_copy(update={"velocity": (0.0, 6.0, 0.0), "angular_velocity": (0.0, 0.0, 3.0)})
    arm = Body(name="a", mass=1.0, inertia=(1.0, 1.0, 1.0), position=O, angular_velocity=(0.0, 0.0, 3.0))
    rail = Translational(name="R", bodies=("a", "b"), anchor=(2.0, 0.0, 0.0), axis=X, armature=0.5)
    pivot = Revolute(name="P", bodies=("ground", "a"), anchor=O, axis=Z)
    turning = scene(body=(arm, spun), joint=(pivot, rail))
    _, force = gauss_principle._unbound(turning)
    row = np.zeros(12)
    row[[0, 6]] = -1.0, 1.0
    assert force == pytest.approx(-0.5 * 18.0 * row), (
        "(r · e)'' = 2 · 6 · 3 - 9 · 2 m/s² without accelerations"
    )


def test_a_damper_between_turning_bodies():
    """Points at 1 m across a body that turns at 3 rad/s part with 3 m/s along x: 2 N s/m give 6 N."""
    spring = Spring(
        bodies=("ground", "b"),
        points=((9.0, 1.0, 0.0), (2.0, 1.0, 0.0)),
        stiffness=4.0,
        damping=2.0,
        natural_length=7.0,
    )
    spun = LINK.model_copy(update={"angular_velocity": (0.0, 0.0, 3.0), "velocity": O})
    given = scene(body=(spun,), joint=(), load=(spring,))
    _, force = gauss_principle._unbound(given)
    assert force == pytest.approx([6.0, 0.0, 0.0, 0.0, 0.0, -6.0])
    place, eye = np.array([[[2.0, 0.0, 0.0]]] * 2), np.tile(np.eye(3), (2, 1, 1, 1))
    place[1, 0, 0] = 1.0
    spin = np.array([[[0.0, 0.0, 3.0]], [O]])
    motion = Motion(place, eye, 0 * place, spin, np.zeros((2, 1)))
    pull, moment = wrenches(given, motion, np.zeros(3))
    assert pull[:, 0] == pytest.approx(np.array([[6.0, 0.0, 0.0], [4.0, 0.0, 0.0]]))
    assert moment[:, 0] == pytest.approx(np.array([[0.0, 0.0, -6.0], [0.0, 0.0, -4.0]]))


def test_loads_of_joints_without_a_common_axis():
    """They are added elsewhere; a torque along a joint is always."""
    rest, eye = np.zeros((1, 1, 3)), np.eye(3)[None, None]
    motion = Motion(rest, eye, rest, rest, np.full((1, 1), np.nan))
    loads = TorsionSpring(joint="A", stiffness=3.0, natural_angle=0.5), JointTorque(joint="A", torque=2.0)
    assert not wrenches(scene(load=loads), motion, np.zeros(3))[1].any()
    assert not wrenches(scene(load=loads[1:]), motion, np.array(Z))[1].any()
    turned = Motion(rest, eye, rest, rest, np.full((1, 1), 0.75))
    assert wrenches(scene(load=loads), turned, np.array(Z))[1][0, 0] == pytest.approx([0.0, 0.0, -0.75])
