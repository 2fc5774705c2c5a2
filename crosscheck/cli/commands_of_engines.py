"""Parsers of the commands for defects and versions of engines: findings, files, alternatives, diagnose, diff,
versions."""

from __future__ import annotations

from crosscheck.alternatives.records import FILE as ALTERNATIVES
from crosscheck.alternatives.records import GRAPHS
from crosscheck.cli.commands_of_motions import Commands, add_command
from crosscheck.cli.options import (
    MOST_MECHANISMS,
    add_duration,
    add_engines,
    add_limits,
    add_reading,
    add_stored_runs,
)
from crosscheck.derivatives.records import FILE as DERIVATIVES
from crosscheck.engines.loaders import PLACES
from crosscheck.study.grid import MOST_SECONDS
from mbref.command_line import add_output, number, output_folder, whole

READER_LIMIT = 120.0  # s of CPU time of a reader of files, imports and compilation included


def add_findings(commands: Commands) -> None:
    """Add the parser of `crosscheck findings`."""
    about = (
        "violations found in engines, each with a proof, and readers of files that differ from the formats; "
        "--recheck asks the installed versions"
    )
    parser = add_command(commands, "findings", about, "crosscheck findings --recheck")
    parser.add_argument("name", nargs="*", metavar="NAME", help="a finding; default: all")
    parser.add_argument(
        "--recheck", action="store_true", help="run the proofs, and report which findings are still present"
    )


def add_alternatives(commands: Commands) -> None:
    """Add the parser of `crosscheck alternatives`."""
    about = (
        "show how far the ways of an engine to solve the same equations differ on random mechanisms, from "
        "stored records; --run makes the missing runs of installed engines"
    )
    parser = add_command(commands, "alternatives", about, "crosscheck alternatives --run --engine drake")
    add_stored_runs(parser, ALTERNATIVES)
    parser.add_argument(
        "--mechanisms",
        type=whole(1, MOST_MECHANISMS),
        default=GRAPHS,
        metavar="N",
        help="number of random mechanisms of --run; default: %(default)s",
    )


def add_derivatives(commands: Commands) -> None:
    """Add the parser of `crosscheck derivatives`."""
    about = (
        "compare derivatives of accelerations on closed loops, by the functions that engines have for them, "
        "with the judge's derivatives in 30 digits: along the motions that the joints allow, by velocities, "
        "and by forces on the bodies. The derivative along a motion keeps loops closed, and changes "
        "velocities by the least amount that the joints require, so that it is the same in all coordinates. "
        "Each function is also compared with differences of the engine's own accelerations, at the state and "
        "with open loops: an engine that differentiates its own step or soft constraints can be right there, "
        "and wrong about the exact motion. An error up to 1e-6 of the largest derivative is right, up to "
        "1e-2 rough. Loads are left out, and drivers refused. A sentence says whether an error depends on "
        "open loops, on velocities, or on neither. Without ENGINE and SCENE the stored results are shown; "
        "--run measures engines and stores them. --cards asks for identities, which need no other "
        "derivatives: closures and virtual work at neighbouring states, the chain rule along the motion, "
        "energy, the engine's own differences, frames, units, order, redundant rows, speed and couplings. "
        "Exit status: 1 if a derivative of a named engine or scene is wrong, or a card fails"
    )
    example = (
        "crosscheck derivatives\n  crosscheck derivatives pinocchio fast_four_bar\n"
        "  crosscheck derivatives my.toml --engine mujoco --json\n  crosscheck derivatives my_module:ENGINE\n"
        "  crosscheck derivatives my_module:ENGINE --cards"
    )
    parser = add_command(commands, "derivatives", about, example)
    about = (
        "engines, and scenes: built-in names, .toml, MJCF, URDF or SDF files, or mechanisms of the stored "
        "results; default: all engines that have such functions, and these mechanisms"
    )
    parser.add_argument("what", nargs="*", metavar="ENGINE|SCENE", help=about)
    cards = "judge the named engines by identities on mechanisms of the cards"
    parser.add_argument("--cards", action="store_true", help=cards)
    add_stored_runs(parser, DERIVATIVES)
    parser.add_argument("--json", action="store_true", help="print one JSON document and nothing else")


