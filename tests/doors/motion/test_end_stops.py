"""End stops with restitution: closed forms, contacts, chatter, the judge's own events, refusals."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

import mbref
from crosscheck.engine import Setting, engine
from crosscheck.judge.arithmetic import EXTENDED, doubles
from crosscheck.judge.metrics import measure
from crosscheck.judge.reference.piecewise import motion_by
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.reference.tree import tree_motion
from mbref import Scene, SceneError
from tests.helpers.coupled_mechanisms import body
from tests.helpers.intermittent_mechanisms import carts
from tests.helpers.parts import X, Z, hinge, slide

G, ORIGIN = 10.0, (0.0, 0.0, 0.0)
ROUNDED = 1e-13  # s, m, m/s: 500 roundings of times, places and velocities near 1
SOLVED = 1e-10  # N, m/s: forces and velocities after equations whose condition costs three digits
BY_STEPS = 1e-10  # s, of methods whose steps have the default tolerance
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
    """A mass m = 2 kg falls by h = 1 m with g = 10 m/s² and e = 0.5: at t₀ = √(2 h / g) = 0.447 s, and after
    flights of 2 eᵏ t₀, k = 1, 2, …, of which four end before 1.3 s. Impulses are m (1 + e) eᵏ g t₀, up to 13
    N s, and kinetic energies fall by e². Limits of their relative errors are 100 times those of times (s), as
    the last bounces are small."""
    e, t0 = 0.5, np.sqrt(2 / G)
    motion = mbref.simulate(ball(e, 1.3), method, times=[0.0, 1.3])
    count = len(motion.events)
    flights = 2 * t0 * e ** np.arange(1, count)
    assert count == 5 and motion.outcome is mbref.Outcome.COMPLETED
    times = np.array([event.time for event in motion.events])
    assert np.abs(times - t0 - np.append(0.0, np.cumsum(flights))).max() <= close
    impulses = 2.0 * (1 + e) * e ** np.arange(count) * G * t0
    assert motion.impulses["S"][:, 2] == pytest.approx(impulses, rel=100 * close)
    shares = [event.energy_after / event.energy_before for event in motion.events]
    assert shares == pytest.approx([e**2] * count, rel=100 * close)


def ball_on_plate(restitution: float, duration: float) -> Scene:
    """The ball falls onto a plate of 3 kg that rests on a stop of its own; all joints meet in one point."""
    plate, stop = body("plate", 3.0, [0.1] * 3, ORIGIN), {"lower": -1.0, "restitution": restitution}
    joints = [slide("P", "ground", "plate", ORIGIN, Z, stop={"lower": 0.0})]
    joints += [slide("S", "plate", "ball", Z, Z, stop=stop)]
    return ball(restitution, duration).with_(body=[plate, body("ball", 2.0, [0.1] * 3, Z)], joint=joints)


def test_each_event_of_a_run_of_a_loose_tolerance_is_at_a_stop():
    """The door falls by 2 rad and rebounds; errors of 1e-6 move its first end, not the number of events."""
    motion = mbref.simulate(door(), "lm1+baumgarte", rtol=1e-6)
    assert [event.stops for event in motion.events] == [("A.lower",)]


def test_method_that_fails_at_once_on_redundant_rows_ends_a_scene_with_a_stop_by_its_outcome():
    twice = [*door().joint, hinge("B", "ground", "rod", ORIGIN, Z)]
    motion = mbref.simulate(door().with_(joint=twice), "lm1")
    assert motion.outcome is mbref.Outcome.SINGULAR_MATRIX and not motion.times.size


@pytest.mark.parametrize(("scene", "below"), [(ball, 0.0), (ball_on_plate, 3.0)], ids=["ground", "plate"])
def test_bounces_without_end_become_a_contact_that_carries_the_weight(scene, below):
    """With e = 0.2 bounces end at t₀ (1 + e) / (1 - e) = 1.5 t₀. A run of 1 s leaves out flights shorter than
    1e-6 s, so that its last event is early by a few of them. Then the lowest joint carries the weight of 2 kg
    and of the mass ``below`` the ball (kg)."""
    motion = mbref.simulate(scene(0.2, 1.0), "taylor", times=[0.0, 0.9, 1.0])
    last = motion.events[-1]
    assert last.stops == last.chatter == ("S.lower",) and "bounces end" in last.sentence
    assert abs(last.time - 1.5 * np.sqrt(2 / G)) <= 1e-5  # s
    assert np.abs(motion.joint("S").displacement[1:] + 1.0).max() <= SOLVED
    lowest = motion.joint(motion.mechanism.joint[0].name)
    assert np.abs(lowest.force[1:, 2] - (2.0 + below) * G).max() <= 10 * SOLVED
    assert "S.lower" in last.contacts


def meetings(e: float, end: float) -> Iterator[float]:
    """Yield the times (s) at which a ball that starts at rest at 0.3 m meets a table at b = 0.02 sin 30 t m.

    Its flights are parabolas, whose roots with b are found by bisection, and it leaves with b' + e (b' - v).
    """
    place, speed, begin = 0.3, 0.0, 0.0

    def gap(t):
        return place + speed * (t - begin) - G / 2 * (t - begin) ** 2 - 0.02 * np.sin(30 * t)

    while (gap(times := np.linspace(begin + 1e-6, end, 4001)) < 0.0).any():
        k = int(np.argmax(gap(times) < 0.0))
        time = brentq(gap, times[k - 1], times[k], xtol=1e-15)
        rate, before = 0.6 * np.cos(30 * time), speed - G * (time - begin)
        place, speed, begin = 0.02 * np.sin(30 * time), rate + e * (rate - before), time
        yield time


def table(height: float, restitution: float) -> Scene:
    """Return a table of 1 kg at 0.02 sin 30 t m, and a ball of 2 kg that starts at rest at a height above."""
    place, stop = (0.0, 0.0, height), {"lower": -height, "restitution": restitution}
    bodies = [body("table", 1.0, [0.1] * 3, ORIGIN), body("ball", 2.0, [0.1] * 3, place)]
    joints = [slide("T", "ground", "table", ORIGIN, Z), slide("S", "table", "ball", place, Z, stop=stop)]
    wave = {"joint": "T", "polynomial": [0.0], "sine": {"amplitude": 0.02, "frequency": 30.0}}
    return Scene(name="table", gravity=(0.0, 0.0, -G), body=bodies, joint=joints, driver=[wave])


def test_ball_meets_a_vibrating_table_at_the_roots_of_its_flights():
    """``meetings`` computes the truth. At a meeting all bodies and joints are in one point."""
    motion, exact = mbref.simulate(table(0.3, 0.7), "taylor", times=[0.0, 0.8]), [*meetings(0.7, 0.8)]
    assert len(exact) == 2 and [event.stops for event in motion.events] == [("S.lower",)] * 2
    assert np.abs(np.array([event.time for event in motion.events]) - exact).max() <= ROUNDED


def test_driver_of_a_table_carries_a_ball_until_the_table_falls_faster():
    """The ball leaves where 18 sin 30 t = 10 m/s²; the driver then accelerates 1 kg in place of 3 kg."""
    times = np.linspace(0.0, 0.03, 7)
    motion = mbref.simulate(table(0.0, 0.0), "taylor", times=times)
    mass = np.where(times < np.arcsin(G / 18) / 30, 3.0, 1.0)
    assert np.abs(motion.columns()["driver(T).force"] - mass * (G - 18 * np.sin(30 * times))).max() <= SOLVED


@pytest.mark.parametrize("restitution", [0.0, 0.6])
def test_falling_rod_rebounds_by_its_restitution(restitution):
    """From level, a rod of m = 2 kg with its centre at l = 0.5 m falls onto a stop at -2 rad. There I ω² / 2
    = m g l sin 2 with I = 0.2 kg m² + m l², and e ω after it. The judge finds the impulse in balance."""
    motion = mbref.simulate(door(restitution), "taylor", times=[0.0, 0.9])
    event, speed = motion.events[0], np.sqrt(2 * 2.0 * G * 0.5 * np.sin(2.0) / 0.7)
    assert abs(event.angles["A"] + 2.0) <= ROUNDED
    assert abs(event.angular_velocity_after[0, 2] - restitution * speed) <= SOLVED
    assert measure(door(restitution), motion, None)["impact_error"] <= ROUNDED


def test_contact_ends_when_its_force_would_pull():
    """A force of 1 - t N pushes 2 kg against a stop up to 1 s, and the reaction is its opposite. From then on
    x'' = (1 - t) / 2, so that x = -(t - 1)³ / 12 m."""
    times = np.linspace(0.0, 2.0, 9)
    motion = mbref.simulate(pushed(), "taylor", times=times)
    changes = [(event.contacts, event.released) for event in motion.events]
    assert changes == [(("S.upper",), ()), ((), ("S.upper",))]
    assert abs(motion.events[1].time - 1.0) <= ROUNDED
    free = np.maximum(times - 1.0, 0.0)
    assert np.abs(motion.position[:, 0, 0] + free**3 / 12).max() <= ROUNDED
    assert np.abs(motion.joint("S").force[:, 0] + np.maximum(1.0 - times, 0.0)).max() <= SOLVED


MASSES, SPEEDS = np.array([2.0, 1.0]), np.array([3.0, -1.0])  # kg, m/s


def balls(restitution: float) -> Scene:
    """Return masses that close a gap of 0.4 m at 4 m/s."""
    bodies = [
        body(n, m, [0.1] * 3, (k, 0.0, 0.0), velocity=[v, 0.0, 0.0])
        for k, (n, m, v) in enumerate(zip("ab", MASSES.tolist(), SPEEDS.tolist(), strict=True))
    ]
    stop = {"lower": "-400 mm", "restitution": restitution}
    joints = [slide("A", "ground", "a", ORIGIN, X), slide("B", "a", "b", (1.0, 0.0, 0.0), X, stop=stop)]
    return Scene(name="balls", duration=0.2, body=bodies, joint=joints)


BY_LIMITS = 2e-2  # m/s, kg m/s; 5e-3 of the speed, by which RK4 misses the restitution of MuJoCo's limits


@pytest.mark.parametrize(
    ("name", "restitution", "close"),
    [
        *(("mbref", e, 100 * ROUNDED) for e in (0.0, 0.3, 1.0)),
        *(("mujoco", e, BY_LIMITS) for e in (0.05, 0.6, 1.0)),
    ],
)
def test_two_masses_on_a_line_keep_their_momentum_and_part_by_the_restitution(name, restitution, close):
    """2 kg at 3 m/s and 1 kg at -1 m/s meet after 0.1 s: Σ m v stays; they part with e · 4 m/s."""
    setting = Setting("taylor", {"rtol": 1e-9}) if name == "mbref" else Setting("tuned", {"step": 5e-4})
    (event,) = engine(name).run(balls(restitution), np.array([0.0, 0.2]), setting).events
    after = event.velocity_after[:, 0]
    assert abs(event.time - 0.1) <= close and abs(MASSES @ (after - SPEEDS)) <= close
    assert abs(after[1] - after[0] - restitution * (SPEEDS[0] - SPEEDS[1])) <= close


def vibration(share: float) -> Scene:
    """A mass of 1 kg on a spring at sin(4 t) / 4 m, with a stop at (1 - share) / 4 m."""
    stop = {"upper": (1 - share) / 4, "restitution": 0.5}
    return Scene(
        name="vibration",
        body=[body("a", 1.0, [0.1] * 3, ORIGIN, velocity=list(X))],
        joint=[slide("S", "ground", "a", ORIGIN, X, stop=stop)],
        load=[{"type": "slide_spring", "joint": "S", "stiffness": 16.0}],
    )


@pytest.mark.parametrize("share", [1e-2, 1e-4, 1e-8])
def test_stop_just_below_the_reach_of_a_vibration_is_met(share):
    """The mass meets the stop at asin(1 - share) / 4 s with the rate cos 4 t, of which e = 0.5 leaves half. A
    rounded place changes the time by up to ROUNDED / rate, and the rate by this times 4 m/s², margin four."""
    time, rate = np.arcsin(1 - share) / 4, np.sqrt(share * (2 - share))
    (event,) = mbref.simulate(vibration(share), "taylor", times=[0.0, 0.5], rtol=1e-13).events
    assert event.stops == ("S.upper",) and abs(event.time - time) <= ROUNDED / rate
    assert abs(event.velocity_after[0, 0] + rate / 2) <= 16 * ROUNDED / rate


@pytest.mark.parametrize(
    ("scene", "formulation"),
    [
        pytest.param(pushed(), natural_motion, id="contact that ends, natural coordinates"),
        pytest.param(vibration(1e-4), natural_motion, id="stop below a reach, natural coordinates"),
        pytest.param(balls(0.3), tree_motion, id="masses that part, tree of joints"),
        pytest.param(ball(1e-3, 0.6), natural_motion, id="ball that comes to rest, natural coordinates"),
        pytest.param(door(), tree_motion, id="rod that rebounds, tree of joints", marks=pytest.mark.slow),
    ],
)
def test_judge_finds_the_events_by_itself(scene, formulation):
    """The judge locates gaps and forces in its own motion, without mbref's events. Positions agree to
    rounding, and velocities, which the impact changes, to ten times that."""
    times = np.linspace(0.0, scene.duration, 4)
    motion = mbref.simulate(scene, "taylor", times=times, rtol=1e-13)
    found = motion_by(formulation, scene, times, EXTENDED, seconds=60.0)
    assert not found.reason and np.abs(doubles(found.position) - motion.position).max() <= ROUNDED
    assert np.abs(doubles(found.velocity) - motion.velocity).max() <= 10 * ROUNDED


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
    """A stop has the start, 0 m, in its range, an end and at most the restitution 1; ends are lengths."""
    with pytest.raises(SceneError, match=says):
        ball(0.5, 1.0).with_(joint=[slide("S", "ground", "ball", ORIGIN, Z, stop=stop)])


def test_stop_is_refused_at_a_driven_joint_in_a_diagnosis_and_by_an_engine_without_stops():
    """The door has a stop at its hinge A. A driver would push through it, a diagnosis is of one pose, the
    adapter of Exudyn maps no stops, and MuJoCo's limits rebound."""
    with pytest.raises(SceneError, match="needs a joint without a driver"):
        door().with_(driver=[{"joint": "A", "polynomial": [0.0, 1.0]}])
    says = r"joint\[A\]\.stop: only motions have intervals, conditions and stops"
    with pytest.raises(SceneError, match=says):
        mbref.diagnose(door())
    assert "joint 'A' has an end stop" in str(engine("exudyn").supports.missing(door()))
    assert "joint 'A' has an end stop with a restitution below" in str(engine("mujoco").cannot(door(0.0)))


