"""Evaluation of the equations of several scenes of equal structure, one after another in one model's
memory."""

from __future__ import annotations

import numpy as np

from mbref.ensembles.parameters import Parameters, parameters_of
from mbref.equations.evaluation import evaluate_along
from mbref.equations.initial_state import Alike, Start, consistent_starts
from mbref.equations.model import Model, Terms
from mbref.equations.packing import Packs
from mbref.scene import SceneError


class Evaluations:
    """Terms of the equations of s scenes whose structure equals the structure of a model. After an evaluation
    the model contains the numbers of its own scene again."""

    def __init__(self, model: Model, packs: Packs):
        self._model, self._packs = model, packs
        self._parameters = Parameters(parameters_of(model.memory.values, packs.data, packs))

    def terms(self, places: np.ndarray, times: np.ndarray, q: np.ndarray, v: np.ndarray) -> Terms:
        """Return the terms of c scenes, given by index, at k states each; blocks have the shape (c, k, m,
        12): m rows, columns of two bodies.

        Arguments are times (c, k), coordinates (c, k, 7 nb) and velocities (c, k, 6 nb).
        """
        m, n, memory, shape = self._model.m, self._model.n, self._model.memory, times.shape
        columns = self._model.entry_columns
        blocks, rows, forces = (np.empty((*shape, size)) for size in (columns.size, 3 * m, n))
        for k, place in enumerate(places.tolist()):
            self._parameters.write(place)
            evaluate_along(times[k], q[k], v[k], blocks[k], rows[k], forces[k], memory.packed.argument)
        self._model.put_numbers(memory.values, self._model.data)
        blocks = blocks.reshape(*shape, *columns.shape)
        phi, nu, gamma = np.split(rows, 3, axis=-1)
        return Terms(self._model.structure, self._packs.mass[places], blocks, phi, nu, gamma, forces)

    def starts(self) -> list[Start | SceneError]:
        """Return the consistent start of each scene, or the error of a scene without one."""
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
        """Return the terms at t = 0 for one state of each scene, with blocks (c, m, 12)."""
        return self.terms(places, np.zeros((len(places), 1)), q[:, None], v[:, None])[:, 0]
