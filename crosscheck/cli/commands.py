"""Functions that carry out the commands of `crosscheck`."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Mapping, Sequence

from crosscheck.cli import listing, request, tables
from crosscheck.cli.certifying import certify
from crosscheck.cli.comparing import compare, tune
from crosscheck.cli.judging import judge, write_reference
from crosscheck.cli.parser import parser
from crosscheck.cli.rendering import rendered
from crosscheck.cli.request import RequestError
from crosscheck.cli.running import (
    COMPLETED,
    OTHERWISE,
    by_scene,
    cases_of,
    console,
    missing_truths,
    notice,
    print_json,
    standard_output_kept,
    studied,
)
from crosscheck.cli.stored_tables import alternatives, closed_loops, convergence, invariants, modes
from crosscheck.study.grid import Record, key
from crosscheck.study.progress import counted
from crosscheck.study.provenance import made_by
from mbref.command_line import status_of
from mbref.files import write
from mbref.motions.trajectory import Outcome


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command line and return the exit status: 0 done, 1 not done, 2 faulty input, 130 interrupted
    (`parser.EXIT` defines "done" for each command)."""
    return status_of(lambda: _command(argv), RequestError)


def _command(argv: Sequence[str] | None) -> int:
    known = parser()
    arguments = known.parse_args(argv)
    if arguments.version:
        listing.show_versions(console())
        return COMPLETED
    if arguments.command is None:
        known.error("the following arguments are required: COMMAND")
    return COMMANDS[arguments.command](arguments)


def _list(arguments: argparse.Namespace) -> int:
    listing.show(console(), arguments.what)
    return COMPLETED


def _run(arguments: argparse.Namespace) -> int:
    cases = cases_of(arguments)
    finished: list[Record] = []
    try:
        studied(cases, finished)
    finally:  # show the finished runs, also after an interrupt
        by_key = {record["key"]: record for record in finished}
        records = [by_key[k] for k in dict.fromkeys(map(key, cases)) if k in by_key]
        if arguments.json:
            print_json(by_scene(cases, records))
        else:
            tables.print_runs(console(), records, [case.scene for case in cases])
            for sentence in missing_truths(cases, records):
                console().print(sentence, soft_wrap=True)
    return COMPLETED if all(r["outcome"] == Outcome.COMPLETED.label for r in records) else OTHERWISE


def _verify(arguments: argparse.Namespace) -> int:
    from crosscheck.conformance import suite

    engine = request.find_engine(arguments.engine, notice)
    if arguments.mechanisms:
        return _verify_random(engine, arguments)
    chosen = request.find_specimens(arguments.scene, arguments.reference_time, engine)
    limits = request.find_limits(arguments.limits, arguments.baseline, arguments.scene or ())
    with counted("verifying", len(chosen) + 1) as advance, standard_output_kept():
        runner = suite.runner(engine, arguments.time_limit, arguments.in_process)
        how = arguments.family, limits.judged, arguments.budget
        found = suite.held_against(runner, chosen, advance, *how)
    if arguments.junit:
        from crosscheck.conformance.junit import junit

        write(arguments.junit, junit(found))
    if arguments.json:
        print(json.dumps({**found.to_record(), **made_by()}, allow_nan=False))
    else:
        for block in suite.tables(found):
            console().print(block)
    return COMPLETED if found.conforms else OTHERWISE


def _verify_random(engine: str, arguments: argparse.Namespace) -> int:
    from crosscheck.conformance.many_mechanisms import MOST, Plan, examined
    from crosscheck.conformance.many_mechanisms_table import tables as tables_of_checks

    beside = arguments.beside or ()
    for other in beside:
        request.find_engines([other.partition("=")[0]], notice)
    plan = Plan(engine, arguments.mechanisms, arguments.first_seed, arguments.family, beside)
    with (
        counted("verifying, at most", MOST * plan.mechanisms) as advance,
        standard_output_kept(),
    ):
        found = examined(plan, arguments.records, advance)
    if arguments.json:
        print(json.dumps({**found.to_record(), **made_by()}, allow_nan=False))
    else:
        for block in tables_of_checks(found):
            console().print(block)
    return COMPLETED if found.conforms else OTHERWISE


def _findings(arguments: argparse.Namespace) -> int:
    from crosscheck.cli.findings import show

    show(console(), arguments.name, arguments.recheck)
    return COMPLETED


def _diagnose(arguments: argparse.Namespace) -> int:
    from crosscheck.cli.diagnosing import diagnose

    return diagnose(arguments)


def _report(arguments: argparse.Namespace) -> int:
    return rendered(_report_options(arguments))


def _paper(arguments: argparse.Namespace) -> int:
    return rendered(["--section", "paper", "--depth", arguments.depth, *_folder(arguments)])


def _report_options(arguments: argparse.Namespace) -> list[str]:
    sections = [f"--section={name}" for name in arguments.section or ()]
    engines = [f"--engine={name}" for name in arguments.engine or ()]
    limits = ["--depth", arguments.depth, "--reference-time", f"{arguments.reference_time:g}"]
    limits += [f"--render={arguments.render}"] if arguments.render else []
    return [*_folder(arguments), *engines, *limits, *sections, "--", *arguments.scene]


def _folder(arguments: argparse.Namespace) -> list[str]:
    return [f"--out={arguments.out}", *["--force"] * arguments.force]


def _diff(arguments: argparse.Namespace) -> int:
    from crosscheck.cli.differences import show

    return OTHERWISE if show(console(), arguments.old, arguments.new, arguments.all) else COMPLETED


def _files(arguments: argparse.Namespace) -> int:
    from crosscheck.cli.files import files

    return files(arguments)


def _derivatives(arguments: argparse.Namespace) -> int:
    from crosscheck.cli.derivatives import derivatives

    return derivatives(arguments)


def _versions(arguments: argparse.Namespace) -> int:
    from crosscheck.cli.versions import versions

    return versions(arguments)


COMMANDS: Mapping[str, Callable[[argparse.Namespace], int]] = {
    "list": _list,
    "run": _run,
    "compare": compare,
    "tune": tune,
    "verify": _verify,
    "findings": _findings,
    "files": _files,
    "diagnose": _diagnose,
    "closed-loops": closed_loops,
    "convergence": convergence,
    "invariants": invariants,
    "alternatives": alternatives,
    "modes": modes,
    "derivatives": _derivatives,
    "report": _report,
    "paper": _paper,
    "diff": _diff,
    "versions": _versions,
    "certify": certify,
    "judge": judge,
    "reference": write_reference,
}
