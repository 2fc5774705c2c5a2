"""Loads of a scene in natural coordinates, as the arrays that the kernels of the series read."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from mbref import rotations
from mbref.kernels.scene_layout import (
    ABOUT_AXIS,
    ALONG_AXIS,
    COUPLED_ANGLE,
    FORCE,
    MOMENT,
    POINT_DAMPER,
    SPRING,
    TURN_DAMPER,
    Loads,
    SceneData,
)
from mbref.taylor.forms import Forms, sum_of_products
from mbref.taylor.numbers import array_of
from mbref.taylor.polynomial_layout import Slides, Springs, TimedForces, Torsions


def constant_forces(data: SceneData, forms: Forms) -> tuple[np.ndarray, np.ndarray]:
    """Return forces on the variables: constant forces (…, d), and the matrix (…, d, d) of forces that are
    linear in the variables."""
    of, loads, d = forms.of, data.loads, forms.d
    weight = data.bodies.mass[..., None] * data.gravity / of.length
    by_weight = weight[..., None] * forms.centres
    force = by_weight.reshape(*by_weight.shape[:-3], 3 * of.nb, d).sum(axis=-2)
    linear = np.zeros((*force.shape, d))
    for k in np.flatnonzero(is_constant(loads)).tolist():
        constant, matrix = _force_of(k, loads, forms)
        force, linear = force + constant, linear + matrix
    return force, linear


def is_constant(loads: Loads) -> np.ndarray:
    """Return which loads (l,) are forces or moments that do not change over time."""
    of_bodies: np.ndarray = (loads.kind == FORCE) | (loads.kind == MOMENT)
    return of_bodies & (loads.function < 0)


def _force_of(k: int, loads: Loads, forms: Forms) -> tuple[np.ndarray, np.ndarray]:
    """Return constant (…, d) and linear (…, d, d) force of a force at a point or a moment, load k."""
    of, body = forms.of, int(loads.first[k])
    if loads.kind[k] == MOMENT:
        return _moment(forms, body, loads.force[..., k, :] / of.length**2)
    if body >= of.nb:
        return np.zeros(forms.d), np.zeros(())
    point = forms.spread(forms(of.point(body, loads.point_first[k]))[1])
    pushed = sum_of_products((loads.force[..., k, :] / of.length)[..., None], point)[..., 0, :]
    return pushed, np.zeros(())


def _moment(forms: Forms, body: int, moment: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return constant (…, d) and linear (…, d, d) force of a moment (…, 3): ½ Σ (moment × R e) · δ(R e) over
    three axes."""
    at_rest, moving = map(forms.spread, forms.of_axes(body))
    axes = moving.reshape(*moving.shape[:-2], 3, 3, forms.d)
    turned = rotations.cross(moment[..., None, :], at_rest.reshape(*at_rest.shape[:-1], 3, 3))
    turning = rotations.cross(moment[..., None, None, :], axes.swapaxes(-1, -2)).swapaxes(-1, -2)
    constant = 0.5 * sum_of_products(turned[..., None], axes)[..., 0, :]
    matrix = 0.5 * sum_of_products(axes, turning)
    return constant.sum(axis=-2), matrix.sum(axis=-3)


def springs_of(loads: Loads, forms: Forms) -> Springs:
    """Return the springs between points."""
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


class CoupledCoordinates(NamedTuple):
    """Joint coordinates in the rows of couplings: rows of ``Torsions`` and ``Slides`` without stiffness."""

    angles: list[tuple[Any, ...]]
    displacements: list[tuple[Any, ...]]


def coupled_coordinates(forms: Forms) -> CoupledCoordinates:
    """Return the joint coordinates in the rows of couplings."""
    of, found = forms.of, CoupledCoordinates([], [])
    table = of.model.data.primitives
    for p, (row, law) in of.coordinates.items():
        first, second = int(table.first[p]), int(table.second[p])
        if table.kind[p] == COUPLED_ANGLE:
            across = (of.direction(first, w[p]) for w in (table.direction_first, table.turning_first))
            directions = *across, of.direction(second, table.direction_second[p])
            constant, form = forms([e for direction in directions for e in direction])
            found.angles.append((constant, form, 0.0, 0.0, 0.0, -1, table.angle[p], row, *law))
        else:
            axis = of.direction(first, table.direction_first[p])
            ends = of.point(first, table.point_first[p]), of.point(second, table.point_second[p])
            found.displacements.append((*_along(forms, axis, ends), 0.0, 0.0, 0.0, -1, row, *law))
    return found


def _along(forms: Forms, axis: Any, ends: Sequence[Any]) -> tuple[np.ndarray, np.ndarray]:
    """Return constants (6,) and forms (6, d) of an axis and of the vector between two points."""
    axis, one, other = forms(axis), forms(ends[0]), forms(ends[1])
    constant, form = (np.concatenate([axis[c], other[c] - one[c]]) for c in range(2))
    return constant, form


