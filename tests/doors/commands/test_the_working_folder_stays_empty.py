"""Commands write nothing into the working folder: no logs of engines, no folders of their solvers."""

from __future__ import annotations

import os

import pytest

from crosscheck.cli import main as crosscheck
from mbref.cli import main as mbref

NOT_A_NUMBER = """<mujoco><worldbody><body name="a"><joint name="j" axis="0 nan 0"/>
<inertial pos="0 0 1" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>"""
NEARLY_SINGULAR = """<mujoco><worldbody><body name="a"><joint axis="0 1 0"/>
<inertial pos="0 0 1" mass="1e6" diaginertia="1 1 1"/><body name="b"><joint axis="0 1 0"/>
<inertial pos="0 0 0" mass="1e-12" diaginertia="1e-13 1e-13 1e-13"/></body></body></worldbody></mujoco>"""


@pytest.mark.parametrize("text", [NOT_A_NUMBER, NEARLY_SINGULAR])
def test_an_import_with_warnings_leaves_the_scene_file_alone(text, tmp_path, monkeypatch, capfd):
    file, here = tmp_path / "a.xml", tmp_path / "here"
    file.write_text(text)
    here.mkdir()
    monkeypatch.chdir(here)
    mbref(["import", str(file), "--out", str(tmp_path / "a.toml")])
    assert "WARNING" not in "".join(capfd.readouterr())
    assert not os.listdir(here)


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["four_bar", "four_bar_gravity"])
def test_runs_of_engines_leave_nothing(scene, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    engines = [word for name in ("mbref", "mujoco", "pinocchio", "exudyn") for word in ("--engine", name)]
    crosscheck(["run", scene, *engines, "--samples", "3", "--duration", "0.01"])
    crosscheck(["modes", "planar_slider_crank_gravity", *engines[2:]])
    assert not os.listdir(tmp_path)
