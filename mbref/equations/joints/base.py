"""A joint as a list of primitive constraints between two bodies, and the vectors they need."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mbref.kernels.scene_layout import DISTANCE, DOT1, DOT2, POINT

ZERO = (0.0, 0.0, 0.0)
ROWS_OF = {POINT: 3, DOT1: 1, DOT2: 1, DISTANCE: 1}


@dataclass(frozen=True)
class Primitive:
    """One primitive equation; world vectors and points at t = 0, ``first`` fixed in the first body."""

    kind: int
    point_first: tuple[float, ...] = ZERO
    point_second: tuple[float, ...] = ZERO
    first: tuple[float, ...] = ZERO
    second: tuple[float, ...] = ZERO
    turning: tuple[float, ...] = ZERO  # with a driver: fixed in the first body, a quarter turn from first
    length: float = 0.0
    driven: bool = False


def unit(v: tuple[float, ...]) -> np.ndarray:
    """v / |v|."""
    return np.asarray(v, dtype=float) / np.linalg.norm(v)


def frame(axis: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A right-handed triad (x, y, z) with z along the axis."""
    z = unit(axis)
    helper = np.eye(3)[np.argmin(np.abs(z))]
    x = unit(np.cross(helper, z))
    return x, np.cross(z, x), z


def coincident(anchor: tuple[float, ...]) -> Primitive:
    """The points of both bodies at the anchor stay together."""
    return Primitive(POINT, point_first=anchor, point_second=anchor)


def perpendicular(first: np.ndarray, second: np.ndarray) -> Primitive:
    """A direction fixed in each body stay perpendicular."""
    return Primitive(DOT1, first=tuple(first), second=tuple(second))


def in_plane(anchor: tuple[float, ...], normal: np.ndarray) -> Primitive:
    """The second body's anchor stays in the plane through the first body's with that normal."""
    return Primitive(DOT2, point_first=anchor, point_second=anchor, first=tuple(normal))


def driven_angle(axis: tuple[float, ...]) -> Primitive:
    """The second body turns about the axis by the driver's angle."""
    x, y, _ = frame(axis)
    return Primitive(DOT1, first=tuple(x), turning=tuple(y), second=tuple(x), driven=True)


def driven_displacement(anchor: tuple[float, ...], axis: tuple[float, ...]) -> Primitive:
    """The second body's anchor advances along the axis by the driver's displacement."""
    z = tuple(unit(axis))
    return Primitive(DOT2, point_first=anchor, point_second=anchor, first=z, driven=True)
