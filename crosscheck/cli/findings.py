"""`crosscheck findings`: stored violations found in engines, and whether the installed versions still have
them."""

from __future__ import annotations

from collections.abc import Sequence

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from crosscheck.cli.request import RequestError
from crosscheck.findings.finding import Finding, findings
from crosscheck.study.progress import counted
from mbref.scene.fields import meant


def chosen(names: Sequence[str]) -> list[Finding]:
    """Return the findings of the given names, or all findings; raises RequestError for an unknown name."""
    known = {found.name: found for found in findings()}
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
    with counted("running proofs", len(wanted) if recheck else 0) as advance:
        for found in wanted:
            cells = [found.name, found.engine, found.version, found.does]
            if recheck:
                answer = found.recheck()
                cells += [answer.version or "–", answer.status.value, answer.words]
                advance(found.name)
            table.add_row(*cells)
    console.print(table)
