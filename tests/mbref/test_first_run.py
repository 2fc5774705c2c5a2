"""The first run on a machine: interpreted kernels race the compilation of the method's kernels."""

import contextlib
import os
import time

import numpy as np
import pytest

from mbref.cli import first_run
from mbref.cli.commands import main
from mbref.method import SPARSE
from mbref.scene import SceneError
from mbref.scenes import SCENES
from mbref.simulation import simulate as compiled
from mbref.stepping.limits import Limits

TIMES = np.linspace(0.0, 0.05, 6)


def for_ever(*_arguments):
    """In place of a process's work."""
    time.sleep(600)


def nothing(*_arguments):
    """In place of a process's work."""


def crash(*_arguments):
    """In place of a process's work."""
    os._exit(1)


@pytest.fixture(autouse=True)
def cold(monkeypatch):
    """A machine of two processors that has no compiled kernels, on which compiling takes for ever."""
    monkeypatch.delenv(first_run.INTERPRETED, raising=False)
    monkeypatch.setattr(first_run, "are_compiled", lambda method: False)
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    monkeypatch.setattr(first_run, "_compile", for_ever)


def motion(method=SPARSE, scene=None):
    """The motion, and the times told as progress; an interrupt ends the wait for the compilation."""
    found, told = [], []
    with contextlib.suppress(KeyboardInterrupt), first_run.simulator(method) as simulate:
        found.append(simulate(scene or SCENES["four_bar_gravity"](), method, TIMES, Limits(), told.append))
        raise KeyboardInterrupt
    return found[0], told


def test_interpreted_kernels_give_the_same_motion_before_kernels_are_compiled():
    found, told = motion()
    expected = compiled.simulate(SCENES["four_bar_gravity"](), SPARSE, TIMES, Limits())
    assert found.settings["kernels"] == "interpreted" and told == [TIMES[-1]]
    assert "kernels" not in expected.settings
    np.testing.assert_allclose(found.position, expected.position, rtol=0, atol=1e-9)


@pytest.mark.parametrize("work", [for_ever, crash])
def test_compiled_kernels_take_over_where_they_are_ready_before(monkeypatch, work):
    monkeypatch.setattr(first_run, "_compile", nothing)
    monkeypatch.setattr(first_run, "_interpret", work)
    found, told = motion()
    assert "kernels" not in found.settings and told == [TIMES[-1]]


def test_faults_of_a_scene_are_told_by_the_interpreted_run():
    scene = SCENES["four_bar_gravity"]()
    bare = scene.with_(body=tuple(b.model_copy(update={"mass": None, "inertia": None}) for b in scene.body))
    with pytest.raises(SceneError, match="has no mass and inertia"):
        motion(scene=bare)


def test_the_command_waits_for_the_compilation_after_its_result(monkeypatch, capsys):
    monkeypatch.setattr(first_run, "_compile", nothing)
    assert main(["run", "four_bar", "--times", "0.001", "--method", "alf+none"]) == 0
    said = capsys.readouterr()
    assert "COMPLETED" in said.out and "meanwhile they are interpreted" in said.err


def test_one_processor_compiles_first(monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    with first_run.simulator(SPARSE) as simulate:
        assert simulate is compiled.simulate
