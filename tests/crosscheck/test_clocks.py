"""The clock of every family of each adapter / a clock that ticks once a look.

Stepping is CPU time, apart from building.  A run over three samples looks twice for building, and twice for
each sample, or twice for all.
"""

from __future__ import annotations

import itertools
import time

import numpy as np
import pytest

from crosscheck.cli.scene_request import find_scenes
from crosscheck.engine import Setting, engine
from crosscheck.study.search.offers import of_file
from mbref.formats import ImportOptions
from mbref.scene import Scene
from mbref.scenes import SCENES
from mbref.trajectory import Outcome
from tests.crosscheck.driven_arm import ENGINES, able, coarsest, driven_arm

IN_ONE_CALL = ("mbref", "exudyn", "casadi", "heyoka")  # other engines step from sample to sample
BUILD, STEPPING = 1.0, 3.0
OTHER_TICKS = {  # building and stepping of families that look at the clock at other places
    ("mbref", "taylor, generated"): (3.0, 1.0),  # generating the code is building, too
    ("exudyn", "tuned"): (3.0, 3.0),  # three runs with different steps
}


@pytest.mark.parametrize(("name", "part"), ENGINES)
def test_seconds_are_ticks_of_the_cpu_clock(name: str, part: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The CPU clock gives 1, 2, 3, …; a wall clock gives fractions, an interval that counts twice more."""
    scene = able(name, driven_arm(), SCENES["planar_slider_crank_gravity"]().with_(duration=0.01))
    for setting in coarsest(name, scene, part):
        own = OTHER_TICKS.get((name, setting.family))
        is_one_call = name in IN_ONE_CALL or setting.family.endswith("compiled")
        check(name, scene, setting, own or (BUILD, 1.0 if is_one_call else STEPPING), monkeypatch)


def check(
    name: str, scene: Scene, setting: Setting, ticks: tuple[float, float], patch: pytest.MonkeyPatch
) -> None:
    clock = itertools.count(1)
    with patch.context() as patched:
        patched.setattr(time, "process_time", lambda: float(next(clock)))
        run = engine(name).run(scene, np.array([0.0, 0.005, 0.01]), setting)
    assert run.outcome is Outcome.COMPLETED, run.message
    assert (run.cost.build_seconds, run.cost.seconds) == ticks, setting


def test_the_model_of_a_file_is_run_by_the_cpu_clock(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    pendulum = '<body name="b"><joint type="hinge" axis="0 1 0"/><geom size="0.1" pos="0 0 -1"/></body>'
    path = tmp_path / "pendulum.xml"
    path.write_text(f"<mujoco><worldbody>{pendulum}</worldbody></mujoco>")
    [scene] = find_scenes([str(path)], ImportOptions())
    setting = of_file("mujoco", scene)[0]
    check("mujoco", scene, setting, (BUILD, STEPPING), monkeypatch)
