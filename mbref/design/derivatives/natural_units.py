"""Natural units of a scene's outputs: of its length, its mass and its duration."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mbref.equations.model import Model
from mbref.equations.offsets import assembled
from mbref.motions.outputs import UNIT_OF, quantity_of
from mbref.scene import Scene


def natural_units(scene: Scene, columns: Sequence[str]) -> np.ndarray:
    """Return the units (c,) of columns, in SI units: of lengths the mechanism's length, of times the scene's
    duration, of angles 1 rad, of masses the sum of all."""
    length, time = Model(assembled(scene)).length, scene.duration
    mass = sum(body.mass or 0.0 for body in scene.body)
    force = mass * length / time**2
    units = {"m": length, "s": time, "s²": time**2, "rad": 1.0, "N": force, "J": force * length}
    units["W"] = units["J"] / time

    def product(text: str) -> float:
        return float(np.prod([units[unit] for unit in text.split()]))

    parts = [UNIT_OF[quantity_of(name)].partition("/") for name in columns]
    found = np.array([product(over) / product(under) for over, _, under in parts])
    return np.where(found > 0.0, found, 1.0)
