"""Model: a scene as arrays, and its equations M, g, Φ, Φ_q, ν, γ at (t, q, v).

Each body is described in its principal frame at the centre of mass, so that M is diagonal; frames are
turned back where trajectories are written.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mbref import rotations
from mbref.equations.evaluation import evaluate_all
from mbref.equations.joints import driver_primitive, primitives_of
from mbref.equations.joints.base import ROWS_OF, Primitive, frame
from mbref.equations.loads import CONSTANTS, FIRST, FOURTH, SECOND, THIRD
from mbref.kernels.layout import (
    COLUMNS,
    FORCE,
    FORCE_AT_POINT,
    GAMMA,
    INVERSE_ROOT,
    JACOBIAN,
    LENGTH,
    MASS,
    MOMENT,
    MOVING,
    NU,
    PHI,
    POINT_I,
    POINT_J,
    ROTATION,
    ROWS,
    SPRING,
    TORSION_SPRING,
    TURNING,
    U_I,
    U_J,
    W_I,
)
from mbref.scene import GROUND, Body, Driver, Fixed, Joint, Scene, SceneError


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
        self._pack_bodies()
        self._pack_primitives()
        loads, data = self._pack_loads()
        self.ints = (
            self._primitives,
            self._row_bodies,
            loads,
            self.entries(np.arange(7 * self.nb), np.arange(self.n)),
        )
        self.floats = (self._moments, self._geometry, self._drivers(), data, np.array([self._gravity()]))
        self._work = self.workspace(1, dense=False)

    def workspace(self, scratch: int, dense: bool = True) -> tuple[np.ndarray, ...]:
        """Fresh working memory (see ``tables``); ``scratch`` numbers for the formulation.

        Not ``dense``: without the matrices whose size is rows times columns.
        """
        m, n, nb = self.m, self.n, self.nb
        big = max(m + nb, 7 * nb)
        matrix, jacobian = ((2 * big, big), (m, n)) if dense else ((2, 16), (0, n))
        frames = np.zeros((nb + 1, 18))
        frames[:, ROTATION : ROTATION + 9 : 4] = 1.0
        columns = np.zeros((5, n))
        columns[MASS] = self.mass
        columns[INVERSE_ROOT] = 1 / np.sqrt(np.where(self.mass > 0, self.mass, 1.0))
        angles = np.zeros((1, max(1, int(np.sum(self.ints[2][:, 3] >= 0)))))
        return (
            frames, np.zeros((m, 12)), np.zeros((6, m)), columns, np.zeros((4, 7 * nb)),
            np.zeros((4, 7 * nb)), np.zeros(matrix), np.zeros((8, big)), np.zeros((1, scratch)),
            angles, np.zeros(jacobian), np.zeros((1, 4)),
        )  # fmt: skip

    def entries(self, coordinates: np.ndarray, velocities: np.ndarray) -> np.ndarray:
        """``ints[LIVE]`` of a y that has these columns of q (7 nb) and v (6 nb)."""
        columns = np.concatenate([coordinates, velocities])
        live = np.zeros((2, 4 + columns.size), dtype=np.int64)
        live[0, MOVING], live[0, TURNING] = coordinates.size, velocities.size
        live[1, : columns.size] = columns
        return live

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

    def blocks(self, t: float, q: np.ndarray, v: np.ndarray) -> Terms:
        """The terms with the blocks (m, 12) of both bodies' columns in place of the Jacobian."""
        work = self._work
        evaluate_all(float(t), np.ascontiguousarray(q), np.ascontiguousarray(v), self.ints, self.floats, work)
        rows = work[ROWS].copy()
        return Terms(
            self.mass, work[JACOBIAN].copy(), rows[PHI], rows[NU], rows[GAMMA], work[COLUMNS][FORCE].copy()
        )

    def entry_columns(self) -> np.ndarray:
        """Column (m, 12) of every entry of the blocks; those of the fixed frame are ≥ n."""
        return (6 * self._row_bodies[:, :, None] + np.arange(6)).reshape(self.m, 12)

    def index(self, name: str) -> int:
        """Index of a body, ``nb`` for the fixed frame."""
        return self._index[name]

    def anchor(self, joint: Joint, q: np.ndarray) -> np.ndarray:
        """World positions (…, 3) of the joint's anchor on its second body at coordinates q (…, nb, 7)."""
        point = joint.anchor_pair[1]
        b = self._index[joint.bodies[1]]
        if b == self.nb:
            return np.broadcast_to(point, (*q.shape[:-2], 3))
        return q[..., b, :3] + rotations.rotate(q[..., b, 3:], self._point(joint.bodies[1], point))

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

    def _pack_bodies(self) -> None:
        principal = [_principal_axes(body) for body in self.bodies]
        self.principal = rotations.from_matrix(np.array([axes for _, axes in principal]))
        given = np.array([body.orientation for body in self.bodies])
        self.orientation = rotations.multiply(given, self.principal)
        mass = np.array([1.0 if self.kinematic else body.mass or 1.0 for body in self.bodies])
        inertia = np.array([np.ones(3) if self.kinematic else moments for moments, _ in principal])
        self._moments = np.column_stack([mass, inertia])
        self.mass = np.concatenate([np.repeat(mass[:, None], 3, axis=1), inertia], axis=1).ravel()
        self._to_local = rotations.to_matrix(self.orientation).transpose(0, 2, 1)

    def _direction(self, name: str, vector: tuple[float, ...]) -> np.ndarray:
        b = self._index[name]
        return np.asarray(vector, dtype=float) if b == self.nb else self._to_local[b] @ vector

    def _point(self, name: str, point: tuple[float, ...]) -> np.ndarray:
        b = self._index[name]
        origin = np.zeros(3) if b == self.nb else np.array(self.bodies[b].position)
        return self._direction(name, np.asarray(point) - origin)

    def _pack_primitives(self) -> None:
        driven = {driver.joint: k for k, driver in enumerate(self.scene.driver)}
        primitives, geometry, bodies, names = [], [], [], []
        for joint in self.joints:
            pair = [self._index[name] for name in joint.bodies]
            for primitive in (*primitives_of(joint), *_driver_rows(joint, driven)):
                driver = driven[joint.name] if primitive.driven else -1
                primitives.append([primitive.kind, *pair, driver, len(names)])
                geometry.append(self._local(primitive, joint.bodies))
                rows = ROWS_OF[primitive.kind]
                bodies += [pair] * rows
                names += [joint.name] * rows
        self.row_joint = tuple(names)
        self.m = len(names)
        self._primitives = np.array(primitives, dtype=np.int64).reshape(-1, 5)
        self._geometry = np.array(geometry, dtype=float).reshape(-1, 16)
        self._row_bodies = np.array(bodies, dtype=np.int64).reshape(-1, 2)

    def _local(self, primitive: Primitive, names: tuple[str, str]) -> np.ndarray:
        first, second = names
        row = np.zeros(16)
        row[POINT_I : POINT_I + 3] = self._point(first, primitive.point_first)
        row[POINT_J : POINT_J + 3] = self._point(second, primitive.point_second)
        row[U_I : U_I + 3] = self._direction(first, primitive.first)
        row[W_I : W_I + 3] = self._direction(first, primitive.turning)
        row[U_J : U_J + 3] = self._direction(second, primitive.second)
        row[LENGTH] = primitive.length
        return row

    def _drivers(self) -> np.ndarray:
        degree = max((len(d.polynomial) for d in self.scene.driver), default=1)
        return np.array([_driver_row(d, degree) for d in self.scene.driver]).reshape(-1, 3 + degree)

    def _gravity(self) -> tuple[float, ...]:
        return (0.0, 0.0, 0.0) if self.kinematic else self.scene.gravity

    def _pack_loads(self) -> tuple[np.ndarray, np.ndarray]:
        joints = {joint.name: joint for joint in self.joints}
        index, data, slots = [], [], 0
        for load in () if self.kinematic else self.scene.load:
            row = np.zeros(15)
            if load.type == "moment":
                index.append([MOMENT, self._index[load.body], self.nb, -1])
                row[FIRST:SECOND] = load.moment
            elif load.type == "force":
                index.append([FORCE_AT_POINT, self._index[load.body], self.nb, -1])
                row[FIRST:SECOND] = self._point(load.body, load.point)
                row[SECOND:THIRD] = load.force
            elif load.type == "spring":
                index.append([SPRING, *(self._index[name] for name in load.bodies), -1])
                for column, name, point in zip((FIRST, SECOND), load.bodies, load.points, strict=True):
                    row[column : column + 3] = self._point(name, point)
                row[CONSTANTS:] = load.stiffness, load.damping, load.natural_length
            elif load.type == "torsion_spring":
                joint = joints[load.joint]
                first, second = joint.bodies
                index.append([TORSION_SPRING, self._index[first], self._index[second], slots])
                slots += 1
                x, y, z = frame(joint.axis)
                for column, name, axis in (
                    (FIRST, first, z), (SECOND, first, x), (THIRD, first, y), (FOURTH, second, x),
                ):  # fmt: skip
                    row[column : column + 3] = self._direction(name, axis)
                row[CONSTANTS:] = load.stiffness, load.damping, load.natural_angle
            else:
                raise SceneError(
                    [f"load[{len(data)}]: mbref has no equations for loads of type {load.type!r}"]
                )
            data.append(row)
        return np.array(index, dtype=np.int64).reshape(-1, 4), np.array(data).reshape(-1, 15)


