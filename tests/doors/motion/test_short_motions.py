"""Short motions of every joint, load, driver and coupling: `taylor` has the judge's stored states."""

import functools

import numpy as np
import pytest

import mbref
from tests.helpers.errors import pose_error, rate_error
from tests.helpers.exact_motions import stored
from tests.helpers.short_motions import CROSSED, MOTIONS, times_of

ROUNDING = 2.2e-16
STEPS = 1050  # of all motions together, which took 970 once: more mean that steps became shorter


def tolerance(steps: int) -> float:
    """Return the error of poses that rounding in so many steps and at the start (20 more) explains. Each step
    has a margin of 20 roundings. Rates and violations have ten times as much."""
    return 20 * ROUNDING * (20 + steps)


@functools.cache
def run_of(name: str) -> mbref.Motion:
    """Return a motion at its stored times, computed once for the tests of this file in a process."""
    scene = MOTIONS[name]()
    return mbref.simulate(scene, "taylor", times=times_of(scene), rtol=1e-12)


@pytest.mark.parametrize("name", MOTIONS)
def test_motion_has_the_judges_states_to_rounding(name):
    """The stored states are by the judge's references or closed forms. Runs cross as many singular positions
    as `CROSSED` says; there rounding is magnified by up to 100."""
    found = run_of(name)
    assert found.outcome.name == "COMPLETED", found.message
    _, crossings = CROSSED.get(name, (0, None))
    sharp = 1.0 if crossings is None else 100.0  # a singular position magnifies rounding
    limit = sharp * tolerance(found.cost.steps)
    exact = stored()[name]
    assert pose_error(found, exact) < limit
    assert rate_error(found, exact) < 10 * limit
    assert found.violation.position.max() < 10 * limit
    if crossings is not None:
        assert len(found.crossings) == crossings


@pytest.mark.parametrize("name", MOTIONS)
def test_accelerations_are_the_rates_of_velocities(name):
    """The rate is a central difference over 2e-4 of the duration. Its error is at most 1 % of the change of
    the acceleration meanwhile, or 1e-4 of the acceleration's and the velocities' scale."""
    scene = MOTIONS[name]()
    middle, apart = 0.43 * scene.duration, 1e-4 * scene.duration
    run = mbref.simulate(scene, "taylor", times=[middle - apart, middle, middle + apart], rtol=1e-12)
    spins = run.angular_velocity, run.angular_acceleration
    for rate, acceleration in ((run.velocity, run.acceleration), spins):
        slope = (rate[2] - rate[0]) / (2 * apart)
        assert acceleration is not None
        curvature = np.abs(acceleration[2] - acceleration[0]).max()
        scale = np.abs(acceleration).max() + np.abs(rate).max() / scene.duration
        assert np.abs(slope - acceleration[1]).max() <= 1e-4 * scale + 0.01 * curvature


def test_all_short_motions_together_take_at_most_1050_steps():
    """At a tolerance of 1e-12 all motions took 970 steps at first; shorter steps need more."""
    runs = [run_of(name) for name in MOTIONS]
    assert {run.outcome.name for run in runs} == {"COMPLETED"} and sum(run.cost.steps for run in runs) < STEPS
