"""Runs that nothing holds to their branch: completed only on the motion that one with projection follows.

Without projection nothing but the accelerations holds a run to its branch.  At a singular position they are
ill-determined, and a pseudo-inverse whose rank drops there lets the run go on along another branch with all
constraints and its energy intact.  Beside one, the same happens to a partition whose dependent coordinates
jump.  With projection it happens where a coarse rank tolerance drops rows that are independent.
"""

from __future__ import annotations

import time

import numpy as np

from mbref import rotations
from mbref.method import DEFAULT, SHORT, Method
from mbref.simulation.limits import GENERIC, Limits
from mbref.simulation.run import Run
from mbref.simulation.stepping import CREEPING, DONE, LEFT_MOTION, TOO_MANY_STEPS, UNDECIDED
from mbref.taylor.run import CrossingRun, TaylorRun

MOST_STEPS = 100_000
TOLERANCE = 1e-10  # of the projected run
OFF = (1e3, 1e-6)  # lengths or rad by which a run may be off: over its tolerance, and whatever that is
DROPS = 1e-10  # rank tolerance above which independent rows may be dropped
COARSE = 0.1  # the same of a run in fixed steps, whose error its tolerance does not limit


def compare_with_default(run: Run, ended: int) -> int:
    """The status of a run that ended with one, after comparing its samples with those of one with projection.

    LEFT_MOTION where it left the motion, whose samples end there; UNDECIDED, at the time of the clock, where
    the projected run does not tell a branch of a run that is DONE; else as it was.  A run that projection
    holds, or that reached no sample, is not compared.
    """
    clock = run.memory.loop.clock
    if not (clock.sample and _may_leave(run) and run.limits.compared):
        return ended
    began = time.process_time()
    projected, status = _held(run)
    run.making += time.process_time() - began
    theirs = projected.memory.loop.clock
    off = _distances(run, projected, min(int(theirs.sample), int(clock.sample))) > _allowed(run)
    if off.any():
        clock.sample = np.argmax(off)
        clock.time = run.times[clock.sample]
        return LEFT_MOTION
    if ended != DONE or status != UNDECIDED:
        return ended
    clock.time = theirs.time
    return UNDECIDED


def _held(run: Run) -> tuple[Run, int]:
    """A run of the same scene that projection holds, and how it ended: by series where the default method
    fails otherwise than at a branch or by its steps."""
    limits = Limits(rtol=TOLERANCE, code=GENERIC, most_steps=MOST_STEPS)
    projected: Run = CrossingRun(run.scene, Method.parse(DEFAULT), run.times, limits)
    status, _ = projected.advance(None)
    if status in (DONE, UNDECIDED, TOO_MANY_STEPS, CREEPING):
        return projected, status
    series = TaylorRun(run.scene, Method.parse(SHORT["taylor"]), run.times, limits)
    of_series, _ = series.advance(None)
    if series.memory.loop.clock.sample < projected.memory.loop.clock.sample:
        return projected, status
    return series, of_series


def _may_leave(run: Run) -> bool:
    held = run.method.stabilisation.projects and run.limits.rank_tolerance <= DROPS
    return run.model.closed_loops > 0 and not held


def _allowed(run: Run) -> float:
    rtol = float(run.memory.control.rtol)
    return max(OFF[0] * rtol, OFF[1]) if run.method.integrator.adaptive else COARSE


def _distances(run: Run, other: Run, samples: int) -> np.ndarray:
    """The largest distance (k,) of a body at each of the first samples: over the length, or rad."""
    mine, theirs = (r.memory.loop.samples.coordinates[:samples] for r in (run, other))
    mine, theirs = (q.reshape(samples, run.model.nb, 7) for q in (mine, theirs))
    places = np.linalg.norm(mine[..., :3] - theirs[..., :3], axis=-1) / run.model.length
    turns = rotations.angle_between(mine[..., 3:], theirs[..., 3:])
    return np.maximum(places, turns).max(axis=-1, initial=0.0)
