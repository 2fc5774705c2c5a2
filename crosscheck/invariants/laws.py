"""Laws of invariants: numbers of each row's runs, and the power with which they grow, from stored records."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from crosscheck.invariants.records import BEST, Record
from crosscheck.judge.metrics import order_of_convergence
from crosscheck.study.grades import DEFAULTS
from crosscheck.study.store import REFUSED
from mbref.motions.trajectory import Outcome

ROUNDING = 1e-12  # values up to this are roundings of some thousand steps
ANY = -math.inf  # least power of a law
OTHER, SOLVERS = "other", "differences of a solver from Newton's at equal settings, by size and step"
TITLES = {
    DEFAULTS: "by the library's defaults",
    BEST: "at the engine's best settings",
    OTHER: "by other families and options",
}


class Column(NamedTuple):
    """A column of the table: a value of an experiment, shown at ``at`` (None: at the finest setting)."""

    heading: str
    about: str
    experiment: str
    value: str
    at: float | None = None
    unit: str = ""


COLUMNS = (
    Column(
        "momentum",
        "A ring of four rods spins in flight at 10 rad/s. Drift of its momentum in 1 s, relative to Σ m |v|; "
        "power of the step.",
        "flight",
        "momentum",
    ),
    Column(
        "angular momentum",
        "The drift of its angular momentum in 1 s, relative to Σ m |v| times its length plus Σ |J ω|; power "
        "of the step.",
        "flight",
        "angular momentum",
    ),
    Column(
        "spin",
        "The drift of its angular momentum in 1 s at 20 rad/s, with as many steps in a turn as before; power "
        "of the spin, from 5 to 40 rad/s.",
        "spin",
        "angular momentum",
        20.0,
        "rad/s",
    ),
    Column(
        "energy",
        "A slider-crank whirls at 30 rad/s without losses. Trend of its energy in 1 s, relative to the "
        "largest energy: + is a gain; power of the step.",
        "whirl",
        "energy",
    ),
    Column(
        "size",
        "Two chains of four slider-cranks, of 1 cm for 1 m and of equal density, move under gravity. "
        "Difference of the motions in lengths or rad, with steps in proportion to the time; power of the "
        "size, from 1 mm to 100 m.",
        "size",
        "motion",
        0.01,
        "m",
    ),
    Column(
        "distance",
        "A four-bar swings under gravity at 100 m from the origin. Difference from its motion at the origin; "
        "power of the distance, from 1 m to 1 km.",
        "distance",
        "motion",
        100.0,
        "m",
    ),
    Column(
        "finest step",
        "Error of the four-bar's motion at the finest setting, and the power of the step; a negative power "
        "says that finer steps are worse.",
        "steps",
        "error",
    ),
)
SIMILAR = "A four-bar swings under gravity, with steps in proportion to the time. "
OF_SOLVERS = (
    Column(
        "size",
        f"{SIMILAR}Difference at 100 m; power of the size, from 1 m to 1 km.",
        "solver by size",
        "motion",
        100.0,
        "m",
    ),
    Column(
        "size and tolerance",
        "Difference at 100 m with a tolerance in inverse proportion to the square of the size; power of the "
        "size, from 1 cm to 100 m.",
        "solver by size and tolerance",
        "motion",
        100.0,
        "m",
    ),
    Column(
        "step",
        "Difference at 100 m at the finest step; power of the step.",
        "solver by step",
        "motion",
    ),
)


def tables(records: Sequence[Record]) -> dict[str, dict[str, Sequence[Record]]]:
    """Return the records of each row of each table, by the table's title and the row's name."""
    found: dict[str, dict[str, list[Record]]] = {title: {} for title in (*TITLES.values(), SOLVERS)}
    of_solvers = {column.experiment for column in OF_SOLVERS}
    for record in records:
        is_other = record["row"].split(", ", 1)[1] not in TITLES
        title = TITLES[OTHER if is_other else record["row"].split(", ", 1)[1]]
        title = SOLVERS if record["experiment"] in of_solvers else title
        found[title].setdefault(record["row"], []).append(record)
    return {title: dict(rows) for title, rows in found.items() if rows}


def columns_of(title: str) -> Sequence[Column]:
    """Return the columns of a table."""
    return OF_SOLVERS if title == SOLVERS else COLUMNS


def of_column(records: Sequence[Record], column: Column) -> list[Record]:
    """Return the records of a row that belong to a column, coarse to fine or by value."""
    return [record for record in records if record["experiment"] == column.experiment]


def cell(records: Sequence[Record], column: Column) -> str:
    """Return a column's value in a row with the power of its law in parentheses."""
    own = of_column(records, column)
    if not own:
        return "○"
    if own[0]["outcome"] == REFUSED:
        return "–"
    known = values(own, column)
    shown = list(known) if column.at is None else [x for x in known if x == column.at]
    if not shown:
        return "!"
    value = known[min(shown)]
    if abs(value) <= ROUNDING:
        return f"<{ROUNDING:.0e}"
    found = power(known)
    sign = "+" if column.value == "energy" and value > 0 else ""
    return f"{sign}{value:.0e}" + ("" if found is None else f" ({round(found, 1) + 0.0:.1f})")


def values(records: Sequence[Record], column: Column) -> dict[float, float]:
    """Return the values of completed runs by step, tolerance, spin, size or distance."""
    done = [record for record in records if record["outcome"] == Outcome.COMPLETED.label]
    found = {record["x"]: record["values"].get(column.value) for record in done}
    return {x: value for x, value in found.items() if value is not None and math.isfinite(value)}


def power(known: Mapping[float, float]) -> float | None:
    """Return the power p of a law value ∝ x^p over at least three neighbouring values above rounding."""
    above = {x: abs(value) for x, value in known.items() if x > 0 and abs(value) > ROUNDING}
    return order_of_convergence(list(above), list(above.values()), ANY) if len(above) > 2 else None


def listed(records: Sequence[Record], column: Column) -> str:
    """Return the values of a row's runs, or how they ended, or the reason of a refusal."""
    own = of_column(records, column)
    if not own:
        return "not measured"
    if own[0]["outcome"] == REFUSED:
        return f"refused: {own[0]['message']}"
    return "; ".join(f"{record['x']:.2g}: {_result(record, column)}" for record in own)


def _result(record: Record, column: Column) -> str:
    if record["outcome"] != Outcome.COMPLETED.label:
        return f"{record['outcome']} {record['message']}".strip()
    value = record["values"].get(column.value)
    return "not finite" if value is None else f"{value:.1e}"


def options(records: Sequence[Record]) -> Mapping[str, object]:
    """Return the options that all runs of a row have in common."""
    own = [record["options"] for record in records if record.get("options")]
    return {k: v for k, v in own[0].items() if all(each.get(k) == v for each in own)} if own else {}
