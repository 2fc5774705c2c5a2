"""The look of engines in the page: a place in the list of colours, a mark, and a word for a grade."""

from __future__ import annotations

import functools
from collections.abc import Mapping

from crosscheck.engine import engine_names
from crosscheck.study.speed_sentences import title
from crosscheck.study.verdict import DEFAULTS, Grade

TONES = 7  # colours of the style sheet; engines of third parties share the last
SIGNS: Mapping[Grade, str] = {
    Grade.RIGHT: "=",
    Grade.INACCURATE: "≈",
    Grade.WRONG: "≠",
    Grade.FAILED: "×",
    Grade.UNJUDGED: "?",
}
MARKS = (  # paths within five pixels of the origin
    "M5 0A5 5 0 1 1-5 0 5 5 0 1 1 5 0Z",
    "M-4.4-4.4H4.4V4.4H-4.4Z",
    "M0-5.4 5 3.8H-5Z",
    "M0-6 5.6 0 0 6-5.6 0Z",
    "M0 5.4-5-3.8H5Z",
    "M-1.8-5H1.8V-1.8H5V1.8H1.8V5H-1.8V1.8H-5V-1.8H-1.8Z",
    "M-5-2.2-2.2-5 5 2.2 2.2 5Z",
)


def tone(engine: str) -> int:
    """The number of an engine's colour and mark, the same everywhere."""
    names = _names()
    return min(names.index(engine), TONES - 1) if engine in names else TONES - 1


@functools.cache
def _names() -> tuple[str, ...]:
    """The engines known here; looking for entry points takes 50 ms."""
    return tuple(engine_names())


def mark(engine: str) -> str:
    """The path of an engine's mark."""
    return MARKS[tone(engine)]


def named(engine: str, family: str) -> str:
    """An engine and a family in words."""
    return f"{title(engine)}, {family}"


def is_hollow(family: str) -> bool:
    """Whether a family's marks are drawn hollow: the library's defaults."""
    return family == DEFAULTS
