"""Crossings: the singular positions that a run passed. Branches are computed at first access."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from mbref.crossing import Crossing
from mbref.equations.branches import Passed, singular_position
from mbref.equations.model import Model


class Crossings(Sequence[Crossing]):
    """Lazy sequence of the singular positions that a run crossed. Branches are computed on first access."""

    def __init__(self, model: Model, passed: Sequence[Passed]):
        self._model, self._passed = model, passed

    @functools.cached_property
    def _found(self) -> tuple[Crossing, ...]:
        found = tuple(_crossing(self._model, passed) for passed in self._passed)
        self._model.release()
        return found

    def __len__(self) -> int:
        return len(self._passed)

    def __getitem__(self, place: Any) -> Any:
        return self._found[place]

    def __iter__(self) -> Iterator[Crossing]:
        return iter(self._found)

    def __repr__(self) -> str:
        return repr(self._found)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle as a tuple, so that another process receives all branches."""
        return tuple, (list(self._found),)


def _crossing(model: Model, passed: Passed) -> Crossing:
    """Return a singular position in the scene's frames."""
    crossing = singular_position(model, passed)
    v = crossing.velocities.reshape(len(crossing.velocities), -1, 6)
    q = np.broadcast_to(crossing.coordinates.reshape(-1, 7), (len(v), v.shape[1], 7))
    motion = model.motion(q, v, np.zeros_like(v))
    return Crossing(
        crossing.time,
        motion["position"][0],
        motion["orientation"][0],
        motion["velocity"],
        motion["angular_velocity"],
        crossing.taken,
        crossing.sentence,
    )
