"""Differences of two sets of records, worked out by hand / the sentences at the limits of noise."""

from __future__ import annotations

from typing import Any

import pytest

from crosscheck.study.difference import changes

SAME = {"cpu": "a"}


def one(
    error: float, *, bound: float = 0.0, seconds: float = 1.0, repeated: bool = False, **metrics: float
) -> dict[str, dict[str, Any]]:
    """A set of one run."""
    found = {"error": error, "error_bound": bound, **metrics}
    return {
        "run": {
            "outcome": "COMPLETED",
            "t_end": 1.0,
            "message": "",
            "metrics": found,
            "machine": SAME,
            "cost": {"seconds": seconds},
            "asked": {"end": 1.0},
            "repeated": repeated,
            "times": [0.0, 1.0],
        }
    }


def said(old: dict[str, Any], new: dict[str, Any]) -> list[str]:
    [change] = changes(old, new)
    return list(change.sentences)


@pytest.mark.parametrize(("first", "second"), [(2e-9, 1e-12), (1e-12, 2e-9)])
def test_errors_below_the_larger_bound_of_both_truths_do_not_differ(first, second):
    """The truth of one set is known to 2e-9, of the other to 1e-12: 1e-10 and 9e-10 are not apart."""
    assert said(one(1e-10, bound=first), one(9e-10, bound=second)) == []
    assert said(one(1e-10, bound=1e-12), one(9e-10, bound=1e-12)) == ["error 1.00e-10 → 9.00e-10"]


@pytest.mark.parametrize(("ratio", "changed"), [(1.9, False), (2.0, False), (2.1, True)])
def test_errors_change_by_more_than_twofold(ratio, changed):
    for old, new in ((1e-5, ratio * 1e-5), (ratio * 1e-5, 1e-5)):
        assert bool(said(one(old), one(new))) is changed, (old, new)


@pytest.mark.parametrize(
    ("both", "ratio", "changed"),
    [
        ((True, True), 1.45, False),
        ((True, True), 1.75, True),
        ((True, False), 1.75, False),
        ((False, True), 1.75, False),
        ((False, False), 1.75, False),
        ((False, False), 2.05, True),
    ],
)
def test_times_that_were_repeated_change_by_half_and_single_ones_by_twofold(both, ratio, changed):
    old, new = (one(1e-5, seconds=s, repeated=r) for s, r in zip((1.0, ratio), both, strict=True))
    assert bool(said(old, new)) is changed and bool(said(new, old)) is changed
    if changed:
        assert said(old, new) == [f"time 1.00e+00 s → {ratio:.2e} s"]


@pytest.mark.parametrize(("noise", "changed"), [(4e-13, False), (1.9e-12, False), (2.1e-12, True)])
def test_errors_are_raised_to_the_rounding_first(noise, changed):
    assert bool(said(one(1e-16), one(noise))) is changed


def test_another_measure_is_compared_where_the_error_is_the_same():
    pairs = {
        "velocity_error": "velocities",
        "violation_position": "closure",
        "energy_error": "energy",
        "reaction_error": "reactions",
    }
    for metric, name in pairs.items():
        old, new = one(1e-5, **{metric: 1e-9}), one(1e-5, **{metric: 3e-9})
        assert said(old, new) == [f"{name} 1.00e-09 → 3.00e-09"]
        assert said(old, one(1e-5, **{metric: 1.9e-9})) == []
        assert said(one(1e-5, **{metric: 1e-13}), one(1e-5, **{metric: 9e-12})) == [], "below 1e-11"
