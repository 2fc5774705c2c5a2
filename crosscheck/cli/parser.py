"""The command line of crosscheck: its commands, their options and examples."""

from __future__ import annotations

import argparse
import math
from textwrap import fill

from crosscheck.cli.commands_of_engines import (
    add_alternatives,
    add_derivatives,
    add_diagnose,
    add_diff,
    add_files,
    add_findings,
    add_versions,
)
from crosscheck.cli.commands_of_motions import Commands, add_certify, add_command, add_judge, add_reference
from crosscheck.cli.listing import TABLES
from crosscheck.cli.options import (
    MOST_ERROR,
    MOST_MECHANISMS,
    MOST_REPEATS,
    MOST_SEED,
    MOST_STARTS,
    add_depth,
    add_duration,
    add_engines,
    add_folder,
    add_limits,
    add_reading,
    add_reference_time,
    add_selection,
    add_stored_runs,
    length,
)
from crosscheck.closed_loops.records import FILE
from crosscheck.convergence.ladders import FILE as LADDERS
from crosscheck.invariants.records import FILE as INVARIANTS
from crosscheck.study.timings import REPEATS
from mbref.command_line import MOST_DURATION, Parser, add_output, commands, number, record_file, whole

FIRST = """\
first steps:
  mbref new my.toml                         a commented mechanism to start from
  crosscheck compare my.toml                a verdict in words, errors, speed, settings
  crosscheck report my.toml --out report    the same as a page, report/index.html
  crosscheck tune mujoco my.toml            the cheapest settings for an error of 1e-6

"""
EXIT = (
    "exit status: 0 when the command did what was asked, 1 otherwise, 2 for bad input, 130 when interrupted. "
    "`run` gives 1 where a run did not complete; `compare` and `report` give 0 although engines fail, since "
    "failures of engines are results, and `compare` 1 where two engines simulate different "
    "mechanisms. `tune` gives 1 where no setting reaches the error, `verify` where a check fails "
    "or no scene was run, `diagnose` where a known defect shows, `derivatives` where one is wrong, "
    "`files` where a reader builds another machine, `diff` and `versions` where something differs by more "
    "than noise."
)


def parser() -> argparse.ArgumentParser:
    """Return the command-line parser; its result has the name of the command in the field ``command``."""
    found = Parser(
        prog="crosscheck",
        description="Simulate a mechanism in several engines and compare each motion with the true motion.",
        epilog=FIRST + fill(EXIT, 79),
    )
    found.add_argument(
        "--version", action="store_true", help="print the versions of crosscheck and the engines"
    )
    known = commands(found, dest="command", metavar="COMMAND")
    for add in (
        _add_list,
        _add_run,
        _add_compare,
        _add_tune,
        _add_verify,
        add_findings,
        add_files,
        add_diagnose,
        _add_closed_loops,
        _add_convergence,
        _add_invariants,
        add_alternatives,
        _add_modes,
        add_derivatives,
        _add_report,
        _add_paper,
        add_diff,
        add_versions,
        add_certify,
        add_judge,
        add_reference,
    ):
        add(known)
    return found


def _add_list(commands: Commands) -> None:
    about = "print the known scenes, engines, methods, settings, metrics and the support matrix"
    parser = add_command(commands, "list", about, "crosscheck list engines")
    parser.add_argument("what", nargs="?", choices=tuple(TABLES), help="the table to print; default: all")


def _add_run(commands: Commands) -> None:
    example = "crosscheck run four_bar --engine mujoco --engine exudyn --samples 21 --json"
    about = "run scenes in engines, one record for every engine and setting"
    add_selection(add_command(commands, "run", about, example))


def _add_compare(commands: Commands) -> None:
    example = "crosscheck compare my.toml\n  crosscheck compare robot.xml --hold trunk --duration 0.5"
    about = "compare engines on a mechanism: which are right, how accurate and how fast, and why others fail"
    parser = add_command(commands, "compare", about, example)
    add_selection(parser)
    parser.add_argument(
        "--repeats",
        type=whole(REPEATS, MOST_REPEATS),
        default=REPEATS,
        metavar="N",
        help=f"timed runs of every setting ({REPEATS} to {MOST_REPEATS}; default: %(default)s)",
    )


def _add_tune(commands: Commands) -> None:
    example = "crosscheck tune mujoco my.toml --error 1e-6\n  crosscheck tune mujoco my.toml --closure 1mm"
    about = "find the cheapest settings of an engine that reach an error or a closure gap on a mechanism"
    parser = add_command(commands, "tune", about, example)
    parser.add_argument("engine", metavar="ENGINE", help="a known engine (`crosscheck list engines`)")
    parser.add_argument("scene", metavar="SCENE", help="a built-in scene, a .toml, MJCF (.xml) or URDF file")
    goal = parser.add_mutually_exclusive_group()
    about = f"largest error / mechanism's length, or rad; at most {MOST_ERROR:g}; default: %(default)g"
    goal.add_argument("--error", type=number(MOST_ERROR), default=1e-6, metavar="E", help=about)
    goal.add_argument(
        "--closure",
        type=length,
        metavar="GAP",
        help="largest distance of points that a joint holds together, such as 1mm, as the criterion in place "
        "of an error; angles do not count",
    )
    add_duration(parser)
    add_limits(parser)
    add_reading(parser)


