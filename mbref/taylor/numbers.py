"""Numbers of many scenes at once: the equations of all scenes of a batch are computed together.

Coefficients of a batch are floats if each scene has the same float, otherwise ``BatchNumber``. Every
operation is an operation of IEEE arithmetic, so that a scene has equal bits in a batch and alone. The first
scene makes decisions; the batch records which scenes would decide differently.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np


class OneScene:
    """The numbers of one scene: floats."""

    number_type: type = float

    def spread(self, array: np.ndarray) -> np.ndarray:
        """Return the values of an array of numbers."""
        return array

    def pattern(self, values: np.ndarray) -> np.ndarray:
        """Return which values are not zero."""
        return np.asarray(values != 0.0)


class ManyScenes:
    """The scenes of a batch: ``agree`` (s,) are the scenes that made all decisions like the first scene."""

    number_type: type = object

    def __init__(self, count: int):
        self.agree = np.ones(count, dtype=bool)

    def decide(self, answers: np.ndarray) -> bool:
        """Return the answer of the first scene."""
        first = bool(answers[0])
        if not (answers if first else ~answers).all():
            self.agree &= answers == first
        return first

    def together(self, values: np.ndarray) -> np.ndarray:
        """Return numbers (…) of values (s, …): an array of floats if the scenes agree."""
        first = values[0]
        same = (values.view(np.int64) == first.view(np.int64)).all(axis=0) if values.dtype == float else None
        if same is None or same.all():
            return np.array(first)
        found = first.astype(object)
        for place in zip(*np.nonzero(~same), strict=True):
            found[place] = BatchNumber(np.ascontiguousarray(values[(slice(None), *place)]), self)
        return found

    def spread(self, array: np.ndarray) -> np.ndarray:
        """Return the values (s, …) of numbers (…)."""
        found = np.empty((self.agree.size, array.size))
        for k, number in enumerate(array.ravel().tolist()):
            found[:, k] = number.values if isinstance(number, BatchNumber) else number
        return found.reshape(self.agree.size, *array.shape)

    def pattern(self, values: np.ndarray) -> np.ndarray:
        """Return which values (s, …) of the first scene are other than zero."""
        found = values != 0.0
        self.agree &= (found == found[0]).reshape(len(found), -1).all(axis=1)
        return np.asarray(found[0])


class BatchNumber:
    """A number for each scene of a batch."""

    __slots__ = ("batch", "values")

    def __init__(self, values: np.ndarray, batch: ManyScenes):
        self.values, self.batch = values, batch

    def _with(self, values: np.ndarray) -> BatchNumber:
        return BatchNumber(values, self.batch)

    def __add__(self, other: Any) -> BatchNumber:
        return self._with(self.values + _values(other))

    def __sub__(self, other: Any) -> BatchNumber:
        return self._with(self.values - _values(other))

    def __mul__(self, other: Any) -> BatchNumber:
        return self._with(self.values * _values(other))

    def __truediv__(self, other: Any) -> BatchNumber:
        return self._with(self.values / _values(other))

    __radd__, __rmul__ = __add__, __mul__  # sums and products do not depend on the order of the factors

    def __rsub__(self, other: Any) -> BatchNumber:
        return self._with(other - self.values)

    def __rtruediv__(self, other: Any) -> BatchNumber:
        return self._with(other / self.values)

    def __neg__(self) -> BatchNumber:
        return self._with(-self.values)

    def __abs__(self) -> BatchNumber:
        return self._with(np.abs(self.values))

    def __round__(self, digits: int) -> BatchNumber:
        return self._with(np.array([round(value, digits) for value in self.values.tolist()]))

    def sqrt(self) -> BatchNumber:
        """Return the square roots."""
        return self._with(np.sqrt(self.values))

    def __bool__(self) -> bool:
        return self.batch.decide(self.values != 0.0)

    def __lt__(self, other: Any) -> bool:
        return self.batch.decide(self.values < _values(other))

    def __gt__(self, other: Any) -> bool:
        return self.batch.decide(self.values > _values(other))

    def __eq__(self, other: object) -> bool:
        return self.batch.decide(self.values == _values(other))

    __hash__ = None  # type: ignore[assignment]


def _values(number: Any) -> Any:
    return number.values if type(number) is BatchNumber else number


def scalar(number: Any) -> Any:
    """Return an entry of an array as a float, or as a BatchNumber."""
    return number if type(number) is BatchNumber else float(number)


def of_first(number: Any) -> Any:
    """Return the number of the first scene, for a decision that influences no result."""
    return float(number.values[0]) if type(number) is BatchNumber else number


def root(number: Any) -> Any:
    """Return the square root."""
    return number.sqrt() if type(number) is BatchNumber else math.sqrt(number)


def largest(numbers: Iterable[Any]) -> Any:
    """Return the largest magnitude; 0 without numbers."""
    sizes = [abs(number) for number in numbers]
    many = [size for size in sizes if type(size) is BatchNumber]
    if not many:
        return max(sizes, default=0.0)
    values = np.maximum.reduce([size.values for size in many])
    rest = max((size for size in sizes if type(size) is not BatchNumber), default=0.0)
    return BatchNumber(np.maximum(values, rest), many[0].batch)


def array_of(numbers: Sequence[Any]) -> np.ndarray:
    """Return numbers as an array; of floats if all numbers are floats."""
    many = any(type(number) is BatchNumber for number in numbers)
    return np.array(numbers, dtype=object if many else float)


def dot(a: np.ndarray, b: np.ndarray) -> Any:
    """Return the products (…) of vectors (…, 3), term by term from the first on."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def norm(vector: np.ndarray) -> Any:
    """Return the length of a vector (3,)."""
    return root(dot(vector, vector))