def torsions_of(data: SceneData, forms: Forms, angles: Sequence[tuple[Any, ...]]) -> Torsions:
    """Return the loads about joints' axes, then the coupled angles."""
    powers = data.primitives.higher.shape[-1] + 1
    of, rows, loads, turning = forms.of, [], data.loads, data.turning
    places = np.flatnonzero(loads.kind == ABOUT_AXIS)
    for k in places:
        first, second, s = int(loads.first[k]), int(loads.second[k]), int(loads.angle[k])
        direction_vectors = (of.direction(first, turning.x_first[s]), of.direction(first, turning.y_first[s]),
                  of.direction(second, turning.x_second[s]))  # fmt: skip
        constant, form = forms([e for direction_vector in direction_vectors for e in direction_vector])
        stiffness, damping = (c[k] / of.length**2 for c in (loads.stiffness, loads.damping))
        indices = loads.function[k], s, -1
        rows.append((constant, form, stiffness, damping, loads.natural[k], *indices, *[0.0] * powers))
    rows += angles
    constant, form, stiffness, damping, natural, *others = _stacked(rows, 9, forms.d, 6 + powers)
    amount = loads.force[..., places, 0] / of.length**2
    amount = np.concatenate([amount, np.zeros((*amount.shape[:-1], len(angles)))], axis=-1)
    function, slot, row = (number.astype(np.int64) for number in others[:3])
    law = np.stack(others[3:], axis=-1)
    return Torsions(constant, form, stiffness, damping, natural, amount, function, slot, row, law)


def slides_of(data: SceneData, forms: Forms, displacements: Sequence[tuple[Any, ...]]) -> Slides:
    """Return the loads along joints' axes, then the dampers between bodies and the coupled displacements."""
    of, rows, loads = forms.of, [], data.loads
    places, powers = np.flatnonzero(loads.kind == ALONG_AXIS), data.primitives.higher.shape[-1] + 1
    for k in places:
        first, second = int(loads.first[k]), int(loads.second[k])
        axis = of.direction(first, loads.axis[k])
        ends = of.point(first, loads.point_first[k]), of.point(second, loads.point_second[k])
        numbers = loads.stiffness[k], loads.damping[k], loads.natural[k] / of.length
        rows.append((*_along(forms, axis, ends), *numbers, loads.function[k], -1, *[0.0] * powers))
    rows += [(*each, 0.0, -1, -1, *[0.0] * powers) for each in _dampers(loads, forms)]
    rows += displacements
    constant, form, stiffness, damping, natural, *others = _stacked(rows, 6, forms.d, 5 + powers)
    amount = loads.force[..., places, 0] / of.length
    amount = np.concatenate([amount, np.zeros((*amount.shape[:-1], len(rows) - len(places)))], axis=-1)
    function, row = (number.astype(np.int64) for number in others[:2])
    law = np.stack(others[2:], axis=-1)
    return Slides(constant, form, stiffness, damping, natural, amount, function, row, law)


def _dampers(loads: Loads, forms: Forms) -> Iterator[tuple[Any, ...]]:
    """Yield constants, forms, no stiffness and damping of scalar products q = a · d that resist as dampers
    between bodies do, by -damping q'.

    A point damper acts along each axis a of the first body. A rotational damper c has the dissipation
    ½ c (ω₂ - ω₁)² = ¼ c Σ q'², where q are the products of each axis of the first and of the second body.
    """
    of = forms.of
    for k in np.flatnonzero(loads.kind == POINT_DAMPER):
        first, second = int(loads.first[k]), int(loads.second[k])
        ends = of.point(first, loads.point_first[k]), of.point(second, loads.point_second[k])
        for axis in forms.axes(first):
            yield *_along(forms, axis, ends), 0.0, loads.damping[k]
    for k in np.flatnonzero(loads.kind == TURN_DAMPER):
        for pair in product(forms.axes(int(loads.first[k])), forms.axes(int(loads.second[k]))):
            yield *forms([e for axis in pair for e in axis]), 0.0, 0.5 * loads.damping[k] / of.length**2


def timed_forces(loads: Loads, forms: Forms) -> TimedForces:
    """Return the forces and moments on bodies that functions of time multiply."""
    places = [k for k in np.flatnonzero(loads.function >= 0) if loads.kind[k] in (FORCE, MOMENT)]
    found, lead, d = [_force_of(int(k), loads, forms) for k in places], loads.force.shape[:-2], forms.d
    constant = np.array([np.broadcast_to(c, (*lead, d)) for c, _ in found]).reshape(len(found), *lead, d)
    linear = np.array([np.broadcast_to(m, (*lead, d, d)) for _, m in found])
    linear = np.moveaxis(linear.reshape(len(found), *lead, d, d), 0, len(lead))
    function = np.array([int(loads.function[k]) for k in places], dtype=np.int64)
    return TimedForces(
        function, np.moveaxis(constant, 0, len(lead)), linear.reshape(*lead, len(found) * d, d)
    )


def _stacked(rows: Sequence[tuple[Any, ...]], width: int, d: int, numbers: int = 3) -> list[np.ndarray]:
    """Return constants (k, width), forms (k width, d) and columns of numbers (k,)."""
    columns = [[row[i] for row in rows] for i in range(2 + numbers)]
    return [
        np.array(columns[0]).reshape(-1, width),
        np.array(columns[1]).reshape(width * len(rows), d),
        *map(array_of, columns[2:]),
    ]
