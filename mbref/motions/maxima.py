"""Largest reactions of joints among the samples of a motion, with their times."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mbref.motions.trajectory import Trajectory


class ReactionMaxima(NamedTuple):
    """Largest force and moment of a joint's reaction among the samples.

    Attributes
    ----------
    force, force_time : float
        Largest size of the force, N, and its time, s.
    moment, moment_time : float
        Largest size of the moment at the anchor, N m, and its time, s.
    open : int
        Largest number of components that equilibrium does not determine, which have the least norm.
    """

    force: float
    force_time: float
    moment: float
    moment_time: float
    open: int


def reaction_maxima(motion: Trajectory) -> dict[str, ReactionMaxima]:
    """Return the largest reaction of each joint; nothing without samples or masses."""
    if not motion.reactions or not motion.times.size:
        return {}
    return {name: _largest(motion, name, wrench) for name, wrench in motion.reactions.items()}


def _largest(motion: Trajectory, name: str, wrench: np.ndarray) -> ReactionMaxima:
    sizes = [np.linalg.norm(wrench[:, part], axis=1) for part in (slice(3), slice(3, 6))]
    found = [(float(size.max()), float(motion.times[size.argmax()])) for size in sizes]
    marks = (motion.open_reactions or {}).get(name)
    return ReactionMaxima(*found[0], *found[1], 0 if marks is None else int(marks.max()))
