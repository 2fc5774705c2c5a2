"""Memory pool: memory of kernels that is made and packed once, and reused by successive runs.

To allocate and pack the memory of a small mechanism takes longer than a short run.  Released memory is
acquired again for an equal key. The numbers of acquired memory are reset, so that no number of a run reaches
the next run.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Hashable, Sequence
from typing import Any

import numpy as np

from mbref.kernels.aligned import aligned_zeros, block_of
from mbref.kernels.named_memory import Packed, packed
from mbref.kernels.records import Numbers

# limits of stored memory: keys, pieces of a key, bytes of a piece
MOST_KEYS, MOST_OF_A_KEY, MOST_BYTES = 64, 4, 1 << 20


class SavedNumbers:
    """Copies of all arrays and records of a memory, by blocks of memory."""

    def __init__(self, values: Any):
        written = (array for array in arrays_in(values) if array.nbytes and array.flags.writeable)
        blocks = {id(block): block for block in map(block_of, written)}
        self._pairs = [(view, bytes(view)) for view in map(bytes_of, blocks.values())]
        self.size = sum(len(numbers) for _, numbers in self._pairs)  # bytes

    def restore(self) -> None:
        """Write the numbers back to the arrays and records from which they were copied."""
        for view, numbers in self._pairs:
            view[:] = numbers


def bytes_of(array: np.ndarray) -> memoryview:
    """Return the bytes of a contiguous array, which take a third of the time to copy."""
    buffer: Any = np.frombuffer(array, np.uint8)  # raises ValueError unless the array is contiguous
    return memoryview(buffer)


def arrays_in(values: tuple[Any, ...]) -> list[np.ndarray]:
    """Return the arrays of a schema and of the packed schemas in it. The array of a record has one
    element."""
    found: list[np.ndarray] = []
    _add_arrays(values, found)
    return found


def _add_arrays(values: tuple[Any, ...], found: list[np.ndarray]) -> None:
    for value in values:
        if isinstance(value, np.ndarray):
            found.append(value)
        elif isinstance(value, tuple):
            _add_arrays(value, found)
        elif isinstance(value, Packed):
            _add_arrays((value.values,), found)
        elif isinstance(value, Numbers):
            found.append(np.asarray(value.base))


class Pooled:
    """Packed memory of a schema, with its initial numbers.

    ``part`` is other pooled memory inside this memory, with its own initial numbers; ``number`` identifies
    the memory.
    """

    def __init__(self, values: Any, key: Hashable, part: Pooled | None = None):
        self.values: Any = values
        self.key, self.number = key, next(_numbers)
        self.packed: Packed = packed(values, part.packed if part else None)
        self._first = SavedNumbers(
            values if part is None else tuple(v for v in values if v is not part.values)
        )
        self.size: int = self._first.size + (part.size if part else 0)  # bytes in arrays and records

    def restore(self) -> None:
        """Write the initial numbers to the arrays and records, except in ``part``."""
        self._first.restore()


_kept: dict[Hashable, list[Pooled]] = {}
_numbers = itertools.count()


def acquire(key: Hashable, make: Callable[[], Any], part: Pooled | None = None) -> Pooled:
    """Return memory for a key: stored memory, or memory that ``make`` returns. The key determines everything
    that ``make`` returns, its part included."""
    key = (key, part.number) if part else key
    kept = _kept.get(key)
    try:
        memory = kept.pop() if kept else None
    except IndexError:  # another thread was faster
        memory = None
    if memory is None:
        return Pooled(make(), key, part)
    memory.restore()
    return memory


def release(memory: Pooled) -> None:
    """Store memory that is no longer used."""
    if memory.size > MOST_BYTES:
        return
    if memory.key not in _kept and len(_kept) >= MOST_KEYS:
        _kept.pop(next(iter(_kept)), None)
    kept = _kept.setdefault(memory.key, [])
    if len(kept) < MOST_OF_A_KEY:
        kept.append(memory)


def fill(target: tuple[Any, ...], arrays: Sequence[np.ndarray]) -> None:
    """Copy arrays into the arrays of a schema, in their order."""
    for mine, theirs in zip(arrays_in(target), arrays, strict=True):
        mine[...] = theirs


def write_record(record: Any, values: Any) -> None:
    """Write the numbers of a schema to a record of the schema."""
    record.base[0] = values


def copied(values: Any) -> Any:
    """Return an instance of an equal schema with its own arrays."""
    arrays = [value for value in values if not isinstance(value, tuple)]
    copies = aligned_zeros((array.shape, array.dtype) for array in arrays)
    for copy, array in zip(copies, arrays, strict=True):
        copy[...] = array
    found = iter(copies)
    return type(values)(*(copied(v) if isinstance(v, tuple) else next(found) for v in values))
