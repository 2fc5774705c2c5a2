"""Numbers, or symbols of a code generator, as entries of arrays."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

NOTHING = 1e-12  # entries below this size are rounding


@dataclass(frozen=True)
class Arithmetic:
    """The functions of the numbers or symbols."""

    sin: Callable[[Any], Any]
    cos: Callable[[Any], Any]


NUMBERS = Arithmetic(math.sin, math.cos)


class Symbol:
    """A symbol of a code generator as an entry of arrays; sums with zero and products with zero or one are
    simplified."""

    def __init__(self, value: Any):
        self.value = value

    def __add__(self, other: Any) -> Any:
        return self if _is(other, 0) else Symbol(self.value + _bare(other))

    def __mul__(self, other: Any) -> Any:
        if _is(other, 0):
            return 0.0
        return self if _is(other, 1) else Symbol(self.value * _bare(other))

    def __sub__(self, other: Any) -> Any:
        return self if _is(other, 0) else Symbol(self.value - _bare(other))

    def __rsub__(self, other: Any) -> Any:
        return Symbol(-self.value) if _is(other, 0) else Symbol(_bare(other) - self.value)

    def __truediv__(self, other: Any) -> Any:
        return self if _is(other, 1) else Symbol(self.value / _bare(other))

    def __rtruediv__(self, other: Any) -> Any:
        return 0.0 if _is(other, 0) else Symbol(_bare(other) / self.value)

    def __neg__(self) -> Any:
        return Symbol(-self.value)

    __radd__, __rmul__ = __add__, __mul__


def _is(number: Any, constant: float) -> bool:
    return not isinstance(number, Symbol) and number == constant


def _bare(number: Any) -> Any:
    return number.value if isinstance(number, Symbol) else float(number)


def symbolic(sin: Callable[[Any], Any], cos: Callable[[Any], Any]) -> Arithmetic:
    """Return the arithmetic of a generator's symbols, as entries of arrays."""
    return Arithmetic(lambda x: Symbol(sin(x.value)), lambda x: Symbol(cos(x.value)))


def bare(entries: Iterable[Any]) -> list[Any]:
    """Return the generator's own symbols, or numbers, of the entries."""
    return [_bare(entry) for entry in entries]
