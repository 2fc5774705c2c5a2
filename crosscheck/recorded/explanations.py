"""Difference of a table from the exact motion, and the test of an explanation: what remains must be small.

An explanation predicts columns. It is accepted if the difference that remains is small in every column:
within the rounding of the cells, or below a part of the difference that only the cause can leave.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from crosscheck.judge.deadline import ask
from crosscheck.recorded.columns import VECTORS, kind_of

Columns = Mapping[str, np.ndarray]
Stated = tuple[str, int, Columns]  # sentence, number of fitted parameters and choices, predicted columns
# fraction of a column's difference that an accepted explanation leaves: errors of fits are below it, and the
# difference of two causes over a motion is above it
LEFT = 1e-4
# fraction of the whole difference that the rounding of cells may leave; above it causes look alike
ROUNDED = 0.02
CELLS = 4  # least number of cells that are off, for each parameter of an explanation
ALIKE = 1e-9  # relative difference of two predictions below which they state one cause in two ways
TIERS = (1, 3, 6)  # parameters up to which explanations are equally simple
SHOWN = 3  # explanations that are named together if the table does not tell them apart
MOST = 1e12  # multiple of a quantity's size; a table with a larger number is not explained


class Cause(NamedTuple):
    """A possible cause: its sentence, the number of fitted parameters and choices, the columns that it
    predicts, and its kind. Causes of one kind that predict one table are one cause."""

    sentence: str
    complexity: int
    columns: Columns
    kind: str = ""


@dataclass(frozen=True)
class Explanation:
    """An explanation: a sentence, the fraction (0 to 1) of the difference that remains, and the number of
    fitted parameters."""

    sentence: str
    remains: float
    complexity: int


@dataclass(frozen=True)
class Difference:
    """Recorded and exact columns (k,) at times (k,), with the scale of each, and exact columns at any
    time.

    ``later`` has all columns of the exact motion as functions of time, from ``begin`` (s) to ``end`` (s).
    ``allowed`` (k,) is the error of each cell that means nothing. ``every`` has the times and exact columns
    of all rows, of which the times (k,) may be a part.
    """

    times: np.ndarray
    recorded: Columns
    exact: Columns
    scale: Mapping[str, float]
    later: Mapping[str, Callable[[np.ndarray], np.ndarray]]
    begin: float = 0.0
    end: float = np.inf
    allowed: Columns = field(default_factory=dict)
    every: tuple[np.ndarray, Columns] | None = None

    @cached_property
    def whole(self) -> Columns:
        """Return all columns of the exact motion at the times, also those that the table has not."""
        return {**{n: column(self.times) for n, column in self.later.items()}, **self.exact}

    @cached_property
    def squares(self) -> dict[str, float]:
        """Return the mean square of each column's difference, relative to its scale."""
        return {n: self.left(n, self.exact[n]) for n in self.recorded}

    @cached_property
    def noise(self) -> dict[str, float]:
        """Return the mean square of each column's errors that mean nothing, relative to its scale."""
        return {n: float(np.mean((self.allowed.get(n, 0.0) / self.scale[n]) ** 2)) for n in self.recorded}

    @cached_property
    def cells(self) -> int:
        """Return the number of cells that are off."""
        errors = ((n, np.abs(self.recorded[n] - self.exact[n])) for n in self.recorded)
        return int(sum((error > self.allowed.get(n, 0.0)).sum() for n, error in errors))

    @property
    def is_absurd(self) -> bool:
        """Return whether a recorded number is too large for its square to mean anything."""
        return any(np.abs(c).max(initial=0.0) > MOST * self.scale[n] for n, c in self.recorded.items())

    def left(self, name: str, predicted: np.ndarray) -> float:
        """Return the mean square of a recorded column minus a predicted one, relative to its scale."""
        return float(np.mean(((self.recorded[name] - predicted) / self.scale[name]) ** 2))

    def size(self, predicted: Columns) -> float:
        """Return the root mean square of recorded minus predicted columns, each relative to its scale."""
        changed = {n: self.left(n, c) for n, c in self.signed(predicted).items()}
        return float(np.sqrt(sum({**self.squares, **changed}.values()) / len(self.squares)))

    def signed(self, predicted: Columns) -> dict[str, np.ndarray]:
        """Return the predicted columns that the table has, quaternions with the sign nearer to the recorded
        one."""
        found = {n: c for n, c in predicted.items() if n in self.recorded}
        turned = {n.rpartition(".")[0] for n in found if kind_of(n) == "orientation"}
        part = {n: c for n, c in self.recorded.items() if n.rpartition(".")[0] in turned}
        return {n: c for n, c in {**found, **with_signs(part, {**self.exact, **found})}.items() if n in found}

    def explained(self, cause: Cause) -> Explanation | None:
        """Return a cause as an explanation if the difference that it leaves is small in every column."""
        sentence, complexity, predicted, _ = cause
        total = sum(self.squares.values())
        if not total or self.cells < CELLS * complexity:
            return None
        left = dict(self.squares)
        for name, column in self.signed(predicted).items():
            left[name] = self.left(name, column)
            if not self.is_small(name, left[name]):
                return None
        if not all(self.is_small(n, square) for n, square in left.items()):
            return None
        remains = float(np.sqrt(sum(left.values()) / total))
        return Explanation(sentence, remains, complexity) if remains <= ROUNDED else None

    def is_small(self, name: str, square: float) -> bool:
        """Return whether an explanation may leave a mean square, relative to the scale, in a column."""
        mean = sum(self.squares.values()) / len(self.squares)
        return square <= max(LEFT**2 * max(self.squares[name], mean), self.noise[name])

    @property
    def bodies(self) -> list[str]:
        """Return the bodies that have columns."""
        found = [n.rpartition(".")[0].rpartition(".")[0] for n in self.recorded if kind_of(n) in VECTORS]
        return list(dict.fromkeys(found))

    def vector(self, body: str, kind: str, of: Columns) -> np.ndarray | None:
        """Return the components (k, 3 or 4) of a body's quantity; None if the table has not all of them."""
        names = vector_names(body, kind)
        return np.array([of[n] for n in names]).T if all(n in self.recorded for n in names) else None


