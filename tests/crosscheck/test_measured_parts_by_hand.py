"""Measured records and small motions / eigenvalues of a damped pendulum, and limits worked out by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.closed_loops import records as loops
from crosscheck.engine import Setting
from crosscheck.engines.compiled import dop853, newton
from crosscheck.engines.mujoco import closures, compiled_run, rates
from crosscheck.engines.mujoco.compiled_run import CompiledRun
from crosscheck.engines.mujoco.families import NEWTON, PROJECTED_COMPILED
from crosscheck.judge.constraints import initial_poses, initial_twists, scene_length
from crosscheck.judge.gauss_principle import gauss
from crosscheck.judge.small_motions.equilibria import steady_poses
from crosscheck.small_motions import compare
from crosscheck.study.grid import Case, key
from mbref.scene import Body, Revolute, Scene, TorsionSpring
from mbref.trajectory import Trajectory

PENDULUM = Scene(
    name="pendulum",
    body=(Body(name="b", mass=2.0, inertia=(0.3, 0.4, 0.5), position=(0.0, -0.5, 0.0)),),
    joint=(Revolute(name="A", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0)),),
    load=(TorsionSpring(joint="A", stiffness=1.5, damping=0.4, natural_angle=0.0),),
    gravity=(0.0, -9.0, 0.0),
)


def true_start(scene: Scene) -> Trajectory:
    (position, orientation), (velocity, spin) = initial_poses(scene), initial_twists(scene)
    both = gauss(scene)
    states = position, orientation, velocity, spin, both[:1], both[1:] / scene_length(scene)
    position, orientation, velocity, spin, linear, angular = (np.array(state)[None] for state in states)
    return Trajectory(
        "s",
        "e",
        "1",
        "m",
        {},
        np.zeros(1),
        ("b",),
        position,
        orientation,
        velocity,
        spin,
        acceleration=linear,
        angular_acceleration=angular,
    )


@pytest.fixture(scope="module")
def steady() -> Any:
    """The pendulum hanging at rest, at which the spring has no moment."""
    return next(each for each in steady_poses(PENDULUM, 4) if each.position[0, 1] < 0)


def engine(settings: list[Any], run: Any) -> Any:
    return SimpleNamespace(name="e", best_settings=lambda scene: settings, run=run)


def test_eigenvalues_of_a_damped_pendulum_by_an_engine_s_accelerations(steady):
    """1 kg m² φ'' + 0.4 φ' + (9 + 1.5) φ = 0; the last setting is the finest, others are 7 times too fast."""

    def run(scene: Scene, times: np.ndarray, setting: int) -> Trajectory:
        made = true_start(scene)
        factor = 1.0 if setting == 3 else 7.0
        made.acceleration[:] *= factor
        made.angular_acceleration[:] *= factor
        return made

    found = compare.by_accelerations(engine([1, 2, 3], run), steady)
    assert (found.engine, found.way, found.reason) == ("e", "accelerations", "")
    exact = np.roots([1.0, 0.4, 10.5])
    assert sorted(found.eigenvalues, key=lambda s: s.imag) == pytest.approx(
        sorted(exact, key=lambda s: s.imag), rel=1e-9
    )
    assert compare.error(steady.eigenvalues, exact) < 1e-12


def test_engines_without_settings_or_accelerations(steady):
    none = compare.by_accelerations(engine([], None), steady)
    assert none.eigenvalues is None and none.reason == "no setting serves the mechanism"

    def bare(scene: Scene, times: np.ndarray, setting: int) -> Trajectory:
        made = true_start(scene)
        return Trajectory(
            "s",
            "e",
            "1",
            "m",
            {},
            made.times,
            ("b",),
            made.position,
            made.orientation,
            made.velocity,
            made.angular_velocity,
        )

    assert compare.by_accelerations(engine([1], bare), steady).reason == "reports no accelerations"


def test_the_distance_of_a_pose_from_the_judge_s(steady):
    """0.25 m of a mechanism, or 0.3 rad, whichever is larger."""
    length = scene_length(PENDULUM)
    moved = np.subtract(steady.position, [0.0, 0.0, 0.25])
    assert compare.distance(PENDULUM, steady, moved, steady.orientation) == pytest.approx(0.25 / length)
    turned = np.array([[math.cos(0.15), 0.0, 0.0, math.sin(0.15)]])
    assert compare.distance(PENDULUM, steady, steady.position, turned) == pytest.approx(0.3)


# --- closed loops -----------------------------------------------------------------------------------------
def case(family: str = "f", **options: float) -> Case:
    return Case(PENDULUM, np.array([0.0, 1.0]), "e", Setting(family, options), 100.0)


