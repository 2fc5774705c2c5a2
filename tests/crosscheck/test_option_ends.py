"""Options of the command lines / values at and beside the ends of what they take, and their results."""

from __future__ import annotations

import argparse

import numpy as np
import pytest

from crosscheck.cli import options, request
from crosscheck.cli.request import RequestError
from crosscheck.judge.reference.certify import FEWEST_DIGITS, MOST_DIGITS
from mbref.cli.options import sample_times
from mbref.scene import Body, Scene

BLOCK = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
SCENE = Scene(name="s", duration=2.0, body=(BLOCK,))


@pytest.mark.parametrize(
    ("parse", "good", "bad"),
    [
        (options.positive, ["5e-324", "1", "1e308"], ["0", "-1", "inf", "nan", "x"]),
        (options.not_negative, ["0", "5e-324", "1e308"], ["-5e-324", "inf", "nan", "x"]),
        (options.whole(1, 10), ["1", "10"], ["0", "-1", "11", "1.5", "x", ""]),
        (
            options.digits,
            [str(FEWEST_DIGITS), str(MOST_DIGITS)],
            [str(FEWEST_DIGITS - 1), str(MOST_DIGITS + 1), "x"],
        ),
    ],
    ids=["positive", "not negative", "whole", "digits"],
)
def test_numbers_at_the_ends_of_what_an_option_takes(parse, good, bad):
    for text in good:
        assert parse(text) == float(text), text
    for text in bad:
        with pytest.raises(argparse.ArgumentTypeError, match="must be"):
            parse(text)


def asked(**given: object) -> argparse.Namespace:
    return argparse.Namespace(**{"times": None, "samples": None, "duration": None, **given})


def test_sample_times_of_mbref_by_hand():
    assert np.array_equal(sample_times(asked(), SCENE), np.linspace(0.0, 2.0, 101))
    assert np.array_equal(sample_times(asked(samples=2), SCENE), [0.0, 2.0])
    assert np.array_equal(sample_times(asked(samples=3, duration=1.0), SCENE), [0.0, 0.5, 1.0])
    assert np.array_equal(sample_times(asked(times="0,0.5,3"), SCENE), [0.0, 0.5, 3.0])
    assert np.array_equal(sample_times(asked(times="0,0.5,3", duration=0.5), SCENE), [0.0, 0.5])
    assert np.array_equal(sample_times(asked(times="0.1", duration=0.1), SCENE), [0.1])


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"samples": 1}, "--samples: must be at least 2, got 1"),
        ({"duration": 0.0}, "--duration: must be positive, got 0"),
        ({"duration": np.inf}, "--duration: must be positive, got inf"),
        ({"times": "0,0"}, "increasing"),
        ({"times": "-1e-9,1"}, "not negative"),
        ({"times": "0,inf"}, "finite"),
        ({"times": "1,x"}, "must be numbers separated by commas, got '1,x'"),
        ({"times": "1", "duration": 0.5}, "--times: none is within --duration 0.5"),
    ],
)
def test_sample_times_that_mbref_refuses(given, says):
    with pytest.raises(ValueError, match=says):
        sample_times(asked(**given), SCENE)


def test_sample_times_of_crosscheck_by_hand():
    assert np.array_equal(request.sample_times(SCENE, None, 2), [0.0, 2.0])
    assert np.array_equal(request.sample_times(SCENE, [0.0, 0.5], 9), [0.0, 0.5])
    refused = {
        (0.0,): "must have a time after 0",
        (0.5, 0.5): "must increase, got 0.5 after 0.5",
        (-0.1, 1.0): "not negative, got -0.1",
        (0.0, np.inf): "must be finite",
    }
    for times, says in refused.items():
        with pytest.raises(RequestError, match=says):
            request.sample_times(SCENE, list(times), 2)


def test_the_end_of_a_motion_by_hand():
    assert request.lasting(SCENE, None, None) is SCENE and request.lasting(SCENE, None, 2.0) is SCENE
    assert request.lasting(SCENE, [0.5, 1.5], None).duration == 1.5, "the last time ends it"
    assert request.lasting(SCENE, [0.5], 0.5).duration == 0.5
    assert request.lasting(SCENE, None, 3.0).duration == 3.0
    with pytest.raises(RequestError, match=r"--times: must end by --duration 0\.5, got 0\.6"):
        request.lasting(SCENE, [0.6], 0.5)
    for end in (0.0, np.inf, np.nan):
        with pytest.raises(RequestError, match="--duration: must be positive"):
            request.lasting(SCENE, None, end)


def test_options_need_one_engine_and_one_family():
    chosen = request.choice(["a"], ["f"], [("x", 1)], None, True)
    assert chosen.setting.family == "f" and dict(chosen.setting.options) == {"x": 1} and chosen.is_named
    assert request.choice(["a", "b"], [], None, 1e-6, False) == request.Choice(None, None, 1e-6, False)
    assert not request.choice(["a"], [], None, None, True).is_named
    for engines, families in ((["a", "b"], ["f"]), (["a"], ["f", "g"]), (["a"], [])):
        with pytest.raises(RequestError, match="--option: needs one --engine and one --setting"):
            request.choice(engines, families, [("x", 1)], None, True)
