"""Copies by a table of addresses / what NumPy copies."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mbref.kernels.copying import Bytes, copy_rows, rows_from, rows_to, table_of
from mbref.kernels.named_memory import packed
from mbref.kernels.records import record


class Numbers(NamedTuple):
    count: int = 1
    weight: float = 2.0


class Whole(NamedTuple):
    table: np.ndarray
    numbers: Numbers


def test_rows_go_to_arrays_and_to_numbers_of_records():
    target, numbers = np.zeros((2, 3)), record(Numbers())
    tables, sizes = np.arange(24.0).reshape(4, 2, 3), np.arange(5.0, 9.0)
    table = table_of([rows_to(target, tables), rows_to(numbers, sizes, "weight")])
    for row in (2, 0):
        assert copy_rows(table, row) == 2
        assert np.array_equal(target, tables[row])
        assert (numbers.count, numbers.weight) == (1, sizes[row])


def test_arrays_and_records_go_to_rows():
    source, numbers = np.array([1.0, 2.0]), record(Numbers(7, 8.0))
    arrays, whole = np.zeros((3, 2)), np.zeros((3, 2), dtype=np.int64)
    table = table_of([rows_from(source, arrays), rows_from(numbers, whole)])
    copy_rows(table, 1)
    assert arrays.tolist() == [[0.0, 0.0], [1.0, 2.0], [0.0, 0.0]]
    assert whole[1, 0] == 7 and not whole[[0, 2]].any()
    assert whole[1].view(float)[1] == 8.0


def test_bytes_come_back_and_arrays_without_entries_are_left_out():
    whole = Whole(np.arange(4.0).reshape(2, 2), record(Numbers(3, 4.0)))
    kept = Bytes((whole, np.zeros(0)))
    assert kept.size == 4 * 8 + 16 and len(kept.copies) == 2
    whole.table[:], whole.numbers.count = -1.0, -1
    copy_rows(table_of(kept.copies), 0)
    assert whole.table.tolist() == [[0.0, 1.0], [2.0, 3.0]] and tuple(whole.numbers) == (3, 4.0)


def test_bytes_are_also_those_of_packed_schemas():
    inside = packed(record(Numbers(3, 4.0)))
    kept = Bytes((inside,))
    inside.values.weight = 0.0
    copy_rows(table_of(kept.copies), 0)
    assert inside.values.weight == 4.0
