"""Numbers of a scene with respect to which a motion is differentiated.

The arrays that the equations read, and the start of a scene, are closed forms of its numbers. Their
derivatives are differences between variants of the scene: three variants where all arrays are affine in the
number, as in most, and differences of order 8 otherwise. The variants of all numbers are packed together.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from mbref.design.derivatives.paths_of_numbers import number_at
from mbref.design.derivatives.states import shortest_spring
from mbref.design.differences import Stencil, affine, central, one_sided
from mbref.equations.evaluated_together import Evaluations
from mbref.equations.initial_state import Start, consistent_start
from mbref.equations.model import Model, displacement
from mbref.equations.offsets import assembled
from mbref.equations.packing import Packs, row_of
from mbref.equations.parts import shape_of
from mbref.input_error import InputError
from mbref.kernels.scene_layout import FIRST_NUMBERS, FIRST_OF_LOADS, SceneData
from mbref.scene import Scene, SceneError

REDUCED = tuple(4.0**-k for k in range(6))  # factors on the step, the first ones preferred
# factors and stencils that are tried in turn; those to one side only where the others leave more than KINKED
CENTRAL_STENCILS = ((1.0, affine()), *((factor, central()) for factor in REDUCED))
ONE_SIDED_STENCILS = tuple((factor, one_sided(sign)) for factor in REDUCED for sign in (1.0, -1.0))
ACCURATE = 1e-12  # relative error of a derivative of the scene's arrays from which no smaller step is tried
# relative error above which central differences may meet a kink of the rows' scale, as where two factors of a
# coupling are equally large; its true error is ten times as large
KINKED = 1e-9
ROUGH = 1e-6  # relative error above which the arrays are not smooth in the number
CHANGED_ROUNDINGS = 100.0  # roundings of the largest value in an array, below which a value does not change
EPSILON = float(np.finfo(float).eps)


NUMBER_STEP = 0.02  # first step of differences between variants of a scene / size of the number
AccurateStencils = dict[str, tuple[float, Stencil]]  # factors and stencils, by path


class Variants(NamedTuple):
    """Scenes whose number at a path differs by a step times the offsets of a stencil. Among all scenes that
    are packed with them, the first one has the index ``first``."""

    scenes: tuple[Scene, ...]
    packs: Packs
    first: int
    stencil: Stencil
    step: float

    def model(self, place: int) -> Model:
        """Return the model of the scene with an index."""
        return Model(self.packs.scenes[self.first + place], self.packs, self.first + place)

    def derivative(self, function: Callable[[Scene, Model], np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivative by the number of a function of a variant's scene and model, and its
        difference from the one of lower order."""
        values = []
        for place, scene in enumerate(self.scenes):
            model = self.model(place)
            values.append(function(scene, model))
            model.release()
        changes = np.array(values) - values[0]
        found, lower = (
            np.tensordot(w, changes, 1) / self.step for w in (self.stencil.weights, self.stencil.lower)
        )
        return found, np.abs(found - lower)


def _variant_scenes(scene: Scene, label: str, step: float, stencil: Stencil) -> tuple[Scene, ...]:
    """Return the variants of a scene; raises SceneError if one is not valid, and InputError if their
    equations have another form."""
    value = number_at(scene, label)
    pairs = ((offset, scene.with_(label, value + step * offset)) for offset in stencil.offsets if offset)
    found = dict(pairs)
    scenes = tuple(found.get(offset, scene) for offset in stencil.offsets)
    if any(shape_of(each) != shape_of(scene) for each in scenes):
        raise InputError(f"{label}: the equations change their form with this number")
    return scenes


def _packed_variants(
    sets: Sequence[tuple[str, float, Stencil, tuple[Scene, ...]]], base: Model
) -> list[Variants]:
    """Return sets of variants, of labels with steps and stencils, packed together; raises InputError for a
    number that moves a switch."""
    scenes = [scene for *_, each in sets for scene in each]
    packs = Packs([assembled(scene) for scene in scenes])
    moved = (packs.data.functions.begin != base.data.functions.begin).any(axis=1)
    found, first = [], 0
    for label, step, stencil, each in sets:
        if moved[first : first + len(each)].any():
            raise InputError(
                f"{label}: the number moves the time at which a load is switched, or a row of a table"
            )
        found.append(Variants(each, packs, first, stencil, step))
        first += len(each)
    return found


