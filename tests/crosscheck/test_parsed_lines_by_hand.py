"""Command lines of crosscheck / what each command and option is parsed to, written down."""

from __future__ import annotations

import argparse
from typing import Any

import pytest

from crosscheck.cli import options
from crosscheck.cli.parser import parser
from crosscheck.closed_loops.records import FILE
from crosscheck.convergence.ladders import FILE as LADDERS
from mbref import formats

READING = argparse.ArgumentParser()
formats.add_options(READING)
FILES = vars(READING.parse_args([]))  # how files of other programs are read
LIMITS = {"time_limit": 60.0, "reference_time": 20.0, "json": False}
SELECTION = {
    "engine": None,
    "method": None,
    "setting": None,
    "option": None,
    "depth": "quick",
    "times": None,
    "samples": None,
    "rtol": None,
    "duration": None,
    **LIMITS,
    "time_limit": None,
    **FILES,
}
STORED = {"run": False, "engine": None, "page": None}
DEFAULTS: dict[str, dict[str, Any]] = {
    "list": {"what": None},
    "run a b": {"scene": ["a", "b"], **SELECTION},
    "compare a": {"scene": ["a"], "repeats": 5, **SELECTION},
    "tune mujoco a": {
        "engine": "mujoco",
        "scene": "a",
        "error": 1e-6,
        "closure": None,
        "duration": None,
        **LIMITS,
        **FILES,
    },
    "verify e": {
        "engine": "e",
        "scene": None,
        "family": "",
        "in_process": False,
        "mechanisms": None,
        "first_seed": 0,
        "records": None,
        "beside": None,
        **LIMITS,
    },
    "findings": {"name": [], "recheck": False},
    "closed-loops": {**STORED, "records": str(FILE), "family": None},
    "convergence": {**STORED, "records": str(LADDERS)},
    "modes": {"scene": None, "engine": None, "starts": 16, "run": False, "page": None, "json": False},
    "report": {
        "scene": [],
        "engine": None,
        "depth": "quick",
        "section": None,
        "out": "report",
        "render": None,
        "reference_time": 20.0,
    },
    "paper": {"depth": "quick", "out": "paper"},
    "diff a b": {"old": "a", "new": "b", "all": False},
    "certify a": {"scene": "a", "digits": 20, "samples": 3, "duration": None, "out": None},
    "judge a t": {
        "scene": "a",
        "table": "t",
        "column": [],
        "unit": [],
        "tolerance": 1e-8,
        "quaternion": "wxyz",
        "reference_time": 20.0,
        "json": False,
    },
    "reference a --out r.csv": {
        "scene": "a",
        "out": "r.csv",
        "times": None,
        "samples": 101,
        "duration": None,
        "reference_time": 20.0,
    },
}


def parsed(line: str) -> dict[str, Any]:
    return vars(parser().parse_args(line.split()))