def add_files(commands: Commands) -> None:
    """Add the parser of `crosscheck files`."""
    about = (
        "read one MJCF, URDF or SDF file by the own reader of each engine, and show which machine each one "
        "built, against the specification of the format: bodies, joints, loops, couplings, gravity, and the "
        "engine's own mass matrix, gravity torques, constraint rows and accelerations at four poses, and its "
        "motion of 0.1 s. A grade says `the same "
        "machine`, `the same except for` limits or forces of joints, `another machine`, or `cannot read`. "
        "Changes of the file that help a reader are tried and named. Each reader runs in a process of its "
        "own. Exit status: 0 if all readers build the file's machine, 1 if one does not, 2 for a faulty file"
    )
    example = (
        "crosscheck files robot.urdf\n  crosscheck files robot.xml --engine drake --engine newton --install"
    )
    parser = add_command(commands, "files", about, example)
    about = "an MJCF, URDF or SDF file; without it: the stored table of features and readers"
    parser.add_argument("robot", nargs="?", metavar="ROBOT", help=about)
    about = (
        f"a reader, or E==VERSION; may repeat: {', '.join(PLACES)}, or module:attribute; "
        "default: all that are installed"
    )
    parser.add_argument("--engine", action="append", metavar="E", help=about)
    about = (
        "install missing packages with pip, each into an environment of its own in the cache folder, as "
        "`crosscheck versions` does"
    )
    parser.add_argument("--install", action="store_true", help=about)
    parser.add_argument("--run", action="store_true", help="measure the stored table again, or readers of it")
    about = "the table of public files of robots in packages, which --run downloads with pip"
    parser.add_argument("--public", action="store_true", help=about)
    add_output(parser, "--page", metavar="FILE", help="also write the table as a page in Markdown")
    about = "also write the result of ROBOT as a page, DIR/index.html, with pictures of other machines"
    parser.add_argument("--out", type=output_folder, metavar="DIR", help=about)
    about = "do not try changes of the file that let more readers build its machine"
    parser.add_argument("--no-advice", action="store_true", help=about)
    about = "CPU time of a reader; default: %(default)g"
    parser.add_argument(
        "--time-limit", type=number(MOST_SECONDS, "s"), default=READER_LIMIT, metavar="S", help=about
    )
    parser.add_argument("--json", action="store_true", help="print one JSON document and nothing else")


def add_diagnose(commands: Commands) -> None:
    """Add the parser of `crosscheck diagnose`."""
    about = (
        "show what engines cannot simulate of a mechanism, which known defects they have there, each tried "
        "on the mechanism by short runs, and which of their solvers differ there; exit status 1 if a defect "
        "or a difference shows"
    )
    example = "crosscheck diagnose robot.xml --engine mujoco"
    parser = add_command(commands, "diagnose", about, example)
    about = "a built-in scene, a .toml, MJCF (.xml), URDF or SDF file"
    parser.add_argument("scene", nargs="+", metavar="SCENE", help=about)
    add_engines(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON document and nothing else")
    add_reading(parser)


def add_diff(commands: Commands) -> None:
    """Add the parser of `crosscheck diff`."""
    example = "crosscheck diff report-before report-after"
    about = "list what changed beyond noise between two sets of records: versions, settings or machines"
    parser = add_command(commands, "diff", about, example)
    parser.add_argument("old", metavar="OLD", help="a records.jsonl, or the folder of a report")
    parser.add_argument("new", metavar="NEW", help="the same")
    parser.add_argument("--all", action="store_true", help="also list the runs that did not change")


def add_versions(commands: Commands) -> None:
    """Add the parser of `crosscheck versions`."""
    example = (
        "crosscheck versions mujoco==3.17.0 mujoco==4.0.0 robot.xml\n"
        "  crosscheck versions mujoco robot.xml --bisect 3.13.0..4.0.0"
    )
    about = (
        "show what changes beyond noise from one version of an engine's package to another, on your "
        "mechanism or on the conformance suite: outcomes, accelerations at the start, motions, errors, cost, "
        "default values of options, and names that the adapter misses. pip installs each version, with "
        "your settings of indexes, into an environment in the cache folder; nothing else changes. Exit "
        "status: 0 if nothing changes, 1 if something does, 2 if a version cannot be installed or run"
    )
    parser = add_command(commands, "versions", about, example)
    about = (
        "two versions PACKAGE==VERSION, or with --bisect a PACKAGE; then scenes: built-in names, .toml, "
        "MJCF, URDF or SDF files; default: the conformance suite"
    )
    parser.add_argument("what", nargs="+", metavar="WHAT", help=about)
    about = "find the released version whose results differ from the results of OLD"
    parser.add_argument("--bisect", metavar="OLD..NEW", help=about)
    parser.add_argument("--suite", action="store_true", help="also run the conformance suite")
    about = f"also make the checks on N random mechanisms (1 to {MOST_MECHANISMS})"
    parser.add_argument("--mechanisms", type=whole(1, MOST_MECHANISMS), metavar="N", help=about)
    about = "the engine, or module:attribute in the package; needed where the package is not a known engine's"
    parser.add_argument("--engine", metavar="E", help=about)
    about = "a family of settings; may repeat; default: a few"
    parser.add_argument("--setting", action="append", metavar="FAMILY", help=about)
    add_duration(parser)
    add_limits(parser)
    add_reading(parser)
