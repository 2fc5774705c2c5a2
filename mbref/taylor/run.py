"""A simulation by Taylor series: memory made of the scene's natural coordinates, advanced by own steps."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from mbref.kernels.layout import OK
from mbref.kernels.named_memory import allocate, packed, record
from mbref.method import Method
from mbref.scene import Scene
from mbref.simulation.limits import SPECIALISED, Limits
from mbref.simulation.run import Run
from mbref.simulation.stepping import PAUSED
from mbref.specialised import Untraceable
from mbref.taylor.lanes import filled
from mbref.taylor.layout import Progress, Series, Solver, TaylorMemory
from mbref.taylor.natural import NaturalCoordinates
from mbref.taylor.polynomials import polynomials_of
from mbref.taylor.stepping import advance_series, enter

NO_CODE = "its series are made by one code for every scene"
LEAST_ORDER, MOST_ORDER = 4, 30
ORDERS_PER_DIGIT, FIRST_ORDER = 1.2, 6.0  # of the order that costs least


def order_of(tolerance: float, wanted: float) -> int:
    """The order of the series: the one wanted, or for 0 by the tolerance; ValueError outside 4 to 30."""
    if wanted == 0:
        best = 2 * round((FIRST_ORDER - ORDERS_PER_DIGIT * np.log10(tolerance)) / 2)
        return int(np.clip(best, LEAST_ORDER, MOST_ORDER))
    if wanted not in range(LEAST_ORDER, MOST_ORDER + 1):
        raise ValueError(f"taylor: order must be {LEAST_ORDER} to {MOST_ORDER}, got {wanted:g}")
    return int(wanted)


class TaylorRun(Run):
    """One simulation by Taylor series; the memory of the general kernels takes its samples."""

    def __init__(self, scene: Scene, method: Method, times: np.ndarray, limits: Limits):
        if limits.code == SPECIALISED:
            raise Untraceable(NO_CODE)
        super().__init__(scene, method, times, limits)
        prepare_series()
        control = self.memory.control
        tolerance = 0.5 * (control.rtol + control.atol)
        order = order_of(tolerance, method.options_of(method.integrator)["order"])
        moving = np.zeros(self.model.n, dtype=bool)
        moving[self.part.active.velocities] = True
        natural = NaturalCoordinates(self.model, self.start, moving)
        self.taylor = self._taylor_memory(natural, order)
        self.taylor.progress.order, self.taylor.progress.tolerance = order, tolerance
        self._packed_taylor = packed(self.taylor)

    def _taylor_memory(self, natural: NaturalCoordinates, order: int) -> TaylorMemory:
        orders, nz, ng, nr = order + 1, len(natural.kept), len(natural.given), len(natural.rows)
        polynomials = polynomials_of(natural, orders)
        sizes = {
            "orders": orders, "nz": nz, "ng": ng, "nr": nr, "nb": self.model.nb,
            "lanes": filled(max(1, nz + nr + ng)), "slots": polynomials.products.left.size,
            "twofold": polynomials.rows.row.size,
            "torsions": polynomials.torsions.slot.size,
        }  # fmt: skip
        series = allocate(Series, sizes)
        grown = np.arange(1.0, orders + 1) * np.arange(2.0, orders + 2)
        series.scale[:, :nz], series.scale[:, nz : nz + nr] = -1.0 / grown[:, None], -1.0
        series.growth[:], series.growth[:, nz : nz + nr] = 1.0, grown[:, None]
        series.variable[:nz] = 1.0
        series.terms[0, :nz] = [natural.start[v] for v in natural.kept]
        series.terms[1, :nz] = [natural.rate[v] for v in natural.kept]
        return TaylorMemory(
            run=self.memory,
            polynomials=polynomials,
            series=series,
            solver=allocate(Solver, sizes),
            progress=record(Progress()),
            state=np.zeros((3, sizes["lanes"])),
            pose=np.zeros((3, 12 * self.model.nb)),
            angles=np.zeros(polynomials.torsions.slot.size),
        )

    def advance(self, progress: Callable[[float], None] | None) -> tuple[int, float]:
        """Run to the end; the final status and the process CPU time of the stepping alone (s)."""
        began = time.process_time()
        status = enter(self._packed_taylor.argument)
        status = PAUSED if status == OK else status
        while status == PAUSED:
            status = advance_series(self._packed_taylor.argument)
            if progress is not None:
                progress(float(self.memory.loop.clock.time))
        return status, time.process_time() - began


def prepare_series() -> None:
    """Compile the kernels of the series, or load them from the cache of this machine."""
    for kernel in (enter, advance_series):
        kernel.prepare()