def displaced(q: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Coordinates (7 nb,) moved by (δr, δπ') per body (6 nb,)."""
    bodies, change = q.reshape(-1, 7), x.reshape(-1, 6)
    turned = rotations.multiply(bodies[:, 3:], rotations.from_vector(change[:, 3:]))
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    return np.concatenate([bodies[:, :3] + change[:, :3], turned], axis=1).ravel()


def _with_ground(scene: Scene) -> tuple[tuple[Body, ...], tuple[Joint, ...]]:
    """Bodies and joints, the ground a body held by six rows where the scene asks for it."""
    if scene.ground == "frame":
        return scene.body, scene.joint
    inertia = (1.0, 1.0, 1.0) if scene.has_mass() else None
    body = Body(name=GROUND, position=(0.0, 0.0, 0.0), mass=1.0 if inertia else None, inertia=inertia)
    hold = Fixed.model_construct(name=GROUND, bodies=(FRAME, GROUND), anchor=(0.0, 0.0, 0.0), type="fixed")
    return (*scene.body, body), (*scene.joint, hold)


FRAME = "the fixed frame"  # what a modelled ground is held to


def _principal_axes(body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Principal moments and the rotation from the principal frame to the body's."""
    inertia = np.array(body.inertia if body.inertia is not None else np.ones(3))
    if inertia.ndim == 1:
        return inertia, np.eye(3)
    moments, axes = np.linalg.eigh(inertia)
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return np.maximum(moments, 0.0), axes


def _driver_rows(joint: Joint, driven: dict[str, int]) -> list[Primitive]:
    if joint.name not in driven:
        return []
    return [driver_primitive(joint)]


def _driver_row(driver: Driver, degree: int) -> np.ndarray:
    sine = driver.sine
    row = np.zeros(3 + degree)
    if sine is not None:
        row[:3] = sine.amplitude, sine.frequency, sine.phase
    row[3 : 3 + len(driver.polynomial)] = driver.polynomial
    return row
