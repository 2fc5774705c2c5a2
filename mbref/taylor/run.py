"""A simulation by Taylor series: memory made of the scene's natural coordinates, advanced by own steps."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from mbref.kernels.layout import OK, Counts
from mbref.kernels.named_memory import allocate, packed, record
from mbref.method import Method
from mbref.scene import Scene
from mbref.simulation.limits import GENERIC, SPECIALISED, Limits
from mbref.simulation.run import Run
from mbref.simulation.stepping import DONE, PAUSED, TOO_MANY_STEPS, UNDECIDED
from mbref.specialised import Untraceable
from mbref.taylor.lanes import filled
from mbref.taylor.layout import Progress, Series, Solver, TaylorMemory
from mbref.taylor.natural import NaturalCoordinates
from mbref.taylor.polynomials import polynomials_of
from mbref.taylor.stepping import advance_series, enter, pass_singular_position

TOLERANCE = 1e-14  # of the series that pass singular positions
SERIES = "taylor[order=16]"  # of them: lower orders magnify rounding less
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
        self.natural = NaturalCoordinates(self.model, self.start, moving)
        self.taylor = self._taylor_memory(order)
        self.taylor.progress.order, self.taylor.progress.tolerance = order, tolerance
        self._packed_taylor = packed(self.taylor)

    def _taylor_memory(self, order: int) -> TaylorMemory:
        natural = self.natural
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

    def expand(self) -> int:
        """Expand at the present time and state: OK or why that cannot be."""
        memory, series, nz = self.memory, self.taylor.series, len(self.natural.kept)
        t, state = float(memory.loop.clock.time), memory.state
        values, rates = self.natural.images.at(t, state.coordinates, state.velocities, self.natural.kept)
        series.terms[:2] = 0.0
        series.terms[0, :nz], series.terms[1, :nz] = values, rates
        self.taylor.angles[:] = memory.equations.angles[self.taylor.polynomials.torsions.slot]
        return int(enter(self._packed_taylor.argument))

    def advance(self, progress: Callable[[float], None] | None) -> tuple[int, float]:
        """Run to the end; the final status and the process CPU time of the stepping alone (s)."""
        began = time.process_time()
        status = self.expand()
        status = PAUSED if status == OK else status
        while status == PAUSED:
            status = advance_series(self._packed_taylor.argument)
            if progress is not None:
                progress(float(self.memory.loop.clock.time))
        return status, time.process_time() - began

    def pass_from(self, other: Run) -> int:
        """Take another run's state and time over a singular position, and its samples on the way.

        PAUSED behind it, DONE at the last sample, else why the motion cannot be followed.
        """
        hand_over(other, self)
        self.memory.loop.clock.passage = other.memory.loop.clock.passage
        status = self.expand()
        first = int(self.memory.loop.clock.sample)
        if status == OK:
            status = pass_singular_position(self._packed_taylor.argument)
        last = int(self.memory.loop.clock.sample)
        for mine, theirs in zip(self.memory.loop.samples, other.memory.loop.samples, strict=True):
            theirs[first:last] = mine[first:last]
        hand_over(self, other)
        return int(status)


def hand_over(one: Run, other: Run) -> None:
    """State, time, angles, watch and counts of one run to the other of the same scene and times."""
    source, target = one.memory, other.memory
    target.state.coordinates[:] = source.state.coordinates
    target.state.velocities[:] = source.state.velocities
    target.equations.angles[:] = source.equations.angles
    target.loop.clock.time, target.loop.clock.sample = source.loop.clock.time, source.loop.clock.sample
    target.watch.reference_pivot = source.watch.reference_pivot
    for name in Counts._fields:
        setattr(target.equations.system.counts, name, getattr(source.equations.system.counts, name))


class CrossingRun(Run):
    """One simulation in steps whose passages of singular positions are Taylor series."""

    def __init__(self, scene: Scene, method: Method, times: np.ndarray, limits: Limits):
        super().__init__(scene, method, times, limits)
        self._series: TaylorRun | None = None

    def pass_singular_position(self) -> int:
        """PAUSED behind it, DONE at the end, else UNDECIDED: the motion beside it cannot be followed."""
        memory = self.memory
        y, (coordinates, velocities) = memory.loop.y, memory.active
        memory.state.coordinates[coordinates] = y[: coordinates.size]
        memory.state.velocities[velocities] = y[coordinates.size : memory.loop.clock.y_size]
        if self._series is None:
            limits = replace(self.limits, rtol=TOLERANCE, atol=TOLERANCE, code=GENERIC)
            self._series = TaylorRun(self.scene, Method.parse(SERIES), self.times, limits)
        status = self._series.pass_from(self)
        if status == PAUSED:
            self.enter_state()
        return status if status in (PAUSED, DONE, TOO_MANY_STEPS) else UNDECIDED


def prepare_series() -> None:
    """Compile the kernels of the series, or load them from the cache of this machine."""
    for kernel in (enter, advance_series, pass_singular_position):
        kernel.prepare()
