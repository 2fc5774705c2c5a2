"""Preparation of the series: its kernels, compiled or loaded before the clock of a run starts.

Two processes can share the work: the kernels of ``STEPPING`` take about as long to compile as all other
kernels together.
"""

from __future__ import annotations

from mbref.taylor.advance import advance_series, enter_series
from mbref.taylor.crossing.long_crossing import (
    begin_crossing,
    continue_crossing,
    cross_position,
    end_crossing,
    put_state_along,
)
from mbref.taylor.driven import follow_drivers
from mbref.taylor.sample_completion import complete_samples
from mbref.taylor.series_memory import CALLED
from mbref.taylor.stepping import begin_series, take_step

STEPPING = (take_step, begin_series, advance_series, follow_drivers)
KERNELS_OF_SERIES = tuple(
    dict.fromkeys([
        *CALLED, complete_samples, enter_series, begin_crossing, cross_position, continue_crossing,
        end_crossing, put_state_along, *STEPPING,
    ])
)  # fmt: skip


def prepare_series() -> None:
    """Compile the kernels of the series, or load them from the cache of this machine."""
    for kernel in KERNELS_OF_SERIES:
        kernel.prepare()


def prepare_stepping() -> None:
    """Compile or load the kernels that take steps."""
    for kernel in STEPPING:
        kernel.prepare()


def prepare_expansion() -> None:
    """Compile or load the kernels that expand the series, cross singular positions and complete samples."""
    for kernel in KERNELS_OF_SERIES:
        if kernel not in STEPPING:
            kernel.prepare()
