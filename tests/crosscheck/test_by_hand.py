"""Drivers, costs, units and keys / figures worked out by hand."""

from __future__ import annotations

import math
from itertools import count

import numpy as np
import pytest

from crosscheck.engine import Setting, engine
from crosscheck.engines import sampling
from crosscheck.engines.driver_motion import motion
from crosscheck.judge.constraints import closure_accelerations
from crosscheck.judge.metrics import METRICS
from crosscheck.judge.reference.bound import bounds
from crosscheck.judge.time_functions import value
from crosscheck.study.difference import _is_changed
from crosscheck.study.fair_timing import _with_cost
from mbref.scene import Body, Distance, Driver, Scene, Sine
from mbref.scenes import SCENES

DRIVER = Driver(
    joint="J",
    polynomial=(-0.3 * math.sin(0.4), 0.7, -0.2, 0.05),
    sine=Sine(amplitude=0.3, frequency=2.0, phase=0.4),
)


def driven(t: float) -> tuple[float, float, float]:
    argument = 2.0 * t + 0.4
    value = DRIVER.polynomial[0] + 0.7 * t - 0.2 * t**2 + 0.05 * t**3 + 0.3 * math.sin(argument)
    rate = 0.7 - 0.4 * t + 0.15 * t**2 + 0.6 * math.cos(argument)
    return value, rate, -0.4 + 0.3 * t - 1.2 * math.sin(argument)


@pytest.mark.parametrize("t", [0.0, 0.3, 1.7])
def test_driver_with_a_phase_in_the_adapters_and_in_the_judge(t: float):
    assert motion(DRIVER, t) == pytest.approx(driven(t), abs=1e-14)
    assert [float(value(DRIVER, t, k)) for k in range(3)] == pytest.approx(driven(t), abs=1e-14)


def test_units_and_labels_of_the_metrics():
    units = {name: metric.unit for name, metric in METRICS.items()}
    assert units == {
        "error": "",
        "position_error": "",
        "rotation_error": "rad",
        "scd": "digits",
        "velocity_error": "",
        "violation_position": "rad",
        "violation_velocity": "rad/s",
        "violation_acceleration": "rad/s²",
        "energy_error": "",
        "reaction_error": "",
    }
    for level in ("position", "velocity", "acceleration"):
        assert METRICS[f"violation_{level}"].label == f"violation of {level} constraints"


def test_cost_is_the_least_and_timing_the_median():
    record = {"cost": {"seconds": 9.0, "steps": 4}}
    found = _with_cost(record, [0.3, 0.1, math.nan, 0.25])
    assert found["cost"] == {"seconds": 0.1, "steps": 4}
    assert found["timing"] == {"median": 0.25, "repeats": 3}
    assert _with_cost(record, [math.nan]) is record


def test_cost_is_cpu_time_of_the_steps_alone(monkeypatch: pytest.MonkeyPatch):
    """A processor's clock that goes on by 1 s a look, and a wall clock that must not be looked at."""
    clock = count()
    monkeypatch.setattr(sampling.time, "process_time", lambda: float(next(clock)))
    monkeypatch.setattr(sampling.time, "perf_counter", lambda: pytest.fail("the wall clock was read"))
    block = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
    still = sampling.Sample(*(np.zeros((1, 3)), np.array([[1.0, 0, 0, 0]]), *(np.zeros((1, 3)),) * 4))
    labels = {"engine": "e", "version": "1", "method": "m", "settings": {}}
    run = sampling.run_through(
        Scene(name="s", body=(block,)),
        np.array([0.0, 1.0, 2.0]),
        lambda a, b: None,
        lambda t: still,
        sampling.Counts(),
        7.0,
        labels,
    )
    assert (run.cost.seconds, run.cost.build_seconds) == (3.0, 7.0)


def test_second_rate_of_a_distance_that_is_not_kept():
    """At 2 m, moving out at 1 m/s and across at 3 m/s, accelerating out at 4 m/s²: l'' = 4 + 3²/2."""
    ball = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(2.0, 0.0, 0.0))
    rod = Distance(name="J", bodies=("ground", "b"), anchors=((0.0, 0.0, 0.0), (2.0, 0.0, 0.0)))
    scene, still = Scene(name="s", body=(ball,), joint=(rod,)), np.zeros((1, 3))
    pose = (0.0, np.array([[2.0, 0.0, 0.0]]), np.array([[1.0, 0.0, 0.0, 0.0]]))
    rates = (np.array([[1.0, 3.0, 0.0]]), still)
    found = closure_accelerations(scene, *pose, *rates, np.array([[4.0, 0.0, 0.0]]), still)
    assert found["J"] == pytest.approx([8.5])


@pytest.mark.parametrize(("family", "code"), [("taylor", "generic"), ("taylor, generated", "generated")])
def test_code_of_a_family_of_mbref(family, code, monkeypatch):
    asked = []
    monkeypatch.setattr(
        "mbref.simulation.simulate.simulate", lambda scene, method, times, limits: asked.append(limits.code)
    )
    engine("mbref").run(SCENES["four_bar"](), np.array([0.1]), Setting(family, {}))
    assert asked == [code]


def test_bound_of_a_reference_never_falls():
    """Ten times the largest difference so far, and 1e-14 at least."""
    assert bounds(np.array([0.0, 1e-9, 1e-12, 3e-9])) == pytest.approx([1e-14, 1e-8, 1e-8, 3e-8], abs=0.0)


@pytest.mark.parametrize(
    ("new", "changed"), [(1.9e-6, False), (2.1e-6, True), (5.1e-7, False), (4.9e-7, True)]
)
def test_a_change_is_one_by_more_than_the_ratio(new, changed):
    assert _is_changed(1e-6, new, 2.0, 1e-12) is changed
