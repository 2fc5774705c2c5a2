"""Blocks: the parts of a section (headings, sentences, tables and figures) as data.

A section returns blocks; ``reports.render`` writes them as HTML and as Markdown.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure as PlotFigure

    Drawing = PlotFigure | str  # a figure of matplotlib, or a mechanism as SVG text


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
    """Table with the cells as they are printed; the columns in ``right`` contain numbers and are
    right-aligned.

    ``folded`` tables are long: the page shows their ``caption`` and opens them on demand.
    """

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    right: frozenset[int] = frozenset()
    folded: bool = False


@dataclass(frozen=True)
class Figure:
    """A picture: ``name`` is unique in the report and becomes a file name, ``caption`` explains the
    picture."""

    name: str
    caption: str
    draw: Callable[[], Drawing]


class Linked(str):
    """A table cell that links to a place in the page; Markdown shows its text only."""

    href: str

    def __new__(cls, text: str, href: str) -> Linked:
        """Return the text; ``href`` is the id of the place with ``#``."""
        made = super().__new__(cls, text)
        made.href = href
        return made


class Marked(str):
    """A table cell in Markdown, of pages of the documentation only."""


class Within(Linked):
    """A table cell that links to a place that the page has in Markdown too: a Fold or a heading."""


@dataclass(frozen=True)
class Prose:
    """Prose in Markdown, of pages of the documentation only."""

    text: str


@dataclass(frozen=True)
class Fold:
    """Blocks that the page shows on demand, below their ``summary``; ``place`` is the id in the page."""

    summary: str
    place: str
    blocks: Sequence[Block]


@dataclass(frozen=True)
class Opening:
    """The top of the page: a headline, sentences with the question that each answers, and an animated
    mechanism (SVG, or empty)."""

    headline: str
    sentences: Mapping[str, str]
    svg: str
    caption: str


@dataclass(frozen=True)
class Moving:
    """Mechanisms side by side, animated unless ``is_still``: title and SVG of each."""

    caption: str
    panels: Sequence[tuple[str, str]]
    is_still: bool = False


@dataclass(frozen=True)
class Cell:
    """A cell of a heat map: its text, its kind ("kept", "false", "ended" or ""), the depth of its colour,
    from 0 to 1, and the id of the place of the page to which it links."""

    text: str
    kind: str
    depth: float = 0.0
    href: str = ""


@dataclass(frozen=True)
class HeatMap:
    """A heat map: cells by row and column; ``label`` names the quantity of the columns."""

    caption: str
    label: str
    columns: Sequence[str]
    rows: Mapping[str, Sequence[Cell]]


@dataclass(frozen=True)
class Verdict:
    """One family in a cell of the matrix: grade and sign, further lines, its id in the page, and the link to
    its best run."""

    family: str
    grade: str
    sign: str
    lines: Sequence[str]
    place: str
    href: str


@dataclass(frozen=True)
class Matrix:
    """Matrix of scenes and engines.

    ``engines`` are (name, title, tone, mark). ``cells[scene][engine]`` contains the verdicts on the families
    of an engine, and is empty if the engine has no run.
    """

    caption: str
    engines: Sequence[tuple[str, str, int, str]]
    scenes: Sequence[tuple[str, str]]
    cells: Mapping[str, Mapping[str, Sequence[Verdict]]]


@dataclass(frozen=True)
class Plot:
    """An interactive figure: caption, SVG, legend (engine, tone, mark, families), and its numbers as a Figure
    for Markdown."""

    caption: str
    svg: str
    legend: Sequence[tuple[str, int, str, Sequence[str]]]
    figure: Figure


@dataclass(frozen=True)
class Card:
    """A run in the page: its id, settings, grade, numbers by name, message, command and origin."""

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
    """The runs of a family on a scene, shown on demand; ``back`` links to the cell of the matrix."""

    place: str
    scene: str
    title: str
    tone: int
    cards: Sequence[Card]
    back: str


@dataclass(frozen=True)
class Listing:
    """Lines printed unchanged in a fixed-width font; ``kind`` names their language in Markdown."""

    text: str
    kind: str = ""


Block = (
    Heading
    | Text
    | Prose
    | Table
    | Figure
    | Listing
    | Fold
    | Opening
    | Moving
    | HeatMap
    | Matrix
    | Plot
    | Record
)
Parts = Mapping[str, Sequence[Block] | str]  # of a page of the documentation, by their names in its template


def listing(lines: Iterable[str], numbered: bool = False) -> list[Block]:
    """Return a list of lines in Markdown; empty without lines."""
    items = [f"{i}. {line}" if numbered else f"- {line}" for i, line in enumerate(lines, 1)]
    return [Prose("\n".join(items))] if items else []


def anchor(name: str) -> str:
    """Return the place of a folded row in a page, from its name."""
    return "".join(c if c.isalnum() else "-" for c in name)
