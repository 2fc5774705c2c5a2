"""The gate on mechanisms of 2 cm, 0.5 m and 40 m / differences put in, over scales worked out by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.judge.model_identity import _differences, acceleration_scale, along, gate_times
from mbref.scene import Body, Moment, Revolute, Scene
from mbref.trajectory import Trajectory

LENGTHS = (0.02, 0.5, 40.0)  # m, from the hinge to the centre of mass
MASS, SPIN, GRAVITY = 2.0, 3.0, 9.81  # kg, rad/s, m/s²


def turning_arm(length: float, duration: float = 1.0, **parts: object) -> Scene:
    arm = Body(
        name="arm",
        mass=MASS,
        inertia=(0.1 * length**2, 0.4 * length**2, 0.4 * length**2),
        position=(length, 0.0, 0.0),
        velocity=(0.0, SPIN * length, 0.0),
        angular_velocity=(0.0, 0.0, SPIN),
    )
    hinge = Revolute(name="A", bodies=("ground", "arm"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    given = {"body": (arm,), "joint": (hinge,), "gravity": (0.0, -GRAVITY, 0.0), "duration": duration}
    return Scene(name="arm", **{**given, **parts})


def fields(scene: Scene, first: Trajectory, second: Trajectory) -> dict[str, float]:
    return {field: by for field, by, _ in _differences(scene, first, second)}


def moved(run: Trajectory, name: str, k: int, vector: tuple[float, float, float]) -> Trajectory:
    """A run with one array changed at its sample k."""
    array = getattr(run, name).copy()
    array[k, 0] += vector
    return replace(run, engine="other", **{name: array})


@pytest.mark.parametrize("length", LENGTHS)
def test_differences_over_the_length_and_the_speed(length):
    """Speeds are 3 lengths a second, angular velocities 3 rad/s: a tenth of either is a tenth."""
    scene = turning_arm(length)
    run = gauss_motion(scene, tuple(gate_times(scene)))
    along_x = (1e-3 * length, 0.0, 0.0)
    found = fields(scene, run, moved(run, "position", 0, along_x))
    assert found["initial position"] == pytest.approx(1e-3)
    assert found["centre of mass"] == pytest.approx(1e-3)
    assert found["initial energy"] == pytest.approx(0.0, abs=1e-12), "the weight acts along y"
    found = fields(scene, run, moved(run, "velocity", 0, (0.0, 0.0, 0.3 * length)))
    assert found["initial velocity"] == pytest.approx(0.1)
    found = fields(scene, run, moved(run, "angular_velocity", 0, (0.3, 0.0, 0.0)))
    assert found["initial angular velocity"] == pytest.approx(0.1)
    assert found["initial velocity"] == found["initial position"] == 0.0


@pytest.mark.parametrize("length", LENGTHS)
def test_slow_motions_count_against_a_length_in_the_duration(length):
    """In 0.1 s the scene's length is passed at 10 lengths a second, more than the 3 it moves at."""
    scene = turning_arm(length, duration=0.1)
    run = gauss_motion(scene, tuple(gate_times(scene)))
    found = fields(scene, run, moved(run, "velocity", 0, (0.0, 0.0, 0.3 * length)))
    assert found["initial velocity"] == pytest.approx(0.03)
    found = fields(scene, run, moved(run, "angular_velocity", 0, (0.3, 0.0, 0.0)))
    assert found["initial angular velocity"] == pytest.approx(0.03)


@pytest.mark.parametrize("length", LENGTHS)
def test_energies_over_the_largest_of_three(length):
    """Lifted by a hundredth of a length: over the kinetic energy, or over the weight times the length."""
    scene = turning_arm(length)
    run = gauss_motion(scene, tuple(gate_times(scene)))
    kinetic = (MASS + 0.4) * (SPIN * length) ** 2 / 2  # 0.4 length² about the centre of mass
    gained = MASS * GRAVITY * 0.01 * length
    scale = max(kinetic + gained, MASS * length**2, MASS * GRAVITY * length)
    found = fields(scene, run, moved(run, "position", 0, (0.0, 0.01 * length, 0.0)))
    assert found["initial energy"] == pytest.approx(gained / scale)


