"""Motions with a planted fault: the judge measures the size of the fault and names the quantity."""

import functools
import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from crosscheck import measure, truth_for
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.energy import energy_series, kinetic_energy, potential_energy
from crosscheck.judge.model_identity import acceleration_scale, along, gate, gate_times
from crosscheck.judge.momentum import momentum_series
from crosscheck.judge.precision import grain
from crosscheck.judge.reaction_balance import absurd, balance, with_exact_reactions
from crosscheck.judge.truth import Truth
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import Body, Scene
from tests.helpers.changed_scenes import bumped, in_another_frame, in_another_order, in_other_units
from tests.helpers.parts import SKEW, Z, block, hinge, turning_about
from tests.helpers.short_motions import GRAVITY, MOTIONS, made

SHIFT = np.array([0.003, -0.004, 0.012])  # m
SHIFTED = 0.013  # m, its length
AXIS = np.array([2.0, -3.0, 6.0]) / 7.0
SAMPLES = 9
ROUNDING = 1e-12  # m, rad, or relative: 5000 rounding units of numbers near 1
CLOSE = 1e-9  # relative error of a small difference of two numbers near 1, of at least 1e-3


def double_hinge() -> Scene:
    """Return two blocks on skew hinges under gravity; the first one begins to turn."""
    first = turning_about((0.0, 0.0, 0.0), SKEW, 3.0, block("a", (0.4, 0.1, -0.1)))
    second = turning_about((0.0, 0.0, 0.0), SKEW, 3.0, block("b", (0.9, 0.3, 0.2), 0.7))
    other = hinge("B", "a", "b", (0.6, 0.2, 0.1), (0.6, 0.0, 0.8))
    joints = [hinge("A", "ground", "a", (0.0, 0.0, 0.0), SKEW), other]
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


GEARS, CRANK = MOTIONS["gears with armature"], MOTIONS["planar_slider_crank_gravity"]
MAKERS = [double_hinge, flying, GEARS, CRANK]
of_each_maker = pytest.mark.parametrize("make", MAKERS, ids=["hinges", "flying", "gears", "slider-crank"])


@of_each_maker
def test_true_motion_has_no_error_and_no_violation(make):
    """The run is the truth at its own times: errors and violations are rounding, 5000 units at most."""
    found = measured(make)
    for name in ("error", "velocity_error", "violation_position", "violation_velocity"):
        assert found[name] <= ROUNDING, name
    assert found["scd"] > 12


LENGTHS = {  # m; largest distance between anchors and centres of mass at the start, from their coordinates
    double_hinge: math.hypot(0.9, 0.3, 0.2),  # first anchor to second centre
    flying: math.hypot(0.7, 0.1, 0.2),  # centre to centre
    GEARS: math.hypot(0.5, 0.1, 0.1),  # centre of the pinion to centre of the wheel
    CRANK: 0.304 * math.cos(0.3) + math.sqrt(0.4048**2 - (0.304 * math.sin(0.3)) ** 2),  # pivot to slider
}


@of_each_maker
@pytest.mark.parametrize("sample", [0, 5, SAMPLES - 1])
def test_a_shift_is_measured_in_lengths_of_the_mechanism(make, sample):
    """The last body is shifted by 13 mm at one sample; scd is -log₁₀ of the error, its correct digits."""
    found = measured(make, position=bumped(exact_of(make)[2].position, sample, -1, SHIFT))
    assert found["position_error"] == pytest.approx(SHIFTED / LENGTHS[make], rel=CLOSE)
    assert found["error"] == found["position_error"] and found["rotation_error"] < ROUNDING
    assert found["scd"] == pytest.approx(-math.log10(SHIFTED / LENGTHS[make]))


@of_each_maker
@pytest.mark.parametrize("angle", [1e-6, 0.02, 3.0])
def test_a_rotation_is_measured_by_its_angle(make, angle):
    """The first body is turned (rad) at one sample. All quaternions change sign, which is no rotation."""
    _, _, exact = exact_of(make)
    orientation = exact.orientation.copy()
    orientation[4, 0] = rotations.multiply(rotations.from_vector(angle * AXIS), orientation[4, 0])
    found = measured(make, orientation=-orientation)
    assert found["rotation_error"] == pytest.approx(angle, abs=ROUNDING)
    assert found["error"] == found["rotation_error"] and found["position_error"] < ROUNDING


