"""Run: one simulation, its memory and its stepper."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from mbref.equations.branches import Passed
from mbref.equations.counts import freedoms_left
from mbref.equations.driver_conflicts import refuse_conflict
from mbref.equations.initial_state import Start, consistent_start
from mbref.equations.model import Model
from mbref.equations.offsets import assembled
from mbref.equations.reduction import Reduction, reduced_data, reduced_start
from mbref.kernels.layout import (
    Active,
    Kernels,
    Loop,
    Memory,
    SparseFactor,
    State,
    Watch,
)
from mbref.kernels.memory_pool import Pooled, acquire, copied, release, write_record
from mbref.kernels.named_memory import allocate, packed
from mbref.kernels.records import record
from mbref.kernels.scene_layout import SceneData
from mbref.linear_algebra.symbolic_factorisation import empty_factor, unsigned
from mbref.method import Method
from mbref.scene import Scene, SceneError
from mbref.stabilisation.all_coordinates import rates as rates_of_all_rows
from mbref.stabilisation.all_coordinates import rates_and_balance
from mbref.stabilisation.base import Stabilisation
from mbref.stepping.control import control_of
from mbref.stepping.limits import Limits
from mbref.stepping.preparation import prepare
from mbref.stepping.ranks import NO_RANKS, are_clear, ranks_of_start

NEARLY = 1e-5  # smallest singular value below which rows are nearly dependent


class Stepper(Protocol):
    """Interface of the stepping loop of a run, by an explicit integrator or by a Taylor series.

    ``ahead`` is the time (s) from the end of an UNDECIDED run to the singular position; 0 if it is unknown.
    """

    ahead: float

    def advance(self, progress: Callable[[float], None] | None) -> tuple[int, float]:
        """Run to the end; return the final status and the process CPU time of the stepping alone (s).

        ``progress`` receives the reached time (s).
        """

    def release(self) -> None:
        """Release the stepper's own memory."""


