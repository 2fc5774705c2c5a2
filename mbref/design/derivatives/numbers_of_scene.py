"""Numbers of a scene with respect to which a motion is differentiated.

The arrays and the start of a scene are closed forms of its numbers. Their derivatives are differences of
order 8 between variants of the scene, whose equations are evaluated at equal states.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbref.design.derivatives.states import shortest_spring
from mbref.design.differences import Stencil, central, one_sided
from mbref.equations.initial_state import consistent_start
from mbref.equations.model import Model, displacement
from mbref.equations.offsets import assembled
from mbref.equations.parts import shape_of
from mbref.input_error import InputError
from mbref.kernels.scene_layout import FIRST_NUMBERS, FIRST_OF_LOADS
from mbref.scene import Scene, SceneError
from mbref.scene.paths import replaced_at

UNITS = {  # by field
    **dict.fromkeys(("mass",), "kg"),
    **dict.fromkeys(("inertia",), "kg m²"),
    **dict.fromkeys(("anchor", "anchors", "position", "point", "points"), "m"),
    **dict.fromkeys(("natural_length", "natural_displacement", "displacement(0)"), "m"),
    **dict.fromkeys(("velocity", "displacement_rate(0)"), "m/s"),
    **dict.fromkeys(("angular_velocity", "rate(0)", "frequency"), "rad/s"),
    **dict.fromkeys(("natural_angle", "phase", "angle(0)"), "rad"),
    **dict.fromkeys(("moment", "torque"), "N m"),
    "force": "N",
    "gravity": "m/s²",
}
UNITS_OF_TURNS = {"stiffness": "N m/rad", "damping": "N m s/rad", "armature": "kg m²"}
UNITS_OF_SLIDES = {"stiffness": "N/m", "damping": "N s/m", "armature": "kg"}
REDUCED = tuple(4.0**-k for k in range(6))  # factors on the step, the first ones preferred
ACCURATE = 1e-12  # relative error of a derivative of the scene's arrays from which no smaller step is tried
ROUGH = 1e-6  # relative error above which the arrays are not smooth in the number
EPSILON = float(np.finfo(float).eps)


@dataclass(frozen=True)
class SceneNumber:
    """A number of a scene: variants of the scene as models, and their weights (k,) in derivatives.

    ``x`` and ``v`` (n,) are the derivatives of the start: displacement (m, rad) and velocity (m/s, rad/s) by
    one unit of the number. ``error`` is relative.
    """

    label: str
    scenes: tuple[Scene, ...]
    models: tuple[Model, ...]
    weights: np.ndarray
    x: np.ndarray
    v: np.ndarray
    error: float

    def derivative(self, function: Callable[[Scene, Model], np.ndarray]) -> np.ndarray:
        """Return the derivative by the number of a function of a variant's scene and model."""
        terms = zip(self.weights, self.scenes, self.models, strict=True)
        parts = (weight * function(scene, model) for weight, scene, model in terms)
        return np.asarray(sum(parts))


def scene_number(scene: Scene, label: str, base: Model, step: float) -> SceneNumber:
    """Return the number of a scene at a path such as ``body[rod].mass`` or ``joint[B].anchor.x``.

    ``base`` is the model of the assembled scene, ``step`` the increment over the number's size. Raises
    SceneError if the path has no number, or if no value near it makes a valid scene; InputError if the
    equations do not depend on it smoothly.
    """
    found: list[SceneNumber] = []
    faults: list[SceneError] = []
    size = _size(number_at(scene, label), label, base)
    for share, stencil in itertools.product(REDUCED, (central(), one_sided(1.0), one_sided(-1.0))):
        try:
            found.append(_differences(scene, label, share * step * size, stencil, base))
        except SceneError as fault:
            faults.append(fault)
        if found and found[-1].error <= ACCURATE:
            break
    if not found:
        raise faults[-1]
    best = min(found, key=lambda number: number.error)
    if not best.error <= ROUGH:
        raise InputError(f"{label}: the equations of the scene are not smooth in this number")
    return best


