"""The samples of a run as a Motion; every failure becomes an Outcome here."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from mbref.equations.branches import Passed, branches_passed, tangents
from mbref.equations.initial_state import Start
from mbref.equations.joint_reactions import lazy_reactions
from mbref.equations.lazy import LazySequence
from mbref.equations.model import Model
from mbref.equations.offsets import assembled, counted_angles
from mbref.kernels.layout import NOT_CONVERGED, NOT_FINITE, SINGULAR, SINGULAR_AHEAD
from mbref.method import Method, default_method
from mbref.motions.crossing import Crossing
from mbref.motions.motion import Motion
from mbref.motions.trajectory import Cost, Outcome
from mbref.scene import Scene
from mbref.scene.structure import bushings, without_series
from mbref.simulation import VERSION
from mbref.simulation.advice import advice_on_rounding, remedy
from mbref.simulation.end_positions import BEYOND, REDUNDANT_ROWS, Met, is_at_dead_position, is_near, met_by
from mbref.simulation.runs import trial_of
from mbref.simulation.wheels import lying_wheel
from mbref.stepping.leaving import begins_at_rest, fits_no_branch, leaving_acceleration
from mbref.stepping.loop import (
    CREEPING,
    DONE,
    LEFT_MOTION,
    STEP_TOO_SMALL,
    TOO_MANY_STEPS,
    UNDECIDED,
    VIOLATED,
)
from mbref.stepping.ranks import Ranks
from mbref.stepping.run import NEARLY, Run

OUTCOMES = {
    DONE: Outcome.COMPLETED,
    SINGULAR: Outcome.SINGULAR_MATRIX,
    NOT_CONVERGED: Outcome.NOT_CONVERGED,
    NOT_FINITE: Outcome.NOT_FINITE,
    VIOLATED: Outcome.VIOLATION,
    STEP_TOO_SMALL: Outcome.STEP_FAILED,
    TOO_MANY_STEPS: Outcome.STEP_FAILED,
    SINGULAR_AHEAD: Outcome.SINGULAR_POSITION,
    UNDECIDED: Outcome.UNDECIDED,
    LEFT_MOTION: Outcome.LEFT_MOTION,
    CREEPING: Outcome.STEP_FAILED,
}

DEAD_POSITION = (
    "the drivers come to a dead position at t = {:.6g} s, beyond which the mechanism cannot move: "
    "end the motion before this time, or drive another joint"
)

REST_POSITION = (
    "the motion begins at rest on a singular position, and the branch along which the forces accelerate it "
    "cannot be computed; give the bodies velocities along the branch"
)

LEAVES_REST = (
    "the motion begins at rest on a singular position and takes, of the {} branches that meet there, the "
    "branch of Gauss's principle of least constraint"
)

NO_BRANCH = (
    "the motion begins on a singular position, and its velocities agree with none of the branches that meet "
    "there; omit the velocities of some bodies, which are then computed"
)

NEARLY_DEPENDENT = (
    "constraint rows are nearly dependent at the start (singular value {:.1e} of unit rows), so that their "
    "rank is uncertain: give the axes and points of the joints with 12 digits"
)
NEAR_SINGULAR_HINT = (
    "; if the mechanism begins near a singular position, rounding changes its motion: begin at that "
    "position, or at a pose with a singular value above {:g}"
)
BUSHING = (
    "the ends of the damped spring load[{}] coincide at the start, so that taylor has no series of its "
    "force; the default method advances in steps"
)
REDUNDANT = "rows with a singular value of {:.1e} at the start count as redundant"
NONE_TAKEN = 0  # the branch taken at a singular position at which the run ended


SINGULAR_POSITION = "the motion reaches a singular position at t = {:.6g} s{}; {} does not cross it{}"
LOSE_RANK = " (the constraint rows of {} lose rank)"
# statuses of failures near a singular position that it may have caused
FAILED = (STEP_TOO_SMALL, NOT_CONVERGED, SINGULAR, CREEPING)
OF_ROUNDING = (*FAILED, UNDECIDED)  # statuses that rounded numbers may cause


def trajectory_of(run: Run, status: int, seconds: float, built: float) -> Motion:
    """Return the samples reached, in the scene's frames and units."""
    met = _singular_position(run, status)
    if met is not None:
        status, run.memory.loop.clock.time = SINGULAR_AHEAD, met.time
    model, loop, counts = run.model, run.memory.loop, run.memory.equations.system.counts
    reached, nb = int(loop.clock.sample), run.model.nb
    q, v, a, multipliers, angles = (sample[:reached].copy() for sample in loop.samples)
    q, v, a = q.reshape(reached, nb, 7), v.reshape(reached, nb, 6), a.reshape(reached, nb, 6)
    times = run.times[:reached]
    return Motion(
        mechanism=run.scene,
        **facts_of(run),
        times=times,
        **model.motion(q, v, a),
        **lazy_reactions(run.scene, times, q, multipliers, angles),
        angles=counted_angles(run.scene, model.structure, angles),
        outcome=OUTCOMES[status],
        t_end=float(loop.clock.time),
        message=_message(run, status) if met is None else _met(run, met),
        crossings=_crossings(run, met),
        cost=cost_of(seconds, built, tuple(counts)),
    )


