"""The equations of a scene in natural coordinates as the arrays that the kernels of the series read."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from mbref import rotations
from mbref.equations.model import Model
from mbref.kernels.scene_layout import FORCE, MOMENT, SPRING, TORSION_SPRING, Bodies, Loads, SceneData
from mbref.taylor.expressions import ONE, Expression, cleaned
from mbref.taylor.layout import Given, Inertia, Polynomials, Poses, Products, Rows, Springs, Torsions
from mbref.taylor.loads import VALUE
from mbref.taylor.natural import NaturalCoordinates
from mbref.taylor.numbers import array_of
from mbref.taylor.orientations import Triple
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
        self._angles = _coupled_angles(self._forms)
        self._without = Springs(*_stacked([], 3, len(of.kept))), _torsions_of(self._angles, len(of.kept))

    def polynomials(self, model: Model) -> Polynomials:
        """Return the polynomials of a scene of this geometry."""
        (springs, torsions), loads = self._without, model.data.loads
        if (loads.kind == SPRING).any():
            springs = _springs(loads, self._forms)
        if (loads.kind == TORSION_SPRING).any():
            torsions = _torsions_of([*_torsions(loads, self._forms), *self._angles], self._forms.d)
        return Polynomials(
            rows=self._rows,
            products=self._products,
            inertia=_inertia(model, self._forms, self._lanes),
            poses=self._poses,
            given=self._given,
            springs=springs,
            torsions=torsions,
        )


class Forms:
    """Expressions as constants and rows of coefficients of the d variables kept."""

    def __init__(self, of: NaturalCoordinates):
        self.of, self.d = of, len(of.kept)
        self._place = {v: i for i, v in enumerate(of.kept)}
        self._axes: dict[int, Sequence[Triple]] = {}
        self._of_axes: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def __call__(self, expressions: Sequence[Expression]) -> tuple[np.ndarray, np.ndarray]:
        """Return constants (k,) and coefficients (k, d)."""
        number_type = self.of.numbers.number_type
        constant: np.ndarray = np.full(len(expressions), 0.0, number_type)
        matrix: np.ndarray = np.full((len(expressions), self.d), 0.0, number_type)
        for row, expression in enumerate(expressions):
            for variable, coefficient in self.of.eliminate(expression).items():
                if variable == ONE:
                    constant[row] = coefficient
                else:
                    matrix[row, self._place[variable]] = coefficient
        return constant, matrix

    def variables(self, variables: Iterable[int]) -> tuple[np.ndarray, np.ndarray]:
        """Return constants and coefficients of variables as functions of the kept variables."""
        return self([{v: 1.0} for v in variables])

    def axes(self, body: int) -> Sequence[Triple]:
        """Return the directions of a body's three principal axes."""
        if body not in self._axes:
            self._axes[body] = [self.of.direction(body, axis) for axis in np.eye(3)]
        return self._axes[body]

    def spread(self, array: np.ndarray) -> np.ndarray:
        """Return the values of numbers, behind an axis that counts the scenes of a batch."""
        return self.of.numbers.spread(array)

    @cached_property
    def centres(self) -> np.ndarray:
        """Return coefficients (…, nb, 3, d) of the bodies' centres of mass."""
        found = [self.variables(centre)[1] for centre in self.of.centres]
        return self.spread(np.array(found).reshape(self.of.nb, 3, self.d))

    @cached_property
    def _of_inertia(self) -> np.ndarray:
        """Return the parts (…, 4 nb, d, d) of M of each body: of its mass, and of ∫ x² dm of its axes."""
        nb, d = self.of.nb, self.d
        axes = self.spread(np.array([self.of_axes(b)[1] for b in range(nb)]).reshape(nb, 3, 3, d))
        forms = np.concatenate([self.centres[..., None, :, :], axes], axis=-3)
        return _sum_of_products(forms.reshape(*forms.shape[:-4], 4 * nb, 3, d))

    def of_axes(self, body: int) -> tuple[np.ndarray, np.ndarray]:
        """Return constants (9,) and coefficients (9, d) of the directions of a body's principal axes."""
        if body not in self._of_axes:
            self._of_axes[body] = self(
                [component for direction_vector in self.axes(body) for component in direction_vector]
            )
        return self._of_axes[body]

    def mass(self, bodies: Bodies) -> np.ndarray:
        """Return M (…, d, d), with ½ ż M ż the kinetic energy in the unit of length squared."""
        principal = bodies.inertia / self.of.length**2
        along = principal.sum(axis=-1, keepdims=True) / 2 - principal
        weights = np.concatenate([bodies.mass[..., None], along], axis=-1)
        weights = weights.reshape(*bodies.mass.shape[:-1], -1, 1, 1)
        return np.asarray((weights * self._of_inertia).sum(axis=-3))


