"""Stored readings of the corpus: what each reader makes of each feature."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from crosscheck.engines.loaders import PLACES
from crosscheck.files.corpus import CASES
from crosscheck.files.corpus.case import Case
from crosscheck.files.differences import LOST, Difference
from crosscheck.files.readers import found_readers
from crosscheck.files.reading import File, Reader, Reading, file_of, read_in
from crosscheck.files.words import is_announced, sentences
from crosscheck.processes.child import Child
from mbref.records import looked_at

FIELDS = {"lower": "limits", "upper": "limits", "anchors": "anchor", "coefficients": "law"}
FILE = Path(__file__).parent / "records.jsonl.xz"
Record = dict[str, Any]

SAME, SAID, SILENT, WRONG, REFUSED = (
    "same",
    "dropped with a message",
    "dropped silently",
    "wrong",
    "refused",
)


def measured(
    names: Sequence[str], install: bool, time_limit: float, progress: Callable[[str], None]
) -> list[Record]:
    """Return a record for each file of the corpus and each reader of its format.

    Differences that a reader already has at the first file of a format, an arm of two hinges, count there
    alone, unless the feature is about them. Raises UnknownReader, NotInstalled.
    """
    found: list[Record] = []
    with TemporaryDirectory(prefix="crosscheck-") as folder:
        for form in dict.fromkeys(case.form for case in CASES):
            readers, _ = found_readers(names, form, install)
            files = [(case, _written(folder, case)) for case in CASES if case.form == form]
            for reader in readers:
                found += _of_reader(reader, files, time_limit, progress)
    return found


def _written(folder: str, case: Case) -> File:
    path = Path(folder) / case.form / case.file
    path.parent.mkdir(exist_ok=True)
    path.write_text(case.text)
    return file_of(path)


def _of_reader(
    reader: Reader, files: Sequence[tuple[Case, File]], limit: float, progress: Callable[[str], None]
) -> list[Record]:
    found, waiting, usual = list[Record](), list(files), set[tuple[str, ...]]()
    while waiting:
        with closing(Child(reader.python)) as child:  # for files in turn, until one of them ends it
            while waiting and child.is_alive:
                case, file = waiting.pop(0)
                reading = read_in(child, reader, file, limit)
                if case is files[0][0]:
                    usual = {_signature(difference) for difference in reading.differences}
                record = _record(case, reading, set() if case is files[0][0] else usual)
                found.append(record | {"words": record["words"].replace(f"{file.path.parent}/", "")})
                progress(f"{reader.name}: {case.form} {case.name}: {found[-1]['status']}")
    return found


def _signature(difference: Difference) -> tuple[str, ...]:
    return difference.kind, difference.part, difference.field


def _record(case: Case, reading: Reading, usual: set[tuple[str, ...]]) -> Record:
    about = {FIELDS.get(name, name) for path in case.right for name in path.split()[-1:]}
    own = [d for d in reading.differences if _signature(d) not in usual or d.field in about]
    return {
        "key": f"{case.form} {case.name} {reading.reader}",
        "form": case.form,
        "case": case.name,
        "reader": reading.reader,
        "version": reading.version,
        "status": _status(own, reading),
        "words": reading.refusal or "; ".join(sentences(own, reading.messages)),
    }


def _status(own: Sequence[Difference], reading: Reading) -> str:
    if reading.refusal:
        return REFUSED
    if not own:
        return SAME
    if any(difference.kind != LOST for difference in own):
        return WRONG
    return SAID if all(is_announced(d, reading.messages) for d in own) else SILENT


def merged(new: Sequence[Record], old: Sequence[Record]) -> list[Record]:
    """Return new records and the old ones of readers and files that were not measured again, in order."""
    cases = {(case.form, case.name): k for k, case in enumerate(CASES)}
    places = {name: k for k, name in enumerate(PLACES)}
    known = {record["key"]: record for record in (*old, *new)}
    kept = [r for r in known.values() if (r["form"], r["case"]) in cases and r["reader"] in places]
    return sorted(kept, key=lambda r: (cases[r["form"], r["case"]], places[r["reader"]]))


def read(path: Path = FILE) -> list[Record]:
    """Return the stored records."""
    return list(looked_at(path).values())
