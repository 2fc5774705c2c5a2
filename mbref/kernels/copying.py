"""Copies of bytes between memories, by a table of addresses, in one call.

A run is set up by some hundred small arrays; to copy them one by one from Python takes longer than a short
run.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import i8
from numba.core import cgutils
from numba.extending import intrinsic

from mbref.kernels.compilation import INDEX_TABLE, INT, PLAIN, entry
from mbref.kernels.named_memory import Packed
from mbref.kernels.records import Numbers


class Copy(NamedTuple):
    """Where ``size`` bytes go to and come from, and how far apart both are from one row to the next."""

    target: int
    target_step: int
    source: int
    source_step: int
    size: int


@intrinsic
def _move(typingctx, target, source, size):
    def generate(context, builder, signature, arguments):
        pointer = ir.IntType(8).as_pointer()
        places = (builder.inttoptr(address, pointer) for address in arguments[:2])
        cgutils.raw_memcpy(builder, *places, arguments[2], 1)
        return arguments[2]

    return i8(target, source, size), generate


def _move_from_python(target: int, source: int, size: int) -> int:
    ctypes.memmove(int(target), int(source), int(size))
    return size


move = _move_from_python if PLAIN else _move


@entry(INT(INDEX_TABLE, INT))
def copy_rows(copies, row):
    """Make the copies (k, 5) of a row; returns how many."""
    for k in range(copies.shape[0]):
        target = copies[k, 0] + row * copies[k, 1]
        move(target, copies[k, 2] + row * copies[k, 3], copies[k, 4])
    return copies.shape[0]


def table_of(copies: Iterable[Copy]) -> np.ndarray:
    """Copies as the table (k, 5) that ``copy_rows`` takes; of no bytes there are none."""
    return np.array([copy for copy in copies if copy.size], dtype=np.int64).reshape(-1, len(Copy._fields))


def address_of(values: np.ndarray | Numbers, name: str | None = None) -> int:
    """Where an array or a record begins, or a number of the record."""
    address = int(values.__array_interface__["data"][0])
    return address if name is None else address + int(values.dtype.fields[name][1])


def places(values: Any) -> Iterable[tuple[int, int]]:
    """Address and size of each array and record of a schema, and of the packed schemas in it."""
    if isinstance(values, Packed):
        yield from places(values.values)
    elif isinstance(values, tuple):
        for value in values:
            yield from places(value)
    elif isinstance(values, np.ndarray | Numbers) and values.nbytes:
        yield address_of(values), values.nbytes


class Bytes:
    """The bytes of a memory at one time, and the copies that bring them back."""

    def __init__(self, values: Any):
        found = sorted(set(places(values)))
        self._kept = np.frombuffer(b"".join(ctypes.string_at(*place) for place in found), dtype=np.uint8)
        starts = np.cumsum([0, *(size for _, size in found)]).tolist()
        base = address_of(self._kept)
        self.copies = [
            Copy(address, 0, base + start, 0, size)
            for (address, size), start in zip(found, starts, strict=False)
        ]
        self.size = starts[-1]


def rows_to(target: np.ndarray | Numbers, rows: np.ndarray, name: str | None = None) -> Copy:
    """The copy of a row of an array to an array, or to a number of a record."""
    return Copy(address_of(target, name), 0, address_of(rows), rows.strides[0], rows[0].nbytes)


def rows_from(source: np.ndarray | Numbers, rows: np.ndarray) -> Copy:
    """The copy of an array, or of a record, to a row of an array."""
    return Copy(address_of(rows), rows.strides[0], address_of(source), 0, source.nbytes)
