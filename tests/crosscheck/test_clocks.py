"""Costs of runs are CPU seconds, of building and of stepping, in every family of each adapter. A clock that
advances by 1 s at each reading replaces the CPU clock. It is read at the start and end of building: 1 s. It
is read at the start and end of stepping to each of three samples, 3 s, or to all, 1 s."""

import itertools
import time

import numpy as np
import pytest

from crosscheck.cli.scene_request import find_scenes
from crosscheck.engine import engine
from crosscheck.study.search.offers import of_file
from mbref.formats import ImportOptions
from mbref.motions.trajectory import Outcome
from mbref.scenes import SCENES
from tests.crosscheck.driven_arm import ENGINES, able, coarsest, driven_arm

IN_ONE_CALL = ("mbref", "exudyn", "casadi", "heyoka")  # other engines step from sample to sample
BUILD, STEPPING = 1.0, 3.0  # s
OTHER_TICKS = {  # building and stepping (s) of families that read the clock at other places
    ("mbref", "taylor, generated"): (3.0, 1.0),  # code is generated in the middle of building
    ("exudyn", "tuned"): (3.0, 3.0),  # three runs with different steps
}


@pytest.mark.parametrize(("name", "part"), ENGINES)
def test_cost_of_a_run_is_cpu_time_of_building_and_of_stepping(name, part, monkeypatch):
    """The CPU clock of `ticks` advances 1 s at each reading. It is read at the start and end of building, and
    of each of three intervals of stepping, or of one call for all; OTHER_TICKS has families that read it more
    often. A wall clock would give fractions of a second."""
    scene = able(name, driven_arm(), SCENES["planar_slider_crank_gravity"]().with_(duration=0.01))
    for setting in coarsest(name, scene, part):
        own = OTHER_TICKS.get((name, setting.family))
        is_one_call = name in IN_ONE_CALL or setting.family.endswith("compiled")
        expected = own or (BUILD, 1.0 if is_one_call else STEPPING)
        assert ticks(name, scene, setting, monkeypatch) == expected, setting


def ticks(name, scene, setting, patch):
    """Return the costs of building and stepping by a clock of CPU time that ticks 1 s at each reading."""
    clock = itertools.count(1)
    with patch.context() as patched:
        patched.setattr(time, "process_time", lambda: float(next(clock)))
        run = engine(name).run(scene, np.array([0.0, 0.005, 0.01]), setting)
    assert run.outcome is Outcome.COMPLETED, run.message
    return run.cost.build_seconds, run.cost.seconds


def test_cost_of_a_run_of_a_files_own_model_is_cpu_time(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By the clock of `ticks`, building takes 1 s and stepping to three samples 3 s."""
    pendulum = '<body name="b"><joint type="hinge" axis="0 1 0"/><geom size="0.1" pos="0 0 -1"/></body>'
    path = tmp_path / "pendulum.xml"
    path.write_text(f"<mujoco><worldbody>{pendulum}</worldbody></mujoco>")
    [scene] = find_scenes([str(path)], ImportOptions())
    setting = of_file("mujoco", scene)[0]
    assert ticks("mujoco", scene, setting, monkeypatch) == (BUILD, STEPPING)
