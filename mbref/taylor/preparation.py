"""Preparation of the series: its kernels, compiled or loaded before the clock of a run starts.

Two processes share the work: one begins with the first kernel, the other one with the last kernel. Neighbours
call common helpers, which each process compiles for itself.
"""

from __future__ import annotations

from mbref.kernels.compilation import prepare_all
from mbref.taylor.advance import advance_series, enter_series
from mbref.taylor.correction import correct_state
from mbref.taylor.crossing.acceptance import pivot_at_turning_point
from mbref.taylor.crossing.detection import contains_singular_position
from mbref.taylor.crossing.determinants import evaluate_gradient, gradient_determinant
from mbref.taylor.crossing.long_crossing import (
    begin_crossing,
    continue_crossing,
    cross_position,
    end_crossing,
    put_state_along,
)
from mbref.taylor.crossing.short_crossing import record_crossings
from mbref.taylor.crossing.start import judge_start
from mbref.taylor.driven import follow_drivers
from mbref.taylor.sample_completion import balance_forces, complete_sample, complete_samples
from mbref.taylor.series import expand_series, expand_with_loads, expand_with_multipliers
from mbref.taylor.solver import respond_in_loops
from mbref.taylor.step_start import choose, choose_partition, return_to_start
from mbref.taylor.stepping import begin_series, expand_from, save_series_without_pole, take_step

KERNELS_OF_SERIES = (
    balance_forces, complete_sample, complete_samples, expand_with_loads, expand_with_multipliers,
    expand_series, correct_state, expand_from, respond_in_loops, choose_partition, choose, return_to_start,
    save_series_without_pole, enter_series, put_state_along, record_crossings, judge_start, begin_series,
    begin_crossing, end_crossing, continue_crossing, cross_position, advance_series, follow_drivers,
    evaluate_gradient, gradient_determinant, contains_singular_position, pivot_at_turning_point, take_step,
)  # fmt: skip


def prepare_series() -> None:
    """Compile the kernels of the series, or load them from the cache of this machine."""
    prepare_all(KERNELS_OF_SERIES)


def prepare_series_backwards() -> None:
    """Compile or load the kernels of the series, from the last one to the first one."""
    prepare_all(KERNELS_OF_SERIES[::-1])
