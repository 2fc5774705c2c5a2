"""End stops with restitution: closed forms, contacts, chatter, the judge's own events, refusals."""

from typing import Any

import numpy as np
import pytest

import mbref
from crosscheck.engine import engine
from crosscheck.judge.arithmetic import EXTENDED, doubles
from crosscheck.judge.metrics import measure
from crosscheck.judge.reference.piecewise import motion_by
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.reference.tree import tree_motion
from mbref import Scene, SceneError
from mbref.motions.event import Event
from tests.helpers.coupled_mechanisms import body
from tests.helpers.parts import X, Z, hinge, slide

G, ORIGIN = 10.0, (0.0, 0.0, 0.0)
ROUNDED = 1e-13  # of times, places and velocities of about 1 s, m and m/s
BY_STEPS = 1e-10  # of methods whose steps have the default tolerance
STEPPED = pytest.param("alf-dual+projection/dop853", BY_STEPS, marks=pytest.mark.slow)


def ball(restitution: float, duration: float) -> Scene:
    """A mass of 2 kg that falls by 1 m along a slide onto a stop."""
    stop = {"lower": -1.0, "restitution": restitution}
    return Scene(
        name="ball",
        gravity=(0.0, 0.0, -G),
        duration=duration,
        body=[body("ball", 2.0, [0.1] * 3, ORIGIN)],
        joint=[slide("S", "ground", "ball", ORIGIN, Z, stop=stop)],
    )


def door(restitution: float = 0.6) -> Scene:
    """A rod of 1 m and 2 kg, hinged at its end and held level, that falls onto a stop at -2 rad."""
    rod = body("rod", 2.0, [0.1, 0.2, 0.2], (0.5, 0.0, 0.0))
    stop = {"lower": -2.0, "restitution": restitution}
    joint = hinge("A", "ground", "rod", ORIGIN, Z, stop=stop)
    return Scene(name="door", gravity=(0.0, -G, 0.0), duration=1.2, body=[rod], joint=[joint])


def pushed() -> Scene:
    """A mass of 2 kg at its stop, which a force 1 - t (N) pushes there up to 1 s."""
    force = {"type": "force", "body": "a", "point": ORIGIN, "force": X, "factor": {"polynomial": [1.0, -1.0]}}
    joint = slide("S", "ground", "a", ORIGIN, X, stop={"upper": 0.0})
    mass = body("a", 2.0, [0.1] * 3, ORIGIN)
    return Scene(name="pushed", duration=2.0, body=[mass], joint=[joint], load=[force])


@pytest.mark.parametrize(("method", "close"), [("taylor", ROUNDED), STEPPED])
def test_bounces_follow_each_other_in_a_geometric_series(method, close):
    """t₀ = √(2 h / g), then flights 2 eᵏ t₀; impulses m (1 + e) eᵏ⁻¹ g t₀; kinetic energies fall by e²."""
    e, t0 = 0.5, np.sqrt(2 / G)
    motion = mbref.simulate(ball(e, 1.3), method, times=[0.0, 1.3])
    count = len(motion.events)
    flights = 2 * t0 * e ** np.arange(1, count)
    assert count == 5 and motion.outcome is mbref.Outcome.COMPLETED
    times = np.array([event.time for event in motion.events])
    assert np.abs(times - t0 - np.append(0.0, np.cumsum(flights))).max() <= close
    impulses = 2.0 * (1 + e) * e ** np.arange(count) * G * t0
    assert np.abs(motion.impulses["S"][:, 2] - impulses).max() <= 100 * close
    assert all(abs(event.energy_after / event.energy_before - e**2) <= 1e-8 for event in motion.events)


