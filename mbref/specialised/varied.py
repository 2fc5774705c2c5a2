"""Varied numbers: those in which scenes of one structure differ; code that serves them all takes them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from mbref.equations.packing import row_of
from mbref.kernels.scene_layout import SceneData
from mbref.specialised.tracing import Record, inputs


class Varied:
    """The numbers in which s scenes differ, from arrays whose first axis counts the scenes.

    ``data`` is that of the first scene, with the primitives that runs need; ``numbers`` (s, k) are the
    values of the k numbers that vary.
    """

    def __init__(
        self, data: SceneData, mass: np.ndarray, inverse_root: np.ndarray, q: np.ndarray, v: np.ndarray
    ):
        every = [*arrays_of(data), mass, inverse_root, q, v]
        self._first = [array[0] for array in every]
        self._masks = [(array != array[0]).any(axis=0) for array in every]
        pairs = zip(every, self._masks, strict=True)
        self.numbers = np.concatenate(
            [array[:, mask] for array, mask in pairs if mask.any()] or [q[:, :0]], axis=1
        )
        self.data = row_of(data, 0)

    def constants(self) -> list[np.ndarray]:
        """All numbers, zero for those that vary, and which those are."""
        pairs = zip(self._first, self._masks, strict=True)
        return [*self._masks, *(np.where(mask, 0, array) for array, mask in pairs)]

    def put_inputs(self, record: Record, memory: Any) -> None:
        """Have memory of objects take the numbers that vary as inputs of a record."""
        scalars = np.empty(self.numbers.shape[1], dtype=object)
        scalars[:] = inputs(record, "numbers", self.numbers[0])
        equations, state, place = memory.equations, memory.state, 0
        targets = [
            *arrays_of(equations.scene), equations.system.mass, equations.system.inverse_root,
            state.coordinates, state.velocities,
        ]  # fmt: skip
        for target, mask in zip(targets, self._masks, strict=True):
            count = np.count_nonzero(mask)
            target[mask] = scalars[place : place + count]
            place += count


def arrays_of(values: Sequence[Any]) -> Iterator[np.ndarray]:
    """All arrays of nested tuples."""
    for value in values:
        if isinstance(value, np.ndarray):
            yield value
        else:
            yield from arrays_of(value)
