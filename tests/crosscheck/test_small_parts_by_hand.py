"""Small parts of the judge, of studies and of the suite / numbers and sentences worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from crosscheck.conformance.changes import fields_of, mapped, nudged, replaced, weighed
from crosscheck.conformance.replays import _later, _samples, _shifted, joints_kept, pinned, replayed
from crosscheck.conformance.rewritings import duplicated, relabelled, renamed, satisfied, stretched, swapped
from crosscheck.judge import joint_reactions, reaction_balance
from crosscheck.judge.free_fall import falls_freely
from crosscheck.judge.mobility import Mobility, mobility
from crosscheck.judge.reference import crossing
from crosscheck.judge.richardson import _beyond, _order, limit
from crosscheck.paper import singular
from crosscheck.recorded import judgement
from crosscheck.recorded.exact import Exact
from crosscheck.recorded.reading import Recording
from crosscheck.setting import Setting
from crosscheck.study import hurried, truth_sentences
from crosscheck.study.grid import Case
from mbref.scene import Body, Cylindrical, Driver, Factor, Force, Moment, Revolute, Scene, Sine, Spring
from mbref.trajectory import Outcome, Trajectory

Z = (0.0, 0.0, 1.0)
DOWN = (0.0, -10.0, 0.0)


def body(name: str = "b", x: float = 1.0, **parts: object) -> Body:
    given = {"mass": 2.0, "inertia": (1.0, 1.0, 1.0), "position": (x, 0.0, 0.0), **parts}
    return Body(name=name, **given)


def hinge(
    name: str = "A", first: str = "ground", second: str = "b", z: float = 0.0, x: float = 0.0
) -> Revolute:
    return Revolute(name=name, bodies=(first, second), anchor=(x, 0.0, z), axis=Z)


def scene(**parts: object) -> Scene:
    given = {"body": (body(),), "joint": (hinge(),), "gravity": DOWN, **parts}
    return Scene(name="s", duration=1.0, **given)


def still(**parts: object) -> Trajectory:
    """The body at rest at two times; zero accelerations."""
    zero = np.zeros((2, 1, 3))
    made = {
        "position": zero + np.array([1.0, 0.0, 0.0]),
        "orientation": np.tile([1.0, 0.0, 0.0, 0.0], (2, 1, 1)),
        "velocity": zero.copy(),
        "angular_velocity": zero.copy(),
        "acceleration": zero.copy(),
        "angular_acceleration": zero.copy(),
        **parts,
    }
    return Trajectory("s", "e", "1", "m", {}, np.array([0.0, 1.0]), ("b",), **made)


# --- reactions --------------------------------------------------------------------------------------------
def test_a_door_on_two_hinges_shares_what_redundancy_leaves_open():
    """Two hinges have ten rows, of which five are redundant. The hinges share the force along the axis, the
    moments across it, and the forces across it, which differ by a couple."""
    door = scene(joint=(hinge("A"), hinge("B", z=2.0)))
    pose = np.array([[1.0, 0.0, 0.0]]), np.array([[1.0, 0.0, 0.0, 0.0]])
    bases = joint_reactions.shared_wrenches(door, 0.0, *pose)
    assert {name: basis.shape for name, basis in bases.items()} == {"A": (6, 5), "B": (6, 5)}
    for basis in bases.values():
        assert basis[5] == pytest.approx(np.zeros(5), abs=1e-12), "no moment about the axis is shared"
        assert basis.T @ basis == pytest.approx(np.eye(5))
    alone = joint_reactions.shared_wrenches(scene(), 0.0, *pose)
    assert alone["A"].shape == (6, 0)
    assert mobility(door) == Mobility(10, 5, 1) and mobility(scene(joint=())) == Mobility(0, 0, 6)
    driven = scene(driver=(Driver(joint="A", polynomial=(0.0, 1.0)),))
    assert mobility(driven) == Mobility(6, 0, 0)


def wrenches(*last: float) -> dict[str, np.ndarray]:
    return {"A": np.array([[0.0] * 6, list(last)])}


def test_resultants_of_joints_on_a_body():
    """A force (1, 2, 3) N and a moment at the origin, 1 m before the centre: (-1, 0, 0) × F = (0, 3, -2)."""
    run = still(reactions=wrenches(1.0, 2.0, 3.0, 4.0, 5.0, 6.0))
    assert joint_reactions.resultants(scene(), run, 1)[0] == pytest.approx([1, 2, 3, 4, 8, 4])
    assert not joint_reactions.resultants(scene(), run, 0).any()
    turned = scene(joint=(hinge(first="b", second="ground"),))
    assert joint_reactions.resultants(turned, run, 1)[0] == pytest.approx([-1, -2, -3, -4, -8, -4])


def test_largest_reactions_and_their_least_scale():
    """Moments are divided by the scene's length of 1 m; 2 kg at 1e-3 m/s² are the least."""
    assert joint_reactions.largest_reaction(scene(), still(reactions=wrenches(3, 0, 0, 0, 4, 0))) == 5.0
    assert joint_reactions.largest_reaction(scene(), still(reactions=wrenches(0, 0, 0, 0, 0, 0))) == 2e-3


