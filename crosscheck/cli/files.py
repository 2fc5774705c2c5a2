"""`crosscheck files`: the machine that each engine's own reader builds from one file."""

from __future__ import annotations

import argparse
import dataclasses
import json
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table
from rich.text import Text

from crosscheck.cli.rendering import rendered, write_page
from crosscheck.cli.request import RequestError
from crosscheck.cli.running import COMPLETED, OTHERWISE, console, notice, print_json
from crosscheck.engines.loaders import PLACES
from crosscheck.files import public, records
from crosscheck.files.corpus import CASES
from crosscheck.files.meaning import SOURCES
from crosscheck.files.readers import UnknownReader, found_readers
from crosscheck.files.reading import ALMOST, ANOTHER, REFUSED, SAME, File, Reading, file_of, readings
from crosscheck.files.repairs import Advice, advice
from crosscheck.files.words import heading, is_announced, part, shown, verdict
from crosscheck.study.progress import counted, narrated
from crosscheck.versions.environment import NotInstalled
from mbref.records import finite, rewrite

LOOKS = {SAME: "green", ALMOST: "yellow", ANOTHER: "bold red", REFUSED: "magenta"}
SIGNS = {
    records.SAME: "✓",
    records.SAID: "dropped, said",
    records.SILENT: "dropped",
    records.WRONG: "wrong",
    records.REFUSED: "refused",
}
CELLS = {"✓": "green", "dropped, said": "yellow", "refused": "magenta", "dropped": "red", "wrong": "red"}
SHOWN = 12  # lines of a reader in the printed table; --json has all


def files(arguments: argparse.Namespace) -> int:
    """Print what each reader builds from a file; returns 1 if one builds another machine or refuses it.

    Without a file print the stored table of features and readers.
    """
    try:
        return _of_file(arguments) if arguments.robot else _of_table(arguments)
    except (UnknownReader, NotInstalled) as reason:
        raise RequestError(str(reason)) from None


def _of_file(arguments: argparse.Namespace) -> int:
    if arguments.run or arguments.page or arguments.public:
        raise RequestError("--run, --page and --public are about a stored table; leave out ROBOT")
    file = file_of(Path(arguments.robot))
    chosen, left_out = found_readers(arguments.engine or (), file.form, arguments.install)
    for name, why in left_out:
        if arguments.engine or not why.startswith("reads no"):
            notice(f"{name} is left out: {why}{'' if 'reads no' in why else '; --install adds it'}")
    if not chosen:
        raise RequestError(f"no reader of {file.form} is left; crosscheck files --help names all")
    with narrated("reading", len(chosen) + 1) as (say, done):
        found = readings(file, chosen, arguments.time_limit, say, done)
        pairs = list(zip(chosen, found, strict=True))
        tried = [] if arguments.no_advice else advice(file, pairs, arguments.time_limit, say)
        done("advice")
    result = document(file, found, tried)
    if arguments.json:
        print_json([result])
    else:
        _show(console(), file, found, tried)
    if arguments.out and (status := _write_report(result, arguments.out)):
        return status
    return COMPLETED if all(reading.grade == SAME for reading in found) else OTHERWISE


def _write_report(result: dict[str, Any], folder: str) -> int:
    """Write the page of a result; return the exit status."""
    with tempfile.TemporaryDirectory(prefix="crosscheck-") as place:
        path = Path(place) / "files.json"
        path.write_text(json.dumps(result), encoding="utf-8")
        return rendered([str(path), f"--out={folder}"], ".robot_files")


def _of_table(arguments: argparse.Namespace) -> int:
    table, page = (public, "real-files") if arguments.public else (records, "files")
    number = sum(map(len, public.COLLECTIONS.values())) if arguments.public else len(CASES)
    if arguments.run:
        most = number * len(arguments.engine or PLACES)
        with counted("reading, at most", most) as advance:
            new = table.measured(arguments.engine or (), arguments.install, arguments.time_limit, advance)
        rewrite(table.FILE, table.merged(new, table.read()))
    if status := write_page(page, table.FILE, arguments.page):
        return status
    found = table.read()
    if arguments.json:
        print_json([{"records": found}])
    elif arguments.public:
        _show_public(console(), found)
    else:
        _show_corpus(console(), found)
    return COMPLETED


