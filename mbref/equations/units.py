"""Lengths of bodies, and the metric of a projection: masses, with moments of inertia that are never tiny.

The length of a body is the mean distance of its joints' anchors from its centre of mass.  Where its moment
of inertia is next to nothing beside its mass at that length, rows of Φ_q that share its turn are all but
parallel in the metric of M, though no singular position is near.  A projection gives every moment
at least the value of the body's mass at SPREAD of its length.
"""

from __future__ import annotations

import functools

import numpy as np

MOST_KEPT = 64  # structures
SPREAD = 0.5  # of a body's length; a slender rod's transverse moment is that of 0.58
SMALLEST = 1e-9  # of the largest length; a shorter one is rounding


def metric_root(mass: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Inverse roots (…, 6 nb) of the projection's metric; 1 without mass.

    From M (…, 6 nb) and lengths (…, nb).
    """
    metric = mass.reshape(*lengths.shape, 6).copy()
    least = metric[..., :1] * (SPREAD * lengths[..., None]) ** 2
    metric[..., 3:] = np.maximum(metric[..., 3:], least)
    return (1.0 / np.sqrt(np.where(metric > 0.0, metric, 1.0))).reshape(mass.shape)


def row_lengths(matrix: np.ndarray) -> np.ndarray:
    """Lengths (…, m) of the rows of matrices (…, m, n), 1 for a row of zeros."""
    lengths = np.linalg.norm(matrix, axis=-1)
    return np.where(lengths > 0.0, lengths, 1.0)


@functools.lru_cache(maxsize=MOST_KEPT)
def _shares(nb: int, ends: bytes) -> np.ndarray:
    """The share (e, nb) of an anchor among those on each body, from the bodies (e,) that they are on."""
    on_body = np.frombuffer(ends, dtype=int)[:, None] == np.arange(nb)
    return on_body / np.maximum(on_body.sum(axis=0), 1)


def body_lengths(nb: int, ends: np.ndarray, anchors: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Length (…, nb) of every body (m); one with all anchors in its centre has the mean of the others, or 1.

    From the joints' anchors (…, e, 3), the bodies (e,) that they are on, the fixed frame being number nb, and
    the centres of mass (…, nb + 1, 3).
    """
    arms = np.linalg.norm(anchors - centres[..., ends, :], axis=-1)
    lengths = arms @ _shares(nb, ends.tobytes())
    has_arms = lengths > SMALLEST * lengths.max(axis=-1, keepdims=True, initial=0.0)
    count = has_arms.sum(axis=-1, keepdims=True)
    total = (lengths * has_arms).sum(axis=-1, keepdims=True)
    return np.where(has_arms, lengths, np.where(count > 0, total / np.maximum(count, 1), 1.0))
