"""Derivatives of a scene's arrays by several numbers, as kernels read them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mbref.design.derivatives.numbers_of_scene import SceneNumber
from mbref.equations.model import Model
from mbref.equations.variation_layout import (
    FunctionChanges,
    LoadChanges,
    PrimitiveChanges,
    SceneChanges,
    TurningChanges,
)

WITH_OWN_ROWS = ("higher", "polynomial")  # arrays of which each primitive or function has a row
PARTS_OF_CHANGES: dict[str, Any] = {
    "primitives": PrimitiveChanges,
    "turning": TurningChanges,
    "functions": FunctionChanges,
    "loads": LoadChanges,
}


def scene_changes(numbers: Sequence[SceneNumber], model: Model) -> SceneChanges:
    """Return the derivatives of a scene's arrays by numbers."""

    def stacked(name: str, rows: Sequence[Any], like: Any) -> np.ndarray:
        own = getattr(like, name)
        shape = (len(rows) * len(own), own.shape[1]) if name in WITH_OWN_ROWS else (len(rows), own.size)
        return np.array([getattr(row, name) for row in rows], dtype=float).reshape(shape)

    data = [number.data for number in numbers]
    parts: dict[str, Any] = {}
    for part, schema in PARTS_OF_CHANGES.items():
        rows, like = [getattr(each, part) for each in data], getattr(model.data, part)
        parts[part] = schema(*(stacked(name, rows, like) for name in schema._fields))
    bodies = [each.bodies for each in data]
    moves = [any(part.any() for part in (*each.primitives, *each.functions)) for each in data]
    return SceneChanges(
        gravity=stacked("gravity", data, model.data),
        mass=stacked("mass", bodies, model.data.bodies),
        inertia=stacked("inertia", bodies, model.data.bodies),
        diagonal=np.array([number.mass for number in numbers]).reshape(len(numbers), model.n),
        moves=np.array(moves, dtype=np.int64),
        **parts,
    )
