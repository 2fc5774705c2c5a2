"""`crosscheck versions`: changes from one version of an engine to another, on a mechanism or the suite."""

from __future__ import annotations

import argparse
import json
import math
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from crosscheck.cli.request import RequestError, lasting
from crosscheck.cli.running import COMPLETED, OTHERWISE, console, notice
from crosscheck.cli.scene_request import find_scenes
from crosscheck.engine import engine, engine_names
from crosscheck.study.progress import narrated
from crosscheck.versions.bisection import Bisection, bisected
from crosscheck.versions.differences import Found, between
from crosscheck.versions.environment import NotInstalled, Requirement, environment, released, requirement
from crosscheck.versions.measured import Command, Measured, measured
from mbref.formats import import_options
from mbref.scene import Scene
from mbref.scene.fields import meant

PROGRAM = "crosscheck"
SHOWN = 40  # changes in the printed table; --json has all


def versions(arguments: argparse.Namespace) -> int:
    """Print the changes between two versions, or the first version that changes results; returns 1 if there
    is a change."""
    try:
        return _bisect(arguments) if arguments.bisect else _compare(arguments)
    except NotInstalled as reason:
        raise RequestError(str(reason)) from None


def _compare(arguments: argparse.Namespace) -> int:
    wanted = [_requirement(word) for word in arguments.what[:2]]
    if len(wanted) < 2:
        raise RequestError(f"two versions are needed, such as {wanted[0]} {wanted[0].package}==VERSION")
    task = _task(arguments, {one.package for one in wanted}, arguments.what[2:])
    with narrated("measuring", len(wanted) * task.parts) as (say, done):
        for one in wanted:  # both before the work in one of them
            say(f"{one}: making its environment")
            environment(one)
        old, new = (measured(one, task.engine, task.commands, say, done) for one in wanted)
    found = _found(task, old, new)
    if arguments.json:
        print(json.dumps({"engine": task.engine, **_of_pair(old, new, found)}, allow_nan=False))
    else:
        console().print(_heading(old, new, found), soft_wrap=True)
        _print(console(), found)
    return OTHERWISE if found else COMPLETED


def _bisect(arguments: argparse.Namespace) -> int:
    package, *scenes = arguments.what
    if "==" in package:
        alone = package.partition("==")[0]
        raise RequestError(f"--bisect: takes a package without a version, such as {alone}, got {package!r}")
    task, (first, last) = _task(arguments, {package}, scenes), _ends(arguments.bisect)
    known = _between_ends(package, released(package), first, last)
    most = 2 + math.ceil(math.log2(len(known)))  # the ends, and one for each halving
    with narrated("measuring, at most", most * task.parts) as (say, done):
        found = bisected(
            known,
            lambda version: measured(Requirement(package, version), task.engine, task.commands, say, done),
            lambda old, new: _found(task, old, new),
        )
    for sentence in found.skipped:
        notice(f"left out: {sentence}")
    if arguments.json:
        changes = [one._asdict() for one in found.changes]
        print(json.dumps({"engine": task.engine, **found._asdict(), "changes": changes}, allow_nan=False))
    else:
        console().print(_sentence(package, known, found), soft_wrap=True)
        _print(console(), found.changes)
    return OTHERWISE if found.new else COMPLETED


class _Task(NamedTuple):
    """The engine, the scenes, and the commands that run in each environment."""

    engine: str
    scenes: Sequence[Scene]
    commands: Sequence[Command]

    @property
    def parts(self) -> int:
        """Return the number of parts of the work in one environment: the environment, facts and commands."""
        return 2 + len(self.commands)