def facts_of(run: Run) -> dict[str, Any]:
    """Return the fields of a Motion that are equal for runs of scenes of equal structure by one method and
    limits."""
    return {
        "scene": run.scene.name,
        "engine": "mbref",
        "version": VERSION,
        "method": str(run.method),
        "settings": {
            **vars(run.limits),
            "branches": [list(pair) for pair in dict(run.limits.branches).items()],
        },
        "bodies": tuple(body.name for body in run.scene.body),
    }


def cost_of(seconds: float, built: float, counts: Sequence[int]) -> Cost:
    """Return the cost of a run from ``layout.Counts`` in their order, without crossings."""
    return Cost(seconds, built, *map(int, counts[:5]))


class Spent:
    """CPU time of the runs of which a motion with events is made: of building them, and of all the rest, in
    which events are located."""

    def __init__(self) -> None:
        self._began, self._built = time.process_time(), 0.0

    def in_run(self, motion: Motion) -> Motion:
        """Return a motion, whose building counts."""
        self._built += motion.cost.build_seconds
        return motion

    def of(self, pieces: Sequence[Motion]) -> Cost:
        """Return the cost up to now, with the counts of the pieces."""
        counts = {
            field.name: sum(getattr(each.cost, field.name) for each in pieces) for field in fields(Cost)
        }
        rest = time.process_time() - self._began - self._built
        return Cost(**counts | {"seconds": max(rest, counts["seconds"]), "build_seconds": self._built})


def _singular_position(run: Run, status: int) -> Met | None:
    """Return the singular position at which a run by a method that does not cross it ended; None if the run
    ended at a regular position."""
    meets = status == SINGULAR_AHEAD
    if run.method.is_series or not (meets or (status in FAILED and is_near(run))) or is_at_dead_position(run):
        return None
    return met_by(run, inside=meets)


def _met(run: Run, met: Met) -> str:
    """Return one sentence on the singular position at which a run ended."""
    where = LOSE_RANK.format(", ".join(map(repr, met.joints))) if met.joints else ""
    trial = trial_of(run)
    able = trial.completed or trial.reached > BEYOND * met.time if trial else not without_series(run.scene)
    return SINGULAR_POSITION.format(met.time, where, run.method.stabilisation.name, ", taylor does" * able)


def _crossings(run: Run, met: Met | None) -> Sequence[Crossing] | None:
    """Return the singular positions that were passed, or the one at which the run ended.

    None for a method that does not detect singular positions.
    """
    if met is not None:
        return lazy_crossings(run.scene, [Passed(met.time, met.coordinates, met.velocities, NONE_TAKEN)])
    return lazy_crossings(run.scene, run.crossings) if run.method.stabilisation.projects else None


def lazy_crossings(scene: Scene, passed: Sequence[Passed]) -> Sequence[Crossing]:
    """Return the singular positions that a run passed; their branches are computed at first access."""
    return LazySequence(range(len(passed)), _with_branches, scene, passed) if passed else ()


def _with_branches(scene: Scene, passed: Sequence[Passed]) -> tuple[Crossing, ...]:
    """Return singular positions in the scene's frames."""
    model = Model(assembled(scene))
    found = tuple(_with_branches_of(model, one) for one in passed)
    model.release()
    return found


def _with_branches_of(model: Model, passed: Passed) -> Crossing:
    velocities, sentence = branches_passed(model, passed)
    v = velocities.reshape(len(velocities), model.nb, 6)
    q = np.broadcast_to(passed.coordinates.reshape(-1, 7), (*v.shape[:2], 7))
    motion = model.motion(q, v, np.zeros_like(v))
    place = motion["position"][0], motion["orientation"][0], motion["velocity"], motion["angular_velocity"]
    return Crossing(passed.time, *place, passed.taken, sentence)


