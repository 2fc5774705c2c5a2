"""simulate: a scene by a method, sampled at given times; the one place where a failure becomes an Outcome."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from mbref import __version__
from mbref.evaluation import evaluate_all
from mbref.initial import Start, consistent_start, scene_length
from mbref.kinematics import NAME as KINEMATIC
from mbref.kinematics import kinematic_analysis, undriven_freedoms
from mbref.march import (
    DONE,
    PAUSED,
    ROW,
    SAMPLE,
    STEP_TOO_SMALL,
    TIME,
    TOO_MANY_STEPS,
    VIOLATED,
    march,
)
from mbref.method import Method
from mbref.model import Model
from mbref.problem import NO_PLAN, packed
from mbref.reactions import reactions
from mbref.scene import Scene, SceneError
from mbref.singular import KEPT, NODES
from mbref.sparse.chart import CHARTS
from mbref.sparse.least_change import LARGE
from mbref.sparse.moving import moving_entries, moving_primitives
from mbref.sparse.plan import plan_for
from mbref.tables import (
    COORDINATES,
    CROSSINGS,
    EVALUATIONS,
    FACTORISATIONS,
    FIXED_STEP,
    FORCED_STEP,
    LARGEST_STEP,
    LARGEST_TURN,
    MOST_STEPS,
    NEWTON,
    NOT_CONVERGED,
    NOT_FINITE,
    ORDER,
    PHI,
    REJECTED,
    ROWS,
    SINGULAR,
    SIZES,
    SMALLEST_STEP,
    STATE,
    STEPS,
    STEPS_PER_CALL,
    VELOCITIES,
    VIOLATION,
)
from mbref.trajectory import Cost, Outcome, Trajectory

CALL = 5_000  # steps between returns to Python, where an interrupt is heard and progress is told

OUTCOMES = {
    DONE: Outcome.COMPLETED,
    SINGULAR: Outcome.SINGULAR_MATRIX,
    NOT_CONVERGED: Outcome.NOT_CONVERGED,
    NOT_FINITE: Outcome.NOT_FINITE,
    VIOLATED: Outcome.VIOLATION,
    STEP_TOO_SMALL: Outcome.STEP_FAILED,
    TOO_MANY_STEPS: Outcome.STEP_FAILED,
}


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


def simulate(
    scene: Scene,
    method: Method | str,
    times: Sequence[float] | np.ndarray,
    limits: Limits | None = None,
    progress: Callable[[float], None] | None = None,
) -> Trajectory:
    """Simulate from t = 0 and sample at ``times`` (k,), increasing, s; ``progress`` is told the time reached.

    The method "kinematic" is the kinematic analysis of ``kinematics``, which integrates nothing.
    Returns the states reached, with accelerations and reactions; a failure of the method is the
    trajectory's outcome.  Raises SceneError for a scene that cannot be simulated, ValueError for times
    that do not increase or an order the integrator does not have, MethodError for an unknown method name.
    """
    times = checked_times(times)
    if method == KINEMATIC:
        return kinematic_analysis(scene, times)
    method = Method.parse(method) if isinstance(method, str) else method
    limits = limits or Limits()
    began = time.process_time()
    run = _Run(scene, method, times, limits)
    built = time.process_time() - began
    status, seconds = run.march(progress)
    return run.trajectory(status, seconds, built)


def checked_times(times: Sequence[float] | np.ndarray) -> np.ndarray:
    """Sample times as an array (k,); ValueError unless finite, not negative and increasing."""
    array = np.ascontiguousarray(times, dtype=float)
    if array.ndim != 1 or not array.size:
        raise ValueError("times: needs at least one sample time")
    if not np.isfinite(array).all() or array[0] < 0 or np.any(np.diff(array) <= 0):
        raise ValueError("times: must be finite, not negative and increasing")
    return array


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


class _Run:
    """One simulation: the arrays that ``march`` works on, and what they mean afterwards."""

    def __init__(self, scene: Scene, method: Method, times: np.ndarray, limits: Limits):
        self.scene, self.method, self.times, self.limits = scene, method, times, limits
        self.model = model = Model(scene)
        if model.kinematic and undriven_freedoms(scene) > 0:
            raise SceneError(missing_masses(scene))
        self.start = consistent_start(model)
        formulation, stabilisation, integrator = method.parts
        self.plan = NO_PLAN
        if model.m > limits.sparse_above and formulation.sparse and stabilisation.name in CHARTS:
            stabilisation = CHARTS[stabilisation.name]
            entries = moving_entries(model, self.start.q, self.start.v)
            plan = plan_for(entries, model.entry_columns(), model.n)
            self.plan, self.work = plan.indices, model.workspace(plan.memory, dense=False)
            ints, floats = moving_primitives(model, entries)
        else:
            self.work = model.workspace(formulation.scratch(model.m, model.n))
            ints, floats = model.ints, model.floats
        self.pivots = np.zeros((5, 2 * (model.m + 7 * model.nb)), dtype=np.int64)
        self.counts = np.zeros(6, dtype=np.int64)
        self.arrays = (
            ints, floats, self.work, self.pivots,
            method.settings(limits.rank_tolerance), self.counts,
        )  # fmt: skip
        self.problem = packed(*self.arrays, self.plan)
        chart = stabilisation.rates, stabilisation.accept
        kernels = integrator.step, integrator.propose, *chart, formulation.accelerate
        self.kernels = tuple(kernel.pointer for kernel in kernels)
        prepare(method)  # so that the run alone is timed
        self.clock = np.zeros(4)
        self.place = np.zeros(2, dtype=np.int64)
        self.control = self._control()
        self._enter(stabilisation, self.start)
        self._allocate(integrator.rows)

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

    def _enter(self, stabilisation, start: Start) -> None:
        state = self.work[STATE]
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
        """Run to the end; the final status and the process CPU time of the stepping alone."""
        atol = self.limits.rtol if self.limits.atol is None else self.limits.atol
        tolerances = np.array([self.limits.rtol, atol])
        arguments = (
            *self.kernels, self.times, *self.samples, self.clock, self.control, self.place, tolerances,
            self.y, self.y_rate, self.y_new, self.memory, self.history, self.nodes, self.problem,
        )  # fmt: skip
        began, status = time.process_time(), PAUSED
        while status == PAUSED:
            status = march(*arguments)
            if progress is not None:
                progress(float(self.clock[TIME]))
        return status, time.process_time() - began

    def trajectory(self, status: int, seconds: float, built: float) -> Trajectory:
        """The samples reached, in the scene's frames and units."""
        model, reached = self.model, int(self.place[SAMPLE])
        q, v, a, multipliers = (sample[:reached] for sample in self.samples)
        nb = model.nb
        q, v, a = q.reshape(reached, nb, 7), v.reshape(reached, nb, 6), a.reshape(reached, nb, 6)
        counts = self.counts
        return Trajectory(
            scene=self.scene.name,
            engine="mbref",
            version=__version__,
            method=str(self.method),
            settings=asdict(self.limits),
            times=self.times[:reached],
            bodies=tuple(body.name for body in self.scene.body),
            **model.motion(q, v, a),
            reactions=reactions(model, self.times[:reached], q, v, multipliers),
            outcome=OUTCOMES[status],
            t_end=float(self.clock[TIME]),
            message=self._message(status),
            cost=Cost(
                seconds,
                built,
                int(counts[STEPS]),
                int(counts[REJECTED]),
                int(counts[EVALUATIONS]),
                int(counts[FACTORISATIONS]),
                int(counts[NEWTON]),
            ),
        )

    def _message(self, status: int) -> str:
        """One sentence: what ended the run, where; or what was corrected at its start."""
        if status == DONE:
            crossings = int(self.counts[CROSSINGS])
            passed = f"singular positions passed: {crossings}" if crossings else ""
            return "; ".join(filter(None, (self.start.report(), passed)))
        t = self.clock[TIME]
        if status == VIOLATED:
            row = int(self.place[ROW])
            size = abs(self.work[ROWS][PHI, row])
            return (
                f"joint {self.model.row_joint[row]!r} is violated by {size:.3g}, more than "
                f"{self.control[VIOLATION]:.3g}, at t = {t:.6g} s"
            )
        if status == TOO_MANY_STEPS:
            return f"{self.limits.most_steps} steps were taken without reaching the end, at t = {t:.6g} s"
        if status == STEP_TOO_SMALL:
            h = self.control[SMALLEST_STEP]
            return f"the error estimate asks for a step below {h:.3g} s at t = {t:.6g} s"
        return f"{OUTCOMES[status].sentence} at t = {t:.6g} s ({self.method.formulation.name})"