class Run:
    """One simulation. Its stepper advances its memory; afterwards samples, counts and clock can be read."""

    def __init__(
        self,
        scene: Scene,
        method: Method,
        times: np.ndarray,
        limits: Limits,
        stepper: Callable[[Run], Stepper],
    ):
        self.scene, self.method, self.times, self.limits = scene, method, times, limits
        self._blocks: np.ndarray | None = None  # (m, 12) of Φ_q at the start, if it was computed
        self.model, self.start, self.reduction = self._posed()
        self.steps = self._reduction_of_steps()
        self._control = control_of(self.model, method, times, limits)
        prepare(method)  # before the timed run
        self.pooled = self._acquire_memory()
        self.memory, self.packed = self.pooled.values, self.pooled.packed
        self.links = self.memory.factor.symbolic.link.size // 2  # rows that link copies of a body
        self.put_start()
        self.crossings: list[Passed] = []
        self.making = 0.0  # s of CPU time for construction during ``advance``
        self.built = 0.0  # s of CPU time before the first step
        self.stepper = stepper(self)

    def release(self) -> None:
        """Return the memory to the pool. Results must not be read afterwards."""
        self.stepper.release()
        release(self.pooled)
        self.model.release()

    def _posed(self) -> tuple[Model, Start, Reduction | None]:
        """Return the scene as a model, its consistent start, and the reduction that the method needs.

        None stands for all equations. Raises SceneError if bodies lack a mass and drivers leave a degree of
        freedom.
        """
        model = Model(assembled(self.scene))
        refuse_conflict(model.scene, float(self.times[-1]))
        start = consistent_start(model)
        if model.kinematic and freedoms_left(model, start) > 0:
            raise SceneError(missing_masses(self.scene))
        if not (self.method.formulation.is_sparse or self.method.stabilisation.projects):
            return model, start, None
        start, reduction, self._blocks = reduced_start(model)
        return model, start, reduction

    def _reduction_of_steps(self) -> Reduction | None:
        """Return the part of the reduction that steps of an explicit integrator need; all of it otherwise.

        Copies of bodies would count as redundant in place of a redundant row, which steps leave out.
        """
        method, reduction = self.method, self.reduction
        if reduction is None or method.is_series:
            return reduction
        if method.formulation.is_sparse and not method.stabilisation.chooses_coordinates:
            reduction = reduction.of_steps(self.model, self.start)
        for coarser in (Reduction.with_few_copies, Reduction.without_copies):
            blocks, has_copies = self._blocks, reduction.symbolic.link.size > 0
            if has_copies and blocks is not None and not are_clear(self.model, blocks, reduction.factor()):
                reduction = coarser(reduction, self.model, self.start)
        return reduction

    def begin_again(self) -> None:
        """Reset the memory, except the stepper's own, to the scene's parameters and the initial state."""
        self.pooled.restore()
        self._put_numbers(self.memory)
        self.put_start()

    def reduced(self, data: SceneData) -> SceneData:
        """Return the data (s, …) of s scenes with the primitives that samples need."""
        is_sparse = self.method.formulation.is_sparse
        return self.reduction.scene(data, axis=1) if self.reduction and is_sparse else data

    def _reduced_by(self, reduction: Reduction | None) -> SceneData:
        """Return the data of the scene with the primitives that a part of the run needs."""
        is_sparse = self.method.formulation.is_sparse
        return self.model.once(reduced_data, reduction) if reduction and is_sparse else self.model.data

    def _acquire_memory(self) -> Pooled:
        """Return memory with the numbers of this run."""
        key = (Memory, *self._identity(), self.model.structure, self.reduction, self.steps, self.times.size)
        memory = acquire(key, self._allocate)
        self._put_numbers(memory.values)
        return memory

    def _put_numbers(self, memory: Memory) -> None:
        """Write the numbers of the scene, the method and the limits into memory."""
        self.model.put_numbers(memory.equations, self._reduced_by(self.steps))
        if memory.sampled:
            self.model.put_numbers(memory.sampled.values, self._reduced_by(self.reduction))
        write_record(memory.equations.system.settings, self.method.settings(self.limits.rank_tolerance))
        write_record(memory.control, self._control)
        memory.loop.times[:] = self.times

    def _identity(self) -> tuple[Any, ...]:
        """Return everything of the method that is in its memory: kernels, schemas and options."""
        formulation, stabilisation, integrator = self.method.parts
        schemas = formulation.scratch, stabilisation.memory, integrator.schema
        numbers = formulation.numbers, stabilisation.numbers
        options = (tuple(self.method.options_of(part).items()) for part in self.method.parts)
        return self._kernels_on(stabilisation), schemas, numbers, *options

    def _allocate(self) -> Memory:
        """Return memory of the method for the scene, without numbers."""
        model, method = self.model, self.method
        formulation, stabilisation, integrator = method.parts
        factor, active = self._factor()
        of_samples = self._reduced_by(self.reduction)
        is_part = self.steps is not self.reduction
        pivots = factor.symbolic.row.size
        dense_rows = model.m if formulation.scratch else 0
        sizes = {**model.sizes, "k": self.times.size, "dense_rows": dense_rows, "pivots": pivots}
        watched = stabilisation.projects and not method.is_series
        sizes["watched_rows"] = pivots if watched else 0
        sizes["watched_entries"] = factor.d.size if watched else 0
        sizes["watched_numbers"] = factor.l.size if watched else 0
        equations = model.equations(
            sizes,
            self._reduced_by(self.steps),
            options=method.packed_options(formulation),
            scratch=packed(allocate(formulation.scratch, sizes) if formulation.scratch else factor),
        )
        return Memory(
            equations=equations,
            state=allocate(State, sizes),
            previous=allocate(State, sizes),
            active=active,
            factor=factor,
            control=record(self._control),
            watch=record(Watch()),
            pivots=np.ones(pivots),
            loop=allocate(Loop, sizes),
            kernels=self._kernels_on(stabilisation),
            chart=packed(allocate(stabilisation.memory, sizes)) if stabilisation.memory else None,
            chart_options=method.packed_options(stabilisation),
            integrator=packed(allocate(integrator.schema, sizes)),
            sampled=packed(equations._replace(scene=copied(of_samples))) if is_part else None,
            balance=packed(self.reduction.factor()) if self.reduction and is_part else None,
        )

    def _factor(self) -> tuple[SparseFactor, Active]:
        """Return the factor, and the entries of y; these are all entries if no equation is left out."""
        if self.steps is None:
            everything = unsigned(np.arange(7 * self.model.nb)), unsigned(np.arange(self.model.n))
            return empty_factor(), Active(*everything)
        return self.steps.factor(), self.steps.active

    def _kernels_on(self, chart: Stabilisation) -> Kernels:
        """Return the kernels of the method for this chart, which leaves out rows that some formulations need;
        none for a series."""
        integrator, formulation = self.method.integrator, self.method.formulation
        of_all_rows = formulation.needs_all_rows and chart.projects
        of_part = formulation.is_sparse and self.steps is not self.reduction
        rates_with_outputs = rates_and_balance if of_part else chart.rates_with_outputs
        chosen = {
            "step": integrator.step,
            "propose": integrator.propose,
            "rates": rates_of_all_rows if of_all_rows else chart.rates,
            "rates_with_outputs": rates_with_outputs,
            "accept": chart.accept,
            "accelerate": formulation.accelerate,
        }
        is_series = self.method.is_series
        pointers: dict[str, Any] = {
            name: None if is_series or kernel is None else kernel.pointer for name, kernel in chosen.items()
        }
        return Kernels(**pointers)

    def put_start(self) -> None:
        """Write the initial state and its ranks into memory."""
        memory = self.memory
        memory.state.coordinates[:] = self.start.q
        memory.state.velocities[:] = self.start.v
        self.ranks, settings = NO_RANKS, memory.equations.system.settings
        ranks = self.model.once(ranks_of_start, self.steps, self.limits.rank_tolerance)
        settings.stuck *= max(1.0, self.model.length)
        settings.independent = ranks.rank == memory.pivots.size - self.links
        if self.method.stabilisation.projects:
            self.ranks = ranks
            memory.watch.generic_rank = ranks.rank + self.links
            freedoms = memory.active.velocities.size - ranks.rank  # at a singular position there may be more
            memory.watch.regular = freedoms <= (0 if self.scene.driver else 1)
            settings.nearly_dependent = self.ranks.least < NEARLY
            settings.rounding *= min(1.0, self.model.length)


def missing_masses(scene: Scene) -> list[str]:
    """Return one fault for each body without mass, for a dynamic analysis."""
    return [
        f"body[{b}].mass: {body.name!r} has no mass and inertia, which a dynamic analysis needs"
        for b, body in enumerate(scene.body)
        if body.mass is None
    ]
