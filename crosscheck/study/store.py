"""The store of records: files that are read with checks of their fields, and packed folders of reports."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from pydantic import BaseModel

from crosscheck.engine import Cannot, engine
from crosscheck.study.provenance import made_by
from crosscheck.study.record_shape import Cost, Measured, Record, Refused, Run, checked
from mbref.records import RecordsError, looked_at, strict_json
from mbref.scene import Scene, SceneError

REFUSED = "REFUSED"  # outcome of a record without a run
METRICS, ORIGIN = ("error", "error_bound", "violation_position"), ("time_limit", "commit", "date")
DIGITS = 6  # of measured numbers in records without motions; tables show two
KEY = 16  # hexadecimal digits of a key there: a thousand runs share one with a probability of 1e-13
PACK = "records.zip"  # name of the file in which a folder's records and scenes are packed
PACKED = ("*.jsonl", "*.json", "*.toml")
MOTION = ("bodies", "reactions", "open_reactions", "angles", "crossings")  # fields of a run's motion
ALWAYS = (1980, 1, 1, 0, 0, 0)  # date of packed files: equal records give equal bytes


def read(path: Path, shape: type[BaseModel] = Run) -> dict[str, Record]:
    """Return the records of a file by key; empty if there is no file. Raises RecordsError."""
    found = looked_at(path)
    checked(path, list(found.values()), shape)
    return found


def read_scenes(folder: Path) -> list[Scene]:
    """Return the scenes of a report's folder; raises RecordsError that names a faulty file, OSError."""
    found = []
    for path in sorted((folder / "scenes").glob("*.toml")):
        try:
            found.append(Scene.from_file(path))
        except SceneError as error:
            raise RecordsError(f"{path}: {error.faults[0]}") from None
    return found


def read_runs(path: Path) -> list[Record]:
    """Return runs without motions, by short keys, and refusals, in their order; empty if there is no file.

    Raises RecordsError.
    """
    found = list(looked_at(path).values())
    for record in found:
        is_refusal = record.get("outcome") == REFUSED
        checked(path, [record], Refused if is_refusal else Measured)
        if not is_refusal:
            record["key"] = short_key(record["key"])
    return found


def short_key(key: str) -> str:
    """Return the key of a run's record without its motion."""
    return key[:KEY]


def short(record: Record) -> Record:
    """Return a run's record with the fields that tables read, in DIGITS digits, and with its origin."""
    metrics, cost = record["metrics"], record["cost"]
    measured = {name: metrics[name] for name in METRICS if math.isfinite(metrics.get(name) or 0.0)}
    return {name: record[name] for name in (*Measured.model_fields, *ORIGIN)} | {
        "key": short_key(record["key"]),
        "metrics": in_digits(measured),
        "cost": in_digits({name: cost[name] for name in Cost.model_fields}),
    }


def in_digits(values: Any, digits: int = DIGITS) -> Any:
    """Return numbers in lists and dictionaries, rounded to significant digits; whole numbers stay."""
    if isinstance(values, dict):
        return {name: in_digits(value, digits) for name, value in values.items()}
    if isinstance(values, list):
        return [in_digits(value, digits) for value in values]
    return float(f"{values:.{digits}g}") if isinstance(values, float) else values


def refusal(key: str, scene: str, name: str, cannot: Cannot) -> Record:
    """Return the record of an engine's refusal of a scene."""
    origin = made_by()
    return {
        "key": key,
        "scene": scene,
        "engine": name,
        "version": engine(name).version(),
        "outcome": REFUSED,
        "owner": cannot.owner.value,
        "message": cannot.reason,
        **{part: origin[part] for part in ("commit", "date")},
    }


@contextmanager
def unpacked(folder: Path) -> Iterator[Path]:
    """Yield a report's folder with its records as files: the folder itself, or a temporary one if its records
    are packed. Raises RecordsError for a damaged pack."""
    if not (folder / PACK).exists():
        yield folder
        return
    with TemporaryDirectory() as place:
        _extract(folder / PACK, place)
        yield Path(place)


def _extract(path: Path, place: str) -> None:
    import zlib
    from lzma import LZMAError

    try:
        with zipfile.ZipFile(path) as archive:
            archive.extractall(place)
    except (zipfile.BadZipFile, LZMAError, zlib.error, EOFError, RuntimeError):
        raise RecordsError(f"{path}: is damaged; restore it") from None


def pack(source: Path, folder: Path, dropped: Collection[str] = ()) -> None:
    """Write the records and scenes of a folder as one compressed file into another folder.

    Fields ``dropped`` of records are left out.
    """
    with unpacked(source) as place:
        paths = sorted(path for pattern in PACKED for path in place.rglob(pattern))
        texts = {path.relative_to(place).as_posix(): _text(path, dropped) for path in paths}
    folder.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(folder / PACK, "w") as archive:
        for name, text in texts.items():
            archive.writestr(zipfile.ZipInfo(name, ALWAYS), text, zipfile.ZIP_LZMA)


def _text(path: Path, dropped: Collection[str]) -> str:
    if path.suffix != ".jsonl" or not dropped:
        return path.read_text()
    records = ({k: v for k, v in r.items() if k not in dropped} for r in looked_at(path).values())
    return "".join(strict_json(record) + "\n" for record in records)
