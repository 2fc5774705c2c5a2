"""Short motions of every joint, load, driver and coupling: `taylor` has the judge's stored states."""

import functools
from dataclasses import replace

import numpy as np
import pytest

import mbref
from tests.helpers.errors import pose_error, rate_error
from tests.helpers.exact_motions import stored
from tests.helpers.short_motions import CROSSED, MOTIONS, times_of

ROUNDING = 2.2e-16
STATES = ("position", "orientation", "velocity", "angular_velocity")
STEPS = 1050  # of all motions together, which took 970 once: more mean that steps became shorter


def tolerance(steps: int) -> float:
    """Return the error of poses that rounding in so many steps and at the start (20 more) explains. Each step
    has a margin of 20 roundings. Rates and violations have ten times as much."""
    return 20 * ROUNDING * (20 + steps)


@functools.cache
def run_of(name: str) -> mbref.Motion:
    """Return a motion at its stored times, and at three times beside each other, computed once for the tests
    of this file in a process."""
    scene = MOTIONS[name]()
    times = np.union1d(times_of(scene), three_times(scene.duration))
    return mbref.simulate(scene, "taylor", times=times, rtol=1e-12)


def three_times(duration: float) -> np.ndarray:
    """Return times about 0.43 of the duration, 1e-4 of it apart."""
    return duration * np.array([0.4299, 0.43, 0.4301])


@pytest.mark.parametrize("name", MOTIONS)
def test_motion_has_the_judges_states_to_rounding_and_rates_of_velocities_as_accelerations(name):
    """The stored states are by the judge's references or closed forms. Runs cross as many singular positions
    as `CROSSED` says; there rounding is magnified by up to 100. The rate is a central difference over 2e-4 of
    the duration. Its error is at most 1 % of the change of the acceleration meanwhile, or 1e-4 of the
    acceleration's and the velocities' scale."""
    run, scene = run_of(name), MOTIONS[name]()
    assert run.outcome.name == "COMPLETED", run.message
    rows = np.searchsorted(run.times, times_of(scene))
    found = replace(run, **{field: getattr(run, field)[rows] for field in STATES})
    _, crossings = CROSSED.get(name, (0, None))
    sharp = 1.0 if crossings is None else 100.0  # a singular position magnifies rounding
    limit = sharp * tolerance(run.cost.steps)
    exact = stored()[name]
    assert pose_error(found, exact) < limit
    assert rate_error(found, exact) < 10 * limit
    assert run.violation.position.max() < 10 * limit
    if crossings is not None:
        assert len(run.crossings) == crossings
    middle = slice(k := int(np.searchsorted(run.times, three_times(scene.duration)[0])), k + 3)
    spins = run.angular_velocity, run.angular_acceleration
    for rates, accelerations in ((run.velocity, run.acceleration), spins):
        rate, acceleration = rates[middle], accelerations[middle]
        slope = (rate[2] - rate[0]) / np.ptp(run.times[middle])
        curvature = np.abs(acceleration[2] - acceleration[0]).max()
        scale = np.abs(acceleration).max() + np.abs(rate).max() / scene.duration
        assert np.abs(slope - acceleration[1]).max() <= 1e-4 * scale + 0.01 * curvature


def test_all_short_motions_together_take_at_most_1050_steps():
    """At a tolerance of 1e-12 all motions took 970 steps at first; shorter steps need more."""
    runs = [run_of(name) for name in MOTIONS]
    assert {run.outcome.name for run in runs} == {"COMPLETED"} and sum(run.cost.steps for run in runs) < STEPS
