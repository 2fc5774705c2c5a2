"""Commands leave the working folder empty: no logs of engines, no folders of their solvers."""

import os

import pytest

from crosscheck.cli import main as crosscheck
from mbref.cli import main as mbref

NOT_A_NUMBER = """<mujoco><worldbody><body name="a"><joint name="j" axis="0 nan 0"/>
<inertial pos="0 0 1" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>"""
NEARLY_SINGULAR = """<mujoco><worldbody><body name="a"><joint axis="0 1 0"/>
<inertial pos="0 0 1" mass="1e6" diaginertia="1 1 1"/><body name="b"><joint axis="0 1 0"/>
<inertial pos="0 0 0" mass="1e-12" diaginertia="1e-13 1e-13 1e-13"/></body></body></worldbody></mujoco>"""


# the armature cancels the inertia about the hinge, 1 + 1 · 1² kg m²
CANCELLED = NOT_A_NUMBER.replace("0 nan 0", "0 1 0").replace("<joint", '<joint armature="-2"')
IMPORT, FILES = (mbref, "import", "--out", "../a.toml"), (crosscheck, "files", "--engine", "mujoco")


@pytest.mark.parametrize(
    ("command", "text", "status"),
    [
        pytest.param(IMPORT, NOT_A_NUMBER, 2, id="refused"),
        pytest.param(IMPORT, NEARLY_SINGULAR, 0, id="imported"),
        pytest.param(FILES, CANCELLED, 0, id="compared", marks=pytest.mark.slow),
    ],
)
def test_file_that_mujoco_warns_about_leaves_no_log(command, text, status, tmp_path, monkeypatch, capfd):
    """MuJoCo writes warnings to the terminal and to MUJOCO_LOG.TXT in the working folder: here of an axis
    that is no number, of a nearly singular mass matrix, and of an inertia that the armature cancels."""
    (tmp_path / "a.xml").write_text(text)
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    program, *words = command
    assert program([*words, "../a.xml"]) == status
    assert "WARNING" not in "".join(capfd.readouterr())
    assert not os.listdir()


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["four_bar", "four_bar_gravity"])
def test_runs_and_modes_of_engines_leave_no_file(scene, tmp_path, monkeypatch):
    """The statuses show that no command was refused (2): Exudyn's defaults end early, which gives 1, and
    `modes`, which asks all engines but mbref, finds equilibria, which gives 0."""
    monkeypatch.chdir(tmp_path)
    engines = [word for name in ("mbref", "mujoco", "pinocchio", "exudyn") for word in ("--engine", name)]
    assert crosscheck(["run", scene, *engines, "--samples", "3", "--duration", "0.01"]) == 1
    assert crosscheck(["modes", "planar_slider_crank_gravity", *engines[2:]]) == 0
    assert not os.listdir(tmp_path)
