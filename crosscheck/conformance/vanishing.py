"""Limits of quantities that vanish in the exact motion: a fixed limit, or the engine's own order and steps.

A quantity of a right engine of low order is larger than the fixed limit, but decreases from one setting to
the next as the motions do. The quantity of a wrong engine stays.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from crosscheck.conformance.trial import Bench, Broken, Finding
from crosscheck.judge.tolerances import COARSEST, OWN_ACCURACY

Measure = Callable[[int], float]


def vanishing(
    bench: Bench, measure: Measure, fixed: float, remark: str = "", where: Callable[[], str] = str
) -> Finding:
    """Return the finding on a quantity, ``measure(0)`` at the finest setting and ``measure(1)`` at the next
    coarser one that completes. ``where`` returns the joint or body at which it is largest, for a remark.

    The quantity may exceed the ``fixed`` limit, up to COARSEST, by what its decrease between the two
    settings leaves at the engine's order of convergence.
    """
    measured = measure(0)
    if measured <= fixed or not math.isfinite(measured) or len(bench.settings) < 2:
        lost = where() if measured > fixed and math.isfinite(measured) else ""
        return Finding(measured, fixed, "; ".join(filter(None, (remark, lost))))
    remark = "; ".join(filter(None, (remark, where())))
    try:
        coarser = measure(1)
    except Broken:
        return Finding(measured, fixed, remark)
    left = OWN_ACCURACY * bench.remaining * (coarser - measured) if math.isfinite(coarser) else 0.0
    also = f"{coarser:.1e} at the coarser setting"
    allowed = max(fixed, min(left, COARSEST))
    return Finding(measured, allowed, f"{remark}; {also}" if remark else also)
