"""Run: one simulation in the compiled loop, on the generic kernels or on the scene's own machine code."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mbref.addresses import table_of
from mbref.evaluation import evaluate_all
from mbref.initial import consistent_start, scene_length
from mbref.kinematics import undriven_freedoms
from mbref.march import PAUSED, TIME, march
from mbref.method import Method
from mbref.model import Model
from mbref.problem import NO_PLAN, packed
from mbref.scene import Scene, SceneError
from mbref.singular import KEPT, NEAR, NODES, relative_pivot
from mbref.sparse.chart import CHARTS
from mbref.sparse.least_change import LARGE
from mbref.sparse.moving import moving_entries, moving_primitives
from mbref.sparse.plan import plan_for
from mbref.specialised import MOVING_ONLY, Specialised, Untraceable, specialise
from mbref.stabilisation import PROJECTION
from mbref.stabilisation.base import Stabilisation
from mbref.tables import (
    CHART_PIVOTS,
    COORDINATES,
    FIXED_STEP,
    FORCED_STEP,
    HANDOVER,
    LARGEST_STEP,
    LARGEST_TURN,
    LIVE,
    MOST_STEPS,
    ORDER,
    SIZES,
    SMALLEST_STEP,
    STATE,
    STEPS,
    STEPS_PER_CALL,
    VELOCITIES,
    VIOLATION,
)

CALL = 5_000  # steps between returns to Python, where an interrupt is heard and progress is told
NEAR_CALL = 2  # the same beside a singular position, to see whether it is passed
WORTH_IT = 2_000  # generic steps that take about as long as making the machine code of a scene
AUTO, GENERIC, SPECIALISED = "auto", "generic", "specialised"


@dataclass(frozen=True)
class Limits:
    """Numbers of a run that belong to no part of the method."""

    rtol: float = 1e-9  # local error per step, relative …
    atol: float | None = None  # … and absolute (SI units); None means as rtol
    rank_tolerance: float = 1e-10  # relative; a singular value or pivot below it counts as zero
    violation: float = 3e-3  # largest |Φ| tolerated (m or rad), times the scene's length where over 1 m
    smallest_step: float = 0.0  # s; 0 means a million-millionth of the duration
    forced_step: float = 0.0  # s; a step this short is taken whatever its error estimate; 0: none
    largest_step: float = 0.0  # s; 0 means the duration
    largest_turn: float = 1.0  # rad that the fastest body may turn in an adaptive step
    most_steps: int = 5_000_000
    sparse_above: int = LARGE  # constraint rows; with more, alf-dual goes through a sparse factor
    code: str = AUTO  # GENERIC kernels, SPECIALISED to the scene, or AUTO: specialised after WORTH_IT steps


@dataclass(frozen=True)
class Chart:
    """Which of all coordinates (7 nb), then velocities (6 nb), are y, and by what kernels they advance."""

    columns: np.ndarray
    loop: np.ndarray | tuple  # the first argument of ``march``


class Run:
    """The arrays that ``march`` works on: advance them to the end, then read samples, counts and clock."""

    def __init__(self, scene: Scene, method: Method, times: np.ndarray, limits: Limits):
        self.scene, self.method, self.times, self.limits = scene, method, times, limits
        self.model = model = Model(scene)
        if model.kinematic and undriven_freedoms(scene) > 0:
            raise SceneError(missing_masses(scene))
        self.start = consistent_start(model)
        formulation, stabilisation, integrator = method.parts
        self.plan, ints, floats = NO_PLAN, model.ints, model.floats
        if model.m > limits.sparse_above and formulation.sparse and stabilisation.name in CHARTS:
            stabilisation = CHARTS[stabilisation.name]
            entries = moving_entries(model, self.start.q, self.start.v)
            plan = plan_for(entries, model.entry_columns(), model.n)
            self.plan, self.work = plan.indices, model.workspace(plan.memory, dense=False)
            ints, floats = moving_primitives(model, entries)
        else:
            self.work = model.workspace(formulation.scratch(model.m, model.n))
        self.pivots = np.zeros((5, 2 * (model.m + 7 * model.nb)), dtype=np.int64)
        self.counts = np.zeros(6, dtype=np.int64)
        self.settings = method.settings(limits.rank_tolerance)
        self.clock, self.place = np.zeros(4), np.zeros(2, dtype=np.int64)
        self.control = self._control()
        self.tolerances = np.array([limits.rtol, limits.rtol if limits.atol is None else limits.atol])
        self._pack(ints, floats)
        prepare(method)  # so that the run alone is timed
        self._enter(stabilisation)
        self._allocate(integrator.rows)
        self.generic = self.chart = self._chart(stabilisation, np.arange(13 * model.nb))
        self.own: Specialised | None = None
        self.wants_code = limits.code == AUTO
        self.making = 0.0  # s of CPU time spent on it
        if limits.code == SPECIALISED:
            self._make_code()
            self._choose_chart(PAUSED)

    def _control(self) -> np.ndarray:
        limits, integrator = self.limits, self.method.integrator
        span = float(self.times[-1]) or 1.0
        control = np.zeros(9)
        options = self.method.options_of(integrator)
        control[ORDER] = integrator.highest_order(options)
        control[FIXED_STEP] = 0.0 if integrator.adaptive else options["step"]
        control[SMALLEST_STEP] = limits.smallest_step or 1e-12 * span
        control[FORCED_STEP] = limits.forced_step
        control[LARGEST_STEP] = limits.largest_step or span
        control[LARGEST_TURN] = limits.largest_turn
        control[VIOLATION] = limits.violation * max(1.0, scene_length(self.model))
        control[MOST_STEPS] = limits.most_steps
        control[STEPS_PER_CALL] = CALL
        return control

    def _pack(self, ints: tuple[np.ndarray, ...], floats: tuple[np.ndarray, ...]) -> None:
        self.arrays = (ints, floats, self.work, self.pivots, self.settings, self.counts, self.plan)
        self.problem = packed(*self.arrays)

    def _enter(self, stabilisation: Stabilisation) -> None:
        state, start = self.work[STATE], self.start
        state[COORDINATES] = start.q
        state[VELOCITIES, : start.v.size] = start.v
        self.y = np.zeros(14 * self.model.nb)
        self.pivots[SIZES, 1] = stabilisation.enter.callable(0.0, self.y, self.problem)

    def _allocate(self, rows: int) -> None:
        k, nb, n, m = self.times.size, self.model.nb, self.model.n, self.model.m
        self.y_rate, self.y_new = np.zeros_like(self.y), np.zeros_like(self.y)
        self.memory = np.zeros((rows, self.y.size))
        self.history = np.zeros((KEPT, 2 + 2 * self.y.size))
        self.nodes = np.zeros(NODES, dtype=np.int64)
        self.samples = (np.zeros((k, 7 * nb)), np.zeros((k, n)), np.zeros((k, n)), np.zeros((k, m)))

    def march(self, progress: Callable[[float], None] | None) -> tuple[int, float]:
        """Run to the end; the final status and the process CPU time of the stepping alone (s)."""
        before, began, status = self.making, time.process_time(), PAUSED
        while status in (PAUSED, HANDOVER):
            status = march(self.chart.loop, self.problem)
            self._choose_chart(status)
            if progress is not None:
                progress(float(self.clock[TIME]))
        return status, time.process_time() - began - (self.making - before)

    def _chart(self, kernels: Stabilisation, columns: np.ndarray) -> Chart:
        integrator = self.method.integrator
        functions = (
            integrator.step, integrator.propose, kernels.rates, kernels.observe, kernels.careful,
            kernels.accept, self.method.formulation.accelerate,
        )  # fmt: skip
        arrays = (
            self.times, *self.samples, self.clock, self.control, self.place, self.tolerances, self.y,
            self.y_rate, self.y_new, self.memory, self.history, self.nodes,
        )  # fmt: skip
        return Chart(columns, table_of((*(function.pointer for function in functions), *arrays)))

    def _choose_chart(self, status: int) -> None:
        """The chart to go on with: the scene's own code where there is some, but not where it gave up."""
        if status == HANDOVER:
            self._use(self.generic, NEAR_CALL)
        elif status == PAUSED and self.wants_code and self.counts[STEPS] >= WORTH_IT:
            self.wants_code = False
            with contextlib.suppress(Untraceable):  # then the generic kernels go on
                self._make_code()
        if status == PAUSED and self.own is not None and relative_pivot(self.work) > 2.0 * NEAR:
            if self.own.rank != self.pivots[SIZES, 0]:
                self._make_code()  # the start was singular, the rows chosen there too few
            self._use(self.moving, CALL)

    def _make_code(self) -> None:
        """The machine code of the scene, made or loaded; raises Untraceable."""
        began = time.process_time()
        if self.method.stabilisation is not PROJECTION:
            raise Untraceable(f"{self.method.stabilisation.name} has no machine code of a scene's own")
        if self.plan is not NO_PLAN:
            raise Untraceable(f"{self.model.m} rows are too many")
        state, rank = self.work[STATE], self.pivots[SIZES, 0]
        self.own = specialise(
            self.model, self.method.formulation, self.settings, state[COORDINATES].copy(),
            state[VELOCITIES, : self.model.n].copy(), self.pivots[CHART_PIVOTS, :rank].copy(),
        )  # fmt: skip
        self._pack((*self.model.ints[:LIVE], self.own.live), self.model.floats)
        self.moving = self._chart(MOVING_ONLY, self.own.columns)
        self.making += time.process_time() - began

    def _use(self, chart: Chart, call: int) -> None:
        """Go on with a chart: its entries of the state and of the history that crossings look back on."""
        self.control[STEPS_PER_CALL] = call
        if chart is self.chart:
            return
        state, old, new = self.work[STATE], self.chart.columns, chart.columns
        whole = np.concatenate([state[COORDINATES], state[VELOCITIES, : self.model.n]])
        whole[old] = self.y[: old.size]
        values, rates = np.tile(whole, (KEPT, 1)), np.zeros((KEPT, whole.size))
        values[:, old] = self.history[:, 2 : 2 + old.size]
        rates[:, old] = self.history[:, 2 + old.size : 2 + 2 * old.size]
        self.history[:, 2 : 2 + 2 * new.size] = np.hstack([values[:, new], rates[:, new]])
        self.y[: new.size] = whole[new]
        self.pivots[SIZES, 1] = new.size
        self.memory[:] = 0.0
        self.chart = chart


def missing_masses(scene: Scene) -> list[str]:
    """One fault per body without mass, for a dynamic analysis."""
    return [
        f"body[{b}].mass: {body.name!r} has no mass and inertia, which a dynamic analysis needs"
        for b, body in enumerate(scene.body)
        if body.mass is None
    ]


def prepare(method: Method) -> None:
    """Compile what the method needs, or load it from the cache of this machine."""
    integrator, stabilisation = method.integrator, method.stabilisation
    for kernel in (
        integrator.step, integrator.propose, stabilisation.rates, stabilisation.accept,
        method.formulation.accelerate, march, evaluate_all, stabilisation.enter.callable,
    ):  # fmt: skip
        kernel.prepare()
