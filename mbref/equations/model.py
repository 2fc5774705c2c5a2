"""Model: a scene as arrays, and its equations M, g, Φ, Φ_q, ν, γ at (t, q, v).

Each body is described in its principal frame at the centre of mass, so that M is diagonal; frames are
turned back where trajectories are written.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbref import rotations
from mbref.equations.coordinates import displace
from mbref.equations.evaluation import evaluate_all
from mbref.equations.joints import driver_primitive, primitives_of
from mbref.equations.joints.base import ROWS_OF, Primitive
from mbref.equations.loads import has_angles
from mbref.equations.packing import packed_drivers, packed_loads
from mbref.equations.units import body_lengths, metric_root
from mbref.kernels.layout import Counts, Equations, Frames, Settings, System
from mbref.kernels.named_memory import allocate, packed, record, stacked
from mbref.kernels.scene_layout import (
    Bodies,
    Primitives,
    SceneData,
)
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
        self.data = SceneData(
            gravity=np.array(self._gravity()),
            lengths=lengths,
            metric_root=metric_root(self.mass, lengths),
            bodies=bodies,
            primitives=self._pack_primitives(),
            row_bodies=self._row_bodies,
            drivers=packed_drivers(scene.driver),
            loads=packed_loads(self),
        )
        self._own = packed(self.equations())

    @property
    def sizes(self) -> dict[str, int]:
        """Sizes of the model's memory (see ``kernels.layout``)."""
        angles = max(1, int(np.sum(self.data.loads.angle >= 0)))
        return {"nb": self.nb, "n": self.n, "m": self.m, "angles": angles, "dense_rows": 0, "width": 12}

    def equations(self, sizes: Mapping[str, int] | None = None, **system: Any) -> Equations:
        """Fresh memory of an evaluation; ``system`` names fields of its System that are given."""
        sizes = sizes or self.sizes
        defaults = {
            "mass": self.mass.copy(),
            "inverse_root": 1 / np.sqrt(np.where(self.mass > 0, self.mass, 1.0)),
            "settings": record(Settings()),
            "counts": record(Counts()),
            "options": None,
            "scratch": None,
        }
        frames = allocate(Frames, sizes)
        frames.rotation[:, ::4] = 1.0
        return allocate(
            Equations, sizes, scene=self.data, frames=frames,
            system=allocate(System, sizes, **{**defaults, **system}),
        )  # fmt: skip

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
        """Φ_q (m, n) from its blocks (m, 12)."""
        matrix, rows = np.zeros((self.m, self.nb + 1, 6)), np.arange(self.m)
        for side in range(2):
            matrix[rows, self._row_bodies[:, side]] = blocks[:, 6 * side : 6 * side + 6]
        return matrix[:, : self.nb].reshape(self.m, self.n)

    def sparse(self, blocks: np.ndarray) -> csr_array:
        """Φ_q (m, n) from its blocks (m, 12), without zeros."""
        from scipy.sparse import csr_array

        columns = self.entry_columns()
        row, entry = np.nonzero((blocks != 0) & (columns < self.n))
        return csr_array((blocks[row, entry], (row, columns[row, entry])), shape=(self.m, self.n))

    def blocks(self, t: float, q: np.ndarray, v: np.ndarray) -> Terms:
        """The terms with the blocks (m, 12) of both bodies' columns in place of the Jacobian."""
        own = self._own.values
        evaluate_all(float(t), np.ascontiguousarray(q), np.ascontiguousarray(v), self._own.argument)
        rows = own.rows
        return Terms(
            self.mass, own.system.blocks.copy(), rows.phi.copy(), rows.nu.copy(), rows.gamma.copy(),
            own.system.force.copy(),
        )  # fmt: skip

    def entry_columns(self) -> np.ndarray:
        """Column (m, 12) of every entry of the blocks; those of the fixed frame are ≥ n."""
        return (6 * self._row_bodies[:, :, None] + np.arange(6)).reshape(self.m, 12)

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

    def anchor(self, joint: Joint, q: np.ndarray) -> np.ndarray:
        """World positions (…, 3) of the joint's anchor on its second body at coordinates q (…, nb, 7)."""
        point = joint.anchor_pair[1]
        b = self._index[joint.bodies[1]]
        if b == self.nb:
            return np.broadcast_to(point, (*q.shape[:-2], 3))
        return q[..., b, :3] + rotations.rotate(q[..., b, 3:], self.point(joint.bodies[1], point))

    def motion(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> dict[str, np.ndarray]:
        """Poses, velocities and accelerations of the scene's bodies as a Trajectory names them.

        From q (k, nb, 7), v and a (k, nb, 6) of the principal frames to the bodies' own, world axes.
        """
        own, p = slice(0, len(self.scene.body)), q[..., 3:]
        return {
            "position": q[:, own, :3],
            "orientation": rotations.multiply(p, rotations.conjugate(self.principal))[:, own],
            "velocity": v[:, own, :3],
            "angular_velocity": rotations.rotate(p, v[..., 3:])[:, own],
            "acceleration": a[:, own, :3],
            "angular_acceleration": rotations.rotate(p, a[..., 3:])[:, own],
        }

    def _pack_bodies(self) -> Bodies:
        principal = [_principal_axes(body) for body in self.bodies]
        self.principal = rotations.from_matrix(np.array([axes for _, axes in principal]))
        given = np.array([body.orientation for body in self.bodies])
        self.orientation = rotations.multiply(given, self.principal)
        mass = np.array([1.0 if self.kinematic else body.mass or 1.0 for body in self.bodies])
        inertia = np.array([np.ones(3) if self.kinematic else moments for moments, _ in principal])
        self.mass = np.concatenate([np.repeat(mass[:, None], 3, axis=1), inertia], axis=1).ravel()
        self._to_local = rotations.to_matrix(self.orientation).transpose(0, 2, 1)
        return Bodies(mass, inertia)

    def direction(self, name: str, vector: Sequence[float]) -> np.ndarray:
        """A world vector (3,) at t = 0 in the principal frame of a body."""
        b = self._index[name]
        return np.asarray(vector, dtype=float) if b == self.nb else self._to_local[b] @ vector

    def point(self, name: str, point: Sequence[float]) -> np.ndarray:
        """A world point (3,) at t = 0 in the principal frame of a body, from its centre of mass."""
        b = self._index[name]
        origin = np.zeros(3) if b == self.nb else np.array(self.bodies[b].position)
        return self.direction(name, np.asarray(point) - origin)

    def _pack_primitives(self) -> Primitives:
        driven = {driver.joint: k for k, driver in enumerate(self.scene.driver)}
        rows, bodies, names = [], [], []
        for joint in self.joints:
            pair = [self._index[name] for name in joint.bodies]
            for primitive in (*primitives_of(joint), *_driver_rows(joint, driven)):
                driver = driven[joint.name] if primitive.driven else -1
                rows.append(self._primitive(primitive, joint.bodies, driver, len(names)))
                count = ROWS_OF[primitive.kind]
                bodies += [pair] * count
                names += [joint.name] * count
        self.row_joint = tuple(names)
        self.m = len(names)
        self._row_bodies = np.array(bodies, dtype=np.int64).reshape(-1, 2)
        return stacked(Primitives, rows)

    def _primitive(self, primitive: Primitive, names: tuple[str, str], driver: int, row: int) -> Primitives:
        first, second = names
        return Primitives(
            kind=primitive.kind,
            first=self._index[first],
            second=self._index[second],
            driver=driver,
            row=row,
            point_first=self.point(first, primitive.point_first),
            point_second=self.point(second, primitive.point_second),
            direction_first=self.direction(first, primitive.first),
            turning_first=self.direction(first, primitive.turning),
            direction_second=self.direction(second, primitive.second),
            length=primitive.length,
        )

    def _gravity(self) -> tuple[float, ...]:
        return (0.0, 0.0, 0.0) if self.kinematic else self.scene.gravity


def displaced(q: np.ndarray, x: np.ndarray) -> np.ndarray:
    """q ⊕ x: coordinates (7 nb,) moved by (δr, δπ') per body (6 nb,), see ``coordinates.displace``."""
    moved = np.ascontiguousarray(q, dtype=float).copy()
    displace(moved, np.ascontiguousarray(x, dtype=float), np.zeros_like(moved))
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


def _principal_axes(body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Principal moments and the rotation from the principal frame to the body's."""
    inertia = np.array(body.inertia if body.inertia is not None else np.ones(3))
    if inertia.ndim == 1:
        return inertia, np.eye(3)
    moments, axes = np.linalg.eigh(inertia)
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return np.maximum(moments, 0.0), axes


def _driver_rows(joint: Joint, driven: dict[str, int]) -> list[Primitive]:
    return [driver_primitive(joint)] if joint.name in driven else []
