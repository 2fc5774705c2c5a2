"""The parts of a section as data: headings, sentences, tables and figures.

A section makes blocks once; ``render`` writes them as HTML and as Markdown.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing


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


@dataclass(frozen=True)
class Listing:
    """Lines printed as they are, in a fixed-width face."""

    text: str


Block = Heading | Text | Table | Figure | Listing