def test_bounces_without_end_become_a_contact_that_carries_the_weight():
    """They end at t₀ (1 + e) / (1 - e), without the flights below 1e-6 of the end time."""
    motion = mbref.simulate(ball(0.2, 1.0), "taylor", times=[0.0, 0.9, 1.0])
    last = motion.events[-1]
    assert (last.stops, last.contacts, last.chatter) == (("S.lower",),) * 3 and "bounces end" in last.sentence
    assert abs(last.time - 1.5 * np.sqrt(2 / G)) <= 1e-5
    assert np.abs(motion.position[1:, 0, 2] + 1.0).max() <= 1e-11
    assert np.abs(motion.joint("S").force[1:, 2] - 2.0 * G).max() <= 1e-9
    assert Event.from_record(last.to_record()).contacts == last.contacts


@pytest.mark.parametrize("restitution", [0.0, 0.6])
def test_falling_rod_rebounds_by_its_restitution(restitution):
    """I ω² / 2 = m g l sin 2 before the stop, and e ω after it; with e = 0 the rod stays there."""
    inertia, motion = 0.2 + 2.0 * 0.25, mbref.simulate(door(restitution), "taylor", times=[0.0, 0.9])
    speed = np.sqrt(2 * 2.0 * G * 0.5 * np.sin(2.0) / inertia)
    event = motion.events[0]
    assert abs(event.angles["A"] + 2.0) <= ROUNDED
    assert abs(event.angular_velocity_after[0, 2] - restitution * speed) <= 1e-10
    assert measure(door(restitution), motion, None)["impact_error"] <= ROUNDED


def test_contact_ends_when_its_force_would_pull():
    """x = -(t - 1)³ / 12 from 1 s on, when the force changes its sign; the reaction is the push before."""
    times = np.linspace(0.0, 2.0, 9)
    motion = mbref.simulate(pushed(), "taylor", times=times)
    changes = [(event.contacts, event.released) for event in motion.events]
    assert changes == [(("S.upper",), ()), ((), ("S.upper",))]
    assert abs(motion.events[1].time - 1.0) <= ROUNDED
    free = np.maximum(times - 1.0, 0.0)
    assert np.abs(motion.position[:, 0, 0] + free**3 / 12).max() <= ROUNDED
    assert np.abs(motion.joint("S").force[:, 0] + np.maximum(1.0 - times, 0.0)).max() <= 1e-10


@pytest.mark.parametrize("restitution", [0.0, 0.3, 1.0])
def test_two_masses_on_a_line_exchange_momentum(restitution):
    """Their sum of m v is constant, and they part with e times the speed at which they met."""
    masses, speeds = np.array([2.0, 1.0]), np.array([3.0, -1.0])
    bodies = [
        body(n, m, [0.1] * 3, (k, 0.0, 0.0), velocity=[v, 0.0, 0.0])
        for k, (n, m, v) in enumerate(zip("ab", masses.tolist(), speeds.tolist(), strict=True))
    ]
    stop = {"lower": "-400 mm", "restitution": restitution}
    joints = [slide("A", "ground", "a", ORIGIN, X), slide("B", "a", "b", (1.0, 0.0, 0.0), X, stop=stop)]
    scene = Scene(name="balls", duration=0.2, body=bodies, joint=joints)
    (event,) = mbref.simulate(scene, times=[0.0, 0.2]).events
    after = event.velocity_after[:, 0]
    assert abs(event.time - 0.1) <= ROUNDED and abs(masses @ (after - speeds)) <= 100 * ROUNDED
    assert abs(after[1] - after[0] - restitution * (speeds[0] - speeds[1])) <= 100 * ROUNDED


RUNS = [(pushed(), natural_motion), pytest.param(door(), tree_motion, marks=pytest.mark.slow)]


@pytest.mark.parametrize(("scene", "formulation"), RUNS, ids=["force A", "rod B"])
def test_judge_finds_the_events_by_itself(scene, formulation):
    """Formulations A and B locate gaps and forces from their own motions, without mbref's events."""
    times = np.linspace(0.0, scene.duration, 4)
    motion = mbref.simulate(scene, "taylor", times=times, rtol=1e-13)
    found = motion_by(formulation, scene, times, EXTENDED, seconds=60.0)
    assert not found.reason and np.abs(doubles(found.position) - motion.position).max() <= ROUNDED
    assert np.abs(doubles(found.velocity) - motion.velocity).max() <= 1e-12


