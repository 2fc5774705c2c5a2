"""Motions with a planted fault: the judge measures the size of the fault and names the quantity."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from crosscheck import measure, truth_for
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.energy import energy_series, kinetic_energy
from crosscheck.judge.metrics import METRICS
from crosscheck.judge.model_identity import acceleration_scale, along, gate, gate_times
from crosscheck.judge.momentum import momentum_series
from crosscheck.judge.precision import grain, single_precision
from crosscheck.judge.reaction_balance import absurd, balance, with_exact_reactions
from crosscheck.judge.truth import Truth
from mbref import rotations
from mbref.scene import Body, Scene
from mbref.trajectory import Trajectory
from tests.helpers.changed_scenes import in_another_frame, in_another_order, in_other_units
from tests.helpers.parts import SKEW, Z, block, hinge, turning_about
from tests.helpers.short_motions import GRAVITY, MOTIONS, made

SHIFT = np.array([0.003, -0.004, 0.012])  # m, 13 mm long
AXIS = np.array([2.0, -3.0, 6.0]) / 7.0
SAMPLES = 9


def double_hinge() -> Scene:
    """Return two blocks on skew hinges under gravity; the first one begins to turn."""
    first = turning_about((0.0, 0.0, 0.0), SKEW, 3.0, block("a", (0.4, 0.1, -0.1)))
    second = turning_about((0.0, 0.0, 0.0), SKEW, 3.0, block("b", (0.9, 0.3, 0.2), 0.7))
    joints = [
        hinge("A", "ground", "a", (0.0, 0.0, 0.0), SKEW),
        hinge("B", "a", "b", (0.6, 0.2, 0.1), (0.6, 0.0, 0.8)),
    ]
    return made("double hinge", [first, second], joints)


def flying() -> Scene:
    """Return two bodies without joints and gravity; one turns about a principal axis."""
    bodies = [
        block("a", (0.0, 0.0, 0.0), velocity=[1.0, -2.0, 2.0], orientation=[1.0, 0.0, 0.0, 0.0]),
        block("b", (0.7, 0.1, 0.2), angular_velocity=[0.0, 0.0, 5.0], orientation=[1.0, 0.0, 0.0, 0.0]),
    ]
    return made("flying", bodies, [], gravity=[0.0, 0.0, 0.0])


@functools.cache
def exact_of(make) -> tuple[Scene, Truth, Trajectory]:
    """Return a scene, its truth and the true motion at nine times."""
    scene = make()
    truth = truth_for(scene)
    assert truth is not None
    return scene, truth, truth.poses(np.linspace(0.0, scene.duration, SAMPLES))


def measured(make, **arrays: np.ndarray) -> Mapping[str, float | None]:
    """Return the metrics of the true motion with some arrays replaced."""
    scene, truth, exact = exact_of(make)
    return measure(scene, replace(exact, **arrays), truth)


def changed(array: np.ndarray, sample: int, body: int, by: np.ndarray) -> np.ndarray:
    """Return an array (k, nb, n) with the row of a body at a sample changed by a vector."""
    found = array.copy()
    found[sample, body] += by
    return found


MAKERS = [double_hinge, flying, MOTIONS["gears with armature"], MOTIONS["planar_slider_crank_gravity"]]


@pytest.mark.parametrize("make", MAKERS)
def test_true_motions_have_no_error(make):
    found = measured(make)
    for name in ("error", "velocity_error", "violation_position", "violation_velocity"):
        assert found[name] <= 1e-12, name
    assert found["scd"] > 12 and found["error_bound"] <= 1e-11
    assert found.keys() == {*METRICS, "error_bound", "error_until"}


# --- poses ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("make", MAKERS)
@pytest.mark.parametrize("sample", [0, 5, SAMPLES - 1])
def test_a_shift_is_measured_in_lengths_of_the_mechanism(make, sample):
    scene, _, exact = exact_of(make)
    found = measured(make, position=changed(exact.position, sample, -1, SHIFT))
    assert found["position_error"] == pytest.approx(0.013 / scene_length(scene), rel=1e-9)
    assert found["error"] == found["position_error"] and found["rotation_error"] < 1e-12
    assert found["scd"] == pytest.approx(-math.log10(0.013 / scene_length(scene)))


@pytest.mark.parametrize("make", MAKERS)
@pytest.mark.parametrize("angle", [1e-6, 0.02, 3.0])
def test_a_rotation_is_measured_by_its_angle(make, angle):
    _, _, exact = exact_of(make)
    orientation = exact.orientation.copy()
    orientation[4, 0] = rotations.multiply(rotations.from_vector(angle * AXIS), orientation[4, 0])
    found = measured(make, orientation=-orientation)
    assert found["rotation_error"] == pytest.approx(angle, abs=1e-12)
    assert found["error"] == found["rotation_error"] and found["position_error"] < 1e-12


def test_a_delay_of_uniform_motions_is_speed_times_time():
    """3 m/s and 5 rad/s, later by 7 ms."""
    scene, truth, exact = exact_of(flying)
    late = 0.007
    delayed = replace(
        exact,
        position=exact.position - late * exact.velocity,
        orientation=rotations.multiply(
            rotations.from_vector(-late * exact.angular_velocity), exact.orientation
        ),
    )
    found = measure(scene, delayed, truth)
    assert found["position_error"] == pytest.approx(3.0 * late / scene_length(scene), rel=1e-9)
    assert found["rotation_error"] == pytest.approx(5.0 * late, rel=1e-9)


@pytest.mark.parametrize("late", [1e-5, 1e-4])
def test_a_delay_of_a_mechanism_is_its_largest_speed_times_time(late):
    """Accelerations change the speeds by a share of the delay over the duration."""
    scene, truth, exact = exact_of(double_hinge)
    times = exact.times[1:]
    delayed = replace(truth.poses(times - late), times=times)
    found = measure(scene, delayed, truth)
    speed = np.linalg.norm(exact.velocity[1:], axis=2).max()
    spin = np.linalg.norm(exact.angular_velocity[1:], axis=2).max()
    assert found["position_error"] == pytest.approx(late * speed / scene_length(scene), rel=100 * late)
    assert found["rotation_error"] == pytest.approx(late * spin, rel=100 * late)
    assert found["violation_position"] < 1e-13 and found["violation_velocity"] < 1e-12


def test_errors_grow_with_a_fault_that_begins_late_until_the_run_ends():
    scene, truth, exact = exact_of(double_hinge)
    off = exact.position + SHIFT * np.maximum(np.arange(SAMPLES) - 3, 0)[:, None, None]
    whole = measure(scene, replace(exact, position=off), truth)
    assert whole["position_error"] == pytest.approx((SAMPLES - 4) * 0.013 / scene_length(scene), rel=1e-9)
    assert whole["error_until"] == exact.times[-1]


# --- velocities, joints and energies ----------------------------------------------------------------------
@pytest.mark.parametrize("share", [1e-6, 0.03])
def test_velocities_too_fast_by_a_share(share):
    """Joints at rest on the ground forbid nothing more; kinetic energies grow with the square."""
    scene, _, exact = exact_of(double_hinge)
    faster = {name: (1 + share) * getattr(exact, name) for name in ("velocity", "angular_velocity")}
    found = measured(double_hinge, **faster)
    assert found["velocity_error"] == pytest.approx(share, rel=1e-9)
    assert found["violation_velocity"] < 1e-12
    kinetic = kinetic_energy(scene, exact.position, exact.orientation, exact.velocity, exact.angular_velocity)
    drift = energy_series(scene, replace(exact, **faster))
    assert drift.argmax() == kinetic.argmax()
    pair = np.argsort(kinetic)[-2:]
    assert drift[pair[1]] / drift[pair[0]] == pytest.approx(kinetic[pair[1]] / kinetic[pair[0]], rel=1e-4)


@pytest.mark.parametrize(("joint", "body"), [("A", 0), ("B", 1)])
def test_a_joint_opens_by_the_gap_that_is_put_in(joint, body):
    """A hinge forbids every displacement of its point, and every velocity of it."""
    scene, _, exact = exact_of(double_hinge)
    length = scene_length(scene)
    found = measured(double_hinge, position=changed(exact.position, 3, 1, SHIFT))
    largest = np.abs(SHIFT).max() / length
    assert largest / math.sqrt(3) <= found["violation_position"] <= 0.013 / length * (1 + 1e-12)
    found = measured(double_hinge, velocity=changed(exact.velocity, 3, 1, 10 * SHIFT))
    assert 0.13 / math.sqrt(3) <= found["violation_velocity"] * length <= 0.13 * (1 + 1e-9)
    found = measured(double_hinge, acceleration=changed(exact.acceleration, 3, 1, 100 * SHIFT))
    assert 1.3 / math.sqrt(3) <= found["violation_acceleration"] * length <= 1.3 * (1 + 1e-9)


def test_gears_that_slip_are_off_by_the_angle():
    """The wheel turned about its hinge by 0.02 rad: joints stay closed, and the mesh is off by 0.02 rad."""
    make = MOTIONS["gears with armature"]
    _, _, exact = exact_of(make)
    orientation, turn = exact.orientation.copy(), rotations.from_vector(0.02 * np.array(Z))
    orientation[2:, 1] = rotations.multiply(turn, orientation[2:, 1])
    place = exact.position.copy()
    centre = np.array([0.5, 0.0, 0.0])
    place[2:, 1] = centre + rotations.rotate(turn, place[2:, 1] - centre)
    found = measured(make, orientation=orientation, position=place)
    assert found["violation_position"] == pytest.approx(0.02, rel=1e-9)
    assert found["rotation_error"] == pytest.approx(0.02, rel=1e-9)
    spin = changed(exact.angular_velocity, 4, 1, 0.3 * np.array(Z))
    velocity = changed(exact.velocity, 4, 1, np.cross(0.3 * np.array(Z), exact.position[4, 1] - centre))
    found = measured(make, angular_velocity=spin, velocity=velocity)
    assert found["violation_velocity"] == pytest.approx(0.3, rel=1e-9)


def test_height_without_speed_is_energy_that_drifts():
    """Both blocks lifted by 5 mm against gravity at one sample: m g h of the largest energy."""
    scene, _, exact = exact_of(double_hinge)
    up = -np.array(GRAVITY) / np.linalg.norm(GRAVITY)
    place = exact.position.copy()
    place[5] += 0.005 * up
    off = energy_series(scene, replace(exact, position=place))
    assert off.argmax() == 5 and np.delete(off, 5).max() < 1e-12
    states = exact.position, exact.orientation, exact.velocity, exact.angular_velocity
    weight = sum(body.mass for body in scene.body) * np.linalg.norm(GRAVITY)
    assert off[5] >= weight * 0.005 / (kinetic_energy(scene, *states).max() + weight * 1.0)
    twice = place.copy()
    twice[5] += 0.005 * up
    again = energy_series(scene, replace(exact, position=twice))
    assert again[5] == pytest.approx(2 * off[5], rel=0.05)


def test_a_push_changes_the_momentum_by_its_share():
    """1.5 kg at 3 m/s and 0.9 m/s across: 1.35 of 1.5 √(9 + 0.81) kg m/s."""
    scene, _, exact = exact_of(flying)
    assert momentum_series(scene, exact).max() < 1e-13
    across = np.array([0.0, 1.0, 1.0]) / math.sqrt(2)
    off = momentum_series(scene, replace(exact, velocity=changed(exact.velocity, 6, 0, 0.9 * across)))
    assert off.argmax() == 6 and off[6] == pytest.approx(1.35 / (1.5 * math.sqrt(9.81)), rel=1e-6)


# --- reactions --------------------------------------------------------------------------------------------
@pytest.mark.parametrize("make", [double_hinge, MOTIONS["planar_slider_crank_gravity"]])
@pytest.mark.parametrize("share", [0.01, 0.2])
def test_reactions_too_large_by_a_share(make, share):
    scene, truth, exact = exact_of(make)
    true = with_exact_reactions(scene, exact)
    larger = replace(true, reactions={name: (1 + share) * w for name, w in true.reactions.items()})
    assert measure(scene, true, truth)["reaction_error"] < 1e-12
    assert measure(scene, larger, truth)["reaction_error"] == pytest.approx(share, rel=0.5)
    assert balance(scene, true, exact) < 1e-10 < balance(scene, larger, exact) <= 2 * share


def test_reactions_of_a_singular_matrix_are_named():
    scene, _, exact = exact_of(double_hinge)
    true = with_exact_reactions(scene, exact)
    wild = replace(true, engine="other", reactions={**true.reactions, "B": 1e6 * true.reactions["B"]})
    assert absurd(scene, true, true) == []
    [sentence] = absurd(scene, wild, true)
    assert sentence.startswith("other gives") and " N in B" in sentence


# --- the gate ---------------------------------------------------------------------------------------------
@functools.cache
def short_run(make) -> Trajectory:
    scene = make()
    return truth_for(scene).poses(gate_times(scene))


START = {
    "initial position": ("position", 0, 1e-4, scene_length),
    "initial velocity": ("velocity", 0, 1e-4, None),
    "initial angular velocity": ("angular_velocity", 0, 1e-4, None),
    "change of velocity": ("velocity", 1, 1e-2, None),
    "change of angular velocity": ("angular_velocity", 1, 1e-2, None),
    "initial acceleration": ("acceleration", 0, 5.0, None),
    "initial angular acceleration": ("angular_acceleration", 0, 5.0, None),
}


@pytest.mark.parametrize("make", [double_hinge, MOTIONS["planet with armatures"]])
@pytest.mark.parametrize("field", START)
def test_the_gate_names_the_quantity_that_differs(make, field):
    """One array is changed at one of two samples; twice the fault has twice the size."""
    scene, run = make(), short_run(make)
    name, sample, size, scale = START[field]
    assert gate(scene, [run, replace(run, engine="other")]) is None
    once, twice = (
        gate(
            scene,
            [
                run,
                replace(
                    run, engine="other", **{name: changed(getattr(run, name), sample, -1, k * size * AXIS)}
                ),
            ],
        )
        for k in (1, 2)
    )
    assert once.field == twice.field == field and once.engines == ("truth", "other")
    assert twice.by == pytest.approx(2 * once.by, rel=1e-6)
    if scale is not None:
        assert once.by == pytest.approx(size / scale(scene), rel=1e-6)


@pytest.mark.parametrize("change", ["mass", "inertia"])
def test_another_mass_or_inertia_shows_in_the_first_moments(change):
    scene = double_hinge()
    body = scene.body[1]
    parts = body.model_dump()
    parts[change] = (1.1 * np.array(parts[change])).tolist()
    heavier = scene.with_(body=(scene.body[0], Body(**parts)))
    run = replace(truth_for(heavier).poses(gate_times(scene)), engine="other")
    found = gate(scene, [short_run(double_hinge), run])
    assert found is not None and found.engines == ("truth", "other")
    assert found.field in (
        "centre of mass",
        "initial energy",
        "change of velocity",
        "change of angular velocity",
    )


@pytest.mark.parametrize("sample", [0, 4, 8])
def test_accelerations_of_another_motion_are_named_with_their_time(sample):
    """Some samples are compared, the last one among them; accelerations are off from a sample on."""
    scene, _, exact = exact_of(double_hinge)
    assert along(scene, exact) is None
    off = np.where(np.arange(SAMPLES) >= sample, 50.0, 0.0)[:, None, None] * AXIS  # m/s²
    found = along(scene, replace(exact, engine="other", acceleration=exact.acceleration + off))
    assert found is not None and found.engines == ("the judge", "other")
    time = float(found.field.removeprefix("acceleration at t = ").removesuffix(" s"))
    assert exact.times[sample] * 0.99 <= time <= max(exact.times[sample + 2 : sample + 3], default=1.0)
    assert found.by > 0.1


# --- digits -----------------------------------------------------------------------------------------------
def test_single_precision_and_noise_have_their_size():
    """Seven neighbouring samples and more: a smooth motion leaves no sixth difference."""
    scene, truth, _ = exact_of(double_hinge)
    run = truth.poses(0.1 + 1e-5 * np.arange(12))
    assert grain(scene, run)[0] < 1e-13 and not single_precision(scene, run)
    rng = np.random.default_rng(3)
    for size in (1e-9, 1e-6):
        noisy = replace(run, position=run.position + size * rng.standard_normal(run.position.shape))
        found, of = grain(scene, noisy)
        assert of == "positions" and 0.3 * size < found * scene_length(scene) < 6 * size
    single = replace(run, velocity=run.velocity.astype(np.float32).astype(float))
    assert {item.partition(" of ")[0] for item in single_precision(scene, single)} == {"velocity"}


# --- scales -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", MOTIONS)
def test_accelerations_that_a_scene_can_cause_have_its_units_alone(name):
    """Differences count against them; frames and orders have no influence."""
    scene = MOTIONS[name]()
    size = acceleration_scale(scene)
    turn, shift = rotations.from_vector(0.9 * AXIS), 20 * SHIFT
    assert acceleration_scale(in_other_units(scene, 3.0, 7.0, 0.5)) == pytest.approx(28 * size)
    assert acceleration_scale(in_another_frame(scene, turn, shift)) == pytest.approx(size)
    assert acceleration_scale(in_another_order(scene)) == pytest.approx(size)
    assert size >= np.linalg.norm(scene.gravity)
