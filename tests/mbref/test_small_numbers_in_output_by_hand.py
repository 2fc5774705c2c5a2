"""Small numbers that commands print, and files that they write / texts worked out by hand."""

from __future__ import annotations

import argparse
import platform
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import mbref
from mbref.cli import commands, main, pictures, plotting, scene_files, statics
from mbref.design.assemble import Assembled
from mbref.input_error import InputError
from mbref.scenes import find_scene
from mbref.simulation.simulate import SAMPLES
from mbref.trajectory import Outcome


def test_nine_decimals_of_vectors_are_printed():
    """Half of a unit of the ninth decimal is rounding, and a zero has no sign."""
    assert statics._three([4e-10, -4e-10, 1.5]) == "(0, 0, 1.5)"
    assert statics._three([6e-10, -6e-10, 1234567.0]) == "(1e-09, -1e-09, 1.23457e+06)"


def test_twelve_decimals_of_eigenvalues_are_printed():
    made: Any = SimpleNamespace(
        eigenvalues=np.array([complex(4e-13, -2.0), complex(-4e-13, 6e-13)]),
        frequencies=np.array([0.25]),
        damping_ratios=np.array([0.5]),
        stability="stable",
        rate=0.0,
    )
    assert statics._mode_lines(4, made) == [
        "equilibrium 4: stable",
        "  eigenvalues, 1/s",
        "    +0 -2 i",
        "    +0 +1e-12 i",
        "  vibration 1: 0.25 Hz, damping ratio 0.5",
    ]


def test_displacements_of_an_assembly_that_are_rounding(monkeypatch, tmp_path, capsys):
    """1e-12 m or rad is not printed."""
    scene = find_scene("four_bar")
    bodies = {"a": (1e-12, 1e-12), "b": (2e-12, 1e-12), "c": (0.0, 3e-12)}
    found = Assembled(scene, {"A": 1e-12, "B": 1.5e-12}, bodies, {"A–B": (0.5, 0.25)})
    asked: list[Any] = []
    monkeypatch.setattr("mbref.design.assemble.assemble", lambda *given: asked.append(given) or found)
    out = str(tmp_path / "closed.toml")
    options = argparse.Namespace(scene="four_bar", length=["A-B=0.25", "D-C=0.5"], out=out)
    assert scene_files._assemble(options) == 0
    assert capsys.readouterr().out.splitlines() == [
        "length A–B: 0.5 m, now 0.25 m",
        "joint B: moved by 1.5e-12 m",
        "body b: moved by 2e-12 m",
        "body c: moved by 0 m, turned by 3e-12 rad",
        out,
    ]
    assert asked == [(scene, {("A", "B"): 0.25, ("D", "C"): 0.5})] and find_scene(out) == scene
    assert scene_files._assemble(argparse.Namespace(scene="four_bar", length=[], out=None)) == 0


@pytest.mark.parametrize("outcome", [Outcome.COMPLETED, Outcome.STEP_FAILED])
def test_a_plot_is_written_with_150_dots_an_inch(monkeypatch, capsys, outcome):
    calls: list[Any] = []
    figure = SimpleNamespace(savefig=lambda path, dpi: calls.append((str(path), dpi)))
    motion = SimpleNamespace(
        plot=lambda *names: calls.append(names) or figure, outcome=outcome, message="why"
    )

    def moved(check: Any) -> Any:
        if check is not None:
            check(SimpleNamespace(columns=lambda *names: calls.append(("checked", *names))))
        return motion

    monkeypatch.setattr(plotting, "request_of", lambda options: SimpleNamespace(motion=moved))
    options = argparse.Namespace(scene="s.toml", out=None, columns=["a", "b"])
    assert plotting._plot(options) == (outcome is not Outcome.COMPLETED)
    assert calls == [("checked", "a", "b"), ("a", "b"), ("s-plot.svg", 150)]
    assert capsys.readouterr().out.splitlines()[0] == "s-plot.svg"
    calls.clear()
    plotting._plot(argparse.Namespace(scene="s", out="x.png", columns=[]))
    assert calls == [(), ("x.png", 150)]

    def missing(*names: str) -> None:
        raise ImportError

    motion.plot = missing
    with pytest.raises(InputError, match="a plot needs matplotlib: pip install 'mbref"):
        plotting._plot(options)


def test_a_motion_along_a_branch_has_as_many_samples_as_a_run():
    assert pictures.BRANCH_SAMPLES == SAMPLES == 101


def test_versions_are_printed(capsys):
    with pytest.raises(SystemExit) as left:
        main(["--version"])
    printed = capsys.readouterr().out
    assert left.value.code in (None, 0)
    assert printed.startswith(f"mbref {mbref.__version__} (Python {platform.python_version()}, numpy ")
    assert [name for name in ("scipy", "numba") if f", {name} " in printed] == ["scipy", "numba"]
    assert commands._versions() == printed.strip()


def test_a_closed_pipe_and_a_full_disk(monkeypatch, capsys):
    """The reader of a pipe may leave early; a file that cannot be written is named."""

    def action(error: BaseException) -> Any:
        def fail(options: Any) -> int:
            raise error

        options = argparse.Namespace(action=fail, out="o.svg", scene="s")
        return SimpleNamespace(parse_args=lambda arguments: options)

    def status(error: BaseException) -> int:
        monkeypatch.setattr(commands, "parser", lambda: action(error))
        monkeypatch.setattr(commands.sys, "stdout", commands.sys.stdout)
        return commands.main([])

    assert status(OSError(28, "No space left on device")) == 2
    assert capsys.readouterr().err == "o.svg: No space left on device\n"
    assert status(OSError(13, "Permission denied", "a.svg")) == 2
    assert capsys.readouterr().err == "a.svg: Permission denied\n"
    assert status(KeyboardInterrupt()) == 130 and capsys.readouterr().err == "mbref: interrupted\n"
    assert status(BrokenPipeError()) == 1 and commands.sys.stdout is None
