"""Options that several commands of crosscheck share."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from crosscheck.engine import ALL, ON_REQUEST, engine_names
from crosscheck.judge.reference.certify import FEWEST_DIGITS, MOST_DIGITS
from crosscheck.judge.reference.reference import SECONDS
from crosscheck.study.command import parsed_option
from crosscheck.study.grid import MOST_SECONDS, TIME_LIMIT
from crosscheck.study.search.selection import QUICK_LIMIT
from mbref import formats
from mbref.command_line import MOST_DURATION, add_force, add_output, number, output_folder, whole
from mbref.scene.fields import LARGEST
from mbref.scene.units import in_si

FILES = "an MJCF (.xml), URDF or SDF file; MJCF also runs in MuJoCo at its own settings"
MOST_ERROR = 1.0  # of the mechanism's length, or rad: a larger error says nothing about a motion
LOOSEST = 0.99  # relative tolerance; at 1 an error is as large as the motion
MOST_SAMPLES = 1_000_000  # of one run; `request.MOST_STATES` limits samples times bodies
MOST_REPEATS = 1000
MOST_MECHANISMS = 100_000  # their verdicts need about 20 kB each
MOST_SEED = 10**12
MOST_STARTS = 10_000
DIGITS = f"{FEWEST_DIGITS} to {MOST_DIGITS}"  # allowed values of --digits


def add_selection(parser: argparse.ArgumentParser) -> None:
    """Add options for scenes, engines, families, sample times, tolerance and limits of runs."""
    parser.add_argument(
        "scene",
        nargs="+",
        metavar="SCENE",
        help=f"a built-in scene (`crosscheck list scenes`), a .toml file, or {FILES}",
    )
    add_engines(parser)
    parser.add_argument(
        "--method",
        action="append",
        metavar="M",
        help="a family of settings, or any method of mbref: formulation+stabilisation/integrator, such as "
        "lm2+projection/dop853 (`crosscheck list methods`); may repeat; default: as for --setting",
    )
    parser.add_argument(
        "--setting",
        action="append",
        metavar="FAMILY",
        help="an engine's family of settings, such as defaults or tuned; may repeat; default: at quick "
        "depth these two or the first two, otherwise all (`crosscheck list settings`)",
    )
    parser.add_argument(
        "--option",
        action="append",
        type=_option,
        metavar="NAME=VALUE",
        help="an option of the single named engine and family, which replaces the sweep over its "
        "options; may repeat",
    )
    add_depth(parser)
    when = parser.add_mutually_exclusive_group()
    when.add_argument("--times", type=numbers, metavar="a,b,c", help="sample times (s), increasing")
    add_samples(when)
    parser.add_argument(
        "--rtol", type=float, help=f"one relative tolerance, at most {LOOSEST:g}, instead of the sweep"
    )
    add_duration(parser)
    add_limits(parser, None)
    add_reading(parser)


def add_duration(parser: argparse.ArgumentParser) -> None:
    """Add the option for the end of a motion."""
    about = f"end time (s), at most {MOST_DURATION:g}; default: the scene's"
    parser.add_argument("--duration", type=float, metavar="T", help=about)


def add_samples(group: Any, default: int | None = None) -> None:
    """Add the option ``--samples`` to a parser or a group of its options."""
    about = f"equally spaced samples, both ends included (2 to {MOST_SAMPLES})"
    about += "" if default is None else f"; default: {default}"
    group.add_argument("--samples", type=whole(2, MOST_SAMPLES), default=default, metavar="N", help=about)


def add_reading(parser: argparse.ArgumentParser) -> None:
    """Add the options for reading a file of another program."""
    formats.add_options(parser.add_argument_group("how a file of another program is read"))


def add_engines(parser: argparse.ArgumentParser) -> None:
    """Add the option that chooses engines."""
    parser.add_argument(
        "--engine",
        action="append",
        metavar="E",
        help=f"{', '.join(engine_names())}, or {ALL} for every installed one; may repeat; "
        f"default: all but {', '.join(ON_REQUEST)}",
    )


def add_folder(parser: argparse.ArgumentParser, default: str) -> None:
    """Add the option ``--out``, a folder that is written."""
    parser.add_argument(
        "--out",
        type=output_folder,
        default=default,
        metavar="DIR",
        help=f"folder to write (default: {default}); its records are continued",
    )
    add_force(parser)


def add_depth(parser: argparse.ArgumentParser) -> None:
    """Add the option for the number of settings of each engine."""
    parser.add_argument(
        "--depth",
        choices=("quick", "whole"),
        default="quick",
        help="quick: a few families of an engine and three settings of a family; whole: every setting",
    )


def _option(text: str) -> tuple[str, Any]:
    try:
        return parsed_option(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def numbers(text: str) -> list[float]:
    """Parse numbers separated by commas."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be numbers separated by commas, got {text!r}") from None


def add_limits(parser: argparse.ArgumentParser, limit: float | None = TIME_LIMIT) -> None:
    """Add the time limits of a run and of a reference, and the option ``--json``. Without a ``limit`` (s) of
    a run, the limit depends on the depth."""
    default = f"{limit:g}" if limit else f"{QUICK_LIMIT:g} at quick depth, {TIME_LIMIT:g} otherwise"
    parser.add_argument(
        "--time-limit",
        type=number(MOST_SECONDS, "s"),
        default=limit,
        metavar="T",
        help="limit of a run: CPU seconds, and also seconds of waiting without computing; at most "
        f"{MOST_SECONDS:g}; default: {default}",
    )
    add_reference_time(parser)
    parser.add_argument("--json", action="store_true", help="print records as JSON on standard output")


def add_reference_time(parser: argparse.ArgumentParser) -> None:
    """Add the option for the CPU time that a reference may take."""
    about = "CPU seconds for the reference of a scene without a closed form (default: %(default)g); 0: none"
    parser.add_argument(
        "--reference-time",
        type=number(MOST_SECONDS, "s", zero=True),
        default=SECONDS,
        metavar="T",
        help=about,
    )


def digits(text: str) -> int:
    """Parse a number of decimal digits within the allowed range."""
    if not (text.isdecimal() and FEWEST_DIGITS <= int(text) <= MOST_DIGITS):
        raise argparse.ArgumentTypeError(f"must be from {DIGITS}, got {text}")
    return int(text)


def length(text: str) -> float:
    """Parse a positive length such as 1mm or 0.5 in; returns metres. A number without a unit is in metres."""
    try:
        value = in_si(text if text[-1:].isalpha() else f"{text} m", "length")
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return number(LARGEST, "m")(repr(value))


def add_stored_runs(parser: argparse.ArgumentParser, records: Path) -> None:
    """Add the options of a command that shows stored runs, and makes missing ones if requested."""
    parser.add_argument("--run", action="store_true", help="make the runs that the records lack")
    parser.add_argument(
        "--engine",
        action="append",
        metavar="E",
        help="measure this engine only; may repeat; default: every installed one",
    )
    parser.add_argument(
        "--records", default=str(records), metavar="FILE", help="default: the records of the package"
    )
    add_output(
        parser,
        "--page",
        metavar="FILE",
        help="also write the tables and the runs as a page in Markdown",
    )
