"""The equations of a scene in natural coordinates as the arrays that the kernels of the series read."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np

from mbref.equations.model import Model
from mbref.kernels.scene_layout import SceneData
from mbref.taylor.expressions import ONE, cleaned
from mbref.taylor.forms import Forms
from mbref.taylor.load_polynomials import (
    constant_forces,
    coupled_coordinates,
    is_constant,
    slides_of,
    springs_of,
    timed_forces,
    torsions_of,
)
from mbref.taylor.loads import VALUE
from mbref.taylor.natural import NaturalCoordinates
from mbref.taylor.numbers import array_of
from mbref.taylor.polynomial_layout import Given, Inertia, Polynomials, Poses, Products, RowPolynomials
from mbref.taylor.simd import WIDTH, padded_size


class Geometry:
    """The equations of a scene in natural coordinates, without masses and loads.

    ``pose_maps`` evaluate the variables, ``tableau`` has ``linear`` and ``place`` of a ``layout.Solver``.
    """

    def __init__(self, of: NaturalCoordinates):
        self.natural, self.pose_maps, self._forms = of, of.direction_vectors.pose_maps(of.kept), Forms(of)
        multipliers = len(of.kept)
        lane = {v: i for i, v in enumerate(of.kept)}
        lane |= {v: multipliers + len(of.rows) + g for g, v in enumerate(of.given)}
        self._lanes = padded_size(max(1, len(lane) + len(of.rows)))
        self._rows, self._products = _rows(of, lane, self._lanes), _products(of, lane, self._lanes)
        self._poses, self._given = _poses(of, self._forms), _given(of)
        self.tableau = _tableau(self._rows, len(of.kept), len(of.rows), self._lanes)
        self._coupled = coupled_coordinates(self._forms)
        self._no_loads: dict[str, Any] | None = None  # tables of scenes whose loads are all constant

    def polynomials(self, model: Model) -> Polynomials:
        """Return the polynomials of a scene of this geometry."""
        return Polynomials(
            rows=self._rows,
            products=self._products,
            inertia=_inertia(model, self._forms, self._lanes),
            poses=self._poses,
            given=self._given,
            **self._loads(model.data),
        )

    def _loads(self, data: SceneData) -> dict[str, Any]:
        """Return the tables of loads that are not constant; tables without such loads are made once."""
        loads = data.loads
        are_constant = bool((is_constant(loads)).all())
        if are_constant and self._no_loads:
            return self._no_loads
        found = {
            "springs": springs_of(loads, self._forms),
            "torsions": torsions_of(data, self._forms, self._coupled.angles),
            "slides": slides_of(data, self._forms, self._coupled.displacements),
            "timed": timed_forces(loads, self._forms),
        }
        self._no_loads = found if are_constant else self._no_loads
        return found


def _rows(of: NaturalCoordinates, lane: dict[int, int], lanes: int) -> RowPolynomials:
    constant: np.ndarray = np.full(lanes, 0.0, of.numbers.number_type)
    linear: list[tuple[float, ...]] = []
    twofold: list[tuple[float, ...]] = []
    for r, row in enumerate(of.rows):
        for (i, j), coefficient in row.items():
            if j == ONE:
                constant[len(of.kept) + r] = coefficient
            elif i == ONE:
                linear.append((r, lane[j], coefficient))
            else:
                twofold += [(r, lane[i], lane[j], coefficient), (r, lane[j], lane[i], coefficient)]
    columns = [*_columns(twofold, 3), *_columns(linear, 2), constant]
    return RowPolynomials(*columns)


def _tableau(rows: RowPolynomials, nz: int, nr: int, lanes: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the constant part of the tableau (nr + 1, lanes) of the rows, and the places of products in the
    tableau."""
    linear = np.full((nr + 1, lanes), 0.0, rows.constant.dtype)
    of_variables = rows.linear_lane < nz
    places = rows.linear_row[of_variables], rows.linear_lane[of_variables]
    np.add.at(linear, places, rows.linear_weight[of_variables])
    linear[np.arange(nr), nz + np.arange(nr)] = 1.0
    return linear, np.where(rows.lane < nz, rows.row * lanes + rows.lane, nr * lanes)


