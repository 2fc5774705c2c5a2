"""Entries of a scene that are made from the numbers of a file, with sentences on values that no scene has."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from mbref.scene import SceneError

Entry = TypeVar("Entry")


def entry(where: str, make: Callable[..., Entry], *values: Any, **fields: Any) -> Entry:
    """Return ``make(*values, **fields)``; raises SceneError, which names the part ``where`` of the file and
    the field, for a value that a scene does not have."""
    try:
        return make(*values, **fields)
    except SceneError as error:
        raise SceneError([f"{where}: {fault}" for fault in error.faults]) from None
