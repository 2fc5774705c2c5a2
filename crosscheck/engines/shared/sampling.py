"""Stepping of an engine from sample to sample: the samples of a run, and integrators of crosscheck."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.integrate import DOP853

from crosscheck.engine import Engine, Setting
from mbref.motions.trajectory import Cost, Outcome, Trajectory
from mbref.scene import Scene

WIDTHS = {
    "position": 3,
    "orientation": 4,
    "velocity": 3,
    "angular_velocity": 3,
    "acceleration": 3,
    "angular_acceleration": 3,
}
MAX_STEPS = 10**6  # steps in one sample interval; a run with more steps is stopped

UNKNOWN = np.zeros((0, 3))  # stands for accelerations that an engine does not give

STRETCH = 1.01  # factor by which a step may be extended to end at a sample
JUMPS = np.linspace(1.0, 4.0, 16)  # multiples of the shortest step, tried if the shortest step fails

Rhs = Callable[[float, np.ndarray], np.ndarray]
# function of (t, accepted state) that returns the corrected state
Settle = Callable[[float, np.ndarray], np.ndarray]


class Failed(Exception):
    """A run that the engine could not finish: its outcome, the time reached and one sentence."""

    def __init__(self, outcome: Outcome, t: float, message: str):
        super().__init__(message)
        self.outcome = outcome
        self.t = t


@dataclass
class Counts:
    """Numbers of steps, rejected steps and evaluations so far."""

    steps: int = 0
    rejected: int = 0
    rhs: int = 0


@dataclass(frozen=True)
class Sample:
    """State of the scene's bodies at one time, as in a Trajectory: (nb, 3), orientations (nb, 4).

    Accelerations are UNKNOWN if the engine does not give them.
    """

    position: np.ndarray
    orientation: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    acceleration: np.ndarray
    angular_acceleration: np.ndarray
    reactions: dict[str, np.ndarray] = field(default_factory=dict)  # joint: (6,) force and moment


def run_through(
    scene: Scene,
    times: np.ndarray,
    advance: Callable[[float, float], None],
    sample: Callable[[float], Sample],
    counts: Counts,
    build_seconds: float,
    labels: dict[str, Any],
) -> Trajectory:
    """Advance from sample to sample; returns the trajectory, complete or up to the time that was reached.

    ``labels`` are the trajectory's engine, version, method and settings.
    """
    samples: list[Sample] = []
    seconds, t, outcome, message = 0.0, 0.0, Outcome.COMPLETED, ""
    try:
        for target in map(float, times):
            start = time.process_time()
            try:
                if target > t:
                    advance(t, target)
            finally:
                seconds += time.process_time() - start
            reached = sample(target)
            if not _finite(reached):
                raise Failed(Outcome.NOT_FINITE, t, f"the motion is not finite at {target:.6g} s")
            samples.append(reached)
            t = target
    except Failed as failure:
        outcome, t, message = failure.outcome, failure.t, str(failure)
    states = {name: _stacked(samples, name, len(scene.body), width) for name, width in WIDTHS.items()}
    return Trajectory(
        scene=scene.name,
        **labels,
        times=np.array(times[: len(samples)], dtype=float),
        bodies=tuple(body.name for body in scene.body),
        position=states["position"],
        orientation=states["orientation"],
        velocity=states["velocity"],
        angular_velocity=states["angular_velocity"],
        acceleration=states["acceleration"],
        angular_acceleration=states["angular_acceleration"],
        reactions=_by_joint([s.reactions for s in samples]),
        outcome=outcome,
        t_end=t,
        message=message,
        cost=Cost(seconds, build_seconds, counts.steps, counts.rejected, counts.rhs),
    )


def labels_of(engine: Engine, setting: Setting) -> dict[str, Any]:
    """Return a trajectory's engine, version, method and settings."""
    return {
        "engine": engine.name,
        "version": engine.version(),
        "method": setting.family,
        "settings": dict(setting.options),
    }


def _finite(sample: Sample) -> bool:
    return all(np.isfinite(getattr(sample, name)).all() for name in WIDTHS)


def _stacked(samples: list[Sample], name: str, bodies: int, width: int) -> Any:
    """Return the samples' arrays of a name (k, bodies, width); None if the engine does not give them."""
    if samples and getattr(samples[0], name) is UNKNOWN:
        return None
    return np.array([getattr(s, name) for s in samples], dtype=float).reshape(len(samples), bodies, width)


def _by_joint(reactions: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray] | None:
    if not reactions or not reactions[0]:
        return None
    return {name: np.array([sample[name] for sample in reactions]) for name in reactions[0]}


def step_count(t0: float, t1: float, step: float) -> int:
    """Return the number of equal steps between t0 and t1, none longer than ``step``."""
    return max(1, math.ceil((t1 - t0) / step * (1 - 1e-9)))


