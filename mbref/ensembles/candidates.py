"""Candidates: scenes of equal structure that may be simulated in the memory of one run, and the numbers in
which they differ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from mbref.equations.active_coordinates import without_rounding
from mbref.equations.driver_conflicts import conflict_of_drivers
from mbref.equations.evaluation import evaluate_along
from mbref.equations.initial_state import Alike, Start, consistent_starts
from mbref.equations.model import Model, Terms
from mbref.equations.offsets import assembled
from mbref.equations.packing import Packs
from mbref.kernels.layout import Equations, Memory
from mbref.kernels.memory_pool import SavedNumbers, arrays_in, bytes_of
from mbref.kernels.scene_layout import SceneData
from mbref.scene import Scene, SceneError
from mbref.stepping.control import largest_violation
from mbref.stepping.ranks import Ranks, all_ranks
from mbref.stepping.run import NEARLY, Run


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


class Candidates(NamedTuple):
    """Scenes of equal structure, s in number, and their starts.

    Fields are coordinates (s, 7 nb) and velocities (s, 6 nb) at the start, consistent starts by scene index,
    their ranks, and the indices of the scenes whose rank, active rows and columns equal the run's.
    """

    packs: Packs
    q: np.ndarray
    v: np.ndarray
    starts: dict[int, Start]
    ranks: list[Ranks]
    fit: list[int]

    def parameters(self, run: Run, memory: Memory) -> list[tuple[Any, ...]]:
        """Return the arrays of a run's memory in which the scenes differ, each with the values of all
        scenes."""
        length, rounding = self.packs.length, run.method.settings(0.0).rounding
        return [
            *parameters_of(memory.equations, run.reduced(self.packs.data), self.packs),
            (memory.state.coordinates, self.q),
            (memory.state.velocities, self.v),
            (memory.control, largest_violation(run.limits, length), "violation"),
            (memory.equations.system.settings, rounding * np.minimum(1.0, length), "rounding"),
        ]


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
            scenes=packs.scenes,
            bodies=packs.listed,
            terms=self._at_start,
            model_of=lambda place: Model(packs.scenes[place], packs, place),
        )
        return consistent_starts(scenes)

    def _at_start(self, places: np.ndarray, q: np.ndarray, v: np.ndarray) -> Terms:
        """Return the terms at t = 0 for one state of each scene, with blocks (c, m, 12)."""
        return self.terms(places, np.zeros((len(places), 1)), q[:, None], v[:, None])[:, 0]


def candidates_of(run: Run, scenes: Sequence[Scene]) -> Candidates:
    """Return the candidates for a batch of a lead run. A scene may join the batch if its structure equals the
    structure of the run, its start is regular and its drivers do not contradict each other."""
    assert run.reduction is not None
    packs, decisions = Packs([*map(assembled, scenes)]), run.reduction.decisions
    evaluations = Evaluations(run.model, packs)
    starts, q, v = _starts(run, packs, evaluations)
    part, places, velocities = decisions.states(q, v)
    durations = np.array([scene.duration for scene in scenes])
    terms = evaluations.terms(np.arange(len(q)), durations[:, None] * part, places, velocities)
    agree = decisions.which_agree(run.model, q, v, terms)
    symbolic, tolerance = run.memory.factor.symbolic, run.limits.rank_tolerance
    ranks = all_ranks(run.model, terms.blocks[:, 0], packs.data.metric_root, symbolic, tolerance)
    alike = [rank.rank == run.ranks.rank and rank.least >= NEARLY for rank in ranks]
    end = float(run.times[-1])
    fit = [k for k in starts if agree[k] and alike[k] and conflict_of_drivers(packs.scenes[k], end) is None]
    return Candidates(packs, q, v, starts, ranks, fit)


def _starts(
    run: Run, packs: Packs, evaluations: Evaluations
) -> tuple[dict[int, Start], np.ndarray, np.ndarray]:
    """Return the consistent starts as ``Run`` computes them, by scene index, and coordinates (s, 7 nb) and
    velocities (s, 6 nb) of all scenes."""
    q, v = packs.start(), np.zeros_like(packs.mass)
    found = {k: start for k, start in enumerate(evaluations.starts()) if isinstance(start, Start)}
    if found:
        places, starts = [*found], found.values()
        at, rates, given = (np.array([getattr(s, name) for s in starts]) for name in ("q", "v", "given"))
        q[places], v[places] = without_rounding(at, rates, given, packs.length[places])
    return {k: replace(start, q=q[k], v=v[k]) for k, start in found.items()}, q, v
