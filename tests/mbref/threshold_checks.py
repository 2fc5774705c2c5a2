"""Registry of the checks of thresholds outside ``mbref.taylor.crossing``, for ``interpreted_limits.py``.

A key is a module of mbref and a constant.  Each check has its numbers written out: a threshold that moves by
10 % (a count: by one) fails its check.
"""

import pytest

CHECKS = {}


def check(key):
    """Decorate the check of a threshold, by module and name."""

    def put(function):
        assert key not in CHECKS, key
        CHECKS[key] = function
        return function

    return put


def near(value, expected):
    """Whether a number is equal to another to a thousandth."""
    return bool(value == pytest.approx(expected, rel=1e-3, abs=0.0))
