"""Preparation of the series: its kernels, compiled or loaded before the clock of a run starts.

Two processes share the work: one begins with the first kernel, the other one with the last kernel. Neighbours
call common helpers, which each process compiles for itself. Scenes without loads and couplings need no
``series.expand_with_loads``. The first run whose motion drivers prescribe compiles ``driven.follow_drivers``.
Both take long.
"""

from __future__ import annotations

import functools

from mbref.kernels.compilation import Exchangeable, prepare_all
from mbref.method import SERIES_METHOD
from mbref.scene import Scene
from mbref.taylor.crossing.steps_across import (
    begin_crossing,
    continue_crossing,
    cross_position,
    end_crossing,
    put_state_along,
)
from mbref.taylor.sample_completion import complete_samples
from mbref.taylor.series import expand_with_loads, expand_without_loads
from mbref.taylor.series_memory import CALLED
from mbref.taylor.stepping import advance_series, enter_series

FROM_PYTHON = (
    complete_samples, enter_series, put_state_along, begin_crossing, end_crossing, continue_crossing,
    cross_position, advance_series,
)  # fmt: skip
MIDDLE = len(CALLED) // 2
IN_EVERY_RUN = *CALLED[:MIDDLE], *FROM_PYTHON, *CALLED[MIDDLE:], expand_without_loads


def kernels_of_series(scene: Scene | None = None) -> tuple[Exchangeable, ...]:
    """Return the kernels that runs of a scene, or of every scene, call."""
    return _kernels(_may_vary(scene))


def prepare_series(scene: Scene | None = None) -> None:
    """Compile the kernels of the series, or load them from the cache of this machine."""
    _prepare(_may_vary(scene))


def _may_vary(scene: Scene | None) -> bool:
    """Return whether a scene, or any scene, may have loads that vary."""
    return scene is None or bool(scene.load or scene.coupling)


def _kernels(has_loads: bool) -> tuple[Exchangeable, ...]:
    return (expand_with_loads, *IN_EVERY_RUN) if has_loads else IN_EVERY_RUN


@functools.cache
def _prepare(has_loads: bool) -> None:
    """Prepare the kernels once: each run asks for them, and a flag is compared faster than all kernels."""
    prepare_all(_kernels(has_loads), SERIES_METHOD)


def prepare_series_backwards() -> None:
    """Compile or load the kernels of every run, from the last one to the first one."""
    prepare_all(IN_EVERY_RUN[::-1], SERIES_METHOD)
