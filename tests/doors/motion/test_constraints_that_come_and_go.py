"""Joints and couplings with intervals: closed forms of impacts, methods, outputs, restarts, refusals."""

import json

import numpy as np
import pytest

import mbref
from crosscheck.judge.arithmetic import EXTENDED, doubles
from crosscheck.judge.reference.piecewise import motion_by
from crosscheck.judge.reference.taylor import natural_motion
from mbref import Motion, Scene, SceneError
from mbref.cli import main
from tests.helpers.intermittent_mechanisms import carts, intermittent_mechanism
from tests.helpers.parts import hinge, joint, rod

ROUNDING = 1e-12  # m, m/s, rad/s, N s and J of mechanisms of about 1 m, 1 kg and 10 rad/s
OTHERS = ("mpi-svd+partitioning", "mpi-gs+none", "lm1+baumgarte", "lm2+none/rk4[step=1e-3]")
METHODS = ("alf-dual+projection", *(pytest.param(name, marks=pytest.mark.slow) for name in OTHERS))


def pendulum(until: float, **changes) -> Scene:
    """A rod of 1 m on a pivot at the origin, which lets go at a time (s)."""
    pivot = hinge("A", "ground", "rod", (0.0, 0.0, 0.0), active=[[0.0, until]])
    body = rod("rod", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 2.0)
    parts = {"name": "pendulum", "gravity": (0.0, -9.81, 0.0), "body": [body], "joint": [pivot]}
    return Scene(**{**parts, **changes})


def test_carts_that_latch_move_on_with_the_mean_velocity_and_keep_it():
    """Carts of 1 kg at 2 m/s and 3 kg at -1 m/s: v = (m₁ v₁ + m₂ v₂) / (m₁ + m₂) = -0.25 m/s, the impulse
    m₁ (v₁ - v) = 2.25 N s and the loss ½ m₁ m₂ / (m₁ + m₂) (v₁ - v₂)² = 27/8 J. Letting go costs nothing.
    Events and columns state when the latch holds; the column of impulses adds them up."""
    motion = mbref.simulate(carts(), times=[0.0, 0.05, 0.1, 0.3, 0.5])
    assert np.allclose(motion.velocity[:, :, 0], [[2, -1]] * 2 + [[-0.25, -0.25]] * 3, rtol=0, atol=ROUNDING)
    assert np.allclose(motion.position[-1, :, 0], [0.1, 0.8], rtol=0, atol=ROUNDING)
    assert np.allclose(motion.impulses["L"], [[2.25, 0, 0, 0, 0, 0], [0] * 6], rtol=0, atol=ROUNDING)
    latched, released = motion.events
    assert latched.energy_before - latched.energy_after == pytest.approx(27 / 8, rel=ROUNDING)
    assert released.energy_before == released.energy_after
    assert [(event.engaged, event.released) for event in motion.events] == [(("L",), ()), ((), ("L",))]
    assert motion.joint("L").active.tolist() == [0, 0, 1, 0, 0]
    assert motion.columns("L.impulse.x")["L.impulse.x"].tolist() == pytest.approx([0, 0, 2.25, 2.25, 2.25])


def test_evenly_spaced_sample_that_rounding_puts_before_an_event_has_the_state_after_it():
    """The second of four samples up to 0.3 s is one unit of rounding before 0.1 s, where the carts latch."""
    motion = mbref.simulate(carts(), times=np.linspace(0.0, 0.3, 4))
    assert motion.velocity[1, :, 0].tolist() == pytest.approx([-0.25, -0.25], abs=ROUNDING)
    assert motion.joint("L").active.tolist() == [0, 1, 1, 0]


