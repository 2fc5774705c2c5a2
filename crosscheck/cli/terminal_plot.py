"""Plot of computing time against error in characters, for a terminal."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from rich.text import Text

from crosscheck.study.grid import Record
from crosscheck.study.record_view import drawn, engine_and_family, error, is_completed

COLOURS = ("blue", "red", "green", "magenta", "yellow", "cyan")
WIDTH, HEIGHT = 64, 16  # characters of the plot


def scatter(records: Sequence[Record], letters: Mapping[tuple[str, str], str]) -> Text:
    """Return a plot of errors (to the right: larger) and times (upwards: slower), both logarithmic, one
    letter for each family."""
    plotted = [r for r in records if is_completed(r) and math.isfinite(error(r))]
    points = [(*_place(r), letters[engine_and_family(r)]) for r in plotted]
    if not points:
        return Text("nothing to plot: the error of no completed run is known")
    (left, right), (low, high) = _range([p[0] for p in points]), _range([p[1] for p in points])
    grid = [[" "] * WIDTH for _ in range(HEIGHT)]
    for x, y, letter in points:
        column = round((x - left) / (right - left) * (WIDTH - 1))
        grid[round((high - y) / (high - low) * (HEIGHT - 1))][column] = letter
    return _framed(grid, (left, right), (low, high), {v: k for k, v in letters.items()})


def _place(record: Record) -> tuple[float, float]:
    """Return the decimal logarithms of error and time. The error is at least the truth's bound; zeros are at
    the lower end."""
    off, seconds = drawn(record, record["cost"]["seconds"])
    return math.log10(off), math.log10(seconds)


def _range(values: Sequence[float]) -> tuple[float, float]:
    """Return the range of whole decades that contains the values."""
    low, high = math.floor(min(values)), math.ceil(max(values))
    return low, high if high > low else low + 1


def _framed(
    grid: Sequence[Sequence[str]],
    across: tuple[float, float],
    up: tuple[float, float],
    names: Mapping[str, tuple[str, str]],
) -> Text:
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
