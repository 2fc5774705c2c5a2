"""Runs of a scene: their start, their comparison with the default method, and trials by `taylor`.

Without projection only the accelerations keep a run on its branch. At a singular position the accelerations
are ill-determined. A pseudo-inverse whose rank drops at the singular position lets the run continue along
another branch, without violating constraints or energy balance. Near a singular position coordinate
partitioning can also change the branch, if its dependent coordinates jump. A projected run may change branch
where it came near a singular position, or where a coarse rank tolerance drops independent rows. Such runs
count as completed only if they agree with the motion of the default method.

A trial shows how far `taylor` follows a motion on which another method failed, so that advice is reliable.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from mbref.input_error import InputError
from mbref.kernels.layout import SINGULAR_AHEAD
from mbref.method import MOST_BODIES, SERIES_METHOD, Method, crossing_method
from mbref.motions.error_estimate import distances
from mbref.scene import Scene
from mbref.scene.structure import without_series
from mbref.stepping.explicit import ExplicitStepper
from mbref.stepping.limits import GENERIC, Limits
from mbref.stepping.loop import DONE, LEFT_MOTION, UNDECIDED
from mbref.stepping.run import Run, Stepper

MOST_COMPARED_STEPS = 100_000  # steps of the run by the default method
TOLERANCE = 1e-10  # relative tolerance of the run by the default method
# allowed distance (lengths of the mechanism or rad): a multiple of the run's tolerance, and a least value
OFF = (1e3, 1e-6)
DROPS = 1e-10  # rank tolerance above which independent rows may be dropped
NEAR = 0.1  # relative pivot below which a projected run was near a singular position
COARSE = 0.1  # allowed distance (lengths or rad) of a run in fixed steps, whose error no tolerance limits
MOST_TRIAL_STEPS = 2000  # largest number of steps of a trial, which takes a fraction of a second


def start_run(scene: Scene, method: Method, times: np.ndarray, limits: Limits) -> Run:
    """Return the run of a scene, ready to be advanced; its stepper may raise NoGeneratedCode."""
    stepper = _series_stepper(scene) if method.is_series else ExplicitStepper
    began = time.process_time()
    run = Run(scene, method, times, limits, stepper)
    run.built = time.process_time() - began - run.making
    return run


def _series_stepper(scene: Scene) -> Callable[[Run], Stepper]:
    """Return the stepper of Taylor series, with its kernels for a scene loaded; other methods do not import
    it."""
    from mbref.taylor.preparation import prepare_series
    from mbref.taylor.stepper import SeriesStepper

    prepare_series(scene)
    return SeriesStepper


def compare_with_default(run: Run, ended: int) -> int:
    """Return the status of a run after comparing its samples with the default method.

    ``ended`` is the status before the comparison. The result is LEFT_MOTION if the distance at a sample
    exceeds the allowed one; samples then end there. The result is UNDECIDED if the run was DONE and the
    default method does not continue; otherwise the result is ``ended``. Runs that cannot leave their motion,
    and runs without a sample, are not compared.
    """
    clock = run.memory.loop.clock
    if not (clock.sample and may_leave(run) and run.limits.compared):
        return ended
    began = time.process_time()
    limits = Limits(rtol=TOLERANCE, code=GENERIC, most_steps=MOST_COMPARED_STEPS)
    reference = start_run(run.scene, Method.parse(crossing_method(run.scene)), run.times, limits)
    status, _ = reference.stepper.advance(None)
    run.making += time.process_time() - began
    theirs = reference.memory.loop.clock
    off = _distances(run, reference, min(int(theirs.sample), int(clock.sample))) > _allowed(run)
    reached = float(theirs.time)
    reference.release()
    if off.any():
        clock.sample = np.argmax(off)
        clock.time = run.times[clock.sample]
        return LEFT_MOTION
    if ended != DONE or status not in (UNDECIDED, SINGULAR_AHEAD):
        return ended
    clock.time = reached
    return UNDECIDED


def may_leave(run: Run) -> bool:
    """Return whether a run may have left its motion without a failure."""
    method, drops = run.method, run.limits.rank_tolerance > DROPS
    near = not method.is_series and run.memory.watch.nearest < NEAR
    return run.model.closed_loops > 0 and (near or drops or not method.stabilisation.projects)


def _allowed(run: Run) -> float:
    rtol = float(run.memory.control.rtol)
    return max(OFF[0] * rtol, OFF[1]) if run.method.integrator.adaptive else COARSE


def _distances(run: Run, other: Run, samples: int) -> np.ndarray:
    """Return the largest distance (k,) of a body at each of the first samples: over the length, or rad."""
    mine, theirs = (
        r.memory.loop.samples.coordinates[:samples].reshape(samples, run.model.nb, 7) for r in (run, other)
    )
    return distances((mine[..., :3], mine[..., 3:]), (theirs[..., :3], theirs[..., 3:]), run.model.length)


_TRIALS: WeakKeyDictionary[Run, Trial | None] = WeakKeyDictionary()


@dataclass(frozen=True)
class Trial:
    """End of a trial: whether the motion was completed, and the time reached, s."""

    completed: bool
    reached: float


def trial_of(run: Run) -> Trial | None:
    """Return the trial of a run, which is made once.

    None for a run of `taylor` itself, for more than 100 bodies, for bushings, and before the kernels of
    `taylor` are compiled.
    """
    if run not in _TRIALS:
        _TRIALS[run] = _made(run)
    return _TRIALS[run]


def passes_with(run: Run, **changes: Any) -> bool | None:
    """Return whether a run of `taylor` that ended UNDECIDED passes its last singular position with changed
    limits.

    None if the motion has more than 100 bodies, or if the run took more than MOST_TRIAL_STEPS steps.
    """
    steps = int(run.memory.equations.system.counts.steps)
    if not run.method.is_series or len(run.scene.body) > MOST_BODIES or steps > MOST_TRIAL_STEPS:
        return None
    limits = replace(run.limits, code=GENERIC, most_steps=MOST_TRIAL_STEPS, **changes)
    trial = start_run(run.scene, run.method, run.times, limits)
    try:
        status, _ = trial.stepper.advance(None)
    except InputError:  # a requested branch that does not exist
        return False
    passed = len(trial.crossings) > len(run.crossings)
    trial.release()
    return passed or status != UNDECIDED


def _made(run: Run) -> Trial | None:
    if run.method.is_series or len(run.scene.body) > MOST_BODIES or without_series(run.scene):
        return None
    from mbref.taylor.preparation import kernels_of_series  # other methods do not import the series otherwise

    if not all(kernel.is_kept for kernel in kernels_of_series(run.scene)):
        return None
    limits = Limits(code=GENERIC, most_steps=MOST_TRIAL_STEPS)
    trial = start_run(run.scene, Method.parse(SERIES_METHOD), run.times, limits)
    status, _ = trial.stepper.advance(None)
    reached = float(trial.memory.loop.clock.time)
    trial.release()
    return Trial(status == DONE, reached)
