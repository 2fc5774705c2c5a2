"""Settings that adapters offer / steps, tolerances and rates at a rate of 10 rad/s, worked out by hand."""

from __future__ import annotations

from typing import Any

import pytest

from crosscheck.engine import Setting
from crosscheck.engines.initial_velocities import lacks_mass, may_move_freely
from crosscheck.engines.mujoco import families as mujoco
from crosscheck.engines.pinocchio import compiled_run
from crosscheck.engines.pinocchio import families as pinocchio
from mbref.scene import Body, Driver, Factor, Moment, Revolute, Scene, Spherical, TorsionSpring

Z, O = (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
HINGE = Revolute(name="A", bodies=("ground", "b"), anchor=O, axis=Z)
STEPS = [0.015, 0.005, 0.0015, 0.0005, 0.00015]  # 0.15 to 0.0015 rad


def scene(**parts: Any) -> Scene:
    body = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 0.0, 0.0))
    return Scene(**{"name": "s", "body": (body,), "joint": (HINGE,), "duration": 2.0, **parts})


def of(family: str, settings: list[Setting]) -> list[dict[str, Any]]:
    return [dict(setting.options) for setting in settings if setting.family == family]


TABLE = ((0.0, 0.0), (1.0, 1.0), (2.0, 3.0), (3.0, 4.0))
DRIVER = Driver(joint="A", polynomial=(0.0, 1.0))


# --- MuJoCo -----------------------------------------------------------------------------------------------
def test_fixed_steps_of_mujoco():
    found = mujoco.sweep(scene(), 10.0)
    assert of("defaults", found) == [{"step": h} for h in (0.015, 0.005, 0.002, 0.0015, 0.0005, 0.00015)]
    for family in ("stock", "euler", "implicit"):
        assert of(family, found) == [{"step": h} for h in STEPS]
    assert of("implicitfast", found) == [], "without dampers it is implicit's equal"
    assert of("tuned", found) == [{"step": h, "beta": 50.0, "hard": 1e-7} for h in STEPS]
    assert of("stiff", found) == [
        {"step": h, "beta": beta, "hard": 1e-7}
        for h, beta in ((0.0015, 130.0), (0.0005, 400.0), (0.00015, 1300.0), (5e-5, 4000.0))
    ]
    damped = scene(load=(TorsionSpring(joint="A", stiffness=0.0, damping=1.0),))
    assert len(of("implicitfast", mujoco.sweep(damped, 10.0))) == 5


@pytest.mark.parametrize(("duration", "count"), [(37.4, 5), (125.0, 4), (125.1, 3), (1e6, 1)])
def test_the_most_steps_of_mujoco(duration, count):
    """250 000 steps of 0.5 ms are 125 s; one step is offered in any case."""
    assert len(of("stock", mujoco.sweep(scene(duration=duration), 10.0))) == count


def test_adaptive_steps_of_mujoco():
    """The shortest step turns by 0.03 rad; rates of closures are 5 times the rate, compiled 0.1 times the
    rate or 10 over the duration."""
    found = mujoco.sweep(scene(), 10.0)
    rtols = (1e-3, 1e-4, 1e-6, 1e-8, 1e-10)
    assert of("forward", found) == [{"rtol": r, "min_step": 0.003, "beta": 50.0, "hard": 1e-7} for r in rtols]
    assert of("projected", found) == [
        {"rtol": r, "min_step": 0.003, "beta": 50.0, "hard": 1e-9} for r in rtols
    ]
    compiled = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)
    assert of(mujoco.FORWARD_COMPILED, found) == [
        {"rtol": r, "min_step": 0.003, "beta": 5.0, "hard": 1e-9} for r in compiled
    ]
    assert of(mujoco.PROJECTED_COMPILED, found) == [
        {"rtol": r, "min_step": 0.003, "hard": 1e-9} for r in compiled
    ]
    [first, *_] = of(mujoco.FORWARD_COMPILED, mujoco.sweep(scene(duration=20.0), 10.0))
    assert first["beta"] == 1.0, "0.1 times the rate exceeds 10 over the duration"
    assert of(mujoco.NEWTON, found) == []


def test_closures_that_weld_have_a_larger_regulariser(monkeypatch):
    kinds = [type("Closure", (), {"kind": "point"})(), type("Closure", (), {"kind": "weld"})()]
    for closures, hard in ((kinds[:1], 1e-9), (kinds, 1e-7)):
        monkeypatch.setattr(
            mujoco, "spanning_tree", lambda given, c=closures: type("Tree", (), {"closures": c})()
        )
        assert of(mujoco.PROJECTED_COMPILED, mujoco.sweep(scene(), 10.0))[0]["hard"] == hard


def test_scenes_without_compiled_families_of_mujoco():
    whole = mujoco.sweep(scene(driver=(DRIVER,)), 10.0)
    assert of(mujoco.NEWTON, whole) == [{"tolerance": t, "turn": 0.6} for t in (1e-4, 1e-7, 1e-10, 1e-13)]
    load = Moment(body="b", moment=Z, factor=Factor(start=1.0))
    for parts in ({"load": (load,)}, {"driver": (Driver(joint="A", table=TABLE),)}):
        found = mujoco.sweep(scene(**parts), 10.0)
        assert not any(setting.family in mujoco.COMPILED for setting in found) and of("projected", found)
        assert mujoco.depends_on_pieces(scene(**parts))
    assert not mujoco.depends_on_pieces(scene(driver=(DRIVER,), load=(Moment(body="b", moment=Z),)))


