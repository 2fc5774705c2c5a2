"""Characteristic lengths of scenes: largest distances between two points, exact, without tables of all pairs.

A few points are compared in pairs. Many points are divided into about √n boxes of neighbours. The distance of
the far corners of two boxes bounds the distances of their points, so that most pairs of boxes are never
opened. The cost is below n^1.5, also for points on a sphere.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from mbref.scene.fields import COINCIDENT

FEW_POINTS = 32  # points; up to here all pairs of a set cost less than its division
SAME_POINT = 1e-9  # distance / radius of gyration; bodies at a smaller one have met up to errors of a motion
ROUNDING = 1e-14  # relative; larger than the rounding of a distance in three dimensions


def characteristic_lengths(points: np.ndarray, mass: np.ndarray) -> np.ndarray:
    """Return the lengths (s,), m, of scenes: the largest distance of their points (s, n, 3).

    Where all points of a scene coincide up to the rounding of a motion, the length is the largest radius of
    gyration by masses and moments of inertia (s, nb, 6), or 1 if no body has one.
    """
    distances, has_mass = largest_distances(points), mass[..., 0] > 0.0
    squares = np.where(has_mass, mass[..., 3:].max(axis=-1), 0.0) / np.where(has_mass, mass[..., 0], 1.0)
    radii = np.sqrt(squares.max(axis=1))
    rounding = np.maximum(COINCIDENT * np.abs(points).max(axis=(1, 2)), SAME_POINT * radii)
    return np.where(distances > rounding, distances, np.where(radii > 0.0, radii, 1.0))


def largest_distances(points: np.ndarray) -> np.ndarray:
    """Return the largest distance (s,) between two points of each set (s, n, 3)."""
    if points.shape[1] <= FEW_POINTS:
        return _all_pairs(points, points)
    return np.array([_largest_distance(np.unique(each, axis=0)) for each in points])


def _all_pairs(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the largest distance (…,) from points (…, k, 3) to points (…, l, 3)."""
    apart = first[..., :, None, :] - second[..., None, :, :]
    distances: np.ndarray = np.sqrt((apart * apart).sum(axis=-1).max(axis=(-2, -1)))
    return distances


def _largest_distance(points: np.ndarray) -> float:
    """Return the largest distance between two of the points (n, 3)."""
    boxes = [*_boxes(points, math.isqrt(len(points)) + 1)]
    low, high = (np.array([end(box, axis=0) for box in boxes]) for end in (np.min, np.max))
    corners = np.maximum(high[:, None] - low, high - low[:, None])
    bounds = np.sqrt((corners * corners).sum(axis=2)) * (1.0 + ROUNDING)
    largest = 0.0
    for pair in np.argsort(-bounds, axis=None):
        one, other = divmod(int(pair), len(boxes))
        if bounds[one, other] <= largest:
            break
        if one <= other:
            largest = max(largest, float(_all_pairs(boxes[one], boxes[other])))
    return largest


def _boxes(points: np.ndarray, most: int) -> Iterator[np.ndarray]:
    """Yield the points (n, 3) in groups of at most ``most`` neighbours, by halves along the longest side."""
    if len(points) <= most:
        yield points
        return
    side = np.argmax(np.ptp(points, axis=0))
    middle = len(points) // 2
    halves = np.argpartition(points[:, side], middle)
    yield from _boxes(points[halves[:middle]], most)
    yield from _boxes(points[halves[middle:]], most)