def test_reactions_of_two_runs():
    first, second = still(reactions=wrenches(8, 0, 0, 0, 6, 0)), still(reactions=wrenches(8, 1, 0, 0, 6, 0))
    found = joint_reactions.compare(scene(), first, second)
    assert found.joints["A"].shared == 0 and found.joints["A"].unique == pytest.approx(0.1)
    assert found.joints["A"].chosen == 0.0 and found.resultant == pytest.approx(0.1)
    door = scene(joint=(hinge("A"), hinge("B", z=2.0)))
    pair = {
        "A": np.tile([4.0, 0.0, 1.0, 0.0, 0.0, 0.0], (2, 1)),
        "B": np.tile([0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (2, 1)),
    }
    other = {"A": pair["A"] + [0, 0, 0.5, 0, 0, 0], "B": pair["B"] - [0, 0, 0.5, 0, 0, 0]}
    shared = joint_reactions.compare(door, still(reactions=pair), still(reactions=other))
    size = 0.5 / math.sqrt(17)
    assert shared.joints["B"].chosen == pytest.approx(size) and shared.joints["B"].unique == pytest.approx(
        0, abs=1e-12
    )
    assert shared.resultant == pytest.approx(0, abs=1e-12) and shared.joints["A"].shared == 5
    sides = joint_reactions.side_by_side(door, {"x": still(reactions=pair), "y": still(reactions=other)}, 1)
    assert sides["A"]["x"] == pytest.approx(math.sqrt(17)) and sides["B"]["y"] == pytest.approx(0.5)
    with pytest.raises(ValueError, match="without reactions"):
        joint_reactions.compare(scene(), first, still())
    with pytest.raises(ValueError, match="common sample times"):
        joint_reactions.compare(scene(), first, replace(second, times=np.array([0.0, 0.9])))


def test_forces_that_joints_must_exert_and_their_balance():
    """2 kg at rest under 10 m/s²: 20 N upwards, which act at the hinge with a moment of 20 N m."""
    exact = still()
    assert reaction_balance.demanded(scene(), exact) == pytest.approx(np.tile([0, 20, 0, 0, 0, 0], (2, 1, 1)))
    pushed = still()
    pushed.acceleration[:, 0, 0], pushed.angular_acceleration[:, 0, 2] = 3.0, 0.5
    loaded = scene(load=(Force(body="b", point=(1.0, 0.0, 0.0), force=(1.0, 0.0, 0.0)),))
    assert reaction_balance.demanded(loaded, pushed)[1, 0] == pytest.approx([5, 20, 0, 0, 0, 0.5])
    right = still(reactions={"A": np.tile([0, 20.0, 0, 0, 0, 20.0], (2, 1))})
    assert reaction_balance.balance(scene(), right, exact) == pytest.approx(0, abs=1e-15)
    assert reaction_balance.idle(scene(), right, exact) == pytest.approx(1.0), "20 N m about a free axis"
    off = still(reactions={"A": np.tile([0, 21.0, 0, 0, 0, 21.0], (2, 1))})
    assert reaction_balance.balance(scene(), off, exact) == pytest.approx(0.05)
    with pytest.raises(ValueError, match="gives no accelerations"):
        reaction_balance.demanded(scene(), still(acceleration=None))


def test_exact_and_absurd_reactions():
    hung = scene(joint=(hinge(x=1.0),))
    exact = reaction_balance.with_exact_reactions(hung, still())
    assert exact.reactions["A"] == pytest.approx(np.tile([0, 20, 0, 0, 0, 0], (2, 1)), abs=1e-12)
    for size, count in ((200.0, 0), (201.0, 1)):
        run = still(reactions={"A": np.tile([0, size, 0, 0, 0, 0], (2, 1))})
        assert len(reaction_balance.absurd(hung, run, exact)) == count
    assert reaction_balance.absurd(hung, run, exact) == ["e gives 201 N in A, where no force exceeds 20 N"]
    none = replace(exact, reactions={"A": np.zeros((2, 6))})
    small = still(reactions={"A": np.tile([0, 0.021, 0, 0, 0, 0], (2, 1))})
    assert len(reaction_balance.absurd(hung, small, none)) == 1, "10 times 2 kg at 1e-3 m/s²"
    assert (
        reaction_balance.absurd(hung, still(reactions={"A": np.tile([0, 0.019, 0, 0, 0, 0], (2, 1))}), none)
        == []
    )


# --- falls, limits, crossings -----------------------------------------------------------------------------
def test_a_mechanism_that_falls_as_one_piece():
    chain = (hinge("A", "b", "c", x=1.5),)
    two = scene(body=(body("b"), body("c", 2.0)), joint=chain)
    assert falls_freely(two) and falls_freely(scene(joint=()))
    assert not falls_freely(scene()), "held by the ground"
    assert not falls_freely(two.with_(gravity=(0.0, 0.0, 0.0)))
    spring = Spring(
        bodies=("ground", "c"), points=((0.0, 0.0, 0.0), (2.0, 0.0, 0.0)), stiffness=1.0, natural_length=2.0
    )
    assert not falls_freely(two.with_(load=(spring,)))
    assert not falls_freely(two.with_(load=(Moment(body="c", moment=Z),)))
    thrown = [
        b.model_copy(update={"velocity": (1.0, 0.0, 0.0), "angular_velocity": (0.0, 0.0, 0.0)})
        for b in two.body
    ]
    assert falls_freely(two.with_(body=thrown))
    spun = [
        thrown[0],
        thrown[1].model_copy(update={"angular_velocity": (0.0, 0.0, 1.0), "velocity": (1.0, 0.5, 0.0)}),
    ]
    assert not falls_freely(two.with_(body=spun))
    parted = [body("b", velocity=(1.0, 0.0, 0.0)), body("c", 2.0, velocity=(2.0, 0.0, 0.0))]
    assert not falls_freely(scene(body=parted, joint=())), "they part along one axis alone"
    assert not falls_freely(two.with_(driver=(Driver(joint="A"),)))
    bare = [b.model_copy(update={"mass": None, "inertia": None}) for b in two.body]
    assert not falls_freely(two.with_(body=bare))


@pytest.mark.parametrize("order", [1.0, 2.0, 4.0])
def test_the_limit_of_runs_with_smaller_steps(order):
    """x(h) = 1 + h^p: the limit is 1, and the finest run is h^p away from it."""
    steps = (0.4, 0.05, 0.2, 0.1)
    runs = [still(position=still().position + np.array([step**order, 0.0, 0.0])) for step in steps]
    found = limit(scene(), steps, runs)
    assert found.order == pytest.approx(order) and found.motion.position[:, 0, 0] == pytest.approx([1.0, 1.0])
    assert found.discretisation == pytest.approx(0.05**order, rel=1e-6) and found.motion.acceleration is None
    assert limit(scene(), steps[:2], runs[:2]) is None
    assert limit(scene(), steps[:3], [runs[0], runs[0], runs[0]]) is None, "no difference"


def test_orders_of_differences_and_signs_of_quaternions():
    assert _order((4.0, 2.0, 1.0), (8.0, 2.0)) == pytest.approx(2.0)
    assert _order((9.0, 2.0, 1.0), (77.0, 3.0)) == pytest.approx(2.0)
    assert _order((4.0, 2.0, 1.0), (1.0, 2.0)) is None and _order((4.0, 2.0, 1.0), (2.0**13, 1.0)) is None
    assert _order((4.0, 2.0, 1.0), (1.0, 0.0)) is None and _order((4.0, 2.0, 1.0), (math.nan, 1.0)) is None
    last, before = np.array([[[0.6, 0.8, 0.0, 0.0]]]), np.array([[[-1.0, 0.0, 0.0, 0.0]]])
    found = _beyond(last, before, 0.5)
    assert found[0, 0] == pytest.approx(np.array([0.4, 1.2, 0.0, 0.0]) / math.hypot(0.4, 1.2))


NODES = np.cos(np.pi * np.arange(40, -1, -1) / 40)


def test_points_near_a_singular_position_are_bridged():
    """|x - 0.2| is below 0.15 of its median at a few nodes, where cubics come from the other nodes."""
    distance = np.abs(NODES - 0.2)
    near = distance < 0.15 * np.median(distance)
    assert crossing.near_singular(distance).tolist() == near.tolist() and 0 < near.sum() < 10
    smooth = np.stack([NODES**3, 1 + NODES], axis=1)
    noisy = smooth + near[:, None] * np.array([5.0, -7.0])
    assert crossing.bridged(NODES, noisy, distance) == pytest.approx(smooth, abs=1e-9)
    far = 1 + 0.1 * NODES
    assert crossing.bridged(NODES, noisy, far) is noisy
    edge = np.abs(NODES - 1.0)
    assert (
        crossing.bridged(NODES, noisy, edge) is noisy
        and crossing.bridged(NODES, noisy, np.abs(NODES + 1)) is noisy
    )


def test_the_place_at_which_a_distance_changes_its_sign():
    assert crossing.singular_time(NODES, np.abs(NODES - 0.2)) == pytest.approx(0.2, abs=1e-9)
    curved = np.abs(np.sin(1.5 * (NODES + 0.3)))
    assert crossing.singular_time(NODES, curved) == pytest.approx(-0.3, abs=1e-6)
    touching = (NODES - 0.2) ** 2
    assert crossing.singular_time(NODES, touching) is None, "its sign stays"
    assert crossing.singular_time(NODES, 1 + 0.1 * NODES) is None
    broken = np.abs(NODES - 0.2)
    broken[3] = math.nan
    assert crossing.singular_time(NODES, broken) is None


@pytest.mark.parametrize(("end", "ahead"), [(1.5, 1.5), (2.9, 2.9), (3.1, None), (0.0, None)])
def test_a_singular_position_ahead_of_a_panel(end, ahead):
    """A distance that falls to zero at 1.5; beyond 3, and for a distance that grows, there is none."""
    found = crossing.singular_ahead(NODES, np.abs(end - NODES))
    assert found == (None if ahead is None else pytest.approx(ahead))


def test_times_and_distances_of_the_paper_s_singular_positions():
    """θ₂ = π/4 - 124.8 t is 0, -π, … at (π/4 + k π) / 124.8."""
    times = singular.crossings(math.pi / 4, 0.06)
    assert [k for _, k in times] == [0, -1, -2]
    assert [t for t, _ in times] == pytest.approx([(0.25 + k) * math.pi / 124.8 for k in range(3)])
    assert singular.crossings(math.pi, 0.0) == [(0.0, 1)]
    assert singular.crossing_distance(math.pi / 4, 0.0) == pytest.approx(math.pi / 4)
    assert singular.crossing_distance(2.5, 0.0) == pytest.approx(math.pi - 2.5)
    assert singular.crossing_distance(0.2, 0.001) == pytest.approx(0.2 - 0.1248)
    assert [singular.turns(k) for k in (0, 1, -1, 2, -3)] == ["0", "π", "-π", "2π", "-3π"]
    assert singular.rank(np.array([2.0, 1.0, 1e-14])) == 2


def test_iterations_of_the_augmented_lagrangian_formulation():
    """One row d = 1, γ = 1: a ← (a + α) / (1 + α), so that 1 - a falls by 1 + α = 10 a step; changes are
    0.9, 0.09, 0.009, …"""
    for epsilon, count in ((1.0, 1), (0.9001, 1), (0.0901, 2), (0.0899, 3), (0.00901, 3), (0.00899, 4)):
        assert singular._iterations(np.eye(1), np.ones(1), 9.0, epsilon) == count
    assert singular._iterations(np.eye(1), np.full(1, 100.0), 9.0, 0.0901 * 100 / 99) == 2, "relative to 99"
    assert singular._iterations(np.eye(1), np.ones(1), 0.0, -1.0) == singular.MOST


# --- judgements of recordings -----------------------------------------------------------------------------
def test_recorded_columns_are_compared_where_the_motion_is_known(monkeypatch):
    """The motion is known at 0, 0.5 and 1 s; the recording has 0, 1 and 2 s."""
    times = np.array([0.0, 0.5, 1.0])
    place = np.array([[[1.0, 0.0, 0.0]], [[2.0, 0.0, 0.0]], [[4.0, 0.0, 0.0]]])
    turn, zero = np.tile([1.0, 0.0, 0.0, 0.0], (3, 1, 1)), np.zeros((3, 1, 3))
    motion = Trajectory("s", "e", "1", "m", {}, times, ("b",), place, turn, zero, zero)
    known = Exact(motion, np.array([0.001, 0.5, 0.002]), "why")
    monkeypatch.setattr(judgement, "_explanations", lambda scene, d, noise: asked.append((d, noise)) or [])
    asked: list = []
    columns = {"b.position.x": np.array([1.0, 4.5, 9.0]), "b.position.y": np.array([0.0, 0.001, 9.0])}
    recording = Recording(np.array([0.0, 1.0, 2.0]), columns, {"b.position.y": 0.1})
    found = judgement._judged(scene(), recording, known, 0.01)
    first, second = found.columns
    assert (first.allowed, second.allowed) == pytest.approx((0.01, 0.102)), "of the length, or the bound"
    assert (first.name, first.largest, first.begins) == ("b.position.x", 0.5, 1.0)
    assert first.bound == pytest.approx(0.002) and second.bound == pytest.approx(0.102)
    assert found.until == 1.0 and found.reason == "why" and second.is_right and not found.is_right
    [(d, noise)] = asked
    assert noise == pytest.approx(math.sqrt((0.002**2 + 0.102**2) / 2)) and d.times.tolist() == [0.0, 1.0]
    assert d.exact["b.position.x"].tolist() == [1.0, 4.0] and d.later(np.array([0.5]))[
        "b.position.x"
    ] == pytest.approx([2.0])
    right = Recording(np.array([0.0, 1.0]), {"b.position.x": np.array([1.0, 4.0])})
    assert judgement._judged(scene(), right, known, 0.0).is_right and len(asked) == 1
    assert judgement._judged(scene(), recording, known, 0.5).is_right and len(asked) == 1
    assert not judgement._judged(scene(), recording, known, 0.49).is_right


@pytest.mark.parametrize(
    ("simple", "changed", "steps"),
    [(1e-6, 1e-6, 1), (0.9e-5, 1e-6, 1), (1.1e-5, 1e-6, 2), (0.5, 0.9e-3, 2), (0.5, 1.1e-3, 3)],
)
def test_causes_are_tried_until_little_is_left(monkeypatch, simple, changed, steps):
    done = []
    monkeypatch.setattr(judgement, "simple", lambda d: done.append(1) or ["s"])
    monkeypatch.setattr(judgement, "changed", lambda scene, d, seconds: done.append(seconds) or ["c"])
    monkeypatch.setattr(judgement, "pairs", lambda d, causes, seconds: done.append(seconds) or ["p"])
    left = {1: simple, 2: changed, 3: 1e-9}
    monkeypatch.setattr(
        judgement, "ranked", lambda d, causes, noise: [SimpleNamespace(remains=left[len(causes)])]
    )
    d = SimpleNamespace(size=lambda columns: 1.0)
    assert judgement._explanations(scene(), d, 1e-9)[0].remains == left[steps]
    assert done == [1, 20.0, 20.0][:steps]
    if simple == 0.5 and steps == 3:
        assert judgement._explanations(scene(), d, 0.2)[0].remains == simple, "three times the noise is more"


# --- studies ----------------------------------------------------------------------------------------------
def test_finer_settings_of_a_family_out_of_time_are_not_started(monkeypatch):
    made = []

    def run(engine, scene, times, setting, limit):
        made.append((setting.family, setting.options["step"], limit))
        outcome = Outcome.TIMED_OUT if setting == Setting("f", {"step": 0.1}) else Outcome.COMPLETED
        return replace(still(), outcome=outcome)

    monkeypatch.setattr(hurried, "run_estimated", run)
    hurry = hurried.Hurried()
    cases = [
        Case(scene(), np.array([1.0]), "e", Setting(f, {"step": h}), 7.0)
        for h in (0.2, 0.1, 0.05)
        for f in "fg"
    ]
    outcomes = [hurry.trajectory(case).outcome for case in cases]
    assert [o.name for o in outcomes] == [
        "COMPLETED",
        "COMPLETED",
        "TIMED_OUT",
        "COMPLETED",
        "TIMED_OUT",
        "COMPLETED",
    ]
    assert ("f", 0.05, 7.0) not in made and ("g", 0.05, 7.0) in made


def known(**parts: object) -> SimpleNamespace:
    given = {"kind": "reference", "bound": 2e-11, "both": True, "seconds": 1.26, "reason": "", "until": 1.0}
    return SimpleNamespace(scene=scene(), truth={**given, **parts})


def test_sentences_on_truths():
    assert truth_sentences.truth([known()]) == (
        "The reference of s is known to 2e-11: two formulations that share no code agree; "
        "it took 1.3 s of CPU time."
    )
    part = known(both=False, reason="no time is left", until=0.25)
    assert truth_sentences.truth([part]) == (
        "The reference of s is known to 2e-11 up to t = 0.25 s of 1 s (no time is left), and errors are of "
        "this part: two runs of one formulation agree; it took 1.3 s of CPU time."
    )
    closed = [known(kind="closed form", bound=b) for b in (1e-14, 3e-13)]
    assert truth_sentences.truth(closed[:1]).endswith("by a reduced equation, to 1e-14.")
    assert truth_sentences.truth(closed).endswith("to 3e-13 or better.")
    ends = known(kind="closed form", reason="it locks", until=0.5)
    assert truth_sentences.truth([ends]).endswith(
        "The motion of s is known up to t = 0.5 s of 1 s (it locks), and errors are of this part."
    )
    assert (
        truth_sentences.truth([known(kind="", reason="singular")]) == "There is no reference for s: singular."
    )
    assert (
        truth_sentences.up_to([known(), part, ends]) == "Up to t = 0.25 s"
        and truth_sentences.up_to([known()]) == ""
    )


# --- changed scenes and motions ---------------------------------------------------------------------------
def test_copies_with_changed_fields():
    rod = body(velocity=(1.0, 2.0, 3.0))
    moved = mapped(
        rod,
        {"mass": lambda m: 3 * m, "angular_velocity": lambda w: 1 / 0, "position": lambda p: 2 * np.array(p)},
    )
    assert (moved.mass, moved.position, moved.velocity) == (6.0, (2.0, 0.0, 0.0), (1.0, 2.0, 3.0))
    assert replaced(rod, name="c", position=np.zeros(3)).position == (0.0, 0.0, 0.0)
    assert fields_of(rod)["mass"] == 2.0
    near = nudged(scene(body=(rod,)), 1e-3)
    assert near.body[0].mass == pytest.approx(2.004) and near.body[0].velocity == pytest.approx(
        (1.002, 2.004, 3.006)
    )
    assert near.gravity == pytest.approx((0.0, -10.02, 0.0)) and near.body[0].position == pytest.approx(
        (1.002, 0.0, 0.0)
    )
    other = weighed(scene())
    assert other.body[0].mass == 4.0 and other.gravity == (1.0, -12.0, 3.0)


def test_equivalent_scenes():
    two = scene(body=(body("b"), body("c", 2.0)), joint=(hinge("A"), hinge("B", "b", "c", x=1.5)))
    two = two.with_(driver=(Driver(joint="B", polynomial=(0.0, 1.0)),), load=(Moment(body="c", moment=Z),))
    named = relabelled(two)
    assert [b.name for b in named.body] == ["part z0", "part y1"] and named.load[0].body == "part y1"
    assert [j.bodies for j in named.joint] == [("ground", "part z0"), ("part z0", "part y1")]
    assert [j.name for j in named.joint] == ["joint z0", "joint y1"] and named.driver[0].joint == "joint y1"
    run = renamed(two, still(reactions={"A": 1, "B": 2}))
    assert run.bodies == ("part z0", "part y1") and run.reactions == {"joint z0": 1, "joint y1": 2}
    back = swapped(two).joint[1]
    assert back.bodies == ("c", "b") and back.axis == (0.0, 0.0, -1.0) and back.anchor == (1.5, 0.0, 0.0)
    assert stretched(two).joint[0].axis == (0.0, 0.0, 1000.0)
    assert [j.name for j in duplicated(two).joint] == ["A", "B", "again"]
    assert duplicated(two).joint[2].anchor == (1.5, 0.0, 0.0)
    longer = two.joint[0].model_copy(update={"axis": (0.0, 0.0, 5.0)})
    sleeve = satisfied(two.with_(joint=(longer, two.joint[1]))).joint[-1]
    assert (sleeve.name, sleeve.bodies, sleeve.anchor, sleeve.axis) == (
        "sleeve",
        ("ground", "b"),
        (0.0, 0.0, 0.3),
        Z,
    )
    for change in (swapped, duplicated, satisfied, stretched):
        assert "no " in change(scene(joint=())).reason


def test_functions_that_begin_later():
    """c0 + c1 t + c2 t² at t + 2, minus the value at 2."""
    driver = Driver(joint="A", polynomial=(0.0, 3.0, 0.5), sine=Sine(amplitude=0.2, frequency=4.0))
    later = _later(driver, 2.0)
    assert later.polynomial == pytest.approx(
        (-0.2 * math.sin(8.0), 5.0, 0.5)
    ) and later.sine.phase == pytest.approx(8.0)
    table = Driver(joint="A", table=((0.0, 0.0), (1.0, 1.0), (2.0, 3.0), (3.0, 4.0)))
    assert _later(table, 0.5).table[1] == (0.5, 1.0)
    factor = Factor(polynomial=(1.0, 2.0), start=1.0, stop=3.0)
    assert _shifted(factor, 0.5).interval == (0.5, 2.5) and _shifted(factor, 2.0).interval == (0.0, 1.0)
    assert _shifted(factor, 3.0) == Factor(polynomial=(0.0,)) and _shifted(factor, 2.9).stop == pytest.approx(
        0.1
    )


def test_samples_of_a_motion_backwards():
    run = still(
        velocity=np.array([[[1.0, 0.0, 0.0]], [[2.0, 0.0, 0.0]]]),
        reactions={"A": np.arange(12.0).reshape(2, 6)},
    )
    back = _samples(scene(), run, np.array([1, 0]), run.times, -1.0)
    assert back.velocity[:, 0, 0].tolist() == [-2.0, -1.0] and back.reactions["A"][0, 0] == 6.0
    sleeve = Cylindrical(name="C", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=Z)
    assert pinned(scene(joint=(hinge(), sleeve))) == ["A"]
    assert joints_kept(run, []).reactions == {} and joints_kept(still(), ["A"]).reactions is None


def test_a_driver_replaced_by_its_moment():
    driven = scene(driver=(Driver(joint="A", polynomial=(0.0, 1.0)),))
    run = still(reactions={"A": np.tile([9.0, 9.0, 9.0, 9.0, 9.0, 4.0], (2, 1))}, velocity=np.ones((2, 1, 3)))
    found = replayed(driven, run)
    assert found.load[-1].moment == (0.0, 0.0, 4.0) and found.load[-1].body == "b" and not found.driver
    assert found.body[0].velocity == (1.0, 1.0, 1.0)
    run.reactions["A"][1, 5] = 5.0
    assert "varies" in replayed(driven, run).reason
    assert "exactly one driver" in replayed(scene(), run).reason
    turned = driven.with_(joint=(hinge(first="b", second="ground"),))
    assert "on the ground" in replayed(turned, run).reason