def _sum_of_products(one: np.ndarray, other: np.ndarray | None = None) -> np.ndarray:
    """Return Σ_k one[k, i] other[k, j] (…, d, e) of arrays (…, 3, d) and (…, 3, e)."""
    other = one if other is None else other
    first, second, third = (one[..., k, :, None] * other[..., k, None, :] for k in range(3))
    return np.asarray(first + second + third)


def _rows(of: NaturalCoordinates, lane: dict[int, int], lanes: int) -> Rows:
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
    return Rows(*columns)


def _tableau(rows: Rows, nz: int, nr: int, lanes: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the constant part of the tableau (nr + 1, lanes) of the rows, and the places of products in
    it."""
    linear = np.full((nr + 1, lanes), 0.0, rows.constant.dtype)
    of_variables = rows.linear_lane < nz
    places = rows.linear_row[of_variables], rows.linear_lane[of_variables]
    np.add.at(linear, places, rows.linear_weight[of_variables])
    linear[np.arange(nr), nz + np.arange(nr)] = 1.0
    return linear, np.where(rows.lane < nz, rows.row * lanes + rows.lane, nr * lanes)


def _columns(entries: Sequence[tuple[float, ...]], indices: int) -> list[np.ndarray]:
    """Return columns of a table, the first ones of indices and the last of numbers."""
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
    """Return the terms of each lane in vectors, padded with nothing; where each block of lanes begins."""
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
    force, linear = _constant_forces(data, forms)
    terms: list[list[tuple[Any, ...]]] = [[] for _ in range(lanes)]
    for i, j in zip(*(place.tolist() for place in np.nonzero(pattern(linear))), strict=True):
        terms[i].append((j, i * d + j))
    slots, start = _slots(terms, (0, d * d))
    source, place = (np.array([slot[k] for slot in slots], np.int64) for k in range(2))
    weights = np.concatenate([linear.reshape(*scenes, d * d), np.zeros((*scenes, 1))], axis=-1)
    mass = np.zeros((*scenes, d, lanes))
    mass[..., :d] = forms.mass(data.bodies)
    coupling, coupled = map(np.ascontiguousarray, np.nonzero(pattern(mass)))
    first = np.searchsorted(coupling, np.arange(d + 1))
    force = np.concatenate([force, np.zeros((*scenes, lanes - d))], axis=-1)
    return Inertia(mass, coupled, first, force, source, weights[..., place], start)


def _constant_forces(data: SceneData, forms: Forms) -> tuple[np.ndarray, np.ndarray]:
    """Return forces on the variables: constant ones (…, d), and the matrix (…, d, d) of linear ones."""
    of, loads, d = forms.of, data.loads, forms.d
    weight = data.bodies.mass[..., None] * (data.gravity / of.length)[..., None, :]
    by_weight = weight[..., None] * forms.centres
    force = by_weight.reshape(*by_weight.shape[:-3], 3 * of.nb, d).sum(axis=-2)
    linear = np.zeros((*force.shape, d))
    for k, (kind, body) in enumerate(zip(loads.kind.tolist(), loads.first.tolist(), strict=True)):
        if kind == FORCE and body < of.nb:
            point = forms.spread(forms(of.point(body, loads.point_first[k]))[1])
            force = (
                force + _sum_of_products((loads.force[..., k, :] / of.length)[..., None], point)[..., 0, :]
            )
        elif kind == MOMENT:
            constant, matrix = _moment(forms, body, loads.force[..., k, :] / of.length**2)
            force, linear = force + constant, linear + matrix
    return force, linear


def _moment(forms: Forms, body: int, moment: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return constant (…, d) and linear (…, d, d) force of a moment (…, 3): ½ Σ (moment × R e) · δ(R e) over
    three axes."""
    at_rest, moving = map(forms.spread, forms.of_axes(body))
    constant, matrix = np.zeros(()), np.zeros(())
    for k in range(0, 9, 3):
        form = moving[..., k : k + 3, :]
        turned = rotations.cross(moment, at_rest[..., k : k + 3])
        turning = rotations.cross(moment[..., None, :], form.swapaxes(-1, -2)).swapaxes(-1, -2)
        constant = constant + 0.5 * _sum_of_products(turned[..., None], form)[..., 0, :]
        matrix = matrix + 0.5 * _sum_of_products(form, turning)
    return constant, matrix


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


def _springs(loads: Loads, forms: Forms) -> Springs:
    of, rows = forms.of, []
    for k in np.flatnonzero(loads.kind == SPRING):
        one, other = (
            forms(of.point(int(body[k]), point[k]))
            for body, point in ((loads.first, loads.point_first), (loads.second, loads.point_second))
        )
        rows.append(
            (
                other[0] - one[0],
                other[1] - one[1],
                loads.stiffness[k],
                loads.damping[k],
                loads.natural[k] / of.length,
            )
        )
    return Springs(*_stacked(rows, 3, forms.d))


def _coupled_angles(forms: Forms) -> list[tuple[Any, ...]]:
    """Return the angles in the rows of couplings, as rows of ``Torsions`` without stiffness."""
    of, rows = forms.of, []
    table = of.model.data.primitives
    for p, (row, factor) in of.angles.items():
        first, second = int(table.first[p]), int(table.second[p])
        across = (of.direction(first, w[p]) for w in (table.direction_first, table.turning_first))
        directions = *across, of.direction(second, table.direction_second[p])
        constant, form = forms([e for direction in directions for e in direction])
        rows.append((constant, form, 0.0, 0.0, 0.0, table.angle[p], row, factor))
    return rows


def _torsions(loads: Loads, forms: Forms) -> list[tuple[Any, ...]]:
    """Return the torsion springs, as rows of ``Torsions``."""
    of, rows = forms.of, []
    for k in np.flatnonzero(loads.kind == TORSION_SPRING):
        first, second = int(loads.first[k]), int(loads.second[k])
        direction_vectors = (of.direction(first, loads.x_first[k]), of.direction(first, loads.y_first[k]),
                  of.direction(second, loads.x_second[k]))  # fmt: skip
        constant, form = forms([e for direction_vector in direction_vectors for e in direction_vector])
        stiffness, damping = (c[k] / of.length**2 for c in (loads.stiffness, loads.damping))
        rows.append((constant, form, stiffness, damping, loads.natural[k], loads.angle[k], -1, 0.0))
    return rows


def _torsions_of(rows: Sequence[tuple[Any, ...]], d: int) -> Torsions:
    constant, form, stiffness, damping, natural, slot, row, factor = _stacked(rows, 9, d, 6)
    indices = slot.astype(np.int64), row.astype(np.int64)
    return Torsions(constant, form, stiffness, damping, natural, *indices, factor)


def _stacked(rows: Sequence[tuple[Any, ...]], width: int, d: int, numbers: int = 3) -> list[np.ndarray]:
    """Return constants (k, width), forms (k width, d) and columns of numbers (k,)."""
    columns = [[row[i] for row in rows] for i in range(2 + numbers)]
    return [
        np.array(columns[0]).reshape(-1, width),
        np.array(columns[1]).reshape(width * len(rows), d),
        *map(array_of, columns[2:]),
    ]
