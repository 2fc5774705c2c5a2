"""Arrays that begin at a cache line of the processor, so that a block of eight numbers fills one line."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

CACHE_LINE = 64  # bytes
Kind = tuple[tuple[int, ...], np.dtype]  # shape and type of an array


def aligned_zeros(kinds: Iterable[Kind]) -> list[np.ndarray]:
    """Return zeros of these shapes and types, C-contiguous, one after another in one block of memory."""
    kinds = [*kinds]
    sizes = [math.prod(shape) * dtype.itemsize for shape, dtype in kinds]
    places = [0]
    for size in sizes:
        places.append(places[-1] - (-size // CACHE_LINE) * CACHE_LINE)
    block = np.zeros(places[-1] + CACHE_LINE, np.uint8)
    first = -block.ctypes.data % CACHE_LINE
    return [
        block[first + place : first + place + size].view(dtype).reshape(shape)
        for place, size, (shape, dtype) in zip(places[:-1], sizes, kinds, strict=True)
    ]


def block_of(array: np.ndarray) -> np.ndarray:
    """Return the block of memory of an array that ``aligned_zeros`` made, or any other array itself."""
    block = array.base
    return block if isinstance(block, np.ndarray) and block.dtype == np.uint8 else array