@pytest.mark.parametrize("length", LENGTHS)
def test_changes_and_accelerations_over_the_largest_change(length):
    """The centre goes round at 9 lengths/s² and falls; the angular acceleration counts times the length."""
    scene = turning_arm(length)
    run = gauss_motion(scene, tuple(gate_times(scene)))
    turning = MASS * GRAVITY / (MASS + 0.4) / length  # rad/s²: m g l / (m l² + 0.4 l²)
    size = np.hypot(SPIN**2 * length, turning * length)
    assert np.linalg.norm(run.acceleration[0, 0]) == pytest.approx(size, rel=1e-9)
    change = np.linalg.norm(run.velocity[1, 0] - run.velocity[0, 0])
    found = fields(scene, run, moved(run, "velocity", 1, (0.0, 0.0, 0.01 * change)))
    assert found["change of velocity"] == pytest.approx(0.01)
    found = fields(scene, run, moved(run, "angular_velocity", 1, (0.01 * change / length, 0.0, 0.0)))
    assert found["change of angular velocity"] == pytest.approx(0.01)
    assert found["change of velocity"] == 0.0
    found = fields(scene, run, moved(run, "acceleration", 0, (0.0, 0.0, 0.02 * size)))
    assert found["initial acceleration"] == pytest.approx(0.02)
    found = fields(scene, run, moved(run, "angular_acceleration", 0, (0.02 * size / length, 0.0, 0.0)))
    assert found["initial angular acceleration"] == pytest.approx(0.02)


@pytest.mark.parametrize("length", LENGTHS)
def test_accelerations_along_a_run_over_their_size(length):
    """Two hundredths of the acceleration, as a linear one and as an angular one times the length."""
    scene = turning_arm(length)
    run = gauss_motion(scene, (0.0,))
    size = float(np.linalg.norm(run.acceleration[0, 0]))
    for name, vector in (
        ("acceleration", (0.0, 0.0, 0.02 * size)),
        ("angular_acceleration", (0.02 * size / length, 0.0, 0.0)),
    ):
        found = along(scene, moved(run, name, 0, vector))
        assert found is not None and found.by == pytest.approx(0.02, rel=1e-6), (name, found)
        assert found.engines == ("the judge", "other") and found.field == "acceleration at t = 0 s"


@pytest.mark.parametrize("length", LENGTHS)
def test_the_scale_of_accelerations_in_lengths(length):
    """Speeds of 3 lengths a second are 9 lengths/s² on a circle of one length; moments count over it."""
    still = turning_arm(length, gravity=(0.0, 0.0, 0.0))
    assert acceleration_scale(still) == pytest.approx(SPIN**2 * length)
    moment = 100.0 * MASS * length**2
    pushed = still.with_(load=(Moment(body="arm", moment=(0.0, 0.0, moment)),))
    assert acceleration_scale(pushed) == pytest.approx(100.0 * length)


def test_the_centre_of_mass_is_weighted_by_the_masses():
    """Moving the body of 6 kg by 0.04 m moves the common centre of mass with the body of 2 kg by 0.03 m."""
    bodies = tuple(
        Body(name=name, mass=mass, inertia=(1.0, 1.0, 1.0), position=(x, 0.0, 0.0))
        for name, mass, x in (("a", 2.0, 0.0), ("b", 6.0, 4.0))
    )
    scene = Scene(name="two", body=bodies, gravity=(0.0, 0.0, 0.0), duration=1.0)
    run = gauss_motion(scene, tuple(gate_times(scene)))
    shifted = run.position.copy()
    shifted[0, 1, 2] += 0.04
    found = fields(scene, run, replace(run, position=shifted))
    assert found["initial position"] == pytest.approx(0.01)
    assert found["centre of mass"] == pytest.approx(0.0075)
