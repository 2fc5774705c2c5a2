"""simulate: the motion of a scene by a method, sampled at given times."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mbref.equations.matrices import Matrices
from mbref.input_error import InputError
from mbref.kernels.background import compiled_in_background
from mbref.kernels.compilation import Exchangeable
from mbref.kernels.machine_code import NoGeneratedCode
from mbref.method import (
    SERIES_METHOD,
    Method,
    MethodError,
    crossing_method,
    default_method,
    may_be_series,
)
from mbref.motions.motion import Motion
from mbref.motions.pieces import is_intermittent
from mbref.motions.trajectory import Outcome
from mbref.scene import Scene
from mbref.scene.structure import without_series
from mbref.scenes import find_scene
from mbref.simulation.outcome import trajectory_of
from mbref.simulation.runs import compare_with_default, start_run
from mbref.stepping import preparation
from mbref.stepping.limits import GENERATED, Limits
from mbref.stepping.loop import DONE
from mbref.stepping.run import Run

__all__ = ["Limits", "are_compiled", "checked_times", "prepare", "simulate", "why_no_code"]

ProgressCall = Callable[[float], None] | None  # receives the reached time (s)
SAMPLES = 101  # default number of samples
BY_DEFAULT = Limits()


def simulate(
    scene: Scene | str | Path,
    method: Method | str | None = None,
    times: Sequence[float] | np.ndarray | None = None,
    limits: Limits | None = None,
    progress: Callable[[float], None] | None = None,
    *,
    duration: float | None = None,
    rtol: float | None = None,
    formulation: Callable[[Matrices], Any] | None = None,
    stabilisation: Callable[[Matrices], tuple[Any, Any]] | str = "none",
) -> Motion:
    """Simulate a scene from t = 0.

    Parameters
    ----------
    scene : Scene, str or path
        A Scene, the name of a built-in one, or a .toml file.
    method : Method or str, optional
        A method or its name. Default: the cheaper of ``taylor`` and ``alf-dual+projection/dop853``; where the
        latter ends early, ``taylor``, if the mechanism is not too large.
    times : sequence of float or ndarray, shape (k,), optional
        Increasing sample times, s. Default: 101 from 0 to the scene's duration.
    limits : Limits, optional
        Tolerances, steps and branches of the run.
    progress : callable, optional
        Called with the time reached (s) between steps.
    duration : float, optional
        End time, s, of the default sample times. Default: the scene's duration.
    rtol : float, optional
        Relative tolerance; replaces the tolerance of ``limits``.
    formulation : callable, optional
        A formulation of your own in place of a method: receives ``Matrices`` and returns q̈ (n,), or q̈ and λ
        (m,). SciPy's DOP853 takes the steps, and each evaluation calls Python: such a run is far slower.
    stabilisation : {"none", "projection"} or callable
        Correction after each step of such a run. A function receives ``Matrices`` and returns q and v.

    Returns
    -------
    Motion
        The states reached, with accelerations and reactions. A failure of the method is its outcome.

    Raises
    ------
    SceneError
        If the scene cannot be simulated, or a table ends before the last sample.
    InputError
        If times do not increase or are given beside a duration, ``limits.order`` is none of the integrator's,
        a formulation is given beside a method or a stabilisation without a formulation, or a function returns
        arrays of other shapes.
    MethodError
        If the method is unknown, has no generated code, or crosses no singular position at which ``limits``
        request a branch.
    """
    scene = find_scene(scene)
    if duration is not None:
        if times is not None:
            raise InputError("give sample times or a duration, not both")
        scene = scene.with_(duration=duration)
    limits = limits or BY_DEFAULT
    if rtol is not None:
        limits = replace(limits, rtol=rtol)
    times = checked_times(np.linspace(0.0, scene.duration, SAMPLES) if times is None else times)
    scene = scene.reaching(times[-1])
    run = _run_of(method, formulation, stabilisation, limits)
    if not is_intermittent(scene):
        return run(scene, times, progress)
    from mbref.simulation.piecewise import simulate_pieces  # only such scenes need it

    return simulate_pieces(scene, times, run, progress, limits)


def _run_of(
    method: Method | str | None,
    formulation: Callable[[Matrices], Any] | None,
    stabilisation: Any,
    limits: Limits,
) -> Callable[[Scene, np.ndarray, ProgressCall], Motion]:
    """Return the function that runs a scene, of constraints that always hold, at times (k,), s."""
    if formulation is not None:
        if method is not None:
            raise InputError("give a method or a formulation of your own, not both")
        from mbref.simulation.own_formulation import simulate_own  # only such runs need it

        return lambda scene, times, progress: simulate_own(
            scene, formulation, stabilisation, times, limits, progress
        )
    if stabilisation != "none":
        raise InputError("stabilisation: needs a formulation of your own; otherwise name it in the method")
    if method is None:
        return lambda scene, times, progress: _by_default(scene, times, limits, progress)
    by = Method.parse(method) if isinstance(method, str) else method
    return lambda scene, times, progress: run_by(by, scene, times, limits, progress)


def run_by(method: Method, scene: Scene, times: np.ndarray, limits: Limits, progress: ProgressCall) -> Motion:
    """Return the motion of a scene by a method."""
    run = checked_run(scene, method, times, limits)
    motion = finish_run(run, progress)
    run.release()
    return motion


def _by_default(scene: Scene, times: np.ndarray, limits: Limits, progress: ProgressCall) -> Motion:
    """Return the motion by the default method; by `taylor` if the sparse method ends early, as at a singular
    position, and if limits require what only `taylor` has."""
    chosen = default_method(scene)
    if limits.branches or limits.code == GENERATED:
        chosen = crossing_method(scene)
    motion = run_by(Method.parse(chosen), scene, times, limits, progress)
    if chosen == SERIES_METHOD or motion.outcome is Outcome.COMPLETED or not may_be_series(scene):
        return motion
    followed = run_by(Method.parse(SERIES_METHOD), scene, times, limits, progress)
    return followed if followed.t_end > motion.t_end else motion


def checked_run(scene: Scene, method: Method, times: np.ndarray, limits: Limits) -> Run:
    """Return the run of a scene; raises MethodError for limits that the method does not support."""
    check_method(method, scene, limits)
    try:
        return start_run(scene, method, times, limits)
    except NoGeneratedCode as reason:
        raise MethodError(f"code: no generated code for {scene.name!r} by {method}: {reason}") from None


def check_method(method: Method, scene: Scene, limits: Limits) -> None:
    """Raise MethodError for limits or loads that the method does not support, before anything is compiled."""
    if limits.branches and method.crosses != "by series":
        raise MethodError(f"branches: {method} does not cross singular positions; use taylor")
    if limits.code == GENERATED and not method.is_series:
        raise MethodError(f"code: {method} has no generated code; use taylor")
    if method.is_series and (found := without_series(scene)):
        raise MethodError(f"{method}: {found}; use {default_method(scene)}")


def finish_run(run: Run, progress: Callable[[float], None] | None = None) -> Motion:
    """Advance a run to its end, and return its motion."""
    status, seconds = run.stepper.advance(progress)
    status = compare_with_default(run, status)
    if status == DONE:
        _check_branches(run)
    return trajectory_of(run, status, seconds, run.built + run.making)


def _check_branches(run: Run) -> None:
    """Raise InputError if a branch is requested at a singular position that the motion does not pass."""
    last, passed = max(dict(run.limits.branches), default=0), len(run.crossings)
    if last > passed:
        raise InputError(
            f"branches: the motion passes {passed} singular position{'s' * (passed != 1)} up to "
            f"t = {run.times[-1]:g} s, and no number {last}"
        )


def prepare(method: Method, scene: Scene | None = None) -> None:
    """Compile the kernels of the method for a scene, or for every scene, or load them from the cache of this
    machine.

    Kernels of `taylor` are included, because runs of other methods are compared with `taylor`.
    """
    from mbref.taylor.preparation import IN_EVERY_RUN, prepare_series, prepare_series_backwards

    beside = prepare_series_backwards
    with compiled_in_background(IN_EVERY_RUN, beside.__module__, beside.__name__):
        preparation.prepare(method)
        prepare_series(scene)


def are_compiled(method: Method, scene: Scene) -> bool:
    """Return whether the kernels of the method for a scene are in the cache of this machine."""
    of_series: Sequence[Exchangeable] = ()
    if method.is_series:
        from mbref.taylor.preparation import kernels_of_series

        of_series = kernels_of_series(scene)
    return all(kernel.is_kept for kernel in (*preparation.kernels_of(method), *of_series))


def why_no_code(scene: Scene, method: Method) -> str:
    """Return the reason why no code of `taylor` can be generated for a scene; empty if it was generated.

    The kernels of the method are compiled.
    """
    prepare(method, scene)
    try:
        start_run(scene, method, np.array([scene.duration]), Limits(code=GENERATED))
    except NoGeneratedCode as reason:
        return str(reason)
    return ""


def checked_times(times: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return sample times as an array (k,); raises InputError unless they are finite, not negative and
    increasing."""
    try:
        array = np.ascontiguousarray(times, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise InputError("times: must be numbers") from None
    if array.ndim != 1 or not array.size:
        raise InputError("times: needs at least one sample time")
    if not np.isfinite(array).all() or array[0] < 0 or (array[1:] <= array[:-1]).any():
        raise InputError("times: must be finite, not negative and increasing")
    return array
