"""Exudyn's static solver as kinematic analysis: poses of a fully driven mechanism, one after another.

Masses and forces have no influence. Velocities come from Exudyn's own constraint Jacobian. The rank of the
Jacobian shows whether a pose is singular. At a singular pose the solver may change to another branch without
a message. The functions take the exudyn module and do not import it.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from crosscheck.engines.exudyn.dynamic import Motion, finite, said, step_count
from crosscheck.engines.exudyn.model import System, build
from crosscheck.engines.shared.driver_motion import motion
from crosscheck.judge.tolerances import RANK
from mbref.motions.trajectory import Cost, Outcome
from mbref.scene import Scene

JUMP = 0.5  # relative deviation from the trapezoidal rule above which a step has changed branch


class Stopped(Exception):
    """The analysis cannot continue; ``outcome`` and a sentence give the reason."""

    def __init__(self, outcome: Outcome, message: str):
        self.outcome = outcome
        super().__init__(message)


class Drive:
    """A mechanism that is moved along its drivers; ``state`` (2, nb * 7) has coordinates and rates."""

    def __init__(self, exu: Any, scene: Scene):
        self.exu, self.scene = exu, scene
        self.system: System = build(exu, scene, forces=False)
        self.now, self.steps, self.newton, self.factorisations = 0.0, 0, 0, 0
        self.state = np.zeros((2, 7 * len(scene.body)))

    def start(self) -> None:
        """Compute the rates at t = 0; raises Stopped if the first pose is singular."""
        self.state[1] = self._rates(0.0)

    def advance(self, t: float, step: float) -> None:
        """Move on to time t in equal steps of at most ``step`` (s); raises Stopped."""
        if t > self.now:
            for later in np.linspace(self.now, t, step_count(t - self.now, step) + 1)[1:]:
                self._step(float(later))

    def _step(self, t: float) -> None:
        h = t - self.now
        self._solve(t, h)
        coordinates = np.array(self.system.mbs.systemData.GetODE2Coordinates())
        rates = self._rates(t)
        missed = coordinates - self.state[0] - h / 2 * (self.state[1] + rates)
        length = h * max(abs(self.state[1]).max(), abs(rates).max())
        if abs(missed).max() > JUMP * length:
            raise Stopped(Outcome.STEP_FAILED, f"the pose jumped to another branch before t = {t:g} s")
        self.now, self.state, self.steps = t, np.array([coordinates, rates]), self.steps + 1

    def _solve(self, t: float, h: float) -> None:
        settings = self._settings()
        settings.staticSolver.loadStepStart = self.now
        settings.staticSolver.loadStepDuration = h
        try:
            self.system.mbs.SolveStatic(settings, updateInitialValues=True)
        except (self.exu.SolverError, self.exu.InternalError) as failure:
            message = f"no pose was found for t = {t:g} s: {said(failure)}"
            raise Stopped(Outcome.NOT_CONVERGED, message) from None
        it = self.system.mbs.sys["staticSolver"].it
        self.newton += it.newtonStepsCount
        self.factorisations += it.newtonJacobiCount

    def _settings(self) -> Any:
        settings = self.exu.SimulationSettings()
        settings.solution.file.write = False
        settings.staticSolver.verboseMode = 0
        settings.staticSolver.adaptiveStep = False
        settings.staticSolver.newton.relativeTolerance = 1e-10
        settings.staticSolver.newton.absoluteTolerance = 1e-12
        settings.linearSolver.solverType = self.exu.LinearSolverType.EigenDense
        settings.linearSolver.ignoreSingularJacobian = True
        return settings

    def _rates(self, t: float) -> np.ndarray:
        """Return rates (nb * 7,) of the coordinates from C_q q' = -C_t; raises Stopped at a singular pose."""
        matrix, rhs = self._jacobian(), self._driver_rates(t)
        u, s, vt = np.linalg.svd(matrix, full_matrices=False)
        if s.size < matrix.shape[1] or s[-1] <= RANK * s[0]:
            raise Stopped(Outcome.SINGULAR_MATRIX, f"the constraint Jacobian loses rank at t = {t:g} s")
        return vt.T @ ((u.T @ rhs) / s)

    def _jacobian(self) -> np.ndarray:
        """Return Exudyn's constraint Jacobian (rows, nb * 7) at the present pose."""
        mbs, n = self.system.mbs, self.state.shape[1]
        solver = self.exu.MainSolverStatic()
        solver.InitializeSolver(mbs, self._settings())
        solver.ComputeJacobianODE2RHS(mbs, 0, 0, 0)  # zeroes the matrix, to which the next call adds
        solver.ComputeJacobianAE(mbs, 1, 0, 1, False)
        matrix = np.array(solver.GetSystemJacobian())[n:, :n]
        solver.FinalizeSolver(mbs, self._settings())
        return matrix

    def _driver_rates(self, t: float) -> np.ndarray:
        """Return -C_t: the rate of each driver in the row of its constraint, zero elsewhere."""
        rhs = np.zeros(self.system.mbs.systemData.AEsize())
        for number, driver in zip(self.system.drivers, self.scene.driver, strict=True):
            rhs[self.system.mbs.systemData.GetObjectLTGAE(number)] = motion(driver, t)[1]
        return rhs


def drive(exu: Any, scene: Scene, times: np.ndarray, step: float) -> Motion:
    """Return coordinates and rates at ``times`` (k,), in static load steps of at most ``step`` (s)."""
    clock = time.process_time()
    moving = Drive(exu, scene)
    built = time.process_time()
    found: list[np.ndarray] = []
    outcome, message = Outcome.COMPLETED, ""
    try:
        moving.start()
        for t in times:
            moving.advance(float(t), step)
            found.append(moving.state)
    except Stopped as stop:
        outcome, message = stop.outcome, str(stop)
    seconds = time.process_time() - built
    cost = Cost(seconds, built - clock, moving.steps, 0, 0, moving.factorisations, moving.newton)
    coordinates = np.array(found).reshape(len(found), 2, len(scene.body), 7).swapaxes(0, 1)
    return finite(Motion(times[: len(found)], coordinates, None, cost, moving.now, outcome, message))
