"""Equations of motion of a scene on its spanning tree: rates of states, and states that satisfy the joints.

A state contains, in this order, the scalar joint coordinates, the quaternions of the balls, the coordinates
of joints outside the tree that a driver, a load, a coupling or an armature uses, and the joint rates.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import qr

from crosscheck.judge import constraints
from crosscheck.judge.arithmetic import DOUBLE, Arithmetic, doubles
from crosscheck.judge.coupling_laws import law_value
from crosscheck.judge.reference.start_velocities import given, start_velocities
from crosscheck.judge.reference.tree_closures import Closures, Measured, Rows
from crosscheck.judge.reference.tree_joints import Placed, Tree, used_coordinates
from crosscheck.judge.reference.tree_loads import Loads
from crosscheck.judge.reference.vectors import apply, product, saddle_solve, unit
from crosscheck.judge.time_functions import values
from crosscheck.judge.tolerances import RANK
from mbref.scene import Scene, refuse_rolling, refuse_turned
from mbref.scene.joints import ANGLE, DISPLACEMENT

COORDINATES = (ANGLE, DISPLACEMENT)
WORSE = 0.5  # conditioning / best conditioning, below which other rows are selected
CORRECTIONS = 8  # largest number of Newton iterations that close the loops
PREFERENCE = 0.2  # largest relative change of a row's weight
OPEN = 1e-9  # residual, relative to the scene's length, above which dropped rows are independent


@dataclass(frozen=True)
class Instant:
    """Parts of the equations at K states: bodies, joint coordinates (see ``coordinates``), the rows
    of closures and drivers with their rates ``speed`` (K, m), and the joint rates (K, nv)."""

    placed: Placed
    coordinates: Rows
    rows: Rows
    speed: np.ndarray
    rate: np.ndarray


class TreeEquations:
    """Equations for the rates of states; ``kept`` are the independent rows of closures and drivers.

    ``way`` is a seed that selects other rows if rows are redundant, and the displacement of loop-closing
    joints, relative to the scene's length.
    """

    def __init__(self, scene: Scene, arithmetic: Arithmetic, way: tuple[int, float] = (0, 0.0)):
        refuse_rolling(scene, "equations on a spanning tree")
        refuse_turned(scene, "equations on a spanning tree")
        self.scene, self.arithmetic, self.tree = scene, arithmetic, Tree(scene, arithmetic)
        self.closures = Closures(self.tree)
        away = [key for key in sorted(used_coordinates(scene)) if key[1] not in self.tree.coordinate]
        self.measured = Measured(
            self.tree, *([scene.joint_named(name) for kind, name in away if kind == k] for k in COORDINATES)
        )
        places = self.tree.coordinate.items()
        at: dict[tuple[str, str], int] = {(ANGLE, name): found[-1] for name, found in places if found}
        at |= {(DISPLACEMENT, name): found[0] for name, found in places if found}
        at |= {key: self.tree.scalars + k for k, key in enumerate(away)}
        driven = [(str(scene.joint_named(d.joint).facts.driven), d.joint) for d in scene.driver]
        self.driven = np.array([at[key] for key in driven], dtype=int)
        # of couplings, padded with coordinates of law 0 where others sum more coordinates, or higher powers
        ends = [[at[kind, joint.name] for joint, kind in scene.coupled(c)] for c in scene.coupling]
        most = max(map(len, ends), default=2)
        padded = [own + own[:1] * (most - len(own)) for own in ends]
        self.coupled = np.array(padded, dtype=int).reshape(-1, most).T
        powers = max((c.powers for c in scene.coupling), default=1)
        laws = [[*c.laws, *[()] * (most - len(c.laws))] for c in scene.coupling]
        factors = [[(*law, *[0.0] * (powers - len(law))) for law in own] for own in laws]
        self.laws = np.moveaxis(arithmetic.array(factors).reshape(-1, most, powers), 0, 2)
        self.loads = Loads(self.tree, at)
        self.nv = len(self.tree.axis)
        self.ends = np.cumsum([self.tree.scalars, 4 * len(self.tree.balls), len(away), self.nv])
        self.light, self.length = int(self.ends[1]), constraints.scene_length(scene)
        self.kept: np.ndarray | None = None
        self.since = 0.0  # s, from which the pieces of functions of time act
        self._doubles: TreeEquations | None = None
        self._varied(*way)

    def _varied(self, seed: int, displaced: float) -> None:
        """Return the sizes of the joint rates and of the rows of closures and drivers, row weights near one,
        and the displacements of closures."""
        rng, closing = np.random.default_rng(seed), self.closures.sizes(self.length)
        self.rate_sizes = np.where(self.tree.turning, 1.0, self.length)
        sizes = self._coordinate_sizes()
        coupled = (np.abs(doubles(self.laws[:, 0])) * sizes[self.coupled]).max(axis=0)
        self._row_sizes = np.concatenate([closing, sizes[self.driven], coupled])
        self._weights = 1 + (PREFERENCE * rng.random(len(self._row_sizes)) if seed else 0.0)
        self._displaced = self.arithmetic.array(displaced * closing * rng.uniform(-1, 1, len(closing)))

    def _coordinate_sizes(self) -> np.ndarray:
        """Return the size of each joint coordinate and twist: the scene's length for displacements, one for
        angles."""
        away = np.where(self.measured.sizes, self.length, 1.0)
        return np.concatenate([self.rate_sizes[: self.tree.scalars], away])

    def light_rates(self, y: np.ndarray) -> np.ndarray:
        """Return the rates (K, light) of scalars and quaternions; a quaternion's rate is half spin times
        quaternion."""
        scalar, ball, _, rate = self._split(y)
        spin = rate[:, self.tree.scalars :].reshape(len(y), len(self.tree.balls), 3)
        moves = product(np.concatenate([0 * spin[..., :1], spin], axis=-1), ball) / 2
        return np.concatenate([rate[:, : scalar.shape[1]], moves.reshape(len(y), 4 * moves.shape[1])], axis=1)

    def other_rates(self, t: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the rates (K, ·) of angles and joint rates at times t (K,), and the distance (K,) from
        singularity."""
        at = self.at(t, y)
        mass, force = self.loads.terms(at.placed, at.coordinates, at.rate, t, self.since)
        jacobian, drift = at.rows.jacobian[:, self.kept], at.rows.drift[:, self.kept]
        acceleration, distance = saddle_solve(mass, jacobian, force, -1 * drift)
        turning = apply(at.coordinates.jacobian[:, self.tree.scalars :], at.rate)
        return np.concatenate([turning, acceleration], axis=1), distance

    def in_doubles(self) -> TreeEquations:
        """Return the equations, with equal rows, in double precision."""
        if self._doubles is None:
            self._doubles = TreeEquations(self.scene, DOUBLE)
        self._doubles.kept, self._doubles.since = self.kept, self.since
        return self._doubles

    def at(self, t: np.ndarray, y: np.ndarray) -> Instant:
        """Return the parts of the equations at states (K, n) and times (K,)."""
        scalar, ball, angle, rate = self._split(y)
        placed = self.tree.placed(scalar, unit(ball), rate)
        own = scalar[..., None] * 0 + np.eye(self.tree.scalars, self.nv, dtype=int)
        coordinates = Rows(scalar, 0 * scalar, own).joined(self.measured.rows(placed, angle))
        closing = self.closures.rows(placed, self._displaced)
        wanted = self._wanted(t)
        driven = coordinates.among(self.driven)
        driven = Rows(driven.value - wanted[0], driven.drift - wanted[2], driven.jacobian)
        coupled = self._coupled(coordinates, rate)
        speed = [apply(closing.jacobian, rate), apply(driven.jacobian, rate) - wanted[1]]
        speed.append(apply(coupled.jacobian, rate))
        rows = closing.joined(driven).joined(coupled)
        return Instant(placed, coordinates, rows, np.concatenate(speed, axis=1), rate)

    def _coupled(self, coordinates: Rows, rate: np.ndarray) -> Rows:
        """Return the sums of the laws of the couplings' coordinates."""
        found = []
        for law, numbers in zip(self.laws, self.coupled, strict=True):
            row = coordinates.among(numbers)
            value, slope, bend = (law_value(list(law), row.value, n) for n in range(3))
            speed = apply(row.jacobian, rate)
            drift = slope * row.drift + bend * speed * speed
            found.append(Rows(value, drift, slope[..., None] * row.jacobian))
        total = found[0]
        for each in found[1:]:
            total = Rows(total.value + each.value, total.drift + each.drift, total.jacobian + each.jacobian)
        return total

    def start(self) -> np.ndarray:
        """Return the state (n,) at t = 0 with the velocities of the documented rule; raises SceneError if the
        scene's velocities contradict its joints."""
        constraints.initial_twists(self.scene)
        y = self.arithmetic.zeros(int(self.ends[-1]))
        y[self.tree.scalars : self.light : 4] = self.arithmetic.number(1.0)
        now = self.arithmetic.number(0.0)
        y = self.closed(now, y)
        at = self.at(self.arithmetic.zeros(1), y[None])
        rows = at.rows.jacobian[0, self.kept]
        rates, mass = (
            rows @ at.rate[0] - at.speed[0, self.kept],
            self.loads.mass_matrix(at.placed, at.coordinates)[0],
        )
        y[self.ends[2] :] = start_velocities(self.arithmetic, rows, rates, *self._given(at.placed), mass)
        return self.closed(now, y)

    def _given(self, placed: Placed) -> tuple[np.ndarray, np.ndarray]:
        """Return twists (g, nv) for unit joint rates in the components that the scene gives, and their values
        (g,), both weighted."""
        asked, (columns,) = given(self.scene), placed.columns
        weights = self.arithmetic.array(asked.weights)
        twists = np.swapaxes(columns[:-1], 1, 2).reshape(6 * (len(columns) - 1), self.nv)
        return weights[:, None] * twists[asked.components], weights * self.arithmetic.array(asked.values)

    def closed(self, t: Any, y: np.ndarray) -> np.ndarray:
        """Return the state (n,) with closed loops at time t that is nearest in the mass metric."""
        y, t, last = y[None], self.arithmetic.zeros(1) + t, np.inf
        self._choose(self.at(t, y))
        for _ in range(CORRECTIONS):
            better = self.nearer(t, y)
            size = np.abs(doubles(better - y)).max(initial=0.0)
            if not size < last:
                break
            y, last = self.arithmetic.settled(better), size
        return y[0]

    def nearer(self, t: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return states (K, n) after one Newton step towards closed loops and consistent rates."""
        at = self.at(t, y)
        step, _ = self._solve(at, 0 * at.rate, -1 * at.rows.value)
        better = self.displaced(y, step, at.coordinates.jacobian)
        better[:, self.ends[2] :] = at.rate + self._solve(at, 0 * at.rate, -1 * at.speed)[0]
        return better

    def gap(self, t: Any, y: np.ndarray) -> float:
        """Return the largest residual of all rows at a state (n,), relative to the scene's length."""
        at = self.at(self.arithmetic.zeros(1) + t, y[None])
        return float(np.abs(doubles(at.rows.value)).max(initial=0.0)) / self.length

    def undetermined(self) -> str:
        """Return the reason why a scene without masses has no motion; empty if drivers determine it or masses
        are given."""
        missing = [body.name for body in self.scene.body if body.mass is None]
        assert self.kept is not None
        if not missing or len(self.kept) == self.nv:
            return ""
        return f"bodies without mass move freely: {', '.join(missing)}"

    def _split(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return scalars (K, ·), balls (K, ·, 4), angles (K, ·) and joint rates (K, nv) of states."""
        scalar, ball, angle, rate = np.split(y, self.ends[:-1], axis=1)
        return scalar, ball.reshape(len(y), len(self.tree.balls), 4), angle, rate

    def displaced(self, y: np.ndarray, step: np.ndarray, coordinates: np.ndarray) -> np.ndarray:
        """Return the states after a small displacement (K, nv) of the joint coordinates."""
        y = y.copy()
        y[:, self.ends[2] :] = step
        moves = self.light_rates(y)
        y[:, : self.light] = y[:, : self.light] + moves
        ball = unit(self._split(y)[1])
        y[:, self.tree.scalars : self.light] = ball.reshape(len(y), 4 * ball.shape[1])
        angles = slice(self.light, self.ends[2])
        y[:, angles] = y[:, angles] + apply(coordinates[:, self.tree.scalars :], step)
        return y

    def _solve(self, at: Instant, force: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        mass = self.loads.mass_matrix(at.placed, at.coordinates)
        return saddle_solve(mass, at.rows.jacobian[:, self.kept], force, right[:, self.kept])

    def _choose(self, at: Instant) -> None:
        """Select a largest set of independent rows; the first selection is used while it is well enough
        conditioned."""
        rows = doubles(at.rows.jacobian[0])
        if self.kept is None:
            self.rank = self._rank(rows)
        rows = rows * self.rate_sizes / self._row_sizes[:, None]
        _, order = qr(rows.T * self._weights, mode="r", pivoting=True)
        best = np.sort(order[: self.rank])
        if self.kept is None or _least(rows[self.kept]) < WORSE * _least(rows[best]):
            self.kept = best

    def _rank(self, rows: np.ndarray) -> int:
        """Return the number of independent rows (m, nv)."""
        size = np.linalg.norm(rows, axis=1, keepdims=True)
        # largest motion of a body for a unit joint rate
        largest = max(size.max(initial=0.0), min(1.0, self.length**2))
        rows = rows / np.where(size > RANK * largest, size, largest)  # rows of rounding size stay small
        pivots = np.abs(np.diag(qr(rows.T, mode="r", pivoting=True)[0]))
        return int((pivots > RANK).sum())

    def _wanted(self, t: np.ndarray) -> np.ndarray:
        """Return (3, K, drivers) values of the drivers at times (K,), their rates and second rates."""
        found = [
            np.stack([values(driver, t, self.since, n, self.arithmetic) for n in range(3)])
            for driver in self.scene.driver
        ]
        return np.stack(found, axis=-1) if found else self.arithmetic.zeros(3, len(t), 0)


def _least(rows: np.ndarray) -> float:
    """Return the least singular value; infinite without rows."""
    return float(np.linalg.svd(rows, compute_uv=False).min(initial=np.inf))