def test_stop_through_which_a_driver_leads_a_latched_cart_is_refused_at_its_time():
    """Cart B moves at -1 m/s up to 0.1 s, then with the driven cart A at 2 m/s: at its end, 0.1 m, at 0.2 s.
    The judge's motion ends there, too."""
    free = carts(active=[[0.1, 1.0]]).with_(driver=[{"joint": "A", "polynomial": [0.0, 2.0]}])
    one, two, latch = free.joint
    stopped = free.with_(joint=[one, {**two.model_dump(), "stop": {"upper": 0.1}}, latch])
    with pytest.raises(SceneError, match=r"end stops B\.upper: cannot be met at t = 0\.2 s"):
        mbref.simulate(stopped)
    assert "contradict" in motion_by(natural_motion, stopped, [0.0, 0.3], EXTENDED).reason


def held_by_its_weight(duration: float, force: dict[str, Any]) -> Scene:
    """A mass of 1 kg on its stop, with a weight of 1 N and a force along the slide."""
    joint = slide("S", "ground", "a", ORIGIN, Z, stop={"lower": 0.0})
    load, mass = {"type": "joint_force", "joint": "S", **force}, body("a", 1.0, [0.1] * 3, ORIGIN)
    scene = Scene(name="held", duration=duration, body=[mass], joint=[joint], load=[load])
    return scene.with_(gravity=(0.0, 0.0, -1.0))


