"""The paper's Tables I to IV as data, and when a run matches a cell.

M. A. Neto and J. Ambrósio, Multibody System Dynamics 10 (2003) 81–105.  Letters are the paper's
footnotes: a singular matrix, b no convergence, c violation too large, d the integration fails.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

from mbref.motions.trajectory import Outcome

CLOSE = 0.002
"""s; end times this near are one: the paper prints milliseconds, and a crossing lasts about as long."""


@dataclass(frozen=True)
class Cell:
    """One outcome that the paper prints: ``end`` (s) and ``letter``, or None and "" if the run completes."""

    table: str
    row: str
    column: str
    end: float | None
    letter: str

    def __str__(self) -> str:
        return "20 s" if self.end is None else f"{self.end:g} s {self.letter}"


class Match(enum.Enum):
    """Agreement of a run with a cell; the value is the mark in the report."""

    SAME = "="
    OTHER_TIME = "≈"
    DIFFERENT = "≠"


def match(cell: Cell, outcome: Outcome, t_end: float) -> Match:
    """Return SAME for equal outcome and end time, OTHER_TIME for an equal footnote at another time, DIFFERENT
    for another outcome."""
    if cell.end is None:
        return Match.SAME if outcome is Outcome.COMPLETED else Match.DIFFERENT
    if outcome.letter != cell.letter:
        return Match.DIFFERENT
    return Match.SAME if abs(t_end - cell.end) <= CLOSE else Match.OTHER_TIME


def _cell(table: str, row: str, column: str, text: str) -> Cell:
    """Return a cell from its printed text: ``20`` for a completed run, otherwise seconds and footnote
    letter."""
    if text == "20":
        return Cell(table, row, column, None, "")
    return Cell(table, row, column, float(text[:-1]), text[-1])


FOUR_BAR_COLUMNS = ("θ₂ = nπ", "θ₂ = π/4", "θ₂ = π/2")
FIVE_BAR, SPATIAL = "five-bar", "spatial slider-crank, driven"

_TABLE_I = {
    "LM2": "0a 0a 0a",
    "LM2 + B": "0a 0a 0a",
    "LM2 + CP": "0a 0a 0a",
    "ALF": "0b 0.006b 0.012b",
    "ALF + CP": "0b 0.006b 0.012b",
    "MPI (SVD)": "0.054c 0.031c 0.037c",
    "MPI (SVD) + B": "0.052c 0.031c 0.037c",
    "MPI (SVD) + CP": "20 20 20",
    "MPI (GS)": "0.050c 0.031c 0.037c",
    "MPI (GS) + B": "0.050c 0.031c 0.063c",
    "MPI (GS) + CP": "20 20 20",
}
_TABLE_II = {
    "LM2": "0a",
    "LM2 + B": "0a",
    "LM2 + CP": "0a",
    "ALF": "0.012b",
    "ALF + CP": "0.012b",
    "MPI (SVD)": "0.095c",
    "MPI (SVD) + B": "0.095c",
    "MPI (SVD) + CP": "3.538d",
    "MPI (GS)": "0.059c",
    "MPI (GS) + B": "0.059c",
    "MPI (GS) + CP": "20",
}
_TABLE_III = {  # outcome, steps per second of simulation, computing seconds per second of simulation
    "LM2": ("6.163c", 3303, 53.95),
    "LM2 + B": ("8.079c", 3292, 52.53),
    "LM2 + CP": ("20", 103, 36.84),
    "ALF": ("20", 3286, 36.84),
    "ALF + CP": ("20", 103, 48.69),
    "MPI (SVD)": ("6.163c", 3303, 79.64),
    "MPI (SVD) + B": ("8.079c", 3292, 79.19),
    "MPI (SVD) + CP": ("20", 103, 42.42),
    "MPI (GS)": ("6.163c", 3303, 92.87),
    "MPI (GS) + B": ("8.079c", 3292, 93.92),
    "MPI (GS) + CP": ("20", 103, 42.14),
}

CELLS: tuple[Cell, ...] = (
    *(
        _cell("I", row, column, text)
        for row, texts in _TABLE_I.items()
        for column, text in zip(FOUR_BAR_COLUMNS, texts.split(), strict=True)
    ),
    *(_cell("II", row, FIVE_BAR, text) for row, text in _TABLE_II.items()),
    *(_cell("III", row, SPATIAL, text) for row, (text, _, _) in _TABLE_III.items()),
)

Counts = dict[str, tuple[int, float]]  # row → steps and computing seconds, per second of simulation
COUNTS_III: Counts = {row: (steps, seconds) for row, (_, steps, seconds) in _TABLE_III.items()}
COUNTS_IV: Counts = {
    "LM1": (2428, 30.31),
    "LM2": (2428, 30.34),
    "MPI (GS)": (2428, 55.52),
    "MPI (SVD)": (2428, 47.07),
    "LM2 + CP": (1627, 39.5),
    "MPI (GS) + CP": (1768, 58.27),
    "MPI (SVD) + CP": (1774, 58.82),
    "ALF + CP": (1368, 28.47),
}
