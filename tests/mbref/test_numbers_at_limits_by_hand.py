"""Decisions of the equations and of natural coordinates at their limits themselves."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref.equations import diagnosis, joint_reactions
from mbref.equations.initial_state import Start
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
