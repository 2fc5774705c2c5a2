"""The verdict and the tables that `crosscheck run`, `compare` and `tune` print, in 80 columns."""

from __future__ import annotations

import math
import string
from collections.abc import Mapping, Sequence
from typing import Literal

from rich.console import Console
from rich.table import Table
from rich.text import Text

from crosscheck.cli.terminal_plot import scatter
from crosscheck.engine import Engine, Setting, engine
from crosscheck.judge.mobility import mobility
from crosscheck.setting import ORIGIN, option_text
from crosscheck.study.command import command
from crosscheck.study.grades import Grade, Judged
from crosscheck.study.grid import Record
from crosscheck.study.record_view import (
    by_scene,
    engine_and_family,
    error,
    error_bound,
    error_text,
    is_completed,
    never_moved,
    varied_settings,
)
from crosscheck.study.search.cheapest import Criterion, known_error
from crosscheck.study.words.file import uncounted_closures
from crosscheck.study.words.speed import LEVEL, SAID, title
from crosscheck.study.words.verdict import Verdict
from mbref.scene import Scene

MEASURED = ("violation_position", "energy_error")  # metrics in further columns of the table of runs
SETTINGS_WIDTH, NUMBER_WIDTH = 15, 8  # least widths of columns in characters, so that numbers are not broken
OUTCOME_WIDTH = 13  # width of the column of outcomes in characters, so that a table fits 80 columns
BEST = {"violation_position": "closure", "energy_error": "energy", "reaction_error": "reactions"}
NO_ENERGY = (
    "energy –: not conserved because of a driver or damper, or samples are too far apart to "
    "follow the rotations"
)
TEXT_COLUMNS = 3  # number of leading columns that contain words, which may be folded


def print_runs(console: Console, records: Sequence[Record], scenes: Sequence[Scene] = ()) -> None:
    """Print one table for each scene: settings, outcome, end time, error, violation, energy and time of every
    run. ``scenes`` name couplings whose turns are not counted."""
    known = {scene.name: scene for scene in scenes}
    header = ("engine, family", "settings", "outcome", "error", "closure", "energy", "time (s)")
    for name, group in by_scene(records).items():
        table = _table(name, header)
        for r in group:
            numbers = [error_text(r), *(_measured(r, m) for m in MEASURED)]
            table.add_row(*_identity(r, group), f"{_outcome(r)}{_at(r)}", *numbers, _seconds(r))
        console.print(table)
        if name in known:
            console.print(uncounted_closures(group, known[name]), markup=False, end="")
        _print_messages(console, group)


def print_comparison(console: Console, group: Judged, said: Verdict, path: str, with_ratio: bool) -> None:
    """Print the verdict on a scene, its runs in the order of increasing error, the plot, each engine's best
    run and recommended settings. Ratios of times are left out if the engines simulate different
    mechanisms."""
    records = group.records
    console.print(f"\n{group.scene.name}, {group.scene.duration:g} s: {_counts(group)}\n")
    _print_verdict(console, said)
    letters = _letters(records)
    console.print(_ranked(group, letters, with_ratio=with_ratio))
    console.print(scatter(records, letters))
    _print_best(console, group)
    _print_advice(console, group, path)
    _print_own_code(console, group)
    _print_messages(console, records)


def _ranked(group: Judged, letters: Mapping[tuple[str, str], str], with_ratio: bool) -> Table:
    """Return the table of runs in the order of increasing error; ``with_ratio`` adds times as multiples of
    the fastest."""
    records = group.records
    timed = (_cost(r) for r in group.comparable if is_completed(r))
    fastest = min((seconds for seconds in timed if seconds > 0), default=math.nan)
    header = ("", "engine, family", "settings", "verdict", "error", "time (s)", *["ratio"] * with_ratio)
    table = _table("runs", header, 4)
    for r in sorted(records, key=lambda r: (not is_completed(r), error(r))):
        row = (
            letters[engine_and_family(r)],
            *_identity(r, records),
            _graded(group, r),
            error_text(r),
            _seconds(r),
        )
        ratio = f"{_cost(r) / fastest:.1f}" if is_completed(r) and _cost(r) > 0 and fastest > 0 else "–"
        table.add_row(*row, *[ratio] * with_ratio)
    return table


