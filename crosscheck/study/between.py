"""Settings between two neighbours of a family, and coarser than its coarsest setting.

The options in which the settings differ are interpolated by geometric means and extrapolated by equal ratios.
"""

from __future__ import annotations

import math
from collections.abc import Callable

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
    the next finer setting.

    None if no step or tolerance grows from the finer to the coarser setting, or if the result exceeds the
    ``longest`` step (s) or the LOOSEST tolerance.
    """
    found = _changed(coarsest, next_finer, lambda a, b: a * a / b)
    if found is None or found == coarsest:
        return None
    changed = [name for name in found.options if found.options[name] != coarsest.options[name]]
    grown = [name for name in changed if found.options[name] > coarsest.options[name]]
    limits = {name: longest if name == STEP else LOOSEST for name in grown}
    return found if grown and all(found.options[name] <= limits[name] for name in grown) else None


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
        if not all(isinstance(value, float) and value > 0 for value in pair):
            return None
        options[name] = float(f"{change(*map(float, pair)):.{DIGITS}g}")
    return None if options == dict(first.options) else Setting(first.family, options)
