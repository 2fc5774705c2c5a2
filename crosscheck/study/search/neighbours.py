"""Settings between two neighbours of a family, and coarser than its coarsest setting.

The options in which the settings differ are interpolated by geometric means and extrapolated by equal ratios.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from crosscheck.engine import Setting
from crosscheck.study.grid import Record

STEP = "step"  # name of the option for fixed steps, s; all other options that vary are tolerances
MOST_COARSER = 8  # largest number of tried settings that are coarser than a family's own
LOOSEST = 0.5  # largest tolerance that is tried
DIGITS = 3  # significant digits of the tried options
# fraction of the next finer setting's work; a coarser setting with more work gains nothing
STILL_CHEAPER = 0.97


def between(coarse: Setting, fine: Setting) -> Setting | None:
    """Return the setting half way between two settings of a family.

    None if both settings are too near to each other or differ in no number.
    """
    found = _changed(coarse, fine, lambda a, b: math.sqrt(a * b))
    return None if found in (coarse, fine) else found


def coarser(coarsest: Setting, next_finer: Setting, longest: float) -> Setting | None:
    """Return the setting that is coarser than the coarsest one by the ratio between the coarsest setting and
    the next finer setting, or by less so that its step is ``longest`` (s) or its tolerance LOOSEST.

    None if no step or tolerance grows from the finer to the coarser setting, or if the coarsest setting has
    already the longest step or the loosest tolerance.
    """
    pairs = {n: (coarsest.options[n], next_finer.options.get(n)) for n in coarsest.options}
    grown = {n: math.log(a / b) for n, (a, b) in pairs.items() if _is_ratio(a, b) and a > b}
    room = [math.log((longest if n == STEP else LOOSEST) / coarsest.options[n]) / grown[n] for n in grown]
    share = min(1.0, *room) if grown else 0.0
    if share <= 0.0:
        return None
    found = _changed(coarsest, next_finer, lambda a, b: a * (a / b) ** share)
    return None if found == coarsest else found


def longest_step(times: Sequence[float] | np.ndarray) -> float:
    """Return the longest interval (s) between samples, from 0 on. An engine's steps end at samples, so that
    a setting with a longer step runs with this step."""
    return float(np.diff(np.concatenate([[0.0], np.asarray(times, dtype=float)])).max())


def within(settings: Sequence[Setting], longest: float) -> list[Setting]:
    """Return the settings of a family, coarse to fine, whose steps are at most ``longest`` (s); the
    first of them has this step if coarser settings were left out."""
    kept = [s for s in settings if STEP not in s.options or float(s.options[STEP]) <= longest]
    left_out = settings[: len(settings) - len(kept)]
    if not left_out:
        return kept
    if not kept:
        return [Setting(left_out[-1].family, {**left_out[-1].options, STEP: longest})]
    coarse, fine = (float(setting.options[STEP]) for setting in (left_out[-1], kept[0]))
    share = math.log(longest / fine) / math.log(coarse / fine)
    first = _changed(left_out[-1], kept[0], lambda a, b: b * (a / b) ** share)
    return kept if first is None or first == kept[0] else [first, *kept]


def work(record: Record) -> float:
    """Return the work of a run: its right-hand sides, or its steps, or its CPU seconds, whichever the run
    reports first. Right-hand sides and steps do not depend on the machine.
    """
    cost = record["cost"]
    return float(cost.get("rhs") or cost.get("steps") or cost["seconds"])


def _changed(first: Setting, second: Setting, change: Callable[[float, float], float]) -> Setting | None:
    options = dict(first.options)
    for name in (n for n in options if options[n] != second.options.get(n)):
        pair = options[name], second.options.get(name)
        if not _is_ratio(*pair):
            return None
        options[name] = float(f"{change(*map(float, pair)):.{DIGITS}g}")
    return None if options == dict(first.options) else Setting(first.family, options)


def _is_ratio(first: object, second: object) -> bool:
    return all(isinstance(value, float) and value > 0 for value in (first, second))
