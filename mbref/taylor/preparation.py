"""Preparation of the series: its kernels, compiled or loaded before the clock of a run starts.

Two processes share the work: one begins with the first kernel, the other one with the last kernel. Neighbours
call common helpers, which each process compiles for itself. The first run whose motion drivers prescribe
compiles ``driven.follow_drivers``, which takes long.
"""

from __future__ import annotations

import functools

from mbref.kernels.compilation import prepare_all
from mbref.method import SERIES_METHOD
from mbref.taylor.crossing.steps_across import (
    begin_crossing,
    continue_crossing,
    cross_position,
    end_crossing,
    put_state_along,
)
from mbref.taylor.sample_completion import complete_samples
from mbref.taylor.series_memory import CALLED
from mbref.taylor.stepping import advance_series, enter_series

FROM_PYTHON = (
    complete_samples, enter_series, put_state_along, begin_crossing, end_crossing, continue_crossing,
    cross_position, advance_series,
)  # fmt: skip
MIDDLE = len(CALLED) // 2
KERNELS_OF_SERIES = *CALLED[:MIDDLE], *FROM_PYTHON, *CALLED[MIDDLE:]


@functools.cache
def prepare_series() -> None:
    """Compile the kernels of the series, or load them from the cache of this machine."""
    prepare_all(KERNELS_OF_SERIES, SERIES_METHOD)


def prepare_series_backwards() -> None:
    """Compile or load the kernels of the series, from the last one to the first one."""
    prepare_all(KERNELS_OF_SERIES[::-1], SERIES_METHOD)
