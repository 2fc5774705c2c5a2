"""Affine expressions in the variables of a mechanism, products of two of them, and their elimination.

An expression is a dictionary from variables to coefficients; its key ONE has the constant. A polynomial is a
dictionary from pairs of keys, in increasing order, to coefficients.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import TypeVar

from mbref.taylor.numbers import largest, of_first

Key = TypeVar("Key", bound=Hashable)
Expression = dict[int, float]
Polynomial = dict[tuple[int, int], float]

ONE = -1
NEGLIGIBLE = 1e-12  # relative size below which coefficients count as zero
VANISHING = 1e-9  # an equation with smaller coefficients follows from other equations, within rounding
DEPENDENT_POLYNOMIAL = 1e-9  # largest coefficient / original coefficient: a smaller polynomial is dependent


def combination(*terms: tuple[float, Expression]) -> Expression:
    """Return the sum of expressions times factors, without coefficients that cancel except for rounding."""
    total: Expression = {}
    parts = []
    for factor, expression in terms:
        for variable, coefficient in expression.items():
            parts.append(factor * coefficient)
            total[variable] = total.get(variable, 0.0) + parts[-1]
    return _larger(total, largest(parts))


def cleaned(expression: dict[Key, float]) -> dict[Key, float]:
    """Return an expression without coefficients of round-off size."""
    return _larger(expression, largest(expression.values()))


def _larger(expression: dict[Key, float], size: float) -> dict[Key, float]:
    """Return an expression without coefficients of round-off size, relative to a coefficient's size."""
    small = NEGLIGIBLE * size
    return {key: value for key, value in expression.items() if abs(value) > small}


def product_sum(pairs: Iterable[tuple[Expression, Expression]], factor: float = 1.0) -> Polynomial:
    """Return Σ a b over pairs of expressions, times a factor."""
    total: Polynomial = {}
    for first, second in pairs:
        for i, a in first.items():
            for j, b in second.items():
                key = (i, j) if i <= j else (j, i)
                total[key] = total.get(key, 0.0) + factor * a * b
    return total


def plus(polynomial: Polynomial, factor: float, expression: Expression) -> Polynomial:
    """Return the sum of a polynomial and an expression times a factor."""
    total = dict(polynomial)
    for variable, coefficient in expression.items():
        key = (ONE, variable)
        total[key] = total.get(key, 0.0) + factor * coefficient
    return total


def significant(equation: dict[Key, float], constant: Key) -> dict[Key, float]:
    """Return a polynomial without coefficients of round-off size; only the constant if all other coefficients
    vanish."""
    size = largest(c for key, c in equation.items() if key != constant)
    small = NEGLIGIBLE if size > VANISHING else VANISHING
    return {key: c for key, c in equation.items() if abs(c) > small or key == constant}


def degree(polynomial: Polynomial) -> int:
    """Return the degree: 0 of a constant, 1 of an expression, otherwise 2."""
    return max(((i != ONE) + (j != ONE) for i, j in polynomial), default=0)


def as_expression(polynomial: Polynomial) -> Expression:
    """Return a polynomial of degree 1 or 0 as an expression."""
    return {j: coefficient for (_, j), coefficient in polynomial.items()}


class Elimination:
    """Variables expressed by other variables, by Gauss–Jordan elimination of linear equations.

    ``may_go(variable, others)`` returns whether an equation with ``others`` further variables may eliminate a
    variable. Elimination of a variable increases the number of products in other equations.
    """

    def __init__(self, may_go: Callable[[int, int], bool]):
        self._may_go = may_go
        self.expressed: dict[int, Expression] = {}
        self._users: dict[int, set[int]] = {}  # variable → eliminated variables that depend on it
        self.left: list[Expression] = []  # equations that have eliminated nothing

    def __call__(self, expression: Expression) -> Expression:
        """Return the expression in variables that are not eliminated."""
        known = self.expressed
        if not any(variable in known for variable in expression):
            return expression
        parts = ((value, known.get(variable, {variable: 1.0})) for variable, value in expression.items())
        return combination(*parts)

    def add(self, equation: Expression) -> None:
        """Add an equation, expression = 0, with coefficients of about one."""
        reduced = significant(self(equation), ONE)
        variables = [k for k, v in reduced.items() if k != ONE and abs(v) > VANISHING]
        able = [k for k in variables if self._may_go(k, len(variables) - 1)]
        if able:
            self._eliminate(max(able, key=lambda k: (round(abs(reduced[k]), 9), k)), reduced)
        elif variables:
            self.left.append(reduced)

    def settle(self) -> None:
        """Try the remaining equations again, until no remaining equation eliminates a variable."""
        before: int | None = None
        while before != len(self.expressed):
            before, equations, self.left = len(self.expressed), self.left, []
            for equation in equations:
                self.add(equation)

    def _eliminate(self, gone: int, equation: Expression) -> None:
        pivot = -equation.pop(gone)
        self.expressed[gone] = {k: v / pivot for k, v in equation.items()}
        users = self._users.pop(gone, set())
        for user in users:
            self.expressed[user] = self(self.expressed[user])
        for user in (gone, *users):
            for variable in self.expressed[user]:
                self._users.setdefault(variable, set()).add(user)


def independent(polynomials: Sequence[Polynomial]) -> list[Polynomial]:
    """Return the linearly independent polynomials; polynomials with fewer terms come first."""
    reduced: dict[tuple[int, int], Polynomial] = {}  # keyed by the monomial that no other polynomial has
    kept = []
    for polynomial in sorted(polynomials, key=len):
        size = largest(polynomial.values())
        rest = dict(polynomial)
        for monomial, other in reduced.items():
            if monomial in rest:
                _subtract(rest, rest[monomial], other)
        rest = {k: v for k, v in rest.items() if abs(v) > DEPENDENT_POLYNOMIAL * size}
        lead = max((k for k in rest if k != (ONE, ONE)), key=lambda k: abs(of_first(rest[k])), default=None)
        if lead is None:
            continue
        rest = {k: v / rest[lead] for k, v in rest.items()}
        for other in reduced.values():
            if lead in other:
                _subtract(other, other[lead], rest)
        reduced[lead] = rest
        kept.append(polynomial)
    return kept


def _subtract(target: Polynomial, factor: float, other: Polynomial) -> None:
    for key, value in other.items():
        target[key] = target.get(key, 0.0) - factor * value
