"""Trial runs: how far `taylor` follows a motion on which another method failed, so that advice is
reliable."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any
from weakref import WeakKeyDictionary

from mbref.input_error import InputError
from mbref.method import MOST_BODIES, SERIES_METHOD, Method
from mbref.scene.structure import bushings
from mbref.simulation.start_run import start_run
from mbref.stepping.limits import GENERIC, Limits
from mbref.stepping.loop import DONE, UNDECIDED
from mbref.stepping.run import Run

MOST_TRIAL_STEPS = 2000  # largest number of steps of a trial, which takes a fraction of a second


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
    if run.method.is_series or len(run.scene.body) > MOST_BODIES or bushings(run.scene):
        return None
    from mbref.taylor.preparation import KERNELS_OF_SERIES  # other methods do not import the series otherwise

    if not all(kernel.is_kept for kernel in KERNELS_OF_SERIES):
        return None
    limits = Limits(code=GENERIC, most_steps=MOST_TRIAL_STEPS)
    trial = start_run(run.scene, Method.parse(SERIES_METHOD), run.times, limits)
    status, _ = trial.stepper.advance(None)
    reached = float(trial.memory.loop.clock.time)
    trial.release()
    return Trial(status == DONE, reached)
