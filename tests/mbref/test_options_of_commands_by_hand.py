"""Options of mbref's commands / their values where nothing is asked for, and their limits, by hand."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref.cli import ensemble, options
from mbref.cli.commands import parser
from mbref.input_error import InputError
from mbref.scene import Body, Scene
from mbref.trajectory import Outcome

RUN = {"rtol": 1e-9, "code": "auto", "max_step": 0.0, "method": None, "json": False, "out": None}
WHEN = {"times": None, "samples": None, "duration": None}
FOUND = {"starts": 24, "number": None, "json": False, "out": None}
SCENE = Scene(
    name="s",
    body=(Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0)),),
    duration=2.0,
)


@pytest.mark.parametrize(
    ("words", "values"),
    [
        ("run s", {**RUN, **WHEN, "columns": [], "branch": [], "estimate": "auto", "scene": "s"}),
        ("run s --json --columns a b --branch 1=2 --branch 2=2", {"json": True, "branch": ["1=2", "2=2"]}),
        (
            "ensemble s --vary a=1:2",
            {**RUN, **WHEN, "count": 100, "seed": 0, "workers": None, "vary": ["a=1:2"]},
        ),
        ("diagnose s", {"start": False, "json": False}),
        ("diagnose s --start --json", {"start": True, "json": True}),
        ("equilibrium s", FOUND),
        ("modes s", {**FOUND, "mode": 1, "view": None}),
        ("modes s --json --mode 2 --starts 5", {"json": True, "mode": 2, "starts": 5}),
        ("assemble s", {"length": [], "out": None}),
        ("animate s", {**WHEN, "branches": False, "crossing": None, "rtol": 1e-9, "view": None, "out": None}),
        ("animate s --branches --crossing 3", {"branches": True, "crossing": 3}),
        ("draw s", {"view": None, "out": None}),
    ],
)
def test_values_of_options(words, values):
    found = vars(parser().parse_args(words.split()))
    assert {name: found[name] for name in values} == values
    if words.startswith("animate"):
        assert "json" not in found, "a picture is no text"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("ensemble s", "--vary"),
        ("export s", "--out"),
        ("", "COMMAND"),
        ("run s --times 1 --samples 2", "not allowed with"),
    ],
)
def test_options_that_are_needed(words, said, capsys):
    with pytest.raises(SystemExit) as end:
        parser().parse_args(words.split())
    assert end.value.code == 2 and said in capsys.readouterr().err


def times(**given: Any) -> list[float]:
    asked = argparse.Namespace(**{**WHEN, **given})
    return options.sample_times(asked, SCENE).tolist()


def test_sample_times_that_options_ask_for():
    """101 samples up to the scene's 2 s, two at least; given times are cut at the duration."""
    assert times() == pytest.approx(0.02 * np.arange(101)) and times(samples=2) == [0.0, 2.0]
    assert times(samples=3, duration=1.0) == [0.0, 0.5, 1.0]
    assert times(times="0,0.5,3") == [0.0, 0.5, 3.0] and times(times="0.5,1,3", duration=1.0) == [0.5, 1.0]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"duration": 0.0}, "--duration: must be positive, got 0"),
        ({"duration": np.inf}, "--duration: must be positive, got inf"),
        ({"samples": 1}, "--samples: must be at least 2, got 1"),
        ({"times": "1,x"}, "--times: must be numbers separated by commas, got '1,x'"),
        ({"times": "-1,2"}, "--times: must be finite, not negative and increasing, got -1,2"),
        ({"times": "1,1"}, "--times: must be finite, not negative and increasing, got 1,1"),
        ({"times": "1,3,2"}, "--times: must be finite, not negative and increasing, got 1,3,2"),
        ({"times": "1,nan"}, "--times: must be finite, not negative and increasing, got 1,nan"),
        ({"times": "2,3", "duration": 1.0}, "--times: none is within --duration 1"),
    ],
)
def test_sample_times_that_no_run_has(given, said):
    with pytest.raises(InputError) as fault:
        times(**given)
    assert str(fault.value) == said


