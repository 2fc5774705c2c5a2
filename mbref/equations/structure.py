"""Structure: a scene without its numbers, one object for all scenes of an equal structure.

Everything that follows from names, types and bodies alone is computed once and stored with it.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbref.equations.joints import ROWS_OF
from mbref.equations.machine_memory import refuse_beyond_memory
from mbref.kernels.scene_layout import ALONG_AXIS, COUPLED_ANGLE, FORCE, NO_SLIP, POINT_DAMPER, SPRING

if TYPE_CHECKING:
    from scipy.sparse import csr_array

MOST_KEPT = 256  # largest number of cached structures
FIRST_PART, LAST_PART, INNER_PART = 1, 2, 3  # places of joint coordinates in the row of a coupling


class PrimitivePlace(NamedTuple):
    """A primitive constraint without its numbers."""

    kind: int
    joint: str
    first: int  # index of the first body
    second: int
    driver: int  # index of the driver, -1 without
    part: int = 0  # FIRST_PART, INNER_PART or LAST_PART of a row of joint coordinates; 0 otherwise
    of: str = ""  # name of the joint to which the coordinate belongs


class LoadPlace(NamedTuple):
    """A load without its numbers."""

    kind: int
    first: int  # index of the first body
    second: int  # index of the second body, 0 without
    function: int  # index of the load's function of time, -1 without
    angle: int = -1  # index of its joint among ``Places.turning``, -1 for other loads


class TurningPlace(NamedTuple):
    """A joint that turns about one axis, without its numbers."""

    joint: str
    first: int  # index of the first body
    second: int


class Places(NamedTuple):
    """Kinds and bodies of all primitives, loads and turning joints, without numbers; body nb is the fixed
    frame.

    ``anchored`` are the bodies of the joints' anchors, ``functions`` the numbers of pieces of the functions
    of time, ``terms`` is the length of their longest polynomial, ``powers`` the number of powers above the
    first in couplings.
    """

    nb: int
    primitives: tuple[PrimitivePlace, ...]
    loads: tuple[LoadPlace, ...]
    turning: tuple[TurningPlace, ...]
    anchored: tuple[int, ...]
    functions: tuple[int, ...]
    terms: int
    powers: int


@dataclass(frozen=True, eq=False)
class Structure:
    """The p primitives, l loads, m rows and their columns. The arrays are read-only.

    ``entry_columns`` (m, 12) is the column of every entry of the blocks; columns of the fixed frame are ≥ n.
    Vectors of the primitives come first, then vectors of the loads and of the a turning joints, in the order
    of ``packing``.
    """

    nb: int  # bodies; the fixed frame has this number
    kind: np.ndarray  # (p,) kinds of the primitives
    first: np.ndarray  # (p,) first bodies
    second: np.ndarray  # (p,) second bodies
    driver: np.ndarray  # (p,) drivers, -1 without
    row: np.ndarray  # (p,) first row of each primitive
    places_in_row: np.ndarray  # (4, p) fields begins, column_first, column_second, angle of ``Primitives``
    sides: int  # bodies of a row: 2, or 4 and more if joint coordinates are coupled
    row_bodies: np.ndarray  # (m, sides), padded with the fixed frame
    entry_columns: np.ndarray  # (m, width)
    row_joint: tuple[str, ...]  # (m,) names of the joints
    load: np.ndarray  # (5, l): kind, first and second body, function of time, index of its joint's angle
    turning: np.ndarray  # (2, a) first and second body
    anchored: np.ndarray  # (e,) bodies of the joints' anchors
    vector_body: np.ndarray  # (5 p + 3 l + 3 a,) the body in whose frame each vector is fixed
    # (5 p + 3 l + 3 a,) the body from whose centre points are measured; the fixed frame for directions
    vector_origin: np.ndarray
    places: Places

    @functools.cached_property
    def sizes(self) -> dict[str, int]:
        """Sizes of the memory of evaluations (see ``kernels.layout``)."""
        sides, m, rolling = self.sides, len(self.row_joint), self.velocity_rows.size
        return {
            "nb": self.nb,
            "n": 6 * self.nb,
            "m": m,
            "angles": self.turning.shape[1],
            "f": len(self.places.functions),
            "powers": self.places.powers,
            "dense_rows": 0,
            "sides": sides,
            "velocity_rows": rolling,
            "rate_rows": m + self.nb if rolling else 0,
            "rate_columns": 7 * self.nb if rolling else 0,
            "width": 6 * sides,
        }

    @functools.cached_property
    def has_angles(self) -> bool:
        """True if a load about a joint's axis or a coupling unwraps its angle."""
        return bool((self.load[4] >= 0).any() or (self.places_in_row[3] >= 0).any())

    @functools.cached_property
    def of_bodies(self) -> np.ndarray:
        """Return which entries (m, 12) of the blocks do not belong to the fixed frame."""
        of_bodies: np.ndarray = self.entry_columns < 6 * self.nb
        return of_bodies

    @functools.cached_property
    def vector_is_point(self) -> np.ndarray:
        """Return (5 p + 3 l + 3 a,) whether each vector is a point: the first two vectors of a primitive or a
        load are points."""
        places = self.places
        return np.array([k < 2 for _ in places.primitives for k in range(5)]
                        + [k < 2 for _ in places.loads for k in range(3)]
                        + [False for _ in places.turning for k in range(3)], dtype=bool)  # fmt: skip

    @functools.cached_property
    def velocity_rows(self) -> np.ndarray:
        """Row numbers of the rows between velocities alone: a wheel that does not slip. Their Φ is zero."""
        return np.asarray(self.row[self.kind == NO_SLIP])

    @functools.cached_property
    def position_rows(self) -> np.ndarray:
        """Row numbers of the rows that restrict positions."""
        return np.setdiff1d(self.rows, self.velocity_rows)

    def of_positions(self, blocks: np.ndarray) -> np.ndarray:
        """Return the blocks (…, m, 12) of Φ_q of the rows that restrict positions; all others are zero."""
        if not self.velocity_rows.size:
            return blocks
        found = blocks.copy()
        found[..., self.velocity_rows, :] = 0.0
        return found

    @functools.cached_property
    def rows(self) -> np.ndarray:
        """Row numbers (m,), 0 to m - 1."""
        return np.arange(len(self.row_joint))

    @functools.cached_property
    def closed_loops(self) -> int:
        """Number of independent loops of bodies and joints, with one for all polynomial couplings; without a
        loop no position is singular."""
        loops = int(self.places.powers > 0)
        nearer = list(range(self.nb + 1))  # a body nearer to the representative of its tree

        def representative(body: int) -> int:
            while nearer[body] != body:
                nearer[body] = body = nearer[nearer[body]]
            return body

        for _, one, other in dict.fromkeys(
            (p.joint, p.first, p.second) for p in self.places.primitives if not p.part
        ):
            first, second = representative(one), representative(other)
            loops += first == second
            nearer[second] = first
        return loops

    def dense(self, blocks: np.ndarray) -> np.ndarray:
        """Return Φ_q (…, m, n) from its blocks (…, m, 12).

        Raises InputError if the memory of this machine does not hold it.
        """
        states, columns = blocks.shape[:-2], 6 * (self.nb + 1)
        refuse_beyond_memory(
            8 * math.prod(states) * len(self.rows) * columns,
            f"the scene is too large for this method or command: a full matrix of {len(self.rows)} "
            f"constraint rows and {6 * self.nb} columns",
        )
        matrix = np.zeros((*blocks.shape[:-1], self.nb + 1, 6))
        for side in range(self.sides):
            matrix[..., self.rows, self.row_bodies[:, side], :] = blocks[..., 6 * side : 6 * side + 6]
        return matrix[..., : self.nb, :].reshape(*blocks.shape[:-1], 6 * self.nb)

    def sparse(self, blocks: np.ndarray) -> csr_array:
        """Return Φ_q (m, n) from its blocks (m, 12), as a sparse matrix."""
        from scipy.sparse import csr_array

        row, entry = np.nonzero((blocks != 0) & self.of_bodies)
        shape = len(self.rows), 6 * self.nb
        return csr_array((blocks[row, entry], (row, self.entry_columns[row, entry])), shape=shape)