def print_tuning(
    console: Console,
    wanted: Criterion,
    reached: Sequence[Record],
    records: Sequence[Record],
    scene: Scene,
    path: str,
) -> None:
    """Print the settings that reach a criterion, cheapest first: first settings of the engine's own
    integrators, then settings that crosscheck integrates. If no settings reach the criterion, print the
    nearest run."""
    if not reached:
        nearest = nearest_of(wanted, records)
        reason, table = unreached(wanted, nearest)
        console.print(f"{reason} {table}:", soft_wrap=True)
        _print_settings(console, "the nearest run", [nearest], wanted)
        return
    simulator = engine(records[0]["asked"]["engine"])
    name, ours = records[0]["engine"], simulator.integrated_here
    own = [r for r in reached if r["family"] not in ours]
    rest = [r for r in reached if r["family"] in ours]
    if not own:
        missing = all(r["family"] in ours for r in records)
        reason = (
            "has no integrator of its own here" if missing else f"reaches {wanted.name} with none of its own"
        )
        console.print(f"{title(name)} {reason}.", soft_wrap=True)
    for group, heading in ((own, f"integrated by {title(name)} itself"), (rest, "integrated by crosscheck")):
        if group:
            _print_settings(console, heading, group, wanted)
            code = own_code(scene, group[0])
            lines = [_to_set(simulator, group[0]), f"The cheapest: {command(group[0], path)}"]
            console.print("\n".join([*lines, *[f"To copy: {code}"] * bool(code)]), soft_wrap=True)


def _print_settings(console: Console, heading: str, records: Sequence[Record], wanted: Criterion) -> None:
    measured = "closure" if "closure" in wanted.name else "error"
    table = _table(heading, ("engine, family", "settings", measured, "time (s)"), 2)
    for r in records:
        table.add_row(" ".join(engine_and_family(r)), _options(r), wanted.text(r), _seconds(r))
    console.print(table)


def _to_set(found: Engine, record: Record) -> str:
    """Return the description of a run's family, and of each of its options."""
    family = found.families.get(record["family"], "")
    options = [
        f"{n} = {option_text(v)} ({found.options[n]})" if n in found.options else f"{n} = {v}"
        for n, v in record["asked"]["options"].items()
        if n not in ORIGIN
    ]
    parts = [f"{record['family']}: {family}" if family else record["family"], *options]
    return "; ".join(parts) + "."


def nearest_of(wanted: Criterion, records: Sequence[Record]) -> Record:
    """Return the run that comes nearest to a criterion; the one that got furthest if none completes."""
    return min(records, key=lambda r: (not is_completed(r), wanted.measure(r), -r["t_end"]))


def unreached(wanted: Criterion, nearest: Record) -> tuple[str, str]:
    """Return the reason why no setting reaches a criterion, and the name of the nearest run's table."""
    bound = error_bound(nearest)
    if not is_completed(nearest):
        return f"No setting reaches {wanted.name}: no run completes.", "The one that got furthest"
    if not math.isfinite(wanted.measure(nearest)):
        return wanted.unknown(nearest), "One of the runs"
    if bound > wanted.level and wanted.measure is known_error:
        known = f"The truth is known to {bound:.0e}"
        return f"{known}, so no run can be seen to reach {wanted.level:g}.", "The nearest"
    return f"No setting reaches {wanted.name}; the nearest run has {wanted.text(nearest)}.", "The nearest run"


def _print_verdict(console: Console, said: Verdict) -> None:
    console.print(said.headline)
    for label, sentence in said.labelled().items():
        console.print(f"\n{label}: {sentence}")


def _counts(group: Judged) -> str:
    counts = mobility(group.scene)
    return (
        f"bodies: {len(group.scene.body)}, degrees of freedom: {counts.degrees_of_freedom}, constraint "
        f"rows: {counts.rows}, of which redundant: {counts.redundant}"
    )


def _print_best(console: Console, group: Judged) -> None:
    """Print constraint violation, energy error and reaction error of each engine's most accurate run, or of a
    finest run if no error is known."""
    header, best = ("engine, family", "settings", "error", *BEST.values()), group.best()
    title = "a finest run of every engine" if _no_error(best) else "every engine's run of least error"
    table = _table(title, header, 2)
    for r in best.values():
        measured = [_measured(r, metric) for metric in BEST]
        table.add_row(*_identity(r, group.records), error_text(r), *measured)
    console.print(table)
    if all(r["metrics"].get("energy_error") is None for r in group.records):
        console.print(NO_ENERGY)
    console.print(uncounted_closures(list(best.values()), group.scene), markup=False, end="")


def _print_advice(console: Console, group: Judged, path: str) -> None:
    """Print the command of each engine's fastest run within the error LEVEL, otherwise of its most accurate
    run."""
    cheapest, best = group.cheapest(LEVEL), group.best()
    if _no_error(best):
        console.print("\nsettings to use: none is known to be right, because no error is known")
        return
    console.print(f"\nsettings to use: the fastest run within {SAID}, otherwise the most accurate run")
    for name in best:
        r = cheapest.get(name, best[name])
        if is_completed(r):
            console.print(f"  error {error_text(r)}, {_seconds(r)} s: {command(r, path)}", soft_wrap=True)