def test_limits_and_the_options_that_set_them():
    asked = argparse.Namespace(rtol=1e-5, max_step=0.25, code="generic")
    found = options.limits_of(asked, {2: 1})
    assert (found.rtol, found.largest_step, found.code, found.branches) == (1e-5, 0.25, "generic", ((2, 1),))
    assert options.limits_of(asked).branches == ()
    with pytest.raises(InputError, match=r"^--rtol: "):
        options.limits_of(argparse.Namespace(rtol=-1.0, max_step=0.0, code="auto"))
    with pytest.raises(InputError, match=r"^--max-step: "):
        options.limits_of(argparse.Namespace(rtol=1e-9, max_step=-1.0, code="auto"))
    assert options.with_option("rtol: is bad: so") == "--rtol: is bad: so"
    assert options.with_option("no field") == "no field"


@pytest.mark.parametrize(("count", "workers"), [(0, None), (1, 0), (0, 1), (1, -1)])
def test_no_ensemble_of_no_variants_or_workers(monkeypatch, count, workers):
    monkeypatch.setattr(ensemble, "find_scene", lambda name: SCENE)
    monkeypatch.setattr(ensemble, "warn", lambda scene: None)
    asked = parser().parse_args(["ensemble", "s", "--vary", "body[b].mass=1:2"])
    asked.count, asked.workers = count, workers
    with pytest.raises(InputError, match="--count and --workers: must be at least 1"):
        ensemble._ensemble(asked)


@pytest.mark.parametrize(("count", "workers"), [(1, None), (1, 1), (2, 5)])
def test_an_ensemble_of_one_variant(monkeypatch, count, workers):
    def variants(scene: Scene, varied: Any, number: int, seed: int) -> None:
        raise KeyError((scene.name, [v.path for v in varied], number, seed))

    monkeypatch.setattr(ensemble, "find_scene", lambda name: SCENE)
    monkeypatch.setattr(ensemble, "warn", lambda scene: None)
    monkeypatch.setattr("mbref.variation.variants", variants)
    asked = parser().parse_args(["ensemble", "s", "--vary", "body[b].mass=1:2", "--seed", "7"])
    asked.count, asked.workers = count, workers
    with pytest.raises(KeyError) as end:
        ensemble._ensemble(asked)
    assert end.value.args == (("s", ["body[b].mass"], count, 7),)


def test_runs_of_an_ensemble_a_second(monkeypatch, capsys):
    """Two variants between 10 s and 14 s on the clock."""
    clock, reported = iter([10.0, 14.0]), list[Any]()

    @contextlib.contextmanager
    def shown(what: Any, end: Any = None) -> Iterator[Any]:
        reported.append((what, end))
        yield reported.append

    def spread(scene: Scene, end: float, completed: Any, rate: float, asked: Any) -> None:
        reported.append((scene.name, end, completed, rate, asked.count))

    runs = [SimpleNamespace(outcome=Outcome.COMPLETED), SimpleNamespace(outcome=Outcome.COMPLETED)]
    monkeypatch.setattr(ensemble, "find_scene", lambda name: SCENE)
    monkeypatch.setattr(ensemble, "warn", lambda scene: None)
    monkeypatch.setattr(ensemble, "time", SimpleNamespace(perf_counter=lambda: next(clock)))
    monkeypatch.setattr(ensemble, "progress_bar", shown)
    monkeypatch.setattr(ensemble, "_show_spread", spread)
    monkeypatch.setattr("mbref.ensembles.processes.processes", shown)
    monkeypatch.setattr(
        "mbref.ensembles.ensemble.ensemble", lambda *given: iter([(1, runs[1]), (0, runs[0])])
    )
    words = [
        "ensemble",
        "s",
        "--vary",
        "body[b].mass=1:2",
        "--count",
        "2",
        "--workers",
        "3",
        "--times",
        "1,2",
    ]
    assert ensemble._ensemble(parser().parse_args(words)) == 0
    assert reported == [(3, None), ("simulating", 2), 1, 2, ("s", 2.0, runs, 0.5, 2)]