def test_short_pull_lifts_a_mass_off_its_stop():
    """50 N pull 1 kg of weight 1 N from 0.41 s to 0.42 s, an eightieth of the run: 49 · 0.01 m/s at 0.42 s,
    from which the weight takes 0.38 m/s up to 0.8 s."""
    scene = held_by_its_weight(0.8, {"force": 50.0, "factor": {"start": 0.41, "stop": 0.42}})
    motion = mbref.simulate(scene, "taylor", times=[0.0, 0.8])
    assert abs(motion.events[-1].time - 0.41) <= SOLVED
    assert abs(motion.velocity[-1, 0, 2] - (0.49 - 0.38)) <= SOLVED


@pytest.mark.parametrize("duration", [0.02, 0.2])
def test_first_pull_of_a_fast_force_ends_the_contact_in_runs_of_any_length(duration):
    """5 sin(80 π t) N exceeds the weight, 1 N, first at asin(1/5) / 80 π; at 0 s the contact begins."""
    sine = {"polynomial": [0.0], "sine": {"amplitude": 1.0, "frequency": 80 * np.pi}}
    push = {"force": 5.0, "factor": sine}
    motion = mbref.simulate(held_by_its_weight(duration, push), times=[0.0, duration])
    assert abs(motion.events[1].time - np.arcsin(0.2) / (80 * np.pi)) <= ROUNDED


