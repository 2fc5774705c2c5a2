"""The command `crosscheck`: list, run, compare, verify, report and certify."""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from crosscheck.cli import listing, request, tables
from crosscheck.cli.options import add_limits, add_selection
from crosscheck.cli.request import RequestError
from crosscheck.study import fair_timing
from crosscheck.study.grid import Case, Record, key, study
from crosscheck.study.progress import counted, shown
from crosscheck.study.record_view import public
from mbref.scene import SceneError
from mbref.trajectory import Outcome

Document = dict[str, Any]
Commands = Any  # the object that argparse adds subcommands to; its type is private
COMPLETED, OTHERWISE, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
REPEATS = 5
COMPARED_SAMPLES = 11  # few, because adaptive integrators end a step at every sample time
PIPED_WIDTH = 180  # characters of a line


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command line; returns the exit status: 0 every run completed, 1 some run ended otherwise,
    2 bad input, 130 interrupted."""
    arguments = _parser().parse_args(argv)
    try:
        return arguments.command(arguments)
    except (RequestError, SceneError) as error:
        for fault in error.faults:
            print(fault, file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        _notice("interrupted")
        return INTERRUPTED
    except BrokenPipeError:  # the reader of the output has closed it, as in `crosscheck list | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OTHERWISE


def _list(arguments: argparse.Namespace) -> int:
    listing.show(_console(), arguments.what)
    return COMPLETED


def _run(arguments: argparse.Namespace) -> int:
    cases = _cases(arguments)
    finished: list[Record] = []
    try:
        _study(cases, finished)
    finally:  # also when interrupted: the finished runs are shown
        records = _in_order(cases, finished)
        if arguments.json:
            print(json.dumps(_by_scene(cases, records), allow_nan=False))
        else:
            tables.print_runs(_console(), records)
    return _status(records)


def _compare(arguments: argparse.Namespace) -> int:
    if arguments.repeats < REPEATS:
        raise RequestError(f"--repeats: must be at least {REPEATS}, got {arguments.repeats}")
    if arguments.times is None and arguments.samples is None:
        arguments.samples = COMPARED_SAMPLES
    cases = _cases(arguments)
    refused = _refused(cases, arguments.reference_time)
    records = _study(cases, [])
    same = [i for i, case in enumerate(cases) if case.scene.name not in refused]
    _notice(f"timing: {arguments.repeats} interleaved repeats of the runs that completed")
    timed = fair_timing.timed(
        [cases[i] for i in same], [records[i] for i in same], arguments.repeats, _notice
    )
    records = [record for record in records if record["scene"] in refused] + timed
    if arguments.json:
        print(json.dumps(_by_scene(cases, records), allow_nan=False))
    else:
        tables.print_runs(_console(), [r for r in records if r["scene"] in refused])
        tables.print_comparison(_console(), timed)
    return OTHERWISE if refused else _status(records)


def _refused(cases: Sequence[Case], reference_time: float) -> set[str]:
    """Names of the scenes whose mechanism differs between engines; the difference is printed."""
    scenes = {case.scene.name: case.scene for case in cases}
    limit = max(case.time_limit for case in cases)
    engines = {name: dict.fromkeys(c.engine for c in cases if c.scene.name == name) for name in scenes}
    identities = {
        n: fair_timing.identity_cases(scene, list(engines[n]), limit) for n, scene in scenes.items()
    }
    records = _study([case for group in identities.values() for case in group], [])
    reasons = {
        n: fair_timing.model_difference(s, [r for r in records if r["scene"] == n], reference_time)
        for n, s in scenes.items()
    }
    for name, reason in reasons.items():
        if reason:
            _notice(f"{name}: times are not compared, the engines simulate different mechanisms: {reason}")
    return {name for name, reason in reasons.items() if reason}


def _verify(arguments: argparse.Namespace) -> int:
    from crosscheck.conformance import suite

    (engine,) = request.find_engines([arguments.engine], _notice)
    chosen = request.find_specimens(arguments.scene, arguments.reference_time)
    with counted("verifying", len(chosen) + 1) as advance:
        found = suite.verify(engine, chosen, arguments.time_limit, advance)
    if arguments.json:
        print(json.dumps(found.to_record(), allow_nan=False))
    else:
        for block in suite.tables(found):
            _console().print(block)
    return COMPLETED if found.conforms else OTHERWISE


def _certify(arguments: argparse.Namespace) -> int:
    from crosscheck.judge.reference.certify import NotCertified, certified

    (scene,) = request.find_scenes([arguments.scene])
    times = request.sample_times(scene, None, arguments.samples, arguments.duration)
    try:
        table = certified(scene, times, arguments.digits)
    except (NotCertified, ImportError) as error:
        raise RequestError(str(error)) from None
    text = json.dumps(table, indent=1, ensure_ascii=False)
    if arguments.out:
        Path(arguments.out).write_text(text + "\n")
    else:
        print(text)
    return COMPLETED


def _report(arguments: argparse.Namespace) -> int:
    """The report stands above this package, so it is started as a program and never imported."""
    with subprocess.Popen([sys.executable, "-m", "reports", *_report_options(arguments)]) as program:
        try:
            return program.wait()
        except KeyboardInterrupt:  # the program is interrupted too, stores its records and ends by itself
            return program.wait()


def _report_options(arguments: argparse.Namespace) -> list[str]:
    sections = [option for name in arguments.section or () for option in ("--section", name)]
    return ["--out", arguments.out, *(["--quick"] if arguments.quick else []), *sections]


def _cases(arguments: argparse.Namespace) -> list[Case]:
    """The runs asked for; a scene that an engine cannot run is reported on standard error."""
    scenes = request.find_scenes(arguments.scene)
    engines = request.find_engines(arguments.engine, _notice)
    families = [*(arguments.method or ()), *(arguments.setting or ())]
    times = [request.sample_times(s, arguments.times, arguments.samples, arguments.duration) for s in scenes]
    cases = request.plan(
        scenes, engines, families or None, arguments.rtol, times, arguments.time_limit, _notice
    )  # fmt: skip
    return [case._replace(reference_time=arguments.reference_time) for case in cases]


def _study(cases: Sequence[Case], finished: list[Record]) -> list[Record]:
    """The records of the cases with a progress bar; each is appended to ``finished`` as it ends."""
    with shown("running", len(cases)) as advance:

        def progress(done: int, total: int, record: Record) -> None:
            finished.append(record)
            advance(done, total, record)

        return study(cases, progress=progress)


def _in_order(cases: Sequence[Case], finished: Sequence[Record]) -> list[Record]:
    by_key = {record["key"]: record for record in finished}
    return [by_key[k] for k in dict.fromkeys(map(key, cases)) if k in by_key]


def _by_scene(cases: Sequence[Case], records: Sequence[Record]) -> Document | list[Document]:
    """{"scene", "records"} of one scene; a list of them for several."""
    names = dict.fromkeys(case.scene.name for case in cases)
    documents = [
        {"scene": name, "records": [public(r) for r in records if r["scene"] == name]} for name in names
    ]
    return documents[0] if len(documents) == 1 else documents


def _status(records: Sequence[Record]) -> int:
    return COMPLETED if all(r["outcome"] == Outcome.COMPLETED.label for r in records) else OTHERWISE


def _console() -> Console:
    """Standard output; wide when it is no terminal, so that no cell of a table is folded."""
    return Console(width=None if sys.stdout.isatty() else PIPED_WIDTH, markup=False)


def _notice(sentence: str) -> None:
    print(sentence, file=sys.stderr)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="crosscheck", description="The same mechanism in several engines, against truth."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    _add_list(commands)
    _add_run(commands)
    _add_compare(commands)
    _add_verify(commands)
    _add_report(commands)
    _add_certify(commands)
    return parser


def _add(
    commands: Commands, name: str, about: str, example: str, command: Callable[[argparse.Namespace], int]
) -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = commands.add_parser(
        name, help=about, description=about, epilog=f"example: {example}", allow_abbrev=False
    )
    parser.set_defaults(command=command)
    return parser


def _add_certify(commands: Commands) -> None:
    example = "crosscheck certify four_bar_gravity --digits 20 --duration 0.1 --out four_bar_gravity.json"
    about = "the motion of a scene to many digits, on which two formulations agree (needs python-flint)"
    parser = _add(commands, "certify", about, example, _certify)
    parser.add_argument("scene", metavar="SCENE", help="a built-in name or a .toml file")
    parser.add_argument("--digits", type=int, default=20, metavar="N", help="default: 20")
    parser.add_argument("--samples", type=int, default=3, metavar="N", help="from 0 to the end (default: 3)")
    parser.add_argument("--duration", type=float, metavar="T", help="end time (s); default: the scene's")
    parser.add_argument("--out", metavar="FILE", help="default: standard output")


def _add_list(commands: Commands) -> None:
    parser = _add(
        commands, "list", "print the known scenes, engines, methods, metrics and the support matrix",
        "crosscheck list engines", _list,
    )  # fmt: skip
    parser.add_argument(
        "what", nargs="?", choices=tuple(listing.TABLES), help="the table to print; default: all"
    )


def _add_run(commands: Commands) -> None:
    example = "crosscheck run four_bar --engine mujoco --engine exudyn --samples 21 --json"
    parser = _add(
        commands, "run", "run scenes in engines, one record for every engine and setting", example, _run
    )
    add_selection(parser)


def _add_compare(commands: Commands) -> None:
    example = "crosscheck compare planar_slider_crank --engine mbref --engine pinocchio"
    about = "compare speed at equal error: run, then time the completed runs in turns; table and plot"
    parser = _add(commands, "compare", about, example, _compare)
    add_selection(parser)
    parser.add_argument(
        "--repeats", type=int, default=REPEATS, help=f"timed runs of every setting, at least {REPEATS}"
    )


def _add_verify(commands: Commands) -> None:
    example = "crosscheck verify mujoco"
    about = "test an engine by the conformance suite: every property on every scene of the suite"
    parser = _add(commands, "verify", about, example, _verify)
    parser.add_argument(
        "engine", metavar="ENGINE", help="a known engine (`crosscheck list engines`), or module:attribute"
    )
    parser.add_argument(
        "--scene", action="append", metavar="S", help="a scene of the suite; may repeat; default: all"
    )
    add_limits(parser)


def _add_report(commands: Commands) -> None:
    example = "crosscheck report --quick --out report"
    about = "make the missing records and render the report; resumes where it was interrupted"
    parser = _add(commands, "report", about, example, _report)
    parser.add_argument(
        "--quick", action="store_true", help="five short scenes, a few settings: about three minutes"
    )
    parser.add_argument(
        "--section", action="append", metavar="S", help="render only this section, such as speed; may repeat"
    )
    parser.add_argument("--out", default="report", metavar="DIR", help="folder to write (default: report)")
