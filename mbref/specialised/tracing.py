"""Tracing: run a kernel once on recording scalars and keep the operations it makes.

The kernels themselves are run, undecorated, on arrays of objects; there is no second formulation.  What is
constant stays a number: zeros vanish, constants fold, equal operations are recorded once.  A branch that
depends on the state follows the sample state and leaves a guard, a comparison that must come out the same
for the record to hold.
"""

from __future__ import annotations

import builtins
import math
import struct
import types
from collections.abc import Callable

import numpy as np

from mbref.kernels.machine_code import NoGeneratedCode as Untraceable

COMPARISONS = {">": "ogt", ">=": "oge", "<": "olt", "<=": "ole"}  # as LLVM names them


class Record:
    """Operations in order: (name, operands), an operand being ``%vk``, the k-th result, or a number.

    ``guards`` maps (comparison, left, right) to the outcome that the record supposes.
    """

    def __init__(self) -> None:
        self.operations: list[tuple] = []
        self.guards: dict[tuple, bool] = {}
        self._known: dict[tuple, Scalar] = {}

    def add(self, name: str, sample: float, *operands: Scalar | float) -> Scalar:
        """The scalar of this operation, recorded now or before."""
        key = (name, *map(operand, operands))
        if key not in self._known:
            self._known[key] = Scalar(self, len(self.operations), float(sample))
            self.operations.append(key)
        return self._known[key]

    def guard(self, comparison: str, left: Scalar | float, right: Scalar | float, outcome: bool) -> bool:
        """Suppose that a comparison comes out as it does at the sample state."""
        self.guards[comparison, operand(left), operand(right)] = outcome
        return outcome


def operand(value: Scalar | float) -> str:
    """As LLVM writes it: the name of an operation's result, or the bits of a number."""
    if isinstance(value, Scalar):
        return f"%v{value.index}"
    return f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}"


def _sample(value: Scalar | float) -> float:
    return value.sample if isinstance(value, Scalar) else value


class Scalar:
    """A number that is not known before the run; ``sample`` is its value at the sample state."""

    __slots__ = ("index", "record", "sample")
    __hash__ = None

    def __init__(self, record: Record, index: int, sample: float):
        self.record, self.index, self.sample = record, index, sample

    def __add__(self, other):
        if other == 0:
            return self
        return self.record.add("fadd", self.sample + _sample(other), self, other)

    def __radd__(self, other):
        return self if other == 0 else self.record.add("fadd", other + self.sample, other, self)

    def __sub__(self, other):
        if other == 0:
            return self
        if other is self:
            return 0.0
        return self.record.add("fsub", self.sample - _sample(other), self, other)

    def __rsub__(self, other):
        return -self if other == 0 else self.record.add("fsub", other - self.sample, other, self)

    def __mul__(self, other):
        if not isinstance(other, Scalar):
            return self._times(other)
        return self.record.add("fmul", self.sample * other.sample, self, other)

    def __rmul__(self, other):
        return self._times(other)

    def _times(self, number: float):
        if number == 0:
            return 0.0
        if number == 1:
            return self
        return -self if number == -1 else self.record.add("fmul", self.sample * number, self, number)

    def __truediv__(self, other):
        if other == 1:
            return self
        return self.record.add("fdiv", self.sample / _sample(other), self, other)

    def __rtruediv__(self, other):
        return 0.0 if other == 0 else self.record.add("fdiv", other / self.sample, other, self)

    def __pow__(self, exponent):
        if exponent != 2:
            raise Untraceable(f"a power of {exponent}")
        return self * self

    def __neg__(self):
        return self.record.add("fneg", -self.sample, self)

    def __abs__(self):
        return self.record.add("fabs", abs(self.sample), self)

    def __gt__(self, other):
        return self.record.guard(">", self, other, self.sample > _sample(other))

    def __ge__(self, other):
        return self.record.guard(">=", self, other, self.sample >= _sample(other))

    def __lt__(self, other):
        return self.record.guard("<", self, other, self.sample < _sample(other))

    def __le__(self, other):
        return self.record.guard("<=", self, other, self.sample <= _sample(other))

    def __eq__(self, other):
        """Kernels ask whether a number is zero only to skip work, which changes no result."""
        return self is other

    def __ne__(self, other):
        return self is not other


def _function(name: str, of_number: Callable[..., float]) -> Callable:
    """A function of numbers, recorded where an argument is a scalar."""

    def function(*arguments):
        record = next((a.record for a in arguments if isinstance(a, Scalar)), None)
        value = of_number(*map(_sample, arguments))
        return value if record is None else record.add(name, value, *arguments)

    return function


_maximum, _minimum = _function("max", builtins.max), _function("min", builtins.min)
FUNCTIONS = {
    "sin": _function("sin", math.sin),
    "cos": _function("cos", math.cos),
    "sqrt": _function("sqrt", math.sqrt),
    "arctan2": _function("atan2", math.atan2),
    "floor": _function("floor", math.floor),
    "max": _maximum,
    "min": _minimum,
    "larger": lambda size, value: _maximum(size, abs(value)),
}


def plain(kernel: Callable) -> Callable:
    """The Python function of a kernel, calling those of other kernels and the functions above."""
    return _plain(kernel, {})


def _plain(kernel: Callable, known: dict) -> Callable:
    function = _python_function(kernel)
    if function in known:
        return known[function]
    globals_ = {**function.__globals__, **FUNCTIONS}
    copy = types.FunctionType(function.__code__, globals_, function.__name__)
    known[function] = copy
    for name in function.__code__.co_names:
        value = function.__globals__.get(name)
        if name not in FUNCTIONS and _is_kernel(value):
            globals_[name] = _plain(value, known)
    return copy


def _python_function(kernel: Callable) -> Callable:
    for attribute in ("py_func", "function"):  # of numba's dispatcher, of mbref's exchangeable kernel
        kernel = getattr(kernel, attribute, kernel)
    return kernel


def _is_kernel(value: object) -> bool:
    return isinstance(_python_function(value), types.FunctionType)


def numbers(array: np.ndarray) -> np.ndarray:
    """An array of objects with the same numbers, as plain floats."""
    return array.astype(object)


def inputs(record: Record, vector: str, samples: np.ndarray) -> list[Scalar]:
    """The entries of a vector that the record takes."""
    return [record.add(f"{vector} {k}", sample) for k, sample in enumerate(samples)]
