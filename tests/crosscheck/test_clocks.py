"""The clock of every adapter / a clock that ticks once a look: stepping is CPU time, apart from building."""

from __future__ import annotations

import itertools
import time
from importlib.util import find_spec

import numpy as np
import pytest

from crosscheck.engine import Setting, engine
from mbref.scenes import SCENES
from mbref.trajectory import Outcome

RUNS = {  # engine and family: options, scene, the module that the engine needs
    ("mujoco", "stock"): ({"step": 1e-3}, "planar_slider_crank_gravity", "mujoco"),
    ("mujoco", "forward"): (
        {"rtol": 1e-4, "min_step": 1e-6, "beta": 50.0, "hard": 1e-7},
        "planar_slider_crank_gravity",
        "mujoco",
    ),
    ("pinocchio", "baumgarte"): ({"step": 1e-3}, "planar_slider_crank_gravity", "pinocchio"),
    ("pinocchio", "tuned"): ({"rtol": 1e-4, "min_step": 1e-6}, "planar_slider_crank_gravity", "pinocchio"),
    ("exudyn", "trapezoidal"): ({"step": 1e-3}, "planar_slider_crank_gravity", "exudyn"),
    ("exudyn", "static"): ({"step": 1e-3}, "four_bar", "exudyn"),
    ("simbody", "merson"): ({"accuracy": 1e-4}, "planar_slider_crank_gravity", "opensim"),
    ("ondsel", "kinematics"): ({"step": 1e-3}, "four_bar", "pyondsel"),
}


@pytest.mark.parametrize("name", RUNS, ids=" ".join)
def test_seconds_are_ticks_of_the_cpu_clock(name: tuple[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    """The CPU clock gives 1, 2, 3, …: its differences are whole and positive, a wall clock's are not."""
    options, scene_name, module = RUNS[name]
    if not find_spec(module):
        pytest.skip(f"{module} is not installed")
    ticks = itertools.count(1)
    scene = SCENES[scene_name]().with_(duration=0.01)
    simulator = engine(name[0])
    simulator.prepare([name[1]])
    monkeypatch.setattr(time, "process_time", lambda: float(next(ticks)))
    run = simulator.run(scene, np.linspace(0.0, 0.01, 3), Setting(name[1], options))
    looked = next(ticks) - 1
    assert run.outcome is Outcome.COMPLETED, run.message
    for seconds in (run.cost.seconds, run.cost.build_seconds):
        assert seconds == round(seconds) and seconds >= 1.0, run.cost
    assert run.cost.seconds + run.cost.build_seconds <= looked, "an interval counts once"
