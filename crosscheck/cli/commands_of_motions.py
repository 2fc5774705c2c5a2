"""Parsers of the commands for one motion: certify, judge and reference."""

from __future__ import annotations

import argparse
from textwrap import fill
from typing import Any

from crosscheck.cli.options import (
    DIGITS,
    MOST_ERROR,
    add_duration,
    add_reference_time,
    add_samples,
    digits,
    numbers,
)
from crosscheck.judge.tolerances import FLOOR
from mbref.command_line import add_output, number

Commands = Any  # the object that argparse adds subcommands to; its type is private


def add_command(commands: Commands, name: str, about: str, example: str) -> argparse.ArgumentParser:
    """Add the parser of a command with its description and an example."""
    return commands.add_parser(
        name,
        help=about,
        description=fill(about, 79),
        epilog=f"example:\n  {example}",
        allow_abbrev=False,
    )


def add_certify(commands: Commands) -> None:
    """Add the parser of `crosscheck certify`."""
    example = "crosscheck certify four_bar_gravity --digits 20 --duration 0.1 --out four_bar_gravity.json"
    about = "the motion of a scene to many digits, on which two formulations agree (needs python-flint)"
    parser = add_command(commands, "certify", about, example)
    parser.add_argument("scene", metavar="SCENE", help="a built-in name, a .toml file, or random_N")
    parser.add_argument("--digits", type=digits, default=20, metavar="N", help=f"{DIGITS}; default: 20")
    add_samples(parser, 3)
    add_duration(parser)
    add_output(parser, "--out", metavar="FILE", help="default: standard output")


def add_judge(commands: Commands) -> None:
    """Add the parser of `crosscheck judge`."""
    example = "crosscheck judge four_bar.toml run.csv --unit mm --unit deg --column coupler.position.x=2"
    about = (
        "compare a motion recorded by any tool with the reference: print the error of each column, its "
        "bound, its begin and likely causes; exit status 0 if all columns are right, otherwise 1"
    )
    parser = add_command(commands, "judge", about, example)
    parser.add_argument("scene", metavar="SCENE", help="a built-in name or a .toml file")
    parser.add_argument("table", metavar="TABLE", help="a table with a column of times, such as run.csv")
    parser.add_argument(
        "--column",
        action="append",
        default=[],
        metavar="NAME=PLACE[:UNIT]",
        help="a column of the scene or `time`, and its number (from 1) or header in the table; may repeat",
    )
    parser.add_argument(
        "--unit",
        action="append",
        default=[],
        metavar="U",
        help="unit of all columns of its quantity, such as mm, deg, mm/s or rpm; may repeat; default: SI",
    )
    parser.add_argument(
        "--tolerance",
        type=number(MOST_ERROR, zero=True),
        default=FLOOR,
        metavar="E",
        help="largest error of a right column, relative to the mechanism's length, 1 rad, or the largest "
        "velocity of a body (default: %(default)g); 0: the bound on the reference alone",
    )
    parser.add_argument(
        "--quaternion", choices=("wxyz", "xyzw"), default="wxyz", help="order of quaternion columns"
    )
    add_reference_time(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")


def add_reference(commands: Commands) -> None:
    """Add the parser of `crosscheck reference`."""
    example = "crosscheck reference four_bar.toml --out ref.csv --samples 201"
    about = "write the reference motion with the bound on its error as a table for other tools"
    parser = add_command(commands, "reference", about, example)
    parser.add_argument("scene", metavar="SCENE", help="a built-in name or a .toml file")
    add_output(parser, "--out", required=True, metavar="FILE", help="the .csv file")
    when = parser.add_mutually_exclusive_group()
    when.add_argument("--times", type=numbers, metavar="a,b,c", help="sample times (s), increasing")
    add_samples(when, 101)
    add_duration(parser)
    add_reference_time(parser)