@pytest.mark.parametrize(
    ("stop", "says"),
    [
        ({"lower": 0.1}, "coordinate starts, got 0.1"),
        ({"restitution": 0.5}, "upper: or lower is required"),
        ({"lower": -1.0, "restitution": 2.0}, "restitution: must be at most 1.0, got 2"),
        ({"upper": "3 deg"}, "is of the displacement of a translational joint, got '3 deg'"),
    ],
)
def test_fault_of_a_stop_is_named(stop, says):
    with pytest.raises(SceneError, match=says):
        ball(0.5, 1.0).with_(joint=[slide("S", "ground", "ball", ORIGIN, Z, stop=stop)])


def test_stop_is_refused_at_a_driven_joint_in_a_diagnosis_and_by_an_engine_without_stops():
    with pytest.raises(SceneError, match="needs a joint without a driver"):
        door().with_(driver=[{"joint": "A", "polynomial": [0.0, 1.0]}])
    with pytest.raises(SceneError, match=r"joint\[A\]\.stop: only motions have intervals and stops"):
        mbref.diagnose(door())
    assert "joint 'A' has an end stop" in str(engine("mujoco").supports.missing(door()))


def held_by_its_weight(duration: float, force: dict[str, Any]) -> Scene:
    """A mass of 1 kg on its stop, with a weight of 1 N and a force along the slide."""
    joint = slide("S", "ground", "a", ORIGIN, Z, stop={"lower": 0.0})
    load, mass = {"type": "joint_force", "joint": "S", **force}, body("a", 1.0, [0.1] * 3, ORIGIN)
    scene = Scene(name="held", duration=duration, body=[mass], joint=[joint], load=[load])
    return scene.with_(gravity=(0.0, 0.0, -1.0))


def test_short_pull_lifts_a_mass_off_its_stop():
    """50 N from 0.41 s to 0.42 s, a hundredth of the run: 49 · 0.01 m/s at 0.42 s, then 1 m/s² less."""
    scene = held_by_its_weight(0.8, {"force": 50.0, "factor": {"start": 0.41, "stop": 0.42}})
    motion = mbref.simulate(scene, "taylor", times=[0.0, 0.8])
    assert abs(motion.events[-1].time - 0.41) <= 1e-11
    assert abs(motion.velocity[-1, 0, 2] - (0.49 - 0.38)) <= 1e-10


@pytest.mark.parametrize("duration", [0.02, 0.2])
def test_first_pull_of_a_fast_force_ends_the_contact_in_runs_of_any_length(duration):
    """5 sin(80 π t) N exceeds the weight first at asin(1/5) / 80 π, about 0.8 ms."""
    sine = {"polynomial": [0.0], "sine": {"amplitude": 1.0, "frequency": 80 * np.pi}}
    push = {"force": 5.0, "factor": sine}
    motion = mbref.simulate(held_by_its_weight(duration, push), times=[0.0, duration])
    assert abs(motion.events[1].time - np.arcsin(0.2) / (80 * np.pi)) <= ROUNDED


def test_rod_that_starts_at_the_end_of_its_range_leaves_it_without_an_event():
    """Its upper end is its start, and it falls from there to -1 rad with I ω² / 2 = m g l sin 1."""
    stop = {"lower": -1.0, "upper": 0.0, "restitution": 0.5}
    joint = hinge("A", "ground", "rod", ORIGIN, Z, stop=stop)
    (event,) = mbref.simulate(door().with_(joint=[joint]), "taylor", times=[0.0, 0.5]).events
    speed = np.sqrt(2 * 2.0 * G * 0.5 * np.sin(1.0) / 0.7)
    assert event.stops == ("A.lower",) and abs(event.angular_velocity_after[0, 2] - speed / 2) <= 1e-10