def unit_of_number(scene: Scene, label: str) -> str:
    """Return the SI unit of a number; empty for ratios, and for coefficients of functions of time. Raises
    SceneError for a path without a field."""
    fields = re.findall(r"(?:^|\.)([a-z_]+(?:\(0\))?)", re.sub(r"\.[xyz]$", "", label))
    if not fields:
        raise SceneError([f"{label}: the scene has no number at this path"])
    field = fields[-1]
    if field not in UNITS_OF_TURNS:
        return UNITS.get(field, "")
    number_at(scene, label)
    slides = _at(scene, label.rpartition(".")[0]).type in ("spring", "slide_spring", "translational")
    return (UNITS_OF_SLIDES if slides else UNITS_OF_TURNS)[field]


def number_at(scene: Scene, path: str) -> float:
    """Return the number at a path; raises SceneError if there is none."""
    value = _at(scene, path)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise SceneError([f"{path}: the scene has no number at this path"])
    return float(value)


def is_same_number(scene: Scene, path: str, other: str) -> bool:
    """Return whether two paths lead to one number of a scene; raises SceneError if one does not exist."""
    mark = object()
    found: list[Any] = []
    fields = {field: getattr(scene, field) for field in Scene.model_fields}
    replaced_at(replaced_at(fields, path, lambda _: mark), other, found.append)
    return found[0] is mark


def _at(scene: Scene, path: str) -> Any:
    """Return the entry or value of a scene at a path; raises SceneError if there is none."""
    found: list[Any] = []

    def keep(value: Any) -> Any:
        found.append(value)
        return value

    replaced_at({field: getattr(scene, field) for field in Scene.model_fields}, path, keep)
    return found[0]


def _size(value: float, path: str, base: Model) -> float:
    """Return the size of a number: its value or 1, and for points the length of the shortest spring or of the
    mechanism."""
    if not re.search(r"anchor|point|position", path):
        return abs(value) or 1.0
    start = base.start()[None]
    return base.length * float(shortest_spring(base, start)[0])


def _differences(scene: Scene, label: str, step: float, stencil: Stencil, base: Model) -> SceneNumber:
    """Return the number with variants at a step times the offsets of a stencil."""
    value = number_at(scene, label)
    scenes = tuple(scene.with_(label, value + step * offset) for offset in stencil.offsets)
    if any(shape_of(each) != shape_of(scene) for each in scenes):
        raise InputError(f"{label}: the equations change their form with this number")
    models = tuple(Model(assembled(each)) for each in scenes)
    if any((model.data.functions.begin != base.data.functions.begin).any() for model in models):
        raise InputError(
            f"{label}: the number moves the time at which a load is switched, or a row of a table"
        )
    start = consistent_start(base)
    starts = [consistent_start(model) for model in models]
    x = np.array([displacement(start.q, each.q) for each in starts])
    v = np.array([each.v for each in starts])
    if any(each.follows_branch for each in (start, *starts)):
        raise InputError(f"{label}: the motion starts at a singular position, where derivatives do not exist")
    error = 0.0
    for values in (x / base.units, v / base.units, *zip(*map(_arrays, models), strict=True)):
        table = np.array(values).reshape(len(models), -1)
        found, lower = (weights @ table / step for weights in (stencil.weights, stencil.lower))
        scale = np.abs(found).max(initial=0.0)
        rounded = EPSILON * np.abs(table).max(initial=0.0) / step
        if scale > 100 * rounded:
            error = max(error, float((np.abs(found - lower).max() + rounded) / scale))
    weights = stencil.weights / step
    return SceneNumber(label, scenes, models, weights, weights @ x, weights @ v, error)


def _arrays(model: Model) -> Iterator[np.ndarray]:
    """Yield the arrays of a model that its equations read."""
    data = model.data
    yield from (
        data.gravity,
        *data.bodies,
        *data.primitives[FIRST_NUMBERS:],
        *data.turning[2:],
        *data.functions[1:],
    )
    yield from data.loads[FIRST_OF_LOADS:]
