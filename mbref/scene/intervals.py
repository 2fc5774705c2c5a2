"""Intervals of time in which a joint or a coupling constrains the motion."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field

from mbref.scene.fields import SceneEntry, Time, as_list

EVEN_ROUNDING = 1e-15  # difference of times / time, by rounding of evenly spaced samples: a few units
Engagement = Literal["anywhere", "given_pose"]


def _in_order(intervals: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    """Return the intervals; raises ValueError unless each ends after its begin and before the next one."""
    times = [time for interval in intervals for time in interval]
    if any(later <= earlier for earlier, later in pairwise(times)):
        shown = ", ".join(f"[{begin:g}, {end:g}]" for begin, end in intervals)
        raise ValueError(f"must be intervals in order that neither touch nor overlap, got {shown}")
    return intervals


Interval = Annotated[tuple[Time, Time], BeforeValidator(as_list)]
Intervals = Annotated[
    tuple[Interval, ...], Field(min_length=1), BeforeValidator(as_list), AfterValidator(_in_order)
]


class Intermittent(SceneEntry):
    """Fields of a constraint that may come and go.

    ``active`` are intervals [begin, end) of time, s; without them the constraint always holds.  Where it
    begins after t = 0 it holds the relative pose of that moment (``engages = "anywhere"``), or the bodies
    have to be at a relative pose that the file allows (``"given_pose"``).
    """

    active: Intervals | None = None
    engages: Engagement = "anywhere"

    def is_active(self, t: float) -> bool:
        """Return whether the constraint holds from t (s) on."""
        return self.active is None or any(begin <= t < end for begin, end in self.active)


def samples_at(times: np.ndarray, events: Sequence[float]) -> np.ndarray:
    """Return sample times (k,), s, of which one that differs from an event's time by rounding is that time.

    ``np.linspace(0, 0.3, 4)`` has a sample one unit of rounding before 0.1 s.
    """
    found = times.copy()
    for event in set(events) - set(times.tolist()):
        nearest = int(np.abs(times - event).argmin())
        if abs(times[nearest] - event) <= EVEN_ROUNDING * event:
            found[nearest] = event
    return found
