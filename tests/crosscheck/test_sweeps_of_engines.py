"""Sweeps of the engines: every family coarse to fine, with documented options; other families are refused."""

import numpy as np
import pytest

from crosscheck.engine import Setting, engine, engine_names, installed
from mbref.scenes import SCENES

KNOBS = ("step", "rtol", "accuracy", "tolerance")  # a smaller number means a finer setting
SWEPT = ("planar_slider_crank_gravity", "four_bar")
KINEMATIC = "ondsel"  # moves scenes whose whole motion is driven
WITHOUT_RUNS = "casadi"  # its sweep runs compiled code, and that not beside OpenSim


def able(name: str, scene: str) -> bool:
    return engine(name).cannot(SCENES[scene]()) is None


@pytest.mark.parametrize("name", [n for n in engine_names() if n != WITHOUT_RUNS])
def test_families_are_swept_from_coarse_to_fine(name: str) -> None:
    """Within a family that serves the scene one option (step, tolerance, accuracy) falls over three settings
    or more; every option is in the engine's documented ones."""
    if not installed(name):
        pytest.skip(f"{name} is not installed")
    simulator, count = engine(name), 0
    for scene in filter(lambda scene: able(name, scene), SWEPT):
        settings = simulator.settings(SCENES[scene]())
        for family in dict.fromkeys(s.family for s in settings):
            found = [s.options for s in settings if s.family == family]
            assert family in simulator.families and simulator.serves(SCENES[scene](), family), family
            assert all(set(options) <= set(simulator.options) for options in found), (family, found)
            (knob,) = [k for k in found[0] if k in KNOBS and len({o[k] for o in found}) > 1]
            values = [options[knob] for options in found]
            assert values == sorted(set(values), reverse=True) and len(values) >= 3, (scene, family, values)
            count += 1
    assert count or name == KINEMATIC, "the engine swept no family"


@pytest.mark.parametrize("name", [n for n in engine_names() if n not in (WITHOUT_RUNS, "mbref")])
def test_engine_refuses_an_unknown_family_by_name(name: str) -> None:
    """No engine has a family "best"; the error names it and the engine."""
    if not installed(name):
        pytest.skip(f"{name} is not installed")
    with pytest.raises(ValueError, match=f"{name} has no family of settings 'best'"):
        engine(name).run(SCENES["bennett"](), np.array([0.0]), Setting("best", {}))


FIXED = {"mujoco": "tuned", "pinocchio": "proximal", "exudyn": "tuned"}  # families with fixed steps


@pytest.mark.parametrize("name", FIXED)
def test_scene_driven_twice_as_fast_has_steps_half_as_long(name: str) -> None:
    """Steps of the sweep are fractions of the time of a turn of the driven four-bar; gains and rounded
    numbers of steps leave the ratio within 0.4 to 0.6."""
    scene = SCENES["four_bar"]()
    (driver,), at_rest = scene.driver, {"velocity": None, "angular_velocity": None}
    scene = scene.with_(body=[body.model_copy(update=at_rest) for body in scene.body])
    fast = scene.with_(driver=(driver.model_copy(update={"polynomial": (0.0, 2 * driver.polynomial[1])}),))
    slow_steps, fast_steps = (
        [s.options.get("step", 1.0) for s in engine(name).settings(each) if s.family == FIXED[name]]
        for each in (scene, fast)
    )
    assert slow_steps
    assert all(0.4 < f / s < 0.6 for s, f in zip(slow_steps, fast_steps, strict=True))
