"""Scenes of equal structure that are evaluated in the memory of one model, and the numbers in which they
differ."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mbref.equations.evaluation import evaluate_along
from mbref.equations.initial_state import Alike, Start, consistent_starts
from mbref.equations.model import Model, Terms
from mbref.equations.packing import Packs
from mbref.kernels.layout import Equations
from mbref.kernels.memory_pool import SavedNumbers, arrays_in, bytes_of
from mbref.kernels.scene_layout import SceneData
from mbref.scene import SceneError


class Parameters:
    """Arrays of memory, each with the values (s, …) of s scenes.

    ``values`` are (array, values), or (record, values, name of a number in it).  ``saved`` numbers are
    restored before the values of a scene are written.
    """

    def __init__(self, values: Sequence[tuple[Any, ...]], saved: SavedNumbers | None = None):
        self._numbers = [value for value in values if len(value) == 3]
        arrays = [value for value in values if len(value) == 2]
        self._arrays = [(bytes_of(target), *_rows(target, of_all)) for target, of_all in arrays]
        self._saved = saved

    def write(self, place: int) -> None:
        """Write the numbers of the scene with the given index."""
        if self._saved is not None:
            self._saved.restore()
        for target, of_all, name in self._numbers:
            target[name] = of_all[place]
        for array, rows, size in self._arrays:
            array[:] = rows[place * size : (place + 1) * size]


def _rows(target: np.ndarray, of_all: np.ndarray) -> tuple[memoryview, int]:
    """Return the bytes of the values (s, …) of an array, and the number of bytes of one scene."""
    rows = np.ascontiguousarray(of_all, dtype=target.dtype).reshape(len(of_all), *target.shape)
    return bytes_of(rows), target.nbytes


def parameters_of(equations: Equations, data: SceneData, packs: Packs) -> list[tuple[Any, ...]]:
    """Return the arrays of an equation's memory in which the scenes differ from the lead scene, each with the
    values of all scenes. No kernel changes these arrays."""
    system = equations.system
    masses = (system.mass, packs.mass), (system.inverse_root, packs.inverse_root)
    pairs = [*zip(arrays_in(equations.scene), arrays_in(data), strict=True), *masses]
    return [(array, of_all) for array, of_all in pairs if (array != of_all).any()]


class Evaluations:
    """Terms of the equations of s scenes whose structure equals the structure of a model. After an evaluation
    the model contains the numbers of its own scene again."""

    def __init__(self, model: Model, packs: Packs):
        self._model, self._packs = model, packs
        self._parameters = Parameters(parameters_of(model.memory.values, packs.data, packs))

    def terms(
        self,
        places: np.ndarray,
        times: np.ndarray,
        q: np.ndarray,
        v: np.ndarray,
        angles: np.ndarray | None = None,
    ) -> Terms:
        """Return the terms of c scenes, given by index, at k states each; blocks have the shape (c, k, m,
        12): m rows, columns of two bodies.

        Arguments are times (c, k), coordinates (c, k, 7 nb) and velocities (c, k, 6 nb); angles of turning
        joints are nearest to ``angles`` (c, k, a), by default within half a turn.
        """
        m, n, memory, shape = self._model.m, self._model.n, self._model.memory, times.shape
        columns, reference = self._model.entry_columns, memory.values.angles
        blocks, rows, forces = (np.empty((*shape, size)) for size in (columns.size, 3 * m, n))
        before = reference.copy()
        near = np.zeros((len(places), 0, before.size)) if angles is None else angles
        for k, place in enumerate(places.tolist()):
            self._parameters.write(place)
            found = blocks[k], rows[k], forces[k]
            evaluate_along(times[k], q[k], v[k], near[k], *found, memory.packed.argument)
        reference[:] = before
        self._model.put_numbers(memory.values, self._model.data)
        blocks = blocks.reshape(*shape, *columns.shape)
        phi, nu, gamma = rows[..., :m], rows[..., m : 2 * m], rows[..., 2 * m :]
        return Terms(self._model.structure, self._packs.mass[places], blocks, phi, nu, gamma, forces)

    def starts(self) -> list[Start | SceneError]:
        """Return the consistent start of each scene, or the error of a scene without one."""
        packs = self._packs
        scenes = Alike(
            model=self._model,
            poses=packs.start(),
            mass=packs.mass,
            length=packs.length,
            scenes=packs.scenes,
            bodies=packs.listed,
            terms=self._at_start,
            model_of=lambda place: Model(packs.scenes[place], packs, place),
        )
        return consistent_starts(scenes)

    def _at_start(self, places: np.ndarray, q: np.ndarray, v: np.ndarray) -> Terms:
        """Return the terms at t = 0 for one state of each scene, with blocks (c, m, 12)."""
        return self.terms(places, np.zeros((len(places), 1)), q[:, None], v[:, None])[:, 0]
