"""Orientations of the bodies of a scene: fixed, rotating about an axis at rest, or free."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mbref import rotations
from mbref.equations.model import Model
from mbref.taylor.direction_vectors import DirectionVectors, direction_forms
from mbref.taylor.expressions import NEGLIGIBLE, ONE, Expression, Polynomial, cleaned, product_sum
from mbref.taylor.numbers import dot, norm, scalar

PARALLEL = 1e-9  # sine of an angle between axes below which they are parallel
APART = 0.2  # sine of the least angle between two directions of a basis

Triple = tuple[Expression, ...]
Frame = tuple[int, np.ndarray]  # number of an orientation, and an axis fixed in it (world, at the start)


@dataclass(frozen=True)
class Orientation:
    """Rotation matrix R of some bodies: fixed (no variables), rotating about an axis, or free.

    The variables of a free orientation are the direction vectors of its ``basis``, three directions (3, 3) in
    rows. An orientation that rotates about an axis has a right-handed basis (arm, across, axis). Its
    variables are the components of the arm along the first two rows of the fixed ``frame`` (3, 3), whose
    third row is the axis.
    """

    variables: tuple[int, ...] = ()
    basis: np.ndarray | None = None
    frame: np.ndarray | None = None

    @functools.cached_property
    def _dual(self) -> np.ndarray:
        """Return the dual basis (3, 3): the components of a direction are its products with these rows."""
        assert self.basis is not None
        across = [rotations.cross(self.basis[k - 2], self.basis[k - 1]) for k in range(3)]
        return np.array(across) / dot(self.basis[0], across[0])

    def direction_vector(self, w: np.ndarray) -> Triple:
        """Return R w of a direction w (3,) that is fixed in the bodies."""
        if self.basis is None:
            return tuple({ONE: c} if c else {} for c in w.tolist())
        a, b, c = dot(self._dual, w).tolist()
        if self.frame is None:
            x, y, z = self.variables[:3], self.variables[3:6], self.variables[6:]
            direction_vectors = ({i: a, j: b, k: c} for i, j, k in zip(x, y, z, strict=True))
        else:
            cosine, sine = self.variables
            direction_vectors = (
                {ONE: c * z, cosine: a * x + b * y, sine: a * y - b * x}
                for x, y, z in zip(*self.frame.tolist(), strict=True)
            )
        return tuple(map(cleaned, direction_vectors))

    def rows(self) -> Iterator[Polynomial]:
        """Yield the rows by which R is a rotation."""
        if self.frame is not None:
            cosine, sine = ({v: 1.0} for v in self.variables)
            yield product_sum([(cosine, cosine), (sine, sine), ({ONE: 1.0}, {ONE: -1.0})], 0.5)
        elif self.basis is not None:
            direction_vectors = [self.direction_vector(b) for b in self.basis]
            for i, j in itertools.combinations_with_replacement(range(3), 2):
                square = {ONE: -scalar(dot(self.basis[i], self.basis[j]))}
                pairs = [*zip(direction_vectors[i], direction_vectors[j], strict=True), (square, {ONE: 1.0})]
                yield product_sum(pairs, 0.5 if i == j else 1.0)


FIXED = Orientation()


class Orientations:
    """The orientations of a model's bodies, by number: -1 is the orientation of the fixed frame.

    ``axes`` (nb, 3, 3) are the principal frames at the start. ``moving`` (nb, 3) are True for principal axes
    about which a body can turn. The variables are added to ``direction_vectors``.
    """

    def __init__(
        self, model: Model, axes: np.ndarray, moving: np.ndarray, direction_vectors: DirectionVectors
    ):
        self.model, self.nb = model, model.nb
        self._axes, self._moving, self._direction_vectors = axes, moving, direction_vectors
        self.group = self._groups()
        self.numbered = self._orientations()

    def __getitem__(self, body: int) -> Orientation:
        """Return the orientation of a body, or of the fixed frame (index nb)."""
        return self.numbered[self.number(body)]

    def number(self, body: int) -> int:
        """Return the number of the orientation of a body, or of the fixed frame (index nb)."""
        return self.group[body] if body < self.nb else -1

    def world(self, body: int, local: np.ndarray) -> np.ndarray:
        """Return a direction (3,) in the principal frame of a body in world axes at the start."""
        return dot(self._axes[body], local) if body < self.nb else np.asarray(local)

    def _groups(self) -> list[int]:
        """Return the number of the orientation of each body; -1 for bodies that do not rotate."""
        group = [*range(self.nb), -1]
        for joint in self.model.joints:
            if len(joint.facts.forbidden_rotations) == 3:
                first, second = (group[self.model.index(name)] for name in joint.bodies)
                keep, go = min(first, second), max(first, second)
                group = [keep if g == go else g for g in group]
        return group[:-1]

    def _orientations(self) -> dict[int, Orientation]:
        at_rest = self._axes_at_rest()
        found = {-1: FIXED}
        for group in sorted(set(self.group) - {-1}):
            axes = at_rest.get(group, [])
            if len(axes) > 1:
                found[group] = FIXED
            elif axes:
                found[group] = self._turning(group, axes[0])
            else:
                found[group] = self._free(group)
        return found

    def _axes_at_rest(self) -> dict[int, list[np.ndarray]]:
        """Return up to two axes at rest of each orientation, in world axes."""
        known: dict[int, list[np.ndarray]] = {-1: [np.eye(3)[0], np.eye(3)[1]]}
        for body, (group, turns) in enumerate(zip(self.group, self._moving, strict=True)):
            turning = np.flatnonzero(turns).tolist()
            for k in turning if len(turning) == 1 else [] if turning else [0, 1, 2]:
                _keep(known, group, self._axes[body][:, k])
        shared, grown = list(self.shared_axes()), True
        while grown:
            grown = False
            for (one, a), (other, b) in (*shared, *((other, one) for one, other in shared)):
                axes = known.get(one, [])
                if len(axes) > 1 or any(map(functools.partial(_are_parallel, a), axes)):
                    grown |= _keep(known, other, b)
        return known

    def shared_axes(self) -> Iterator[tuple[Frame, Frame]]:
        """Yield pairs of orientations that joints let turn about a common axis only, each with the axis
        (world)."""
        for joint in self.model.joints:
            if len(joint.facts.forbidden_rotations) == 2:
                yield tuple(  # type: ignore[misc]
                    (self._group_of(name), self._axis(name, joint.directions[0])) for name in joint.bodies
                )

    def _group_of(self, name: str) -> int:
        body = self.model.index(name)
        return self.group[body] if body < self.nb else -1

    def _axis(self, name: str, axis: Sequence[float]) -> np.ndarray:
        world = self._world_of(name, np.asarray(axis))
        return np.asarray(world / norm(world))

    def _world_of(self, name: str, vector: np.ndarray) -> np.ndarray:
        """Return a direction that moves with a body, given in the scene's world axes, at the start."""
        body = self.model.index(name)
        return self.world(body, dot(self.model.to_local[body], vector))

    def _turning(self, group: int, axis: np.ndarray) -> Orientation:
        frame = self._frame(axis)
        across = (d - axis * dot(axis, d) for d in self._directions(group))
        arm = next(d for d in across if norm(d) > APART)
        arm = arm / norm(arm)
        return Orientation(
            self._variables(group, frame[:2], [arm]), np.array([arm, rotations.cross(axis, arm), axis]), frame
        )

    def _frame(self, axis: np.ndarray) -> np.ndarray:
        """Return right-handed unit vectors in rows: the third is the axis, the first a direction along which
        a body slides."""
        slides = [j for j in self.model.joints if len(j.facts.forbidden_translations) == 2]
        along = [self._axis(j.bodies[0], j.directions[0]) for j in slides]
        first = next((x for x in along if abs(dot(x, axis)) < PARALLEL), np.eye(3)[np.argmin(np.abs(axis))])
        first = first - axis * dot(axis, first)
        first = first / norm(first)
        return np.array([first, rotations.cross(axis, first), axis])

    def _free(self, group: int) -> Orientation:
        basis = _basis(self._directions(group))
        return Orientation(self._variables(group, np.eye(3), basis), basis=basis)

    def _variables(self, group: int, axes: np.ndarray, directions: Iterable[np.ndarray]) -> tuple[int, ...]:
        """Add components along axes at rest (k, 3) of directions that move with an orientation."""
        body = self.group.index(group)
        forms = [direction_forms(axes, dot(self._axes[body].T, w)) for w in directions]
        return self._direction_vectors.add(body, np.concatenate(forms))

    def _directions(self, group: int) -> Iterator[np.ndarray]:
        """Yield directions for the basis of an orientation, the best first: axes of joints, arms, principal
        axes."""
        joints = [joint for joint in self.model.joints if group in map(self._group_of, joint.bodies)]
        for joint in joints:
            for name, axis in zip(joint.bodies, joint.directions * (3 - len(joint.directions)), strict=False):
                if self._group_of(name) == group:
                    yield self._axis(name, axis)
        for b in (b for b in range(self.nb) if self.group[b] == group):
            name = self.model.bodies[b].name
            anchors = [
                p
                for joint in joints
                for n, p in zip(joint.bodies, joint.anchor_pair, strict=True)
                if n == name
            ]
            for one, other in itertools.combinations(anchors, 2):
                arm = self._world_of(name, np.subtract(other, one))
                if (length := norm(arm)) > NEGLIGIBLE:
                    yield arm / length
            yield from self._axes[b].T


def _are_parallel(one: np.ndarray, other: np.ndarray) -> bool:
    return bool(norm(rotations.cross(one, other)) < PARALLEL)


def _keep(known: dict[int, list[np.ndarray]], group: int, axis: np.ndarray) -> bool:
    """Add an axis to the known axes of an orientation; return whether the axis is new."""
    axes = known.setdefault(group, [])
    if len(axes) > 1 or any(map(functools.partial(_are_parallel, axis), axes)):
        return False
    axes.append(axis)
    return True


def _basis(directions: Iterable[np.ndarray]) -> np.ndarray:
    """Return in rows the first two directions with a large enough angle and the unit vector across both."""
    chosen: list[np.ndarray] = []
    for unit in directions:
        if not chosen or norm(rotations.cross(chosen[0], unit)) > APART:
            chosen.append(unit)
        if len(chosen) == 2:
            break
    across = rotations.cross(*chosen)
    return np.array([*chosen, across / norm(across)])
