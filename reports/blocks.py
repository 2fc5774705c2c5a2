"""The parts of a section as data: headings, sentences, tables and figures.

A section makes blocks once; ``render`` writes them as HTML and as Markdown.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure as PlotFigure

    Drawing = PlotFigure | str  # a figure of matplotlib, or a mechanism as SVG


@dataclass(frozen=True)
class Heading:
    """A heading; ``level`` 2 opens a chapter, 3 a part of it."""

    text: str
    level: int = 3


@dataclass(frozen=True)
class Text:
    """One paragraph of plain text."""

    text: str


@dataclass(frozen=True)
class Table:
    """Cells as they are printed; the columns in ``right`` hold numbers and are right-aligned.

    ``folded`` tables are long: the page shows their ``caption`` and opens them on demand.
    """

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    right: frozenset[int] = frozenset()
    folded: bool = False


@dataclass(frozen=True)
class Figure:
    """A picture: ``name`` is unique in the report and a file name, ``caption`` how to read it."""

    name: str
    caption: str
    draw: Callable[[], Drawing]


class Linked(str):
    """A cell that leads to a place of the page; in Markdown its text alone."""

    href: str

    def __new__(cls, text: str, href: str) -> Linked:
        """The text, with the id of the place, ``#`` included."""
        made = super().__new__(cls, text)
        made.href = href
        return made


@dataclass(frozen=True)
class Opening:
    """The first screen: a headline, sentences by what they answer, and a mechanism that moves (SVG, or
    empty)."""

    headline: str
    sentences: Mapping[str, str]
    svg: str
    caption: str


@dataclass(frozen=True)
class Moving:
    """Mechanisms that move side by side: title and SVG of each."""

    caption: str
    panels: Sequence[tuple[str, str]]


@dataclass(frozen=True)
class Cell:
    """A cell of a heat map: its text, its kind ("kept", "false", "ended" or ""), how deep its colour is, from
    0 to 1, and the id of the place of the page that it leads to."""

    text: str
    kind: str
    depth: float = 0.0
    href: str = ""


@dataclass(frozen=True)
class HeatMap:
    """Cells by row and column; ``label`` names the quantity of the columns."""

    caption: str
    label: str
    columns: Sequence[str]
    rows: Mapping[str, Sequence[Cell]]


@dataclass(frozen=True)
class Verdict:
    """One family in a cell of the matrix: its grade and sign, the lines below, its place, and the link to its
    best run."""

    family: str
    grade: str
    sign: str
    lines: Sequence[str]
    place: str
    href: str


@dataclass(frozen=True)
class Matrix:
    """Scenes × engines: ``engines`` are (name, title, tone, mark), ``cells[scene][engine]`` the verdicts on
    an engine's families; empty where it has no run."""

    caption: str
    engines: Sequence[tuple[str, str, int, str]]
    scenes: Sequence[tuple[str, str]]
    cells: Mapping[str, Mapping[str, Sequence[Verdict]]]


@dataclass(frozen=True)
class Plot:
    """A figure that can be asked: its caption, SVG, the legend (engine, tone, mark, families), and the same
    numbers as a Figure for Markdown."""

    caption: str
    svg: str
    legend: Sequence[tuple[str, int, str, Sequence[str]]]
    figure: Figure


@dataclass(frozen=True)
class Card:
    """A run in the page: its place, settings, grade, numbers by name, message, command, and what made it."""

    place: str
    settings: str
    grade: str
    sign: str
    numbers: Mapping[str, str]
    message: str
    command: str
    made: str


@dataclass(frozen=True)
class Record:
    """The runs of an engine's family on a scene, shown when one is asked for; ``back`` is the place in the
    matrix that leads here."""

    place: str
    scene: str
    title: str
    tone: int
    cards: Sequence[Card]
    back: str


@dataclass(frozen=True)
class Listing:
    """Lines printed as they are, in a fixed-width face."""

    text: str


Block = Heading | Text | Table | Figure | Listing | Opening | Moving | HeatMap | Matrix | Plot | Record
