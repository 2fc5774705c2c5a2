"""Openings of joints: distances between points that a joint holds together, and angles by which it tilts."""

from __future__ import annotations

import math
from itertools import chain
from typing import NamedTuple

import numpy as np

from crosscheck.judge import constraints
from crosscheck.judge.events import parts
from crosscheck.judge.violations import violation_series
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene


class Opening(NamedTuple):
    """Largest openings over all joints and samples; infinite without a sample, for numbers that are not
    finite, and for a coupling that is not counted.

    ``gap`` (m) is the distance between a joint's points, or the displacement by which a coupling is off.
    ``angle`` (rad) is the angle by which a joint tilts or a coupling is off. ``uncounted`` names couplings
    whose joints turn too far between samples for their full turns to be counted.
    """

    gap: float
    angle: float
    uncounted: tuple[str, ...] = ()


def opening(scene: Scene, run: Trajectory) -> Opening:
    """Return the largest openings of a run, whose bodies are in the scene's order; drivers do not count, nor
    joints while they do not hold."""
    found = [_of_piece(piece, own) for piece, own, _ in parts(scene, run, None) if len(own.times)]
    if not found:
        return Opening(math.inf, math.inf)
    gaps, angles, uncounted = zip(*found, strict=True)
    return Opening(max(gaps), max(angles), tuple(dict.fromkeys(chain.from_iterable(uncounted))))


def uncounted_couplings(scene: Scene, run: Trajectory) -> tuple[str, ...]:
    """Return the names of the couplings of a run whose turns cannot be counted."""
    return opening(scene, run).uncounted if scene.coupling else ()


def counted_violation(scene: Scene, run: Trajectory) -> float:
    """Return the largest residual of a run, without couplings whose turns cannot be counted."""
    if uncounted := uncounted_couplings(scene, run):
        scene = scene.with_(coupling=[each for each in scene.coupling if each.name not in uncounted])
    return float(violation_series(scene, run).max(initial=0.0))


def _of_piece(scene: Scene, run: Trajectory) -> Opening:
    """Return the largest openings of a run in which all joints hold."""
    pose = (run.times, run.position, run.orientation)
    with np.errstate(all="ignore"):  # states that are not finite are reported, without warnings
        residuals = constraints.closure(scene.with_(driver=()), *pose)
        gaps = constraints.coupling_gaps(scene, *pose, run.angular_velocity, run.angles)
        residuals |= gaps
    are_lengths = constraints.length_rows(scene.with_(driver=()))
    return Opening(
        _largest([r[:, are_lengths[name]] for name, r in residuals.items()]),
        _largest([r[:, ~are_lengths[name]] for name, r in residuals.items()]),
        tuple(name for name, gap in gaps.items() if np.isnan(gap).any()),
    )


def _largest(rows: list[np.ndarray]) -> float:
    """Return the largest norm of the rows (k, n) of one joint at one sample."""
    found = np.max([0.0, *(np.linalg.norm(r, axis=1).max() for r in rows)])
    return float(found) if np.isfinite(found) else math.inf
