"""Model: a scene as arrays, and its equations M, g, Φ, Φ_q, ν, γ at (t, q, v).

Each body is described in its principal frame at the centre of mass, so that M is diagonal. Trajectories are
converted to the bodies' own frames.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from mbref import rotations
from mbref.equations.coordinates import displace_all
from mbref.equations.evaluation import evaluate_along
from mbref.equations.packed_scenes import packs_of
from mbref.equations.packing import Packs, row_of
from mbref.equations.structure import Structure
from mbref.equations.units import displacement_units
from mbref.kernels.layout import Equations, Frames, OperationCounts, Settings, System
from mbref.kernels.memory_pool import Pooled, acquire, copied, release
from mbref.kernels.named_memory import allocate
from mbref.kernels.records import record
from mbref.kernels.scene_layout import SceneData
from mbref.scene import Scene

Found = TypeVar("Found")


@dataclass(frozen=True)
class Terms:
    """The terms of Eqs. 1-4 at states of any shape (…): n = 6 nb velocities, m rows.

    An index selects states: ``terms[0]``.
    """

    structure: Structure
    mass: np.ndarray  # (n,) diagonal of M; 1 where the scene has no masses
    blocks: np.ndarray  # (…, m, 12) Φ_q in the columns of both bodies of a row
    phi: np.ndarray  # (…, m) Φ, in metres or radians
    nu: np.ndarray  # (…, m) right-hand side of Φ_q q' = ν
    gamma: np.ndarray  # (…, m) right-hand side of Φ_q q'' = γ
    force: np.ndarray  # (…, n) g

    def __getitem__(self, place: Any) -> Terms:
        of_states = self.blocks, self.phi, self.nu, self.gamma, self.force
        return Terms(self.structure, self.mass, *(values[place] for values in of_states))

    def less(self, value: Any) -> Terms:
        """Return the terms of Φ - value (m,)."""
        return Terms(
            self.structure, self.mass, self.blocks, self.phi - value, self.nu, self.gamma, self.force
        )

    @functools.cached_property
    def jacobian(self) -> np.ndarray:
        """Φ_q (…, m, n)."""
        return self.structure.dense(self.blocks)


class Model:
    """A scene as arrays, with its equations; ``bodies`` lists the bodies of the scene, then the ground if it
    is modelled.

    ``entry_columns`` (m, 12) has the columns of the blocks' entries; columns of the fixed frame are ≥ n.
    ``to_local`` (nb + 1, 3, 3) turns world vectors at t = 0 to the principal frames of the bodies.
    ``units`` (n,) has the displacements along (δr, δπ') by one length of the mechanism: m, or 1 rad.
    A scene without all masses is ``kinematic``: M is the identity and there are no forces.
    """

    def __init__(self, scene: Scene, packs: Packs | None = None, place: int = 0):
        """Store a scene, or the scene with an index among several that are packed."""
        packs = packs or packs_of(scene)
        self._found = packs.found.setdefault(place, {})
        self.scene, self._packs, self._place = packs.scenes[place], packs, place
        self.bodies, self.joints = packs.listed[place], packs.joints[place]
        self.nb, self.n, self.kinematic = packs.nb, 6 * packs.nb, packs.kinematic
        self.structure, self.data = packs.structure, self.once(_own_data)
        self.m, self.row_joint = len(self.structure.row_joint), self.structure.row_joint
        self.entry_columns, self.sizes = self.structure.entry_columns, self.structure.sizes
        self.has_angles, self.closed_loops = self.structure.has_angles, self.structure.closed_loops
        self.mass, self.principal = packs.mass[place], packs.principal[place]
        self.length, self.orientation = float(packs.length[place]), packs.orientation[place]
        self.units = displacement_units(self.nb, self.length)
        self.to_local = packs.to_local[place]
        self._pooled: Pooled | None = None

    @property
    def memory(self) -> Pooled:
        """Memory of evaluations with the numbers of this scene, acquired at first access."""
        if self._pooled is None:
            self._pooled = acquire((Equations, self.structure), self.equations)
            self.put_numbers(self._pooled.values, self.data)
        return self._pooled

    def once(self, function: Callable[..., Found], *arguments: Hashable) -> Found:
        """Return the result of a function of this model and of further arguments, which is called once for a
        packed scene.

        The result is never changed, because further runs of the scene read it.
        """
        key = function, *arguments
        if key not in self._found:
            self._found[key] = function(self, *arguments)
        found: Found = self._found[key]
        return found

    def release(self) -> None:
        """Release the memory of evaluations."""
        if self._pooled is not None:
            release(self._pooled)
            self._pooled = None

    def equations(
        self, sizes: Mapping[str, int] | None = None, data: SceneData | None = None, **system: Any
    ) -> Equations:
        """Return new memory for evaluations, with a copy of the scene's data or of other data.

        ``system`` contains given fields of its System.
        """
        sizes, data = sizes or self.sizes, data or self.data
        defaults = {
            "settings": record(Settings()),
            "counts": record(OperationCounts()),
            "options": None,
            "scratch": None,
        }
        frames = allocate(Frames, sizes)
        frames.rotation[:, ::4] = 1.0
        found = allocate(
            Equations, sizes, scene=copied(data), frames=frames,
            system=allocate(System, sizes, **{**defaults, **system}),
        )  # fmt: skip
        self.put_numbers(found, data)
        return found

    def put_numbers(self, equations: Equations, data: SceneData) -> None:
        """Write the numbers of a scene of equal structure, and this model's masses, into memory of
        evaluations."""
        for mine, theirs in zip(equations.scene.numbers, data.numbers, strict=True):
            mine[...] = theirs
        equations.piece[:] = data.functions.first[:-1]
        equations.system.mass[:] = self.mass
        equations.system.inverse_root[:] = self._packs.inverse_root[self._place]

    def start(self) -> np.ndarray:
        """Coordinates (7 nb,) of the scene's poses, for principal frames."""
        return self._packs.start()[self._place]

    def terms(
        self,
        times: float | np.ndarray,
        q: np.ndarray,
        v: np.ndarray | None = None,
        angles: np.ndarray | None = None,
    ) -> Terms:
        """Return the terms at a time (s), coordinates q (7 nb,) and velocities v (6 nb,), by default at rest.

        For k times (k,), with q (k, 7 nb) and v (k, 6 nb), return the terms at k states. Angles of turning
        joints are nearest to ``angles`` (a,) or (k, a), rad; by default they are within half a turn.
        """
        t = np.array(times, dtype=float, ndmin=1)
        q = np.ascontiguousarray(q, dtype=float).reshape(t.size, 7 * self.nb)
        v = np.zeros((t.size, self.n)) if v is None else np.ascontiguousarray(v).reshape(t.size, self.n)
        blocks, m = np.empty((t.size, self.entry_columns.size)), self.m
        rows = np.empty((t.size, 3 * m))
        forces = np.empty((t.size, self.n))
        reference = self.memory.values.angles
        before = reference.copy()
        counted = np.zeros((0, before.size))
        if angles is not None:
            counted = np.ascontiguousarray(angles, dtype=float).reshape(t.size, before.size)
        evaluate_along(t, q, v, counted, blocks, rows, forces, self.memory.packed.argument)
        reference[:] = before
        blocks = blocks.reshape(t.size, *self.entry_columns.shape)
        phi, nu, gamma = rows[:, :m], rows[:, m : 2 * m], rows[:, 2 * m :]
        found = Terms(self.structure, self.mass, blocks, phi, nu, gamma, forces)
        return found if np.ndim(times) else found[0]

    def index(self, name: str) -> int:
        """Return the index of a body, ``nb`` for the fixed frame."""
        return self._packs.index[name]

    def direction(self, name: str, vector: Sequence[float]) -> np.ndarray:
        """Return a world vector (3,) at t = 0 in the principal frame of a body."""
        at = np.array([self.index(name)]), np.array([vector], dtype=float)
        found: np.ndarray = self._packs.directions(*at)[self._place, 0]
        return found

    def point(self, name: str, point: Sequence[float]) -> np.ndarray:
        """Return a world point (3,) at t = 0 in the principal frame of a body, relative to its centre of
        mass."""
        at = np.array([self.index(name)]), np.array([point], dtype=float)
        found: np.ndarray = self._packs.points(*at)[self._place, 0]
        return found

    def anchors(self, q: np.ndarray) -> np.ndarray:
        """Return world positions (k, j, 3) of the joints' anchors on their second bodies at q (k, nb, 7)."""
        second = np.array([self._packs.index[joint.bodies[1]] for joint in self.scene.joint], dtype=int)
        given = np.array([joint.anchor_pair[1] for joint in self.scene.joint], dtype=float).reshape(-1, 3)
        frame = np.broadcast_to([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (len(q), 1, 7))
        pose = np.concatenate([q, frame], axis=1)[:, second]
        own = self._packs.points(second, given)[self._place]
        return pose[..., :3] + rotations.rotate(pose[..., 3:], own)

    def motion(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> dict[str, Any]:
        """Return ``motion_of`` for the scene's bodies."""
        principal = self.principal if self._packs.turns_frames else None
        return motion_of(q, v, a, principal, len(self.scene.body))


def _own_data(model: Model) -> SceneData:
    """Return the arrays of a model's scene among the arrays of all packed scenes."""
    data: SceneData = row_of(model._packs.data, model._place)
    return data


def motion_of(
    q: np.ndarray, v: np.ndarray, a: np.ndarray, principal: np.ndarray | None, count: int
) -> dict[str, Any]:
    """Return poses, velocities and accelerations of the first ``count`` bodies with the names of a
    Trajectory, in world axes.

    Arguments are q (…, nb, 7), v and a (…, nb, 6) of the ``principal`` frames (…, nb, 4); None means the
    bodies' own frames.
    """
    own, p = slice(0, count), q[..., 3:]
    turned = p if principal is None else rotations.multiply(p, rotations.conjugate(principal))
    to_world = rotations.to_matrix(p)
    spin, spin_rate = (np.einsum("...ij,...j->...i", to_world, rates[..., 3:]) for rates in (v, a))
    return {
        "position": q[..., own, :3],
        "orientation": turned[..., own, :],
        "velocity": v[..., own, :3],
        "angular_velocity": spin[..., own, :],
        "acceleration": a[..., own, :3],
        "angular_acceleration": spin_rate[..., own, :],
    }


def poses(model: Model, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
    """Return coordinates (k, 7 nb) of positions (k, b, 3) and orientations (k, b, 4) of the bodies."""
    count, own = position.shape[:2]
    q = np.tile(model.start(), (count, 1)).reshape(count, model.nb, 7)
    q[:, :own, :3] = position
    q[:, :own, 3:] = rotations.multiply(orientation, model.principal[:own])
    return q.reshape(count, 7 * model.nb)


def displaced(q: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return q ⊕ x: coordinates (7 nb,) moved by (δr, δπ') for each body (6 nb,), see
    ``coordinates.displace``."""
    return all_displaced(q, x.reshape(1, -1))[0]


def all_displaced(q: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return q ⊕ x (k, 7 nb) for each of x (k, 6 nb)."""
    moved = np.empty((len(x), q.size))
    moved[:] = q
    displace_all(moved, np.ascontiguousarray(x, dtype=float), np.zeros(q.size))
    return moved


def displacement(q: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Return the small (δr, δπ') for each body (6 nb,) that moves coordinates (7 nb,) to other coordinates,
    to first order."""
    here, there = q.reshape(-1, 7), target.reshape(-1, 7)
    turn = 2.0 * rotations.multiply(rotations.conjugate(here[:, 3:]), there[:, 3:])
    return np.concatenate([there[:, :3] - here[:, :3], np.sign(turn[:, :1]) * turn[:, 1:]], axis=1).ravel()
