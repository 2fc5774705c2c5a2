"""A simulation in Taylor series: memory made of the scene's natural coordinates, and its steps."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Hashable, Mapping
from dataclasses import replace
from itertools import repeat

import numpy as np

from mbref.equations.branches import SMOOTH, Passed
from mbref.equations.initial_state import Start
from mbref.equations.model import Model
from mbref.kernels.lent_memory import Lent, copied, fill, lent, shapes_of, take_back
from mbref.kernels.machine_code import NoGeneratedCode
from mbref.kernels.named_memory import Packed, allocate
from mbref.method import Method
from mbref.scene import Scene
from mbref.simulation.limits import AUTO, GENERATED, GENERIC, Limits
from mbref.simulation.run import Run
from mbref.simulation.stepping import PAUSED
from mbref.taylor.advance import advance_series, enter
from mbref.taylor.driven import follow_drivers
from mbref.taylor.geometry import geometry_of
from mbref.taylor.layout import (
    Polynomials,
    Series,
    SeriesKernels,
    TaylorMemory,
)
from mbref.taylor.passing import (
    SHARE,
    advance_over,
    begin_here,
    cross,
    give_back,
    look_along,
    pass_on,
    take_over,
)
from mbref.taylor.polynomials import Geometry
from mbref.taylor.samples import complete_samples
from mbref.taylor.simd import padded_size
from mbref.taylor.start import OFF
from mbref.taylor.stepping import begin, expand_from, step
from mbref.taylor.twin import LEAST_CHANGE

EXACT, EXACT_ORDER = 1e-13, 22  # rtol and atol of steps that pass singular positions, and their least order
KEPT = 16  # singular positions that are passed in a call
CALLED = (begin, expand_from, step)  # the SeriesKernels
KERNELS_OF_SERIES = (
    *CALLED, enter, advance_series, follow_drivers, complete_samples, advance_over, take_over, begin_here,
    cross, pass_on, give_back, look_along,
)  # fmt: skip
ROUNDING = 1e-16  # of a singular value
STEPS_WORTH_CODE = 20_000  # steps ahead from which on generated code saves more time than it takes
LEAST_ORDER, MOST_ORDER = 4, 30
CHEAPEST = {GENERIC: (6.0, 1.2), GENERATED: (7.0, 1.6)}  # order: at a tolerance of 1, and more per digit


def order_of(tolerance: float, wanted: float, code: str) -> int:
    """The order of the series: the one wanted, or for 0 the cheapest; ValueError outside 4 to 30."""
    if wanted == 0:
        first, per_digit = CHEAPEST[code]
        best = 2 * round((first - per_digit * np.log10(tolerance)) / 2)
        return int(min(max(best, LEAST_ORDER), MOST_ORDER))
    if wanted not in range(LEAST_ORDER, MOST_ORDER + 1):
        raise ValueError(f"taylor: order must be {LEAST_ORDER} to {MOST_ORDER}, got {wanted:g}")
    return int(wanted)


class SeriesRun(Run):
    """The steps of one simulation in Taylor series; the memory of the general kernels takes its samples.

    ``strides`` says whether drivers alone are followed (``mbref.taylor.driven``), ``most_waiting`` how many
    samples may wait for accelerations and multipliers until steps of a call have ended.
    """

    strides, most_waiting = False, 0

    def __init__(self, scene: Scene, method: Method, times: np.ndarray, limits: Limits):
        super().__init__(scene, method, times, replace(limits, code=GENERIC))
        self.memory.equations.system.settings.independent = True  # at samples, where states are exact
        self._decide_rank()
        prepare_series()
        self.is_driven = self.ranks.rank == self.memory.active.velocities.size and not self.model.has_angles
        tolerance, order = self._tolerance_and_order(limits)
        self.geometry, self.polynomials = self._equations()
        exact_order = max(order, EXACT_ORDER) if self.model.closed_loops else order
        self._lent_series = self._lend_series(exact_order)
        self.taylor, self._packed_taylor = self._lent_series.values, self._lent_series.packed
        progress = self.taylor.progress
        progress.order, progress.tolerance = order, tolerance
        progress.usual_order, progress.usual = order, tolerance
        progress.exact_order, progress.exact = exact_order, SHARE * (EXACT + EXACT)
        progress.change = max(self.memory.control.rtol, LEAST_CHANGE)
        progress.end = self.times[-1]
        progress.farthest = OFF * max(1.0, self.model.length)
        progress.striding = self.strides
        progress.freedoms = self.memory.active.velocities.size - self.ranks.rank
        self.wants_code = limits.code == AUTO
        if limits.code == GENERATED:
            self._put_code()

    def _tolerance_and_order(self, limits: Limits) -> tuple[float, int]:
        """Of the steps of the series."""
        control, method = self.memory.control, self.method
        tolerance = SHARE * (control.rtol + control.atol)
        code = GENERATED if limits.code == GENERATED else GENERIC
        return tolerance, order_of(tolerance, method.options_of(method.integrator)["order"], code)

    def _decide_rank(self) -> None:
        """Have the elimination count as many rows as independent as singular values do at the start."""
        settings, (_, least, rounding) = self.memory.equations.system.settings, self.ranks
        if settings.nearly_dependent:
            settings.rank_tolerance = (least * max(rounding, ROUNDING)) ** 0.5

    def _equations(self) -> tuple[Geometry, Polynomials]:
        """The scene in natural coordinates, and its equations in them."""
        return self.equations_of(self.model, self.start)

    def equations_of(self, model: Model, start: Start) -> tuple[Geometry, Polynomials]:
        """Those of a scene that differs from this one in numbers alone, from its start."""
        moving = np.zeros(model.n, dtype=bool)
        moving[self.memory.active.velocities] = True
        geometry = geometry_of(model, start, moving, self.strides)
        return geometry, geometry.polynomials(model)

    @property
    def packed_series(self) -> Packed:
        """The memory of the series for kernels."""
        return self._packed_taylor

    def give_back(self) -> None:
        """Leave the memory to the next run; this one cannot be read any more."""
        take_back(self._lent_series)
        super().give_back()

    def _lend_series(self, order: int) -> Lent:
        """Memory of the series with the numbers of this run."""
        natural, polynomials = self.geometry.natural, self.polynomials
        nz, ng, nr = len(natural.kept), len(natural.given), len(natural.rows)
        sizes = {
            "orders": order + 1, "nz": nz, "ng": ng, "nr": nr,
            "lanes": padded_size(max(1, nz + nr + ng)), "slots": polynomials.products.left.size,
            "twofold": polynomials.rows.row.size, "kept": KEPT,
            "waiting": min(self.times.size, self.most_waiting),
            "springs": polynomials.springs.natural.size, "torsions": polynomials.torsions.slot.size,
            **self.model.sizes,
        }  # fmt: skip
        shapes = shapes_of_equations(self.geometry, polynomials)
        key = (TaylorMemory, *sizes.values(), shapes, self.limits.branches)
        memory = lent(key, lambda: self._allocate_series(sizes), self._lent)
        put_equations(memory.values, self.geometry, polynomials)
        return memory

    def _allocate_series(self, sizes: Mapping[str, int]) -> TaylorMemory:
        """Memory of the series, ready but for numbers."""
        orders, nz, nr = sizes["orders"], sizes["nz"], sizes["nr"]
        series = allocate(Series, sizes)
        grown = np.arange(1.0, orders + 1) * np.arange(2.0, orders + 2)
        series.scale[:, :nz], series.scale[:, nz : nz + nr] = -1.0 / grown[:, None], -1.0
        series.growth[:], series.growth[:, nz : nz + nr] = 1.0, grown[:, None]
        series.variable[:nz] = 1.0
        parting = [k for k, taken in dict(self.limits.branches).items() if taken != SMOOTH]
        return allocate(
            TaylorMemory,
            sizes,
            run=self.memory,
            polynomials=copied(self.polynomials),
            pose_maps=copied(self.geometry.pose_maps),
            series=series,
            kernels=SeriesKernels(*(kernel.pointer for kernel in CALLED)),
            parting=np.array(parting, np.int64),
        )

    def generate_where_it_pays(self, status: int) -> None:
        """Go on with generated code where many steps are ahead of a run that is PAUSED."""
        if self.wants_code and status == PAUSED and self._steps_ahead() >= STEPS_WORTH_CODE:
            self.wants_code = False
            with contextlib.suppress(NoGeneratedCode):  # then the generic kernels go on
                self._put_code()

    def _steps_ahead(self) -> float:
        """Steps to the end at the pace so far, or to the limit of steps."""
        taken, reached = self.memory.equations.system.counts.steps, self.memory.loop.clock.time
        return min(taken * (self.times[-1] / reached - 1.0), self.limits.most_steps - taken)

    def _put_code(self) -> None:
        """Expand the series by generated code from now on; raises NoGeneratedCode where there is none."""
        began = time.process_time()
        try:
            from mbref.taylor.generated.build import put_code  # optional, and not needed by most runs
        except ModuleNotFoundError:
            raise NoGeneratedCode("the subpackage mbref.taylor.generated is not installed") from None
        self._code = put_code(self.taylor)
        self.making += time.process_time() - began

    def expand(self) -> int:
        """Expand at the present time and state, for steps until the end: OK or why that cannot be."""
        self.taylor.progress.end = self.times[-1]
        return int(enter(self._packed_taylor.argument))

    def step_on(self) -> int:
        """As many steps as are taken at a time: PAUSED after them, DONE at the end, or why there are none."""
        return int(advance_series(self._packed_taylor.argument))

    def recorded(self) -> list[Passed]:
        """The singular positions passed since they were last asked for, along smooth branches."""
        progress = self.taylor.progress
        passed, progress.passed = int(progress.passed), 0
        if not passed:
            return []
        times, coordinates, velocities = (found[:passed].copy() for found in self.taylor.crossings)
        return list(map(Passed, times.tolist(), coordinates, velocities, repeat(SMOOTH)))

    def least_pivot(self) -> float:
        """The least pivot of the rows where the series begins; 1 without rows."""
        return float(np.abs(self.taylor.solver.last[: int(self.taylor.progress.rank)]).min(initial=1.0))


def shapes_of_equations(geometry: Geometry, polynomials: Polynomials) -> Hashable:
    """The shapes of the equations of a scene: all of them have room in memory that is made for one."""
    return shapes_of((polynomials, geometry.pose_maps, geometry.tableau))


def put_equations(memory: TaylorMemory, geometry: Geometry, polynomials: Polynomials) -> None:
    """Have memory of series hold the equations of a scene."""
    fill(memory.polynomials, polynomials)
    fill(memory.pose_maps, geometry.pose_maps)
    memory.solver.linear[:], memory.solver.place[:] = geometry.tableau


def prepare_series() -> None:
    """Compile the kernels of the series, or load them from the cache of this machine."""
    for kernel in KERNELS_OF_SERIES:
        kernel.prepare()
