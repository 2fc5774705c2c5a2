"""Motions of a scene along the branches that meet at one of its singular positions."""

from __future__ import annotations

from dataclasses import replace

from mbref.equations.branches import SMOOTH
from mbref.method import MethodError
from mbref.motion import Motion
from mbref.stepping.limits import Limits
from mbref.trajectory import Outcome

FRAMES = 101  # number of samples of a motion


def chosen_crossing(smooth: Motion, number: int | None) -> int:
    """Return the number, from 1, of the chosen singular position; without a choice, of the first position
    with several branches.

    Raises MethodError if the method does not detect singular positions, ValueError if the motion passes none.
    """
    if smooth.crossings is None:
        raise MethodError(
            f"--branches: {smooth.method} does not detect singular positions; use --method taylor"
        )
    passed, until = len(smooth.crossings), f"up to t = {smooth.t_end:g} s"
    if number is not None and not 1 <= number <= passed:
        raise ValueError(
            f"--crossing: must be at most {passed}, the singular positions {until}, got {number}"
        )
    several = of_several_branches(smooth)
    if number is None and not several:
        which = "; ".join(sentence(smooth, k) for k in range(1, passed + 1)) or "the motion passes none"
        raise ValueError(f"--branches: no singular position {until} has several branches: {which}")
    return number or several[0]


def of_several_branches(motion: Motion) -> list[int]:
    """Return the numbers, from 1, of the passed singular positions at which several branches meet."""
    return [k for k, crossing in enumerate(motion.crossings or (), 1) if len(crossing.velocity) > 1]


def along_branches(smooth: Motion, method: str, limits: Limits, number: int) -> dict[str, Motion]:
    """Return the motions by title, from before a singular position of the smooth motion to after it."""
    from mbref.simulation.simulate import simulate

    assert smooth.crossings is not None
    crossing = smooth.crossings[number - 1]
    times = crossing.instants(smooth.t_end, FRAMES)
    motions = [
        simulate(smooth.mechanism, method, times, replace(limits, branches={number: branch}))
        for branch in range(1, len(crossing.velocity) + 1)
    ]
    return {_title(branch, motion): motion for branch, motion in enumerate(motions, SMOOTH)}


def sentence(motion: Motion, number: int) -> str:
    """Return one sentence on a singular position."""
    assert motion.crossings is not None
    crossing = motion.crossings[number - 1]
    return f"singular position {number} at t = {crossing.time:.6g} s: {crossing.sentence}"


def _title(branch: int, motion: Motion) -> str:
    """Return the branch's name, with the end time if its run ended early."""
    name = f"branch {branch}{', smooth' * (branch == SMOOTH)}"
    return name if motion.outcome is Outcome.COMPLETED else f"{name}, ended at {motion.t_end:.4g} s"
