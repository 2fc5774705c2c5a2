"""Singular positions of a run by Taylor series: their crossing along the requested branches."""

from __future__ import annotations

from collections.abc import Callable
from itertools import repeat
from typing import Any

import numpy as np

from mbref.equations.branches import SMOOTH, Passed
from mbref.stepping.loop import DONE, PAUSED, UNDECIDED
from mbref.stepping.run import Run
from mbref.stepping.singular_start import fits_no_branch, leaving
from mbref.taylor.crossing.departure import Departure
from mbref.taylor.crossing.long_crossing import (
    begin_crossing,
    continue_crossing,
    cross_position,
    end_crossing,
    put_state_along,
)


class BranchFollower:
    """The crossings of one run, along the branches that its limits request.

    ``taylor`` is the memory of the series, ``argument`` its pointer for kernels, and ``expand`` begins a
    series at the present state.
    """

    def __init__(self, run: Run, taylor: Any, argument: Any, expand: Callable[[], int]):
        self._run, self._taylor, self._argument = run, taylor, argument
        self._departure = Departure(run, taylor, expand, self._state_at)
        self._way = leaving(run) if run.times[-1] > 0.0 else None
        self._fits_no_branch = self._way is None and fits_no_branch(run)

    @property
    def begins_at_branches(self) -> bool:
        """Return whether the run starts at a singular position that it can leave."""
        return self._way is not None

    def leave_start(self) -> int:
        """Leave a singular position at t = 0, if any; return PAUSED, DONE, or the failure status."""
        if self._way is None:
            return UNDECIDED if self._fits_no_branch else PAUSED
        begin_crossing(self._argument)
        return self._until_clear(self._departure.from_start(self._way), [])

    def cross(self) -> int:
        """Cross the singular position ahead; return PAUSED when the distance is large enough, DONE at the
        end, or the failure status."""
        return self._until_clear(int(cross_position(self._argument)), [])

    @property
    def leaves_branch(self) -> bool:
        """Return whether the last singular position must be left along another branch, which is not yet
        taken."""
        crossings = self._run.crossings
        return bool(crossings) and crossings[-1].taken != self._asked(len(crossings))

    def take_branch(self) -> int:
        """Continue along the requested branch at the last singular position; return the status as
        ``cross``."""
        crossings = self._run.crossings
        begin_crossing(self._argument)
        taken = [crossings.pop()._replace(taken=self._asked(len(crossings) + 1))]
        return self._until_clear(self._departure.along_branch(taken[0]), taken)

    def record(self) -> None:
        """Add the singular positions crossed since the last request to the crossings of the run."""
        self._run.crossings += self._recorded()

    def _recorded(self) -> list[Passed]:
        """Return the singular positions crossed since the last request, along smooth branches."""
        progress = self._taylor.progress
        count, progress.recorded = int(progress.recorded), 0
        if not count:
            return []
        times, coordinates, velocities = (found[:count].copy() for found in self._taylor.crossings)
        return list(map(Passed, times.tolist(), coordinates, velocities, repeat(SMOOTH)))

    def _asked(self, number: int) -> int:
        """Return the requested branch at a singular position, both counted from 1."""
        return dict(self._run.limits.branches).get(number, SMOOTH)

    def _until_clear(self, status: int, crossed: list[Passed]) -> int:
        """Take high-accuracy steps until no singular position is near, after crossings ``crossed``."""
        counts: Any = self._run.memory.equations.system.counts
        while status in (PAUSED, DONE):
            branch = self._to_branch(crossed)
            if branch is not None:
                counts.crossings = len(self._run.crossings) + len(crossed)
                status = self._departure.along_branch(branch)
            elif status == DONE or self._taylor.distance.is_clear:
                break
            else:
                status = int(continue_crossing(self._argument))
        status = int(end_crossing(status, self._argument))
        if status in (PAUSED, DONE):
            self._run.crossings += crossed
        return status

    def _to_branch(self, crossed: list[Passed]) -> Passed | None:
        """Add the crossings of the last step up to a requested branch; return the latter crossing or None."""
        for passed in self._recorded():
            taken = self._asked(len(self._run.crossings) + len(crossed) + 1)
            crossed.append(passed._replace(taken=taken))
            if taken != SMOOTH:
                return crossed[-1]
        return None

    def _state_at(self, ahead: float) -> tuple[np.ndarray, np.ndarray]:
        """Return coordinates and velocities at a distance (s) from the start of the series."""
        put_state_along(ahead, self._argument)
        state = self._run.memory.state
        return state.coordinates.copy(), state.velocities.copy()
