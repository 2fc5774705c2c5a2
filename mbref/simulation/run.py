"""Run: one simulation in the compiled loop, on the generic kernels or on the scene's own machine code."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable

import numpy as np

from mbref.equations.active_coordinates import (
    moving_coordinates,
    moving_entries,
    moving_primitives,
    without_rounding,
)
from mbref.equations.degrees_of_freedom import undriven_freedoms
from mbref.equations.evaluation import evaluate_all
from mbref.equations.initial_state import consistent_start, scene_length
from mbref.equations.loads import has_angles
from mbref.equations.model import Model
from mbref.equations.static_constraints import at_rest, held_by_rows
from mbref.kernels.arguments import NO_PLAN, packed
from mbref.kernels.layout import (
    COORDINATES,
    FIRST_STEP,
    FIXED_STEP,
    FORCED_STEP,
    LARGEST_STEP,
    LARGEST_TURN,
    LIVE,
    LOADS,
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
from mbref.kernels.pointer_table import table_of
from mbref.linear_algebra.symbolic_factorisation import COLUMN, plan_for
from mbref.scene import Scene, SceneError
from mbref.simulation.limits import AUTO, SPECIALISED, Limits
from mbref.simulation.method import Method
from mbref.simulation.singular_crossing import KEPT, NODES
from mbref.simulation.stepping import PAUSED, TIME, march
from mbref.specialised import Part, Specialised, Untraceable, specialise, with_own_code
from mbref.stabilisation import PROJECTION
from mbref.stabilisation.base import Stabilisation
from mbref.stabilisation.sparse_chart import CHARTS

CALL = 5_000  # steps between returns to Python, where an interrupt is heard and progress is told
WORTH_IT = 20_000  # steps ahead from which on machine code of the scene's own saves what making it takes
UNWRAPPED = 1.0  # rad that a body may turn in a step where springs wind up: two turn less than π apart


class Run:
    """The arrays that ``march`` works on: advance them to the end, then read samples, counts and clock."""

    def __init__(self, scene: Scene, method: Method, times: np.ndarray, limits: Limits):
        self.scene, self.method, self.times, self.limits = scene, method, times, limits
        self.model = model = Model(scene)
        self._check_freedoms()
        self.start = consistent_start(model)
        self.chart, self.sparse = chart_of(method, model.m > limits.sparse_above)
        ints, floats, memory = self._what_moves()
        self.work = model.workspace(memory, dense=not self.sparse)
        self.pivots = np.zeros((5, 2 * (model.m + 7 * model.nb)), dtype=np.int64)
        self.counts = np.zeros(6, dtype=np.int64)
        self.settings = method.settings(limits.rank_tolerance)
        self.clock, self.place = np.zeros(4), np.zeros(2, dtype=np.int64)
        self.control = self._control()
        self.tolerances = np.array([limits.rtol, limits.rtol if limits.atol is None else limits.atol])
        self._pack(ints, floats)
        prepare(method, self.chart)  # so that the run alone is timed
        self._enter()
        self._allocate(method.integrator.rows)
        self.loop = self._table(self.chart)
        self.own: Specialised | None = None
        self.wants_code = limits.code == AUTO
        self.making = 0.0  # s of CPU time spent on it
        if limits.code == SPECIALISED:
            self._make_code()

    def _check_freedoms(self) -> None:
        """SceneError where bodies without mass, or a method that does not integrate, leave a freedom."""
        integrates = self.method.integrator.integrates
        freedoms = undriven_freedoms(self.scene) if self.model.kinematic or not integrates else 0
        if freedoms > 0 and not integrates:
            fault = (
                f"driver: {freedoms} degrees of freedom are left; a kinematic analysis prescribes them all"
            )
            raise SceneError([fault])
        if freedoms > 0:
            raise SceneError(missing_masses(self.scene))

    def _what_moves(self) -> tuple[tuple, tuple, int]:
        """Choose ``plan`` and, of a projection, ``moving``; the ``ints`` and ``floats`` needed, scratch."""
        model, formulation = self.model, self.method.formulation
        ints, floats, self.plan = model.ints, model.floats, NO_PLAN
        memory = 0 if self.sparse else formulation.scratch(model.m, model.n)
        projected = self.method.stabilisation is PROJECTION
        if self.sparse or projected:
            self.start = without_rounding(model, self.start)
            moving, entries = moving_entries(model, self.start.q, self.start.v)
            held, entries = held_by_rows(model, self.start, moving, entries)
            plan = plan_for(moving, entries, model.entry_columns(), held)
            self.start = at_rest(self.start, held)
            self.plan, memory = plan.indices, max(memory, plan.memory)
        if self.sparse:
            ints, floats = moving_primitives(model, entries)
        if projected:
            self.moving = Part.of(plan, moving_coordinates(self.start.q, plan.part(COLUMN)))
            ints = (*ints[:LIVE], model.entries(self.moving.coordinates, self.moving.velocities))
        return ints, floats, memory

    def _control(self) -> np.ndarray:
        limits, integrator = self.limits, self.method.integrator
        span = float(self.times[-1]) or 1.0
        control = np.zeros(10)
        options = self.method.options_of(integrator)
        control[ORDER] = integrator.highest_order(options)
        control[FIXED_STEP] = 0.0 if integrator.adaptive else options["step"]
        control[SMALLEST_STEP] = limits.smallest_step or 1e-12 * span
        control[FORCED_STEP] = limits.forced_step
        control[FIRST_STEP] = limits.first_step
        control[LARGEST_STEP] = limits.largest_step or span
        turn = UNWRAPPED if has_angles(self.model.ints[LOADS]) else self.method.stabilisation.largest_turn
        control[LARGEST_TURN] = limits.largest_turn or turn
        control[VIOLATION] = limits.violation * max(1.0, scene_length(self.model))
        control[MOST_STEPS] = limits.most_steps
        control[STEPS_PER_CALL] = CALL
        return control

    def _pack(self, ints: tuple[np.ndarray, ...], floats: tuple[np.ndarray, ...]) -> None:
        self.arrays = (ints, floats, self.work, self.pivots, self.settings, self.counts, self.plan)
        self.problem = packed(*self.arrays)

    def _enter(self) -> None:
        state, start = self.work[STATE], self.start
        state[COORDINATES] = start.q
        state[VELOCITIES, : start.v.size] = start.v
        self.y = np.zeros(14 * self.model.nb)
        self.pivots[SIZES, 1] = self.chart.enter.callable(0.0, self.y, self.problem)

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
        while status == PAUSED:
            status = march(self.loop, self.problem)
            if self.wants_code and status == PAUSED and self._steps_ahead() >= WORTH_IT:
                self.wants_code = False
                with contextlib.suppress(Untraceable):  # then the generic kernels go on
                    self._make_code()
            if progress is not None:
                progress(float(self.clock[TIME]))
        return status, time.process_time() - began - (self.making - before)

    def _steps_ahead(self) -> float:
        """Steps to the end at the pace so far, or to the limit of steps."""
        taken = self.counts[STEPS]
        return min(taken * (self.times[-1] / self.clock[TIME] - 1.0), self.control[MOST_STEPS] - taken)

    def _table(self, chart: Stabilisation) -> np.ndarray | tuple:
        """The first argument of ``march``."""
        integrator = self.method.integrator
        functions = (
            integrator.step, integrator.propose, chart.rates, chart.observe, chart.careful, chart.accept,
            self.method.formulation.accelerate,
        )  # fmt: skip
        arrays = (
            self.times, *self.samples, self.clock, self.control, self.place, self.tolerances, self.y,
            self.y_rate, self.y_new, self.memory, self.history, self.nodes,
        )  # fmt: skip
        return table_of((*(function.pointer for function in functions), *arrays))

    def _make_code(self) -> None:
        """Go on with machine code of the scene, made or loaded; raises Untraceable."""
        began = time.process_time()
        if self.method.stabilisation is not PROJECTION:
            raise Untraceable(f"{self.method.stabilisation.name} has no machine code of a scene's own")
        self.own = specialise(
            self.model, self.method.formulation, self.settings, self.start.q, self.start.v, self.moving
        )
        self._pack((*self.arrays[0][:LIVE], self.own.live), self.arrays[1])
        self.loop = self._table(with_own_code(self.chart))
        self.making += time.process_time() - began


def missing_masses(scene: Scene) -> list[str]:
    """One fault per body without mass, for a dynamic analysis."""
    return [
        f"body[{b}].mass: {body.name!r} has no mass and inertia, which a dynamic analysis needs"
        for b, body in enumerate(scene.body)
        if body.mass is None
    ]


def chart_of(method: Method, sparse: bool = True) -> tuple[Stabilisation, bool]:
    """The kernels of the stabilisation, and whether they have a sparse factor, where one is wanted."""
    stabilisation = method.stabilisation
    if sparse and method.formulation.sparse and stabilisation.name in CHARTS:
        return CHARTS[stabilisation.name], True
    return stabilisation, False


def prepare(method: Method, chart: Stabilisation | None = None) -> None:
    """Compile what the method needs, or load it from the cache of this machine."""
    integrator, chart = method.integrator, chart or chart_of(method)[0]
    for kernel in (
        integrator.step, integrator.propose, chart.rates, chart.accept, method.formulation.accelerate,
        march, evaluate_all, chart.enter.callable,
    ):  # fmt: skip
        kernel.prepare()
