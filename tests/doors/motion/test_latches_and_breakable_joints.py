"""Conditions of joints and couplings: latches where a coordinate reaches a value, joints that break by their
reaction, restarts, refusals; closed forms, and the judge's own events."""

from dataclasses import replace

import numpy as np
import pytest

import mbref
from crosscheck.engine import engine
from crosscheck.judge.arithmetic import EXTENDED
from crosscheck.judge.metrics import measure
from crosscheck.judge.reference.piecewise import motion_by
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.truth.reference_truth import ReferenceTruth
from mbref import Motion, Scene, SceneError
from tests.helpers.coupled_mechanisms import body
from tests.helpers.intermittent_mechanisms import carts, rotors
from tests.helpers.parts import Z, hinge, joint, rod, slide

ROUNDED = 1e-12  # s, m, rad, m/s and N of mechanisms of about 1 m, 1 kg and 1 s
G, ORIGIN = 10.0, (0.0, 0.0, 0.0)
BEGIN = 1.2  # rad, angle at which the bob of a pendulum of 1 m and 1 kg is let go


def bob(limit: float) -> Scene:
    """A bob on a massless rope of 1 m, which breaks at a tension (N)."""
    place = (np.sin(BEGIN), -np.cos(BEGIN), 0.0)
    rope = joint("R", "distance", "ground", "bob", anchors=[ORIGIN, place], release={"force": limit})
    mass = body("bob", 1.0, [0.1] * 3, place)
    return Scene(name="bob", gravity=(0.0, -G, 0.0), duration=1.0, body=[mass], joint=[rope])


PUSH = 5.0  # N m/s, rate of the moment that opens the door from 1 s on
HOLD = 3.0  # N, force at the door's edge, 1 m from its hinge, at which the catch lets go
INERTIA = 0.2 + 2.0 * 0.25  # kg m², of the door about its hinge
CLOSED = -0.5  # rad


def door() -> Scene:
    """A door that closes at 2 rad/s onto a stop, where a catch holds it until a moment pulls it open."""
    edge = [np.cos(CLOSED), np.sin(CLOSED), 0.0]
    moving = {"velocity": [0.0, -1.0, 0.0], "angular_velocity": [0.0, 0.0, -2.0]}
    push = {"type": "moment", "body": "door", "moment": [0.0, 0.0, PUSH]}
    at_stop = {"lower": CLOSED, "restitution": 0.5}
    when, release = {"joint": "A", "reaches": CLOSED}, {"force": HOLD}
    return Scene(
        name="door",
        duration=2.0,
        body=[body("door", 2.0, [0.1, 0.2, 0.2], (0.5, 0.0, 0.0), **moving)],
        joint=[
            hinge("A", "ground", "door", ORIGIN, Z, stop=at_stop),
            joint("C", "inline", "ground", "door", edge, axis=edge, when=when, release=release),
        ],
        load=[{**push, "factor": {"polynomial": [-1.0, 1.0], "start": 1.0}}],
    )


@pytest.fixture(scope="module")
def door_motion() -> Motion:
    return mbref.simulate(door(), "taylor", times=[0.0, 0.1, 0.25, 1.0, 1.8, 2.0], rtol=1e-13)


@pytest.mark.parametrize(
    "when",
    [
        {"joint": "A", "reaches": "200 mm"},
        {"bodies": ["one", "two"], "points": [ORIGIN, (1.0, 0.0, 0.0)], "reaches": 0.7},
    ],
    ids=["travel", "distance"],
)
def test_carts_latch_where_a_travel_or_a_distance_reaches_its_value(when):
    """Carts of 1 kg at 2 m/s and 3 kg at -1 m/s start 1 m apart: 2 m/s · t = 0.2 m and 1 m - 3 m/s · t = 0.7
    m at 0.1 s; then v = (m₁ v₁ + m₂ v₂) / (m₁ + m₂) = -0.25 m/s."""
    motion = mbref.simulate(carts(active=None, when=when), "taylor", times=[0.0, 0.1, 0.5])
    (event,) = motion.events
    assert abs(event.time - 0.1) <= ROUNDED and event.engaged == ("L",)
    assert np.abs(motion.velocity[:, :, 0] - [[2, -1], *[[-0.25, -0.25]] * 2]).max() <= ROUNDED
    assert motion.joint("L").active.tolist() == [0, 1, 1]


