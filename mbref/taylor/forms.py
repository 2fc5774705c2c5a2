"""Expressions of a scene in natural coordinates as affine forms of the remaining variables."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property

import numpy as np

from mbref.kernels.scene_layout import Bodies
from mbref.taylor.expressions import ONE, Expression
from mbref.taylor.natural import NaturalCoordinates
from mbref.taylor.orientations import Triple

MOST_STORED_BYTES = 2**26  # bytes of the parts of M by bodies; larger parts are summed without being stored


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
        """Return the values of numbers, with the scenes of a batch along the first axis."""
        return self.of.numbers.spread(array)

    @cached_property
    def centres(self) -> np.ndarray:
        """Return coefficients (…, nb, 3, d) of the bodies' centres of mass."""
        found = [self.variables(centre)[1] for centre in self.of.centres]
        return self.spread(np.array(found).reshape(self.of.nb, 3, self.d))

    @cached_property
    def _of_bodies(self) -> np.ndarray:
        """Return coefficients (…, 4 nb, 3, d) of each body's centre of mass and three axes."""
        nb, d = self.of.nb, self.d
        axes = self.spread(np.array([self.of_axes(b)[1] for b in range(nb)]).reshape(nb, 3, 3, d))
        forms = np.concatenate([self.centres[..., None, :, :], axes], axis=-3)
        return forms.reshape(*forms.shape[:-4], 4 * nb, 3, d)

    @cached_property
    def _of_inertia(self) -> np.ndarray:
        """Return the parts (…, 4 nb, d, d) of M that each body contributes: the part of its mass, and the
        parts of ∫ x² dm along its three axes."""
        return sum_of_products(self._of_bodies)

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
        if 4 * self.of.nb * self.d * self.d * 8 <= MOST_STORED_BYTES:
            return np.asarray((weights * self._of_inertia).sum(axis=-3))
        forms = self._of_bodies
        flat, weighted = (each.reshape(*each.shape[:-3], -1, self.d) for each in (forms, weights * forms))
        return np.asarray(np.swapaxes(flat, -1, -2) @ weighted)


def sum_of_products(one: np.ndarray, other: np.ndarray | None = None) -> np.ndarray:
    """Return Σ_k one[k, i] other[k, j] (…, d, e) of arrays (…, 3, d) and (…, 3, e)."""
    other = one if other is None else other
    first, second, third = (one[..., k, :, None] * other[..., k, None, :] for k in range(3))
    return np.asarray(first + second + third)