@pytest.mark.parametrize("late", [1e-5, 1e-4])
def test_error_of_a_delayed_mechanism_is_its_largest_speed_times_the_delay(late):
    """A run that is late (s) is off by its speed times the delay. Meanwhile speeds change, by less than 100
    of themselves per second: the relative tolerance is 100 delays."""
    scene, truth, exact = exact_of(double_hinge)
    times = exact.times[1:]
    delayed = replace(truth.poses(times - late), times=times)
    found = measure(scene, delayed, truth)
    speed = np.linalg.norm(exact.velocity[1:], axis=2).max()
    spin = np.linalg.norm(exact.angular_velocity[1:], axis=2).max()
    assert found["position_error"] == pytest.approx(late * speed / LENGTHS[double_hinge], rel=100 * late)
    assert found["rotation_error"] == pytest.approx(late * spin, rel=100 * late)
    assert found["violation_position"] < ROUNDING and found["violation_velocity"] < ROUNDING


def largest_energy(scene: Scene, run: Trajectory) -> float:
    """Return the largest kinetic energy or change of an energy from the start, J."""
    kinetic = kinetic_energy(scene, run.position, run.orientation, run.velocity, run.angular_velocity)
    potential = potential_energy(scene, run.position, run.orientation)
    return max(kinetic.max(), *(np.abs(energy - energy[0]).max() for energy in (kinetic, potential)))


@pytest.mark.parametrize("share", [1e-6, 0.03])
def test_velocities_too_fast_by_a_share_have_that_error_and_kinetic_energies_that_drift(share):
    """Velocities (1 + s) v obey the joints. The energy T grows by ((1 + s)² - 1) T, over the largest."""
    scene, _, exact = exact_of(double_hinge)
    faster = {name: (1 + share) * getattr(exact, name) for name in ("velocity", "angular_velocity")}
    found = measured(double_hinge, **faster)
    assert found["velocity_error"] == pytest.approx(share, rel=CLOSE)
    assert found["violation_velocity"] < ROUNDING
    kinetic = kinetic_energy(scene, exact.position, exact.orientation, exact.velocity, exact.angular_velocity)
    run = replace(exact, **faster)
    drift = ((1 + share) ** 2 - 1) * kinetic / largest_energy(scene, run)
    assert energy_series(scene, run) == pytest.approx(drift, abs=ROUNDING)


def test_violation_of_a_joint_is_a_component_of_the_gap_that_is_put_in_at_every_level():
    """Three rows of a hinge are components of its gap or of its rates: the largest is at least 1/√3 of it."""
    _, _, exact = exact_of(double_hinge)
    for level, factor in (("position", 1), ("velocity", 10), ("acceleration", 100)):
        moved = bumped(getattr(exact, level), 3, 1, factor * SHIFT)
        found = measured(double_hinge, **{level: moved})[f"violation_{level}"]
        size = factor * SHIFTED / LENGTHS[double_hinge]
        assert size / math.sqrt(3) <= found <= size * (1 + CLOSE)


def test_violation_of_gears_that_slip_is_their_angle_and_its_rate():
    """The wheel turned about its hinge by 0.02 rad, or by 0.3 rad/s: its joints stay closed."""
    _, _, exact = exact_of(GEARS)
    orientation, turn = exact.orientation.copy(), rotations.from_vector(0.02 * np.array(Z))
    orientation[2:, 1] = rotations.multiply(turn, orientation[2:, 1])
    place = exact.position.copy()
    centre = np.array([0.5, 0.0, 0.0])
    place[2:, 1] = centre + rotations.rotate(turn, place[2:, 1] - centre)
    found = measured(GEARS, orientation=orientation, position=place)
    assert found["violation_position"] == pytest.approx(0.02, rel=CLOSE)
    assert found["rotation_error"] == pytest.approx(0.02, rel=CLOSE)
    spin = bumped(exact.angular_velocity, 4, 1, 0.3 * np.array(Z))
    velocity = bumped(exact.velocity, 4, 1, np.cross(0.3 * np.array(Z), exact.position[4, 1] - centre))
    found = measured(GEARS, angular_velocity=spin, velocity=velocity)
    assert found["violation_velocity"] == pytest.approx(0.3, rel=CLOSE)