@pytest.mark.parametrize("end", [0.05, 0.1])
def test_carts_latch_after_or_at_the_time_at_which_another_joint_lets_go(end):
    """A third body's joint lets go at 0.05 s or 0.1 s, when a cart at 2 m/s has moved by 0.2 m. Then both
    carts move at -0.25 m/s, by their momentum; in the judge's motion, too."""
    latched, place = carts(active=None, when={"joint": "A", "reaches": 0.2}), (0.0, 0.0, 5.0)
    other = joint("X", "fixed", "ground", "third", place, active=[[0.0, end]])
    third = body("third", 1.0, [0.1] * 3, place)
    scene = latched.with_(body=[*latched.body, third], joint=[*latched.joint, other])
    motion = mbref.simulate(scene, "taylor", times=[0.0, 0.5])
    latch = motion.events[-1]
    assert abs(latch.time - 0.1) <= ROUNDED and latch.engaged == ("L",)
    assert [event.time for event in motion.events if event.released == ("X",)] == [end]
    assert len(motion.events) == (1 if end == 0.1 else 2)
    judged = motion_by(natural_motion, scene, [0.0, 0.5], EXTENDED)
    assert abs(judged.events[-1] - 0.1) <= ROUNDED
    for velocity in (motion.velocity, judged.velocity):
        assert np.abs(velocity[-1, :2, 0] + 0.25).max() <= ROUNDED


def test_latch_does_not_take_a_coordinate_where_its_own_interval_ends():
    """The cart has travelled by 0.2 m at 0.1 s; the interval [0 s, 0.1 s) ends before."""
    motion = mbref.simulate(carts(active=[[0.0, 0.1]], when={"joint": "A", "reaches": 0.2}), "taylor")
    assert not any(event.engaged for event in motion.events)
    assert np.abs(motion.velocity[-1, :, 0] - [2.0, -1.0]).max() <= ROUNDED


@pytest.mark.parametrize("back", [0.25, 1e-2, 1e-3])
def test_mass_that_starts_at_the_value_latches_where_it_returns(back):
    """A mass of 1 kg, pushed by 1 N - 3 N t / back, is at t²/2 (1 - t / back): it returns at ``back``, s."""
    latch = joint("L", "fixed", "ground", "a", when={"joint": "S", "reaches": 0.0})
    push = {"type": "joint_force", "joint": "S", "force": 1.0, "factor": {"polynomial": [1.0, -3.0 / back]}}
    joints = [slide("S", "ground", "a", ORIGIN), latch]
    mass = body("a", 1.0, [0.1] * 3, ORIGIN)
    scene = Scene(name="back", duration=1.0, body=[mass], joint=joints, load=[push])
    (event,) = mbref.simulate(scene, "taylor", times=[0.0, 1.0]).events
    assert event.engaged == ("L",) and abs(event.time - back) <= ROUNDED


@pytest.mark.parametrize("tension", [20.0, (1 - 1e-6) * G * (3 - 2 * np.cos(BEGIN))], ids=["high", "peak"])
def test_pendulum_released_by_its_tension_falls_freely(tension):
    """A bob of 1 kg on a rope of 1 m starts at rest at θ₀ = 1.2 rad. The tension T = m g (3 cos θ - 2 cos θ₀)
    gives the angle of the release, and v² = 2 g (cos θ - cos θ₀) the speed of the fall. The peak of T, at
    θ = 0, exceeds the second limit for less than 1 ms."""
    motion = mbref.simulate(bob(tension), "taylor", times=[0.0, 1.0], rtol=1e-13)
    (event,) = motion.events
    angle = np.arccos((tension / G + 2 * np.cos(BEGIN)) / 3)
    place = np.array([np.sin(angle), -np.cos(angle), 0.0])
    speed = -np.sqrt(2 * G * (np.cos(angle) - np.cos(BEGIN))) * np.array([np.cos(angle), np.sin(angle), 0.0])
    left = 1.0 - event.time
    fallen = place + speed * left - [0.0, G * left**2 / 2, 0.0]
    assert event.released == ("R",) and np.abs(event.position[0] - place).max() <= ROUNDED
    assert np.abs(event.velocity_after[0] - speed).max() <= ROUNDED
    assert np.abs(motion.position[-1, 0] - fallen).max() <= ROUNDED and not motion.joint("R").force[-1].any()


def test_catch_takes_the_door_at_its_stop_and_lets_go_by_its_force(door_motion):
    """The door closes after 0.5 rad / 2 rad/s, and gives up I (2 rad/s)² / 2 without a bounce. From 1 s on
    the moment PUSH (t - 1) loads the catch 1 m from the hinge, up to HOLD; then I φ'' = PUSH (t - 1)."""
    closed, opened = door_motion.events
    assert (closed.engaged, closed.stops, opened.released) == (("C",), (), ("C",))
    assert abs(closed.time - 0.25) <= ROUNDED and abs(opened.time - 1.0 - HOLD / PUSH) <= ROUNDED
    assert closed.energy_before == pytest.approx(INERTIA * 2.0**2 / 2, rel=ROUNDED)
    assert closed.energy_after <= ROUNDED
    free, begin = door_motion.times[-2:] - 1.0, HOLD / PUSH
    turned = PUSH / INERTIA * ((free**3 - begin**3) / 6 - begin**2 / 2 * (free - begin))
    assert np.abs(door_motion.joint("A").angle[-2:] - CLOSED - turned).max() <= ROUNDED


