"""Singular positions of two loops that follow each other within one step: each is recorded."""

import math

import numpy as np
import pytest

from mbref.scenes.four_bar import LENGTH, two_rhombi
from mbref.simulation.simulate import Limits, simulate

METHODS = ("taylor", "taylor[order=28]")
POSITION = 1e-9  # rad; singular positions are found to rounding, whatever rtol is


def angles(run) -> np.ndarray:
    """Return the crank's angle (rad) from the line of its frame at each singular position."""
    return np.array([math.asin(passed.position[0, 1] / (LENGTH / 2)) for passed in run.crossings])


@pytest.mark.parametrize("rtol", [1e-4, 1e-9, 1e-12])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("apart", [2e-2, -5e-3, 3e-4])
def test_flat_positions_of_two_loops_within_one_step_are_both_recorded(apart, method, rtol):
    """Each loop is flat where the crank is in line with the loop's frame. The crank swings down from 0.3 rad
    to π - 0.3 rad and back. It passes 0, where the first loop is flat, and ``apart`` (rad), the angle of the
    second loop's frame; half a turn later it passes both again, and ``angles`` has the other sign."""
    run = simulate(two_rhombi(apart), method, [1.0], Limits(rtol=rtol, code="generic"))
    assert run.outcome.label == "COMPLETED", run.message
    expected = sorted((0.0, apart), reverse=True) + sorted((0.0, -apart))
    assert len(run.crossings) >= len(expected)
    assert np.abs(angles(run)[: len(expected)] - expected).max() < POSITION


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("number", [1, 2])
def test_second_branch_is_taken_at_the_first_or_second_of_two_crossings_in_a_step(number, method):
    """The rocker of one loop is the crank of the next. Body 1 is the coupler of the first loop, whose frame
    is at 0 rad, body 3 that of the second, whose frame is at -0.02 rad. Up to the crossing of its loop a
    coupler is parallel to its frame, to POSITION, 1e-9 rad; on the second branch it turns by more than 0.1
    rad. Gravity and rigid joints lose no energy, to 100 rtol."""
    apart, times, rtol = -2e-2, np.linspace(0.0, 0.6, 61), 1e-9
    limits = Limits(rtol=rtol, branches={number: 2}, code="generic")
    run = simulate(two_rhombi(apart), method, times, limits)
    assert run.outcome.label == "COMPLETED", run.message
    assert np.abs(angles(run)[:number] - [0.0, apart][:number]).max() < POSITION
    behind = times > run.crossings[number - 1].time
    turned = 2 * np.arctan2(run.orientation[..., 3], run.orientation[..., 0])
    coupler, frame = (1, 0.0) if number == 1 else (3, apart)
    assert np.abs(turned[~behind, coupler] - frame).max() < POSITION
    assert np.abs(turned[behind, coupler] - frame).max() > 0.1
    assert np.ptp(run.energy) < 100 * rtol * np.abs(run.energy).max()
