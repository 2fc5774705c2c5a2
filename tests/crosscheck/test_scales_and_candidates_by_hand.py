"""Scales of recorded quantities, and the finest settings that are run / worked out by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.recorded import columns
from crosscheck.study import least_errors

SCENE = SimpleNamespace(duration=8.0)


def motion(speed: float, spin: float, samples: int = 2) -> Any:
    """Two samples of two bodies, of which one moves at a speed, and turns, at one sample."""
    velocity, angular = np.zeros((samples, 2, 3)), np.zeros((samples, 2, 3))
    if samples:
        velocity[1, 0], angular[0, 1] = (0.6 * speed, 0.0, -0.8 * speed), (0.0, -spin, 0.0)
    return SimpleNamespace(velocity=velocity, angular_velocity=angular)


@pytest.mark.parametrize(
    ("speed", "spin", "wanted"),
    [(0.75, 0.2, (0.75, 0.2)), (0.4, 0.1, (0.5, 0.125)), (3.0, 0.0, (3.0, 0.125)), (0.0, 5.0, (0.5, 5.0))],
)
def test_sizes_of_recorded_quantities(monkeypatch, speed, spin, wanted):
    """A length of 4 m; velocities count at least as 4 m and one rad within the 8 s of the motion."""
    monkeypatch.setattr(columns, "scene_length", lambda scene: 4.0)
    found = columns.scales(SCENE, motion(speed, spin))
    assert (found["velocity"], found["angular_velocity"]) == pytest.approx(wanted)
    assert (found["position"], found["displacement"]) == (4.0, 4.0)
    assert (found["orientation"], found["angle"]) == (1.0, 1.0)
    empty = columns.scales(SCENE, motion(0.0, 0.0, samples=0))
    assert (empty["velocity"], empty["angular_velocity"]) == (0.5, 0.125)


def test_signs_of_quaternions_are_continuous():
    """The second and third have turned by less than a right angle, up to their signs; the fourth is back."""
    first, second = np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.8, 0.0, 0.6, 0.0])
    found = columns._continuous(np.array([first, -second, -second, second, first]))
    assert found.tolist() == [first.tolist(), *[second.tolist()] * 3, first.tolist()]
    assert columns._continuous(np.array([-first])).tolist() == [(-first).tolist()]
    flat = np.array([first, [0.0, 1.0, 0.0, 0.0]])
    assert columns._continuous(flat).tolist() == flat.tolist(), "a right angle keeps the sign"


def test_the_three_finest_settings_of_each_family(monkeypatch):
    asked: list[tuple] = []
    settings = [("a", "f", k) for k in range(5)] + [("a", "g", k) for k in range(2)] + [("b", "f", 7)]
    cases = [SimpleNamespace(engine=e, setting=Setting(f, {"step": k})) for e, f, k in settings]

    def default_cases(scene: Any, engines: Any, time_limit: float) -> Any:
        asked.append((scene, engines, time_limit))
        return cases, ["a refusal"]

    monkeypatch.setattr(least_errors, "default_cases", default_cases)
    found = least_errors.candidates("a scene", ["a", "b"])
    assert asked == [("a scene", ["a", "b"], 240.0)]
    assert [(c.engine, c.setting.family, c.setting.options["step"]) for c in found] == [
        ("a", "f", 2),
        ("a", "f", 3),
        ("a", "f", 4),
        ("a", "g", 0),
        ("a", "g", 1),
        ("b", "f", 7),
    ]
