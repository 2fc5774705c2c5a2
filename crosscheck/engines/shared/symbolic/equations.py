"""Equations of motion in joint coordinates, in any arithmetic: numbers, or symbols of a code generator.

The mechanism is a spanning tree of slides and turns (`crosscheck.engines.shared.spanning_tree`) whose loops
are closed by points:

    M q̈ + Gᵀ λ = f,    G q̈ = γ - 2 β G q' - β² Φ

with accelerations from the Schur complement G M⁻¹ Gᵀ. Rows of G that always vanish (in a planar mechanism)
are left out. Entries that are always zero need no operations, since the arithmetic drops products with zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from crosscheck.engines.shared.initial_velocities import RANK_TOLERANCE, initial_rates
from crosscheck.engines.shared.planar_scene import planar_scene
from crosscheck.engines.shared.spanning_tree import GROUND_LINK, SLIDE, TURN, spanning_tree
from crosscheck.engines.shared.symbolic.frames import Frame, cross, moved_by, velocity_of
from crosscheck.engines.shared.symbolic.symbols import NOTHING, NUMBERS, Arithmetic
from crosscheck.engines.shared.tree_reactions import LinkMotion, wrench
from mbref.scene import Moment, Scene

Entries: TypeAlias = Sequence[Any] | np.ndarray  # numbers or symbols
SEED = 1  # random seed of the pose at which vanishing rows are found


class TreeEquations:
    """Equations of a scene; the constructor raises ValueError with a reason if they cannot be derived."""

    def __init__(self, scene: Scene):
        self.scene = planar_scene(scene)
        self.has_own_joints = self.scene is scene
        self.tree = spanning_tree(self.scene)
        kinds = {mobility.kind for link in self.tree.links for mobility in link.mobilities}
        if kinds - {SLIDE, TURN} or any(closure.kind != "point" for closure in self.tree.closures):
            raise ValueError("its tree has free or ball joints, or loops that points do not close")
        if scene.driver or any(not isinstance(load, Moment) for load in scene.load):
            raise ValueError("it has drivers, or loads other than moments")
        self.n = self.tree.nv
        self.start = np.concatenate((np.zeros(self.n), initial_rates(self.scene, self.tree)))
        self.rows = self._rows_that_matter()
        if not self.n or self._rank() < len(self.rows):
            raise ValueError("nothing moves" if not self.n else "its closures depend on each other")

    def accelerations(self, q: Entries, v: Entries, arithmetic: Arithmetic, beta: float) -> Any:
        """Return q̈ (n,) for coordinates and rates (n,); ``beta`` (1/s) is the decay rate of the closure
        errors, a double root."""
        frames = self.frames(q, v, arithmetic)
        mass, force = self._inertia(frames)
        violation, jacobian, bias = self._closures(frames)
        if not self.rows:
            return solved(mass, force)
        rate = jacobian @ np.array(v, dtype=object)
        gamma = -bias - (2 * beta) * rate - beta**2 * violation if beta else -bias
        columns = np.column_stack([solved(mass, column) for column in (force, *jacobian)])
        free, along = columns[:, 0], columns[:, 1:]
        return free + along @ solved(jacobian @ along, gamma - jacobian @ free)

    def settled(self, q: Entries, v: Entries, arithmetic: Arithmetic) -> tuple[Any, Any]:
        """Return coordinates and rates after one mass-orthogonal Newton step onto the closures."""
        q, v = np.array(q, dtype=object), np.array(v, dtype=object)
        frames = self.frames(q, v, arithmetic)
        mass, _ = self._inertia(frames)
        violation, jacobian, _ = self._closures(frames)
        if not self.rows:
            return q, v
        along = np.column_stack([solved(mass, row) for row in jacobian])
        schur = jacobian @ along
        return q - along @ solved(schur, violation), v - along @ solved(schur, jacobian @ v)

    def frames(self, q: Entries, v: Entries, arithmetic: Arithmetic) -> list[Frame]:
        """Return the moving frames of the links, with their origins at ``position``."""
        zero = np.zeros(3, dtype=object)
        ground = Frame(np.zeros(3), zero, np.eye(3).astype(object), zero, zero, zero, zero)
        anchored: list[Frame] = []  # frames whose origin is the anchor of the link's joint
        for link, first in zip(self.tree.links, self.tree.starts, strict=True):
            parent = ground if link.parent == GROUND_LINK else anchored[link.parent]
            frame = parent.moved(parent.arm(link.anchor), link.anchor)
            for i, mobility in enumerate(link.mobilities, first):
                frame = moved_by(frame, mobility.kind, mobility.axis, i, (q[i], v[i]), arithmetic)
            anchored.append(frame)
        pairs = zip(self.tree.links, anchored, strict=True)
        return [frame.moved(frame.arm(link.position), link.position) for link, frame in pairs]

    def _inertia(self, frames: Sequence[Frame]) -> tuple[np.ndarray, np.ndarray]:
        """Return M (n, n) and f (n,) with gravity and moments."""
        mass, force = _zeros(self.n, self.n), _zeros(self.n)
        gravity = np.array(self.scene.gravity, dtype=float)
        for k, (link, at_link) in enumerate(zip(self.tree.links, frames, strict=True)):
            frame = at_link.moved(at_link.arm(link.position + link.offset), link.position + link.offset)
            turned = frame.rotation.T
            spin, spin_rate = turned @ frame.spin, turned @ frame.spin_rate
            moment = turned @ self._moment(k) - link.inertia @ spin_rate - cross(spin, link.inertia @ spin)
            push = link.mass * (gravity - frame.acceleration)
            columns = []
            for column in frame.columns:
                i, turns, axis, _ = column
                spun = turned @ axis if turns else np.zeros(3)
                columns.append((i, velocity_of(frame, column, frame.origin), spun))
            for i, linear, angular in columns:
                force[i] += linear @ push + angular @ moment
                for j, other, spun in columns:
                    mass[i, j] += link.mass * (linear @ other) + angular @ (link.inertia @ spun)
        return mass, force

    def _closures(self, frames: Sequence[Frame]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return Φ (m,), G (m, n) and the accelerations (m,) of the closures for q̈ = 0, for rows that do not
        vanish."""
        violations, jacobians, biases = [_zeros(0)], [_zeros(0, self.n)], [_zeros(0)]
        for closure in self.tree.closures:
            ends = []
            for k in closure.links:
                if k != GROUND_LINK:
                    ends.append(frames[k].moved(frames[k].arm(closure.anchor), closure.anchor))
            jacobian = _zeros(3, self.n)
            for end, sign in zip(ends, (1.0, -1.0), strict=False):
                for column in end.columns:
                    jacobian[:, column[0]] += sign * velocity_of(end, column, end.origin)
            one = ends[1] if len(ends) > 1 else None
            violations.append(ends[0].origin - (closure.anchor if one is None else one.origin))
            biases.append(ends[0].acceleration - (0.0 if one is None else one.acceleration))
            jacobians.append(jacobian)
        found = (np.concatenate(parts) for parts in (violations, jacobians, biases))
        violation, jacobian, bias = (part[self.rows] for part in found)
        return violation, jacobian, bias

    def _rows_that_matter(self) -> list[int]:
        self.rows = list(range(3 * len(self.tree.closures)))
        pose = np.random.default_rng(SEED).uniform(-1, 1, self.n)
        _, jacobian, _ = self._closures(self.frames(pose, np.zeros(self.n), NUMBERS))
        return [i for i in self.rows if np.abs(jacobian[i].astype(float)).max() > NOTHING]

    def _moment(self, k: int) -> np.ndarray:
        moments = [load for load in self.scene.load if isinstance(load, Moment)]
        own = [load for load in moments if self.tree.own[self.scene.body_index(load.body)] == k]
        return sum((np.array(load.moment, dtype=float) for load in own), np.zeros(3))

    def _rank(self) -> int:
        """Return the rank of the closures' Jacobian at the start."""
        _, jacobian, _ = self._closures(self.frames(np.zeros(self.n), np.zeros(self.n), NUMBERS))
        return int(np.linalg.matrix_rank(jacobian.astype(float), rtol=RANK_TOLERANCE))

    def link_motion(self, y: np.ndarray) -> tuple[LinkMotion, list[np.ndarray]]:
        """Return the motion of the links at a state (2 n,), and for each closure the wrench (6,) on its
        second link."""
        q, v = y[: self.n], y[self.n :]
        frames = self.frames(q, v, NUMBERS)
        change, forces = self._solved(frames)
        along, about = zip(*(_changes(frame, change) for frame in frames), strict=True)
        of = {
            name: np.array([getattr(frame, name) for frame in frames], dtype=float)
            for name in ("rotation", "origin", "velocity", "spin")
        }
        motion = LinkMotion(
            of["rotation"], of["origin"], of["velocity"], of["spin"], q, v, np.array(along), np.array(about)
        )
        return motion, self._closing(frames, forces)

    def _solved(self, frames: Sequence[Frame]) -> tuple[np.ndarray, np.ndarray]:
        """Return q̈ (n,) and the forces (closures, 3) of the closures, by least squares if the equations of
        the closures are singular."""
        mass, force = (part.astype(float) for part in self._inertia(frames))
        _, jacobian, bias = (part.astype(float) for part in self._closures(frames))
        free, along = np.linalg.solve(mass, force), np.linalg.solve(mass, jacobian.T)
        found = np.linalg.lstsq(jacobian @ along, -bias - jacobian @ free, rcond=RANK_TOLERANCE)[0]
        forces = np.zeros(3 * len(self.tree.closures))
        forces[self.rows] = found
        return free + along @ found, forces.reshape(-1, 3)

    def _closing(self, frames: Sequence[Frame], forces: np.ndarray) -> list[np.ndarray]:
        found = []
        for closure, force in zip(self.tree.closures, forces, strict=True):
            first, second = closure.links
            own = frames[second if first == GROUND_LINK else first]
            place = np.array(own.origin + own.arm(closure.anchor), dtype=float)
            found.append(wrench(force if first == GROUND_LINK else -force, place))
        return found


