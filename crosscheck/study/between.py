"""Settings between two of a family, and coarser than its coarsest: the numbers in which they differ are
continued by geometric means and ratios."""

from __future__ import annotations

import math
from collections.abc import Callable

from crosscheck.engine import Setting
from crosscheck.study.grid import Record

STEP = "step"  # the option of fixed steps, s; the others that vary are tolerances
MOST_COARSER = 8  # settings coarser than a family's own that are tried
LOOSEST = 0.5  # largest tolerance that is tried
DIGITS = 3  # significant digits of the tried options
STILL_CHEAPER = 0.97  # fraction of the next finer setting's work: a coarser setting must cost less


def between(coarse: Setting, fine: Setting) -> Setting | None:
    """The setting half way between two of a family; None where they are too near or differ in no number."""
    found = _changed(coarse, fine, lambda a, b: math.sqrt(a * b))
    return None if found in (coarse, fine) else found


def coarser(coarsest: Setting, next_finer: Setting, longest: float) -> Setting | None:
    """The setting that lies beyond the coarsest of a family by as much as the next finer lies below it.

    None where they differ in no number that grows, as steps and tolerances do, and beyond the ``longest``
    step (s) and the LOOSEST tolerance.
    """
    found = _changed(coarsest, next_finer, lambda a, b: a * a / b)
    if found is None or found == coarsest:
        return None
    changed = [name for name in found.options if found.options[name] != coarsest.options[name]]
    grown = [name for name in changed if found.options[name] > coarsest.options[name]]
    limits = {name: longest if name == STEP else LOOSEST for name in grown}
    return found if grown and all(found.options[name] <= limits[name] for name in grown) else None


def work(record: Record) -> float:
    """The number of right-hand sides of a run, else of its steps, else its CPU seconds: the part of its cost
    that does not depend on the machine, where it has one."""
    cost = record["cost"]
    return float(cost.get("rhs") or cost.get("steps") or cost["seconds"])


def _changed(first: Setting, second: Setting, change: Callable[[float, float], float]) -> Setting | None:
    options = dict(first.options)
    for name in (n for n in options if options[n] != second.options.get(n)):
        pair = options[name], second.options.get(name)
        if not all(isinstance(value, float) and value > 0 for value in pair):
            return None
        options[name] = float(f"{change(*map(float, pair)):.{DIGITS}g}")
    return None if options == dict(first.options) else Setting(first.family, options)