def _message(run: Run, status: int) -> str:
    """Return one sentence: cause and time of an early end with a remedy, or the correction of the start."""
    if status != DONE and is_at_dead_position(run):
        return DEAD_POSITION.format(run.memory.loop.clock.time)
    if status == UNDECIDED and run.memory.loop.clock.time == 0.0 and begins_at_rest(run):
        return REST_POSITION
    if status == UNDECIDED and run.memory.loop.clock.time == 0.0 and fits_no_branch(run):
        return NO_BRANCH
    if status != DONE:
        chosen = _left_from_rest(run) if run.memory.loop.clock.time > 0.0 else ""
        parts = _cause(run, status), _rounded(run.ranks), _remedy(run, status), chosen
        return "; ".join(filter(None, parts))
    found = report_of(run.start, run.ranks, int(run.memory.equations.system.counts.crossings))
    return "; ".join(filter(None, (_of_bushings(run), _left_from_rest(run), found)))


def _of_bushings(run: Run) -> str:
    """Return the reason why the default method is not `taylor`; empty if it is, or for another method."""
    found = bushings(run.scene)
    is_default = found and str(run.method) == str(Method.parse(default_method(run.scene)))
    return BUSHING.format(found[0]) if is_default else ""


def _left_from_rest(run: Run) -> str:
    """Return a sentence on the branch chosen at a start at rest; empty if only one branch exists, or if no
    force acts along a branch."""
    if not begins_at_rest(run) or leaving_acceleration(run) is None:
        return ""
    return LEAVES_REST.format(len(tangents(run.model, run.start.q)))


def report_of(start: Start, ranks: Ranks, crossings: int) -> str:
    """Return a report on the correction of the start, on rows that are redundant to rounding, and on the
    number of passed singular positions."""
    passed = f"singular positions passed: {crossings}" if crossings else ""
    nearly = NEARLY_DEPENDENT.format(ranks.least) if ranks.least < NEARLY else ""
    return "; ".join(filter(None, (start.report(), _rounded(ranks), nearly, passed)))


def _rounded(ranks: Ranks) -> str:
    return REDUNDANT.format(ranks.next) if ranks.next > REDUNDANT_ROWS else ""


def _remedy(run: Run, status: int) -> str:
    """Return the remedy for an early end; if rows are nearly dependent at the start, a remedy for the
    scene."""
    if lying_wheel(run):
        return ""
    if not run.memory.equations.system.settings.nearly_dependent or run.memory.loop.clock.time > 0.0:
        return (advice_on_rounding(run) if status in OF_ROUNDING else "") or remedy(run, status)
    turned = run.model.closed_loops > 0 and not run.scene.driver
    return NEARLY_DEPENDENT.format(run.ranks.least) + (NEAR_SINGULAR_HINT.format(NEARLY) if turned else "")


def _cause(run: Run, status: int) -> str:
    """Return the cause and the time of an early end."""
    memory = run.memory
    t = memory.loop.clock.time
    if status == VIOLATED:
        row = int(memory.loop.clock.violated_row)
        if row in run.model.structure.velocity_rows:
            return f"the wheel of joint {run.model.row_joint[row]!r} has to slip at t = {t:.6g} s"
        size = abs(memory.equations.rows.phi[row])
        if not size > memory.control.violation:
            joint = run.model.row_joint[row]
            return f"the rate of joint {joint!r} contradicts a wheel that does not slip, at t = {t:.6g} s"
        return (
            f"joint {run.model.row_joint[row]!r} is violated by {size:.3g}, more than "
            f"{memory.control.violation:.3g}, at t = {t:.6g} s"
        )
    if status == TOO_MANY_STEPS:
        return f"{run.limits.most_steps} steps were taken without reaching the end, at t = {t:.6g} s"
    if status == CREEPING:
        return f"steps at t = {t:.6g} s are too short to reach the end"
    if status == STEP_TOO_SMALL and not lying_wheel(run):
        h = memory.control.smallest_step
        return f"the error estimate requires a step below {h:.3g} s at t = {t:.6g} s"
    if status == LEFT_MOTION:
        return f"{OUTCOMES[status].sentence}, as a run by another method shows, by t = {t:.6g} s"
    if flat := lying_wheel(run):
        return f"the wheel of joint {flat!r} lies flat on its plane, at t = {t:.6g} s"
    return f"{OUTCOMES[status].sentence} at t = {t + run.stepper.ahead:.6g} s ({_failed_part(run, status)})"


def _failed_part(run: Run, status: int) -> str:
    """Return the name of the part that failed: a stabilisation may solve positions by Newton's method,
    and a formulation may iterate, too."""
    formulation, stabilisation, integrator = run.method.parts
    if run.method.is_series:
        return integrator.name
    corrects = stabilisation.projects or stabilisation.chooses_coordinates
    if status != NOT_CONVERGED or not corrects:
        return formulation.name
    iterates = formulation.crosses == "by regularisation"
    return f"{formulation.name} or {stabilisation.name}" if iterates else stabilisation.name