def rk4(
    rhs: Rhs, settle: Settle, y: np.ndarray, t0: float, t1: float, step: float, counts: Counts
) -> np.ndarray:
    """Return the state at t1 by the classical Runge-Kutta method, in equal steps no longer than ``step``
    (s)."""
    n = step_count(t0, t1, step)
    h = (t1 - t0) / n
    for i in range(n):
        t = t0 + i * h
        k1 = rhs(t, y)
        k2 = rhs(t + h / 2, y + h / 2 * k1)
        k3 = rhs(t + h / 2, y + h / 2 * k2)
        k4 = rhs(t + h, y + h * k3)
        y = settle(t + h, y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
        counts.steps += 1
        counts.rhs += 4
        if not math.isfinite(y.sum()):
            raise Failed(Outcome.NOT_FINITE, t, f"the state is not finite after the step from {t:.6g} s")
    return y


@dataclass
class Adaptive:
    """DOP853 from sample to sample; every accepted state is projected, and the step length is kept between
    samples.

    Near a singular position the accelerations are dominated by noise, and shorter steps would integrate the
    noise instead of crossing the position. So ``min_step`` is the shortest step. If the shortest step fails,
    some longer steps are tried, and the step with the least error estimate is accepted.
    """

    rhs: Rhs
    settle: Settle | None
    rtol: float  # relative tolerance; the absolute tolerance is a hundredth of it
    min_step: float  # s
    max_step: float  # s
    counts: Counts
    step: float = 0.0  # s; length of the next step

    def advance(self, y: np.ndarray, t0: float, t1: float) -> np.ndarray:
        """Return the state at t1; raises Failed if the motion is not finite or takes too many steps."""
        t, f = t0, self._evaluate(t0, y)
        self.step = self.step or self.min_step
        for _ in range(MAX_STEPS):
            wanted = min(max(self.step, self.min_step), self.max_step)
            h = t1 - t if t + STRETCH * wanted >= t1 else wanted
            new, slope, error = self._attempt(t, y, f, h)
            if not error <= 1 and h <= STRETCH * self.min_step:
                h, new, slope, error = self._jump(t, y, f, t1)
            elif not error <= 1:
                self.counts.rejected += 1
                self.step = h * min(_growth(error), 1.0)
                continue
            self.counts.steps += 1
            self.step = max(h * _growth(error), self.step if h < wanted else 0.0)
            t, y, f = (t1 if h == t1 - t else t + h), new, slope
            if t == t1:
                return y
        raise Failed(Outcome.STEP_FAILED, t, f"{MAX_STEPS} steps have only reached {t:.6g} s")

    def _jump(
        self, t: float, y: np.ndarray, f: np.ndarray, t1: float
    ) -> tuple[float, np.ndarray, np.ndarray, float]:
        """Return the step with the least error estimate among the shortest step and some longer steps."""
        lengths = {min(factor * self.min_step, t1 - t) for factor in JUMPS}
        attempts = [(h, *self._attempt(t, y, f, h)) for h in sorted(lengths)]
        self.counts.rejected += len(attempts)
        best = min(attempts, key=lambda attempt: attempt[3] if math.isfinite(attempt[3]) else math.inf)
        if not math.isfinite(best[3]):
            if self.settle is not None:
                self.settle(t + best[0], best[1])  # raises the specific error, if any
            raise Failed(Outcome.NOT_FINITE, t, f"the motion is not finite after {t:.6g} s")
        return best

    def _evaluate(self, t: float, y: np.ndarray) -> np.ndarray:
        self.counts.rhs += 1
        return self.rhs(t, y)

    def _attempt(
        self, t: float, y: np.ndarray, f: np.ndarray, h: float
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """Return the projected new state, its slope, and the error estimate over the tolerance, for a step of
        h."""
        k = np.empty((len(DOP853.C) + 1, len(y)))
        k[0] = f
        for i in range(1, len(DOP853.C)):
            k[i] = self._evaluate(t + DOP853.C[i] * h, y + h * (DOP853.A[i, :i] @ k[:i]))
        new = y + h * (DOP853.B @ k[:-1])
        k[-1] = self._evaluate(t + h, new)
        scale = self.rtol * (0.01 + np.maximum(abs(y), abs(new)))
        fifth, third = (DOP853.E5 @ k) / scale, (DOP853.E3 @ k) / scale
        squares = fifth @ fifth
        error = h * squares / math.sqrt((squares + 0.01 * (third @ third)) * len(y)) if squares else 0.0
        if self.settle is None:
            return new, k[-1], error
        return self._settled(self.settle, t + h, new, k[-1], h / scale, error)

    def _settled(
        self, settle: Settle, t: float, y: np.ndarray, slope: np.ndarray, weight: np.ndarray, error: float
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """Return the projected state, its slope and the error estimate.

        The slope before the projection is a second estimate of the error: if the small projection changes the
        slope by much, the next step would start from noise.
        """
        try:
            settled = settle(t, y)
        except Failed:
            return y, slope, math.inf
        after = self._evaluate(t, settled)
        apart = weight * (after - slope)
        return settled, after, max(error, math.sqrt(apart @ apart / max(len(y), 1)))


def _growth(error: float) -> float:
    """Return the factor for the next step length, from an error estimate (over the tolerance) of an
    eighth-order step."""
    if not math.isfinite(error):
        return 0.2
    return min(10.0, max(0.2, 0.9 * error ** (-1 / 8))) if error else 10.0