@functools.lru_cache(maxsize=MOST_KEPT)
def structure_of(places: Places) -> Structure:
    """Return the structure of a scene with these primitives and loads between its bodies and the fixed
    frame."""
    nb, primitives = places.nb, places.primitives
    kind, first, second, driver = (
        np.array([place[k] for place in primitives], dtype=np.int64) for k in (0, 2, 3, 4)
    )
    load = np.array(places.loads, dtype=np.int64).reshape(-1, 5).T.copy()
    rows = np.array(
        [ROWS_OF[place.kind] * (place.part in (0, LAST_PART)) for place in primitives], dtype=np.int64
    )
    coupled, columns = _coupled_bodies(places)
    sides = max([2, *map(len, coupled)])
    row_bodies = np.full((rows.sum(), sides), nb, dtype=np.int64)
    row_bodies[:, :2] = np.repeat(np.stack([first, second], axis=1), rows, axis=0)
    for bodies, row in zip(
        coupled, np.cumsum(rows)[[p.part == LAST_PART for p in primitives]] - 1, strict=True
    ):
        row_bodies[row, : len(bodies)] = bodies
    turning = {place.joint: k for k, place in enumerate(places.turning)}
    slots = [turning[place.of] if place.kind == COUPLED_ANGLE else -1 for place in primitives]
    begins = np.array([place.part in (0, FIRST_PART) for place in primitives], dtype=np.int64)
    return Structure(
        nb=nb,
        kind=kind,
        first=first,
        second=second,
        driver=driver,
        row=np.cumsum([0, *rows], dtype=np.int64)[:-1],
        places_in_row=np.array([begins, *columns, slots], dtype=np.int64).reshape(4, -1),
        sides=sides,
        row_bodies=row_bodies,
        entry_columns=(6 * row_bodies[:, :, None] + np.arange(6)).reshape(len(row_bodies), 6 * sides),
        row_joint=tuple(
            place.joint for place, count in zip(primitives, rows, strict=True) for _ in range(count)
        ),
        load=load,
        turning=np.array([place[1:] for place in places.turning], dtype=np.int64).reshape(-1, 2).T.copy(),
        anchored=np.array(places.anchored, dtype=int),
        vector_body=_of_vectors([(p.first, p.second, p.first, p.first, p.second) for p in primitives]
                                + [(l.first, l.second, l.first) for l in places.loads]
                                + [(t.first, t.first, t.second) for t in places.turning]),
        vector_origin=_of_vectors([(p.first, p.second, nb, nb, nb) for p in primitives]
                                  + [_origins(l, nb) for l in places.loads]
                                  + [(nb, nb, nb) for _ in places.turning]),
        places=places,
    )  # fmt: skip


