"""Options that several commands of crosscheck share."""

from __future__ import annotations

import argparse
import math

from crosscheck.engine import engine_names
from crosscheck.judge.reference.reference import SECONDS
from crosscheck.study.grid import TIME_LIMIT


def add_selection(parser: argparse.ArgumentParser) -> None:
    """Scenes, engines, families, sample times, tolerance and limits of runs."""
    parser.add_argument(
        "scene",
        nargs="+",
        metavar="SCENE",
        help="a built-in scene (`crosscheck list scenes`) or a .toml file",
    )
    known = ", ".join(engine_names())
    parser.add_argument("--engine", action="append", metavar="E", help=f"{known}; may repeat; default: all")
    parser.add_argument(
        "--method",
        action="append",
        metavar="M",
        help="a family of settings, or any method of mbref: formulation+stabilisation/integrator, such as "
        "lm2+projection/dop853 (`crosscheck list methods`); may repeat; default: every family",
    )
    parser.add_argument(
        "--setting",
        action="append",
        metavar="FAMILY",
        help="an engine's family of settings, such as defaults or tuned; may repeat; default: all",
    )
    when = parser.add_mutually_exclusive_group()
    when.add_argument("--times", type=_numbers, metavar="a,b,c", help="sample times (s), increasing")
    when.add_argument("--samples", type=int, metavar="N", help="equally spaced samples, both ends included")
    parser.add_argument(
        "--rtol", type=float, help="one relative tolerance instead of the sweep over tolerances"
    )
    parser.add_argument("--duration", type=float, metavar="T", help="end time (s); default: the scene's")
    add_limits(parser)


def _not_negative(text: str) -> float:
    number = float(text)
    if not 0 <= number < math.inf:
        raise argparse.ArgumentTypeError(f"must be finite and not negative, got {text}")
    return number


def _numbers(text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be numbers separated by commas, got {text!r}") from None


def add_limits(parser: argparse.ArgumentParser) -> None:
    """Times that a run and a reference may take, and the form of the output."""
    parser.add_argument(
        "--time-limit",
        type=float,
        default=TIME_LIMIT,
        metavar="T",
        help="wall time a run may take (s); default: %(default)g",
    )
    add_reference_time(parser)
    parser.add_argument("--json", action="store_true", help="print records as JSON on standard output")


def add_reference_time(parser: argparse.ArgumentParser) -> None:
    """The time that a reference may take."""
    about = "CPU seconds for the reference of a scene without a closed form (default: %(default)g); 0: none"
    parser.add_argument("--reference-time", type=_not_negative, default=SECONDS, metavar="T", help=about)
