"""Functions of time as data: polynomial, sine and table, of drivers and of loads; loads can be switched.

A table is interpolated by a cubic spline: twice continuously differentiable, "not-a-knot" at both ends. So
the spline through values of a cubic polynomial equals the polynomial (C. de Boor, A Practical Guide to
Splines, 1978, chapter IV). A periodic table repeats itself; its spline is as smooth where a period ends.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple, Self

import numpy as np
from pydantic import BeforeValidator, Field, ValidationInfo, field_validator

from mbref.scene.fields import (
    Angle,
    AngularSpeed,
    LaterTime,
    LengthOrAngle,
    Measure,
    Real,
    Reals,
    SceneEntry,
    Time,
    as_list,
    unit_of,
)

MOST_PERIODS = 100_000  # of a periodic table
# difference of two values of a period / largest value, or of times / length of the table, that is rounding
CLOSED_TABLE = 1e-9
FEWEST_ROWS = 4  # least number of rows of a table; four rows determine a cubic polynomial

Row = tuple[Annotated[Real, unit_of("time")], Measure]
Table = Annotated[tuple[Row, ...], BeforeValidator(as_list)]
Cubic = tuple[float, float, float, float]
ZEROS: Cubic = (0.0, 0.0, 0.0, 0.0)


class Sine(SceneEntry):
    """amplitude · sin(frequency · t + phase); frequency in rad/s."""

    amplitude: LengthOrAngle = 0.0
    frequency: AngularSpeed = 1.0
    phase: Angle = 0.0


class Piece(NamedTuple):
    """A piece of a function: from ``begin`` (s) on, part · (polynomial + sine) + Σ cubic[k] (t - begin)^k."""

    begin: float
    part: float  # 1 where polynomial and sine act, 0 where the function is switched off
    cubic: Cubic


class TimeFunction(SceneEntry):
    """polynomial + sine + table; each part is optional.

    ``table`` has rows (time in s, value), times increasing. A ``periodic`` table begins and ends with one
    value; a scene repeats its rows up to the duration, and states then in ``period_rows`` how many rows one
    period has, without the last one.
    """

    periodic: bool = False
    sine: Sine | None = None
    table: Table | None = None
    period_rows: Annotated[int, Field(ge=FEWEST_ROWS - 1)] | None = None

    @field_validator("table")
    @classmethod
    def _table_makes_a_spline(cls, table: Any, info: ValidationInfo) -> Any:
        if table is None:
            return None
        if len(table) < FEWEST_ROWS:
            raise ValueError(f"must have at least {FEWEST_ROWS} rows [time, value], got {len(table)}")
        for k, ((before, _), (after, _)) in enumerate(itertools.pairwise(table)):
            if not after > before:
                raise ValueError(
                    f"times must increase, but row {k + 1} is at {after:g} s and row {k} at {before:g} s"
                )
        return _closed(table) if info.data.get("periodic") else table

    @field_validator("period_rows")
    @classmethod
    def _table_has_equal_periods(cls, count: int | None, info: ValidationInfo) -> int | None:
        if count is None or not (table := info.data.get("table")):
            return count
        if (len(table) - 1) % count:
            raise ValueError(f"must divide the {len(table) - 1} rows before the last one, got {count}")
        (first, _), (end, _), (last, _) = table[0], table[count], table[-1]
        size = max(abs(x) for _, x in table)
        for k, ((t, x), (later, other)) in enumerate(zip(table, table[count:], strict=False)):
            off = abs(other - x) > CLOSED_TABLE * size
            if off or abs(later - t - (end - first)) > CLOSED_TABLE * (last - first):
                raise ValueError(f"is {count}, but rows {k} and {k + count} of the table differ")
        return count

    def repeated(self, until: float) -> Self:
        """Return the function with the rows of a periodic table repeated up to a time (s)."""
        if not (self.periodic and self.table) or self.table[-1][0] >= until:
            return self
        period = self.period_rows or len(self.table) - 1
        (first, _), *_, (last, value) = table = self.table[: period + 1]
        count = math.ceil((until - first) / (last - first))
        rows = [(t + k * (last - first), x) for k in range(count) for t, x in table[:-1]]
        end = first + count * (last - first), value
        return self.model_copy(update={"table": (*rows, end), "period_rows": period})

    @property
    def coefficients(self) -> tuple[float, ...]:
        """Coefficients c0, c1, c2, … of the polynomial."""
        raise NotImplementedError

    @property
    def interval(self) -> tuple[float, float]:
        """Times (s) between which the function is switched on."""
        return -np.inf, np.inf

    def pieces(self) -> tuple[Piece, ...]:
        """Pieces on which the function is analytic, from t = 0 on."""
        start, stop = self.interval
        cuts = {0.0, *(t for t in (start, stop) if 0.0 < t < np.inf)}
        if self.table is not None:
            cuts |= {t for t, _ in self.table[1:-1] if t > 0.0}
        cubics = self._cubics(sorted(cuts))
        return tuple(
            Piece(t, 1.0, cubic) if start <= t < stop else Piece(t, 0.0, ZEROS) for t, cubic in cubics
        )

    def _cubics(self, begins: list[float]) -> Iterator[tuple[float, Cubic]]:
        """Yield each time in ``begins`` (s) with the coefficients of the table's cubic in the time since
        then."""
        if self.table is None:
            yield from ((begin, ZEROS) for begin in begins)
            return
        from scipy.interpolate import CubicSpline  # only scenes with tables need it

        times, values = zip(*self.table, strict=True)
        spline = CubicSpline(times, values, bc_type="periodic" if self.periodic else "not-a-knot")
        rows = np.clip(np.searchsorted(times, begins, side="right") - 1, 0, len(times) - 2)
        for begin, k in zip(begins, rows.tolist(), strict=True):
            a, b, c, d = spline.c[::-1, k].tolist()
            s = begin - times[k]
            yield begin, (a + s * (b + s * (c + s * d)), b + s * (2 * c + 3 * s * d), c + 3 * s * d, d)

    def values(self, times: np.ndarray) -> np.ndarray:
        """Return the values (k,) at times (k,) in s; at a time of switching, the value of the piece that
        begins."""
        pieces = self.pieces()
        k = np.searchsorted([piece.begin for piece in pieces[1:]], times, side="right")
        begin, part, cubic = (np.array(column)[k] for column in zip(*pieces, strict=True))
        smooth = np.polynomial.polynomial.polyval(times, np.array(self.coefficients))
        if self.sine is not None:
            smooth = smooth + self.sine.amplitude * np.sin(self.sine.frequency * times + self.sine.phase)
        powers = (times - begin)[:, None] ** np.arange(4)
        return np.asarray(part * smooth + (cubic * powers).sum(axis=1))

    def _delayed(self, t: float) -> dict[str, Any]:
        """Return the fields of the function that has at 0 the value, and at every time later, of this one at
        t (s)."""
        terms = np.polynomial.Polynomial(self.coefficients)(np.polynomial.Polynomial([t, 1.0])).coef
        fields: dict[str, Any] = {"polynomial": tuple(terms.tolist())}
        if self.sine is not None:
            phase = self.sine.phase + self.sine.frequency * t
            fields["sine"] = self.sine.model_copy(update={"phase": math.remainder(phase, 2 * math.pi)})
        if self.table is not None:
            fields["table"] = tuple((time - t, value) for time, value in self.table)
        return fields

    @property
    def is_constant(self) -> bool:
        """True if the value never changes."""
        return self.is_polynomial and not any(self.coefficients[1:]) and len(self.pieces()) == 1

    @property
    def is_polynomial(self) -> bool:
        """True without a table and a sine that moves."""
        still = self.sine is None or not self.sine.amplitude or not self.sine.frequency
        return still and self.table is None


def _closed(table: tuple[Row, ...]) -> tuple[Row, ...]:
    """Return the rows of a period with equal values at both ends; raises ValueError if they differ by more
    than rounding."""
    (_, first), *inner, (end, last) = table
    if abs(last - first) > CLOSED_TABLE * max(abs(x) for _, x in table):
        raise ValueError(f"periodic, but begins with {first:g} and ends with {last:g}")
    return (table[0], *inner, (end, first))


class Factor(TimeFunction):
    """A function of time that multiplies a load; the function is 1 if only times of switching are given.

    The load acts from ``start`` (s) until before ``stop`` (s).
    """

    polynomial: Reals | None = None
    start: Time = 0.0
    stop: LaterTime | None = None

    @field_validator("stop")
    @classmethod
    def _stop_is_later(cls, stop: float | None, info: Any) -> float | None:
        if stop is not None and stop <= info.data.get("start", 0.0):
            raise ValueError(f"must be later than start, {info.data['start']:g} s, got {stop:g}")
        return stop

    @property
    def coefficients(self) -> tuple[float, ...]:
        if self.polynomial is not None:
            return self.polynomial
        return (1.0,) if self.sine is None and self.table is None else (0.0,)

    @property
    def interval(self) -> tuple[float, float]:
        return self.start, np.inf if self.stop is None else self.stop

    def from_time(self, t: float) -> Factor | None:
        """Return the factor as a function of the time since t (s); None if it is switched off from t on."""
        if self.stop is not None and self.stop <= t:
            return None
        stop = None if self.stop is None else self.stop - t
        return self.model_copy(update={**self._delayed(t), "start": max(0.0, self.start - t), "stop": stop})
