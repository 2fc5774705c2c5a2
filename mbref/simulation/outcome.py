"""results: what a run reached, as a trajectory; the one place where a failure becomes an Outcome."""

from __future__ import annotations

from dataclasses import asdict

from mbref import __version__
from mbref.equations.joint_reactions import reactions
from mbref.kernels.layout import (
    CROSSINGS,
    EVALUATIONS,
    FACTORISATIONS,
    NEWTON,
    NOT_CONVERGED,
    NOT_FINITE,
    PHI,
    REJECTED,
    ROWS,
    SINGULAR,
    SMALLEST_STEP,
    STEPS,
    VIOLATION,
)
from mbref.simulation.run import Run
from mbref.simulation.stepping import DONE, ROW, SAMPLE, STEP_TOO_SMALL, TIME, TOO_MANY_STEPS, VIOLATED
from mbref.trajectory import Cost, Outcome, Trajectory

OUTCOMES = {
    DONE: Outcome.COMPLETED,
    SINGULAR: Outcome.SINGULAR_MATRIX,
    NOT_CONVERGED: Outcome.NOT_CONVERGED,
    NOT_FINITE: Outcome.NOT_FINITE,
    VIOLATED: Outcome.VIOLATION,
    STEP_TOO_SMALL: Outcome.STEP_FAILED,
    TOO_MANY_STEPS: Outcome.STEP_FAILED,
}


def trajectory_of(run: Run, status: int, seconds: float, built: float) -> Trajectory:
    """The samples reached, in the scene's frames and units."""
    model, reached = run.model, int(run.place[SAMPLE])
    q, v, a, multipliers = (sample[:reached] for sample in run.samples)
    nb = model.nb
    q, v, a = q.reshape(reached, nb, 7), v.reshape(reached, nb, 6), a.reshape(reached, nb, 6)
    counts = run.counts
    return Trajectory(
        scene=run.scene.name,
        engine="mbref",
        version=__version__,
        method=str(run.method),
        settings=asdict(run.limits),
        times=run.times[:reached],
        bodies=tuple(body.name for body in run.scene.body),
        **model.motion(q, v, a),
        reactions=reactions(model, run.times[:reached], q, v, multipliers),
        outcome=OUTCOMES[status],
        t_end=float(run.clock[TIME]),
        message=_message(run, status),
        cost=Cost(
            seconds,
            built,
            int(counts[STEPS]),
            int(counts[REJECTED]),
            int(counts[EVALUATIONS]),
            int(counts[FACTORISATIONS]),
            int(counts[NEWTON]),
        ),
    )


def _message(run: Run, status: int) -> str:
    """One sentence: what ended the run, where; or what was corrected at its start."""
    if status == DONE:
        crossings = int(run.counts[CROSSINGS])
        passed = f"singular positions passed: {crossings}" if crossings else ""
        return "; ".join(filter(None, (run.start.report(), passed)))
    t = run.clock[TIME]
    if status == VIOLATED:
        row = int(run.place[ROW])
        size = abs(run.work[ROWS][PHI, row])
        return (
            f"joint {run.model.row_joint[row]!r} is violated by {size:.3g}, more than "
            f"{run.control[VIOLATION]:.3g}, at t = {t:.6g} s"
        )
    if status == TOO_MANY_STEPS:
        return f"{run.limits.most_steps} steps were taken without reaching the end, at t = {t:.6g} s"
    if status == STEP_TOO_SMALL:
        h = run.control[SMALLEST_STEP]
        return f"the error estimate asks for a step below {h:.3g} s at t = {t:.6g} s"
    return f"{OUTCOMES[status].sentence} at t = {t:.6g} s ({run.method.formulation.name})"
