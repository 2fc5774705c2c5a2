"""Memory pool: saved numbers come back, and parameters of scenes are written to arrays and records."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mbref.ensembles.candidates import Parameters
from mbref.kernels.memory_pool import SavedNumbers
from mbref.kernels.named_memory import packed
from mbref.kernels.records import record


class Numbers(NamedTuple):
    count: int = 1
    weight: float = 2.0


class Whole(NamedTuple):
    table: np.ndarray
    numbers: Numbers


def test_parameters_of_a_scene_go_to_arrays_and_to_numbers_of_records():
    target, numbers = np.zeros((2, 3)), record(Numbers())
    tables, sizes = np.arange(24.0).reshape(4, 2, 3), np.arange(5.0, 9.0)
    parameters = Parameters([(target, tables), (numbers, sizes, "weight")])
    for place in (2, 0):
        parameters.write(place)
        assert np.array_equal(target, tables[place])
        assert (numbers.count, numbers.weight) == (1, sizes[place])


def test_saved_numbers_come_back_before_those_of_a_scene():
    whole = Whole(np.arange(4.0).reshape(2, 2), record(Numbers(3, 4.0)))
    parameters = Parameters(
        [(whole.numbers, np.array([7.0, 8.0]), "weight")], SavedNumbers((whole, np.zeros(0)))
    )
    whole.table[:], whole.numbers.count = -1.0, -1
    parameters.write(1)
    assert whole.table.tolist() == [[0.0, 1.0], [2.0, 3.0]] and tuple(whole.numbers) == (3, 8.0)


def test_saved_numbers_are_also_those_of_packed_schemas():
    inside = packed(record(Numbers(3, 4.0)))
    saved = SavedNumbers((inside,))
    assert saved.size == 16
    inside.values.weight = 0.0
    saved.restore()
    assert inside.values.weight == 4.0
