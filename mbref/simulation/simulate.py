"""simulate: a scene by a method, sampled at given times."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from mbref.scene import Scene
from mbref.simulation.method import Method, MethodError
from mbref.simulation.outcome import trajectory_of
from mbref.simulation.run import SPECIALISED, Limits, Run, prepare
from mbref.specialised import Untraceable
from mbref.trajectory import Trajectory

__all__ = ["Limits", "checked_times", "prepare", "simulate", "why_no_code"]


def simulate(
    scene: Scene,
    method: Method | str,
    times: Sequence[float] | np.ndarray,
    limits: Limits | None = None,
    progress: Callable[[float], None] | None = None,
) -> Trajectory:
    """Simulate from t = 0 and sample at ``times`` (k,), increasing, s; ``progress`` is told the time reached.

    The method "kinematic" integrates nothing (``integrators.predictor``).
    Returns the states reached, with accelerations and reactions; a failure of the method is the
    trajectory's outcome.  Raises SceneError for a scene that cannot be simulated, ValueError for times
    that do not increase or an order the integrator does not have, MethodError for an unknown method name
    and where ``limits`` ask for machine code that the method or the scene cannot have.
    """
    times = checked_times(times)
    method = Method.parse(method) if isinstance(method, str) else method
    limits = limits or Limits()
    began = time.process_time()
    try:
        run = Run(scene, method, times, limits)
    except Untraceable as reason:
        raise MethodError(f"no machine code for {scene.name!r} by {method}: {reason}") from None
    built = time.process_time() - began - run.making
    status, seconds = run.advance(progress)
    return trajectory_of(run, status, seconds, built + run.making)


def why_no_code(scene: Scene, method: Method) -> str:
    """Why a scene cannot have machine code of its own by this method; empty where it can, and now has it."""
    try:
        Run(scene, method, np.array([scene.duration]), Limits(code=SPECIALISED))
    except Untraceable as reason:
        return str(reason)
    return ""


def checked_times(times: Sequence[float] | np.ndarray) -> np.ndarray:
    """Sample times as an array (k,); ValueError unless finite, not negative and increasing."""
    array = np.ascontiguousarray(times, dtype=float)
    if array.ndim != 1 or not array.size:
        raise ValueError("times: needs at least one sample time")
    if not np.isfinite(array).all() or array[0] < 0 or np.any(np.diff(array) <= 0):
        raise ValueError("times: must be finite, not negative and increasing")
    return array