def run_of(step: float, seconds: float, **changes: Any) -> dict[str, Any]:
    made = {"key": "k", "engine": "e", "scene": "pendulum", "family": "f", "outcome": "COMPLETED"}
    return {**made, "asked": {"options": {"step": step}}, "cost": {"seconds": seconds}, **changes}


@pytest.mark.parametrize(
    ("record", "is_long"),
    [
        (run_of(0.4, 26.0), True),
        (run_of(0.4, 25.0), False),
        (run_of(0.1, 999.0), False),
        (run_of(0.05, 999.0), False),
        (run_of(0.4, 26.0, family="g"), False),
        (run_of(0.4, 26.0, engine="other"), False),
        (run_of(0.4, 26.0, scene="other"), False),
        (run_of(0.4, 26.0, outcome="STEP_FAILED"), False),
        ({**run_of(0.4, 26.0), "asked": {"options": {}}}, False),
    ],
)
def test_cases_that_would_run_out_of_time(record, is_long):
    """A quarter of the step takes four times as long; the limit is 100 s."""
    assert loops._is_too_long(case(step=0.1), record) is is_long


def test_cases_that_ran_out_of_time():
    asked = case(step=0.1)
    assert loops._is_too_long(asked, run_of(0.1, 1.0, key=key(asked), outcome="TIMED_OUT"))
    assert not loops._is_too_long(asked, run_of(0.4, 999.0, key=key(asked)))
    assert not loops._is_too_long(case(rtol=0.1), run_of(0.4, 999.0)), "a family without steps"


@pytest.mark.parametrize(
    ("changes", "is_replaced"),
    [
        ({}, True),
        ({"key": "other"}, False),
        ({"key": "other", "version": "2"}, True),
        ({"key": "other", "outcome": "REFUSED"}, True),
        ({"engine": "other"}, False),
        ({"scene": "other"}, False),
    ],
)
def test_records_that_supersede_others(changes, is_replaced):
    changes = {k: loops.REFUSED if v == "REFUSED" else v for k, v in changes.items()}
    old = {"key": "k", "engine": "e", "scene": "s", "version": "1", "outcome": "COMPLETED"}
    assert loops.supersedes(old, {**old, **changes}) is is_replaced
    assert loops.supersedes({**old, **changes}, old) is is_replaced


def test_records_without_their_motion():
    whole = {name: name for name in loops.KEPT} | {"bodies": 1, "reactions": 2}
    first, second, third = loops.METRICS
    whole["metrics"] = {first: 0.5, second: math.inf, third: None, "another": 3.0}
    kept = loops.kept(whole)
    assert set(kept) == set(loops.KEPT) | {"metrics"}
    assert kept["metrics"] == {first: 0.5, third: None}, "no number that JSON does not have"


# --- compiled runs ----------------------------------------------------------------------------------------
def made_run(family: str, **options: float) -> CompiledRun:
    context = SimpleNamespace(address=11, quaternions=np.array([4, 9]))
    return CompiledRun(family, options, context, np.array([1.0, 2.0]), 0.75)


@pytest.mark.parametrize(("family", "settle"), [("forward, compiled", 0), (PROJECTED_COMPILED, 33)])
def test_the_system_of_a_compiled_run(monkeypatch, family, settle):
    """The absolute tolerance is the relative one; only projected families correct states."""
    monkeypatch.setattr(rates, "rates", SimpleNamespace(address=22))
    monkeypatch.setattr(closures, "settle", SimpleNamespace(address=33))
    found = made_run(family, rtol=1e-6, min_step=1e-4)._dop853()
    assert isinstance(found, dop853.System) and found.quaternions.tolist() == [4, 9]
    assert (found.function, found.context, found.settle) == (22, 11, settle)
    assert (found.rtol, found.atol, found.shortest, found.longest) == (1e-6, 1e-6, 1e-4, 0.75)
    assert found.most_steps == 10**6


def test_the_system_of_newton_s_method(monkeypatch):
    monkeypatch.setattr(closures, "follow", SimpleNamespace(address=44))
    found = made_run(NEWTON, tolerance=1e-9)._newton()
    assert found == newton.System(44, 11, 1e-9, 0.75)


def test_features_that_scenes_do_not_use_are_off():
    import mujoco

    model = mujoco.MjModel.from_xml_string("<mujoco><option iterations='50'/></mujoco>")
    compiled_run.leave_out_unused(mujoco, model)
    flags = {name: getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}") for name in compiled_run.UNUSED}
    assert model.opt.disableflags == sum(int(flag) for flag in flags.values()) and model.opt.iterations == 3
    assert "CONSTRAINT" not in flags and "EQUALITY" not in flags and "GRAVITY" not in flags
