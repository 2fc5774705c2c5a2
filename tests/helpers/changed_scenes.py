"""A mechanism in other units, in another frame, or in another order: its motion follows."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from crosscheck.conformance.changes import relations
from mbref import rotations
from mbref.scene import Scene

Change = Callable[[np.ndarray], np.ndarray]
POINTS = ("position", "anchor", "anchors", "point", "points")
VECTORS = ("velocity", "angular_velocity", "axis", "axes", "force", "moment", "gravity")


def changed(entry: Mapping[str, Any], changes: Mapping[str, Change]) -> dict[str, Any]:
    """Return an entry of a scene with functions applied to its fields, where it has them."""
    return {
        name: changes[name](np.array(value)).tolist() if name in changes and value is not None else value
        for name, value in entry.items()
    }


def in_other_units(scene: Scene, mass: float, length: float, time: float) -> Scene:
    """Return the scene with each number as if units were smaller by the factors of mass, length and time."""
    return relations.in_other_units(relations.scaled(scene, mass), length, time)


def in_another_frame(scene: Scene, turn: np.ndarray, shift: np.ndarray) -> Scene:
    """Return the scene turned by a unit quaternion (4,) and then shifted by a vector (3,), m."""

    def vector(value: np.ndarray) -> np.ndarray:
        return rotations.rotate(turn, value) if value.ndim else value  # the force along a joint is a number

    changes: dict[str, Change] = dict.fromkeys(VECTORS, vector)
    changes |= dict.fromkeys(POINTS, lambda value: vector(value) + shift)
    changes["orientation"] = lambda value: rotations.multiply(turn, value)
    dump = changed(scene.model_dump(), changes)
    for kind in ("body", "joint", "load"):
        dump[kind] = [changed(entry, changes) for entry in dump[kind]]
    return Scene.model_validate(dump)


def in_another_order(scene: Scene) -> Scene:
    """Return the scene with bodies, joints, loads, drivers and couplings in reverse order."""
    kinds = ("body", "joint", "load", "driver", "coupling")
    return scene.with_(**{kind: getattr(scene, kind)[::-1] for kind in kinds})


def bumped(array: np.ndarray, sample: int, body: int, by: np.ndarray) -> np.ndarray:
    """Return an array (k, nb, n) of a motion with the row of a body at a sample changed by a vector."""
    found = array.copy()
    found[sample, body] += by
    return found
