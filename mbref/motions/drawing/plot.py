"""Columns of motions over time or over another column, as a matplotlib figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from mbref.input_error import InputError
from mbref.motions.drawing.svg import COLOURS, GREY
from mbref.motions.output_units import requested_units, unit_of_column
from mbref.motions.outputs import UNIT_OF, chosen, quantity_of

DEFAULT = ("angle", "displacement", "energy")
DASHES = ("-", "--", "-.", ":")  # of the motions in one plot


class Tabulated(Protocol):
    """A motion: an object with columns over time."""

    def columns(self) -> dict[str, np.ndarray]:
        """Return all columns (k,) by name, ``time`` among them."""


def plot(
    motions: Tabulated | Mapping[str, Tabulated],
    *names: str,
    over: str = "time",
    units: str = "",
    together: bool = False,
    ax: Any = None,
) -> Any:
    """Plot columns of one motion, or of several by their labels, in one panel for each quantity.

    Parameters
    ----------
    motions : Motion, or mapping of str to Motion
        The motions; a label stands behind the names of its curves.
    *names : str
        Columns or their beginnings, such as ``"rod.position"``. Default: joint coordinates and energy.
    over : str
        Column of the horizontal axis, such as ``"A.angle"`` of a driven joint. Default: time.
    units : str
        Units such as ``"mm,deg"``. Default: SI.
    together : bool
        Whether all columns of one unit share a panel.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in, for columns of one panel. Default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure or matplotlib.axes.Axes
        The new figure, or ``ax``.

    Raises
    ------
    InputError, ImportError
        If a name fits no column, or several panels are requested for ``ax``, or matplotlib is not installed.
    """
    given: Mapping[str, Tabulated] = motions if isinstance(motions, Mapping) else {"": motions}
    wanted = requested_units(units)
    tables = {label: motion.columns() for label, motion in given.items()}
    columns = list(dict.fromkeys(name for table in tables.values() for name in table))
    across, *others = chosen(columns, [over])
    if others:
        raise InputError(f"over: must be one column, such as {across!r}, got {over!r}")
    if missing := [label for label, table in tables.items() if across not in table]:
        raise InputError(f"over: motion {missing[0]!r} has no column {across!r}")
    panels = grouped(
        [name for name in columns if name != "time" and (names or name != across)], names, together
    )
    every = _axes(len(panels), ax)
    for axes, members in zip(every, panels.values(), strict=True):
        curves = {
            (name, label): (table[across], table[name])
            for name in members
            for label, table in tables.items()
            if name in table
        }
        _draw(axes, curves, across, wanted)
        title, *several = dict.fromkeys(map(quantity_of, members))
        axes.set_ylabel(_labelled("" if several else title.replace("_", " "), members[0], wanted))
        if title.endswith("violation"):
            axes.set_yscale("log")
    every[-1].set_xlabel(_labelled(across, across, wanted), parse_math=False)
    return every[0].figure if ax is None else ax


def _labelled(title: str, column: str, units: Sequence[str]) -> str:
    return ", ".join(filter(None, (title, unit_of_column(column, units)[0])))


def _axes(panels: int, ax: Any) -> Any:
    """Return axes (panels,) of a new figure, or the given axes; raises InputError, ImportError."""
    if ax is not None:
        if panels != 1:
            raise InputError(f"ax: takes columns of one quantity, or of one unit with together, got {panels}")
        return [ax]
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise ImportError("plot needs matplotlib: pip install matplotlib; columns() does not") from None
    figure = Figure(figsize=(7.2, 1.2 + 1.9 * panels), layout="constrained")
    return figure.subplots(panels, 1, sharex=True, squeeze=False)[:, 0]


def _draw(axes: Any, curves: Mapping[tuple[str, str], Any], across: str, units: Sequence[str]) -> None:
    """Draw curves by column and label of the motion: a colour for each column, dashes for each motion; for a
    single column a colour for each motion."""
    names, labels = (list(dict.fromkeys(key[k] for key in curves)) for k in range(2))
    for (name, label), (x, y) in curves.items():
        colour, dash = names.index(name), labels.index(label)
        if len(names) == 1:
            colour, dash = dash, 0
        axes.plot(
            x / unit_of_column(across, units)[1],
            y / unit_of_column(name, units)[1],
            DASHES[dash % len(DASHES)],
            color=COLOURS[colour % len(COLOURS)],
            label=".",
            gid=", ".join(filter(None, (name, label))),
        )
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color=GREY, alpha=0.25)
    legend = axes.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    for text, line in zip(legend.get_texts(), axes.get_legend_handles_labels()[0], strict=True):
        text.set(text=line.get_gid() or line.get_label(), parse_math=False)  # a name is no formula


def grouped(columns: Sequence[str], names: Sequence[str], together: bool = False) -> dict[str, list[str]]:
    """Return the columns chosen by names or beginnings, under their quantity, or ``together`` under their
    unit; raises as ``chosen``."""
    by_default = [column for column in columns if quantity_of(column) in DEFAULT] or list(columns)
    groups: dict[str, list[str]] = {}
    for column in chosen(columns, names) if names else by_default:
        quantity = quantity_of(column)
        groups.setdefault((together and UNIT_OF[quantity]) or quantity, []).append(column)
    return groups