def test_pendulum_that_a_second_pivot_catches_keeps_its_angular_momentum_about_this_pivot():
    """I ω + m r × v about the pivot, which is 0.3 m from the rod's centre, with I = m (1 m)² / 12 and m = 2
    kg. Its centre then turns about this pivot. The samples are after the event: their energy is constant."""
    second = joint("Q", "spherical", "rod", "ground", (0.8, 0.0, 0.0), active=[[0.3, 2.0]])
    pivots = [*pendulum(0.3).joint, second]
    motion = mbref.simulate(pendulum(0.3, joint=pivots), times=[0.3, 1.0])
    (event,) = motion.events
    arm = (0.5 - 0.8) / 0.5 * event.position[0]  # m; to the centre, at 0.5 m, from the new pivot, at 0.8 m
    velocity, spin = event.velocity_after[0], event.angular_velocity_after[0]
    before = 2.0 / 12 * event.angular_velocity[0, 2] + 2.0 * np.cross(arm, event.velocity[0])[2]
    assert 2.0 / 12 * spin[2] + 2.0 * np.cross(arm, velocity)[2] == pytest.approx(before, abs=ROUNDING)
    assert np.allclose(velocity, np.cross(spin, arm), rtol=0, atol=ROUNDING)
    assert np.ptp(motion.energy) <= 20 * ROUNDING  # J, of about 20 J


@pytest.fixture(scope="module")
def truss() -> Motion:
    """Two rods of 1 kg on hinges A, D and C of the ground and a common hinge B: they fall while C is open."""
    rods = [rod("a", (0.0, 0.0, 0.0), (1.0, 1.0, 0.0)), rod("b", (1.0, 1.0, 0.0), (2.5, 0.0, 0.0))]
    ends = [("A", "ground", "a", (0, 0, 0)), ("D", "ground", "a", (0, 0, 1)), ("B", "a", "b", (1, 1, 0))]
    held = hinge("C", "ground", "b", (2.5, 0.0, 0.0), active=[[0.0, 0.1], [0.25, 9.0]])
    joints = [*(hinge(*end) for end in ends), held]
    scene = Scene(name="truss", gravity=(0.0, -9.81, 0.0), body=rods, joint=joints)
    return mbref.simulate(scene, times=[0.0, 0.1, 0.2, 0.25, 0.6])


def test_hinges_of_a_locked_truss_carry_its_weight(truss):
    """A, D and C carry 2 kg · 9.81 m/s² at rest. While C is open, at 0.2 s, it carries nothing. Parallel
    hinges have redundant rows, so that impulses are not determined (open); none acts where C lets go."""
    opened, locked = truss.events
    assert all(locked.open.values()) and not truss.joint("C").force[2].any()
    assert "impulses open" in locked.sentence and "impulses" not in opened.sentence
    weight = np.array([0.0, 2.0 * 9.81, 0.0])
    assert np.allclose(sum(truss.joint(name).force for name in "ADC")[-1], weight, rtol=0, atol=1e-9)  # N


@pytest.fixture(scope="module")
def random_motion() -> Motion:
    """A random mechanism with a coupling that comes and goes, an armature and loads."""
    return mbref.simulate(intermittent_mechanism(7), times=np.linspace(0.0, 0.3, 7))


@pytest.mark.parametrize("method", METHODS)
def test_method_of_each_stabilisation_moves_through_events_as_the_judges_reference(random_motion, method):
    """METHODS have one method for each stabilisation, and one of fixed steps. Positions (m) agree with a
    reference by the judge's own equations and events to a tenth of the default tolerance, 1e-9."""
    scene, times = random_motion.mechanism, random_motion.times
    found = mbref.simulate(scene, method, times=times)
    assert found.outcome.name == "COMPLETED", found.message
    exact = motion_by(natural_motion, scene, times, EXTENDED)
    assert np.abs(found.position - doubles(exact.position)).max() < 1e-10


@pytest.mark.parametrize("t", [0.1, 0.2])
def test_scene_at_a_sample_continues_the_motion_through_its_later_events(random_motion, t):
    """A run from the sample on has the same end, to both tolerances (m). At 0.2 s some constraints change."""
    rest = mbref.simulate(random_motion.scene_at(t), times=[0.0, 0.3 - t])
    assert np.abs(rest.position[-1] - random_motion.position[-1]).max() < 1e-9


def test_scene_at_an_event_starts_with_the_state_after_it():
    """Carts that latch at 0.1 s are latched from the start on: only their release is left."""
    latched = mbref.simulate(carts(), times=[0.0, 0.1]).scene_at(0.1)
    assert [event.released for event in mbref.simulate(latched).events] == [("L",)]