def test_rod_that_starts_at_the_end_of_its_range_leaves_it_without_an_event():
    """The rod starts at its upper end and falls from there to -1 rad with I ω² / 2 = m g l sin 1, where I =
    0.7 kg m², m = 2 kg and l = 0.5 m. With e = 0.5 it rebounds with ω / 2."""
    stop = {"lower": -1.0, "upper": 0.0, "restitution": 0.5}
    joint = hinge("A", "ground", "rod", ORIGIN, Z, stop=stop)
    (event,) = mbref.simulate(door().with_(joint=[joint]), "taylor", times=[0.0, 0.5]).events
    speed = np.sqrt(2 * 2.0 * G * 0.5 * np.sin(1.0) / 0.7)
    assert event.stops == ("A.lower",) and abs(event.angular_velocity_after[0, 2] - speed / 2) <= SOLVED


def test_stop_that_is_met_with_another_one_does_not_pull():
    """Two rods of 1 m, 1 kg and 0.1 kg m² in a line turn at 1 and 0.9 rad/s; both hinges meet ends without
    restitution. A stops, and b leaves its end, with its momentum about B: 0.35 ω = 0.1 · 0.9 + 0.5 · 1.45."""
    spins, speeds = ((0.0, 0.0, 1.0), (0.0, 0.0, 0.9)), ((0.0, 0.5, 0.0), (0.0, 1.45, 0.0))
    bodies = [
        body(name, 1.0, [0.1] * 3, (k + 0.5, 0.0, 0.0), velocity=speeds[k], angular_velocity=spins[k])
        for k, name in enumerate("ab")
    ]
    hinges = [hinge("A", "ground", "a", ORIGIN, Z, stop={"upper": 0.0})]
    hinges += [hinge("B", "a", "b", X, Z, stop={"lower": 0.0})]
    scene = Scene(name="rods", duration=0.1, body=bodies, joint=hinges)
    motion = mbref.simulate(scene, "taylor", times=[0.0])
    (event,) = motion.events
    assert event.stops == ("A.upper", "B.lower") and event.contacts == ("A.upper",)
    assert np.abs(event.angular_velocity_after[:, 2] - [0.0, 0.815 / 0.35]).max() <= SOLVED
    assert measure(scene, motion, None)["impact_error"] <= ROUNDED


