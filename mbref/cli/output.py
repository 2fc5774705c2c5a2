"""Output of the commands: tables that fit 80 columns, progress on terminals and in pipes, warnings."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbref.motions.output_units import unit_of_column
from mbref.motions.outputs import UNIT_OF, quantity_of
from mbref.scene import Scene
from mbref.scene.slips import probable_slips
from mbref.terminal import Console

if TYPE_CHECKING:
    from rich.table import Table

    from mbref.motions.motion import Motion

CELL_FRAME = 3  # characters of a cell beside its text: two blanks and a line
PIPED_WIDTH = 80  # characters of a line without a terminal
HOUR = 3600.0  # s
PAUSE = 10.0  # s between two progress lines if stderr is no terminal
NOISE = 1e-12  # of the largest number of a unit; smaller numbers are rounding errors of zeros
PRODUCTS = (  # unit, and two units whose numbers make one of the unit when multiplied
    ("m/s", "m", "1/s"),
    ("rad/s", "rad", "1/s"),
    ("m/s²", "m/s", "1/s"),
    ("rad/s²", "rad/s", "1/s"),
    ("N m", "N", "m"),
    ("W", "J", "1/s"),
)
STATE = ("position", "velocity", "angular_velocity")  # of a body in a table; fields of a trajectory


# columns in which numbers of the size of rounding errors are printed
SMALL_COLUMNS = ("violation", "error_estimate")


def console() -> Console:
    """Return the console of the standard output: as wide as the terminal, 80 columns in a pipe; names are
    never markup."""
    return Console(width=None if sys.stdout.isatty() else PIPED_WIDTH)


def warn(scene: Scene) -> None:
    """Print warnings about numbers of a scene that are probably mistakes on stderr."""
    for slip in probable_slips(scene):
        print(f"warning: {slip}", file=sys.stderr)


def exit_status(motions: Mapping[str, Motion]) -> int:
    """Print the outcomes of runs that ended early, by label; return 1 if there is one, otherwise 0."""
    ended = {label: motion for label, motion in motions.items() if motion.outcome.name != "COMPLETED"}
    for label, motion in ended.items():
        print(f"{label}: {motion.outcome.name}: {motion.message}".removeprefix(": "))
    return 1 if ended else 0


def open_combinations(found: Iterable[Mapping[str, float]]) -> list[str]:
    """Return a line for each combination of numbers, by their weights, that data do not determine."""
    sums = (" ".join(f"{weight:+.3g} ({name})" for name, weight in each.items()) for each in found)
    return [f"not determined, in relative changes: {parts}" for parts in sums]


def largest_numbers(columns: Mapping[str, np.ndarray], end: float) -> dict[str, float]:
    """Return the largest absolute number of each unit among columns (…) of a motion up to an end time (s).

    A rate counts as at least 1 rad, or the largest length, in this time, in a shorter motion in a second; a
    moment as the largest force times the largest length, a power as the largest energy in this time.
    """
    found = {"rad": 1.0, "1/s": 1.0 / max(end, 1.0) if end > 0.0 else 0.0, "": 1.0}
    for name, values in columns.items():
        unit = "s" if name == "time" else UNIT_OF[quantity_of(name)]
        found[unit] = float(np.max(np.abs(values), initial=found.get(unit, 0.0), where=np.isfinite(values)))
    for unit, first, second in PRODUCTS:
        found[unit] = max(found.get(unit, 0.0), found.get(first, 0.0) * found.get(second, 0.0))
    return found


def rounded(name: str, values: np.ndarray, largest: Mapping[str, float]) -> np.ndarray:
    """Return numbers of a column of a name, for printing: those below NOISE of the ``largest_numbers`` of
    their unit are zero."""
    noise = NOISE * largest["s" if name == "time" else UNIT_OF[quantity_of(name)]]
    return np.where(np.abs(values) <= noise, 0.0, values)


def body_table(
    title: str, bodies: Sequence[str], cells: Callable[[int, str], Iterable[str]], units: Sequence[str] = ()
) -> Table:
    """Return a table with rows x, y, z of ``cells(body, field of STATE)`` for every body and quantity,
    in units."""
    from rich.table import Table

    table = Table(title=title)
    table.add_column("body", overflow="fold")
    table.add_column("", no_wrap=True)
    for axis in "xyz":
        table.add_column(axis, justify="right", no_wrap=True)
    for b, name in enumerate(bodies):
        for k, field in enumerate(STATE):
            quantity = f"{field.replace('_', ' ')}, {unit_of_column(field, units)[0]}"
            last = k == len(STATE) - 1
            table.add_row("" if k else name, quantity, *cells(b, field), end_section=last)
    return table


class _Numbers(NamedTuple):
    """A column of a table: the lines of its title, and its numbers as they are printed."""

    title: str
    numbers: Sequence[str]

    @property
    def width(self) -> int:
        """Characters of the column with its frame, where no line is broken."""
        return CELL_FRAME + max(map(len, (*self.title.split("\n"), *self.numbers)))


def column_tables(
    columns: Mapping[str, np.ndarray],
    largest: Mapping[str, float],
    units: Sequence[str] = (),
    width: int = PIPED_WIDTH,
) -> Iterator[Table]:
    """Yield tables of numbers over time that fit into ``width`` characters, with no number broken.

    Each of the named columns (k,) is in one table; the time, the first of them, is in all. ``largest`` are
    the ``largest_numbers`` of the motion.
    """
    shown = []
    for name, values in columns.items():
        unit, size = unit_of_column(name, units)
        numbers = values if name.endswith(SMALL_COLUMNS) else rounded(name, values, largest) / size
        shown.append(_Numbers(f"{name}\n{unit}", [f"{x:.6g}" for x in numbers]))
    if _width(shown) > width:
        shown = [column._replace(title=column.title.replace(".", "\n.")) for column in shown]
    part = shown[:1]
    for column in shown[1:]:
        if len(part) > 1 and _width([*part, column]) > width:
            yield _table_of(part)
            part = shown[:1]
        part = [*part, column]
    yield _table_of(part)


def _width(columns: Iterable[_Numbers]) -> int:
    return 1 + sum(column.width for column in columns)


def _table_of(columns: Sequence[_Numbers]) -> Table:
    from rich.table import Table

    table = Table()
    for title, numbers in columns:
        least = max(map(len, numbers), default=0)  # a title is broken if the table is too wide all the same
        table.add_column(title, justify="right", overflow="fold", min_width=least)
    for row in zip(*(column.numbers for column in columns), strict=True):
        table.add_row(*row)
    return table


@contextmanager
def progress_bar(what: str, end: float) -> Iterator[Callable[[float], None]]:
    """Show the progress of a long run on stderr: a bar on a terminal, otherwise a line every ten seconds."""
    on_stderr = Console(stderr=True)
    if not on_stderr.is_terminal:
        yield Lines(what, end, time.monotonic)
        return
    from rich.progress import Progress

    with Progress(console=on_stderr, transient=True) as bar:
        task = bar.add_task(what, total=end)
        yield lambda t: bar.update(task, completed=t)


class Lines:
    """Progress lines such as "simulating: 40 %, about 18 s left", written at times of a clock (s)."""

    def __init__(self, what: str, end: float, clock: Callable[[], float]):
        self._what, self._end, self._clock = what, end, clock
        self._began = self._said = clock()

    def __call__(self, done: float) -> None:
        """Write a line with the progress if ten seconds have passed since the last one."""
        now = self._clock()
        if now - self._said >= PAUSE and done > 0:
            self._said = now
            left = (now - self._began) * (self._end / done - 1)
            sentence = f"about {left:.0f} s left" if left < HOUR else "more than an hour left"
            print(f"{self._what}: {100 * done / self._end:.0f} %, {sentence}", file=sys.stderr)
