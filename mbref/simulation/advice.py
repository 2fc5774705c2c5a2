"""Advice for a run that failed: another method or limits, or more digits of the scene's numbers.

`taylor` is suggested only if a trial run completes the motion. Without a trial, properties of method and
scene decide. Loops that are redundant at the start, and that a small motion opens, have rounded numbers.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mbref.equations.counts import RANK_TOLERANCE, counts, scaled_jacobian
from mbref.equations.model import displaced
from mbref.formulations import FORMULATIONS
from mbref.kernels.layout import NOT_CONVERGED, SINGULAR
from mbref.linear_algebra.least_norm import null_space
from mbref.scene.scene import functions_of
from mbref.scene.structure import without_series
from mbref.simulation.runs import passes_with, trial_of
from mbref.stepping.loop import (
    CREEPING,
    LEFT_MOTION,
    STEP_TOO_SMALL,
    TOO_MANY_STEPS,
    UNDECIDED,
    VIOLATED,
)
from mbref.stepping.run import Run

OTHER = 2  # number of the first branch that is not the smooth one
FOLLOWS, COMPLETES = "taylor crosses singular positions", "taylor completes this motion"
CORRECTS = "+projection corrects violations after every step"
FINE = 1e-13  # smallest tolerance that is tried where rounding would decide the branch
MAY_DECIDE = "a smaller rtol or another branch may let the motion go on"
MAY_DECIDE_ALONE = "a smaller rtol may let the motion go on"
POSE_STEP = 0.1  # m and rad; largest change of a coordinate on the way to a nearby pose
POSE_ITERATIONS = 12  # of Newton's method, which converges from a pose within POSE_STEP of a closed one
LEAST_GAP = 100  # gap / rounding of the largest coordinate; smaller gaps are of Newton's method
MOST_GAP = 1e-5  # gap, m or rad, of numbers with five digits; a larger gap is of a singular start
MOST_ADVISED_ROWS = 300  # larger matrices take seconds
ADVICE = (
    "a small motion opens redundant loops by {:.1g} m or rad, so that the file's numbers seem to be rounded: "
    "give the axes and points of the joints with 12 digits"
)


def remedy(run: Run, status: int) -> str:
    """Return a clause that names a method or a change that avoids the failure; empty if no remedy is
    known."""
    if status == SINGULAR:
        return _of_singular_matrix(run)
    if status == NOT_CONVERGED:
        return _of_iteration(run)
    if status in (STEP_TOO_SMALL, TOO_MANY_STEPS, CREEPING):
        return _of_steps(run)
    if status == UNDECIDED:
        return _of_branch(run)
    if status == VIOLATED:
        rolls, by = run.model.structure.velocity_rows.size > 0, run.method.stabilisation
        return "" if by.projects or (rolls and by.chooses_coordinates) else CORRECTS
    return _follows(run) if status == LEFT_MOTION else ""


def _of_branch(run: Run) -> str:
    """Return the advice on a tolerance and on the choice of a branch; both are tried first."""
    if without_series(run.scene):
        return MAY_DECIDE_ALONE
    number = len(run.crossings) + 1
    changes: dict[str, dict[str, Any]] = {
        f"rtol {FINE:g}": {"rtol": FINE, "atol": None},
        f"--branch {number}={OTHER}": {"branches": {**dict(run.limits.branches), number: OTHER}},
    }
    if run.limits.rtol <= FINE:
        changes.pop(f"rtol {FINE:g}")
    passes = {change: passes_with(run, **limits) for change, limits in changes.items()}
    if None in passes.values():
        return MAY_DECIDE
    good = [change for change, does in passes.items() if does]
    if good:
        return f"the motion goes on with {' or '.join(good)}"
    neither = (
        f"neither {' nor '.join(passes)} lets" if len(passes) > 1 else f"{next(iter(passes))} does not let"
    )
    time = run.memory.loop.clock.time
    end = ": end it before this time" if time > 0.0 else ""
    rows = {row[0] for function in functions_of(run.scene) for row in function.table or ()}
    move = ", or move the row of a table that is at this time" if time in rows and time > 0.0 else ""
    return f"{neither} the motion go on{end}{move}"


def _follows(run: Run) -> str:
    """Return the advice to use `taylor`; empty if `taylor` does not complete the motion."""
    if trial_of(run) is None:
        return "" if run.method.is_series or without_series(run.scene) else FOLLOWS
    return _completes(run)


def _of_singular_matrix(run: Run) -> str:
    formulation, scene = run.method.formulation, run.scene
    if loose := _undetermined(run):
        return f"nothing determines the motion of body {loose!r}, which has mass 0"
    masses = run.model.mass[: 6 * len(scene.body)].reshape(-1, 6)
    massless = [body.name for body, m in zip(scene.body, masses, strict=True) if not m.all()]
    found = counts(scene)
    if massless and not formulation.handles_singular_mass:
        able = _completes(run) or _bearing(mass=True, redundancy=found.redundant > 0)
        return f"body {massless[0]!r} lacks mass or a moment of inertia; {able}"
    if found.redundant and not formulation.handles_redundancy:
        able = _completes(run) or _bearing(redundancy=True)
        return f"constraint rows are redundant ({found.redundant} of {found.rows}); {able}"
    return _follows(run) if run.model.closed_loops else ""


def _undetermined(run: Run) -> str:
    """Return the body of mass 0 that moves most if bodies with mass stay; empty if all bodies stay then."""
    places = [b for b, body in enumerate(run.scene.body) if body.mass == 0]
    if not places:
        return ""
    columns = [6 * b + k for b in places for k in range(6)]
    rows = scaled_jacobian(run.model, 0.0, run.start.q)[:, columns]
    _, sizes, motions = np.linalg.svd(np.vstack([rows, np.zeros((len(columns), len(columns)))]))
    if sizes[-1] > RANK_TOLERANCE:
        return ""
    moved = np.abs(motions[-1]).reshape(-1, 6).max(axis=1)
    return run.scene.body[places[int(moved.argmax())]].name


def _completes(run: Run) -> str:
    """Return a clause that `taylor` completes the motion; empty if `taylor` does not, or if no trial run was
    made."""
    trial = trial_of(run)
    return COMPLETES if trial is not None and trial.completed else ""


def _bearing(mass: bool = False, redundancy: bool = False) -> str:
    """Return the advice to use a formulation that accepts a singular mass matrix or redundant rows."""
    able = [
        f.name
        for f in FORMULATIONS.values()
        if (f.handles_singular_mass or not mass)
        and (f.handles_redundancy or not redundancy)
        and not f.needs_independent_columns
    ]
    return "use " + " or ".join(filter(None, (", ".join(able[:-1]), able[-1])))


def _of_iteration(run: Run) -> str:
    if run.method.formulation.name.startswith("alf"):
        return _completes(run) or "mpi-svd and mpi-qr solve without iteration"
    return _follows(run)


def _of_steps(run: Run) -> str:
    if run.method.is_series or not run.model.closed_loops:
        return "mbref diagnose prints the distance of the motion from singular positions"
    return _follows(run)


def advice_on_rounding(run: Run) -> str:
    """Return the advice to give more digits; empty if redundant rows stay consistent along a small motion."""
    if run.model.m > MOST_ADVISED_ROWS:
        return ""
    gap, size = gap_of(run), max(1.0, np.abs(run.start.q).max(initial=0.0))
    return ADVICE.format(gap) if LEAST_GAP * np.finfo(float).eps * size < gap < MOST_GAP else ""


def gap_of(run: Run) -> float:
    """Return the largest |Φ| (m or rad) that Newton's method leaves near the start, at the rank of the
    start."""
    model, q = run.model, run.start.q
    jacobian = scaled_jacobian(model, 0.0, q)
    space = null_space(jacobian, RANK_TOLERANCE)
    rank, free = model.n - space.shape[1], space.sum(axis=1)
    if not free.any() or rank == model.m:
        return 0.0
    q = displaced(q, POSE_STEP * free / np.abs(free).max())
    for _ in range(POSE_ITERATIONS):
        found = model.terms(0.0, q, np.zeros(model.n))
        u, sizes, vt = np.linalg.svd(found.jacobian, full_matrices=False)
        q = displaced(q, -vt[:rank].T @ (u[:, :rank].T @ found.phi / sizes[:rank]))
    return float(np.abs(model.terms(0.0, q, np.zeros(model.n)).phi).max())
