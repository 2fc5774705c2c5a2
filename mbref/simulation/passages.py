"""Passages of scenes that follow a run: the series of one, which take the numbers of each."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from mbref.equations.branches import Passed
from mbref.equations.model import Model
from mbref.kernels.copying import Bytes
from mbref.kernels.named_memory import Packed
from mbref.simulation.crossings import Crossings
from mbref.simulation.evaluations import Rows
from mbref.simulation.group import Group
from mbref.simulation.run import Run
from mbref.taylor.passing_run import PassingRun
from mbref.taylor.series_run import put_equations, shapes_of_equations
from mbref.taylor.start import OFF
from mbref.trajectory import Crossing


class Passages:
    """Brief passages of the scenes of a group; the series is made at the first."""

    def __init__(self, run: Run, group: Group):
        self._run, self._group = run, group
        self._models: dict[int, Model] = {}
        self._passed: dict[int, list[Passed]] = {}

    @cached_property
    def _series(self) -> PassingRun:
        return PassingRun(self._run)

    @cached_property
    def _room(self) -> Any:
        """The shapes of the equations that the memory of the series takes."""
        return shapes_of_equations(self._series.geometry, self._series.polynomials)

    @cached_property
    def _begins(self) -> Rows:
        """The memory of the series as it begins, with the numbers of each scene."""
        memory: Any = self._series.taylor
        farthest = OFF * np.maximum(1.0, self._group.packs.length)
        numbers = [*self._group.numbers(self._series, memory.run), (memory.progress, farthest, "farthest")]
        return Rows(numbers, Bytes(memory))

    def series_of(self, place: int) -> Packed | None:
        """The series with the numbers of the scene at a place; None where its equations have no room."""
        series, model = self._series, self._group.model(place)
        self._begins.copy(place)
        series.enter_state()
        equations = series.equations_of(model, self._group.starts[place])
        if self._room != shapes_of_equations(*equations):
            return None
        put_equations(series.taylor, *equations)
        self._models[place] = model
        return series.packed_series

    def record(self, place: int) -> None:
        """Keep the singular positions that the scene at a place has passed."""
        self._passed[place] = self._series.recorded()

    def crossings(self, place: int) -> Sequence[Crossing]:
        """The singular positions that the scene at a place has passed."""
        passed = self._passed.get(place)
        return Crossings(self._models[place], passed) if passed else ()

    def give_back(self) -> None:
        """Leave the memory of the series, if it was made, to the next run."""
        if "_series" in self.__dict__:
            self._series.give_back()
