"""Numbers of a scene with respect to which a motion is differentiated.

The terms and the start of a scene are closed forms of its numbers. Their derivatives are differences between
variants of the scene, whose equations are evaluated at equal states: two variants where all terms are affine
in the number, as in most, and differences of order 8 otherwise.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from mbref.design.derivatives.states import States, arrays_of_terms, shortest_spring, sum_of_differences
from mbref.design.differences import Stencil, affine, central, one_sided
from mbref.equations.evaluated_together import Evaluations
from mbref.equations.initial_state import Start, consistent_start
from mbref.equations.model import Model, Terms, displacement
from mbref.equations.offsets import assembled
from mbref.equations.packing import Packs
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
# factors and stencils that are tried in turn; those to one side only where the others leave more than KINKED
CENTRAL_STENCILS = ((1.0, affine()), *((factor, central()) for factor in REDUCED))
ONE_SIDED_STENCILS = tuple((factor, one_sided(sign)) for factor in REDUCED for sign in (1.0, -1.0))
ACCURATE = 1e-12  # relative error of a derivative of the scene's arrays from which no smaller step is tried
# relative error above which central differences may meet a kink of the rows' scale, as where two factors of a
# coupling are equally large; its true error is ten times as large
KINKED = 1e-9
ROUGH = 1e-6  # relative error above which the arrays are not smooth in the number
# displacement of a state in general position that undoes alignments, lengths of the shortest spring or rad
GENERAL = 0.02
CHANGED_ROUNDINGS = 100.0  # roundings of the largest value in an array, below which a value does not change
TERMS_ROUNDING = 50.0  # roundings of the largest term that the many operations of a term may leave
EPSILON = float(np.finfo(float).eps)


AccurateStencils = dict[str, tuple[float, Stencil]]  # factors and stencils, by path


class Variants(NamedTuple):
    """Scenes whose number at a path differs by a step times the offsets of a stencil, packed."""

    scenes: tuple[Scene, ...]
    packs: Packs
    stencil: Stencil
    step: float

    @staticmethod
    def of(scene: Scene, label: str, step: float, stencil: Stencil, base: Model) -> Variants:
        """Return the variants of a scene; raises SceneError if one is not valid, and InputError if they
        differ in more than numbers."""
        value = number_at(scene, label)
        scenes = tuple(scene.with_(label, value + step * offset) for offset in stencil.offsets)
        if any(shape_of(each) != shape_of(scene) for each in scenes):
            raise InputError(f"{label}: the equations change their form with this number")
        packs = Packs([*map(assembled, scenes)])
        if (packs.data.functions.begin != base.data.functions.begin).any():
            raise InputError(
                f"{label}: the number moves the time at which a load is switched, or a row of a table"
            )
        return Variants(scenes, packs, stencil, step)

    def model(self, place: int) -> Model:
        """Return the model of the scene with an index."""
        return Model(self.packs.scenes[place], self.packs, place)


def variants_of(scene: Scene, label: str, base: Model, step: float) -> Variants:
    """Return variants for differences of order 8, with the largest step up to one that leaves all scenes
    valid; central if possible. ``base`` and ``step`` are as of ``scene_number``."""
    size = step * size_of_number(number_at(scene, label), label, base)
    faults: list[SceneError] = []
    for factor, stencil in (*CENTRAL_STENCILS[1:], *ONE_SIDED_STENCILS):
        try:
            return Variants.of(scene, label, factor * size, stencil, base)
        except SceneError as fault:
            faults.append(fault)
    raise faults[-1]


@dataclass(frozen=True)
class SceneNumber:
    """A number of a scene: variants of the scene, and their weights (k,) in derivatives.

    ``terms`` evaluates the variants. ``x`` and ``v`` (n,) are the derivatives of the start: displacement
    (m, rad) and velocity (m/s, rad/s) by one unit of the number. ``error`` is relative.
    """

    label: str
    variants: Variants
    terms: Callable[..., Terms]
    weights: np.ndarray
    x: np.ndarray
    v: np.ndarray
    error: float

    def derivative(self, function: Callable[[Scene, Model], np.ndarray]) -> np.ndarray:
        """Return the derivative by the number of a function of a variant's scene and model."""
        total = 0.0
        for k in np.flatnonzero(self.weights).tolist():
            model = self.variants.model(k)
            total = total + self.weights[k] * function(self.variants.scenes[k], model)
            model.release()
        return np.asarray(total)

    def changed_terms(self, states: States) -> tuple[list[np.ndarray], np.ndarray]:
        """Return the derivatives of ``arrays_of_terms`` at states, and of M (n,)."""
        first, *others = np.flatnonzero(self.weights).tolist()
        base = _terms_at(self.terms, [first], states)[0]  # the weights add up to zero
        pairs = ((self.weights[k], _terms_at(self.terms, [k], states)[0], base) for k in others)
        return sum_of_differences(pairs), self.weights @ self.variants.packs.mass


def _terms_at(terms: Callable[..., Terms], places: Sequence[int], states: States) -> Terms:
    """Return the terms of scenes with indices (c,) at states."""
    each = states.times, states.q, states.v, states.angles
    many = (np.repeat(values[None], len(places), axis=0) for values in each)
    return terms(np.asarray(places), *many)