def _show_public(out: Console, found: Sequence[records.Record]) -> None:
    table = Table("package", "file", "reader", "grade", "differences", box=SIMPLE)
    for record in found:
        cells = record["package"], record["path"], record["reader"], record["grade"], record["words"]
        table.add_row(*map(Text, cells))
    out.print(table)


def _show_corpus(out: Console, found: Sequence[records.Record]) -> None:
    for form in dict.fromkeys(record["form"] for record in found):
        own = [record for record in found if record["form"] == form]
        readers = list(dict.fromkeys(record["reader"] for record in own))
        table = Table("feature", *readers, title=form, box=SIMPLE)
        rows: dict[str, dict[str, str]] = {}
        for record in own:
            rows.setdefault(record["case"], {})[record["reader"]] = record["status"]
        for case, cells in rows.items():
            signs = [SIGNS.get(cells.get(name, ""), "–") for name in readers]
            table.add_row(case, *(Text(sign, CELLS.get(sign, "")) for sign in signs))
        out.print(table)


def document(file: File, found: Sequence[Reading], tried: Sequence[Advice]) -> dict[str, Any]:
    """Return the JSON document of a file; null is no limit, or a number that the reader does not give."""
    made: dict[str, Any] = finite(_document(file, found, tried))
    return made


def _document(file: File, found: Sequence[Reading], tried: Sequence[Advice]) -> dict[str, Any]:
    return {
        "file": str(file.path),
        "format": file.form,
        "machine": dataclasses.asdict(file.machine),
        "readers": [
            {
                "reader": reading.reader,
                "version": reading.version,
                "grade": reading.grade,
                "verdict": verdict(reading),
                "differences": [
                    {
                        **dataclasses.asdict(difference),
                        "announced": is_announced(difference, reading.messages),
                    }
                    for difference in reading.differences
                ],
                "messages": list(reading.messages),
                "unknown": dict(reading.unknown),
                "seconds": round(reading.seconds, 3),
                "machine": None if reading.machine is None else dataclasses.asdict(reading.machine),
            }
            for reading in found
        ],
        "advice": [dataclasses.asdict(each) for each in tried],
    }


def _show(out: Console, file: File, found: Sequence[Reading], tried: Sequence[Advice]) -> None:
    out.print(heading(file, SOURCES[file.form]), soft_wrap=True)
    for message in file.machine.messages:
        out.print(f"  {message}", soft_wrap=True)
    out.print()
    for reading in found:
        name = f"{reading.reader} {reading.version}"
        out.print(Text(f"{name:20} ", "bold") + Text(verdict(reading), LOOKS[reading.grade]), soft_wrap=True)
        for quantity, why in reading.unknown.items():
            out.print(f"{'':20} {quantity} not compared: {why}", style="dim", soft_wrap=True)
    wrong = [reading for reading in found if reading.differences]
    if wrong:
        out.print(_table(wrong))
    for each in tried:
        out.print(_sentence(each), soft_wrap=True)
    for reading in found:
        if reading.convention:
            out.print(f"{reading.reader}: {reading.convention}", style="dim", soft_wrap=True)


def _table(wrong: Sequence[Reading]) -> Table:
    table = Table("reader", "part", "in the file", "in the reader", box=SIMPLE)
    for reading in wrong:
        for k, difference in enumerate(reading.differences[:SHOWN]):
            values = map(shown, (difference.file, difference.reader))
            table.add_row("" if k else reading.reader, part(difference), *values)
        if len(reading.differences) > SHOWN:
            table.add_row("", f"and {len(reading.differences) - SHOWN} more: --json has all", "", "")
    return table


def _sentence(each: Advice) -> str:
    said = f"the file's machine in {', '.join(each.same)}" if each.same else ""
    more = f"fewer differences in {', '.join(each.nearer)}" if each.nearer else ""
    return f"Tried: {each.says}. Result: {'; '.join(filter(None, (said, more)))}."
