"""Stored cells of the table of readers in which a reader differs, checked against the installed reader."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from crosscheck.files.records import REFUSED, SILENT, WRONG, Record, measured, read
from crosscheck.findings.finding import Answer, Status

WRONGLY = (WRONG, SILENT, REFUSED)
PREFIX = "files-"  # begins the name of a reader among the findings
LIMIT = 120.0  # s of CPU time of a file
SHOWN = 3  # changed cells in an answer


class Cells(NamedTuple):
    """Stored cells of a reader: ``all``, and the ``wrong`` ones: other, silently dropped or refused parts."""

    engine: str
    version: str
    all: Sequence[Record]
    wrong: Sequence[Record]

    @property
    def name(self) -> str:
        """Return the reader's name among the findings."""
        return f"{PREFIX}{self.engine}"

    @property
    def does(self) -> str:
        """Return a sentence on the reader."""
        return (
            f"differs from the format without a message, or refuses the file, in {len(self.wrong)} of "
            f"{len(self.all)} small files; `crosscheck files` lists them."
        )

    def recheck(self, progress: Callable[[str], None]) -> Answer:
        """Read all files of the table by the installed reader, and compare with the stored cells."""
        new = measured([self.engine], install=False, time_limit=LIMIT, progress=progress)
        if not new:
            return Answer(Status.ABSENT, "", None, f"crosscheck files --engine {self.engine} --install")
        wrong = sum(record["status"] in WRONGLY for record in new)
        old = {record["key"]: record["status"] for record in self.all}
        changed = [f"{r['form']} {r['case']}: {r['status']}" for r in new if old.get(r["key"]) != r["status"]]
        more = f" and {len(changed) - SHOWN} more" if len(changed) > SHOWN else ""
        words = f"{wrong} files; changed: {', '.join(changed[:SHOWN]) or 'none'}{more}"
        return Answer(Status.PRESENT if wrong else Status.GONE, new[0]["version"], float(wrong), words)


def cells() -> Mapping[str, Cells]:
    """Return the stored cells of each reader that differs in a file, by the name ``files-READER``."""
    found: dict[str, list[Record]] = {}
    for record in read():
        found.setdefault(record["reader"], []).append(record)
    made = [
        Cells(name, own[0]["version"], own, [record for record in own if record["status"] in WRONGLY])
        for name, own in found.items()
    ]
    return {each.name: each for each in made if each.wrong}
