"""The numbers of a reference: double, extended (long double), or of any number of digits (python-flint).

Formulas are written once, with NumPy's operators and np.sqrt, np.sin, np.cos, for arrays of any type; arrays
of many digits contain objects. Only the midpoints of Arb's intervals are passed from step to step. So the
digits are proved by the agreement of two formulations, not by an enclosure.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Arithmetic:
    """Element type of arrays; ``eps`` is its rounding unit, ``digits`` is set if elements are objects."""

    name: str
    eps: float
    dtype: Any
    digits: int = 0

    def array(self, values: Any) -> np.ndarray:
        """Return an array (any shape) of the arithmetic from doubles or from its own numbers; doubles count
        as exact."""
        if not self.digits:
            return np.array(values, dtype=self.dtype)
        from flint import arb, ctx

        ctx.dps = self.digits
        given = np.array(values, dtype=object)
        return _objects([x if isinstance(x, arb) else arb(float(x)) for x in given.ravel()], given.shape)

    def number(self, value: Any) -> Any:
        """Return one number of the arithmetic."""
        return self.array(value)[()]

    def zeros(self, *shape: int) -> np.ndarray:
        """Return an array of zeros."""
        return np.full(shape, self.number(0.0), dtype=self.dtype)

    def settled(self, values: np.ndarray) -> np.ndarray:
        """Return the midpoints of interval numbers, without their radii, which would grow from operation to
        operation."""
        return _objects([x.mid() for x in np.ravel(values)], np.shape(values)) if self.digits else values


DOUBLE = Arithmetic("double", float(np.finfo(float).eps), np.float64)
# on some CPUs a long double is a double
EXTENDED = Arithmetic("long double", float(np.finfo(np.longdouble).eps), np.longdouble)


def many_digits(digits: int) -> Arithmetic:
    """Return the arithmetic of a number of decimal digits; raises ImportError if python-flint is not
    installed."""
    return Arithmetic(f"{digits} digits", 10.0**-digits, object, digits)


def doubles(values: np.ndarray) -> np.ndarray:
    """Return the nearest doubles of an array of any arithmetic."""
    return np.asarray(values).astype(float)


def largest(values: np.ndarray) -> float:
    """Return the largest absolute value in an array of any arithmetic, as a double; the result is 0 for an
    empty array."""
    return float(np.abs(doubles(values)).max(initial=0.0))


def _objects(values: list[Any], shape: tuple[int, ...]) -> np.ndarray:
    out = np.empty(len(values), dtype=object)
    out[:] = values
    return out.reshape(shape)
