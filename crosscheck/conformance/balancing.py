"""Checks on reactions and impulses."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from crosscheck.conformance.changes.copies import Outside
from crosscheck.conformance.trial import Bench, Finding
from crosscheck.conformance.vanishing import vanishing
from crosscheck.judge.events import impact_error, impulse_error
from crosscheck.judge.pieces import has_pieces
from crosscheck.judge.reaction_balance import balance, idle
from crosscheck.judge.tolerances import REACTIONS
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene


def balanced(bench: Bench) -> Finding | Outside:
    """Reactions, impulses and loads on every body agree with its exact motion, by the judge's own loads."""
    if has_pieces(bench.scene):
        return _of_impulses(bench)
    return _of_reactions(bench, balance)


def _of_impulses(bench: Bench) -> Finding | Outside:
    """Return the error of velocities after impacts, and of impulses if the engine gives them."""

    def off(k: int) -> list[float]:
        found = [measure(bench.scene, bench.sweep[k], None) for measure in (impact_error, impulse_error)]
        return [error for error in found if error is not None]

    if not off(0):
        return Outside("the engine gives no impacts, or no velocity jumps")
    return vanishing(bench, lambda k: max(off(k), default=np.inf), REACTIONS)


def workless(bench: Bench) -> Finding | Outside:
    """No reaction acts along a motion that its joint allows, by the judge's own joint equations."""
    return _of_reactions(bench, idle)


def _of_reactions(
    bench: Bench, measured: Callable[[Scene, Trajectory, Trajectory], float]
) -> Finding | Outside:
    if not bench.motion.reactions:
        return Outside("the engine gives no reactions, or the scene has no joint")
    if bench.exact.acceleration is None or not bench.scene.has_mass():
        return Outside("the accelerations are not known here")
    if silent := [joint.name for joint in bench.scene.joint if joint.name not in bench.motion.reactions]:
        return Finding(np.inf, REACTIONS, f"no reaction is given in {', '.join(silent)}")
    return vanishing(bench, lambda k: measured(bench.scene, bench.sweep[k], bench.exact), REACTIONS)
