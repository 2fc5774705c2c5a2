"""Intervals of time, and conditions, in which a joint or a coupling constrains the motion."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo, field_validator

from mbref.scene.conditions import Release, When
from mbref.scene.fields import SceneEntry, Time, as_list

LOCATED = 1e-14  # difference of times / longest time, by rounding of a time that is found as a zero
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

    ``active`` are intervals [begin, end) of time, s, outside of which it never holds. It begins to hold
    where an interval begins, or with ``when`` where a coordinate reaches a value. A reaction ends it by
    ``release``. Where it begins after t = 0 it holds the relative pose of that moment (``engages =
    "anywhere"``), or the bodies have to be at a relative pose that the file allows (``"given_pose"``).
    ``holds_at_start`` states whether it holds at t = 0; the default is to hold, without ``when``.
    """

    active: Intervals | None = None
    when: When | None = None
    release: Release | None = None
    holds_at_start: bool | None = None
    engages: Engagement = "anywhere"

    @field_validator("holds_at_start")
    @classmethod
    def _is_in_an_interval(cls, holds: bool | None, info: ValidationInfo) -> bool | None:
        active = info.data.get("active")
        if holds and active and active[0][0] > 0.0:
            raise ValueError(f"needs an interval from t = 0 on; the first one begins at {active[0][0]:g} s")
        return holds

    @property
    def is_permanent(self) -> bool:
        """Return whether the constraint always holds."""
        return self.active is None and self.when is None and self.release is None

    @property
    def starts_held(self) -> bool:
        """Return whether the constraint holds at t = 0."""
        if self.holds_at_start is not None:
            return self.holds_at_start or self.is_permanent
        return self.when is None and self.is_active(0.0)

    def is_active(self, t: float) -> bool:
        """Return whether the constraint may hold from t (s) on, by its intervals."""
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


def at_sample(times: np.ndarray, event: float) -> float:
    """Return the time (s) of an event that was found as a zero; a sample time, if it differs by rounding."""
    nearest = float(times[np.abs(times - event).argmin()])
    return nearest if abs(nearest - event) <= LOCATED * float(times[-1]) else event