def _no_error(best: Mapping[str, Record]) -> bool:
    """Return whether runs completed and the error of none is known."""
    completed = [r for r in best.values() if is_completed(r)]
    return bool(completed) and not any(math.isfinite(error(r)) for r in completed)


def _print_own_code(console: Console, group: Judged) -> None:
    """Print a line of each engine's own code or XML for its fastest run within the error LEVEL, otherwise for
    its most accurate run, among settings that the engine itself has."""
    found = group.within(LEVEL, lambda r: bool(own_code(group.scene, r)))
    if found:
        console.print("\nto copy into your model: settings that an engine itself has")
    for name, r in found.items():
        said = f"  {title(name)}, {r['family']}, error {error_text(r)}, {_seconds(r)} s: "
        console.print(f"{said}{own_code(group.scene, r)}", soft_wrap=True)


def own_code(scene: Scene, record: Record) -> str:
    """Return the line of the engine's own code or XML that makes the settings of a record; empty if no such
    line is known."""
    asked = Setting(record["family"], record["asked"]["options"])
    return engine(record["asked"]["engine"]).own_code(scene, asked)


def _options(record: Record) -> str:
    asked = record["asked"]["options"].items()
    return ", ".join(f"{name}={option_text(value)}" for name, value in asked if name not in ORIGIN)


def _graded(group: Judged, record: Record) -> str:
    found = group.grade(record)
    return str(found) if found is not Grade.FAILED else f"{_outcome(record)}{_at(record)}"


def _at(record: Record) -> str:
    """Return a line such as ``at 0.1 s``; empty for a run that completed or ran out of time."""
    silent = is_completed(record) or record["outcome"] in ("TIMED_OUT", "CRASHED")
    return "" if silent else f"\nat {max(record['t_end'], 0):.4g} s"


def _cost(record: Record) -> float:
    return record["cost"]["seconds"]


def _measured(record: Record, metric: str) -> str:
    """Return the text of a metric; – if it is missing, and for a run that ended at its start."""
    return "–" if never_moved(record) else _number(record["metrics"].get(metric))


def _seconds(record: Record) -> str:
    """Return the time of stepping as text; – for a run that ended at its start or has no time."""
    return "–" if never_moved(record) or not _cost(record) else _number(_cost(record))


def _print_messages(console: Console, records: Sequence[Record]) -> None:
    """Print the causes of failed runs; settings of a family with the same cause share a line."""
    reported: dict[tuple[str, str], list[str]] = {}
    for r in records:
        if not is_completed(r):
            name, settings = _identity(r, records)
            reported.setdefault((name, f"{r['outcome']}: {r['message']}"), []).append(settings)
    if reported:
        console.print()
    for (name, reason), alike in reported.items():
        console.print(Text(f"{name} {'; '.join(alike)}: {reason}"))


def _letters(records: Sequence[Record]) -> dict[tuple[str, str], str]:
    marks = string.ascii_uppercase + string.ascii_lowercase + string.digits
    curves = dict.fromkeys(engine_and_family(record) for record in records)
    return {name: marks[i % len(marks)] for i, name in enumerate(curves)}


def _identity(record: Record, records: Sequence[Record]) -> tuple[str, str]:
    return " ".join(engine_and_family(record)), varied_settings(record, records)


def _outcome(record: Record) -> str:
    return record["outcome"].lower().removesuffix("_matrix").replace("_", " ")


def _number(value: float | None) -> str:
    return "–" if value is None or not math.isfinite(value) else f"{value:.2e}"


def listing_table(title: str, header: Sequence[str]) -> Table:
    """Return an empty table of words, whose cells may be folded."""
    return _table(title, header, len(header))


def _table(title: str, header: Sequence[str], words: int = TEXT_COLUMNS) -> Table:
    """Return an empty table whose first columns contain words and may be folded; its numbers are never
    broken."""
    table = Table(title=f"\n{title}", box=None, padding=(0, 1, 0, 0), title_justify="left", pad_edge=False)
    for i, name in enumerate(header):
        width = SETTINGS_WIDTH if name == "settings" else 0 if i < words else NUMBER_WIDTH
        side: Literal["left", "right"] = "left" if i < words else "right"
        table.add_column(
            name,
            justify=side,
            overflow="fold",
            no_wrap=i >= words,
            min_width=width,
            max_width=OUTCOME_WIDTH if name in ("outcome", "verdict") else None,
        )
    return table