def vector_names(body: str, kind: str) -> list[str]:
    """Return the names of the columns of a body's quantity."""
    return [f"{body}.{kind}.{axis}" for axis in VECTORS[kind]]


def with_signs(recorded: Columns, predicted: Columns) -> Columns:
    """Return predicted columns in which each quaternion, or its components in the table, has the sign nearer
    to the recorded one; the sign has no meaning."""
    found = dict(predicted)
    for body in {n.rpartition(".")[0] for n in recorded if kind_of(n) == "orientation"}:
        names = [f"{body}.{axis}" for axis in VECTORS["orientation"] if f"{body}.{axis}" in recorded]
        sign = np.sign(sum(recorded[n] * predicted[n] for n in names))
        found.update({n: np.where(sign < 0, -1.0, 1.0) * predicted[n] for n in names})
    return found


def accepted(difference: Difference, causes: Iterable[Cause]) -> Iterator[tuple[Explanation, Cause]]:
    """Return the causes that explain the difference; asks for the deadline before each cause."""
    for cause in causes:
        ask()
        found = difference.explained(cause)
        if found is not None:
            yield found, cause


def simplest(
    difference: Difference, found: Sequence[tuple[Explanation, Cause]]
) -> list[tuple[Explanation, Cause]]:
    """Return the simplest of the accepted explanations: all that are equally simple.

    Of causes of one kind, or without fitted numbers, that predict one table, the first is returned.
    """
    least = min((_tier(e.complexity) for e, _ in found), default=0)
    different: list[tuple[Explanation, Cause]] = []
    for one in found:
        if _tier(one[0].complexity) == least and not any(_alike(difference, one, o) for o in different):
            different.append(one)
    return different


def joined(explanations: Sequence[Explanation]) -> tuple[Explanation, ...]:
    """Return explanations that the table does not tell apart as one; more than SHOWN explain nothing."""
    if not 0 < len(explanations) <= SHOWN:
        return ()
    sentence = "; or ".join(e.sentence for e in explanations)
    return (Explanation(sentence, max(e.remains for e in explanations), explanations[0].complexity),)


def _tier(complexity: int) -> int:
    return int(np.searchsorted(TIERS, complexity))


def _alike(d: Difference, one: tuple[Explanation, Cause], other: tuple[Explanation, Cause]) -> bool:
    """Return whether two causes of one kind, or without fitted numbers, predict one table."""
    if one[1].kind != other[1].kind and one[1].complexity > 1:
        return False
    first, second = ({**d.exact, **cause.columns} for _, cause in (one, other))
    return all(
        np.abs(first[n] - second[n]).max() <= ALIKE * max(1.0, np.abs(first[n]).max()) for n in d.recorded
    )
