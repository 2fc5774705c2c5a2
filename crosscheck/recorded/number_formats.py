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
EXACT = 300  # decimals of a number that is not rounded
# relative rounding of numbers in single precision: to binary, and again to the shortest decimal number
SINGLE = float(np.finfo(np.float32).eps)


@dataclass(frozen=True)
class Cells:
    """Digits of the cells (k,) of a column.

    ``places`` is the number of decimals of the last digit (negative for tens), ``digits`` the number of
    significant digits (0 for zero), ``parts`` the digits behind the point as text, ``values`` the numbers.
    """

    places: np.ndarray
    digits: np.ndarray
    parts: tuple[str, ...]
    values: np.ndarray

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
    return Cells(np.array(places), np.array(digits), parts, np.array([number(text) for text in column]))


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
    data = [c for n, c in columns.items() if n != "time"]
    is_single = _show_single_precision(data)
    found = {}
    for name, cells in columns.items():
        kept = cells.keeps_zeros or (cells.is_regular and not table_strips)
        own = _longest(list(columns.values())) if name == "time" else cells.longest
        shared = (max(longest[0], own[0]), max(longest[1], own[1]))
        places = cells.shown if kept else cells.full(cells.longest if cells.shows_own_format else shared)
        half = 0.5 * 10.0 ** -np.clip(places, -EXACT, EXACT).astype(float)
        precision = SINGLE if is_single and _is_single(cells.values) else float(np.finfo(float).eps)
        found[name] = half + precision * np.abs(cells.values)
    return found


def _longest(columns: Sequence[Cells]) -> tuple[int, int]:
    """Return the largest numbers of decimals and of significant digits of several columns."""
    pairs = [cells.longest for cells in columns] or [(0, 0)]
    return max(places for places, _ in pairs), max(digits for _, digits in pairs)


def _show_single_precision(columns: Sequence[Cells]) -> bool:
    """Return whether all numbers are single precision numbers, and enough of them have eight or more
    digits."""
    long = {x for cells in columns for x in cells.values[cells.digits >= 8].tolist()}
    return len(long) >= PROVEN and all(_is_single(cells.values) for cells in columns)


def _is_single(values: np.ndarray) -> bool:
    """Return whether numbers (k,) are single precision numbers, or the shortest decimals that stand for
    them."""
    if np.abs(values).max(initial=0.0) > np.finfo(np.float32).max:
        return False
    singles = values.astype(np.float32)
    if (singles.astype(float) == values).all():
        return True
    return all(float(str(single)) == x for single, x in zip(singles, values.tolist(), strict=True))
