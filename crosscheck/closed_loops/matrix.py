"""The matrix from its records: the grade of every engine on every mechanism, at best and by defaults."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from crosscheck.closed_loops.mechanisms import DIFFICULTIES, Difficulty
from crosscheck.closed_loops.records import REFUSED
from crosscheck.engine import engine_names
from crosscheck.judge.tolerances import FALSE_SUCCESS, FLOOR
from crosscheck.study.command import command
from crosscheck.study.grid import Record
from crosscheck.study.least_errors import rank
from crosscheck.study.record_view import ended, error, error_bound
from crosscheck.study.verdict import DEFAULTS, Grade, grade
from mbref.trajectory import Outcome

SIGNS = {Grade.RIGHT: "✓", Grade.INACCURATE: "≈", Grade.WRONG: "✗", Grade.FAILED: "!", Grade.UNJUDGED: "?"}
REFUSES, NOT_RUN = "–", ""
LEGEND = {
    "✓ 3e-12": f"right: the largest error, at most {FLOOR:g} of the mechanism's length or rad",
    "≈ 3e-05": f"accurate to this error, at most {FALSE_SUCCESS:g}",
    "✗ 0.95": "wrong: the run completes without a message, and this is its error",
    "! ended": "the run ended early with a message, crashed, or did not end within its limit of CPU time",
    REFUSES: "refused: the engine or crosscheck's adapter cannot model it; the reason is below",
}
PLACES = {column.scene: column.place() for column in DIFFICULTIES}


@dataclass(frozen=True)
class Cell:
    """An engine on a mechanism: the records of its runs, or its refusal alone; none where nothing ran."""

    engine: str
    column: Difficulty
    records: Sequence[Record]

    def best(self) -> Record | None:
        """Return the run of least error, otherwise the one that got furthest, or the refusal."""
        return min(self.records, key=_order, default=None)

    def defaults(self) -> Record | None:
        """Return the best run by the library's defaults, or the refusal; None if it has no such family."""
        own = [r for r in self.records if is_refusal(r) or r["family"] == DEFAULTS]
        return min(own, key=_order, default=None)

    def families(self) -> Mapping[str, Record]:
        """Return the best run of every family."""
        names = dict.fromkeys(r["family"] for r in self.records if not is_refusal(r))
        return {name: min((r for r in self.records if r["family"] == name), key=_order) for name in names}

    @property
    def place(self) -> str:
        """The id of the cell's records in a page."""
        return f"{self.engine}-{self.column.scene}".replace("_", "-")


def is_refusal(record: Record) -> bool:
    """Return whether a record is a refusal."""
    return bool(record["outcome"] == REFUSED)


def _order(record: Record) -> tuple[bool, float, float]:
    return rank(record) if not is_refusal(record) else (True, 0.0, 0.0)


def matrix(records: Sequence[Record]) -> dict[str, dict[str, Cell]]:
    """Return the cells by engine and by heading of the column; engines in the order of the engine table."""
    measured = {record["engine"] for record in records}
    ordered = [name for name in engine_names() if name in measured]
    return {
        name: {
            column.heading: Cell(name, column, [r for r in records if _is_of(r, name, column)])
            for column in DIFFICULTIES
        }
        for name in ordered
    }


def _is_of(record: Record, name: str, column: Difficulty) -> bool:
    return bool(record["engine"] == name and record["scene"] == column.scene)


def shown(record: Record | None) -> str:
    """Return a cell's text: sign and error, or how the run ended."""
    if record is None:
        return NOT_RUN
    if is_refusal(record):
        return REFUSES
    found = grade(record)
    text = _ended(record) if found is Grade.FAILED else _size(record)
    return f"{SIGNS[found]} {text}"


def _ended(record: Record) -> str:
    known = {Outcome.CRASHED.label: "crashed", Outcome.TIMED_OUT.label: "no end"}
    return known.get(record["outcome"], "ended")


def _size(record: Record) -> str:
    """The error to one digit, or the truth's own bound where that is larger."""
    value, bound = error(record), error_bound(record)
    if value < bound:
        return f"<{bound:.0e}"
    return f"{value:.2g}" if value > FALSE_SUCCESS else f"{value:.0e}"


def sentence(record: Record) -> str:
    """Return what a record says: its setting and its error, or the reason of a refusal or an end."""
    if is_refusal(record):
        return f"refused: {record['message']} ({record['owner']})"
    options = ", ".join(f"{k} {v:g}" if isinstance(v, float) else f"{k} {v}" for k, v in _options(record))
    how = f"{record['family']} ({options})" if options else record["family"]
    if grade(record) is Grade.FAILED:
        return f"{how}: {ended(record)}. {record['message']}".rstrip(". ") + "."
    seconds = record["cost"]["seconds"]
    return f"{how}: largest error {_size(record)}, {seconds:.2g} s of CPU time"


def _options(record: Record) -> Sequence[tuple[str, object]]:
    return list(record["asked"]["options"].items())


def rerun(record: Record) -> str:
    """Return the command that makes a run again; empty for a refusal."""
    return "" if is_refusal(record) else command(record, PLACES[record["scene"]])
