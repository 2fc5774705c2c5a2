"""Names with the characters of markup, paths and other alphabets, in tables and on command lines."""

import numpy as np
import pytest

from mbref.cli import main
from mbref.cli.run import show
from mbref.motions.motion import Motion
from mbref.motions.trajectory import Trajectory
from mbref.scene import Body, Scene

NAMES = (
    *("[red]x[/]", "[/nothing]", "$x_1$", "../../up", "a/b"),
    *("<b>&amp;</b>", "a|b", "Türe α", "%s {0}", "ground "),
)


@pytest.mark.parametrize("name", NAMES)
def test_run_s_table_shows_a_name_literally(name: str, capsys: pytest.CaptureFixture[str]):
    """The scene, its body, the method and the message of the run have this name: it is shown four times.
    NAMES look like markup of terminals, HTML and formulas, or like paths."""
    body = Body(name=name, mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
    still = np.zeros((1, 1, 3))
    first = (name, "mbref", "1", name, {}, np.zeros(1), (name,))
    turn = np.array([[[1.0, 0.0, 0.0, 0.0]]])
    run = Trajectory(*first, still, turn, still, still, message=name)
    scene = Scene(name=name, body=(body,))
    show(scene, Motion.of(scene, run))
    out = capsys.readouterr().out
    assert out.count(name.strip()) >= 4, out


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("x" * 5000, "x: File name too long"),
        ("a\nb", r"unknown scene 'a\nb'"),
        (".", ".: cannot be read: Is a directory"),
        ("/", "/: cannot be read: Is a directory"),
        ("", "unknown scene ''"),
    ],
)
def test_name_of_no_scene_and_no_file_is_refused_in_one_line(name, says, capsys: pytest.CaptureFixture[str]):
    """Messages have less than 700 characters, also for a name of 5000; the status is 2."""
    assert main(["diagnose", name]) == 2
    said = capsys.readouterr().err
    assert says in said and said.count("\n") == 1 and len(said) < 700
