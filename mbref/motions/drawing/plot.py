"""Columns of a motion over time, as a matplotlib figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mbref.motions.drawing.svg import COLOURS, GREY
from mbref.motions.outputs import UNIT_OF, chosen, quantity_of

DEFAULT = ("angle", "displacement", "energy")


def plot(columns: Mapping[str, np.ndarray], names: Sequence[str]) -> Any:
    """Return a figure with one panel for each quantity of the named columns, by default of ``DEFAULT``.

    Raises InputError for a name of no column, ImportError without matplotlib.
    """
    panels = grouped([name for name in columns if name != "time"], names)
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise ImportError("plot needs matplotlib: pip install matplotlib; columns() does not") from None
    figure = Figure(figsize=(7.2, 1.2 + 1.9 * len(panels)), layout="constrained")
    every = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (quantity, members) in zip(every, panels.items(), strict=True):
        for i, name in enumerate(members):
            axes.plot(columns["time"], columns[name], color=COLOURS[i % len(COLOURS)], label=str(i))
        if quantity.endswith("violation"):
            axes.set_yscale("log")
        axes.set_ylabel(f"{quantity.replace('_', ' ')}, {UNIT_OF[quantity]}".strip(", "))
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(color=GREY, alpha=0.25)
        legend = axes.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
        for text, name in zip(legend.get_texts(), members, strict=True):
            text.set(text=name, parse_math=False)  # a name is no formula
    every[-1].set_xlabel("time, s")
    return figure


def grouped(columns: Sequence[str], names: Sequence[str]) -> dict[str, list[str]]:
    """Return the columns chosen by names or beginnings, under their quantity; raises as ``chosen``."""
    by_default = [column for column in columns if quantity_of(column) in DEFAULT] or list(columns)
    groups: dict[str, list[str]] = {}
    for column in chosen(columns, names) if names else by_default:
        groups.setdefault(quantity_of(column), []).append(column)
    return groups
