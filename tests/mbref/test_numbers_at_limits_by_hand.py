"""Decisions of the equations and of natural coordinates at their limits themselves."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref.equations import diagnosis, joint_reactions
from mbref.equations.initial_state import Start
from mbref.stepping import ranks, singular_start
from mbref.taylor import orientations

X, Y, Z = np.eye(3)
NONE = np.zeros(0)


def beyond(number: float) -> float:
    return math.nextafter(number, math.inf)


def test_directions_of_a_basis_at_the_limit(monkeypatch):
    """A sine of 1/4 is too small for a basis whose limit is 1/4, and two axes of that sine are apart."""
    monkeypatch.setattr(orientations, "APART", 0.25)
    monkeypatch.setattr(orientations, "PARALLEL", 0.25)
    at, above = (np.array([0.5, sine, 0.0]) for sine in (0.25, beyond(0.25)))
    assert orientations._basis([X, at, Z])[1] is not at and orientations._basis([X, at, Z])[1].tolist() == [
        0,
        0,
        1,
    ]
    assert orientations._basis([X, above, Z])[1].tolist() == above.tolist()
    assert not orientations._are_parallel(X, at)
    assert orientations._are_parallel(X, np.array([0.5, math.nextafter(0.25, 0.0), 0.0]))


@pytest.mark.parametrize("off", [1e-9, beyond(1e-9)])
def test_starts_report_more_than_rounding(off):
    report = f"{'initial positions were off the constraints by 1.00e-09; corrected' if off > 1e-9 else ''}"
    assert Start(NONE, NONE, off, 0.0, NONE).report() == report
    report = "initial velocities by 1.00e-09; corrected" if off > 1e-9 else ""
    assert Start(NONE, NONE, 0.0, off, NONE).report() == report


def test_rows_and_reactions_at_their_limits(monkeypatch):
    monkeypatch.setattr(diagnosis, "UNIQUE_TOLERANCE", 0.25)
    parts = diagnosis.take_part(np.array([[0.25, 0.0], [0.0, beyond(0.25)], [-0.5, 0.0]]))
    assert parts.tolist() == [False, True, True]
    scene: Any = SimpleNamespace(has_mass=lambda: True, joint=())
    found = [len(joint_reactions.lazy_reactions(scene, NONE, NONE, np.zeros((1, m)))) for m in (120, 121)]
    assert found == [2, 1]


def test_ranks_and_starts_at_their_limits(monkeypatch):
    """A value at the tolerance is no rank; a force across the velocities gives no acceleration."""
    values = np.array([0.5, 0.25, 0.125])
    assert ranks._ranks(values, 0.25) == (1, 0.5, 0.25)
    assert ranks._ranks(values, math.nextafter(0.25, 0.0)) == (2, 0.25, 0.125)
    assert ranks._ranks(values, 0.5) == (0, 1.0, 0.5) and ranks._ranks(values, 0.0) == (3, 0.125, 0.0)
    monkeypatch.setattr(singular_start, "NEAR_SINGULAR", 0.25)
    monkeypatch.setattr(singular_start, "MET", 0.5)
    monkeypatch.setattr(singular_start, "rate_violation", lambda model, q, v: q)

    def near(least: float, violation: float, speed: float = 1.0) -> bool:
        start = SimpleNamespace(q=violation, v=np.array([0.0, speed]))
        run: Any = SimpleNamespace(ranks=SimpleNamespace(least=least), start=start, model=None)
        return singular_start.begins_near_singular(run)

    below = math.nextafter(0.25, 0.0)
    found = [near(0.25, 0.0), near(below, 0.5), near(below, beyond(0.5)), near(0.0, 0.0, 0.0)]
    assert found == [False, True, False, False]