def _add_verify(commands: Commands) -> None:
    about = "test an engine by the conformance suite: every property on every scene of the suite"
    parser = add_command(commands, "verify", about, "crosscheck verify mujoco")
    parser.add_argument(
        "engine", metavar="ENGINE", help="a known engine (`crosscheck list engines`), or module:attribute"
    )
    parser.add_argument(
        "--scene", action="append", metavar="S", help="a scene of the suite; may repeat; default: all"
    )
    parser.add_argument(
        "--family",
        default="",
        metavar="F",
        help="a family of settings, or a method of mbref; default: the best",
    )
    parser.add_argument(
        "--in-process",
        action="store_true",
        help="run in this process: fast, but a crash ends all, and repeated runs share the process",
    )
    parser.add_argument(
        "--limits",
        metavar="FILE",
        help="own limits of checks and expected failures (.toml; docs/verify-your-engine.md)",
    )
    parser.add_argument(
        "--baseline",
        metavar="FILE",
        help="what --json printed before: failures that are no worse do not count",
    )
    parser.add_argument(
        "--budget",
        type=number(MOST_DURATION, "s"),
        default=math.inf,
        metavar="T",
        help="begin no scene after T seconds, and name the scenes that were left out",
    )
    add_output(parser, "--junit", metavar="FILE", help="also write a JUnit file of the checks that ran")
    drawn = parser.add_argument_group(
        "checks on random mechanisms instead of scenes; all runs are in this process"
    )
    drawn.add_argument(
        "--mechanisms",
        type=whole(1, MOST_MECHANISMS),
        metavar="N",
        help=f"make every check on N random mechanisms (1 to {MOST_MECHANISMS})",
    )
    drawn.add_argument(
        "--first-seed", type=whole(0, MOST_SEED), default=0, metavar="S", help="default: %(default)s"
    )
    drawn.add_argument("--records", type=record_file, metavar="FILE", help="store and reuse verdicts there")
    drawn.add_argument(
        "--beside",
        action="append",
        metavar="E[=F]",
        help="an engine (and family) with which the motions must agree; may repeat",
    )
    add_limits(parser)


def _add_closed_loops(commands: Commands) -> None:
    about = (
        "show engines on closed-loop mechanisms, each hard in one way, from stored records; "
        "--run measures installed engines again"
    )
    parser = add_command(commands, "closed-loops", about, "crosscheck closed-loops --run --engine drake")
    add_stored_runs(parser, FILE)
    parser.add_argument("--family", action="append", metavar="F", help="measure this family only; may repeat")


def _add_convergence(commands: Commands) -> None:
    about = (
        "show least errors and orders of convergence of engines from stored records; "
        "--run makes the missing runs of installed engines at halved steps"
    )
    parser = add_command(commands, "convergence", about, "crosscheck convergence --run --engine drake")
    add_stored_runs(parser, LADDERS)
    about = "families of MuJoCo and Pinocchio on every built-in scene, from records of their own"
    parser.add_argument("--every-scene", action="store_true", help=about)


def _add_invariants(commands: Commands) -> None:
    about = (
        "show what engines do to momenta, energy, similarity and distance from the origin, and by which law, "
        "from stored records; --run makes the missing runs of installed engines"
    )
    parser = add_command(commands, "invariants", about, "crosscheck invariants --run --engine drake")
    add_stored_runs(parser, INVARIANTS)


def _add_modes(commands: Commands) -> None:
    about = (
        "compare equilibria, steady motions and the eigenvalues of small motions: the judge's own equations, "
        "mbref, and engines; without a scene show the stored table of mechanisms with closed forms"
    )
    parser = add_command(commands, "modes", about, "crosscheck modes my.toml --engine mujoco --engine exudyn")
    parser.add_argument("scene", nargs="?", metavar="SCENE", help="a built-in name or a .toml file")
    parser.add_argument(
        "--engine", action="append", metavar="E", help="ask this engine only; may repeat; default: installed"
    )
    parser.add_argument(
        "--starts",
        type=whole(1, MOST_STARTS),
        default=16,
        metavar="N",
        help=f"poses to search from (1 to {MOST_STARTS}; default: %(default)s)",
    )
    parser.add_argument("--run", action="store_true", help="measure the stored table again, or engines of it")
    add_output(parser, "--page", metavar="FILE", help="also write the table in Markdown")
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")


def _add_report(commands: Commands) -> None:
    example = "crosscheck report my.toml --out report"
    about = "make the missing records and render the report; resumes where it was interrupted"
    parser = add_command(commands, "report", about, example)
    parser.add_argument(
        "scene",
        nargs="*",
        metavar="SCENE",
        help="built-in scenes or .toml files; default: five short built-in ones, at whole depth all of them",
    )
    add_engines(parser)
    add_depth(parser)
    parser.add_argument(
        "--quick", dest="depth", action="store_const", const="quick", help="short for --depth quick"
    )
    parser.add_argument(
        "--section",
        action="append",
        metavar="S",
        help="render only this section, such as speed (docs/compare.md lists them); may repeat",
    )
    add_folder(parser, "report")
    parser.add_argument("--render", metavar="DIR", help="render a report from its records, without any run")
    add_reference_time(parser)


def _add_paper(commands: Commands) -> None:
    example = "crosscheck paper --out paper"
    about = (
        "run the tables and figures of Neto & Ambrósio (2003) and render them beside the printed ones; "
        "resumes where it was interrupted"
    )
    parser = add_command(commands, "paper", about, example)
    parser.add_argument(
        "--depth",
        choices=("quick", "whole"),
        default="quick",
        help="quick: the tables and figures; whole: also the sweeps of settings and every pair of methods",
    )
    add_folder(parser, "paper")
