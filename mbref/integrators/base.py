"""Integrator: one step of y' = f(t, y) in the compiled loop."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from mbref.compiled import Exchangeable


@dataclass(frozen=True)
class Integrator:
    """``step(rates, accelerate, t, h, y, y', y_new, memory, tolerances, …) -> error ratio``.

    The kernel writes ``y_new``; its result is the estimated local error over the tolerance (accept up to
    1; a fixed-step method returns 0), or minus the status of an evaluation that failed.  ``memory`` has
    ``rows`` rows of the length of y and is the integrator's own.
    """

    name: str
    order: int
    step: Exchangeable
    rows: int
    adaptive: bool
    options: Mapping[str, float] = field(default_factory=dict)