def _task(arguments: argparse.Namespace, packages: Iterable[str], names: Sequence[str]) -> _Task:
    """Return the request; raises RequestError before anything is installed."""
    called, reading = _engine(arguments.engine, packages), import_options(arguments)
    limits = [f"--time-limit={arguments.time_limit:g}", f"--reference-time={arguments.reference_time:g}"]
    runs = [word for family in arguments.setting or () for word in ("--setting", family)]
    runs += [] if arguments.duration is None else ["--duration", repr(arguments.duration)]
    verify = [PROGRAM, "verify", called, "--json", *limits]
    commands = []
    if names:
        compare = [PROGRAM, "compare", *names, "--engine", called, "--json"]
        commands.append([*compare, *limits, *runs, *reading.words()])
    if arguments.mechanisms:
        commands.append([*verify, "--mechanisms", str(arguments.mechanisms)])
    if arguments.suite or not commands:
        commands.append(verify)
    scenes = find_scenes(names, reading, notice)
    return _Task(called, [lasting(scene, None, arguments.duration) for scene in scenes], commands)


def _engine(named: str | None, packages: Iterable[str]) -> str:
    """Return the name of the engine whose versions are measured; raises RequestError."""
    known = engine_names()
    if named is not None:
        if named not in known and ":" not in named:
            raise RequestError(f"unknown engine {named!r}; known: {', '.join(known)}{meant(named, known)}")
        return named
    owners = {_plain(engine(name).package): name for name in known}
    found = {owners.get(_plain(package), "") for package in packages}
    if "" in found or len(found) > 1:
        raise RequestError(
            f"{' and '.join(sorted(packages))}: not the package of one engine; "
            f"add --engine E, or name one of {', '.join(sorted(owners))}"
        )
    return found.pop()


def _plain(package: str) -> str:
    """Return a name as package indexes compare it."""
    return re.sub(r"[-_.]+", "-", package).lower()


def _requirement(word: str) -> Requirement:
    try:
        return requirement(word)
    except ValueError as error:
        raise RequestError(str(error)) from None


def _ends(text: str) -> tuple[str, str]:
    first, dots, last = text.partition("..")
    if not (first and dots and last):
        raise RequestError(f"--bisect: must be OLD..NEW, such as 3.13.0..4.0.0, got {text!r}")
    return first, last


def _between_ends(package: str, known: Sequence[str], first: str, last: str) -> Sequence[str]:
    """Return the released versions from the first to the last."""
    if unknown := [version for version in (first, last) if version not in known]:
        missing = " or ".join(unknown)
        raise RequestError(f"{package}: no released version {missing}; known: {', '.join(known)}")
    low, high = known.index(first), known.index(last)
    if low >= high:
        raise RequestError(f"--bisect: {first} must be older than {last}")
    return known[low : high + 1]


def _found(task: _Task, old: Measured, new: Measured) -> list[Found]:
    """Return the changes; raises RequestError if no command ends with a result in either version."""
    if all(document is None for measured in (old, new) for document in measured.documents):
        raise RequestError(*dict.fromkeys([*old.faults.values(), *new.faults.values()]))
    return between(old, new, task.scenes)


def _of_pair(old: Measured, new: Measured, found: Sequence[Found]) -> dict[str, Any]:
    sides = {"old": old, "new": new}
    return {
        **{
            side: {"requirement": str(one.requirement), **one.facts, "faults": list(one.faults.values())}
            for side, one in sides.items()
        },
        "changes": [one._asdict() for one in found],
    }


def _heading(old: Measured, new: Measured, found: Sequence[Found]) -> str:
    counts = Counter(one.kind for one in found)
    said = ", ".join(f"{kind} {number}" for kind, number in counts.items())
    return f"{old.requirement} → {new.requirement}: {said or 'no change beyond noise'}"


def _sentence(package: str, known: Sequence[str], found: Bisection) -> str:
    if found.new is None:
        return f"{package} {known[0]} and {known[-1]} have equal results, within noise."
    return f"{package} {found.new} changes the results of {found.old} ({found.made} versions were measured)."


def _print(on: Console, found: Sequence[Found]) -> None:
    """Print the changes in a table."""
    if not found:
        return
    table = Table("what", "where", "change", box=SIMPLE)
    for one in found[:SHOWN]:
        table.add_row(*one)
    on.print(table)
    if len(found) > SHOWN:
        on.print(f"and {len(found) - SHOWN} more: --json has all", soft_wrap=True)
