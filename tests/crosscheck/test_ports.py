"""MuJoCo's ports / MuJoCo in C at the same settings, and truth; their code is compiled for minutes first."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest

from crosscheck.engine import Owner, Setting, engine
from crosscheck.findings.finding import FOLDER
from crosscheck.judge.metrics import error_series
from crosscheck.judge.truth import truth_for
from mbref.scene import Scene
from mbref.scenes import SCENES
from mbref.trajectory import Outcome
from tests.crosscheck.measured import MARGIN

MODULES = {"mjx": "mujoco.mjx", "warp": "mujoco_warp"}
IN_C = 8.2e-9  # error of MuJoCo in C over 0.05 s at a step of 1 ms
LOOP = {"mjx": 6.1e-6, "warp": 1.4e-7}  # MJX leaves J' v out of the closures; Warp rounds to single precision


def is_installed(module: str) -> bool:
    package, _, _ = module.partition(".")
    return bool(find_spec(package)) and bool(find_spec(module))


@pytest.mark.parametrize("name", MODULES)
def test_drivers_are_refused_by_name(name: str) -> None:
    refusal = engine(name).cannot(SCENES["four_bar"]())
    assert refusal is not None and refusal.owner is Owner.ENGINE and "callback" in refusal.reason, refusal
    assert engine(name).cannot(SCENES["four_bar_gravity"]()) is None


@pytest.mark.slow
@pytest.mark.parametrize("name", MODULES)
def test_a_port_and_mujoco_in_c(name: str) -> None:
    """The start is MuJoCo's, and the loop moves as measured."""
    if not is_installed(MODULES[name]):
        pytest.skip(f"{MODULES[name]} is not installed")
    scene = Scene.from_file(FOLDER / "ball_four_bar.toml").with_(duration=0.05)
    times, setting = np.linspace(0, scene.duration, 11), Setting("stock", {"step": 1e-3})
    exact = truth_for(scene).poses(times)
    for simulator, measured in (("mujoco", IN_C), (name, LOOP[name])):
        run = engine(simulator).run(scene, times, setting)
        assert run.outcome is Outcome.COMPLETED, run.message
        off = float(error_series(scene, run, exact).max())
        assert off < MARGIN * measured, f"{simulator}: {off:.1e} from the truth"
