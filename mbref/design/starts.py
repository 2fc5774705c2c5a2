"""Starts of the search for equilibria: poses in strides along the constraints."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import numpy as np

from mbref import rotations
from mbref.design.balance import STRIDE, Newton
from mbref.design.linearisation import OffConstraints, Tangent


def starts_from(first: Tangent, freedoms: int, count: int) -> Iterator[Tangent]:
    """Yield the first pose, and further poses along the constraints in random directions with a fixed seed.

    Starts displace soft springs rather than stiff ones.
    """
    rng = np.random.default_rng(1)
    yield first
    ends = [first, first]
    directions: list[np.ndarray | None] = [None, None]
    for k in range(1, count):
        side = (k + 1) % 2
        tangent, old = ends[side], directions[side]
        drawn = rng.standard_normal(tangent.model.n)
        wish = drawn if old is None else old + 0.3 * rotations.unit(drawn)
        if old is None and side and directions[0] is not None:
            wish = -directions[0]
        along = np.linalg.lstsq(tangent.basis, wish, rcond=None)[0]
        direction, moved = _stride(tangent, along, first.forces)
        if moved is None or moved.freedoms != freedoms:
            directions[side] = None
            continue
        directions[side], ends[side] = direction, moved
        yield moved


def _stride(tangent: Tangent, y: np.ndarray, forces: np.ndarray) -> tuple[np.ndarray, Tangent | None]:
    """Return a direction (n,) of unit length near y (f,) that displaces soft springs, and the pose after a
    stride along it."""
    here: Newton | Tangent = tangent
    with contextlib.suppress(OffConstraints):
        here = Newton(tangent)
        y = here.softened(y, forces)
    y = y / (np.linalg.norm(tangent.basis @ y) or 1.0)
    return rotations.unit(tangent.basis @ y), here.moved(STRIDE * y)
