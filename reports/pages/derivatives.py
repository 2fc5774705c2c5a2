"""The page on engines' derivatives of accelerations of closed loops."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import groupby
from pathlib import Path

from crosscheck.derivatives import sentences, table
from crosscheck.derivatives.compare import (
    AT_REST,
    BLOCKS,
    FORCE,
    MOVING,
    NUMBER,
    POSITION,
    RIGHT,
    ROUGH,
    VELOCITY,
    WRONG,
    Row,
)
from crosscheck.derivatives.mechanisms import MECHANISMS
from crosscheck.derivatives.records import FILE, Record, read, rows_of
from crosscheck.derivatives.without import REASONS
from crosscheck.engine import engine_names

from ..blocks import Block, Cell, Fold, HeatMap, Listing, Parts, Table, Text, Within, listing

KINDS = {RIGHT: "kept", ROUGH: "kept", WRONG: "false"}
MOST_DIGITS = 15  # digits of a cell of the deepest colour
COLUMNS = [mechanism.name for mechanism in MECHANISMS]
TRUE = "Largest error against the judge, over positions, velocities, forces and numbers, moving and at rest."
SELF = (
    "Largest error against differences of the engine's own accelerations, with closed and with open loops. "
    "Empty where accelerations have a jump off the constraints, and where an engine has derivatives along "
    "allowed motions only."
)
PARTS = "Largest error against the judge over all mechanisms, by the variable of the derivative."
BY = {  # heading: state and block
    "position, at rest": (AT_REST, POSITION),
    "position, moving": (MOVING, POSITION),
    "velocity, moving": (MOVING, VELOCITY),
    "force, moving": (MOVING, FORCE),
    "number, moving": (MOVING, NUMBER),
}
ROWS = ("mechanism", "state", "against", *BLOCKS, "most in")
WITHOUT = ("engine", "version", "reason", "owner")


def parts(records: Path = FILE) -> Parts:
    """Return the parts of the page from the records in a file."""
    found = read(records)
    functions = table.functions(found)
    engines = [(name, [*own]) for name, own in groupby(table.ordered(found), lambda r: str(r["engine"]))]
    return {
        "overview": [
            Table("How to read a cell.", ("Sign", "Meaning"), list(table.LEGEND.items())),
            _map(TRUE, functions, table.by_judge),
        ],
        "own": [_map(SELF, functions, table.by_own)],
        "blocks": [_blocks(functions)],
        "without": [_without(found)],
        "mechanisms": [
            Table("Mechanisms of the columns.", ("Name", "Difficulty"), [m[:2] for m in MECHANISMS])
        ],
        "engines": [_engine(name, own) for name, own in engines if own[0]["functions"]],
    }


def _map(
    caption: str, functions: dict[table.Name, table.Function], chosen: Callable[[Sequence[Row]], list[Row]]
) -> HeatMap:
    rows = {
        _name(*name): [_cell(name[0], of.get(column, []), chosen) for column in COLUMNS]
        for name, of in functions.items()
    }
    return HeatMap(
        caption, "engine, function", COLUMNS, {n: c for n, c in rows.items() if any(x.text for x in c)}
    )


def _name(engine: str, function: str) -> Within:
    return Within(f"{engine}, {function}", f"#{engine}")


def _cell(engine: str, found: list[Row] | Record, chosen: Callable[[Sequence[Row]], list[Row]]) -> Cell:
    if isinstance(found, dict):
        return Cell(table.REFUSES, "", href=f"#{engine}")
    return _shown(engine, table.worst(chosen(found)))


def _shown(engine: str, row: Row | None) -> Cell:
    if row is None:
        return Cell(table.NONE, "")
    digits = max(0.0, -math.log10(max(row.error, 10.0**-MOST_DIGITS)))
    return Cell(table.shown(row), KINDS.get(row.grade, ""), digits / MOST_DIGITS, f"#{engine}")


def _blocks(functions: dict[table.Name, table.Function]) -> HeatMap:
    rows: dict[str, list[Cell]] = {}
    for name, of in functions.items():
        true = [row for rows in of.values() if isinstance(rows, list) for row in table.by_judge(rows)]
        rows[_name(*name)] = [
            _shown(name[0], table.worst(table.of_block(true, *block))) for block in BY.values()
        ]
    return HeatMap(PARTS, "engine, function", [*BY], rows)


def _without(found: Sequence[Record]) -> Table:
    measured = table.without(found)
    known = {name: (name, "", cannot.reason, cannot.owner.value) for name, cannot in REASONS.items()}
    rows = [known[name] for name in engine_names() if name in known and name not in measured]
    rows += [(name, r["version"], r["reason"], r["owner"]) for name, r in measured.items()]
    return Table("Engines without derivatives.", WITHOUT, rows)


def _engine(name: str, records: Sequence[Record]) -> Fold:
    """Return the folded results of an engine: functions, causes of errors, all errors, and the command."""
    functions = {name: about for record in records for name, about in record["functions"].items()}
    blocks: list[Block] = [Table("Functions.", ("function", "call"), list(functions.items()))]
    said = [line for record in records for line in sentences.of_rows(rows_of(record))]
    refused = [f"{r['scene']}: refused: {r['reason']} ({r['owner']})" for r in records if r["reason"]]
    blocks += listing([*said, *refused])
    for function in functions:
        rows = [row for record in records for row in rows_of(record) if row.function == function]
        if rows:
            blocks.append(Table(f"Errors of {function}.", ROWS, _lines(rows)))
    blocks += [Text("Command:"), Listing(f"crosscheck derivatives {name}")]
    versions = ", ".join(dict.fromkeys(record["version"] for record in records))
    return Fold(f"{name} {versions}", name, blocks)


def _lines(rows: Sequence[Row]) -> list[tuple[str, ...]]:
    found = []
    for (scene, state, truth), group in groupby(rows, lambda r: (r.scene, r.state, r.truth)):
        own = {row.by: row for row in group}
        most = max(own.values(), key=lambda row: row.error)
        cells = (table.shown(own.get(block)) for block in BLOCKS)
        found.append((scene, state, truth, *cells, f"`{most.worst}`"))
    return found