def scene_number(
    scene: Scene, label: str, base: Model, step: float, accurate: AccurateStencils | None = None
) -> SceneNumber:
    """Return the number of a scene at a path such as ``body[rod].mass`` or ``joint[B].anchor.x``.

    ``base`` is the model of the assembled scene, ``step`` the increment over the number's size. The stencil
    of ``accurate`` is tried first, and the one that is accurate is kept there. Raises
    SceneError if the path has no number, or if no value near it makes a valid scene; InputError if the
    equations do not depend on it smoothly.
    """
    size = step * size_of_number(number_at(scene, label), label, base)
    found: list[SceneNumber] = []
    faults: list[SceneError] = []
    accurate = {} if accurate is None else accurate
    before = (accurate[label],) if label in accurate else ()
    for stencils, enough in ((before, 0.0), (CENTRAL_STENCILS, KINKED), (ONE_SIDED_STENCILS, ROUGH)):
        for factor, stencil in stencils:
            try:
                found.append(_differences(scene, label, factor * size, stencil, base))
            except SceneError as fault:
                faults.append(fault)
                continue
            if found[-1].error <= ACCURATE:
                accurate[label] = factor, stencil
                return found[-1]
        best = min(found, key=lambda number: number.error, default=None)
        if best is not None and best.error <= enough:
            return best
    if not found:
        raise faults[-1]
    raise InputError(f"{label}: the equations of the scene are not smooth in this number")


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
    replaced_at({field: getattr(scene, field) for field in Scene.model_fields}, path, found.append)
    return found[0]


def size_of_number(value: float, path: str, base: Model) -> float:
    """Return the size of a number: its value or 1, and for points the length of the shortest spring or of the
    mechanism."""
    if not re.search(r"anchor|point|position", re.sub(r"\[[^\]]*\]", "", path)):
        return abs(value) or 1.0
    start = base.start()[None]
    return base.length * float(shortest_spring(base, start)[0])


def _differences(scene: Scene, label: str, step: float, stencil: Stencil, base: Model) -> SceneNumber:
    """Return the number with variants at a step times the offsets of a stencil."""
    variants = Variants.of(scene, label, step, stencil, base)
    evaluations, start = Evaluations(base, variants.packs), consistent_start(base)
    starts: list[Start] = []
    for found in evaluations.starts():
        if isinstance(found, SceneError):
            raise found
        starts.append(found)
    if any(each.follows_branch for each in (start, *starts)):
        raise InputError(f"{label}: the motion starts at a singular position, where derivatives do not exist")
    x = np.array([displacement(start.q, each.q) for each in starts])
    v = np.array([each.v for each in starts])
    arrays = x / base.units, v / base.units, *_arrays(variants.packs)
    terms = _terms_at(evaluations.terms, range(len(starts)), _general_state(base))
    errors = [_stencil_error(values, stencil, step) for values in arrays]
    errors += [_stencil_error(values, stencil, step, TERMS_ROUNDING) for values in arrays_of_terms(terms)]
    weights = stencil.weights / step
    return SceneNumber(label, variants, evaluations.terms, weights, weights @ x, weights @ v, max(errors))


def _stencil_error(values: np.ndarray, stencil: Stencil, step: float, allowed: float = 0.0) -> float:
    """Return the relative error of the derivative of values (offsets, …) that change beyond rounding: the
    difference from the lower order beyond ``allowed`` roundings, and one rounding without any."""
    table = values.reshape(len(values), -1)
    changes = np.abs(table - table[0]).max(axis=0)
    table = table[:, changes > CHANGED_ROUNDINGS * EPSILON * np.abs(table).max(initial=0.0)]
    found, lower = (weights @ table / step for weights in (stencil.weights, stencil.lower))
    scale = np.abs(found).max(initial=0.0)
    rounded = EPSILON * np.abs(table).max(initial=0.0) / step
    if scale <= CHANGED_ROUNDINGS * rounded:
        return 0.0
    off = np.abs(found - lower).max()
    return float((max(0.0, off - allowed * rounded) if allowed else off + rounded) / scale)


def _general_state(model: Model) -> States:
    """Return one state near the start in general position, at the end of the scene's duration: a term that
    is affine in a number there is affine at every state."""
    random = np.random.default_rng(0)
    q, n = model.start()[None], model.n
    x = GENERAL * float(shortest_spring(model, q)[0]) * random.normal(size=n) * model.units
    none = np.zeros((1, model.m))
    angles = np.zeros((1, len(model.structure.places.turning)))
    still = States(
        np.array([model.scene.duration]), q, model.units * random.normal(size=(1, n)), angles, none, none
    )
    return still._replace(q=still.displaced(x[None]))


def _arrays(packs: Packs) -> Iterator[np.ndarray]:
    """Yield the arrays (scenes, …) that the equations read."""
    data = packs.data
    yield from (
        data.gravity,
        *data.bodies,
        *data.primitives[FIRST_NUMBERS:],
        *data.turning[2:],
        *data.functions[1:],
    )
    yield from data.loads[FIRST_OF_LOADS:]