@pytest.mark.parametrize("line", DEFAULTS)
def test_a_command_without_options(line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = parsed(line)
    assert found.pop("version") is False and found.pop("command") == line.split()[0]
    assert found.pop("parser_of_command").prog == f"crosscheck {line.split()[0]}"
    assert found.pop("action") is None
    assert {k: str(v) if k == "out" and v else v for k, v in found.items()} == DEFAULTS[line]


@pytest.mark.parametrize(
    ("line", "name", "value"),
    [
        ("run a --engine x --engine y", "engine", ["x", "y"]),
        ("run a --method m --method n", "method", ["m", "n"]),
        ("run a --setting f", "setting", ["f"]),
        ("run a --option step=0.5 --option kind=fast", "option", [("step", 0.5), ("kind", "fast")]),
        ("run a --depth whole", "depth", "whole"),
        ("run a --times 0,0.5,2", "times", [0.0, 0.5, 2.0]),
        ("run a --samples 7", "samples", 7),
        ("run a --rtol 1e-5", "rtol", 1e-5),
        ("run a --duration 2.5", "duration", 2.5),
        ("run a --time-limit 9", "time_limit", 9.0),
        ("run a --reference-time 0", "reference_time", 0.0),
        ("run a --json", "json", True),
        ("compare a --repeats 8", "repeats", 8),
        ("tune mujoco a --error 1e-4", "error", 1e-4),
        ("tune mujoco a --closure 1mm", "closure", 1e-3),
        ("tune mujoco a --closure 2", "closure", 2.0),
        ("tune mujoco a --time-limit 3", "time_limit", 3.0),
        ("verify e --scene s --scene t", "scene", ["s", "t"]),
        ("verify e --family f", "family", "f"),
        ("verify e --in-process", "in_process", True),
        ("verify e --mechanisms 12", "mechanisms", 12),
        ("verify e --first-seed 3", "first_seed", 3),
        ("verify e --beside x=y --beside z", "beside", ["x=y", "z"]),
        ("findings drift jump", "name", ["drift", "jump"]),
        ("findings --recheck", "recheck", True),
        ("closed-loops --run", "run", True),
        ("closed-loops --family f --family g", "family", ["f", "g"]),
        ("closed-loops --records r", "records", "r"),
        ("convergence --engine e", "engine", ["e"]),
        ("modes a --starts 4", "starts", 4),
        ("modes --run", "run", True),
        ("report a b", "scene", ["a", "b"]),
        ("report --quick", "depth", "quick"),
        ("report --depth whole --quick", "depth", "quick"),
        ("report --depth whole", "depth", "whole"),
        ("report --section s --section t", "section", ["s", "t"]),
        ("report --render d", "render", "d"),
        ("paper --depth whole", "depth", "whole"),
        ("diff a b --all", "all", True),
        ("certify a --digits 35", "digits", 35),
        ("certify a --samples 9", "samples", 9),
        ("judge a t --column x=2 --column y=3", "column", ["x=2", "y=3"]),
        ("judge a t --unit mm --unit deg", "unit", ["mm", "deg"]),
        ("judge a t --tolerance 0", "tolerance", 0.0),
        ("judge a t --quaternion xyzw", "quaternion", "xyzw"),
        ("reference a --out r.csv --times 0,1", "times", [0.0, 1.0]),
        ("reference a --out r.csv --samples 5", "samples", 5),
        ("list engines", "what", "engines"),
        ("--version", "version", True),
    ],
)
def test_an_option(line, name, value, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert parsed(line)[name] == value


@pytest.mark.parametrize(
    "line",
    [
        "run",
        "run a --times 0,1 --samples 3",
        "run a --depth deep",
        "run a --option step",
        "tune mujoco a --error 1e-3 --closure 1mm",
        "tune mujoco a --error 0",
        "tune mujoco a --closure 1kg",
        "tune mujoco a --closure -1mm",
        "verify e --mechanisms 0",
        "verify e --mechanisms 1.5",
        "certify a --digits 3",
        "certify a --digits 101",
        "judge a t --tolerance -1",
        "judge a t --tolerance inf",
        "judge a t --quaternion zyx",
        "reference a",
        "reference a --out r.csv --times 0,x",
        "report --sect s",
    ],
)
def test_lines_that_are_refused(line, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        parsed(line)
    assert ended.value.code == 2 and capsys.readouterr().err


@pytest.mark.parametrize(
    ("parse", "text", "value"),
    [
        (options.digits, "4", 4),
        (options.digits, "100", 100),
        (options.whole, "1", 1),
        (options.not_negative, "0", 0.0),
        (options.positive, "1e-300", 1e-300),
        (options.length, "2 cm", 0.02),
        (options.length, "0.25", 0.25),
        (options.numbers, "1,-2.5", [1.0, -2.5]),
    ],
)
def test_values_at_the_ends_of_their_ranges(parse, text, value):
    assert parse(text) == pytest.approx(value)


@pytest.mark.parametrize(
    ("parse", "text", "says"),
    [
        (options.positive, "0", "must be positive, got 0"),
        (options.positive, "inf", "must be positive, got inf"),
        (options.positive, "x", "must be a number, got 'x'"),
        (options.not_negative, "-0.5", "must be finite and not negative, got -0.5"),
        (options.not_negative, "nan", "must be finite and not negative, got nan"),
        (options.whole, "0", "must be a positive whole number, got 0"),
        (options.digits, "3", "must be from 4 to 100, got 3"),
        (options.numbers, "1;2", "must be numbers separated by commas, got '1;2'"),
    ],
)
def test_values_outside_their_ranges(parse, text, says):
    with pytest.raises(argparse.ArgumentTypeError) as refused:
        parse(text)
    assert str(refused.value) == says
