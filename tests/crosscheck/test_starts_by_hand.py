"""Starts of scenes with offsets, and mobility / coordinates, turns and limits worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from crosscheck.judge import (
    deadline,
    joint_loads,
    momentum,
    published_measures,
    push_difference,
    reaction_balance,
    start,
)
from crosscheck.judge.mobility import Mobility, mobility, row_count
from crosscheck.judge.start import _up_to_turns, start_coordinates, started
from mbref import rotations
from mbref.scene import (
    Body,
    Coupling,
    Driver,
    Factor,
    JointForce,
    JointTorque,
    Moment,
    Revolute,
    Scene,
    SceneError,
    SlideSpring,
    Spherical,
    TorsionSpring,
    Translational,
)
from mbref.trajectory import Trajectory

X, Y, Z, O = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)


def body(name: str, *place: float) -> Body:
    return Body(name=name, mass=2.0, inertia=(0.3, 0.4, 0.5), position=place)


def hinge(name: str, second: str, *anchor: float, first: str = "ground") -> Revolute:
    return Revolute(name=name, bodies=(first, second), anchor=anchor, axis=Z)


RAIL = Translational(name="R", bodies=("ground", "c"), anchor=(5.0, 0.0, 0.0), axis=(0.0, 2.0, 0.0))


def geared(length: float = 1.0, **parts: Any) -> Scene:
    """Bars of some length on hinges at (0, 0, 0) and (2, 0, 0), and a block on a rail along y."""
    bodies = body("a", length, 0.0, 0.0), body("b", 2.0, length, 0.0), body("c", 5.0, 0.0, 0.0)
    joints = hinge("A", "a", 0.0, 0.0, 0.0), hinge("B", "b", 2.0, 0.0, 0.0), RAIL
    return Scene(**{"name": "s", "body": bodies, "joint": joints, "gravity": O, **parts})


GEAR = Coupling(name="G", joints=("A", "B"), ratio=2.0, offset=0.5)
RACK = Coupling(name="H", joints=("A", "R"), ratio=3.0, offset=-0.25)


def test_coordinates_at_a_start_with_offsets(monkeypatch):
    """q_A = 0.1, q_B = 2 q_A + 0.5 and s_R = 3 q_A - 0.25; the bodies stand where these take them."""
    scene = geared(coupling=(GEAR, RACK))
    turns = rotations.from_vector(np.array([[0.0, 0.0, 0.1], [0.0, 0.0, 0.7], O]))
    places = (math.cos(0.1), math.sin(0.1), 0.0), (2 - math.sin(0.7), math.cos(0.7), 0.0), (5.0, 0.05, 0.0)
    placed = scene.with_(
        body=[
            given.model_copy(update={"position": place, "orientation": tuple(turn.tolist())})
            for given, place, turn in zip(scene.body, places, turns, strict=True)
        ]
    )
    monkeypatch.setattr(Scene, "assembled", lambda self: placed)
    found = start_coordinates(scene)
    assert started(scene) is placed and list(found) == ["A", "B", "R"]
    assert found["A"] == pytest.approx([0.1, 0.0]) and found["B"] == pytest.approx([0.7, 0.0])
    assert found["R"] == pytest.approx([0.0, 0.05], abs=1e-15)
    monkeypatch.setattr(Scene, "assembled", lambda self: self)
    assert started(scene) is scene
    rest = {name: values.tolist() for name, values in start_coordinates(scene).items()}
    assert rest == dict.fromkeys("ABR", [0.0] * 2)


@pytest.mark.parametrize(
    ("coupling", "gap", "least"),
    [
        (GEAR, 0.25, 0.25),
        (GEAR, 2 * math.pi + 0.25, 0.25),
        (GEAR, -6 * math.pi - 0.125, 0.125),
        (RACK, 0.25, 0.25),
        (RACK, 6 * math.pi - 0.25, 0.25),
        (RACK, 2 * math.pi, 2 * math.pi),
        (Coupling(name="G", joints=("R", "A"), ratio=3.0), 2 * math.pi + 0.5, 0.5),
        (Coupling(name="G", joints=("A", "B"), ratio=0.25), math.pi / 2 + 0.125, 0.125),
        (Coupling(name="G", joints=("A", "B"), ratio=1e-3), 0.2 * math.pi, 0.0),
        (Coupling(name="G", joints=("A", "R"), ratio=1.0), 202 * math.pi, 2 * math.pi),
        (Coupling(name="G", joints=("A", "R"), ratio=1.0), -202 * math.pi, 2 * math.pi),
    ],
)
def test_gaps_of_couplings_up_to_full_turns(coupling, gap, least):
    """Full turns of angles count by their ratios, up to a hundred; displacements have none."""
    assert _up_to_turns(geared(), coupling, gap) == pytest.approx(least, abs=1e-12)


@pytest.mark.parametrize(
    ("shift", "size", "is_refused"),
    [(4.9e-12, 1.0, False), (5.1e-12, 1.0, True), (0.9e-12, 0.1, False), (1.1e-12, 0.1, True)],
)
def test_poses_that_violate_a_joint_are_refused(monkeypatch, shift, size, is_refused):
    """Up to 1e-12 of the length of 5 m, or of 1 m where it is shorter."""
    scene = geared(coupling=(GEAR,))
    small = [b.model_copy(update={"position": tuple(size * x for x in b.position)}) for b in scene.body]
    joints = [j.model_copy(update={"anchor": tuple(size * x for x in j.anchor)}) for j in scene.joint]
    scene = scene.with_(body=small, joint=joints)
    turn = rotations.from_vector(np.array([0.0, 0.0, 0.5]))
    place = 2 * size, 0.0, 0.0
    arm = rotations.rotate(turn, np.array([0.0, size, 0.0]))
    placed = small[1].model_copy(update={"position": tuple(place + arm), "orientation": tuple(turn)})
    moved = small[0].model_copy(update={"position": (size, 0.0, -shift)})
    found = scene.with_(body=(moved, placed, small[2]))
    monkeypatch.setattr(Scene, "assembled", lambda self: found)
    if not is_refused:
        assert started(scene) is found
        return
    with pytest.raises(SceneError, match=rf"^A: the poses at the start violate it by {shift:.3g} m or rad$"):
        started(scene)


@pytest.mark.parametrize(
    ("angle", "is_refused"), [(0.5, False), (0.5 + 2e-11, True), (0.5 + 2 * math.pi, False)]
)
def test_poses_that_violate_a_coupling_are_refused(monkeypatch, angle, is_refused):
    """q_B = 2 q_A + 0.5 with q_A = 0, up to full turns."""
    scene = geared(coupling=(GEAR,))
    turn = rotations.from_vector(np.array([0.0, 0.0, angle]))
    arm = rotations.rotate(turn, np.array([0.0, 1.0, 0.0]))
    placed = scene.body[1].model_copy(
        update={"position": (2 + arm[0], arm[1], 0.0), "orientation": tuple(turn)}
    )
    found = scene.with_(body=(scene.body[0], placed, scene.body[2]))
    monkeypatch.setattr(Scene, "assembled", lambda self: found)
    if is_refused:
        with pytest.raises(SceneError, match=r"^G: the poses at the start violate it by 2e-11 m or rad$"):
            started(scene)
    else:
        assert started(scene) is found
    assert start.MET == 1e-12 and start.TURNS[[0, 100, -1]].tolist() == [-200 * math.pi, 0.0, 200 * math.pi]


# --- mobility ---------------------------------------------------------------------------------------------
def test_rows_and_degrees_of_freedom():
    """15 rows of 18 leave three freedoms; a driver and a coupling have one row each."""
    plain, gear = geared(), GEAR.model_copy(update={"offset": 0.0})
    assert mobility(plain) == Mobility(15, 0, 3) and row_count(plain) == 15
    assert mobility(plain.with_(coupling=(gear,))) == Mobility(16, 0, 2)
    drivers = tuple(Driver(joint=name, polynomial=(0.0, 1.0)) for name in "AB")
    assert (
        row_count(plain.with_(driver=drivers)) == 17
        and row_count(plain.with_(coupling=(gear,), driver=drivers)) == 18
    )
    over = plain.with_(
        joint=(*plain.joint, Spherical(name="S", bodies=("ground", "a"), anchor=(0.0, 0.0, 1.0)))
    )
    assert mobility(over) == Mobility(18, 3, 3)
    free = geared(joint=())
    assert mobility(free) == Mobility(0, 0, 18)


# --- loads along joint coordinates ------------------------------------------------------------------------
def test_loads_of_several_joints_and_their_angles():
    """Angles belong to loads about axes in their order; a displacement is found from the pose."""
    loads = (
        TorsionSpring(joint="B", stiffness=2.0, natural_angle=0.5),
        SlideSpring(joint="R", stiffness=4.0, natural_displacement=0.25, damping=0.5),
        JointTorque(joint="A", torque=3.0),
        JointForce(joint="R", force=-1.0),
    )
    scene = geared(load=loads)
    position = np.array([[1.0, 0.0, 0.0], [2.0, 1.0, 0.0], [5.0, 1.25, 0.0]])
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (3, 1))
    velocity = np.array([O, O, (0.0, 6.0, 0.0)])
    found = joint_loads.joint_wrenches(
        scene, 0.0, (position, turns), (velocity, np.zeros((3, 3))), np.array([1.5, 9.0])
    )
    assert [load.joint for load in joint_loads.turning_loads(scene)] == ["B", "A"]
    assert [load.joint for load in joint_loads.joint_loads(scene)] == ["B", "R", "A", "R"]
    assert found[0] == pytest.approx([0.0, 0.0, 0.0, 0.0, 0.0, 3.0])
    assert found[1] == pytest.approx([0.0, 0.0, 0.0, 0.0, 0.0, -2.0])
    assert found[2] == pytest.approx([0.0, -4.0 - 3.0 - 1.0, 0.0, 0.0, 0.0, 0.0])


# --- limits of time ---------------------------------------------------------------------------------------
def test_the_limit_that_ends_first_holds(monkeypatch):
    """At 10 s of CPU time, 5 s and within them 100 s; a limit holds up to its very end."""
    now = [10.0]
    monkeypatch.setattr(deadline.time, "thread_time", lambda: now[0])
    with deadline.within(5.0):
        with deadline.within(100.0):
            now[0] = 15.0
            deadline.ask()
            now[0] = 15.1
            with pytest.raises(deadline.TimeIsUp, match="the CPU time has passed"):
                deadline.ask()
        now[0] = 10.0
        with deadline.within(1.0):
            now[0] = 12.0
            with pytest.raises(deadline.TimeIsUp):
                deadline.ask()
        deadline.ask()
    now[0] = 1e9
    deadline.ask()


def test_work_that_is_given_up_ends():
    with deadline.given_up(), pytest.raises(deadline.GivenUp, match="the computation was cancelled"):
        deadline.ask()
    deadline.ask()


# --- reactions, momentum and measures ---------------------------------------------------------------------
def run(*places: float, **parts: Any) -> Trajectory:
    """The three bodies at several times, shifted along z."""
    k = len(places)
    rest = np.zeros((k, 3, 3))
    place = np.array([b.position for b in geared().body]) + np.array(places)[:, None, None] * Z
    turn = np.tile([1.0, 0.0, 0.0, 0.0], (k, 3, 1))
    made = {"position": place, "orientation": turn, "velocity": rest, "angular_velocity": rest, **parts}
    return Trajectory("s", "e", "1", "m", {}, 0.5 * np.arange(k), ("a", "b", "c"), **made)


def test_unique_components_are_those_of_the_last_pose(monkeypatch):
    asked: list[Any] = []

    def shared(scene: Scene, t: float, position: Any, orientation: Any, rank: float) -> Any:
        asked.append((t, position[:, 2].tolist(), orientation.shape, rank))
        return {"A": np.zeros((6, 0))}

    monkeypatch.setattr(push_difference, "shared_wrenches", shared)
    last = {"A": np.array([[90.0, 0, 0, 0, 0, 0], [8.0, 0, 0, 0, 0, 0]])}
    second = {"A": last["A"] + [[0, 0, 0, 0, 0, 0], [0, 2.0, 0, 0, 0, 0]]}
    found = push_difference._reactions(
        geared(), run(0.0, 1.0, reactions=last), run(5.0, 7.0, reactions=second), 1e-7
    )
    assert found == (0.25, "reactions") and asked == [(0.5, [7.0] * 3, (3, 4), 1e-7)]
    none = push_difference._reactions(geared(), run(0.0, reactions={}), run(0.0, reactions=second), 1e-7)
    assert none == (0.0, "reactions")


def test_reactions_of_a_hinge_with_an_armature():
    """(3.5 + 2 + 0.5) kg m² q'' = -20 N m: the armature's moment is -0.5 q'', which the joint may exert."""
    link = Body(name="b", mass=2.0, inertia=(1.0, 3.0, 3.5), position=X)
    own = Revolute(name="A", bodies=("ground", "b"), anchor=O, axis=Z, armature=0.5)
    scene = Scene(name="s", body=(link,), joint=(own,), gravity=(0.0, -10.0, 0.0))
    second = -20.0 / 6.0
    rest, turn = np.zeros((2, 1, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (2, 1, 1))
    exact = Trajectory(
        "s",
        "e",
        "1",
        "m",
        {},
        np.array([0.0, 1.0]),
        ("b",),
        rest + X,
        turn,
        rest,
        rest,
        acceleration=rest + np.array([0.0, second, 0.0]),
        angular_acceleration=rest + np.array([0.0, 0.0, second]),
    )
    found = reaction_balance.with_exact_reactions(scene, exact)
    wanted = [0.0, 20.0 + 2 * second, 0.0, 0.0, 0.0, -0.5 * second]
    assert found.reactions["A"] == pytest.approx(np.tile(wanted, (2, 1)), abs=1e-12)
    assert reaction_balance.balance(scene, found, exact) == pytest.approx(0.0, abs=1e-14)
    assert reaction_balance.idle(scene, found, exact) == pytest.approx(0.0, abs=1e-14)
    across = replace(found, reactions={"A": np.tile([*wanted[:5], 9.0], (2, 1))})
    assert reaction_balance.idle(scene, across, exact) == pytest.approx(0.0, abs=1e-14)
    plain = scene.with_(joint=(own.model_copy(update={"armature": 0.0}),))
    largest = 20.0 + 2 * second
    assert reaction_balance.idle(plain, across, exact) == pytest.approx(9.0 / largest)


def test_joint_loads_that_change_with_time_keep_the_momentum():
    """Only forces and moments on bodies are pushes from outside."""
    fading = Factor(polynomial=(1.0, 2.0))
    between = hinge("K", "b", 1.0, 0.0, 0.0, first="a")
    pair = geared(joint=(between,), load=(JointTorque(joint="K", torque=1.0, factor=fading),))
    moving = run(0.0, 0.0, velocity=np.tile([0.5, 0.0, 0.0], (2, 3, 1)))
    assert momentum.momentum_series(pair, moving) is not None
    pushed = pair.with_(load=(*pair.load, Moment(body="a", moment=Z, factor=fading)))
    assert momentum.momentum_series(pushed, moving) is None


def test_measures_of_runs_without_samples(monkeypatch):
    none, exact = run(), run()
    scene = geared()
    monkeypatch.setattr(published_measures, "energy_drift", lambda scene, motion: motion.times)
    assert published_measures.energy(scene, none, None) is None
    assert published_measures.energy(scene, run(0.0, 0.0, 0.0), None) == 1.0
    assert published_measures.mean_square_distance("a")(scene, none, exact) is None
    assert published_measures.distance("a")(scene, none, exact) == 0.0
    assert published_measures.relative_distance("a")(scene, none, exact) == 0.0
    for measure in ("distance", "relative_distance", "mean_square_distance"):
        assert getattr(published_measures, measure)("a")(scene, run(0.0), None) is None
    found = [
        getattr(published_measures, measure)("c")(scene, run(3.0, 4.0, 9.0), run(0.0, 0.0))
        for measure in ("distance", "relative_distance", "mean_square_distance")
    ]
    assert found == pytest.approx([4.0, 0.8, math.sqrt(12.5)]), "at the samples of the exact motion"
