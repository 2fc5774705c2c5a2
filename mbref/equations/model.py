"""Model: a scene as arrays, and its equations M, g, Φ, Φ_q, ν, γ at (t, q, v).

Each body is described in its principal frame at the centre of mass, so that M is diagonal; frames are
turned back where trajectories are written.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mbref import rotations
from mbref.equations.coordinates import displace_all
from mbref.equations.evaluation import evaluate_along
from mbref.equations.loads import has_angles
from mbref.equations.packing import packed_drivers, packed_loads, packed_primitives
from mbref.equations.random_states import RandomStates
from mbref.equations.units import body_lengths, metric_root
from mbref.kernels.layout import Counts, Equations, Frames, Settings, System
from mbref.kernels.lent_memory import copied, fill, lent, shapes_of, take_back
from mbref.kernels.named_memory import allocate
from mbref.kernels.records import record
from mbref.kernels.scene_layout import Bodies, SceneData
from mbref.scene import (
    GROUND,
    Body,
    Fixed,
    Joint,
    Scene,
)

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
    """A scene packed once; ``bodies`` are those of the scene, then the ground if it is modelled.

    ``entry_columns`` (m, 12) says the column of every entry of the blocks; those of the fixed frame are ≥ n.
    A scene without all masses is ``kinematic``: M is the identity and there are no forces.
    """

    def __init__(self, scene: Scene):
        self.scene = scene
        self.bodies, self.joints = _with_ground(scene)
        self.nb = len(self.bodies)
        self.n = 6 * self.nb
        self.kinematic = not scene.has_mass()
        self._index = {body.name: b for b, body in enumerate(self.bodies)}
        self._index.setdefault(GROUND, self.nb)
        self._index[FRAME] = self.nb
        bodies = self._pack_bodies()
        lengths = body_lengths(self.bodies, self.joints)
        self.structure, primitives = packed_primitives(self)
        self.m, self.row_joint = len(self.structure.row_joint), self.structure.row_joint
        self.entry_columns = self.structure.entry_columns
        self.data = SceneData(
            gravity=np.array(self._gravity()),
            lengths=lengths,
            metric_root=metric_root(self.mass, lengths),
            bodies=bodies,
            primitives=primitives,
            moving=np.arange(primitives.kind.size),
            resting=np.zeros(0, dtype=np.int64),
            row_bodies=self.structure.row_bodies,
            drivers=packed_drivers(scene.driver),
            loads=packed_loads(self),
        )
        self._lend_memory()

    def _lend_memory(self) -> None:
        """Have memory of evaluations with the numbers of this scene."""
        self._own = lent((Equations, *self.sizes.values(), shapes_of(self.data)), self.equations)
        self.put_numbers(self._own.values, self.data)

    def give_back(self) -> None:
        """Leave the memory of evaluations to the next model; this one evaluates no more."""
        take_back(self._own)
        del self._own

    @property
    def sizes(self) -> dict[str, int]:
        """Sizes of the model's memory (see ``kernels.layout``)."""
        angles = max(1, int(np.count_nonzero(self.data.loads.angle >= 0)))
        return {"nb": self.nb, "n": self.n, "m": self.m, "angles": angles, "dense_rows": 0, "width": 12}

    def equations(
        self, sizes: Mapping[str, int] | None = None, data: SceneData | None = None, **system: Any
    ) -> Equations:
        """Fresh memory of an evaluation, with a copy of the scene's data or of others.

        ``system`` names fields of its System that are given.
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
        """Have memory of evaluations hold the data of a scene and the masses of this model."""
        fill(equations.scene, data)
        equations.system.mass[:] = self.mass
        equations.system.inverse_root[:] = 1 / np.sqrt(np.where(self.mass > 0, self.mass, 1.0))

    @property
    def has_angles(self) -> bool:
        """Whether a torsion spring unwraps its angle."""
        return bool(has_angles(self.data.loads))

    def start(self) -> np.ndarray:
        """Coordinates (7 nb,) of the scene's poses, principal frames."""
        position = np.array([body.position for body in self.bodies])
        return np.concatenate([position, self.orientation], axis=1).ravel()

    def terms(self, t: float, q: np.ndarray, v: np.ndarray) -> Terms:
        """The terms at time t (s), coordinates q (7 nb,), velocities v (6 nb,)."""
        found = self.blocks(t, q, v)
        return replace(found, jacobian=self.dense(found.jacobian))

    def dense(self, blocks: np.ndarray) -> np.ndarray:
        """Φ_q (…, m, n) from its blocks (…, m, 12)."""
        matrix, rows = np.zeros((*blocks.shape[:-1], self.nb + 1, 6)), self.structure.rows
        for side in range(2):
            matrix[..., rows, self.structure.row_bodies[:, side], :] = blocks[..., 6 * side : 6 * side + 6]
        return matrix[..., : self.nb, :].reshape(*blocks.shape[:-1], self.n)

    def along(self, times: np.ndarray, q: np.ndarray, v: np.ndarray) -> Terms:
        """The terms at k states, with the blocks (k, m, 12) in place of Jacobians; mass (n,) is that of all.

        From times (k,) in s, q (k, 7 nb) and v (k, n).
        """
        count = len(times)
        blocks, rows = np.empty((count, 12 * self.m)), np.empty((count, 3 * self.m))
        forces = np.empty((count, self.n))
        evaluate_along(times, q, v, blocks, rows, forces, self._own.packed.argument)
        phi, nu, gamma = (rows[:, k * self.m : (k + 1) * self.m] for k in range(3))
        return Terms(self.mass, blocks.reshape(count, self.m, 12), phi, nu, gamma, forces)

    def sparse(self, blocks: np.ndarray) -> csr_array:
        """Φ_q (m, n) from its blocks (m, 12), without zeros."""
        from scipy.sparse import csr_array

        columns = self.entry_columns
        row, entry = np.nonzero((blocks != 0) & (columns < self.n))
        return csr_array((blocks[row, entry], (row, columns[row, entry])), shape=(self.m, self.n))

    def blocks(self, t: float, q: np.ndarray, v: np.ndarray) -> Terms:
        """The terms with the blocks (m, 12) of both bodies' columns in place of the Jacobian."""
        at = np.ascontiguousarray(q).reshape(1, -1), np.ascontiguousarray(v).reshape(1, -1)
        found = self.along(np.array([float(t)]), *at)
        return Terms(self.mass, found.jacobian[0], found.phi[0], found.nu[0], found.gamma[0], found.force[0])

    def blocks_along(self, times: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Blocks (k, m, 12) of Φ_q at coordinates q (k, nb, 7) at times (k,) in s."""
        return self.along(times, q.reshape(len(q), 7 * self.nb), np.zeros((len(q), self.n))).jacobian

    def at(self, q: np.ndarray, states: RandomStates) -> Terms:
        """``along`` at states about coordinates q (7 nb,), of times that are parts of the duration."""
        moved = all_displaced(q, states.displacement)
        return self.along(states.part * self.scene.duration, moved, states.velocity)

    @cached_property
    def length(self) -> float:
        """The largest distance between two of the scene's centres of mass and joint anchors at t = 0 (m)."""
        points = [body.position for body in self.scene.body]
        for joint in self.scene.joint:
            points += getattr(joint, "anchors", None) or [joint.anchor]
        array = np.array(points)
        apart = array[:, None] - array
        return float(np.sqrt((apart * apart).sum(axis=-1).max())) or 1.0

    @property
    def closed_loops(self) -> int:
        """Independent loops of bodies and joints; without one, no position is singular."""
        part, loops = list(range(self.nb + 1)), 0
        for joint in self.joints:
            first, second = (part[self.index(name)] for name in joint.bodies)
            loops += first == second
            part = [first if p == second else p for p in part]
        return loops

    def index(self, name: str) -> int:
        """Index of a body, ``nb`` for the fixed frame."""
        return self._index[name]

    def anchors(self, q: np.ndarray) -> np.ndarray:
        """World positions (k, j, 3) of the joints' anchors on their second bodies at q (k, nb, 7)."""
        second = np.array([self._index[joint.bodies[1]] for joint in self.scene.joint], dtype=int)
        given = np.array([joint.anchor_pair[1] for joint in self.scene.joint], dtype=float).reshape(-1, 3)
        frame = np.broadcast_to([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (len(q), 1, 7))
        pose = np.concatenate([q, frame], axis=1)[:, second]
        return pose[..., :3] + rotations.rotate(pose[..., 3:], self.points(second, given))

    def motion(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> dict[str, np.ndarray]:
        """Poses, velocities and accelerations of the scene's bodies as a Trajectory names them.

        From q (k, nb, 7), v and a (k, nb, 6) of the principal frames to the bodies' own, world axes.
        """
        own, p = slice(0, len(self.scene.body)), q[..., 3:]
        turned = rotations.multiply(p, rotations.conjugate(self.principal)) if self._turns_frames else p
        to_world = rotations.to_matrix(p)
        spin, spin_rate = (np.einsum("...ij,...j->...i", to_world, rates[..., 3:]) for rates in (v, a))
        return {
            "position": q[:, own, :3],
            "orientation": turned[:, own],
            "velocity": v[:, own, :3],
            "angular_velocity": spin[:, own],
            "acceleration": a[:, own, :3],
            "angular_acceleration": spin_rate[:, own],
        }

    def _pack_bodies(self) -> Bodies:
        principal = [_principal_axes(body) for body in self.bodies]
        given = np.array([body.orientation for body in self.bodies])
        self._turns_frames = any(axes is not None for _, axes in principal)
        self.principal = _quaternions([axes for _, axes in principal])
        self.orientation = rotations.multiply(given, self.principal) if self._turns_frames else given
        mass = np.array([1.0 if self.kinematic else body.mass or 1.0 for body in self.bodies])
        inertia = np.ones((self.nb, 3)) if self.kinematic else np.array([moments for moments, _ in principal])
        self.mass = np.concatenate([np.repeat(mass[:, None], 3, axis=1), inertia], axis=1).ravel()
        to_local = rotations.to_matrix(self.orientation).transpose(0, 2, 1)
        self._to_local = np.concatenate([to_local, np.eye(3)[None]])  # the fixed frame is the last
        self._centres = np.array([*(body.position for body in self.bodies), (0.0, 0.0, 0.0)])
        return Bodies(mass, inertia)

    def direction(self, name: str, vector: Sequence[float]) -> np.ndarray:
        """A world vector (3,) at t = 0 in the principal frame of a body."""
        return self.directions(np.array([self._index[name]]), np.array([vector], dtype=float))[0]

    def point(self, name: str, point: Sequence[float]) -> np.ndarray:
        """A world point (3,) at t = 0 in the principal frame of a body, from its centre of mass."""
        return self.points(np.array([self._index[name]]), np.array([point], dtype=float))[0]

    def directions(self, bodies: np.ndarray, vectors: np.ndarray) -> np.ndarray:
        """World vectors (k, 3) at t = 0, each in the principal frame of a body of index (k,)."""
        return (self._to_local[bodies] @ vectors[:, :, None])[:, :, 0]

    def points(self, bodies: np.ndarray, points: np.ndarray) -> np.ndarray:
        """World points (k, 3) at t = 0, each in the principal frame of a body of index (k,)."""
        return self.directions(bodies, points - self._centres[bodies])

    def _gravity(self) -> tuple[float, ...]:
        return (0.0, 0.0, 0.0) if self.kinematic else self.scene.gravity


def displaced(q: np.ndarray, x: np.ndarray) -> np.ndarray:
    """q ⊕ x: coordinates (7 nb,) moved by (δr, δπ') per body (6 nb,), see ``coordinates.displace``."""
    return all_displaced(q, x.reshape(1, -1))[0]


def all_displaced(q: np.ndarray, x: np.ndarray) -> np.ndarray:
    """q ⊕ x (k, 7 nb) for each of x (k, 6 nb)."""
    moved = np.empty((len(x), q.size))
    moved[:] = q
    displace_all(moved, np.ascontiguousarray(x, dtype=float), np.zeros(q.size))
    return moved


def displacement(q: np.ndarray, target: np.ndarray) -> np.ndarray:
    """The small (δr, δπ') per body (6 nb,) that displaces coordinates (7 nb,) to others, to first order."""
    here, there = q.reshape(-1, 7), target.reshape(-1, 7)
    turn = 2.0 * rotations.multiply(rotations.conjugate(here[:, 3:]), there[:, 3:])
    return np.concatenate([there[:, :3] - here[:, :3], np.sign(turn[:, :1]) * turn[:, 1:]], axis=1).ravel()


def _with_ground(scene: Scene) -> tuple[tuple[Body, ...], tuple[Joint, ...]]:
    """Bodies and joints, the ground a body held by six rows where the scene asks for it."""
    if scene.ground == "frame":
        return scene.body, scene.joint
    inertia = (1.0, 1.0, 1.0) if scene.has_mass() else None
    body = Body(name=GROUND, position=(0.0, 0.0, 0.0), mass=1.0 if inertia else None, inertia=inertia)
    hold = Fixed.model_construct(name=GROUND, bodies=(FRAME, GROUND), anchor=(0.0, 0.0, 0.0), type="fixed")
    return (*scene.body, body), (*scene.joint, hold)


FRAME = "the fixed frame"  # holds a modelled ground


def _quaternions(axes: Sequence[np.ndarray | None]) -> np.ndarray:
    """Quaternions (k, 4) of rotation matrices, of which None stands for no rotation."""
    if all(each is None for each in axes):
        return np.tile([1.0, 0.0, 0.0, 0.0], (len(axes), 1))
    return rotations.from_matrix(np.array([np.eye(3) if each is None else each for each in axes]))


def _principal_axes(body: Body) -> tuple[Sequence[float], np.ndarray | None]:
    """Principal moments, and the rotation from the principal frame to the body's; None for the same frame."""
    if body.inertia is None:
        return (1.0, 1.0, 1.0), None
    if not isinstance(body.inertia[0], tuple):
        return body.inertia, None
    inertia = np.array(body.inertia)
    moments, axes = np.linalg.eigh(inertia)
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return np.maximum(moments, 0.0), axes
