"""Families of settings of each engine: costs in CPU time, driven motions, sweeps from coarse to fine."""

import itertools
import time

import numpy as np
import pytest

from crosscheck.cli.scene_request import find_scenes
from crosscheck.engine import Setting, engine, engine_names, installed
from crosscheck.study.search.offers import of_file
from mbref.formats import ImportOptions
from mbref.motions.trajectory import Outcome
from mbref.scenes import SCENES
from tests.helpers.driven_arm import END, ENGINES, SLIDE, TURN, able, coarsest, driven_arm, middle

IN_ONE_CALL = ("mbref", "exudyn", "casadi", "heyoka")  # other engines step from sample to sample
BUILD, STEPPING = 1.0, 3.0  # s
OTHER_TICKS = {  # building and stepping (s) of families that read the clock at other places
    ("mbref", "taylor, generated"): (3.0, 1.0),  # code is generated in the middle of building
    ("exudyn", "tuned"): (3.0, 3.0),  # three runs with different steps
}


@pytest.mark.parametrize(("name", "part"), ENGINES)
def test_cost_of_a_run_is_cpu_time_of_building_and_of_stepping(name, part, monkeypatch):
    """The CPU clock of `ticks` advances 1 s at each reading. It is read at the start and end of building: 1
    s. It is read at the start and end of stepping to each of three samples, 3 s, or of one call for all, 1 s.
    OTHER_TICKS has families that read it more often. A wall clock would give fractions of a second."""
    scene = able(name, driven_arm(), SCENES["planar_slider_crank_gravity"]().with_(duration=0.01))
    for setting in coarsest(name, scene, part):
        is_one_call = name in IN_ONE_CALL or setting.family.endswith("compiled")
        usual = (BUILD, 1.0 if is_one_call else STEPPING)
        expected = OTHER_TICKS.get((name, setting.family), usual)
        assert ticks(name, scene, setting, monkeypatch) == expected, setting


def ticks(name, scene, setting, patch):
    """Return the costs of building and of stepping to three samples; the CPU clock ticks at each reading."""
    clock = itertools.count(1)
    with patch.context() as patched:
        patched.setattr(time, "process_time", lambda: float(next(clock)))
        run = engine(name).run(scene, np.array([0.0, 0.005, 0.01]), setting)
    assert run.outcome is Outcome.COMPLETED, run.message
    return run.cost.build_seconds, run.cost.seconds


def test_cost_of_a_run_of_a_files_own_model_is_cpu_time(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo runs the MJCF file's model. By the clock of `ticks` building takes 1 s, stepping 3 s."""
    pendulum = '<body name="b"><joint type="hinge" axis="0 1 0"/><geom size="0.1" pos="0 0 -1"/></body>'
    path = tmp_path / "pendulum.xml"
    path.write_text(f"<mujoco><worldbody>{pendulum}</worldbody></mujoco>")
    [scene] = find_scenes([str(path)], ImportOptions())
    setting = of_file("mujoco", scene)[0]
    assert ticks("mujoco", scene, setting, monkeypatch) == (BUILD, STEPPING)


TIMES = np.array([0.0, 0.4 * END, END])
WITHIN = 2e-3  # m; exchanged phases, frequencies or drivers move the bodies by more than 8e-3 m
RATES = 10 * WITHIN  # rad/s and m/s; drivers of 5 and 9 rad/s magnify errors of the coordinate by as much
ROUGH = ("cpodes",)  # off by more than 8e-3 on a prescribed motion; it runs the model of the other families


@pytest.mark.parametrize(("name", "part"), ENGINES)
def test_an_engine_follows_drivers_that_turn_an_arm_and_slide_a_block_along_it(name, part):
    """The drivers prescribe the arm's angle φ(t) and the block's way s(t). With e = (cos φ, sin φ, 0) the arm
    is at 0.5 m · e and the block at (1 m + s) · e. Positions may be off by WITHIN, velocities by RATES."""
    scene = able(name, driven_arm())
    angle, rate = TURN.value(TIMES), TURN.rate(TIMES)
    along, speed = 1.0 + SLIDE.value(TIMES), SLIDE.rate(TIMES)
    out = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    across = np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=-1)
    position = np.stack([0.5 * out, along[:, None] * out], axis=1)
    slid = speed[:, None] * out + (along * rate)[:, None] * across
    velocity = np.stack([0.5 * rate[:, None] * across, slid], axis=1)
    spin = np.stack([0 * rate, 0 * rate, rate], axis=-1)[:, None].repeat(2, axis=1)
    settings = [s for s in middle(name, scene, part) if s.family not in ROUGH]
    assert settings, "every family is in ROUGH"
    for setting in settings:
        run = engine(name).run(scene, TIMES, setting)
        assert run.outcome is Outcome.COMPLETED, (setting, run.message)
        assert abs(run.position - position).max() < WITHIN, setting
        assert abs(run.velocity - velocity).max() < RATES, setting
        assert abs(run.angular_velocity - spin).max() < RATES, setting


