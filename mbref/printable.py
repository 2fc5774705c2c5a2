"""Texts of messages: which characters act on a terminal, or are in no name, and how long words are cut."""

from __future__ import annotations

import re

# control characters except tab and line feed, separators of lines, directions of writing, single surrogates
ACTING = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")

LONG_WORD = re.compile(r"\S{300,}")  # longer than names, and than paths of most folders
LONG_LINE = re.compile(r"[^\n]{3000,}")  # as lists of thousands of names


def printable(text: str) -> str:
    """Return the text with an escape, such as ``\\x1b``, for each character that would act on a terminal."""
    return ACTING.sub(lambda found: ascii(found[0])[1:-1], text)


def shortened(text: str) -> str:
    """Return the text with an ellipsis in place of the middle of words and lines that nobody would read."""
    words = LONG_WORD.sub(lambda found: f"{found[0][:150]}…{found[0][-50:]}", text)
    return LONG_LINE.sub(lambda found: f"{found[0][:2000]} … {found[0][-500:]}", words)


def exact(number: float) -> str:
    """Return a text that reads as this very number: of six digits where they suffice, such as ``5``."""
    short = f"{number:g}"
    return short if float(short) == number else repr(float(number))


def checked_name(name: str) -> str:
    """Return a name; raises ValueError for a name with a character that is not printed."""
    if found := re.search(f"{ACTING.pattern}|[\t\n]", name):
        raise ValueError(f"must have no control character, got {found[0]!a} in it")
    return name
