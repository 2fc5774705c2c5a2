"""Collections whose values are computed at first access, because this takes longer than a short run.

A collection is pickled as its function with the arguments, so that another process can compute its values.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any


class _Lazy:
    """The keys of a collection, and the function with arguments that returns its values."""

    def __init__(self, keys: Collection[Any], find: Callable[..., Any], *arguments: Any):
        self._keys, self._find, self._arguments = keys, find, arguments

    @cached_property
    def _found(self) -> Any:
        return self._find(*self._arguments)

    def __len__(self) -> int:
        return len(self._keys)

    def __getitem__(self, key: Any) -> Any:
        return self._found[key]

    def __repr__(self) -> str:
        return repr(self._found)


class LazyMapping(_Lazy, Mapping[str, Any]):
    """Mapping with known names; the function returns a mapping with these names."""

    def __iter__(self) -> Iterator[str]:
        return iter(self._keys)


class LazySequence(_Lazy, Sequence[Any]):
    """Sequence with the length of its keys; the function returns a sequence of this length."""
