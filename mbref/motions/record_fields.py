"""Fields of an object that is read from a record: types of texts and numbers, and arrays by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, TypeVar

import numpy as np

DECLARED: dict[str, tuple[type, ...]] = {"str": (str,), "float": (float, int), "int": (int,)}
T = TypeVar("T")


def typed(made: T) -> T:
    """Return an object of a dataclass; raises ValueError for a text or number of another type than declared.

    None is allowed for a number, because a record has null for NaN.
    """
    declared: Any = made
    for each in fields(declared):
        kinds, value = DECLARED.get(str(each.type).removesuffix(" | None")), getattr(made, each.name)
        if kinds and type(value) not in kinds and (value is not None or str in kinds):
            raise ValueError(f"{each.name}: must be {each.type}, got {value!r:.40}")
    return made


def arrays(
    lists: Mapping[str, Any] | None, shape: tuple[int, ...], kind: type
) -> dict[str, np.ndarray] | None:
    """Return arrays of a shape by name, or None without lists. Raises ValueError for another shape."""
    if lists is None:
        return None
    return {name: np.array(values, dtype=kind).reshape(shape) for name, values in lists.items()}
