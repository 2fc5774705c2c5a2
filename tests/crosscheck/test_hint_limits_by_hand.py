"""Hints of the conformance suite / limits that an acceleration meets exactly, and the parts of a scene."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.conformance import hint
from mbref.scene import Body, Scene

WHEEL = Body(name="wheel", mass=3.0, inertia=(1.0, 1.5, 2.0), position=(4.0, 0.0, 0.0))
SCENE = Scene(name="free", body=(WHEEL,), gravity=(0.0, 0.0, 0.0))


@pytest.mark.parametrize("moved", [{"velocity": (0.0, 1.0, 0.0)}, {"angular_velocity": (0.0, 0.0, 2.0)}])
def test_a_velocity_or_a_spin_needs_velocity_terms(moved):
    scene = SCENE.with_(body=(WHEEL.model_copy(update=moved),))
    assert hint.parts_of(scene) == ["mass matrix", "velocity terms"]


@pytest.fixture
def explained(monkeypatch) -> Any:
    """The changes that explain an acceleration of the engine instead of 2 m/s².

    An error of more than half is wrong, and a quarter of the error may remain."""

    def found(own: float, *changed: float) -> Any:
        monkeypatch.setattr(hint, "WRONG", 0.5)
        monkeypatch.setattr(hint, "EXPLAINED", 0.25)
        monkeypatch.setattr(hint, "_least", lambda scene: 0.5)
        monkeypatch.setattr(hint, "_rounded", lambda bench: 0.0)
        monkeypatch.setattr(hint, "terms_at", lambda scene, run, k: np.array([2.0]))
        monkeypatch.setattr(hint, "accelerations", lambda scene, terms: terms)
        monkeypatch.setattr(hint, "_differences", lambda scene, bench: np.array([own]))
        monkeypatch.setattr(hint, "variants", lambda *_: [("loads", x, np.array([x])) for x in changed])
        return hint.explanations(SimpleNamespace(scene=SCENE, close=None))

    return found


def test_an_acceleration_at_the_limit_is_right(explained):
    assert explained(3.0) is None and explained(1.0) is None
    assert explained(3.0 + 2.0**-40) == set()


def test_a_change_at_the_limit_explains(explained):
    """Accelerations differ by 2 m/s². A change explains this if at most 0.5 m/s² remain."""
    assert explained(4.0, 3.5, 4.5, 3.5 - 2.0**-40, 4.5 + 2.0**-40) == {("loads", 3.5), ("loads", 4.5)}
