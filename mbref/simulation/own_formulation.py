"""Runs by a formulation, and a stabilisation, that a user gives as plain Python functions.

Every evaluation calls Python, so that such a run takes far longer than one by compiled kernels.
SciPy's DOP853 takes the steps; it starts anew at each sample and at each time of switching.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from mbref.equations.counts import freedoms_left
from mbref.equations.driver_conflicts import refuse_conflict
from mbref.equations.initial_state import consistent_start, position_weights, solve_positions
from mbref.equations.joint_angles import angles_of_pose
from mbref.equations.joint_reactions import lazy_reactions
from mbref.equations.matrices import BodyFrames, Matrices, matrices_at
from mbref.equations.model import Model
from mbref.equations.offsets import assembled, counted_angles
from mbref.equations.units import unit_equations
from mbref.input_error import InputError
from mbref.method import OWN
from mbref.motions.motion import Motion
from mbref.motions.trajectory import Cost, Outcome
from mbref.scene import Scene, SceneError
from mbref.scene.scene import functions_of
from mbref.simulation import VERSION
from mbref.stepping.control import UNWRAPPED, largest_violation
from mbref.stepping.limits import Limits
from mbref.stepping.run import missing_masses

OwnFormulation = Callable[[Matrices], Any]  # q̈ (n,), or q̈ and λ (m,)
OwnStabilisation = Callable[[Matrices], tuple[Any, Any]]  # q (7 nb,) and v (n,)
Stabiliser = OwnStabilisation | str  # a function, "none" or "projection"

FINEST_RTOL = 2.3e-14  # least relative tolerance of SciPy's integrators, 100 roundings
RANK_OF_PROJECTION = (
    1e-10  # singular value / largest one of unit rows, below which projection leaves a row out
)


class _End(Exception):
    """The run ends early with an outcome and a sentence."""

    def __init__(self, outcome: Outcome, sentence: str):
        super().__init__(sentence)
        self.outcome = outcome


class _Sample(NamedTuple):
    """State, accelerations, multipliers and angles of turning joints at a sample time."""

    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    multipliers: np.ndarray
    angles: np.ndarray


def simulate_own(
    scene: Scene,
    formulation: OwnFormulation,
    stabilisation: Stabiliser,
    times: np.ndarray,
    limits: Limits,
    progress: Callable[[float], None] | None,
) -> Motion:
    """Return the motion of a scene at times (k,), s, by a formulation and a stabilisation in plain Python.

    Raises SceneError as ``simulate``, and InputError if a function returns arrays of other shapes.
    """
    began = time.process_time()
    run = _OwnRun(scene, formulation, stabilisation, limits, float(times[-1]))
    built, found = time.process_time() - began, []
    outcome, message = Outcome.COMPLETED, ""
    try:
        for t, sample in run.samples(times):
            found.append(sample)
            if progress is not None:
                progress(t)
    except _End as end:
        outcome, message = end.outcome, f"{end} at t = {run.t:.6g} s"
    seconds = time.process_time() - began - built
    return run.motion(times[: len(found)], found, outcome, message, (seconds, built))


class _OwnRun:
    """A run with its state, in principal frames; functions of the user see the bodies' own frames."""

    def __init__(
        self,
        scene: Scene,
        formulation: OwnFormulation,
        stabilisation: Stabiliser,
        limits: Limits,
        end: float,
    ):
        self.scene, self.formulation, self.limits = scene, formulation, limits
        self.model = model = Model(assembled(scene))
        refuse_conflict(model.scene, end)
        start = consistent_start(model)
        if model.kinematic and freedoms_left(model, start) > 0:
            raise SceneError(missing_masses(scene))
        self.frames = BodyFrames(model)
        self.stabilise = _stabiliser(self, stabilisation)
        name = getattr(formulation, "__name__", type(formulation).__name__)
        chart = stabilisation if isinstance(stabilisation, str) else getattr(stabilisation, "__name__", "own")
        self.method = f"{OWN}{name}+{chart}/dop853"
        self.t, self.q, self.v = 0.0, start.q.copy(), start.v.copy()
        self.angles = model.memory.values.angles
        self.angles[:] = 0.0
        self.steps = self.rejected = self.evaluations = 0
        self.length = limits.first_step or None

    def matrices(self, t: float, q: np.ndarray, v: np.ndarray) -> Matrices:
        """Return the equations at a state of principal frames."""
        return matrices_at(self.model, self.frames, t, q, v)

    def accelerations(self, terms: Matrices) -> tuple[np.ndarray, np.ndarray | None]:
        """Return q̈ (n,) of principal frames, and λ (m,) if the user's formulation returns multipliers."""
        self.evaluations += 1
        try:
            found = self.formulation(terms)
        except np.linalg.LinAlgError as error:
            raise _End(Outcome.SINGULAR_MATRIX, f"the formulation ends: {error}") from None
        given, multipliers = found if isinstance(found, tuple) and len(found) == 2 else (found, None)
        n, m = len(terms.columns), len(terms.rows)
        a = _shaped(given, (n,), f"formulation: must return q̈ of shape ({n},), or q̈ and λ of shape ({m},)")
        if multipliers is not None:
            multipliers = _shaped(multipliers, (m,), f"formulation: λ must have the shape ({m},)")
        if not np.isfinite(a).all():
            raise _End(Outcome.NOT_FINITE, "the accelerations that the formulation returns are not finite")
        return self.frames.principal(a), multipliers

    def samples(self, times: np.ndarray) -> Iterator[tuple[float, _Sample]]:
        """Yield each sample time (s) with its sample; raises _End."""
        switches = {piece for piece in _switches(self.model.scene) if 0.0 < piece < times[-1]}
        for stop in sorted({*times.tolist(), *switches}):
            if stop > self.t:
                self._advance(stop, stop in switches)
            if stop in times:
                yield stop, self._sample()

    def _advance(self, stop: float, switched: bool) -> None:
        """Advance to a time (s), at which functions of time may be switched."""
        from scipy.integrate import DOP853  # only such runs need it

        latest = np.nextafter(stop, -np.inf) if switched else stop
        size = 7 * self.model.nb

        def rates(t: float, y: np.ndarray) -> np.ndarray:
            terms = self.matrices(min(t, latest), y[:size], y[size:])
            a, _ = self.accelerations(terms)
            turned = self.frames.principal_coordinates  # rates of quaternions turn as quaternions do
            return np.concatenate([turned(terms.q_rate), a])

        limits, y = self.limits, np.concatenate([self.q, self.v])
        rtol = max(limits.rtol, FINEST_RTOL)
        atol = limits.rtol if limits.atol is None else limits.atol
        first = None if self.length is None else min(self.length, stop - self.t)
        solver = DOP853(rates, self.t, y, stop, rtol=rtol, atol=atol, first_step=first)
        while solver.status == "running":
            if self.steps >= limits.most_steps:
                raise _End(Outcome.STEP_FAILED, f"{self.steps} steps did not reach the end; raise most_steps")
            solver.max_step = self._longest(solver.y[size:])
            if message := solver.step():
                raise _End(Outcome.STEP_FAILED, message)
            self.steps, self.t = self.steps + 1, float(solver.t)
            self._accept(solver.y[:size], solver.y[size:])
            solver.y = np.concatenate([self.q, self.v])
            if solver.status == "running":
                solver.f = rates(self.t, solver.y)
                self.length = float(solver.h_abs)

    def _longest(self, v: np.ndarray) -> float:
        """Return the longest step (s): no body turns so far that full turns of joints are uncertain."""
        spin = float(np.linalg.norm(v.reshape(-1, 6)[:, 3:], axis=1).max())
        longest = self.limits.largest_step or np.inf
        return min(longest, UNWRAPPED / spin) if self.angles.size and spin > 0 else longest

    def _accept(self, q: np.ndarray, v: np.ndarray) -> None:
        """Take over the state after a step: count turns, stabilise, and check violations; raises _End."""
        if not (np.isfinite(q).all() and np.isfinite(v).all()):
            raise _End(Outcome.NOT_FINITE, "the state is not finite; try a smaller tolerance")
        poses = q.reshape(-1, 7).copy()
        poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
        self.q, self.v = poses.ravel(), v.copy()
        turned = angles_of_pose(self.model, self.q) - self.angles
        self.angles += np.remainder(turned + np.pi, 2 * np.pi) - np.pi
        self.stabilise()
        phi = np.abs(self.model.terms(self.t, self.q).phi)
        most = largest_violation(self.limits, self.model.length)
        if phi.size and not phi.max() <= most:
            joint = self.model.row_joint[int(np.argmax(phi))]
            size = f"{phi.max():.3g}, more than {most:.3g},"
            raise _End(Outcome.VIOLATION, f"joint {joint!r} is violated by {size}")

    def project(self) -> None:
        """Correct positions, then velocities, by the least change in the metric of M."""
        self.q, _ = solve_positions(self.model, self.t, self.q)
        terms = self.model.terms(self.t, self.q, self.v)
        root = 1.0 / np.sqrt(position_weights(self.model))
        rows, rest = unit_equations(terms.jacobian * root, terms.nu - terms.jacobian @ self.v)
        self.v += root * np.linalg.lstsq(rows, rest, rcond=RANK_OF_PROJECTION)[0]

    def correct(self, stabilisation: OwnStabilisation) -> None:
        """Take over coordinates and velocities that the user's stabilisation returns."""
        q, v = stabilisation(self.matrices(self.t, self.q, self.v))
        what = "stabilisation: must return q and v of shapes"
        q = _shaped(q, self.q.shape, f"{what} {self.q.shape} and {self.v.shape}")
        v = _shaped(v, self.v.shape, f"{what} {self.q.shape} and {self.v.shape}")
        self.q, self.v = self.frames.principal_coordinates(q), self.frames.principal(v)

    def _sample(self) -> _Sample:
        terms = self.matrices(self.t, self.q, self.v)
        a, multipliers = self.accelerations(terms)
        if multipliers is None:
            multipliers = terms.multipliers_of(self.frames.own(a)) if terms.M is not None else 0.0 * terms.nu
        return _Sample(self.q, self.v, a, multipliers, self.angles.copy())

    def motion(
        self,
        times: np.ndarray,
        found: list[_Sample],
        outcome: Outcome,
        message: str,
        seconds: tuple[float, float],
    ) -> Motion:
        """Return the samples as a Motion, in the scene's frames."""
        k, model = len(found), self.model
        nb, every = model.nb, zip(*found, strict=True) if found else [()] * len(_Sample._fields)
        shapes = (nb, 7), (nb, 6), (nb, 6), (model.m,), (self.angles.size,)
        poses, rates, second, multipliers, angles = (
            np.array(each).reshape(k, *shape) for each, shape in zip(every, shapes, strict=True)
        )
        cost = Cost(*seconds, steps=self.steps, rhs=self.evaluations)
        model.release()
        return Motion(
            mechanism=self.scene,
            scene=self.scene.name,
            engine="mbref",
            version=VERSION,
            method=self.method,
            settings={**vars(self.limits), "branches": []},
            bodies=tuple(body.name for body in self.scene.body),
            times=times,
            **model.motion(poses, rates, second),
            **lazy_reactions(self.scene, times, poses, multipliers, angles),
            angles=counted_angles(self.scene, model.structure, angles),
            outcome=outcome,
            t_end=self.t,
            message=message,
            cost=cost,
        )


def _stabiliser(run: _OwnRun, stabilisation: Stabiliser) -> Callable[[], None]:
    """Return the function that corrects the state of a run after a step; raises InputError."""
    if callable(stabilisation):
        return lambda: run.correct(stabilisation)
    if stabilisation not in ("none", "projection"):
        raise InputError(f"stabilisation: must be none, projection or a function, got {stabilisation!r}")
    return run.project if stabilisation == "projection" else lambda: None


def _switches(scene: Scene) -> Iterator[float]:
    """Yield the times (s) at which a driver or load of the scene is not analytic."""
    for function in functions_of(scene):
        yield from (piece.begin for piece in function.pieces())


def _shaped(value: Any, shape: tuple[int, ...], what: str) -> np.ndarray:
    """Return an array of a shape; raises InputError otherwise."""
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{what}, got {type(value).__name__}") from None
    if array.shape != shape:
        raise InputError(f"{what}, got {array.shape}")
    return array
