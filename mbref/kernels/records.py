"""Records: numbers of a schema in their own memory, which Python and kernels read and write by name."""

from __future__ import annotations

import functools
import operator
import typing
from typing import Any, NamedTuple, TypeVar

import numpy as np

Schema = TypeVar("Schema")


class NoNumbers(NamedTuple):
    """Schema of a part of a method without numbers of its own."""


class Numbers(np.void):  # type: ignore[misc]  # NumPy's stubs call it final
    """Numbers of a schema in their own memory; a subclass for each schema has properties with the names of
    the numbers."""

    __slots__ = ()


def is_record(schema: type) -> bool:
    """Return whether all fields of a NamedTuple are numbers."""
    return all(hint in (int, float) for hint in typing.get_type_hints(schema).values())


@functools.cache
def dtype_of(record: type) -> np.dtype:
    """Return the NumPy structure of a record; raises TypeError for a field name that NumPy uses."""
    hints = typing.get_type_hints(record)
    if taken := [name for name in hints if hasattr(Numbers, name)]:
        raise TypeError(f"{record.__name__}: NumPy's records have attributes called {', '.join(taken)}")
    return np.dtype([(name, "i8" if hint is int else "f8") for name, hint in hints.items()])


@functools.cache
def record_type_of(schema: type) -> np.dtype:
    """Return the NumPy type of a record of numbers."""
    numbers = {name: _number(name) for name in typing.get_type_hints(schema)}
    return np.dtype((type(schema.__name__, (Numbers,), {"__slots__": (), **numbers}), dtype_of(schema)))


def _number(name: str) -> property:
    """Return a property for a number, which takes a third of the time of NumPy's own attribute access."""

    def put(numbers: Numbers, value: Any) -> None:
        numbers[name] = value

    return property(operator.itemgetter(name), put)


def record(values: Schema) -> Schema:
    """Return the numbers of a record in their own memory, to be read and written by name."""
    kind: Any = type(values)
    return np.array([values], dtype=record_type_of(kind))[0]
