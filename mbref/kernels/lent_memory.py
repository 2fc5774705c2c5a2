"""Lent memory: memory of kernels that is made and packed once, and serves one run after another.

To allocate and pack the memory of a small mechanism takes longer than a short run.  Memory that is taken back
is lent again for the same key with the bytes that it had when it was made, so that nothing of one run reaches
the next.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Hashable
from typing import Any

from mbref.kernels.aligned import aligned_copy
from mbref.kernels.copying import Bytes, copy_rows, table_of
from mbref.kernels.named_memory import packed
from mbref.kernels.records import Numbers

MOST_KEYS, MOST_OF_A_KEY, MOST_BYTES = 64, 4, 1 << 20  # kept for later; larger memory is not kept


class Lent:
    """Packed memory of a schema, and the bytes with which it begins.

    ``part`` is other lent memory that is in it, and keeps its own bytes; ``number`` tells one from another.
    """

    def __init__(self, values: Any, key: Hashable, part: Lent | None = None):
        self.values, self.key, self.number = values, key, next(_numbers)
        self.packed = packed(values, part.packed if part else None)
        self._first = Bytes(values if part is None else tuple(v for v in values if v is not part.values))
        self.size = self._first.size + (part.size if part else 0)  # bytes in arrays and records
        self._table = table_of(self._first.copies)

    def restore(self) -> None:
        """Have all arrays and records as they were made."""
        copy_rows(self._table, 0)


_kept: dict[Hashable, list[Lent]] = {}
_numbers = itertools.count()


def lent(key: Hashable, make: Callable[[], Any], part: Lent | None = None) -> Lent:
    """Memory of a key, which says all of what ``make`` makes, its part included: kept, or else made."""
    key = (key, part.number) if part else key
    kept = _kept.get(key)
    try:
        memory = kept.pop() if kept else None
    except IndexError:  # another thread was faster
        memory = None
    if memory is None:
        return Lent(make(), key, part)
    memory.restore()
    return memory


def take_back(memory: Lent) -> None:
    """Keep memory that nobody uses any more."""
    if memory.size > MOST_BYTES:
        return
    if memory.key not in _kept and len(_kept) >= MOST_KEYS:
        _kept.pop(next(iter(_kept)), None)
    kept = _kept.setdefault(memory.key, [])
    if len(kept) < MOST_OF_A_KEY:
        kept.append(memory)


def fill(target: Any, source: Any) -> None:
    """Copy the arrays of one instance of a schema into those of another."""
    for mine, theirs in zip(target, source, strict=True):
        if isinstance(theirs, tuple):
            fill(mine, theirs)
        else:
            mine[...] = theirs


def write(record: Numbers, values: Any) -> None:
    """Have a record hold these numbers."""
    for name, value in zip(values._fields, values, strict=True):
        record[name] = value


def shapes_of(values: Any) -> tuple[Any, ...]:
    """The shapes of the arrays of a schema."""
    return tuple(shapes_of(value) if isinstance(value, tuple) else value.shape for value in values)


def copied(values: Any) -> Any:
    """The same schema with arrays of its own."""
    return type(values)(*(copied(v) if isinstance(v, tuple) else aligned_copy(v) for v in values))
