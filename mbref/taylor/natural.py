"""A scene in natural coordinates: joints as products of linear forms, with as few variables as rows allow.

The variables of a body are its centre of mass and its rotation from the start, R (J. García de Jalón and E.
Bayo, Kinematic and Dynamic Simulation of Multibody Systems, 1994): points and directions fixed in it are
linear in them, joints are rows of second degree, and the mass matrix is constant.  Bodies that keep their
relative orientation share R.  If an axis of R is known to rest, R has two variables, the components of one
direction vector. If not, R has three direction vectors, axes of joints first, so that joints share variables.
Linear equations eliminate variables (see ``expressions``).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from mbref import rotations
from mbref.equations.model import Model
from mbref.kernels.scene_layout import COUPLED_ANGLE, COUPLED_SLIDE, DISTANCE, DOT1, DOT2, POINT
from mbref.taylor.direction_vectors import DirectionVectors, direction_forms
from mbref.taylor.expressions import (
    ONE,
    Elimination,
    Expression,
    Polynomial,
    as_expression,
    combination,
    degree,
    independent,
    plus,
    product_sum,
    significant,
)
from mbref.taylor.loads import COSINE, SINE, VALUE
from mbref.taylor.numbers import ManyScenes, OneScene, largest, of_first, scalar
from mbref.taylor.orientations import Orientations, Triple

MOST_TERMS = 40  # largest number of terms of an equation that eliminates a position
MOST_FACTORS = 1  # largest number of further variables of an equation that eliminates a direction
MOST_KINEMATIC = 4  # largest number of terms if the equations serve kinematics only


class Pose(NamedTuple):
    """Centres of mass (nb, 3) in m and principal frames (nb, 3, 3) of the bodies at the start."""

    centres: np.ndarray
    axes: np.ndarray


def pose_of(q: np.ndarray) -> Pose:
    """Return the pose of coordinates (…, 7 nb)."""
    poses = q.reshape(*q.shape[:-1], -1, 7)
    return Pose(poses[..., :3], rotations.to_matrix(poses[..., 3:]))


def unit_of_length(length: float) -> float:
    """Return the power of two nearest to a length (m)."""
    return float(2.0 ** round(np.log2(length)))


class NaturalCoordinates:
    """The variables of a model from its pose at the start, lengths in the unit ``length`` (m), and rows.

    ``moving`` (n,) are the velocities that can be nonzero. ``kept`` are the remaining variables, ``given``
    the variables that drivers prescribe, each as (driver, VALUE, COSINE or SINE).  ``coordinates`` belong to
    rows of couplings, in addition to the products of the rows.  If drivers prescribe the whole motion
    (``driven``), no forces are needed: equations eliminate more variables, and driven cranks have linear
    rows.
    """

    def __init__(
        self, model: Model, pose: Pose, moving: np.ndarray, driven: bool, numbers: OneScene | ManyScenes
    ):
        self.model, self.nb, self.driven, self.numbers = model, model.nb, driven, numbers
        self.length = unit_of_length(model.length)
        self.place, axes = pose.centres / self.length, pose.axes
        self._moving = moving.reshape(-1, 6)
        self.direction_vectors = DirectionVectors(self.length)
        self.given: dict[int, tuple[int, int]] = {}
        self.centres = [self.direction_vectors.add(b, np.eye(12)[:3]) for b in range(self.nb)]
        self._positions = range(3 * self.nb)
        self.eliminate = Elimination(self._may_go)
        self.orientations = Orientations(model, axes, self._moving[:, 3:], self.direction_vectors)
        # primitive of a joint coordinate → its row, and the factors of its powers in this row
        self.coordinates: dict[int, tuple[int, list[float]]] = {}
        self.rows = self._rows()
        gone = self.eliminate.expressed
        kept = (v for v in range(len(self.direction_vectors)) if v not in gone and v not in self.given)
        products = Counter(v for row in self.rows for pair in row if ONE not in pair for v in {*pair})
        self.kept = sorted(kept, key=lambda v: -products[v])

    # --- variables ----------------------------------------------------------------------------------------
    def _may_go(self, variable: int, others: int) -> bool:
        of_directions = MOST_KINEMATIC if self.driven else MOST_FACTORS
        most = MOST_TERMS if variable in self._positions else of_directions
        return others <= most and variable not in self.given

    def direction(self, body: int, local: np.ndarray) -> Triple:
        """Return a direction fixed in a body, given in its principal frame."""
        return tuple(
            map(
                self.eliminate, self.orientations[body].direction_vector(self.orientations.world(body, local))
            )
        )

    def point(self, body: int, local: np.ndarray) -> Triple:
        """Return a point fixed in a body, given in its principal frame from its centre of mass (m)."""
        arm = self.orientations[body].direction_vector(self.orientations.world(body, local) / self.length)
        if body == self.nb:
            return arm
        centre = ({v: 1.0} for v in self.centres[body])
        moved = (combination((1.0, c), (1.0, a)) for c, a in zip(centre, arm, strict=True))
        return tuple(map(self.eliminate, moved))

    # --- rows ---------------------------------------------------------------------------------------------
    def _rows(self) -> list[Polynomial]:
        """Return independent rows of degree 2, and rows of degree 1 that eliminate nothing."""
        for equation in self._linear_equations():
            self.eliminate.add(equation)
        self.eliminate.settle()
        kinds = self.model.data.primitives.kind
        rows, turned = [], set()
        for p in np.flatnonzero(~np.isin(kinds, (POINT, COUPLED_ANGLE, COUPLED_SLIDE))).tolist():
            number = self._turned(p)
            if number is not None and number not in turned:
                turned.add(number)
                rows += self._turning(p)
            else:
                is_driven = self.model.data.primitives.driver[p] >= 0
                rows += self._driven(p) if is_driven else [self._undriven(p)]
        couplings = self._couplings()
        rows += [row for row, coordinates in couplings if not coordinates]
        free = (o for number, o in self.orientations.numbered.items() if number not in turned)
        rows = [row for orientation in free for row in orientation.rows()] + rows
        before: int | None = None
        while before != len(self.eliminate.expressed):
            before, rows = len(self.eliminate.expressed), [self._reduced(row) for row in rows]
            for row in rows:
                if degree(row) == 1 and not self._is_prescribed(row):
                    self.eliminate.add(as_expression(row))
            self.eliminate.settle()
        linear = ({(ONE, v): c for v, c in equation.items()} for equation in self.eliminate.left)
        found = independent([row for row in (*rows, *linear) if degree(row) > 0])
        for row, coordinates in couplings:
            if coordinates:
                self.coordinates |= {p: (len(found), law) for p, law in coordinates}
                found.append(self._reduced(row))
        return found

    def _couplings(self) -> list[tuple[Polynomial, list[tuple[int, list[float]]]]]:
        """Return for each coupling the polynomial of its displacements in first power, and all other
        coordinates with the factors of their powers.

        In the unit of length the largest factor of a coordinate is 1.
        """
        primitives, found = self.model.data.primitives, []
        coupled = np.flatnonzero(np.isin(primitives.kind, (COUPLED_ANGLE, COUPLED_SLIDE)))
        begins = np.flatnonzero(primitives.begins[coupled])
        for ends in np.split(coupled, begins[1:]) if coupled.size else ():
            row, polynomial = ends.tolist(), Polynomial()
            factors = [scalar(primitives.length[p]) * self._unit(p) for p in row]
            size = largest(factors)
            coordinates = []
            for p, factor in zip(row, factors, strict=True):
                law = [factor / size]
                for k, higher in enumerate(primitives.higher[p], 2):
                    law.append(scalar(higher) * self._unit(p) ** k / size)
                if primitives.kind[p] == COUPLED_ANGLE or any(map(of_first, law[1:])):
                    coordinates.append((p, law))
                else:
                    axis = self.direction(int(primitives.first[p]), primitives.direction_first[p])
                    apart = _difference(*self._ends(p)[::-1])
                    moved = product_sum(zip(axis, apart, strict=True), factor / size)
                    polynomial = {
                        k: polynomial.get(k, 0.0) + moved.get(k, 0.0) for k in {**polynomial, **moved}
                    }
            found.append((polynomial, coordinates))
        return found

    def _unit(self, p: int) -> float:
        """Return the unit of a joint coordinate: the unit of length (m), or one radian."""
        return self.length if self.model.data.primitives.kind[p] == COUPLED_SLIDE else 1.0

    def _is_prescribed(self, row: Polynomial) -> bool:
        """Return whether a row has a driver; such a row eliminates nothing, because M would depend on
        time."""
        return any(variable in self.given for pair in row for variable in pair)

    def _linear_equations(self) -> Iterator[Expression]:
        """Yield expressions that are zero: static positions, axes that joints share, coincident points."""
        for b, c in zip(*np.nonzero(~self._moving[:, :3]), strict=True):
            yield {self.centres[b][c]: 1.0, ONE: -scalar(self.place[b, c])}
        numbered = self.orientations.numbered
        pairs = [(numbered[one].direction_vector(a), numbered[other].direction_vector(b))
                 for (one, a), (other, b) in self.orientations.shared_axes()]  # fmt: skip
        primitives = self.model.data.primitives
        pairs += [self._ends(p) for p in np.flatnonzero(primitives.kind == POINT).tolist()]
        for first, second in pairs:
            yield from _difference(first, second)

    def _ends(self, p: int) -> tuple[Triple, Triple]:
        """Return the points of a primitive constraint on both bodies."""
        table = self.model.data.primitives
        first, second = int(table.first[p]), int(table.second[p])
        return self.point(first, table.point_first[p]), self.point(second, table.point_second[p])

    def _undriven(self, p: int) -> Polynomial:
        table = self.model.data.primitives
        if table.kind[p] == DISTANCE:
            apart, length = _difference(*self._ends(p)), scalar(table.length[p]) / self.length
            pairs = [*zip(apart, apart, strict=True), ({ONE: length}, {ONE: -length})]
            return product_sum(pairs, 0.5 / length)
        first = self.direction(int(table.first[p]), table.direction_first[p])
        return product_sum(zip(first, self._other_side(p), strict=True))

    def _other_side(self, p: int) -> Triple:
        """Return the vector that stays perpendicular to a primitive's first direction."""
        table = self.model.data.primitives
        if table.kind[p] == DOT1:
            return self.direction(int(table.second[p]), table.direction_second[p])
        return _difference(*self._ends(p)[::-1])

    def _turned(self, p: int) -> int | None:
        """Return the orientation that a driver turns about an axis at rest, from directions at rest; None if
        no such driver exists."""
        table = self.model.data.primitives
        if not self.driven or table.driver[p] < 0 or table.kind[p] != DOT1:
            return None
        body = int(table.first[p])
        at_rest = (self.direction(body, w[p]) for w in (table.direction_first, table.turning_first))
        if any(set(component) - {ONE} for direction_vector in at_rest for component in direction_vector):
            return None
        number = self.orientations.number(int(table.second[p]))
        return number if self.orientations.numbered[number].frame is not None else None

    def _turning(self, p: int) -> list[Polynomial]:
        """Return rows of degree 1 of a driven direction, cos ψ x + sin ψ y, which determine the rotation."""
        table = self.model.data.primitives
        cosine, sine = self._prescribed(int(table.driver[p]), (COSINE, SINE))
        x, y = (
            self.direction(int(table.first[p]), w[p]) for w in (table.direction_first, table.turning_first)
        )
        rows = []
        for a, b, d in zip(x, y, self._other_side(p), strict=True):
            along = {cosine: a.get(ONE, 0.0), sine: b.get(ONE, 0.0)}
            rows.append(plus(plus({}, 1.0, d), -1.0, along))
        return rows

    def _driven(self, p: int) -> list[Polynomial]:
        """Return rows of a driven displacement or angle: the direction of the second body stays perpendicular
        to the direction e = cos ψ y - sin ψ x of the first body, which the driver turns."""
        table = self.model.data.primitives
        driver, body = int(table.driver[p]), int(table.first[p])
        if table.kind[p] == DOT2:
            (value,) = self._prescribed(driver, (VALUE,))  # in the unit of length
            return [plus(self._undriven(p), -1.0, {value: 1.0})]
        cosine, sine = self._prescribed(driver, (COSINE, SINE))
        x, y = (self.direction(body, w) for w in (table.direction_first[p], table.turning_first[p]))
        turned = [product_sum([({cosine: 1.0}, b), ({sine: -1.0}, a)]) for a, b in zip(x, y, strict=True)]
        rows: list[Polynomial] = []
        if max(map(degree, turned)) == 2:
            turned, rows = self._own_variables(p, turned)
        e = tuple(map(as_expression, turned))
        return [*rows, product_sum(zip(e, self._other_side(p), strict=True))]

    def _own_variables(self, p: int, turned: list[Polynomial]) -> tuple[list[Polynomial], list[Polynomial]]:
        """Return a direction of degree 2 as new variables, and the rows that define them."""
        table = self.model.data.primitives
        body = int(table.first[p])
        along, across = (
            direction_forms(np.eye(3), w[p]) for w in (table.turning_first, table.direction_first)
        )
        own = self.direction_vectors.add(body, along, across, int(table.driver[p]))
        rows = [plus(row, -1.0, {v: 1.0}) for row, v in zip(turned, own, strict=True)]
        return [{(ONE, v): 1.0} for v in own], rows

    def _prescribed(self, driver: int, functions: Sequence[int]) -> tuple[int, ...]:
        variables = self.direction_vectors.add(self.nb, np.zeros((len(functions), 12)))
        self.given |= {v: (driver, function) for v, function in zip(variables, functions, strict=True)}
        return variables

    def _reduced(self, row: Polynomial) -> Polynomial:
        """Return a row without eliminated variables."""
        gone, total = self.eliminate.expressed, Polynomial()
        for (i, j), coefficient in row.items():
            if i in gone or j in gone:
                pair = (self.eliminate({i: 1.0}), self.eliminate({j: 1.0}))
                for key, value in product_sum([pair], coefficient).items():
                    total[key] = total.get(key, 0.0) + value
            else:
                total[i, j] = total.get((i, j), 0.0) + coefficient
        return significant(total, (ONE, ONE))


def _difference(first: Triple, second: Triple) -> Triple:
    return tuple(combination((1.0, a), (-1.0, b)) for a, b in zip(first, second, strict=True))
