"""Parameters: the numbers in which scenes of equal structure differ, written to one memory scene by scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mbref.equations.packing import Packs
from mbref.kernels.layout import Equations
from mbref.kernels.memory_pool import SavedNumbers, arrays_in
from mbref.kernels.scene_layout import SceneData


class Parameters:
    """Arrays of memory, each with the values (s, …) of s scenes.

    ``values`` are (array, values), or (record, values, name of a number in it).  ``saved`` numbers are
    restored before the values of a scene are written.
    """

    def __init__(self, values: Sequence[tuple[Any, ...]], saved: SavedNumbers | None = None):
        self._values = [(target, of_all, *(name or (...,))) for target, of_all, *name in values]
        self._saved = saved

    def write(self, place: int) -> None:
        """Write the numbers of the scene with the given index."""
        if self._saved is not None:
            self._saved.restore()
        for target, of_all, where in self._values:
            target[where] = of_all[place]


def parameters_of(equations: Equations, data: SceneData, packs: Packs) -> list[tuple[Any, ...]]:
    """Return the arrays of an equation's memory in which the scenes differ from the lead scene, each with the
    values of all scenes. No kernel changes these arrays."""
    system = equations.system
    masses = (system.mass, packs.mass), (system.inverse_root, packs.inverse_root)
    pairs = [*zip(arrays_in(equations.scene), arrays_in(data), strict=True), *masses]
    return [(array, of_all) for array, of_all in pairs if (array != of_all).any()]