def variants_of(scene: Scene, label: str, base: Model) -> Iterator[Variants]:
    """Yield variants for differences of order 8 that leave all scenes valid, with smaller and smaller steps,
    the central ones first; raises SceneError if there are none. ``base`` is as of ``scene_numbers``."""
    size = NUMBER_STEP * size_of_number(number_at(scene, label), label, base)
    stencils, faults = (*CENTRAL_STENCILS[1:], *ONE_SIDED_STENCILS), list[SceneError]()
    for factor, stencil in stencils:
        try:
            scenes = _variant_scenes(scene, label, factor * size, stencil)
        except SceneError as fault:
            faults.append(fault)
            continue
        yield _packed_variants([(label, factor * size, stencil, scenes)], base)[0]
    if len(faults) == len(stencils):
        raise faults[-1]


@dataclass(frozen=True)
class SceneNumber:
    """A number of a scene: variants of the scene, and their weights (k,) in derivatives.

    ``data`` and ``mass`` (n,) are the derivatives of the arrays that the equations read, and of M. ``x`` and
    ``v`` (n,) are the derivatives of the start: displacement (m, rad) and velocity (m/s, rad/s) by one unit
    of the number. ``error`` is relative.
    """

    label: str
    variants: Variants
    weights: np.ndarray
    data: SceneData
    mass: np.ndarray
    x: np.ndarray
    v: np.ndarray
    error: float


def scene_numbers(
    scene: Scene, labels: Sequence[str], base: Model, accurate: AccurateStencils | None = None
) -> list[SceneNumber]:
    """Return the numbers of a scene at paths such as ``body[rod].mass`` or ``joint[B].anchor.x``.

    ``base`` is the model of the assembled scene. The stencils of ``accurate`` are tried first, and those that
    are accurate are kept there. Raises SceneError if a path has no number, or if no value near it makes a
    valid scene; InputError if the arrays do not depend on a number smoothly.
    """
    if accurate is None:
        return base.once(_numbers_of_scene, scene, tuple(labels))
    return _searched(scene, labels, base, accurate)


def _numbers_of_scene(base: Model, scene: Scene, labels: Sequence[str]) -> list[SceneNumber]:
    return _searched(scene, labels, base, {})


def _searched(
    scene: Scene, labels: Sequence[str], base: Model, accurate: AccurateStencils
) -> list[SceneNumber]:
    """Return ``scene_numbers``; each round evaluates the next stencil of all that are not accurate."""
    searches = {label: _StencilSearch(label, accurate) for label in labels}
    sizes = {label: NUMBER_STEP * size_of_number(number_at(scene, label), label, base) for label in labels}
    while left := [search for search in searches.values() if not search.is_done]:
        sets = []
        for search in left:
            factor, stencil = search.candidate
            try:
                scenes = _variant_scenes(scene, search.label, factor * sizes[search.label], stencil)
            except SceneError as fault:
                search.note(fault)
                continue
            sets.append((search.label, factor * sizes[search.label], stencil, scenes))
        for label, found in zip((each[0] for each in sets), _differences(sets, base), strict=True):
            searches[label].note(found)
    return [search.found for search in searches.values()]


class _StencilSearch:
    """The search for a stencil that gives accurate derivatives by the number with a label."""

    def __init__(self, label: str, accurate: AccurateStencils):
        self.label, self._accurate = label, accurate
        before = (accurate[label],) if label in accurate else ()
        self._left = [*before, *CENTRAL_STENCILS, *ONE_SIDED_STENCILS]
        self._first_of_one_side = len(ONE_SIDED_STENCILS)
        self._found: list[SceneNumber] = []
        self._fault: SceneError | None = None
        self.is_done = False

    @property
    def candidate(self) -> tuple[float, Stencil]:
        """The factor on the step and the stencil to try next."""
        return self._left[0]

    @property
    def found(self) -> SceneNumber:
        """The most accurate number; raises SceneError or InputError if there is none."""
        best = min(self._found, key=lambda number: number.error, default=None)
        if best is None:
            assert self._fault is not None
            raise self._fault
        if best.error > ROUGH:
            raise InputError(f"{self.label}: the equations of the scene are not smooth in this number")
        return best

    def note(self, found: SceneNumber | SceneError) -> None:
        """Save the result of the candidate."""
        tried = self._left.pop(0)
        if isinstance(found, SceneError):
            self._fault = found
        else:
            self._found.append(found)
            if found.error <= ACCURATE:
                self._accurate[self.label] = tried
                self.is_done = True
        best = min((number.error for number in self._found), default=np.inf)
        if not self._left or (len(self._left) == self._first_of_one_side and best <= KINKED):
            self.is_done = True


