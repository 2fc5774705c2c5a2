"""Kinematic analysis: positions, velocities and accelerations of a driven mechanism at given times.

Newton–Raphson on Φ(q, t) = 0, then the linear systems Φ_q q' = ν and Φ_q q'' = γ (Eqs. 1 to 3), with no
integration.  Between sample times it goes in steps small enough for the predictor q + h q' + ½ h² q''
(Eq. 16) to stay with the branch.
"""

from __future__ import annotations

import time

import numpy as np

from mbref import __version__
from mbref.diagnose import rank_of, scaled_jacobian
from mbref.initial import consistent_start
from mbref.model import Model, Terms, displaced
from mbref.scene import Scene, SceneError
from mbref.trajectory import Cost, Outcome, Trajectory

NAME = "kinematic"  # as a method
A_LITTLE = 1e-2  # rad, to look beside a singular start
LARGEST_TURN = 0.1  # rad that the fastest body turns between two solutions
TOLERANCE, MOST_ITERATIONS = 1e-13, 20
RANK_TOLERANCE = 1e-10  # relative, of least-squares solutions: redundant rows are consistent


class _NotConverged(Exception):
    """Newton–Raphson did not reach the tolerance."""


def kinematic_analysis(scene: Scene, times: np.ndarray) -> Trajectory:
    """Poses, velocities and accelerations at ``times`` (k,), increasing, s, of a fully driven scene.

    Raises SceneError where a freedom is left without a driver.  The outcome is NOT_CONVERGED where
    Newton–Raphson fails, with the states before it; poses on a singular position itself are those the
    predictor leads to, their rates least in norm.
    """
    if freedoms := undriven_freedoms(scene):
        fault = f"driver: {freedoms} degrees of freedom are left; a kinematic analysis prescribes them all"
        raise SceneError([fault])
    began = time.process_time()
    analysis = _Analysis(scene)
    built = time.process_time() - began
    began = time.process_time()
    states, outcome, message = [], Outcome.COMPLETED, ""
    for t in times:
        try:
            analysis.advance(float(t))
        except _NotConverged as failure:
            outcome, message = Outcome.NOT_CONVERGED, str(failure)
            break
        states.append(analysis.state())
    cost = Cost(time.process_time() - began, built, analysis.steps, newton=analysis.iterations)
    return analysis.trajectory(np.asarray(times)[: len(states)], states, outcome, message, cost)


def undriven_freedoms(scene: Scene) -> int:
    """Degrees of freedom that no driver prescribes; looked at beside the start where that is singular."""
    freedoms = scene.counts().degrees_of_freedom
    if freedoms == 0 or not scene.driver:
        return freedoms
    analysis = _Analysis(scene)
    analysis.step(A_LITTLE)
    rank = rank_of(scaled_jacobian(analysis.model, analysis.t, analysis.q))
    return analysis.model.n - rank


class _Analysis:
    """The present solution (t, q, v, a) and the step to the next."""

    def __init__(self, scene: Scene):
        self.scene, self.model = scene, Model(scene)
        start = consistent_start(self.model)
        self.steps = self.iterations = 0
        self.t, self.q, self.v = 0.0, start.q, start.v
        self.a = _least(self._terms().jacobian, self._terms().gamma)

    def _terms(self) -> Terms:
        return self.model.terms(self.t, self.q, self.v)

    def advance(self, target: float) -> None:
        """Solve at the target time, by way of as many solutions between as the branch needs."""
        while self.t < target:
            bound = self._time_to_turn(LARGEST_TURN)
            self._solve(target if target - self.t <= bound else self.t + bound)

    def step(self, turn: float) -> None:
        """Solve once, when the fastest body has turned by ``turn`` (rad)."""
        self._solve(self.t + min(1.0, self._time_to_turn(turn)))

    def _time_to_turn(self, turn: float) -> float:
        fastest = np.max(np.abs(self.v.reshape(-1, 6)[:, 3:]), initial=0.0)
        return turn / fastest if fastest > 0 else np.inf

    def _solve(self, t: float) -> None:
        h = t - self.t
        self.t, self.q = t, displaced(self.q, h * self.v + 0.5 * h * h * self.a)
        for _ in range(MOST_ITERATIONS):
            terms = self._terms()
            if np.max(np.abs(terms.phi)) <= TOLERANCE:
                break
            self.iterations += 1
            self.q = displaced(self.q, _least(terms.jacobian, -terms.phi))
        else:
            raise _NotConverged(f"Newton–Raphson leaves {np.max(np.abs(terms.phi)):.2g} at t = {t:.6g} s")
        self.steps += 1
        self.v = _least(terms.jacobian, terms.nu)
        self.a = _least(terms.jacobian, self._terms().gamma)

    def state(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q (nb, 7), v and a (nb, 6) now."""
        return self.q.reshape(-1, 7), self.v.reshape(-1, 6), self.a.reshape(-1, 6)

    def trajectory(
        self, times: np.ndarray, states: list, outcome: Outcome, message: str, cost: Cost
    ) -> Trajectory:
        """The states in the scene's frames."""
        nb = self.model.nb
        q = np.array([s[0] for s in states]).reshape(-1, nb, 7)
        v = np.array([s[1] for s in states]).reshape(-1, nb, 6)
        a = np.array([s[2] for s in states]).reshape(-1, nb, 6)
        return Trajectory(
            scene=self.scene.name, engine="mbref", version=__version__, method=NAME, settings={},
            times=times, bodies=tuple(b.name for b in self.scene.body), **self.model.motion(q, v, a),
            outcome=outcome, t_end=self.t, message=message, cost=cost,
        )  # fmt: skip


def _least(jacobian: np.ndarray, rhs: np.ndarray) -> np.ndarray:
    """The least-squares solution of least norm."""
    return np.linalg.lstsq(jacobian, rhs, rcond=RANK_TOLERANCE)[0]
