"""`crosscheck findings`: stored violations found in engines, and whether the installed versions still have
them."""

from __future__ import annotations

from collections.abc import Sequence

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from crosscheck.cli.request import RequestError
from crosscheck.files.rechecks import Cells, cells
from crosscheck.findings.finding import Finding, findings
from crosscheck.study.progress import counted
from mbref.scene.fields import meant


def chosen(names: Sequence[str]) -> list[Finding | Cells]:
    """Return the findings of the given names, or all; raises RequestError for an unknown name.

    A reader of robot files that differs from the formats is a finding too, such as ``files-drake``.
    """
    known: dict[str, Finding | Cells] = {found.name: found for found in findings()}
    known |= cells()
    if faults := [
        f"unknown finding {name!r}; known: {', '.join(known)}{meant(name, known)}"
        for name in names
        if name not in known
    ]:
        raise RequestError(*faults)
    return [known[name] for name in names or known]


def show(console: Console, names: Sequence[str], recheck: bool) -> None:
    """Print findings; with ``recheck`` run the proof of each and print its result in a further column."""
    wanted = chosen(names)
    columns = ["finding", "engine", "found in", "what it does"]
    table = Table(*columns, *(["installed", "status", "measured"] if recheck else []), box=SIMPLE)
    files = [len(found.all) for found in wanted if isinstance(found, Cells)]
    proofs = sum(files) + len(wanted) - len(files)
    with counted("running proofs", proofs if recheck else 0) as advance:
        for found in wanted:
            row, answer = [found.name, found.engine, found.version, found.does], None
            if recheck and isinstance(found, Cells):
                answer = found.recheck(advance)
            elif recheck and isinstance(found, Finding):
                answer = found.recheck()
                advance(found.name)
            if answer is not None:
                row += [answer.version or "–", answer.status.value, answer.words]
            table.add_row(*row)
    console.print(table)
