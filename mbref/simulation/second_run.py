"""Second runs: the global error of a motion, estimated by its difference from a more accurate run.

The second run integrates by `taylor` at a tolerance near rounding. Every number of its scene is changed by up
to two units in the last place. So the difference also contains the rounding of the scene's numbers and of the
start, magnified by the motion.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from mbref.equations.model import Model
from mbref.equations.offsets import assembled
from mbref.input_error import InputError
from mbref.method import MOST_BODIES, OWN, SERIES_METHOD, Method, MethodError, crossing_method
from mbref.motions.error_estimate import ErrorEstimate, distances, rounding
from mbref.motions.motion import Motion
from mbref.motions.pieces import first_piece
from mbref.scene import Scene, SceneError
from mbref.scene.structure import without_series
from mbref.simulation.simulate import simulate
from mbref.stepping.limits import AUTO, FINEST, GENERATED, Limits

# order of the Taylor series of the second run; other runs use at most order 22 at tolerances above 1e-13
ORDER = 24
# relative tolerances of the second run, the larger one also of a further run of a motion with a warning
RTOL_SERIES, RTOL_EXPLICIT = 1e-13, 1e-12
OWN_LIKE = "lm1"  # built-in method with adaptive steps and without projection, as an own formulation
TIGHTER = 0.1  # factor on the motion's own tolerance, if that gives a smaller tolerance
TIMES = ("duration", "active")  # fields of a scene that are not perturbed
UNIT = 2.0**-52  # largest relative distance between neighbouring doubles
LONGER = "; --estimate yes and with_error_estimate have no time limit"


ProgressCallback = Callable[[float], None]


def with_error_estimate(
    motion: Motion, seconds: float = np.inf, progress: ProgressCallback | None = None
) -> Motion:
    """Return the motion with its estimated global error, by a second run at a smaller tolerance.

    The second run takes about twice the time of the motion. The estimate is ``error_estimate``, and its
    warning, if any, is part of ``message``.

    Parameters
    ----------
    motion : Motion
        A motion that ``simulate`` returned.
    seconds : float
        Limit of CPU time, s, of the motion and of its second run; a longer run has no estimate.
    progress : callable, optional
        Called with the time reached (s) between steps of the second run.

    Returns
    -------
    Motion
        The motion, whose ``error_estimate.error`` (k,) is relative or in rad.

    Raises
    ------
    InputError
        If the motion is of another engine than mbref.
    """
    estimate = _estimate(motion, seconds, progress)
    message = "; ".join(filter(None, (motion.message, estimate.warning)))
    return replace(motion, message=message, error_estimate=estimate)


def _estimate(motion: Motion, seconds: float, progress: ProgressCallback | None) -> ErrorEstimate:
    """Return the estimated error of a motion."""
    if motion.engine != "mbref":
        raise InputError(f"error_estimate: a motion of {motion.engine}; crosscheck judges other engines")
    is_own = motion.method.startswith(OWN)
    method = Method.parse(OWN_LIKE if is_own else motion.method)
    limits = Limits(**{f.name: motion.settings[f.name] for f in fields(Limits)})
    rtol = limits.rtol if method.integrator.adaptive else None
    if reason := _none(motion, seconds):
        return ErrorEstimate.none(motion.times, rtol, reason)
    check = _Check(seconds, progress)
    by, finer = _finer(motion.mechanism, method, limits)
    second = _second_run(motion, by, finer, check)
    error = np.maximum(second.distances(motion), rounding(motion, second.length))
    reason = second.reason if second.is_short(motion) else ""
    estimate = ErrorEstimate(motion.times, error, rtol, f"{by}, rtol {finer.rtol:g}", reason)
    if is_own or not estimate.warning or limits.rtol <= RTOL_EXPLICIT:
        return estimate
    tighter = replace(limits, rtol=RTOL_EXPLICIT, atol=None, compared=False)
    tried = _run(lambda: motion.mechanism, method, motion.times, tighter, check)
    if tried.motion is None or tried.is_short(motion):
        return estimate
    return replace(estimate, tighter=(RTOL_EXPLICIT, float(np.nanmax(second.distances(tried.motion)))))


def _none(motion: Motion, seconds: float) -> str:
    """Return the reason why no second run is made; empty if a second run is made."""
    if not motion.times.size:
        return "the run has no sample"
    spent = motion.cost.seconds
    return f"the run took {spent:.2g} s, more than {seconds:g} s{LONGER}" if spent > seconds else ""


def _second_run(motion: Motion, by: Method, limits: Limits, check: _Check) -> _Made:
    """Return the run of the perturbed scene. If the run of the perturbed scene ends early, return the run of
    the scene itself: rounding may end the perturbed run at a singular position from which the motion starts.
    """
    scene = motion.mechanism
    found = _run(lambda: perturbed(scene), by, motion.times, limits, check)
    if not found.is_short(motion):
        return found
    other = _run(lambda: scene, by, motion.times, limits, check)
    return found if found.count >= other.count else other


def perturbed(scene: Scene) -> Scene:
    """Return the scene with its numbers changed by up to two units in the last place; zeros stay zeros.

    Raises SceneError if such a scene is not valid.
    """
    random = np.random.default_rng(1)

    def changed(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: item if key in TIMES else changed(item) for key, item in value.items()}
        if isinstance(value, list):
            return [changed(item) for item in value]
        return value * (1.0 + random.uniform(-2.0, 2.0) * UNIT) if isinstance(value, float) else value

    return Scene(**changed(scene.to_dict()))


def _finer(scene: Scene, method: Method, limits: Limits) -> tuple[Method, Limits]:
    """Return method and limits of the more accurate second run, from which the error is estimated."""
    if method.is_series or (len(scene.body) <= MOST_BODIES and not without_series(scene)):
        by = Method.parse(f"{SERIES_METHOD}[order={ORDER}]")
    elif method.integrator.adaptive and method.stabilisation.projects:
        by = method
    else:
        by = Method.parse(crossing_method(scene))
    rtol = max(FINEST, min(RTOL_SERIES if by.is_series else RTOL_EXPLICIT, TIGHTER * limits.rtol))
    if not method.is_series:
        return by, Limits(rtol=rtol)
    code = AUTO if limits.code == GENERATED else limits.code
    return by, replace(limits, rtol=rtol, atol=None, forced_step=0.0, code=code)


@dataclass(frozen=True)
class _Made:
    """A second run: its motion, the mechanism's length (m), and the reason of an early end."""

    motion: Motion | None
    length: float
    reason: str

    @property
    def count(self) -> int:
        """Number of samples."""
        return 0 if self.motion is None else len(self.motion.times)

    def is_short(self, other: Motion) -> bool:
        """Return whether the run has fewer samples than another one."""
        return self.count < len(other.times)

    def distances(self, other: Motion) -> np.ndarray:
        """Return the largest distance (k,) of a body from its position in another motion.

        Distances are relative to the mechanism's length, or angles in rad. Distances after the end of the run
        are NaN.
        """
        found = np.full(len(other.times), np.nan)
        if self.motion is not None:
            k = min(self.count, len(other.times))
            own, theirs = ((m.position[:k], m.orientation[:k]) for m in (self.motion, other))
            found[:k] = distances(own, theirs, self.length)
        return found


class _TooLong(Exception):
    """A second run exceeds its time limit."""


class _Check:
    """Progress callback of second runs; raises _TooLong after a number of CPU seconds."""

    def __init__(self, seconds: float, progress: ProgressCallback | None):
        self._seconds, self._progress = seconds, progress
        self._end = time.process_time() + seconds

    def __call__(self, reached: float) -> None:
        """Report the reached time, s."""
        if time.process_time() > self._end:
            raise _TooLong(f"a second run takes longer than {self._seconds:g} s{LONGER}")
        if self._progress is not None:
            self._progress(reached)


def _run(
    scene: Callable[[], Scene], method: Method, times: np.ndarray, limits: Limits, check: _Check
) -> _Made:
    """Return a run within the time limit of second runs."""
    try:
        own = scene()
        motion = simulate(own, method, times, limits, check)
    except (SceneError, MethodError, InputError, _TooLong) as error:
        return _Made(None, 1.0, str(error))
    length = Model(assembled(first_piece(own))).length
    return _Made(motion, length, f"the second run ended at t = {motion.t_end:.3g} s: {motion.message}")