def test_saved_motion_with_events_has_its_mechanism_and_columns(random_motion, tmp_path):
    """Columns are computed anew from the states in the file. They equal those of the motion that was saved to
    1e-9, in SI units: accelerations and reactions magnify the rounding of states."""
    random_motion.save(tmp_path / "motion.json")
    loaded = Motion.load(tmp_path / "motion.json")
    columns, others = random_motion.columns(), loaded.columns()
    assert loaded.mechanism == random_motion.mechanism and list(columns) == list(others)
    assert all(np.allclose(columns[name], others[name], rtol=0, atol=1e-9) for name in columns)


def rod_and_lock(begin: float) -> Scene:
    """A rod that turns at 5 rad/s, and a weld that holds it in its first pose from a time (s) on."""
    turning = {**rod("rod", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 2.0), "angular_velocity": [0.0, 0.0, 5.0]}
    pivot = hinge("A", "ground", "rod", (0.0, 0.0, 0.0))
    lock = joint("L", "fixed", "ground", "rod", active=[[begin, 3.0]], engages="given_pose")
    return Scene(name="lock", duration=2.0, body=[turning], joint=[pivot, lock])


def test_weld_that_engages_at_its_given_pose_stops_a_rod_that_is_back_there():
    """The rod is back after 2π / 5 s and loses its energy ½ m l² / 3 · ω² = 25/3 J."""
    (event,) = mbref.simulate(rod_and_lock(2 * np.pi / 5)).events
    assert event.energy_after <= ROUNDING and event.energy_before == pytest.approx(25 / 3, rel=ROUNDING)


def test_weld_that_cannot_engage_at_its_given_pose_is_refused_with_the_gap(tmp_path, capsys):
    """After 1 s the rod has turned by 5 rad: its axis is off by |sin 5| = 0.959 across the given one."""
    rod_and_lock(1.0).save(tmp_path / "lock.toml")
    assert main(["run", str(tmp_path / "lock.toml")]) == 2
    said = "L: cannot begin to hold at t = 1 s: the given pose is missed by 0.959"
    assert said in capsys.readouterr().err


def test_command_prints_events_and_records_them(tmp_path, capsys):
    """The carts have ½ (1 · 2² + 3 · 1²) = 3.5 J until they latch at 0.1 s; they let go at 0.3 s."""
    carts().save(tmp_path / "carts.toml")
    assert main(["run", str(tmp_path / "carts.toml")]) == 0
    assert "event at t = 0.1 s: L begins to hold; kinetic energy 3.5 J" in capsys.readouterr().out
    assert main(["run", str(tmp_path / "carts.toml"), "--json"]) == 0
    (record,) = json.loads(capsys.readouterr().out)["records"]
    assert [event["time"] for event in record["events"]] == [0.1, 0.3]


TURNED = [{"joint": "A", "polynomial": [0.0, 1.0]}]  # a driver of the pivot


def test_driver_of_a_joint_with_intervals_is_refused_by_name():
    """The pivot A lets go after 1 s, from when on its driver would have no joint to turn."""
    says = r"driver\[A\].joint: needs a joint that always holds; 'A' has intervals"
    with pytest.raises(SceneError, match=says):
        pendulum(1.0, driver=TURNED)


SENSITIVITIES = ("sensitivities", "--of", "one.position.x", "--to", "body[one].mass")


@pytest.mark.parametrize("command", [("diagnose",), ("equilibrium",), ("modes",), SENSITIVITIES])
def test_command_of_one_pose_or_derivatives_refuses_a_scene_by_the_joint_with_intervals(
    command, tmp_path, capsys
):
    """A pose has no time at which the latch L of the carts could hold or not."""
    carts().save(tmp_path / "carts.toml")
    assert main([*command, str(tmp_path / "carts.toml")]) == 2
    assert "joint[L].active: " in capsys.readouterr().err


def test_weld_that_would_begin_to_hold_a_driven_rod_is_refused_by_name():
    """From 0.1 s on the weld holds the rod, which the driver turns on."""
    pivot = hinge("A", "ground", "rod", (0, 0, 0))
    weld = joint("L", "fixed", "ground", "rod", active=[[0.1, 2.0]])
    driven = pendulum(0.1, joint=[pivot, weld], driver=TURNED)
    says = r"L: cannot begin to hold at t = 0\.1 s: the drivers contradict"
    with pytest.raises(SceneError, match=says):
        mbref.simulate(driven)
