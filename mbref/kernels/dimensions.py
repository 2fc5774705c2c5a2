"""Dimensions of declared arrays: expressions in the names of sizes, and whether arrays fit them.

Results are cached, because successive runs allocate and check equal schemas.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping
from types import CodeType

MOST_CHECKED = 256  # number of schemas with sizes whose check is cached

Shapes = tuple[str, tuple[str, ...], tuple[int, ...]]  # name of an array, its declared and its actual shape


def size_of(expression: str, sizes: Mapping[str, int]) -> int:
    """Return the length of a dimension, an expression in the names of sizes from the schema's source."""
    if expression in sizes:
        return sizes[expression]
    return int(eval(_compiled(expression), {"max": max}, dict(sizes)))


@functools.cache
def _compiled(expression: str) -> CodeType:
    return compile(expression, "<dimension>", "eval")


@functools.cache
def _names(expression: str) -> set[str]:
    """Return the names of sizes in an expression."""
    return set(re.findall(r"[a-z_]\w*", expression)) - {"max"}


@functools.lru_cache(maxsize=MOST_CHECKED)
def check_sizes(arrays: tuple[Shapes, ...]) -> None:
    """Raise TypeError unless dimensions of one name have one length in all arrays."""
    sizes: dict[str, int] = {}
    for _, shape, found in arrays:
        for dimension, length in zip(shape, found, strict=True):
            if dimension.isidentifier():
                sizes.setdefault(dimension, length)
    for name, shape, found in arrays:
        for dimension, length in zip(shape, found, strict=True):
            if not _names(dimension) <= sizes.keys():
                sizes.setdefault(dimension, length)
        declared = tuple(size_of(dimension, sizes) for dimension in shape)
        if declared != found:
            raise TypeError(f"{name}: ({', '.join(shape)}) is {declared} here, got {found}")
