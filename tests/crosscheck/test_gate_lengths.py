"""The gate on mechanisms of 2 cm, 0.5 m and 40 m / differences put in, over scales worked out by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.judge.model_identity import acceleration_scale, along
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


def moved(run: Trajectory, name: str, k: int, vector: tuple[float, float, float]) -> Trajectory:
    """A run with one array changed at its sample k."""
    array = getattr(run, name).copy()
    array[k, 0] += vector
    return replace(run, engine="other", **{name: array})


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
