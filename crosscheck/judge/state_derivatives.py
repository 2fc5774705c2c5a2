"""Derivatives of a scene's accelerations at its start, along motions that the constraints allow.

The judge's equations in joint coordinates (formulation B) are evaluated at states near the start, in long
doubles or 30 digits, and derivatives are central differences. The rule of the tangent: with N the allowed
displacements, Φ_q N = 0,

- a coordinate u moves the pose along N u, with closed loops;
- a pose that moves changes the twists (velocity and angular velocity, world) by the least change δv,
  ½ δvᵀ M δv, that keeps them consistent with joints and drivers;
- a number of the scene leaves pose and twists as they are if the changed scene allows it, and otherwise
  changes them by the least δq and δv in the same metric.

Changes of the rates of armatures count in M. Where a body has no mass, all masses and inertias are 1.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

from crosscheck.judge.arithmetic import EXTENDED, Arithmetic, doubles, many_digits
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.reference.tree_equations import OPEN, Instant, TreeEquations
from crosscheck.judge.reference.vectors import apply, product, saddle_solve, unit
from mbref.scene import Scene, SceneError

DIGITS = 30  # of the arithmetic, if python-flint is installed
ORDER, ORDER_OF_DIGITS = 8, 2  # of differences: with many digits the steps are short
TRUNCATION = {8: 1e8, 2: 1e2}  # error of differences of an order / that power of the step h
CORRECTIONS = 6  # most Newton steps that close the loops of displaced states
CONJUGATE = np.array([1, -1, -1, -1])  # factors of the inverse of a quaternion
SAFETY = 4.0  # factor on the difference of two computations
STEPS_OF_PATHS = re.compile(r"([a-z_]+)|\[([^\]]+)\]")  # fields, and entries by index or name
FAR, TRIES = 1e-3, 3  # displacements (lengths or rad) that open loops at a singular position
AT_REST = {"velocity": None, "angular_velocity": None}
OTHER_ROWS = 1  # seed of the second computation, which keeps other redundant rows


class NotSmooth(Exception):
    """The accelerations have no derivative at a state; the argument says the reason."""


class StateDerivatives(NamedTuple):
    """Accelerations (6 nb,) at the start, and their derivatives by coordinates u of the allowed motions.

    Of each body in turn the acceleration of its centre of mass and the angular acceleration, world. ``basis``
    N (6 nb, f) are twists, m and rad, by unit u. ``by_position`` and ``by_velocity`` (6 nb, f) are along u
    and u', ``by_force`` (6 nb, 6 nb) along forces at the centres of mass and moments on the bodies, world,
    and ``by_number`` (6 nb, p) along numbers of the scene. ``carried`` (6 nb, f) is the change δv of the
    twists along u.
    """

    accelerations: np.ndarray
    basis: np.ndarray
    by_position: np.ndarray
    by_velocity: np.ndarray
    by_force: np.ndarray
    by_number: np.ndarray
    carried: np.ndarray


class Bounded(NamedTuple):
    """Derivatives, and a bound of the error of each entry; the basis counts as exact."""

    values: StateDerivatives
    bounds: StateDerivatives


def bounded_derivatives(
    scene: Scene, numbers: Sequence[str] = (), arithmetic: Arithmetic | None = None
) -> Bounded:
    """Return the derivatives at the start with bounds, from two computations with different steps and rows.

    ``numbers`` are paths such as ``body[rod].mass``. Raises SceneError for a path without a number, and
    NotSmooth at a singular position.
    """
    arithmetic = arithmetic or _finest()
    order = ORDER_OF_DIGITS if arithmetic.digits else ORDER
    step = (arithmetic.eps / TRUNCATION[order]) ** (1 / (order + 1))  # truncation and rounding are equal
    first = _Start(scene, arithmetic, order, 0)
    first.refuse_singular()
    other = _Start(scene, arithmetic, order, OTHER_ROWS, first.directions)
    one, two = first.derivatives(numbers, step), other.derivatives(numbers, step / 2)
    eps = float(np.finfo(float).eps)
    bounds = [SAFETY * np.abs(a - b) + eps * np.abs(a) for a, b in zip(one, two, strict=True)]
    return Bounded(one, StateDerivatives(*bounds))


class _Start:
    """The equations of a scene at its start: state y (n,), twists (6 nb,), and rates (g,) of armatures."""

    def __init__(
        self,
        scene: Scene,
        arithmetic: Arithmetic,
        order: int,
        seed: int,
        directions: np.ndarray | None = None,
    ):
        self.scene, self.arithmetic = scene, arithmetic
        self.equations = TreeEquations(scene, arithmetic, (seed, 0.0))
        self.offsets = np.concatenate([-np.arange(order // 2, 0, -1), np.arange(1, order // 2 + 1)])
        self.y = self.equations.start()
        if reason := self.equations.undetermined():
            raise NotSmooth(reason)
        self.begin = int(self.equations.ends[2])
        at = self.at(self.y[None])
        self.twists, self.geared = _twists(at)[0], _geared(self.equations, at)[0]
        self.poses, self.columns = _poses(self.equations, at), _columns(at)[0]
        self.rates = self._allowed(at) if directions is None else self._rates(directions)
        self.directions = doubles(self.columns @ self.rates)

    def at(self, y: np.ndarray) -> Instant:
        """Return the parts of the equations at states (K, n)."""
        return self.equations.at(self.arithmetic.zeros(len(y)), y)

    def refuse_singular(self) -> None:
        """Raise NotSmooth if the loops open along some of the allowed motions."""
        weights = np.random.default_rng(0).normal(size=(self.rates.shape[1], TRIES))
        self.moved(FAR * (self.rates @ weights).T)

    def derivatives(self, numbers: Sequence[str], step: float) -> StateDerivatives:
        """Return the derivatives by differences with a step, in units of the mechanism."""
        own = self.accelerations(self.y[None])[0]
        steps = step * np.outer(self.rates.T.ravel(), self.offsets).reshape(*self.rates.T.shape, -1)
        moves = np.moveaxis(steps, 2, 1)  # (f, offsets, nv)
        f, nv = len(moves), self.equations.nv
        flat = moves.reshape(f * len(self.offsets), nv)
        moved = self.moved(flat)
        placed, carried = self.accelerations(moved), _twists(self.at(moved))
        speed = float(np.abs(doubles(self.twists)).max(initial=0.0)) or 1.0
        fast = np.repeat(self.y[None], len(flat), axis=0)
        fast[:, self.begin :] = fast[:, self.begin :] + speed / step * flat
        rated = self.accelerations(fast)
        by_place, by_rate, changed = (
            self._slopes(value, values.reshape(f, len(self.offsets), -1), self.offsets * h)
            for value, values, h in ((own, placed, step), (own, rated, speed), (self.twists, carried, step))
        )
        by_number = [self._by_number(own, label, step) for label in numbers]
        return StateDerivatives(
            doubles(own),
            self.directions,
            by_place,
            by_rate,
            self._by_force(),
            np.array(by_number).reshape(len(numbers), len(own)).T,
            changed,
        )

    def accelerations(self, y: np.ndarray) -> np.ndarray:
        """Return accelerations (K, 6 nb) at states (K, n)."""
        equations, at = self.equations, self.at(y)
        t = self.arithmetic.zeros(len(y))
        mass, force = equations.loads.terms(at.placed, at.coordinates, at.rate, t, 0.0)
        rows, drift = at.rows.jacobian[:, equations.kept], at.rows.drift[:, equations.kept]
        found = saddle_solve(mass, rows, force, -1 * drift)[0]
        placed = at.placed
        drifts = np.concatenate([placed.drift[:, :-1], placed.spin_drift[:, :-1]], axis=2)
        return np.asarray(apply(_columns(at), found) + drifts.reshape(len(y), -1))

    def moved(self, steps: np.ndarray) -> np.ndarray:
        """Return the states (K, n) after displacements (K, nv) of the joint coordinates, with closed loops
        and the nearest twists. Raises NotSmooth if the loops open."""
        y = np.repeat(self.y[None], len(steps), axis=0)
        jacobian = np.repeat(self.at(self.y[None]).coordinates.jacobian, len(steps), axis=0)
        return self.near(self.equations.displaced(y, steps, jacobian))

    def near(self, y: np.ndarray) -> np.ndarray:
        """Return states (K, n) with closed loops near others, and the twists nearest to the start's.
        Raises NotSmooth if there are none."""
        equations, t, last = self.equations, self.arithmetic.zeros(len(y)), np.inf
        for _ in range(CORRECTIONS):
            better = self.arithmetic.settled(equations.nearer(t, y))
            size = np.abs(doubles(better - y)[:, : self.begin]).max(initial=0.0)
            if not size < last:
                break
            y, last = better, size
        at = self.at(y)
        if np.abs(doubles(at.rows.value)).max(initial=0.0) > OPEN * equations.length:
            raise NotSmooth("the start is a singular position: some displacements open the loops")
        rows, speed = at.rows.jacobian[:, equations.kept], at.speed[:, equations.kept]
        right = apply(rows, at.rate) - speed
        y[:, self.begin :] = self._nearest(at, self.twists, self.geared, right)
        return y

    def _nearest(self, at: Instant, twists: Any, geared: Any, right: np.ndarray) -> np.ndarray:
        """Return the joint rates (K, nv) of the twists nearest to given ones for which G r = right (K, m)."""
        loads = self.equations.loads
        force = loads.momentum(at.placed, at.coordinates, twists, geared)
        rows = at.rows.jacobian[:, self.equations.kept]
        return saddle_solve(loads.mass_matrix(at.placed, at.coordinates), rows, force, right)[0]

    def _allowed(self, at: Instant) -> np.ndarray:
        """Return rates (nv, f) of the joint coordinates that the rows allow, of unit size."""
        equations, sizes = self.equations, self.equations.rate_sizes
        rows = at.rows.jacobian[0, equations.kept]
        scaled = doubles(rows) * sizes
        scaled = scaled / (np.linalg.norm(scaled, axis=1, keepdims=True))
        free = np.linalg.svd(scaled, full_matrices=True)[2][len(rows) :].T
        found = self.arithmetic.array(sizes[:, None] * free)
        return self._onto(rows, found)

    def _rates(self, twists: np.ndarray) -> np.ndarray:
        """Return the rates (nv, f) of the joint coordinates for allowed twists (6 nb, f)."""
        rows = self.at(self.y[None]).rows.jacobian[0, self.equations.kept]
        back = np.linalg.pinv(doubles(self.columns))
        found = self.arithmetic.array(back @ twists)
        for _ in range(2):
            found = found + back @ (self.arithmetic.array(twists) - self.columns @ found)
        return self._onto(rows, found)

    @staticmethod
    def _onto(rows: np.ndarray, found: np.ndarray) -> np.ndarray:
        back = np.linalg.pinv(doubles(rows))
        for _ in range(2):
            found = found - back @ (rows @ found)
        return found

    def _slopes(self, own: np.ndarray, values: np.ndarray, offsets: Any) -> np.ndarray:
        """Return derivatives (n, f) from values (f, offsets, n) at offsets from the value ``own`` (n,)."""
        weights = _weights(self.arithmetic.array(offsets))
        found = ((values - own) * weights[:, None]).sum(axis=1)
        return doubles(found).T

    def _by_force(self) -> np.ndarray:
        """Return the accelerations (6 nb, 6 nb) of unit forces and moments on the bodies."""
        equations, at = self.equations, self.at(self.y[None])
        mass = equations.loads.mass_matrix(at.placed, at.coordinates)
        rows, count = at.rows.jacobian[:, equations.kept], len(self.columns)
        mass, rows = np.repeat(mass, count, axis=0), np.repeat(rows, count, axis=0)
        none = self.arithmetic.zeros(count, rows.shape[1])
        found = saddle_solve(mass, rows, self.columns, none)[0]
        return doubles(found @ self.columns.T).T

    def _by_number(self, own: np.ndarray, label: str, step: float) -> np.ndarray:
        """Return the derivative (6 nb,) by a number of the scene."""
        value = number_at(self.scene, label)
        size = scene_length(self.scene) if re.search("anchor|point|position", label) else abs(value) or 1.0
        places = value + self.offsets * step * size
        values = [self._of_variant(self.scene.with_(label, float(place))) for place in places]
        offsets = self.arithmetic.array(places) - self.arithmetic.number(value)
        return self._slopes(own, np.array(values)[None], offsets)[:, 0]

    def _of_variant(self, scene: Scene) -> np.ndarray:
        """Return the accelerations (6 nb,) of another scene at the state nearest to this start."""
        at_rest = [body.model_copy(update=AT_REST) for body in scene.body]
        other = _Start(
            scene.with_(body=at_rest), self.arithmetic, len(self.offsets), 0, self.directions[:, :0]
        )
        at = other.at(other.y[None])
        apart = np.concatenate([self.poses[0] - other.poses[0], _turned(other.poses[1], self.poses[1])], 1)
        still = 0 * at.speed[:, other.equations.kept]
        step = other._nearest(at, apart.ravel(), 0 * self.geared, still)
        other.twists, other.geared = self.twists, self.geared
        return other.accelerations(other.moved(step))[0]


def _finest() -> Arithmetic:
    """Return the arithmetic of DIGITS, or of long doubles without python-flint."""
    return many_digits(DIGITS) if find_spec("flint") else EXTENDED


def number_at(scene: Scene, label: str) -> float:
    """Return the number of a scene at a path; raises SceneError if there is none."""
    found: object = scene
    for name, entry in STEPS_OF_PATHS.findall(label):
        if entry and isinstance(found, tuple):
            names = [getattr(each, "name", getattr(each, "joint", None)) for each in found]
            place = int(entry) if entry.isdigit() else names.index(entry) if entry in names else len(found)
            found = found[place] if place < len(found) else None
        elif isinstance(found, tuple):
            found = found["xyz".index(name)] if name in ("x", "y", "z") else None
        else:
            found = getattr(found, name, None)
    if not isinstance(found, int | float) or isinstance(found, bool):
        raise SceneError([f"{label}: the scene has no number at this path"])
    return float(found)


def _weights(offsets: np.ndarray) -> np.ndarray:
    """Return weights (k,) of values at offsets from a point, less the value there, in its derivative."""
    found = []
    for k, x in enumerate(offsets):
        others = np.delete(offsets, k)
        found.append(np.prod(others / (others - x)) / x)
    return np.array(found)


def _columns(at: Instant) -> np.ndarray:
    """Return the twists (K, 6 nb, nv) for unit joint rates."""
    columns = np.swapaxes(at.placed.columns[:, :-1], 2, 3)
    return columns.reshape(len(columns), -1, columns.shape[-1])


def _twists(at: Instant) -> np.ndarray:
    placed = at.placed
    return np.concatenate([placed.velocity[:, :-1], placed.spin[:, :-1]], axis=2).reshape(len(at.rate), -1)


def _geared(equations: TreeEquations, at: Instant) -> np.ndarray:
    """Return the rates (K, g) of the coordinates with armatures."""
    return apply(at.coordinates.jacobian[:, equations.loads.geared], at.rate)


def _poses(equations: TreeEquations, at: Instant) -> tuple[np.ndarray, np.ndarray]:
    """Return positions (nb, 3) and unit quaternions (nb, 4)."""
    given = unit(equations.arithmetic.array([body.orientation for body in equations.scene.body]))
    return at.placed.position[0, :-1], product(at.placed.turn[0, :-1], given)


def _turned(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return twice the vector part (nb, 3) of the small rotations from quaternions to others."""
    return 2 * product(second, first * CONJUGATE)[:, 1:]