@pytest.mark.parametrize(("t", "later"), [(0.1, 2), (0.25, 1), (1.8, 0)])
def test_scene_at_carries_whether_the_catch_holds(door_motion, t, later):
    """Before it closes, closed, and opened: a run from there has the events left and the last pose."""
    rest = mbref.simulate(door_motion.scene_at(t), "taylor", times=[0.0, 2.0 - t], rtol=1e-13)
    assert len(rest.events) == later
    assert np.abs(rest.position[-1] - door_motion.position[-1]).max() <= ROUNDED


def test_broken_joint_is_no_part_of_the_scene_after_the_break():
    """The rope breaks before 0.9 s. The scene at this sample has no joint and continues the fall."""
    motion = mbref.simulate(bob(20.0), "taylor", times=[0.0, 0.9, 1.0])
    fallen = motion.scene_at(0.9)
    assert not fallen.joint
    rest = mbref.simulate(fallen, times=[0.1])
    assert np.abs(rest.position - motion.position[-1]).max() <= 1e-9  # m; rtol of both runs


def test_linkage_that_locks_at_an_angle_becomes_a_truss_at_rest():
    """A rod of m = 1 kg and l = 1 m falls by 0.3 rad and pulls a block along a level slide: the weight has
    done the work m g l / 2 sin 0.3. Then a ball joint holds the middle of the rod, and thereby both."""
    bodies = [rod("a", ORIGIN, (1.0, 0.0, 0.0)), body("c", 2.0, [0.1] * 3, (1.5, 0.0, 0.0))]
    link = joint("B", "distance", "a", "c", anchors=[(1.0, 0.0, 0.0), (1.5, 0.0, 0.0)])
    ball = joint("W", "spherical", "ground", "a", (0.5, 0.0, 0.0), when={"joint": "A", "reaches": -0.3})
    joints = [hinge("A", "ground", "a", ORIGIN), link, slide("S", "ground", "c", (1.5, 0.0, 0.0)), ball]
    scene = Scene(name="truss", gravity=(0.0, -G, 0.0), duration=1.0, body=bodies, joint=joints)
    motion = mbref.simulate(scene, "taylor", times=[0.0, 0.9, 1.0], rtol=1e-13)
    (event,) = motion.events
    assert abs(event.angles["A"] + 0.3) <= ROUNDED
    assert event.energy_before == pytest.approx(0.5 * G * np.sin(0.3), rel=ROUNDED)
    assert event.energy_after <= ROUNDED and np.abs(motion.velocity[1:]).max() <= ROUNDED


def test_clutch_that_cannot_carry_its_load_lets_go_at_once():
    """Braked by 3 N m / 0.3 kg m² = 10 rad/s², rotor A reaches 6 t - 5 t² = 1 rad at 0.2 s with 4 rad/s. The
    clutch, of ratio 1/2, adds (1/2)² 0.3 kg m² of rotor B: A has 4 · 0.3 / 0.375 = 3.2 rad/s, B half, by 0.48
    N m s. It would then brake B by 3 / 0.375 / 2 = 4 rad/s² with 1.2 N m, more than its limit, 1 N m."""
    when, release = {"joint": "A", "reaches": "1 rad"}, {"joint": "B", "moment": 1.0}
    coupling = [{"name": "clutch", "joints": ["A", "B"], "ratio": 0.5, "when": when, "release": release}]
    brake = {"type": "joint_torque", "joint": "A", "torque": -3.0}
    scene = rotors().with_(coupling=coupling, load=[brake])
    motion = mbref.simulate(scene, "taylor", times=[0.0, 0.4], rtol=1e-13)
    assert [event.engaged for event in motion.events] == [("clutch",), ()]
    assert "largest impulse 0.48 N m s in joint B" in motion.events[0].sentence
    assert all(abs(event.time - 0.2) <= ROUNDED for event in motion.events)
    assert np.abs(motion.angular_velocity[-1, :, 2] - [3.2 - 10.0 * 0.2, 1.6]).max() <= ROUNDED


JUDGED = [carts(active=None, when={"joint": "A", "reaches": 0.2})]
JUDGED += [pytest.param(scene, marks=pytest.mark.slow) for scene in (bob(20.0), door())]