def parts_of_row(count: int) -> list[int]:
    """Return the parts of the joint coordinates in the row of a coupling."""
    return [FIRST_PART, *[INNER_PART] * (count - 2), LAST_PART]


def _coupled_bodies(places: Places) -> tuple[list[list[int]], tuple[list[int], list[int]]]:
    """Return the bodies of each coupling, four or more, padded with the fixed frame; and the positions in a
    row of the columns of each primitive's first and second body."""
    coupled: list[list[int]] = []
    columns: tuple[list[int], list[int]] = [], []
    bodies: list[int] = []
    for k, place in enumerate(places.primitives):
        if place.part == FIRST_PART:
            stop = next(j for j, p in enumerate(places.primitives[k:], k) if p.part == LAST_PART) + 1
            row = places.primitives[k:stop]
            bodies = list(dict.fromkeys(body for p in row for body in (p.first, p.second)))
            coupled.append(bodies + [places.nb] * (4 - len(bodies)))
        ends = (place.first, place.second)
        found = [6 * bodies.index(body) for body in ends] if place.part else [0, 6]
        for each, column in zip(columns, found, strict=True):
            each.append(column)
    return coupled, columns


def _of_vectors(bodies: Sequence[Sequence[int]]) -> np.ndarray:
    return np.array([body for each in bodies for body in each], dtype=np.int64)


def _origins(load: LoadPlace, nb: int) -> tuple[int, ...]:
    """Return the bodies from whose centres of mass the vectors of a load are measured: two points, then
    an axis."""
    between_points = load.kind in (SPRING, ALONG_AXIS, POINT_DAMPER)
    first = load.first if between_points or load.kind == FORCE else nb
    second = load.second if between_points else nb
    return first, second, nb