@pytest.mark.parametrize(
    ("family", "options", "code"),
    [
        ("defaults", {"step": 0.001}, '<option timestep="0.001"><flag autoreset="disable"/></option>'),
        ("defaults", {}, '<option timestep="0.002"><flag autoreset="disable"/></option>'),
        (
            "stock",
            {"step": 0.001},
            '<option timestep="0.001" integrator="RK4" jacobian="dense">'
            '<flag autoreset="disable" island="disable"/></option>'
            '<default><equality solref="0.002 1.0" solimp="0.9999 0.9999 0.001 0.5 2.0"/></default>',
        ),
        (
            "euler",
            {"step": 0.01},
            '<option timestep="0.01" integrator="Euler" jacobian="dense">'
            '<flag autoreset="disable" island="disable"/></option>'
            '<default><equality solref="0.02 1.0" solimp="0.9999 0.9999 0.001 0.5 2.0"/></default>',
        ),
        (
            "tuned",
            {"step": 0.001, "beta": 30.0, "hard": 1e-7},
            '<option timestep="0.001" integrator="RK4" jacobian="dense" iterations="50" tolerance="1e-20">'
            '<flag autoreset="disable" island="disable" refsafe="disable"/></option>'
            '<default><equality solref="-900.0 -60.0" solimp="0.9999 0.9999 0.001 0.5 2.0"/></default>'
            " and in Python: model.body_invweight0[:] *= 1e-07; model.dof_invweight0[:] *= 1e-07",
        ),
        ("forward", {"rtol": 1e-3}, ""),
        (mujoco.NEWTON, {}, ""),
    ],
)
def test_mjcf_of_a_setting(family, options, code):
    assert mujoco.own_code(Setting(family, options)) == code


# --- Pinocchio --------------------------------------------------------------------------------------------
@pytest.mark.parametrize("why", ["", "no compiler"])
def test_settings_of_pinocchio(monkeypatch, why):
    monkeypatch.setattr(compiled_run, "why_not", lambda given: why)
    found = pinocchio.sweep(scene(), 10.0)
    steps = [0.02, 0.006, 0.002, 0.0006, 0.0002]
    assert of("defaults", found) == of("proximal", found) == [{"step": h} for h in steps]
    assert of("baumgarte", found) == [{"step": h} for h in (*steps, 7e-05)]
    rtols = (1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-11)
    assert of("dop853", found) == of("tuned", found) == [{"rtol": r, "min_step": 0.003} for r in rtols]
    compiled = [] if why else [{"rtol": r, "min_step": 0.003} for r in (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)]
    assert of(pinocchio.TUNED_COMPILED, found) == compiled
    assert of(pinocchio.DOP853_COMPILED, found) == [{**options, "beta": 0.0} for options in compiled]


@pytest.mark.parametrize(("duration", "count"), [(50.0, 5), (50.1, 4), (1e7, 1)])
def test_the_most_steps_of_pinocchio(monkeypatch, duration, count):
    monkeypatch.setattr(compiled_run, "why_not", lambda given: "no")
    assert len(of("proximal", pinocchio.sweep(scene(duration=duration), 10.0))) == count


@pytest.mark.parametrize(
    ("family", "options", "code"),
    [
        ("defaults", {"step": 0.5}, "h = 0.5; settings = pinocchio.ProximalSettings()"),
        ("proximal", {"step": 0.5}, "h = 0.5; settings = pinocchio.ProximalSettings(1e-09, 1e-08, 50)"),
        (
            "baumgarte",
            {"step": 0.5},
            "h = 0.5; settings = pinocchio.ProximalSettings(1e-09, 1e-08, 50); "
            "[c.setBaumgarteCorrectorParameters(pinocchio.BaumgarteCorrectorParameters("
            "0.04000000000000001, 0.4)) for c in closures]",
        ),
        ("baumgarte", {"rtol": 1e-3}, ""),
        ("dop853", {"step": 0.5}, ""),
    ],
)
def test_python_of_a_setting(family, options, code):
    assert pinocchio.own_code(Setting(family, options)) == code


# --- masses -----------------------------------------------------------------------------------------------
def test_scenes_that_move_freely_need_masses():
    ball = Spherical(name="B", bodies=("ground", "b"), anchor=O)
    assert may_move_freely(scene()) and not may_move_freely(scene(driver=(DRIVER,)))
    assert may_move_freely(scene(joint=(HINGE, ball))), "the ball adds redundant rows only"
    without = (Body(name="b", position=(1.0, 0.0, 0.0)),)
    assert lacks_mass(scene()) is None and lacks_mass(scene(body=without, driver=(DRIVER,))) is None
    assert str(lacks_mass(scene(body=without))) == (
        "the drivers do not prescribe the whole motion, and b has no mass (excluded by the engine's model)"
    )
