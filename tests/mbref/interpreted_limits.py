"""Decisions just on both sides of thresholds outside ``mbref.taylor.crossing``, with interpreted kernels.

``test_decisions.py`` runs them; ``docs/internals/thresholds.md`` lists the thresholds.
"""

import importlib

import pytest

from mbref.kernels.compilation import PLAIN
from tests.mbref import (  # noqa: F401 - they register checks
    limits_of_equations,
    limits_of_runs,
    limits_of_scenes,
    limits_of_solutions,
)
from tests.mbref.threshold_checks import CHECKS


def module_of(key):
    return importlib.import_module(f"mbref.{key.split()[0]}")


@pytest.mark.skipif(not PLAIN, reason="kernels are interpreted by test_decisions.py")
@pytest.mark.parametrize("key", list(CHECKS))
def test_a_decision_changes_at_its_threshold(key, monkeypatch):
    assert CHECKS[key](monkeypatch), key


@pytest.mark.skipif(not PLAIN, reason="kernels are interpreted by test_decisions.py")
@pytest.mark.parametrize("up", [False, True], ids=["smaller", "larger"])
@pytest.mark.parametrize("key", list(CHECKS))
def test_the_check_fails_when_its_threshold_moves(key, up, monkeypatch):
    """A number moves by a tenth, a count by one."""
    module, name = module_of(key), key.split()[1]
    usual = getattr(module, name)
    monkeypatch.setattr(module, name, moved(usual, up))
    assert not CHECKS[key](monkeypatch), f"{key} = {getattr(module, name)} passes the check of {usual}"


def moved(value, up):
    """A threshold that has moved; of several numbers the first one, of a table all of them."""
    if isinstance(value, dict):
        return {k: moved(v, up) for k, v in value.items()}
    if isinstance(value, tuple):
        return (moved(value[0], up), *value[1:])
    if isinstance(value, int):
        return value + (1 if up else -1)
    return value * (1.1 if up else 1 / 1.1)