def _columns(entries: Sequence[tuple[float, ...]], indices: int) -> list[np.ndarray]:
    """Return columns of a table: columns of indices first, then a column of numbers."""
    columns = list(zip(*entries, strict=True)) if entries else [()] * (indices + 1)
    return [*(np.array(column, np.int64) for column in columns[:-1]), array_of(columns[-1])]


def _products(of: NaturalCoordinates, lane: dict[int, int], lanes: int) -> Products:
    """Return the products: of two variables in rows, of a multiplier and a variable in forces."""
    nz = len(of.kept)
    terms: list[list[tuple[float, ...]]] = [[] for _ in range(lanes)]
    for r, row in enumerate(of.rows):
        for (i, j), coefficient in row.items():
            if i != ONE:
                one, other, twice = lane[i], lane[j], 2.0 if i == j else 1.0
                terms[nz + r].append((one, other, coefficient))
                if of.driven:
                    continue
                for target, factor in dict.fromkeys([(one, other), (other, one)]):
                    if target < nz:
                        terms[target].append((nz + r, factor, twice * coefficient))
    return products_of_lanes(terms)


def products_of_lanes(terms: Sequence[Sequence[tuple[Any, ...]]]) -> Products:
    """Return products by the factors and weights of each lane, with padded slots."""
    slots, start = _slots(terms, (0, 0, 0.0))
    left, right, weight = _columns(slots, 2)
    return Products(left, right, weight, start)


def _slots(
    terms: Sequence[Sequence[tuple[Any, ...]]], nothing: tuple[Any, ...]
) -> tuple[list[tuple[Any, ...]], np.ndarray]:
    """Return the terms of each lane in vectors, padded with nothing; and the slot at which each block of
    lanes begins."""
    slots, start = [], [0]
    for block in range(0, len(terms), WIDTH):
        levels = itertools.zip_longest(*terms[block : block + WIDTH], fillvalue=nothing)
        slots += [slot for level in levels for slot in level]
        start.append(len(slots))
    return slots, np.array(start)


def _inertia(model: Model, forms: Forms, lanes: int) -> Inertia:
    """Return the mass matrix; gravity, forces and moments that are constant."""
    data, d = model.data, forms.d
    scenes, pattern = data.bodies.mass.shape[:-1], forms.of.numbers.pattern
    force, linear = constant_forces(data, forms)
    terms: list[list[tuple[Any, ...]]] = [[] for _ in range(lanes)]
    for i, j in zip(*(place.tolist() for place in np.nonzero(pattern(linear))), strict=True):
        terms[i].append((j, i * d + j))
    slots, start = _slots(terms, (0, d * d))
    source, place = (np.array([slot[k] for slot in slots], np.int64) for k in range(2))
    weights = np.zeros((*scenes, d * d + 1))  # slots without a term use the last weight
    weights[..., :-1] = linear.reshape(*scenes, d * d)
    mass = np.zeros((*scenes, d, lanes))
    mass[..., :d] = forms.mass(data.bodies)
    coupling, coupled = map(np.ascontiguousarray, np.nonzero(pattern(mass)))
    first = np.searchsorted(coupling, np.arange(d + 1))
    force = np.concatenate([force, np.zeros((*scenes, lanes - d))], axis=-1)
    return Inertia(mass, coupled, first, force, source, weights[..., place], start)


def _poses(of: NaturalCoordinates, forms: Forms) -> Poses:
    places = []
    for b in range(of.nb):
        columns = forms.axes(b)
        centre = [{k: of.length * v for k, v in of.eliminate({c: 1.0}).items()} for c in of.centres[b]]
        places += [*centre, *(columns[j][i] for i in range(3) for j in range(3))]
    constant, matrix = forms([cleaned(expression) for expression in places])
    row, variable = map(np.ascontiguousarray, np.nonzero(matrix))
    start = np.searchsorted(row, np.arange(len(places) + 1))
    return Poses(constant, start, variable, matrix[row, variable])


def _given(of: NaturalCoordinates) -> Given:
    rows = [(d, f, of.length if f == VALUE else 1.0) for d, f in of.given.values()]
    return Given(*_columns(rows, 2))
