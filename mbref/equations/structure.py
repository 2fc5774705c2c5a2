"""Structure: constraint rows without their numbers, one object for all scenes of an equal structure."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from mbref.equations.joints.base import ROWS_OF

MOST_KEPT = 256  # structures
PrimitivePlace = tuple[int, str, int, int, int]  # kind, joint, first and second body, driver or -1


@dataclass(frozen=True, eq=False)
class Structure:
    """The primitives of p, their m rows and the columns of those; nobody changes the arrays.

    ``entry_columns`` (m, 12) says the column of every entry of the blocks; those of the fixed frame are ≥ n.
    """

    nb: int  # bodies; the fixed frame has this number
    kind: np.ndarray  # (p,)
    first: np.ndarray  # (p,) bodies
    second: np.ndarray  # (p,)
    driver: np.ndarray  # (p,), -1 without
    row: np.ndarray  # (p,) the first row of each
    row_bodies: np.ndarray  # (m, 2)
    entry_columns: np.ndarray  # (m, 12)
    rows: np.ndarray  # (m,) 0 to m - 1
    row_joint: tuple[str, ...]  # (m,) names
    of_directions: np.ndarray  # (3 p,) bodies: direction_first, turning_first and direction_second of each


@functools.lru_cache(maxsize=MOST_KEPT)
def structure_of(nb: int, places: tuple[PrimitivePlace, ...]) -> Structure:
    """The structure of primitives between nb bodies and the fixed frame, which is number nb."""
    kind, first, second, driver = (
        np.array([place[k] for place in places], dtype=np.int64) for k in (0, 2, 3, 4)
    )
    rows = np.array([ROWS_OF[place[0]] for place in places], dtype=np.int64)
    row_bodies = np.repeat(np.stack([first, second], axis=1), rows, axis=0)
    return Structure(
        nb=nb,
        kind=kind,
        first=first,
        second=second,
        driver=driver,
        row=np.cumsum([0, *rows], dtype=np.int64)[:-1],
        row_bodies=row_bodies,
        entry_columns=(6 * row_bodies[:, :, None] + np.arange(6)).reshape(len(row_bodies), 12),
        rows=np.arange(len(row_bodies)),
        row_joint=tuple(place[1] for place, count in zip(places, rows, strict=True) for _ in range(count)),
        of_directions=np.concatenate([first, first, second]),
    )
