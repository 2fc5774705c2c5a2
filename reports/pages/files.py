"""The page on readers of robot files: what each one makes of each feature of the corpus."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from crosscheck.files.corpus import CASES
from crosscheck.files.corpus.case import Case
from crosscheck.files.records import FILE, REFUSED, SAID, SAME, SILENT, WRONG, Record, read

from ..blocks import Fold, Marked, Parts, Table, listing

SIGNS = {
    SAME: "✓",
    SAID: "dropped, said",
    SILENT: "**dropped**",
    WRONG: "**wrong**",
    REFUSED: "refused",
}
LONGEST = 400  # characters of a reader's message


def parts(records: Path = FILE) -> Parts:
    """Return the parts of the page from the records in a file."""
    found = read(records)
    made: dict[str, Any] = {
        form.lower(): _of_form(form, [record for record in found if record["form"] == form])
        for form in ("MJCF", "URDF", "SDF")
    }
    names = list(dict.fromkeys(record["reader"] for record in found))
    versions = {record["reader"]: record["version"] for record in found}
    counts = [(name, versions[name], *_counts(found, name)) for name in names]
    header = ("reader", "version", *SIGNS)
    made["counts"] = [Table("Files of the corpus.", header, counts, frozenset(range(2, 7)))]
    made["number"] = str(len(CASES))
    return made


def _counts(records: Sequence[Record], name: str) -> list[str]:
    own = [record["status"] for record in records if record["reader"] == name]
    return [str(own.count(status)) for status in SIGNS]


def _of_form(form: str, records: Sequence[Record]) -> list[Table | Fold]:
    """Return the table of features and readers, and what is behind each of its cells."""
    readers = list(dict.fromkeys(record["reader"] for record in records))
    cells = {(record["case"], record["reader"]): record for record in records}
    cases = [case for case in CASES if case.form == form]
    rows = [(case.name, *(Marked(_sign(cells.get((case.name, name)))) for name in readers)) for case in cases]
    lines = [line for case in cases for line in _lines(case, cells, readers)]
    table = Table(f"{form}: feature and reader.", ("feature", *readers), rows)
    return [table, Fold(f"{form}: numbers behind the cells", f"{form.lower()}-numbers", listing(lines))]


def _sign(record: Record | None) -> str:
    return "–" if record is None else SIGNS[record["status"]]


def _lines(case: Case, cells: dict[tuple[str, str], Record], readers: Sequence[str]) -> Iterator[str]:
    """Yield what is right and, for each reader that differs, how."""
    yield f"{case.name}: {case.why} ({case.section})"
    for name in readers:
        record = cells.get((case.name, name))
        if record is not None and record["status"] != SAME:
            words = record["words"]
            said = words if len(words) <= LONGEST else f"{words[:LONGEST]}…"
            yield f"{case.name}, {name} {record['version']}: {record['status']}: {said}"
