"""The page on small motions of engines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from crosscheck.small_motions.mechanisms import MECHANISMS
from crosscheck.small_motions.records import FILE, Record, read
from crosscheck.small_motions.sentences import heading, method, search, size, written

from ..blocks import Fold, Parts, Table, listing


def parts(records: Path = FILE) -> Parts:
    """Return the parts of the page from the records in a file."""
    found = read(records)
    about = {mechanism.name: mechanism.about for mechanism in MECHANISMS}
    scenes = list(dict.fromkeys(record["scene"] for record in found))
    poses = {name: [_pose(record) for record in found if record["scene"] == name] for name in scenes}
    folded = [Fold(f"{name}: {about.get(name, '')}", name, listing(lines)) for name, lines in poses.items()]
    return {"table": [_table(found, scenes)], "refusals": listing(_refusals(found)), "mechanisms": folded}


def _table(records: Sequence[Record], scenes: Sequence[str]) -> Table:
    """Return the table of the largest error of each method over the poses of each mechanism."""
    cells: dict[str, dict[str, list[float | None]]] = {}
    for record in records:
        errors = {"judge": record["error"], "mbref modes": record["mbref_error"]}
        errors |= {method(each): each["error"] for each in record["results"] if each["way"]}
        for name, value in errors.items():
            cells.setdefault(name, {}).setdefault(record["scene"], []).append(value)
    first = [name for name in ("judge", "mbref modes") if name in cells]
    rows = [
        (name, *(_largest(cells[name].get(scene, [])) for scene in scenes))
        for name in [*first, *sorted(set(cells) - set(first))]
    ]
    return Table("Largest errors.", ("method", *scenes), rows, frozenset(range(1, 1 + len(scenes))))


def _largest(values: Sequence[float | None]) -> str:
    known = [value for value in values if value is not None]
    return size(max(known)) if known else "–"


def _refusals(records: Sequence[Record]) -> Iterator[str]:
    """Yield a line for each reason why an engine has no eigenvalues."""
    found = {
        (record["scene"], each["engine"], each["reason"]): None
        for record in records
        for each in record["results"]
        if each["reason"]
    }
    yield from (f"{name} without {scene}: {reason}." for scene, name, reason in sorted(found))


def _pose(record: Record) -> str:
    listed = ", ".join(written(*s) for s in record["eigenvalues"])
    return f"{heading(record)}: s = {listed} 1/s. {search(record)}"
