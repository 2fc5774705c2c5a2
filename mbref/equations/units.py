"""Lengths of bodies, and the metric of a projection: masses, with moments of inertia that are never tiny.

The length of a body is the mean distance of its joints' anchors from its centre of mass.  If its moment of
inertia is tiny compared with its mass at that length, rows of Φ_q that act on its rotation are nearly
parallel in the metric of M, although no singular position is near.  A projection gives every moment at least
the value of the body's mass at SPREAD of its length.
"""

from __future__ import annotations

import numpy as np

SPREAD = 0.5  # radius of gyration / body length; 0.58 for a slender rod about its end
SHORTEST_LENGTH = 1e-9  # length / largest length; shorter lengths are rounding


def metric(mass: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Return the projection's metric (…, 6 nb), from M (…, 6 nb) and lengths (…, nb)."""
    found = mass.reshape(*lengths.shape, 6).copy()
    least = found[..., :1] * (SPREAD * lengths[..., None]) ** 2
    found[..., 3:] = np.maximum(found[..., 3:], least)
    return found.reshape(mass.shape)


def inverse_root(mass: np.ndarray) -> np.ndarray:
    """Return inverse square roots of masses; 1 without mass."""
    return 1.0 / np.sqrt(np.where(mass > 0.0, mass, 1.0))


def displacement_units(bodies: int, length: float) -> np.ndarray:
    """Return the units (6 nb,) in which displacements (δr, δπ') of bodies compare: a length (m), 1 rad."""
    return np.array(([length] * 3 + [1.0] * 3) * bodies)


def row_lengths(matrix: np.ndarray) -> np.ndarray:
    """Return lengths (…, m) of the rows of matrices (…, m, n), 1 for a row of zeros."""
    lengths = np.sqrt((matrix * matrix).sum(axis=-1))
    return np.where(lengths > 0.0, lengths, 1.0)


def unit_rows(matrix: np.ndarray) -> np.ndarray:
    """Return matrices (…, m, n) with rows of unit length, so that their rank does not depend on units."""
    return matrix / row_lengths(matrix)[..., None]


def unit_equations(matrix: np.ndarray, rhs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return equations (…, m, n), (…, m) with rows of unit length: their rank does not depend on units."""
    lengths = row_lengths(matrix)
    return matrix / lengths[..., None], rhs / lengths


def body_lengths(arms: np.ndarray, bodies: np.ndarray, nb: int) -> np.ndarray:
    """Return the length (s, nb) of every body (m) of s scenes.

    A body with all anchors in its centre has the mean of all other lengths, or 1. Arguments are the joints'
    anchors (s, e, 3), relative to the centres of mass of their bodies, and the bodies (e,), nb for the fixed
    frame.
    """
    place = (nb + 1) * np.arange(len(arms))[:, None] + bodies
    distances, size = np.sqrt((arms * arms).sum(axis=-1)), len(arms) * (nb + 1)
    total = np.bincount(place.ravel(), distances.ravel(), size).reshape(len(arms), nb + 1)[:, :nb]
    lengths = total / np.maximum(np.bincount(bodies, minlength=nb + 1)[:nb], 1)
    has_arms = lengths > SHORTEST_LENGTH * lengths.max(axis=-1, keepdims=True, initial=0.0)
    if has_arms.all():
        return lengths
    count = has_arms.sum(axis=-1, keepdims=True)
    total = (lengths * has_arms).sum(axis=-1, keepdims=True)
    return np.where(has_arms, lengths, np.where(count > 0, total / np.maximum(count, 1), 1.0))
