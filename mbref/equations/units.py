"""Lengths of bodies, and the metric of a projection: masses, with moments of inertia that are never tiny.

The length of a body is the mean distance of its joints' anchors from its centre of mass.  Where its moment
of inertia is next to nothing beside its mass at that length, rows of Φ_q that share its turn are all but
parallel in the metric of M, though no singular position is near.  A projection gives every moment
at least the value of the body's mass at SPREAD of its length.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import dist

import numpy as np

from mbref.scene import Body, Joint

SPREAD = 0.5  # of a body's length; a slender rod's transverse moment is that of 0.58
SMALLEST = 1e-9  # of the largest length; a shorter one is rounding


def metric_root(mass: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Inverse roots (6 nb,) of the projection's metric from M (6 nb,) and lengths (nb,); 1 without mass."""
    metric = mass.reshape(-1, 6).copy()
    metric[:, 3:] = np.maximum(metric[:, 3:], (metric[:, 0] * (SPREAD * lengths) ** 2)[:, None])
    return 1.0 / np.sqrt(np.where(metric > 0.0, metric, 1.0)).ravel()


def row_lengths(matrix: np.ndarray) -> np.ndarray:
    """Lengths (…, m) of the rows of matrices (…, m, n), 1 for a row of zeros."""
    lengths = np.linalg.norm(matrix, axis=-1)
    return np.where(lengths > 0.0, lengths, 1.0)


def body_lengths(bodies: Sequence[Body], joints: Sequence[Joint]) -> np.ndarray:
    """Length (nb,) of every body (m); one with all anchors in its centre has the mean of the others, or 1."""
    index = {body.name: b for b, body in enumerate(bodies)}
    arms: list[list[float]] = [[] for _ in bodies]
    for joint in joints:
        anchors = getattr(joint, "anchors", None) or [joint.anchor] * 2
        for name, anchor in zip(joint.bodies, anchors, strict=True):
            if name in index:
                arms[index[name]].append(dist(anchor, bodies[index[name]].position))
    lengths = np.array([sum(of_body) / max(len(of_body), 1) for of_body in arms])
    has_arms = lengths > SMALLEST * lengths.max(initial=0.0)
    mean = float(np.mean(lengths[has_arms])) if np.any(has_arms) else 1.0
    return np.where(has_arms, lengths, mean)
