"""Options of the command lines / values at and beside the ends of what they take, and their results."""

from __future__ import annotations

import argparse

import numpy as np
import pytest

from crosscheck.cli import options, request
from crosscheck.cli.request import RequestError
from crosscheck.judge.reference.certify import FEWEST_DIGITS, MOST_DIGITS
from mbref.scene import Body, Scene

BLOCK = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
SCENE = Scene(name="s", duration=2.0, body=(BLOCK,))


@pytest.mark.parametrize(
    ("parse", "good", "bad"),
    [
        (options.number(1.0), ["5e-324", "1"], ["0", "-1", "1.0000000000000002", "inf", "nan", "x"]),
        (options.number(1.0, zero=True), ["0", "5e-324", "1"], ["-5e-324", "1.1", "inf", "nan", "x"]),
        (options.whole(1, 10), ["1", "10"], ["0", "-1", "11", "1.5", "x", ""]),
        (
            options.digits,
            [str(FEWEST_DIGITS), str(MOST_DIGITS)],
            [str(FEWEST_DIGITS - 1), str(MOST_DIGITS + 1), "x"],
        ),
    ],
    ids=["positive", "not negative", "whole", "digits"],
)
def test_option_takes_the_ends_of_its_range_and_refuses_values_beyond(parse, good, bad):
    """Texts in ``good`` are parsed as their numbers; texts in ``bad`` are refused."""
    for text in good:
        assert parse(text) == float(text), text
    for text in bad:
        with pytest.raises(argparse.ArgumentTypeError, match="must be"):
            parse(text)


@pytest.mark.parametrize(
    ("times", "duration", "end"),
    [(None, None, 2.0), (None, 2.0, 2.0), (None, 3.0, 3.0), ([0.5, 1.5], None, 1.5), ([0.5], 0.5, 0.5)],
)
def test_motion_ends_at_the_last_time_or_at_the_duration_option(times, duration, end):
    """Without both options the scene's own duration of 2 s stays."""
    assert request.lasting(SCENE, times, duration).duration == end


def test_duration_before_the_last_time_or_not_positive_is_refused():
    with pytest.raises(RequestError, match=r"--times: must end by --duration 0\.5, got 0\.6"):
        request.lasting(SCENE, [0.6], 0.5)
    for end in (0.0, np.inf, np.nan):
        with pytest.raises(RequestError, match="--duration: must be positive"):
            request.lasting(SCENE, None, end)
