"""Columns of a motion over time, as a matplotlib figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mbref.drawing.svg import COLOURS, GREY
from mbref.scene_fields import meant

UNITS = {
    "position": "m",
    "velocity": "m/s",
    "angular_velocity": "rad/s",
    "acceleration": "m/s²",
    "angular_acceleration": "rad/s²",
    "orientation": "",
    "angle": "rad",
    "rate": "rad/s",
    "displacement": "m",
    "force": "N",
    "moment": "N m",
    "energy": "J",
    "open": "",
}
DEFAULT = ("angle", "displacement", "energy")


def plot(columns: Mapping[str, np.ndarray], names: Sequence[str]) -> Any:
    """Return a figure with one panel for each quantity of the named columns, by default of ``DEFAULT``.

    Raises ValueError for a name of no column, ImportError without matplotlib.
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
            axes.plot(columns["time"], columns[name], color=COLOURS[i % len(COLOURS)], label=name)
        axes.set_ylabel(f"{quantity.replace('_', ' ')}, {UNITS[quantity]}".strip(", "))
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(color=GREY, alpha=0.25)
        axes.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    every[-1].set_xlabel("time, s")
    return figure


def _beginnings(columns: Sequence[str]) -> list[str]:
    """The columns and their beginnings, such as ``rod`` and ``rod.position``."""
    parts = [column.split(".") for column in columns]
    return list(dict.fromkeys(".".join(p[:n]) for p in parts for n in range(1, len(p) + 1)))


def grouped(columns: Sequence[str], names: Sequence[str]) -> dict[str, list[str]]:
    """The columns chosen by names or beginnings, under their quantity; ValueError for an unknown name."""
    chosen = []
    for name in names:
        found = [column for column in columns if column == name or column.startswith(f"{name}.")]
        if not found:
            known = f"; columns: {', '.join(columns)}"
            raise ValueError(f"no column {name!r}{meant(name, _beginnings(columns)) or known}")
        chosen += [column for column in found if column not in chosen]
    if not names:
        chosen = [c for c in columns if quantity_of(c) in DEFAULT] or list(columns)
    groups: dict[str, list[str]] = {}
    for column in chosen:
        groups.setdefault(quantity_of(column), []).append(column)
    return groups


def quantity_of(column: str) -> str:
    """``position`` of ``rod.position.x``, ``angle`` of ``A.angle``."""
    return next(part for part in reversed(column.split(".")) if part in UNITS)