@pytest.mark.parametrize("height", [0.005, 0.01])
def test_energy_drift_of_lifted_blocks_is_their_weight_times_the_height(height):
    """Both blocks are lifted (m) at one sample: the drift is m g h over the largest energy."""
    scene, _, exact = exact_of(double_hinge)
    place = exact.position.copy()
    place[5] -= height * np.array(GRAVITY) / np.linalg.norm(GRAVITY)
    run = replace(exact, position=place)
    off = energy_series(scene, run)
    weight = sum(body.mass for body in scene.body) * np.linalg.norm(GRAVITY)
    assert off[5] == pytest.approx(weight * height / largest_energy(scene, run), rel=CLOSE)
    assert np.delete(off, 5).max() < ROUNDING


def test_momentum_drift_of_a_pushed_body_is_the_change_of_its_momentum():
    """1.5 kg at 3 m/s get 0.9 m/s across: 1.5 · 0.9 of the largest 1.5 √(3² + 0.9²) kg m/s."""
    scene, _, exact = exact_of(flying)
    across = np.array([0.0, 1.0, 1.0]) / math.sqrt(2)
    off = momentum_series(scene, replace(exact, velocity=bumped(exact.velocity, 6, 0, 0.9 * across)))
    assert off[6] == pytest.approx(0.9 / math.hypot(3.0, 0.9)) and np.delete(off, 6).max() < ROUNDING


@pytest.mark.parametrize("make", [double_hinge, CRANK], ids=["double hinge", "slider-crank"])
@pytest.mark.parametrize("share", [0.01, 0.2])
def test_error_and_imbalance_of_reactions_too_large_by_a_share_are_that_share(make, share):
    """True reactions have the error 0 and balance forces and the exact accelerations, to rounding."""
    scene, truth, exact = exact_of(make)
    true = with_exact_reactions(scene, exact)
    larger = replace(true, reactions={name: (1 + share) * w for name, w in true.reactions.items()})
    assert measure(scene, true, truth)["reaction_error"] < ROUNDING
    assert measure(scene, larger, truth)["reaction_error"] == pytest.approx(share, rel=CLOSE)
    assert balance(scene, true, exact) < ROUNDING
    assert balance(scene, larger, exact) == pytest.approx(share, rel=CLOSE)


def test_reaction_a_million_times_too_large_is_named_with_its_engine_and_joint():
    """An engine that solves with a singular matrix gives such reactions; true ones are not named."""
    scene, _, exact = exact_of(double_hinge)
    true = with_exact_reactions(scene, exact)
    wild = replace(true, engine="other", reactions={**true.reactions, "B": 1e6 * true.reactions["B"]})
    assert absurd(scene, true, true) == []
    [sentence] = absurd(scene, wild, true)
    assert sentence.startswith("other gives") and " N in B" in sentence


@functools.cache
def short_run(make) -> Trajectory:
    scene = make()
    return truth_for(scene).poses(gate_times(scene))


# The gate compares poses, velocities and accelerations of two runs at the start, and changes of velocity to
# the next sample: engines must simulate one mechanism. START has for each field that the gate can name the
# array of the run, the sample, and the length of the vector that is added.
START = {
    "initial position": ("position", 0, 1e-4),
    "initial velocity": ("velocity", 0, 1e-4),
    "initial angular velocity": ("angular_velocity", 0, 1e-4),
    "change of velocity": ("velocity", 1, 1e-2),
    "change of angular velocity": ("angular_velocity", 1, 1e-2),
    "initial acceleration": ("acceleration", 0, 5.0),
    "initial angular acceleration": ("angular_acceleration", 0, 5.0),
}


def by_gate(make, field: str, times: float):
    """Return the gate's difference of the true run and one with ``times`` the vector of START added."""
    scene, run = make(), short_run(make)
    name, sample, size = START[field]
    off = bumped(getattr(run, name), sample, -1, times * size * AXIS)
    return gate(scene, [run, replace(run, engine="other", **{name: off})])