@pytest.mark.parametrize("restitutions", [(0.5, 0.2), (0.2, 0.5)])
def test_geared_stops_that_are_met_at_once_rebound_by_the_larger_restitution(restitutions):
    """Rotors at 2 and -4 rad/s, geared by -2, meet ends at 1 and -2 rad. Each rate after it is at least -e
    times its own before, so that both turn back with 0.5 of their rates, by mbref and by the judge."""
    rates, limits = (2.0, -4.0), ({"upper": 1.0}, {"lower": -2.0})
    at = {name: (float(k), 0.0, 0.0) for k, name in enumerate("ab")}
    spins = dict(zip("ab", ((0.0, 0.0, rate) for rate in rates), strict=True))
    bodies = [body(n, 1.0, [0.1] * 3, at[n], angular_velocity=spins[n]) for n in "ab"]
    stops = [{**end, "restitution": e} for end, e in zip(limits, restitutions, strict=True)]
    hinges = [hinge(n.upper(), "ground", n, at[n], Z, stop=s) for n, s in zip("ab", stops, strict=True)]
    gears = {"name": "gears", "joints": ["A", "B"], "ratio": -2.0}
    scene = Scene(name="gears", duration=0.6, body=bodies, joint=hinges, coupling=[gears])
    motion = mbref.simulate(scene, "taylor", times=[0.0, 0.6])
    assert motion.events[0].stops == ("A.upper", "B.lower")
    for found in (motion, motion_by(natural_motion, scene, [0.0, 0.6], EXTENDED)):
        assert np.abs(doubles(found.angular_velocity)[-1, :, 2] + 0.5 * np.array(rates)).max() <= SOLVED
