"""Checks on the last digits of a run: single precision, noise between samples, accuracy of velocities and
accelerations."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from crosscheck.conformance.changes.copies import Outside
from crosscheck.conformance.trial import SWEPT, Bench, Finding
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.precision import grain, motion_rate, single_precision
from crosscheck.judge.push_difference import accelerations_apart
from crosscheck.judge.reaction_balance import balance, idle
from crosscheck.judge.tolerances import GRAINS, LIKE_TRUTH, OWN_ACCURACY, PERTURBED, ROUNDING, SAME_MOTION
from mbref.motions.trajectory import Trajectory


def double_precision(bench: Bench) -> Finding | Outside:
    """Numbers are not rounded to single precision, unless the engine declares single precision."""
    if bench.rounding > ROUNDING:
        return Outside(f"the engine declares that its numbers are rounded to {bench.rounding:.1e}")
    single = single_precision(bench.scene, bench.close)
    return Finding(float(len(single)), 0.0, ", ".join(single[:3]))


def smooth(bench: Bench) -> Finding:
    """States at neighbouring times lie on smooth curves, up to the rounding that the engine declares."""
    noise, where = grain(bench.scene, bench.close)
    allowed = max(SAME_MOTION, GRAINS * bench.rounding)
    # steps that end at the samples leave the error of an engine of low order between neighbouring times
    if noise > allowed and (own := OWN_ACCURACY * bench.left) > LIKE_TRUTH:
        allowed = own
    return Finding(noise, allowed, where)


def refined(bench: Bench) -> Finding | Outside:
    """Without joints, differences of successive settings decrease to the engine's rounding."""
    if len(bench.sweep) < SWEPT:
        return Outside("the engine offers fewer than three settings that complete")
    allowed = max(SAME_MOTION, GRAINS * bench.rounding, bench.steps_before)
    return Finding(bench.steps_apart, allowed, f"{bench.steps_before:.1e} apart before")


def settled(bench: Bench) -> Finding | Outside:
    """Differences between settings explain the errors of velocities, accelerations and reactions."""
    if len(bench.settings) < 2:
        return Outside("the engine offers one setting")
    if np.isnan(bench.exact.velocity).any():
        return Outside("the closed form of this scene gives poses only")
    return max(_rates(bench), key=lambda finding: finding.measured / finding.allowed)


def _rates(bench: Bench) -> Iterator[Finding]:
    """Return differences from the exact velocities and, if the engine gives them, accelerations and
    reactions."""
    scene, motion, exact = bench.scene, bench.motion, bench.exact
    steps, perturbed_difference = (
        _speeds_apart(bench, motion, run) for run in (*bench.sweep[1:2], bench.perturbed)
    )
    allowed = max(SAME_MOTION, OWN_ACCURACY * steps, PERTURBED * perturbed_difference)
    yield Finding(_speeds_apart(bench, motion, exact), allowed, "velocities")
    if exact.acceleration is None:
        return
    yield Finding(accelerations_apart(scene, exact, motion), bench.own_pushes, "accelerations")
    if scene.has_mass() and motion.reactions and len(motion.reactions) == len(scene.joint):
        yield Finding(balance(scene, motion, exact), bench.own_pushes, "balance of reactions")
        yield Finding(idle(scene, motion, exact), bench.own_pushes, "reactions along freedoms")


def _speeds_apart(bench: Bench, first: Trajectory, second: Trajectory) -> float:
    """Return the largest difference of velocities over the scene's length and of angular velocities, relative
    to the rate of the motion."""
    linear = np.abs(first.velocity - second.velocity).max() / scene_length(bench.scene)
    angular = np.abs(first.angular_velocity - second.angular_velocity).max()
    return float(max(linear, angular)) / motion_rate(bench.scene, bench.motion)
