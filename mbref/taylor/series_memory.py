"""Memory of a Taylor series for a run: pooled, with the equations of its scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mbref.equations.branches import SMOOTH
from mbref.kernels.memory_pool import Pooled, acquire, arrays_in, copied, fill
from mbref.kernels.named_memory import allocate
from mbref.stepping.run import Run
from mbref.taylor.correction import correct_state
from mbref.taylor.crossing.acceptance import pivot_at_turning_point
from mbref.taylor.crossing.detection import contains_singular_position
from mbref.taylor.crossing.determinants import evaluate_gradient, gradient_determinant
from mbref.taylor.crossing.start import judge_start
from mbref.taylor.crossing.steps_across import record_crossings
from mbref.taylor.layout import Series, SeriesKernels, TaylorMemory
from mbref.taylor.loads import varies
from mbref.taylor.polynomial_layout import Polynomials
from mbref.taylor.polynomials import Geometry
from mbref.taylor.sample_completion import balance_forces, complete_sample
from mbref.taylor.series import (
    expand_series,
    expand_with_loads,
    expand_with_multipliers,
    expand_without_loads,
)
from mbref.taylor.simd import padded_size
from mbref.taylor.solver import respond_in_loops
from mbref.taylor.step_start import choose, choose_partition, return_to_start
from mbref.taylor.stepping import begin_series, expand_from, save_series_without_pole, take_step

KEPT = 16  # singular positions that a call can record
CALLED = (  # the SeriesKernels after ``orders``
    balance_forces, complete_sample, expand_with_multipliers, expand_series, correct_state,
    expand_from, respond_in_loops, choose_partition, choose, return_to_start, save_series_without_pole,
    record_crossings, judge_start, begin_series, evaluate_gradient, gradient_determinant,
    contains_singular_position, pivot_at_turning_point, take_step,
)  # fmt: skip


def acquire_memory(run: Run, geometry: Geometry, polynomials: Polynomials, order: int) -> Pooled:
    """Return memory of the series of a run, up to an order, with its equations."""
    natural = geometry.natural
    nz, ng, nr = len(natural.kept), len(natural.given), len(natural.rows)
    sizes = {
        "orders": order + 1, "nz": nz, "ng": ng, "nr": nr,
        "lanes": padded_size(max(1, nz + nr + ng)), "slots": polynomials.products.left.size,
        "twofold": polynomials.rows.row.size, "kept": KEPT, "k": run.times.size,
        "springs": polynomials.springs.natural.size, "torsions": polynomials.torsions.slot.size,
        "slides": polynomials.slides.function.size, "timed": polynomials.timed.function.size,
        **run.model.sizes,
    }  # fmt: skip
    # memory for one scene fits all scenes whose equations have equal shapes
    numbers = arrays_in((polynomials, geometry.pose_maps, geometry.tableau))
    key = (TaylorMemory, *sizes.values(), *(each.shape for each in numbers), run.limits.branches)
    memory = acquire(key, lambda: _allocate(run, geometry, polynomials, sizes), run.pooled)
    _put(memory.values, numbers)
    return memory


def _allocate(
    run: Run, geometry: Geometry, polynomials: Polynomials, sizes: Mapping[str, int]
) -> TaylorMemory:
    """Return memory of the series without the numbers of a run."""
    count, nz, nr = sizes["orders"], sizes["nz"], sizes["nr"]
    series = allocate(Series, sizes)
    grown = np.arange(1.0, count + 1) * np.arange(2.0, count + 2)
    series.scale[:, :nz], series.scale[:, nz : nz + nr] = -1.0 / grown[:, None], -1.0
    series.growth[:], series.growth[:, nz : nz + nr] = 1.0, grown[:, None]
    series.variable[:nz] = 1.0
    orders = expand_with_loads if varies(polynomials) else expand_without_loads
    switches = [k for k, taken in dict(run.limits.branches).items() if taken != SMOOTH]
    return allocate(
        TaylorMemory,
        sizes,
        run=run.memory,
        polynomials=copied(polynomials),
        pose_maps=copied(geometry.pose_maps),
        series=series,
        kernels=SeriesKernels(*(kernel.pointer for kernel in (orders, *CALLED))),
        branch_switches=np.array(switches, np.int64),
    )


def put_equations(memory: TaylorMemory, geometry: Geometry, polynomials: Polynomials) -> None:
    """Put the equations of a scene into memory."""
    _put(memory, arrays_in((polynomials, geometry.pose_maps, geometry.tableau)))


def _put(memory: TaylorMemory, equations: Sequence[np.ndarray]) -> None:
    """Put the arrays of equations into memory."""
    fill((memory.polynomials, memory.pose_maps, memory.solver.linear, memory.solver.place), equations)
