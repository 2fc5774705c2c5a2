"""Colours and marks of engines in the page, and words for grades."""

from __future__ import annotations

import functools
from collections.abc import Mapping

from crosscheck.engine import engine_names
from crosscheck.study.grades import DEFAULTS, Grade
from crosscheck.study.words.speed import title

TONES = 7  # number of colours in the style sheet; third-party engines share the last one
SIGNS: Mapping[Grade, str] = {
    Grade.RIGHT: "=",
    Grade.INACCURATE: "≈",
    Grade.WRONG: "≠",
    Grade.FAILED: "×",
    Grade.UNJUDGED: "?",
}
MARKS = (  # SVG paths within five pixels of the origin
    "M5 0A5 5 0 1 1-5 0 5 5 0 1 1 5 0Z",
    "M-4.4-4.4H4.4V4.4H-4.4Z",
    "M0-5.4 5 3.8H-5Z",
    "M0-6 5.6 0 0 6-5.6 0Z",
    "M0 5.4-5-3.8H5Z",
    "M-1.8-5H1.8V-1.8H5V1.8H1.8V5H-1.8V1.8H-5V-1.8H-1.8Z",
    "M-5-2.2-2.2-5 5 2.2 2.2 5Z",
)


def tone(engine: str) -> int:
    """Return the number of an engine's colour and mark, which is equal in all pictures."""
    names = _names()
    return min(names.index(engine), TONES - 1) if engine in names else TONES - 1


@functools.cache
def _names() -> tuple[str, ...]:
    """Return the names of crosscheck's own engines; looking for third-party engines would take 50 ms."""
    return tuple(engine_names())


def mark(engine: str) -> str:
    """Return the SVG path of an engine's mark."""
    return MARKS[tone(engine)]


def named(engine: str, family: str) -> str:
    """Return engine and family as text."""
    return f"{title(engine)}, {family}"


def is_hollow(family: str) -> bool:
    """Return whether a family's marks have no filling: this marks the library's defaults."""
    return family == DEFAULTS
