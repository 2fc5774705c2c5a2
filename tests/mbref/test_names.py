"""Names with the characters of markup, paths and other alphabets, in tables and on command lines."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from mbref.cli import main
from mbref.cli.run import show
from mbref.motion import Motion
from mbref.scene import Body, Scene
from mbref.trajectory import Trajectory

NAMES = (
    "[red]x[/]",
    "[/nothing]",
    "$x_1$",
    "../../up",
    "a/b",
    "<b>&amp;</b>",
    "a|b",
    "Türe α",
    "%s {0}",
    "ground ",
)


@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_shown_as_it_is(name: str, capsys: pytest.CaptureFixture[str]):
    body = Body(name=name, mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
    still = np.zeros((1, 1, 3))
    first = (name, "mbref", "1", name, {}, np.zeros(1), (name,))
    turn = np.array([[[1.0, 0.0, 0.0, 0.0]]])
    run = Trajectory(*first, still, turn, still, still, message=name)
    scene = Scene(name=name, body=(body,))
    show(scene, Motion.of(scene, run))
    out = capsys.readouterr().out
    assert out.count(name.strip()) >= 4, out


@pytest.mark.parametrize("name", NAMES)
def test_a_scene_of_that_name_is_diagnosed(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    body = Body(name=name, mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
    Scene(name=name, body=(body,)).save(tmp_path / "scene.toml")
    assert main(["diagnose", str(tmp_path / "scene.toml"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["scene"] == name


@pytest.mark.parametrize("name", ["x" * 5000, "a\nb", ".", "..", "/", ""])
def test_a_scene_that_is_no_file_is_bad_input(name: str, capsys: pytest.CaptureFixture[str]):
    assert main(["diagnose", name]) == 2
    assert "Traceback" not in capsys.readouterr().err