KNOBS = ("step", "rtol", "accuracy", "tolerance")  # a smaller number means a finer setting
SWEPT = ("planar_slider_crank_gravity", "four_bar")
KINEMATIC = "ondsel"  # moves scenes whose whole motion is driven
NOT_SWEPT = "casadi"  # its sweep runs code that needs another CasADi than OpenSim loads into this process


@pytest.mark.parametrize("name", [n for n in engine_names() if n != NOT_SWEPT])
def test_families_are_swept_from_coarse_to_fine(name: str) -> None:
    """In each family one option of KNOBS falls from setting to setting, of which there are three or more. The
    engine documents the family and all its options."""
    if not installed(name):
        pytest.skip(f"{name} is not installed")
    simulator, count = engine(name), 0
    for scene in (SCENES[each]() for each in SWEPT):
        settings = [] if simulator.cannot(scene) else simulator.settings(scene)
        for family in dict.fromkeys(s.family for s in settings):
            found = [s.options for s in settings if s.family == family]
            assert family in simulator.families and simulator.serves(scene, family), family
            assert all(set(options) <= set(simulator.options) for options in found), (family, found)
            (knob,) = [k for k in found[0] if k in KNOBS and len({o[k] for o in found}) > 1]
            values = [options[knob] for options in found]
            assert values == sorted(set(values), reverse=True) and len(values) >= 3, (family, values)
            count += 1
    assert count or name == KINEMATIC, "no family was swept"


@pytest.mark.parametrize("name", [n for n in engine_names() if n not in (NOT_SWEPT, "mbref")])
def test_engine_refuses_an_unknown_family_by_name(name: str) -> None:
    """The error names the family "best" and the engine. mbref, whose families are methods, is left out."""
    if not installed(name):
        pytest.skip(f"{name} is not installed")
    with pytest.raises(ValueError, match=f"{name} has no family of settings 'best'"):
        engine(name).run(SCENES["bennett"](), np.array([0.0]), Setting("best", {}))


FIXED = {"mujoco": "tuned", "pinocchio": "proximal", "exudyn": "tuned"}  # families with fixed steps


@pytest.mark.parametrize("name", FIXED)
def test_scene_driven_twice_as_fast_has_steps_half_as_long(name: str) -> None:
    """Steps of a sweep are fractions of the time in which the driven four-bar turns once. Rounded numbers of
    steps leave the ratio within 0.4 to 0.6. Both scenes have no given velocities."""
    scene = SCENES["four_bar"]()
    (driver,), at_rest = scene.driver, {"velocity": None, "angular_velocity": None}
    scene = scene.with_(body=[body.model_copy(update=at_rest) for body in scene.body])
    fast = scene.with_(driver=(driver.model_copy(update={"polynomial": (0.0, 2 * driver.polynomial[1])}),))
    sweeps = (engine(name).settings(each) for each in (scene, fast))
    steps = ([s.options["step"] for s in sweep if s.family == FIXED[name]] for sweep in sweeps)
    slow_steps, fast_steps = steps
    assert slow_steps
    assert all(0.4 < short / long < 0.6 for long, short in zip(slow_steps, fast_steps, strict=True))