@pytest.mark.parametrize("make", [double_hinge, MOTIONS["planet with armatures"]], ids=["hinges", "planet"])
@pytest.mark.parametrize("field", START)
def test_gate_names_the_field_that_differs_and_twice_the_difference_has_twice_the_size(make, field):
    """A vector is added to one array of the true run of the last body, at the start or the next sample."""
    run = short_run(make)
    assert gate(make(), [run, replace(run, engine="other")]) is None
    once, twice = by_gate(make, field, 1), by_gate(make, field, 2)
    assert once.field == twice.field == field and once.engines == ("truth", "other")
    assert twice.by == pytest.approx(2 * once.by, rel=1e-6)  # rounding of a small difference


@pytest.mark.parametrize("change", ["mass", "inertia"])
def test_gate_names_the_change_of_velocity_of_a_body_with_another_mass_or_inertia(change):
    """The second block has a tenth more of it; the difference is more than ten times what the gate allows."""
    scene = double_hinge()
    body = scene.body[1]
    parts = body.model_dump()
    parts[change] = (1.1 * np.array(parts[change])).tolist()
    heavier = scene.with_(body=(scene.body[0], Body(**parts)))
    run = replace(truth_for(heavier).poses(gate_times(scene)), engine="other")
    found = gate(scene, [short_run(double_hinge), run])
    assert found is not None and (found.field, found.engines) == ("change of velocity", ("truth", "other"))
    assert found.by > 10 * found.allowed


@pytest.mark.parametrize("sample", [0, 4, 8])
def test_accelerations_that_are_wrong_from_a_sample_on_are_named_with_their_time(sample):
    """``along`` compares accelerations with the judge's at the run's own states. 50 m/s² are added from a
    sample on. Some of the nine samples are compared, the last one among them, so that the printed time may be
    up to two samples late. Its three digits round by less than 1 %."""
    scene, _, exact = exact_of(double_hinge)
    assert along(scene, exact) is None
    off = np.where(np.arange(SAMPLES) >= sample, 50.0, 0.0)[:, None, None] * AXIS  # m/s²
    found = along(scene, replace(exact, engine="other", acceleration=exact.acceleration + off))
    assert found is not None and found.engines == ("the judge", "other")
    time = float(found.field.removeprefix("acceleration at t = ").removesuffix(" s"))
    assert 0.99 * exact.times[sample] <= time <= 1.01 * exact.times[min(sample + 2, SAMPLES - 1)]
    assert found.by > 100 * found.allowed


@pytest.mark.parametrize("size", [1e-9, 1e-6])
def test_noise_of_positions_is_measured_within_a_factor_of_six(size):
    """A smooth motion has no sixth difference of twelve samples, 10 µs apart: rounding is found. Normal noise
    of a standard deviation (m) is found to a factor of six: so few samples show its spread no better."""
    scene, run = double_hinge(), exact_of(double_hinge)[1].poses(0.1 + 1e-5 * np.arange(12))
    assert grain(scene, run)[0] < ROUNDING
    noise = size * np.random.default_rng(3).standard_normal(run.position.shape)
    found, of = grain(scene, replace(run, position=run.position + noise))
    assert of == "positions" and size / 6 < found * LENGTHS[double_hinge] < 6 * size


@pytest.mark.parametrize(("scale", "units"), [(scene_length, 7.0), (acceleration_scale, 7.0 / 0.5**2)])
@pytest.mark.parametrize("name", [*MOTIONS][::4])
def test_scale_of_a_scene_is_in_its_units_and_independent_of_frame_and_order(name, scale, units):
    """Scales are the mechanism's length, and an acceleration. Numbers of lengths are 7 times as large in
    other units, those of times half as large."""
    scene = MOTIONS[name]()
    turn, shift = rotations.from_vector(0.9 * AXIS), 20 * SHIFT
    others = in_another_frame(scene, turn, shift), in_another_order(scene)
    found = [scale(in_other_units(scene, 3.0, 7.0, 0.5)) / units, *map(scale, others)]
    assert found == pytest.approx([scale(scene)] * 3)


def test_scale_of_accelerations_is_at_least_gravity():
    """A fault of a body at rest is relative to its weight, and not to rounding."""
    for scene in (make() for make in MOTIONS.values()):
        assert acceleration_scale(scene) >= np.linalg.norm(scene.gravity), scene.name