def is_of_point(path: str) -> bool:
    """Return whether a path is of a coordinate of a point."""
    return bool(re.search(r"anchor|point|position", re.sub(r"\[[^\]]*\]", "", path)))


def size_of_number(value: float, path: str, base: Model) -> float:
    """Return the size of a number: its value or 1, and for points the length of the shortest spring or of the
    mechanism."""
    if not is_of_point(path):
        return abs(value) or 1.0
    start = base.start()[None]
    return base.length * float(shortest_spring(base, start)[0])


def _differences(
    sets: Sequence[tuple[str, float, Stencil, tuple[Scene, ...]]], base: Model
) -> list[SceneNumber | SceneError]:
    """Return the number of each set of variants, or the error of a variant without a start."""
    if not sets:
        return []
    every = _packed_variants(sets, base)
    packs, start = every[0].packs, consistent_start(base)
    starts = Evaluations(base, packs).starts()
    found: list[SceneNumber | SceneError] = []
    for (label, *_), variants in zip(sets, every, strict=True):
        own = slice(variants.first, variants.first + len(variants.scenes))
        found.append(_number_of_variants(label, variants, starts[own], start, base))
    return found


def _number_of_variants(
    label: str, variants: Variants, starts: Sequence[Start | SceneError], start: Start, base: Model
) -> SceneNumber | SceneError:
    """Return the number whose variants have these starts, or the error of a variant without one."""
    found: list[Start] = []
    for each in starts:
        if isinstance(each, SceneError):
            return each
        found.append(each)
        if each.follows_branch or start.follows_branch:
            raise InputError(
                f"{label}: the motion starts at a singular position, where derivatives do not exist"
            )
    x, v = np.array([(displacement(start.q, each.q), each.v) for each in found]).swapaxes(0, 1)
    stencil, step, packs = variants.stencil, variants.step, variants.packs
    own = slice(variants.first, variants.first + len(starts))
    arrays = v / base.units, *(each[own] for each in _arrays(packs))
    error = max(_stencil_error(values, stencil, step) for values in arrays)
    error = max(error, _stencil_error(x / base.units, stencil, step, size=1.0))
    weights = stencil.weights / step
    data = _weighted(row_of(packs.data, own), weights)
    return SceneNumber(
        label, variants, weights, data, weights @ packs.mass[own], weights @ x, weights @ v, error
    )


def _weighted(values: Any, weights: np.ndarray) -> Any:
    """Return the sums over scenes, with weights (s,) that add up to zero, of arrays (s, …) in a schema."""
    if isinstance(values, tuple):
        return type(values)(*(_weighted(each, weights) for each in values))
    differences = (values - values[:1]).reshape(len(values), -1)
    return (weights @ differences).reshape(values.shape[1:])


def _stencil_error(values: np.ndarray, stencil: Stencil, step: float, size: float = 0.0) -> float:
    """Return the relative error of the derivative of values (offsets, …) that change beyond rounding: the
    difference from the lower order, and one rounding. ``size`` is of numbers whose differences the values
    are, as displacements are of poses."""
    table = values.reshape(len(values), -1)
    changes = np.abs(table - table[0]).max(axis=0)
    table = table[:, changes > CHANGED_ROUNDINGS * EPSILON * np.abs(table).max(initial=size)]
    found, lower = (weights @ table / step for weights in (stencil.weights, stencil.lower))
    scale = np.abs(found).max(initial=0.0)
    rounded = EPSILON * np.abs(table).max(initial=0.0) / step
    if scale <= CHANGED_ROUNDINGS * rounded:
        return 0.0
    return float((np.abs(found - lower).max() + rounded) / scale)


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
