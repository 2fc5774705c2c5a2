"""Speed against error of records: interleaved timing, tables and a plot for the terminal."""

from __future__ import annotations

import math
import string
from collections.abc import Callable, Mapping, Sequence
from statistics import median
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from crosscheck.isolate import ChildFailed, time_interleaved
from crosscheck.study import Case, Record
from mbref.scene import Scene
from mbref.trajectory import Outcome

COLOURS = ("blue", "red", "green", "magenta", "yellow", "cyan")
MEASURED = ("error", "violation_position", "energy_error")  # of the metrics, what the table of runs shows
WIDTH, HEIGHT = 64, 16  # characters of the plot
PUBLIC = ("engine", "version", "method", "settings", "outcome", "message", "t_end", "times", "bodies",
          "reactions", "metrics", "cost")  # fmt: skip


def public(record: Record) -> Record:
    """The fields of a record that ``--json`` prints, ``timing`` too where the run was timed; numbers that
    are not finite become null."""
    return {name: _finite(record[name]) for name in (*PUBLIC, "timing") if name in record}


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def timed(
    cases: Sequence[Case], records: Sequence[Record], repeats: int, notice: Callable[[str], None]
) -> list[Record]:
    """The records with the ``cost.seconds`` of interleaved runs: their minimum, and ``timing``
    with their median and number.

    The completed runs of a scene take turns in one process, so that all see the same machine.  A scene
    whose timing process fails keeps the seconds of its isolated runs, which a ``notice`` says.
    """
    done = list(records)
    for scene in {case.scene.name: case.scene for case in cases}.values():
        places = [
            i for i, case in enumerate(cases) if case.scene.name == scene.name and _completed(records[i])
        ]
        try:
            for i, seconds in zip(places, _seconds(scene, [cases[i] for i in places], repeats), strict=True):
                done[i] = _with_cost(records[i], seconds)
        except ChildFailed as failure:
            notice(f"{scene.name}: no interleaved timing, single runs are shown: {failure}")
    return done


def _seconds(scene: Scene, cases: Sequence[Case], repeats: int) -> list[list[float]]:
    if not cases:
        return []
    limit = (repeats + 1) * sum(case.time_limit for case in cases)
    jobs = [(case.engine, case.setting) for case in cases]
    return time_interleaved(scene, cases[0].times, jobs, repeats, limit)


def _with_cost(record: Record, seconds: Sequence[float]) -> Record:
    """NaN repeats are runs that this time did not complete; a record of those alone keeps its cost."""
    finite = [s for s in seconds if math.isfinite(s)]
    if not finite:
        return record
    cost = {**record["cost"], "seconds": min(finite)}
    return {**record, "cost": cost, "timing": {"median": median(finite), "repeats": len(finite)}}


def _completed(record: Record) -> bool:
    return record["outcome"] == Outcome.COMPLETED.label


def print_runs(console: Console, records: Sequence[Record]) -> None:
    """One table a scene: settings, outcome, end time, error, violation, energy and time of every run."""
    header = (
        "engine",
        "family",
        "settings",
        "outcome",
        "end (s)",
        "error",
        "violation",
        "energy",
        "time (s)",
    )
    for name, group in by_scene(records).items():
        table = _table(name, header, right_from=4)
        for r in group:
            numbers = [_number(r["metrics"].get(m)) for m in MEASURED]
            table.add_row(
                *_identity(r, group),
                _outcome(r),
                f"{r['t_end']:.4g}",
                *numbers,
                _number(r["cost"]["seconds"]),
            )
        console.print(table)
        _print_messages(console, group)


def print_comparison(console: Console, records: Sequence[Record]) -> None:
    """One table a scene, least error first, with times and ratios to the fastest; then the plot."""
    header = (
        "",
        "engine",
        "family",
        "settings",
        "outcome",
        "end (s)",
        "error",
        "best (s)",
        "median (s)",
        "ratio",
    )
    for name, group in by_scene(records).items():
        letters = _letters(group)
        fastest = min((r["cost"]["seconds"] for r in group if _completed(r)), default=math.nan)
        table = _table(name, header, right_from=5)
        for r in sorted(group, key=lambda r: (not _completed(r), error(r))):
            measured = (f"{r['t_end']:.4g}", _number(error(r)), *_times(r, fastest))
            table.add_row(letters[_curve(r)], *_identity(r, group), _outcome(r), *measured)
        console.print(table)
        console.print(scatter(group, letters))
        _print_messages(console, group)


def _times(record: Record, fastest: float) -> tuple[str, str, str]:
    seconds = record["cost"]["seconds"]
    middle = _number(record.get("timing", {}).get("median"))
    return _number(seconds), middle, f"{seconds / fastest:.1f}" if _completed(record) and fastest > 0 else "–"


