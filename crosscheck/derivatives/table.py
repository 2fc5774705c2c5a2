"""Tables of engines' derivatives from records: the largest error of each function, by mechanism and block."""

from __future__ import annotations

from collections.abc import Sequence

from crosscheck.derivatives.compare import JUDGE, MOST, OWN, RIGHT, ROUGH, UNDECIDED, WRONG, Row
from crosscheck.derivatives.records import rows_of
from crosscheck.engine import engine_names
from crosscheck.study.record_shape import Record

SIGNS = {RIGHT: "✓", ROUGH: "≈", WRONG: "✗", UNDECIDED: "?"}
REFUSES, NONE = "–", ""
LEGEND = {
    "✓ 3e-12": f"right: the largest error, at most {MOST[RIGHT]:g} of the largest derivative",
    "≈ 3e-05": f"rough: the largest error, at most {MOST[ROUGH]:g} of the largest derivative",
    "✗ 0.95": "wrong: this error, of the largest derivative",
    "?": "undecided: the differences with which the engine is compared are not more accurate",
    REFUSES: "refused: the engine or crosscheck's adapter cannot; the reason is below",
    "empty": "the function has no such derivatives, or they are not compared",
}
Name = tuple[str, str]  # engine and function
Function = dict[str, list[Row] | Record]  # by mechanism: rows, or the record of a refusal


def functions(records: Sequence[Record]) -> dict[Name, Function]:
    """Return rows or refusals by mechanism, of each function of each engine with such functions, in the order
    of the table of engines."""
    found: dict[Name, Function] = {}
    for record in ordered(records):
        for function in record["functions"]:
            rows = [row for row in rows_of(record) if row.function == function]
            found.setdefault((record["engine"], function), {})[record["scene"]] = rows or record
    return found


def ordered(records: Sequence[Record]) -> list[Record]:
    """Return records in the order of the table of engines, engines of others last."""
    known = list(engine_names())
    return sorted(records, key=lambda r: known.index(r["engine"]) if r["engine"] in known else len(known))


def without(records: Sequence[Record]) -> dict[str, Record]:
    """Return the first record of each engine that has no function for derivatives."""
    found: dict[str, Record] = {}
    for record in ordered(records):
        if not record["functions"]:
            found.setdefault(record["engine"], record)
    return found


def worst(rows: Sequence[Row]) -> Row | None:
    """Return the row with the largest error; undecided rows count only if there are no others."""
    decided = [row for row in rows if row.grade != UNDECIDED]
    return max(decided or rows, key=lambda row: row.error, default=None)


def by_judge(rows: Sequence[Row]) -> list[Row]:
    """Return the rows that are compared with the judge."""
    return [row for row in rows if row.truth == JUDGE]


def by_own(rows: Sequence[Row]) -> list[Row]:
    """Return the rows that are compared with differences of the engine's own accelerations."""
    return [row for row in rows if row.truth == OWN]


def of_block(rows: Sequence[Row], state: str, by: str) -> list[Row]:
    """Return the rows of a block at a state."""
    return [row for row in rows if (row.state, row.by) == (state, by)]


def shown(row: Row | None) -> str:
    """Return a cell's text: sign and error."""
    if row is None:
        return NONE
    if row.grade == UNDECIDED:
        return SIGNS[UNDECIDED]
    return f"{SIGNS[row.grade]} {size(row.error)}"


def size(error: float) -> str:
    """Return an error with one digit; less than rounding as a bound."""
    if error < 1e-15:
        return "<1e-15"
    return f"{error:.2g}" if error > MOST[ROUGH] else f"{error:.0e}"
