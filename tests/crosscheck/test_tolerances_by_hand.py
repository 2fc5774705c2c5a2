"""Tolerances of the judge / the numbers with which stored verdicts were given, and their order.

A tolerance is not adapted to results. Whoever changes one measures the stored verdicts anew.
"""

from __future__ import annotations

import pytest

from crosscheck.judge import tolerances

EPS = 2.0**-52
NUMBERS = {
    "ROUNDING": EPS,
    "RANK": 1e-9,
    "FREEDOM": 1e-7,
    "ON_PATH": 1e-9,
    "SAME_LENGTH": 1e-13,
    "PARALLEL": 1e-9,
    "CONTRADICTION": 0.05,
    "CONTRADICTED": 1e-3,
    "TRUTH_DRIVEN": 1e-13,
    "TRUTH_DYNAMIC": 1e-12,
    "AT_REST": 1e-12,
    "STRAIGHT_LINE": 0.1,
    "LEAST_ORDER": 0.5,
    "FLOOR": 1e-8,
    "FALSE_SUCCESS": 0.01,
    "EXCESS": 100,
    "SAME_START": 1e-8,
    "SAME_CHANGE": 1e-4,
    "SINGLE_CHANGE": 0.1,
    "LEAST_CHANGE": 1e-3,
    "SAME_FORCES": 0.01,
    "NEXT_TO_SINGULAR": 1e-3,
    "GATE_TIME": 1e-3,
    "UNIT_NORM": 1e-12,
    "STAYS_CLOSED": 1e-6,
    "LIKE_TRUTH": 1e-5,
    "SAME_MOTION": 1e-9,
    "GRAINS": 16,
    "SAME_PUSHES": 1e-6,
    "OWN_ACCURACY": 4,
    "PERTURBED": 100,
    "REACTIONS": 1e-3,
}


def test_every_tolerance_has_its_number():
    found = {name: value for name, value in vars(tolerances).items() if name.isupper()}
    assert found.pop("ERROR_LEVELS") == (1e-3, 1e-6, 1e-9)
    assert found == NUMBERS


@pytest.mark.parametrize(
    ("smaller", "larger", "times"),
    [
        ("ROUNDING", "UNIT_NORM", 1000),
        ("TRUTH_DRIVEN", "SAME_MOTION", 1000),
        ("TRUTH_DYNAMIC", "SAME_MOTION", 100),
        ("SAME_MOTION", "LIKE_TRUTH", 1000),
        ("STAYS_CLOSED", "LIKE_TRUTH", 10),
        ("LIKE_TRUTH", "FALSE_SUCCESS", 100),
        ("FLOOR", "LIKE_TRUTH", 100),
        ("SAME_LENGTH", "ON_PATH", 1000),
        ("RANK", "FREEDOM", 10),
    ],
)
def test_a_tolerance_is_far_from_what_it_has_to_tell_apart(smaller, larger, times):
    assert getattr(tolerances, larger) > times * getattr(tolerances, smaller)
