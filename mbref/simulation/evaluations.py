"""Evaluations of scenes of one shape, one after another in the memory of a model of their structure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from mbref.equations.evaluation import evaluate_along
from mbref.equations.initial_state import Alike, Start, consistent_starts
from mbref.equations.model import Model, Terms
from mbref.equations.packing import Packs
from mbref.kernels.copying import Bytes, copy_rows, rows_to, table_of
from mbref.kernels.layout import Equations
from mbref.kernels.scene_layout import SceneData
from mbref.scene import SceneError


class Evaluations:
    """The terms of s scenes of the structure of a model, which keeps its numbers."""

    def __init__(self, model: Model, packs: Packs):
        self._model, self._packs = model, packs
        self._numbers = Rows(numbers_of(model.memory.values, packs.data, packs))

    def terms(self, places: np.ndarray, times: np.ndarray, q: np.ndarray, v: np.ndarray) -> Terms:
        """The terms of the scenes at places (c,) at k states each, with blocks (c, k, m, 12).

        At times (c, k), coordinates (c, k, 7 nb) and velocities (c, k, 6 nb).
        """
        m, n, memory, shape = self._model.m, self._model.n, self._model.memory, times.shape
        blocks, rows, forces = (np.empty((*shape, width)) for width in (12 * m, 3 * m, n))
        for k, place in enumerate(places.tolist()):
            self._numbers.copy(place)
            evaluate_along(times[k], q[k], v[k], blocks[k], rows[k], forces[k], memory.packed.argument)
        self._model.put_numbers(memory.values, self._model.data)
        phi, nu, gamma = (rows[..., i * m : (i + 1) * m] for i in range(3))
        return Terms(self._packs.mass[places], blocks.reshape(*shape, m, 12), phi, nu, gamma, forces)

    def starts(self) -> list[Start | SceneError]:
        """The consistent start of each scene, or why there is none."""
        packs = self._packs
        scenes = Alike(
            model=self._model,
            poses=packs.start(),
            mass=packs.mass,
            length=packs.length,
            bodies=packs.listed,
            terms=self._at_start,
            model_of=lambda place: Model(packs.scenes[place], packs, place),
        )
        return consistent_starts(scenes)

    def _at_start(self, places: np.ndarray, q: np.ndarray, v: np.ndarray) -> Terms:
        """The terms at t = 0, of one state of each scene, with blocks (c, m, 12)."""
        terms = self.terms(places, np.zeros((len(places), 1)), q[:, None], v[:, None])
        of_states = (terms.jacobian, terms.phi, terms.nu, terms.gamma, terms.force)
        return Terms(terms.mass, *(values[:, 0] for values in of_states))


class Rows:
    """Arrays of which a row at a time is copied to memory, behind the bytes that it has else."""

    def __init__(self, rows: Sequence[tuple[Any, ...]], before: Bytes | None = None):
        self._kept = before, [(target, np.ascontiguousarray(of_all), *name) for target, of_all, *name in rows]
        copies = before.copies if before else []
        self._table = table_of([*copies, *(rows_to(*each) for each in self._kept[1])])

    def copy(self, place: int) -> None:
        """Have memory hold a row."""
        copy_rows(self._table, place)


def numbers_of(equations: Equations, data: SceneData, packs: Packs) -> list[tuple[Any, ...]]:
    """Arrays of memory of evaluations, and those of scenes whose rows belong there."""
    system = equations.system
    masses = (system.mass, packs.mass), (system.inverse_root, packs.inverse_root)
    return [*zip(arrays_of(equations.scene), arrays_of(data), strict=True), *masses]


def arrays_of(values: Sequence[Any]) -> Iterator[np.ndarray]:
    """All arrays of nested tuples."""
    for value in values:
        if isinstance(value, np.ndarray):
            yield value
        else:
            yield from arrays_of(value)