def _print_messages(console: Console, records: Sequence[Record]) -> None:
    for r in records:
        if not _completed(r):
            console.print(Text(f"{' '.join(_identity(r, records))}: {r['outcome']}: {r['message']}"))


def scatter(records: Sequence[Record], letters: Mapping[tuple[str, str], str]) -> Text:
    """Error (right: larger) against time (up: slower), both logarithmic, one letter a family."""
    plotted = [r for r in records if _completed(r) and math.isfinite(error(r))]
    points = [(*_place(r), letters[_curve(r)]) for r in plotted]
    if not points:
        return Text("nothing to plot: no completed run has an error")
    (left, right), (low, high) = _range([p[0] for p in points]), _range([p[1] for p in points])
    grid = [[" "] * WIDTH for _ in range(HEIGHT)]
    for x, y, letter in points:
        column = round((x - left) / (right - left) * (WIDTH - 1))
        grid[round((high - y) / (high - low) * (HEIGHT - 1))][column] = letter
    return _framed(grid, (left, right), (low, high), {v: k for k, v in letters.items()})


def _place(record: Record) -> tuple[float, float]:
    """Decades of error and time, exact zeros at the lower end."""
    return math.log10(max(error(record), 1e-16)), math.log10(max(record["cost"]["seconds"], 1e-6))


def _range(values: Sequence[float]) -> tuple[float, float]:
    """Whole decades around the values."""
    low, high = math.floor(min(values)), math.ceil(max(values))
    return low, high if high > low else low + 1


def _framed(grid, across: tuple[float, float], up: tuple[float, float], names: Mapping) -> Text:
    engines = list(dict.fromkeys(engine for engine, _ in names.values()))
    colours = {mark: COLOURS[engines.index(engine) % len(COLOURS)] for mark, (engine, _) in names.items()}
    text = Text("time (s)\n")
    for i, line in enumerate(grid):
        edge = f"1e{up[1] - i / (HEIGHT - 1) * (up[1] - up[0]):+03.0f}" if i in (0, HEIGHT - 1) else ""
        text.append(f"{edge:>6} │")
        for character in line:
            text.append(character, style=colours.get(character, ""))
        text.append("\n")
    text.append(" " * 7 + "└" + "─" * WIDTH + "\n")
    ends = f"1e{across[0]:+03.0f}", f"1e{across[1]:+03.0f}"
    text.append(" " * 8 + ends[0] + "error".center(WIDTH - 10) + ends[1] + "\n")
    for mark, (engine, family) in names.items():
        text.append(f"   {mark} {engine} {family}\n", style=colours[mark])
    return text


def by_scene(records: Sequence[Record]) -> dict[str, list[Record]]:
    """Records grouped by the scene's name, in their order."""
    groups: dict[str, list[Record]] = {}
    for record in records:
        groups.setdefault(record["scene"], []).append(record)
    return groups


def error(record: Record) -> float:
    """The error of a record; infinite where there is none to compare with."""
    value = record["metrics"].get("error")
    return math.inf if value is None or math.isnan(value) else value


def _letters(records: Sequence[Record]) -> dict[tuple[str, str], str]:
    marks = string.ascii_uppercase + string.ascii_lowercase + string.digits
    return {curve: marks[i % len(marks)] for i, curve in enumerate(dict.fromkeys(map(_curve, records)))}


def _curve(record: Record) -> tuple[str, str]:
    return record["engine"], record["family"]


def swept(record: Record, records: Sequence[Record]) -> str:
    """The settings in which a record differs from others of its family, as printed (``rtol=1e-06``);
    all of them when it is alone."""
    own = record["settings"]
    settings = [r["settings"] for r in records if _curve(r) == _curve(record)]
    names = [k for k in own if len(settings) == 1 or any(s.get(k, own[k]) != own[k] for s in settings)]
    return ", ".join(f"{k}={own[k]:g}" if isinstance(own[k], float) else f"{k}={own[k]}" for k in names)


def _identity(record: Record, records: Sequence[Record]) -> tuple[str, str, str]:
    return (*_curve(record), swept(record, records))


def _outcome(record: Record) -> str:
    return record["outcome"].lower().replace("_", " ")


def _number(value: float | None) -> str:
    return "–" if value is None or not math.isfinite(value) else f"{value:.2e}"


def _table(title: str, header: Sequence[str], right_from: int) -> Table:
    table = Table(title=title)
    for i, name in enumerate(header):
        table.add_column(name, justify="right" if i >= right_from else "left", overflow="fold")
    return table