@pytest.mark.parametrize("scene", JUDGED, ids=["carts that latch", "rope that breaks", "door with a catch"])
def test_judge_finds_latches_and_releases_by_itself(scene):
    """The reference has two formulations, which find the times of events by their own motions: mbref's run
    has no error by them. With its last event written 10 ms late, the measured error of times is 10 ms."""
    truth = ReferenceTruth(scene, 60.0)
    run = mbref.simulate(scene, "taylor", times=np.linspace(0.0, scene.duration, 5), rtol=1e-13)
    found = measure(scene, run, truth)
    assert len(run.events) and found["error"] <= ROUNDED and found["event_time_error"] <= ROUNDED
    late = replace(run, events=(*run.events[:-1], replace(run.events[-1], time=run.events[-1].time + 0.01)))
    assert measure(scene, late, truth)["event_time_error"] == pytest.approx(0.01)


@pytest.mark.parametrize(
    "factor", [{"polynomial": [1.0]}, {"polynomial": [0.0, 1.0]}], ids=["constant", "ramp"]
)
def test_release_by_a_force_that_redundant_joints_share_is_refused_by_name(factor):
    """Two welds hold a mass. How they share its load, also one from zero, depends on their elasticity."""
    welds = [joint("B", "fixed", "ground", "a", release={"force": 1.0}), joint("C", "fixed", "ground", "a")]
    mass = body("a", 1.0, [0.1] * 3, ORIGIN)
    load = {"type": "force", "body": "a", "point": ORIGIN, "force": [0.0, -G, 0.0], "factor": factor}
    scene = Scene(name="two", body=[mass], joint=welds, load=[load])
    says = r"B\.release: redundant constraints leave the force in joint 'B' open"
    with pytest.raises(SceneError, match=says):
        mbref.simulate(scene)
    assert "redundant constraints" in motion_by(natural_motion, scene, [0.0, 1.0], EXTENDED).reason


IN_ORDER = "joint[L].active: must be intervals in order that neither touch nor overlap, got "
MOTOR = {"type": "revolute", "axis": [0, 0, 1], "armature": 1.0, "active": [[0.1, 0.3]]}


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"when": {"joint": "X", "reaches": 1.0}}, "joint[L].when.joint: unknown joint 'X'; known: A, B, L"),
        ({"when": {"joint": "L", "reaches": 1.0}}, "joint[L].when.joint: needs a joint that always holds"),
        ({"when": {"joint": "A", "reaches": "3 deg"}}, "when.reaches: is of the displacement of 'A', got '3"),
        ({"when": {"joint": "A", "coordinate": ["angle"], "reaches": 1.0}}, "joint[L].when.coordinate: "),
        ({"when": {"reaches": 1.0}}, "joint[L].when: needs a joint, or bodies and points"),
        ({"when": {"bodies": ["one", "two"], "reaches": 1.0}}, "joint[L].when.points: is required for a dis"),
        ({"release": {"force": 1.0, "moment": 1.0}}, "joint[L].release: needs a force or a moment, not both"),
        ({"type": "spherical", "release": {"moment": 1.0}}, "release.moment: 'L' is spherical, whose moment"),
        ({"release": {"force": 1.0}, "holds_at_start": False}, "holds_at_start: lets it never hold"),
        ({"holds_at_start": True}, "joint[L].holds_at_start: is of a constraint with active, when or"),
        ({"active": [[0.3, 0.1]]}, IN_ORDER),
        ({"active": [[0.1, 0.3], [0.3, 0.4]]}, IN_ORDER),
        ({"active": [0.1, 0.3]}, "joint[L].active[0]: must be a begin and an end (s), got 0.1"),
        ({"engages": "given_pose"}, "joint[L].engages: is of a constraint with intervals"),
        (MOTOR, "joint[L].armature: needs a joint that always holds, and this one has"),
    ],
)
def test_fault_of_intervals_or_of_a_condition_names_joint_and_field(changes, says):
    """The changes are of the latch L between two carts on the slides A and B."""
    with pytest.raises(SceneError) as fault:
        carts(**{"active": None, **changes})
    assert says in str(fault.value)


def test_engine_refuses_a_condition_by_its_path():
    """The latch L holds where slide A has moved by 0.2 m; adapters of engines map no conditions."""
    latched = carts(active=None, when={"joint": "A", "reaches": 0.2})
    refused = [str(engine(name).supports.missing(latched)) for name in ("mujoco", "pinocchio", "exudyn")]
    assert all(refusal.startswith("joint[L].when is a condition") for refusal in refused)