def _changes(frame: Frame, change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the linear and angular acceleration (3,) of a link at the joint accelerations."""
    along, about = frame.acceleration, frame.spin_rate
    for column in frame.columns:
        place, turns, axis, _ = column
        along = along + velocity_of(frame, column, frame.origin) * change[place]
        about = about + axis * change[place] if turns else about
    return np.array(along, dtype=float), np.array(about, dtype=float)


def _zeros(*shape: int) -> np.ndarray:
    return np.zeros(shape, dtype=object)


def solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return the solution (n,) of a symmetric positive definite system by L D Lᵀ without pivoting."""
    n = len(right)
    lower, d, x = _zeros(n, n), _zeros(n), np.array(right, dtype=object)
    for j in range(n):
        d[j] = matrix[j, j] - sum((lower[j, k] * lower[j, k] * d[k] for k in range(j)), 0.0)
        for i in range(j + 1, n):
            lower[i, j] = (matrix[i, j] - sum((lower[i, k] * lower[j, k] * d[k] for k in range(j)), 0.0)) / d[
                j
            ]
    for i in range(n):
        x[i] = x[i] - sum((lower[i, k] * x[k] for k in range(i)), 0.0)
    x = x / d
    for i in reversed(range(n)):
        x[i] = x[i] - sum((lower[k, i] * x[k] for k in range(i + 1, n)), 0.0)
    return x
