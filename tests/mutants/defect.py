"""A one-line defect."""

from __future__ import annotations

from typing import NamedTuple


class Defect(NamedTuple):
    """``old``, which the file has once, becomes ``new``; ``tests``, one or several, have to fail."""

    file: str
    old: str
    new: str
    tests: str
    unseen: str = ""  # why no test can see it
