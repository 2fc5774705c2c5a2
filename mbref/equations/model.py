"""Model: a scene as arrays, and its equations M, g, Φ, Φ_q, ν, γ at (t, q, v).

Each body is described in its principal frame at the centre of mass, so that M is diagonal. Trajectories are
converted to the bodies' own frames.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbref import rotations
from mbref.equations.coordinates import displace_all
from mbref.equations.evaluation import evaluate_along
from mbref.equations.packing import Packs, row_of
from mbref.equations.random_states import RandomStates
from mbref.kernels.layout import Counts, Equations, Frames, Settings, System
from mbref.kernels.memory_pool import Pooled, acquire, copied, release
from mbref.kernels.named_memory import allocate
from mbref.kernels.records import record
from mbref.kernels.scene_layout import SceneData
from mbref.scene import Scene

if TYPE_CHECKING:
    from scipy.sparse import csr_array


@dataclass(frozen=True)
class Terms:
    """The terms of Eqs. 1-4 at one state: n = 6 nb velocities, m rows."""

    mass: np.ndarray  # (n,) diagonal of M; 1 where the scene has no masses
    jacobian: np.ndarray  # (m, n) Φ_q
    phi: np.ndarray  # (m,) Φ, in metres or radians
    nu: np.ndarray  # (m,) right-hand side of Φ_q q' = ν
    gamma: np.ndarray  # (m,) right-hand side of Φ_q q'' = γ
    force: np.ndarray  # (n,) g


class Model:
    """A scene as arrays, with its equations; ``bodies`` lists the bodies of the scene, then the ground if it
    is modelled.

    ``entry_columns`` (m, 12) has the columns of the blocks' entries; columns of the fixed frame are ≥ n.
    A scene without all masses is ``kinematic``: M is the identity and there are no forces.
    """

    def __init__(self, scene: Scene, packs: Packs | None = None, place: int = 0):
        """Store a scene, or the scene with an index among several that are packed."""
        packs = packs or Packs([scene])
        self.scene, self._packs, self._place = scene, packs, place
        self.bodies, self.joints = packs.listed[place], packs.joints[place]
        self.nb, self.n, self.kinematic = packs.nb, 6 * packs.nb, packs.kinematic
        self.structure, self.data = packs.structure, row_of(packs.data, place)
        self.m, self.row_joint = len(self.structure.row_joint), self.structure.row_joint
        self.entry_columns = self.structure.entry_columns
        self.mass, self.principal = packs.mass[place], packs.principal[place]
        self.length, self.orientation = float(packs.length[place]), packs.orientation[place]
        self._pooled: Pooled | None = None

    @property
    def memory(self) -> Pooled:
        """Memory of evaluations with the numbers of this scene, acquired at first access."""
        if self._pooled is None:
            self._pooled = acquire((Equations, self.structure), self.equations)
            self.put_numbers(self._pooled.values, self.data)
        return self._pooled

    def release(self) -> None:
        """Release the memory of evaluations."""
        if self._pooled is not None:
            release(self._pooled)
            self._pooled = None

    @property
    def sizes(self) -> dict[str, int]:
        """Sizes of the model's memory (see ``kernels.layout``)."""
        return self.structure.sizes

    def equations(
        self, sizes: Mapping[str, int] | None = None, data: SceneData | None = None, **system: Any
    ) -> Equations:
        """Return new memory for evaluations, with a copy of the scene's data or of other data.

        ``system`` contains given fields of its System.
        """
        sizes, data = sizes or self.sizes, data or self.data
        defaults = {
            "settings": record(Settings()),
            "counts": record(Counts()),
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

    @property
    def has_angles(self) -> bool:
        """True if a load about a joint's axis or a coupling unwraps its angle."""
        return self.structure.has_angles

    def start(self) -> np.ndarray:
        """Coordinates (7 nb,) of the scene's poses, for principal frames."""
        return self._packs.start()[self._place]

    def terms(self, t: float, q: np.ndarray, v: np.ndarray) -> Terms:
        """Return the terms at time t (s), coordinates q (7 nb,), velocities v (6 nb,)."""
        found = self.blocks(t, q, v)
        return replace(found, jacobian=self.dense(found.jacobian))

    def dense(self, blocks: np.ndarray) -> np.ndarray:
        """Return Φ_q (…, m, n) from its blocks (…, m, 12)."""
        matrix, rows = np.zeros((*blocks.shape[:-1], self.nb + 1, 6)), self.structure.rows
        for side in range(self.structure.sides):
            matrix[..., rows, self.structure.row_bodies[:, side], :] = blocks[..., 6 * side : 6 * side + 6]
        return matrix[..., : self.nb, :].reshape(*blocks.shape[:-1], self.n)

    def along(self, times: np.ndarray, q: np.ndarray, v: np.ndarray) -> Terms:
        """Return the terms at k states, with the blocks (k, m, 12) instead of Jacobians; mass (n,) is
        constant.

        Arguments are times (k,) in s, q (k, 7 nb) and v (k, n).
        """
        count = len(times)
        blocks, rows = np.empty((count, self.entry_columns.size)), np.empty((count, 3 * self.m))
        forces = np.empty((count, self.n))
        evaluate_along(times, q, v, blocks, rows, forces, self.memory.packed.argument)
        phi, nu, gamma = (rows[:, k * self.m : (k + 1) * self.m] for k in range(3))
        return Terms(self.mass, blocks.reshape(count, *self.entry_columns.shape), phi, nu, gamma, forces)

    def sparse(self, blocks: np.ndarray) -> csr_array:
        """Return Φ_q (m, n) from its blocks (m, 12), as a sparse matrix."""
        from scipy.sparse import csr_array

        columns = self.entry_columns
        row, entry = np.nonzero((blocks != 0) & (columns < self.n))
        return csr_array((blocks[row, entry], (row, columns[row, entry])), shape=(self.m, self.n))

    def blocks(self, t: float, q: np.ndarray, v: np.ndarray) -> Terms:
        """Return the terms with the blocks (m, 12) of both bodies' columns in place of the Jacobian."""
        at = np.ascontiguousarray(q).reshape(1, -1), np.ascontiguousarray(v).reshape(1, -1)
        found = self.along(np.array([float(t)]), *at)
        return Terms(self.mass, found.jacobian[0], found.phi[0], found.nu[0], found.gamma[0], found.force[0])

    def blocks_along(self, times: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Return blocks (k, m, 12) of Φ_q at coordinates q (k, nb, 7) at times (k,) in s."""
        return self.along(times, q.reshape(len(q), 7 * self.nb), np.zeros((len(q), self.n))).jacobian

    def at(self, q: np.ndarray, states: RandomStates) -> Terms:
        """Return ``along`` at states displaced from q (7 nb,); times are fractions of the duration."""
        moved = all_displaced(q, states.displacement)
        return self.along(states.part * self.scene.duration, moved, states.velocity)

    @property
    def closed_loops(self) -> int:
        """Number of independent loops of bodies and joints; without a loop no position is singular."""
        return self.structure.closed_loops

    def index(self, name: str) -> int:
        """Return the index of a body, ``nb`` for the fixed frame."""
        return self._packs.index[name]

    @property
    def to_local(self) -> np.ndarray:
        """Rotations (nb + 1, 3, 3) from the world at t = 0 to the principal frames of the bodies."""
        return self._packs.to_local[self._place]

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
