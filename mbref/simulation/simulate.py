"""simulate: a scene by a method, sampled at given times."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from mbref.kernels.beside import compiled_beside
from mbref.kernels.machine_code import NoGeneratedCode
from mbref.method import DEFAULT, Method, MethodError
from mbref.motion import Motion
from mbref.scene import Scene
from mbref.scenes import find_scene
from mbref.simulation import preparation
from mbref.simulation.limits import GENERATED, Limits
from mbref.simulation.outcome import trajectory_of
from mbref.simulation.run import Run
from mbref.simulation.stepping import DONE
from mbref.taylor.check import compare_with_default
from mbref.taylor.run import CrossingRun, TaylorRun
from mbref.taylor.series_run import KERNELS_OF_SERIES, prepare_series

__all__ = ["Limits", "are_compiled", "checked_times", "prepare", "simulate", "why_no_code"]

SAMPLES = 101  # where no times are asked for


def simulate(
    scene: Scene | str | Path,
    method: Method | str = DEFAULT,
    times: Sequence[float] | np.ndarray | None = None,
    limits: Limits | None = None,
    progress: Callable[[float], None] | None = None,
) -> Motion:
    """Simulate from t = 0 and sample at ``times`` (k,), increasing, s; ``progress`` is told the time reached.

    ``scene`` is a Scene, the name of a built-in one or a .toml file; without ``times``, 101 equally spaced
    ones from 0 to the scene's duration.  The method "kinematic" integrates nothing
    (``integrators.predictor``).
    Returns the states reached, with accelerations and reactions; a failure of the method is the
    motion's outcome.  Raises SceneError for a scene that cannot be simulated, ValueError for times
    that do not increase or an order the integrator does not have, MethodError for an unknown method name
    and where ``limits`` ask for generated code that the method or the scene cannot have, or for a branch of a
    method that does not look for singular positions.
    """
    scene = scene if isinstance(scene, Scene) else find_scene(str(scene))
    times = checked_times(np.linspace(0.0, scene.duration, SAMPLES) if times is None else times)
    method = Method.parse(method) if isinstance(method, str) else method
    limits = limits or Limits()
    if limits.branches and not method.stabilisation.projects:
        raise MethodError(
            f"branches: {method} does not look for singular positions; +projection and taylor do"
        )
    run = begun(scene, method, times, limits)
    motion = completed(run, progress)
    run.give_back()
    return motion


def begun(scene: Scene, method: Method, times: np.ndarray, limits: Limits) -> Run:
    """The run of a scene, ready to be advanced."""
    began = time.process_time()
    if limits.code == GENERATED and not is_series(method):
        raise MethodError(f"code: {method} has no generated code; taylor has")
    try:
        run = kind_of(method)(scene, method, times, limits)
    except NoGeneratedCode as reason:
        raise MethodError(f"code: no generated code for {scene.name!r} by {method}: {reason}") from None
    run.built = time.process_time() - began - run.making
    return run


def completed(run: Run, progress: Callable[[float], None] | None = None) -> Motion:
    """The motion of a run, advanced to its end."""
    status, seconds = run.advance(progress)
    status = compare_with_default(run, status)
    if status == DONE:
        _check_branches(run)
    return trajectory_of(run, status, seconds, run.built + run.making)


def _check_branches(run: Run) -> None:
    """Raise ValueError where a branch was asked for at a singular position that the motion does not pass."""
    last, passed = max(dict(run.limits.branches), default=0), len(run.crossings)
    if last > passed:
        raise ValueError(
            f"branches: the motion passes {passed} singular positions up to t = {run.times[-1]:g} s, "
            f"there is no number {last}"
        )


def is_series(method: Method) -> bool:
    """Whether the method integrates by Taylor series, the only one with generated code."""
    return not method.integrator.step


def kind_of(method: Method) -> type[Run]:
    """How a run of the method treats singular positions."""
    if is_series(method):
        return TaylorRun
    return CrossingRun if method.stabilisation.projects else Run


def prepare(method: Method) -> None:
    """Compile the kernels of the method, or load them from the cache of this machine.

    Those of the default method and of Taylor series are among them: comparisons and crossings need them.
    """
    with compiled_beside(KERNELS_OF_SERIES, prepare_series.__module__, prepare_series.__name__):
        preparation.prepare(method)
        preparation.prepare(Method.parse(DEFAULT))
    prepare_series()


def are_compiled(method: Method) -> bool:
    """Whether the kernels of a run by the method are in the cache of this machine."""
    return all(kernel.is_kept for kernel in preparation.kernels_of(method))


def why_no_code(scene: Scene, method: Method) -> str:
    """The reason why a scene cannot have generated code by `taylor`; empty where it can, and now has it.

    Compiles the kernels of the method.
    """
    prepare(method)
    try:
        TaylorRun(scene, method, np.array([scene.duration]), Limits(code=GENERATED))
    except NoGeneratedCode as reason:
        return str(reason)
    return ""


def checked_times(times: Sequence[float] | np.ndarray) -> np.ndarray:
    """Sample times as an array (k,); ValueError unless finite, not negative and increasing."""
    try:
        array = np.ascontiguousarray(times, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise ValueError("times: must be numbers") from None
    if array.ndim != 1 or not array.size:
        raise ValueError("times: needs at least one sample time")
    if not np.isfinite(array).all() or array[0] < 0 or np.any(np.diff(array) <= 0):
        raise ValueError("times: must be finite, not negative and increasing")
    return array
