"""Formats in which a table writes numbers, and the rounding of each cell that follows from the format.

A column keeps trailing zeros (``%.3f``, ``%.5e``) or strips them (``%g``, C++ streams, spreadsheets). With
zeros kept, the last digit of a cell shows its rounding. With zeros stripped, a short cell is a number whose
further digits are zero: the longest cells show how many digits all cells have.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

NUMBER = re.compile(r"[-+]?(\d*)(?:\.(\d*))?(?:[eEdD]([-+]?\d{1,6}))?")
WHOLE = 15  # significant digits from which on a number has all digits of double precision
PROVEN, SHARE = 8, 0.7  # least number, and fraction, of cells of full length that prove a column's own format
FEW = 3  # significant digits below which a column may consist of short numbers, such as 0.2, 0.4, 0.6
EVIDENCE = 4.0  # -log10 of the probability that double precision numbers look like single precision
TIES = 1 + 1e-6  # of half a unit; numbers in the middle of two decimals are written as one of them
EXACT = 300  # decimals of a number that is not rounded
# relative rounding of numbers in single precision: to binary, and again to the shortest decimal number
SINGLE = float(np.finfo(np.float32).eps)


@dataclass(frozen=True)
class Cells:
    """Digits of the cells (k,) of a column.

    ``places`` is the number of decimals of the last digit (negative for tens), ``digits`` the number of
    significant digits (0 for zero), ``parts`` the digits behind the point as text, ``values`` the numbers.
    ``has_exponents`` is True if every cell except zeros has an exponent.
    """

    places: np.ndarray
    digits: np.ndarray
    parts: tuple[str, ...]
    values: np.ndarray
    has_exponents: bool

    @cached_property
    def keeps_zeros(self) -> bool:
        """Return whether cells show trailing zeros, with one number of decimals or of significant digits."""
        zeros = any(len(part) > 1 and part.endswith("0") for part in self.parts)
        return zeros and self.is_regular

    @property
    def is_regular(self) -> bool:
        """Return whether all cells have one number of decimals or one number of significant digits."""
        return self._has_common_place or self._has_common_digits

    @cached_property
    def has_one_mantissa(self) -> bool:
        """Return whether cells with exponents have one number of digits behind the point, as in engineering
        notation: ``16.510E+00``, ``5.123E-03``; a zero may have another one."""
        sizes = {len(part) for part, digits in zip(self.parts, self.digits, strict=True) if digits}
        return self.has_exponents and len(sizes) == 1

    @cached_property
    def _has_common_place(self) -> bool:
        return len(set(self.places.tolist())) == 1

    @cached_property
    def _has_common_digits(self) -> bool:
        return len(set(self.digits[self.digits > 0].tolist())) == 1

    @property
    def shown(self) -> np.ndarray:
        """Return the decimals (k,) of the last digit; a zero with a number of significant digits is exact."""
        is_exact = (self.digits == 0) & (not self._has_common_place)
        return np.where(is_exact, EXACT, self.places)

    @cached_property
    def longest(self) -> tuple[int, int]:
        """Return the largest numbers of decimals and of significant digits."""
        return int(self.places.max()), int(self.digits.max())

    def full(self, longest: tuple[int, int]) -> np.ndarray:
        """Return the decimals (k,) of the last digit if cells have at most these decimals and digits."""
        leading = self.digits - 1 - self.places  # decimal exponent of the first digit
        return np.where(self.digits > 0, np.minimum(longest[0], longest[1] - 1 - leading), longest[0])

    @cached_property
    def shows_own_format(self) -> bool:
        """Return whether enough cells have the full length of the column."""
        is_full = (self.places >= self.full(self.longest)) & (self.digits > 0)
        return bool(
            self.longest[1] >= FEW
            and is_full.sum() >= PROVEN
            and is_full.sum() >= SHARE * (self.digits > 0).sum()
        )


def parsed(text: str) -> tuple[int, int, str] | None:
    """Return decimals of the last digit, number of significant digits, and digits behind the point; None if
    the text is no finite decimal number."""
    match = NUMBER.fullmatch(text)
    if not match or not (match[1] or match[2]):
        return None
    part = match[2] or ""
    return len(part) - int(match[3] or 0), len((match[1] + part).lstrip("0")), part


def number(text: str) -> float:
    """Return the number of a cell, also with a Fortran exponent such as ``1.5D-03``; NaN for other text."""
    return float(re.sub("[dD]", "e", text)) if parsed(text) else float("nan")


def cells_of(column: Sequence[str]) -> Cells:
    """Return the digits of a column of numbers."""
    rows = [parsed(text) or (0, 0, "") for text in column]
    places, digits, parts = zip(*rows, strict=True)
    has_exponents = all(re.search("[eEdD]", text) for text, row in zip(column, rows, strict=True) if row[1])
    values = np.array([number(text) for text in column])
    return Cells(np.array(places), np.array(digits), parts, values, has_exponents)


def half_units(table: Mapping[str, Sequence[str]]) -> dict[str, np.ndarray]:
    """Return half a unit of the last digit (k,) of each cell as its column's format writes it.

    Parameters
    ----------
    table : mapping of str to sequence of str
        Cells of each column. The column ``time`` does not show the format of other columns.
    """
    columns = {name: cells_of(column) for name, column in table.items()}
    stripped = {n: c for n, c in columns.items() if n != "time" and not c.keeps_zeros}
    table_strips = any(not c.is_regular for c in columns.values())
    longest = _longest(list(stripped.values()))
    halves = {}
    for name, cells in columns.items():
        kept = cells.keeps_zeros or cells.has_one_mantissa or (cells.is_regular and not table_strips)
        own = _longest(list(columns.values())) if name == "time" else cells.longest
        shared = (max(longest[0], own[0]), max(longest[1], own[1]))
        places = cells.shown if kept else cells.full(cells.longest if cells.shows_own_format else shared)
        halves[name] = 0.5 * 10.0 ** -np.clip(places, -EXACT, EXACT).astype(float)
    shows = {n: _evidence_of_single(cells, halves[n]) for n, cells in columns.items()}
    evidence = [found for n, found in shows.items() if n != "time"]
    is_single = min(evidence, default=-np.inf) >= 0.0 and sum(evidence) >= EVIDENCE
    found = {}
    for name, cells in columns.items():
        precision = SINGLE if is_single and shows[name] >= 0.0 else float(np.finfo(float).eps)
        found[name] = halves[name] + precision * np.abs(cells.values)
    return found


def _longest(columns: Sequence[Cells]) -> tuple[int, int]:
    """Return the largest numbers of decimals and of significant digits of several columns."""
    pairs = [cells.longest for cells in columns] or [(0, 0)]
    return max(places for places, _ in pairs), max(digits for _, digits in pairs)


def _evidence_of_single(cells: Cells, half: np.ndarray) -> float:
    """Return the evidence that numbers (k,) have single precision; -inf if one of them has not.

    They are the shortest decimals of single precision numbers, or such numbers lie within ``half`` a unit of
    their last digit. The evidence is minus log10 of the probability that other numbers look so.
    """
    if np.abs(cells.values).max(initial=0.0) > np.finfo(np.float32).max:
        return -np.inf
    singles = cells.values.astype(np.float32)
    written = zip(singles, cells.values.tolist(), strict=True)
    is_shortest = np.array([float(str(single)) == x for single, x in written])
    is_near = np.abs(singles.astype(float) - cells.values) <= TIES * half
    if not (is_near | is_shortest).all():
        return -np.inf
    unit = np.where(is_near, 2 * half, 10.0 ** -np.clip(cells.places, -EXACT, EXACT).astype(float))
    distinct = np.unique(cells.values, return_index=True)[1]
    shows = np.maximum(np.log10(np.spacing(np.abs(singles)) / unit), 0.0) * (cells.digits > 0)
    return float(shows[distinct].sum())
