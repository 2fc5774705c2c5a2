"""The table of engines (rows) and closed-loop mechanisms (columns), from records: the error of each engine on
each mechanism, at its best settings and at its defaults."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from crosscheck.closed_loops.mechanisms import DIFFICULTIES, Difficulty
from crosscheck.engine import Owner, engine_names
from crosscheck.engines.shared.terms import FAMILY as TERMS
from crosscheck.judge.tolerances import FALSE_SUCCESS, FLOOR
from crosscheck.setting import option_text
from crosscheck.study.command import command
from crosscheck.study.grades import DEFAULTS, Grade, grade
from crosscheck.study.grid import Record
from crosscheck.study.record_view import ended, error, error_bound
from crosscheck.study.search.least_errors import rank
from crosscheck.study.store import REFUSED
from mbref.motions.trajectory import Outcome

SIGNS = {Grade.RIGHT: "✓", Grade.INACCURATE: "≈", Grade.WRONG: "✗", Grade.FAILED: "!", Grade.UNJUDGED: "?"}
REFUSES, NOT_RUN = "–", "○"
NO_FAMILY = "no family of the engine's own steps serves this mechanism here"
LEGEND = {
    "✓ 3e-12": f"right: the largest error, at most {FLOOR:g} of the mechanism's length or rad",
    "≈ 3e-05": f"inaccurate: the largest error, at most {FALSE_SUCCESS:g} of the length or rad",
    "✗ 0.95": "wrong: the run completes without a message, with this error",
    "! ended": "the run ended early with a message, crashed, or did not end within its limit of CPU time",
    REFUSES: "refused: the engine or crosscheck's adapter cannot model it; the reason is below",
    NOT_RUN: "not measured",
}
PLACES = {column.scene: column.place() for column in DIFFICULTIES}


@dataclass(frozen=True, eq=False)
class Cell:
    """Results of an engine on a mechanism: the records of its runs, or the record of its refusal.

    A cell without a run has neither runs nor a refusal.
    """

    row: str
    column: Difficulty
    records: Sequence[Record]

    def best(self) -> Record | None:
        """Return the run of least error; without a completed run the run that got furthest, or the
        refusal."""
        return min(self.records, key=_order, default=None)

    def defaults(self) -> Record | None:
        """Return the best run with the library's default settings, or the refusal; None if the engine has no
        default settings."""
        own = [r for r in self.records if is_refusal(r) or r["family"] == DEFAULTS]
        return min(own, key=_order, default=None)

    def families(self) -> Mapping[str, Record]:
        """Return the best run of every family."""
        names = dict.fromkeys(r["family"] for r in self.records if not is_refusal(r))
        return {name: min((r for r in self.records if r["family"] == name), key=_order) for name in names}


def is_refusal(record: Record) -> bool:
    """Return whether a record is a refusal."""
    return bool(record["outcome"] == REFUSED)


def is_run(record: Record | None) -> bool:
    """Return whether a record exists and is the record of a run."""
    return record is not None and not is_refusal(record)


def _order(record: Record) -> tuple[bool, float, float]:
    return rank(record) if not is_refusal(record) else (True, 0.0, 0.0)


def matrix(records: Sequence[Record]) -> dict[str, dict[str, Cell]]:
    """Return the cells by row and by heading of the column; rows in the order of the engine table.

    A row is an engine with its own integrators, or the engine's equations in crosscheck's integrator, which
    closes the loops.
    """
    found: dict[str, list[Record]] = {}
    for name in engine_names():
        of_engine = [record for record in records if record["engine"] == name]
        on_terms = [record for record in of_engine if record.get("family") == TERMS]
        own = [record for record in of_engine if record.get("family") != TERMS]
        found[name] = own + _unserved(own, on_terms)
        found[f"{name}, terms"] = [*on_terms, *filter(is_refusal, own)] if on_terms else []
    return {
        row: {column.heading: Cell(row, column, _of(group, column)) for column in DIFFICULTIES}
        for row, group in found.items()
        if group
    }


def _of(records: Sequence[Record], column: Difficulty) -> list[Record]:
    return [record for record in records if record["scene"] == column.scene]


def _unserved(own: Sequence[Record], on_terms: Sequence[Record]) -> list[Record]:
    """Return refusals of the scenes that an engine's own integrators cannot run, but its equations in
    crosscheck's integrator can."""
    served = {record["scene"] for record in own}
    reason = {"outcome": REFUSED, "message": NO_FAMILY, "owner": Owner.ADAPTER.value}
    return [{**record, **reason} for record in on_terms if record["scene"] not in served]


def shown(record: Record | None) -> str:
    """Return a cell's text: symbol and error, or the outcome of the run."""
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
    """Return the error with one digit, or the bound on the error of the truth if the bound is larger."""
    value, bound = error(record), error_bound(record)
    if value < bound:
        return f"<{bound:.0e}"
    return f"{value:.2g}" if value > FALSE_SUCCESS else f"{value:.0e}"


def sentence(record: Record) -> str:
    """Return the setting and the error of a record, or the reason of a refusal or an early end."""
    if is_refusal(record):
        return f"refused: {record['message']} ({record['owner']})"
    options = ", ".join(f"{k} {option_text(v)}" for k, v in record["asked"]["options"].items())
    how = f"{record['family']} ({options})" if options else record["family"]
    if grade(record) is Grade.FAILED:
        return f"{how}: {ended(record)}. {record['message']}".rstrip(". ") + "."
    seconds = record["cost"]["seconds"]
    return f"{how}: largest error {_size(record)}, {seconds:.2g} s of CPU time"


def rerun(record: Record) -> str:
    """Return the command that makes a run again; empty for a refusal."""
    return "" if is_refusal(record) else command(record, PLACES[record["scene"]])
