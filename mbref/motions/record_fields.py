"""Types of the texts and numbers of an object that is read from a record."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, TypeVar

KINDS: dict[str, tuple[type, ...]] = {"str": (str,), "float": (float, int), "int": (int,)}
T = TypeVar("T")


def typed(made: T) -> T:
    """Return an object of a dataclass; raises ValueError for a text or number of another type than declared.

    None is allowed for a number, because a record has null for NaN.
    """
    declared: Any = made
    for each in fields(declared):
        kinds, value = KINDS.get(str(each.type).removesuffix(" | None")), getattr(made, each.name)
        if kinds and type(value) not in kinds and (value is not None or str in kinds):
            raise ValueError(f"{each.name}: must be {each.type}, got {value!r:.40}")
    return made
