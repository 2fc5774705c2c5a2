"""The page on public files of robots: which machine each reader makes of each file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from crosscheck.files.public import COLLECTIONS, FAULTY, FILE, READERS, Record, read
from crosscheck.files.reading import ALMOST, ANOTHER, REFUSED, SAME

from ..blocks import Fold, Marked, Parts, Table, listing

SIGNS = {SAME: "✓", ALMOST: "except", ANOTHER: "**other**", REFUSED: "refused"}
GRADES = tuple(SIGNS)
LONGEST = 21  # letters of a file's name in the table


def parts(records: Path = FILE) -> Parts:
    """Return the parts of the page from the records in a file."""
    found = [record for record in read(records) if record["reader"]]
    order = [name for name in READERS if any(record["reader"] == name for record in found)]
    files = [(package, path) for package, paths in COLLECTIONS.items() for path in paths]
    faulty = [record for record in read(records) if record["grade"] == FAULTY]
    lines = [f"{_label(r)}, {r['reader']}: {r['grade']}: {r['words']}" for r in found if r["grade"] != SAME]
    lines += [f"{_label(record)}: {FAULTY}: {record['words']}" for record in faulty]
    return {
        "number": str(len(files)),
        "packages": str(len(COLLECTIONS)),
        "counts": [_counts(found, order)],
        "files": [_files(found, order)],
        "causes": [_causes(found, order)],
        "seconds": _seconds(found),
        "numbers": [Fold("Files: differences behind the cells", "numbers", listing(lines))],
    }


def _label(record: Record) -> str:
    return f"{record['package'].partition('==')[0]} {record['path'].rpartition('share/')[2]}"


def _counts(found: Sequence[Record], names: Sequence[str]) -> Table:
    rows = []
    for name in names:
        own = [record for record in found if record["reader"] == name]
        counts = [str(sum(record["grade"] == grade for record in own)) for grade in GRADES]
        rows.append((name, own[-1]["version"], *counts, f"{max(record['seconds'] for record in own):.1f}"))
    header = ("reader", "version", *GRADES, "most CPU s")
    return Table("Public files by grade.", header, rows, frozenset(range(2, 3 + len(GRADES))))


def _files(found: Sequence[Record], names: Sequence[str]) -> Table:
    cells = {(r["package"], r["path"], r["reader"]): Marked(SIGNS[r["grade"]]) for r in found}
    rows: list[Sequence[str]] = []
    for package, paths in COLLECTIONS.items():
        rows.append((Marked(f"**{package.replace('==', ' ')}**"), *[""] * len(names)))
        for path in paths:
            own = [cells.get((package, path, reader), "–") for reader in names]
            rows.append((_short(path), *own))
    return Table("Public files and readers.", ("file", *names), rows)


def _short(path: str) -> str:
    """Return the name of a file, with its folder if many files have the name."""
    *_, folder, name = path.split("/")
    label = f"{folder}/{name}" if name.startswith(("model.", "robot.", "reach.")) else name
    return label if len(label) <= LONGEST else f"…{label[-LONGEST:]}"


def _causes(found: Sequence[Record], names: Sequence[str]) -> Table:
    """Return the differences of each reader by the number of files that have them."""
    rows = []
    for name in names:
        own = [record for record in found if record["reader"] == name]
        counts = Counter(cause for record in own for cause in record["causes"])
        rows += [(name, cause, str(count)) for cause, count in counts.most_common()]
    return Table(
        "Differences by the number of files.", ("reader", "difference", "files"), rows, frozenset({2})
    )


def _seconds(found: Sequence[Record]) -> str:
    """Return the largest sum of CPU times of one file."""
    sums = Counter[tuple[str, str]]()
    for record in found:
        sums[record["package"], record["path"]] += record["seconds"]
    return f"{max(sums.values()):.0f}"
