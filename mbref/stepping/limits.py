"""Limits: options of a run that belong to no part of the method, checked on construction."""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import partial
from typing import Any

from mbref.input_error import InputError
from mbref.scene.fields import LARGEST, SMALLEST, shown

AUTO, GENERIC, GENERATED = "auto", "generic", "generated"
CODES = (AUTO, GENERIC, GENERATED)
FINEST = 1e-16  # least relative tolerance; doubles have no more digits
LARGEST_COUNT = 2**62  # largest count

# field → least and largest value, and whether 0 is allowed, too
INTERVALS = {
    "rtol": (FINEST, 0.99, False),
    "atol": (SMALLEST, LARGEST, False),
    "rank_tolerance": (SMALLEST, 0.99, True),
    "violation": (SMALLEST, LARGEST, False),
    "first_step": (SMALLEST, LARGEST, True),
    "smallest_step": (SMALLEST, LARGEST, True),
    "forced_step": (SMALLEST, LARGEST, True),
    "largest_step": (SMALLEST, LARGEST, True),
    "largest_turn": (SMALLEST, LARGEST, True),
}
COUNTS = {"most_steps": (1, LARGEST_COUNT)}


BranchChoice = Mapping[int, int] | tuple[tuple[int, int], ...]  # crossing → branch, or stored as pairs


@dataclass(frozen=True)
class Limits:
    """Tolerances, steps and code of a run.

    Whatever number is given, the field is a Python float or int: compiled code reads its bytes. Raises
    InputError for a field outside its interval.

    Attributes
    ----------
    rtol : float
        Relative local error of a step; smaller in runs of more than 1000 steps.
    atol : float or None
        Absolute local error (SI units). None: equal to ``rtol``.
    rank_tolerance : float
        Singular value or pivot, relative to the largest one, below which it counts as zero.
    violation : float
        Largest allowed |Φ| (m or rad), times the scene's length if that is over 1 m.
    first_step : float
        Length of the first step, s. 0: chosen by the integrator.
    smallest_step : float
        Shortest step, s. 0: 1e-12 of the duration.
    forced_step : float
        Step, s, that is so short that it is accepted whatever its error estimate. 0: no such step.
    largest_step : float
        Longest step, s, also for fixed steps. 0: the duration.
    largest_turn : float
        Largest rotation of the fastest body in an adaptive step, rad. 0: a safe angle.
    most_steps : int
        Largest number of steps of a run.
    compared : bool
        True to compare a run without projection with a projected run.
    branches : mapping of int to int, or tuple of pairs
        Crossing → branch to take there, both counted from 1. Default: the smooth branch.
    code : {"auto", "generic", "generated"}
        Code of ``taylor``: generic kernels, code generated for the scene, or the faster one.
    """

    rtol: float = 1e-9
    atol: float | None = None
    rank_tolerance: float = 1e-10
    violation: float = 3e-3
    first_step: float = 0.0
    smallest_step: float = 0.0
    forced_step: float = 0.0
    largest_step: float = 0.0
    largest_turn: float = 0.0
    most_steps: int = 5_000_000
    compared: bool = True
    branches: BranchChoice = ()
    code: str = AUTO

    def __post_init__(self) -> None:
        for field in fields(self):
            object.__setattr__(self, field.name, _checked(field.name, getattr(self, field.name)))


def _checked(name: str, value: Any) -> Any:
    if name == "code":
        if value not in CODES:
            raise InputError(f"code: must be one of {', '.join(CODES)}, got {shown(value)}")
        return value
    if name == "compared":
        if not isinstance(value, bool):
            raise InputError(f"compared: must be True or False, got {shown(value)}")
        return value
    if name == "branches":
        return _pairs(value)
    if name in COUNTS:
        return _count(name, value, *COUNTS[name])
    return None if name == "atol" and value is None else _number(name, value, *INTERVALS[name])


def _pairs(value: Any) -> tuple[tuple[int, int], ...]:
    """Return pairs of whole numbers from 1, for a mapping or for pairs."""
    try:
        pairs = value.items() if isinstance(value, Mapping) else value
        counts = partial(_count, "branches", least=1, largest=LARGEST_COUNT)
        return tuple((counts(crossing), counts(branch)) for crossing, branch in pairs)
    except (TypeError, ValueError):
        raise InputError(
            f"branches: must be pairs of a crossing and a branch, counted from 1, got {shown(value)}"
        ) from None


def _number(name: str, value: Any, least: float, largest: float, zero: bool) -> float:
    try:
        number = math.nan if isinstance(value, str | bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not (least <= number <= largest or (zero and number == 0)):
        also = "0 or " if zero else ""
        raise InputError(f"{name}: must be {also}a number from {least:g} to {largest:g}, got {shown(value)}")
    return number


def _count(name: str, value: Any, least: int, largest: int) -> int:
    try:
        count = least - 1 if isinstance(value, bool) else operator.index(value)
    except TypeError:
        count = least - 1
    if not least <= count <= largest:
        raise InputError(f"{name}: must be a whole number from {least} to 2**62, got {shown(value)}")
    return count
