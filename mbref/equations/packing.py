"""Scenes of one structure as the arrays that kernels read, packed at once: a single scene, or many variants.

Scenes are of one structure where they differ in numbers alone (``shape_of``).  The first axis of every array
counts the scenes.  An entry that scenes share, as variants share most, is read once.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np

from mbref import rotations
from mbref.equations.joints import driver_primitive, primitives_of
from mbref.equations.joints.base import Primitive, frame
from mbref.equations.structure import Structure, structure_of
from mbref.equations.units import body_lengths, metric_root
from mbref.kernels.scene_layout import (
    FORCE,
    MOMENT,
    SPRING,
    TORSION_SPRING,
    Bodies,
    Drivers,
    Loads,
    Primitives,
    SceneData,
)
from mbref.scene import (
    GROUND,
    Body,
    Driver,
    Fixed,
    Force,
    Joint,
    Load,
    Moment,
    Scene,
    SceneError,
    Sine,
    Spring,
    TorsionSpring,
)

FRAME = "the fixed frame"  # holds a modelled ground
AT_REST = Sine(amplitude=0.0, frequency=0.0, phase=0.0)
NONE = (0.0, 0.0, 0.0)


def shape_of(scene: Scene) -> Hashable:
    """All of a scene but its numbers: scenes of equal shape are packed together."""
    return (
        scene.ground,
        tuple((body.name, _shape_of_inertia(body)) for body in scene.body),
        tuple((joint.name, joint.type, joint.bodies) for joint in scene.joint),
        tuple((driver.joint, len(driver.polynomial)) for driver in scene.driver),
        tuple((load.type, getattr(load, load.acts_on)) for load in scene.load),
    )


def _shape_of_inertia(body: Body) -> bool | None:
    """Whether it has products of inertia; None without mass."""
    return None if body.inertia is None else isinstance(body.inertia[0], tuple)


class Packs:
    """Scenes of one shape: structure, SceneData, masses, frames and lengths.

    For s scenes of nb bodies: ``mass`` (s, 6 nb), the diagonal of M, and ``inverse_root``, M^(-1/2), 1 where
    the mass is zero; ``principal`` and ``orientation`` (s, nb, 4) of principal frames, from the body's own
    and from the world; ``length`` (s,), the largest distance between two centres of mass and joint anchors at
    t = 0 (m).  ``listed`` has the bodies of each scene.
    """

    def __init__(self, scenes: Sequence[Scene]):
        self.scenes, self.kinematic = scenes, not scenes[0].has_mass()
        listed = [with_ground(scene) for scene in scenes]
        self.listed = [bodies for bodies, _ in listed]
        self.bodies, self.joints = listed[0]
        self.nb = len(self.bodies)
        self.index = {body.name: b for b, body in enumerate(self.bodies)}
        self.index.setdefault(GROUND, self.nb)
        self.index[FRAME] = self.nb
        bodies = self._bodies([body for bodies, _ in listed for body in bodies])
        joints = [joint for _, joints in listed for joint in joints]
        lengths = self._lengths(joints)
        self.structure, primitives = self._primitives(joints)
        self.data = SceneData(
            gravity=self._gravity(),
            lengths=lengths,
            metric_root=metric_root(self.mass, lengths),
            bodies=bodies,
            primitives=primitives,
            moving=self._all(np.arange(primitives.kind.shape[1])),
            resting=self._all(np.zeros(0, dtype=np.int64)),
            row_bodies=self._all(self.structure.row_bodies),
            drivers=self._drivers(),
            loads=self._loads(),
        )

    def _all(self, array: np.ndarray) -> np.ndarray:
        """An array that is the same for all scenes."""
        many = len(self.scenes) > 1
        return np.broadcast_to(array, (len(self.scenes), *array.shape)) if many else array[None]

    def _rows(self, rows: Iterable[Any], width: int) -> np.ndarray:
        """Rows of numbers (s, …, width) of entries, of one scene after another."""
        return np.array([*rows], dtype=float).reshape(len(self.scenes), -1, width)

    def _gravity(self) -> np.ndarray:
        return np.array([NONE if self.kinematic else scene.gravity for scene in self.scenes])

    def _bodies(self, bodies: Sequence[Body]) -> Bodies:
        frames = _once(_principal_axes, bodies)
        poses = self._rows(((*body.position, *body.orientation) for body in bodies), 7)
        given, shape = poses[:, :, 3:], (len(self.scenes), self.nb)
        self.turns_frames = any(axes is not None for _, axes in frames)
        self.principal = _quaternions([axes for _, axes in frames]).reshape(*shape, 4)
        self.orientation = rotations.multiply(given, self.principal) if self.turns_frames else given
        mass, inertia = np.ones(shape), np.ones((*shape, 3))
        if not self.kinematic:
            mass = np.array([body.mass for body in bodies]).reshape(shape)
            inertia = self._rows((moments for moments, _ in frames), 3)
        masses = np.concatenate([np.repeat(mass[..., None], 3, axis=-1), inertia], axis=-1)
        self.mass = masses.reshape(len(self.scenes), 6 * self.nb)
        self.inverse_root = 1 / np.sqrt(np.where(self.mass > 0, self.mass, 1.0))
        to_local = rotations.to_matrix(self.orientation).swapaxes(-1, -2)
        self._to_local = np.concatenate([to_local, self._all(np.eye(3)[None])], axis=1)  # the fixed frame's
        self._centres = np.concatenate([poses[:, :, :3], self._all(np.zeros((1, 3)))], axis=1)
        return Bodies(mass, inertia)

    def _lengths(self, joints: Sequence[Joint]) -> np.ndarray:
        """Lengths (s, nb) of bodies; the anchors' distances from them, and the scenes' ``length``."""
        anchors = self._rows(_once(_anchors, joints), 6).reshape(len(self.scenes), -1, 3)
        ends = [self.index[name] for joint in self.joints for name in joint.bodies]
        scene = self.scenes[0]
        own = self._centres[:, : len(scene.body)], anchors[:, : 2 * len(scene.joint)]
        points = np.concatenate(own, axis=1)
        apart = points[:, :, None] - points[:, None]
        self.length = np.sqrt((apart * apart).sum(axis=-1).max(axis=(1, 2)))
        self.length = np.where(self.length > 0.0, self.length, 1.0)
        return body_lengths(self.nb, np.array(ends, dtype=int), anchors, self._centres)

    def _structured(self, joints: Sequence[Joint]) -> tuple[Structure, np.ndarray]:
        """The structure of the rows of all joints and drivers, and numbers (s, p, 16) as ``_of_joint``."""
        driven = {driver.joint: k for k, driver in enumerate(self.scenes[0].driver)}
        found = _once(partial(_of_joint, driven=driven), joints)
        places = []
        for joint, (primitives, _) in zip(self.joints, found, strict=False):  # of the first scene
            first, second = (self.index[name] for name in joint.bodies)
            for p in primitives:
                places.append((p.kind, joint.name, first, second, driven[joint.name] if p.driven else -1))
        numbers = np.concatenate([numbers for _, numbers in found] or [np.zeros((0, 16))])
        structure = structure_of(self.nb, tuple(places))
        return structure, numbers.reshape(len(self.scenes), len(places), 16)

    def _primitives(self, joints: Sequence[Joint]) -> tuple[Structure, Primitives]:
        """The structure of the constraint rows, and the primitives of all joints and drivers."""
        structure, numbers = self._structured(joints)
        scenes, p = numbers.shape[:2]
        vectors = numbers[..., :15].reshape(scenes, p, 5, 3).swapaxes(1, 2)
        directions = self.directions(structure.of_directions, vectors[:, 2:].reshape(scenes, 3 * p, 3))
        first, turning, second = directions.reshape(scenes, 3, p, 3).swapaxes(0, 1)
        return structure, Primitives(
            kind=self._all(structure.kind),
            first=self._all(structure.first),
            second=self._all(structure.second),
            driver=self._all(structure.driver),
            row=self._all(structure.row),
            point_first=self.points(structure.first, vectors[:, 0]),
            point_second=self.points(structure.second, vectors[:, 1]),
            direction_first=first,
            turning_first=turning,
            direction_second=second,
            length=numbers[..., 15],
        )

    def _drivers(self) -> Drivers:
        """All drivers, their polynomials filled up with zeros to the highest degree."""
        drivers = [driver for scene in self.scenes for driver in scene.driver]
        terms = max((len(driver.polynomial) for driver in self.scenes[0].driver), default=1)
        numbers = self._rows(_once(partial(_driver, terms=terms), drivers), 3 + terms)
        return Drivers(numbers[..., 0], numbers[..., 1], numbers[..., 2], numbers[..., 3:])

    def _loads(self) -> Loads:
        """All loads; none of scenes without masses."""
        scenes = () if self.kinematic else self.scenes
        kinds = np.array([self._kind(k, load) for scene in scenes[:1] for k, load in enumerate(scene.load)])
        kinds = kinds.reshape(-1, 3).astype(np.int64)
        numbers = self._rows((_numbers_of(load, scene) for scene in scenes for load in scene.load), 24)
        numbers = numbers.reshape(len(self.scenes), len(kinds), 24)
        kind, first, second = kinds.T
        vectors = numbers[..., :21].reshape(*numbers.shape[:-1], 7, 3).swapaxes(0, 2).swapaxes(1, 2)
        is_angle = kind == TORSION_SPRING
        points = [
            np.where(has_point[:, None], self.points(bodies, at), 0.0)
            for has_point, bodies, at in (
                ((kind == FORCE) | (kind == SPRING), first, vectors[1]),
                (kind == SPRING, second, vectors[2]),
            )
        ]
        axes = [self.directions(first, vector) for vector in vectors[3:6]]
        return Loads(
            self._all(kind), self._all(first), self._all(second),
            self._all(np.where(is_angle, np.cumsum(is_angle) - 1, -1)),
            vectors[0], *points, *axes, self.directions(second, vectors[6]),
            numbers[..., 21], numbers[..., 22], numbers[..., 23],
        )  # fmt: skip

    def _kind(self, place: int, load: Load) -> tuple[int, int, int]:
        """Kind and bodies of load[place]; SceneError for a type without equations."""
        if isinstance(load, Moment | Force):
            return FORCE if isinstance(load, Force) else MOMENT, self.index[load.body], 0
        if isinstance(load, Spring):
            return SPRING, *map(self.index.__getitem__, load.bodies)
        if not isinstance(load, TorsionSpring):
            raise SceneError([f"load[{place}]: mbref has no equations for loads of type {load.type!r}"])
        return TORSION_SPRING, *map(self.index.__getitem__, self.scenes[0].joint_named(load.joint).bodies)

    def directions(self, bodies: np.ndarray, vectors: np.ndarray) -> np.ndarray:
        """World vectors (…, k, 3) at t = 0, each in the principal frame (s, k, 3) of a body of index (k,)."""
        return (self._to_local[:, bodies] @ vectors[..., None])[..., 0]

    def points(self, bodies: np.ndarray, points: np.ndarray) -> np.ndarray:
        """World points (…, k, 3) at t = 0, each in the principal frame (s, k, 3) of a body of index (k,)."""
        return self.directions(bodies, points - self._centres[:, bodies])

    def start(self) -> np.ndarray:
        """Coordinates (s, 7 nb) of the scenes' poses, principal frames."""
        poses = np.concatenate([self._centres[:, : self.nb], self.orientation], axis=-1)
        return poses.reshape(len(self.scenes), 7 * self.nb)


def row_of(values: Any, place: Any) -> Any:
    """The arrays of one scene, or of those at some places, of a schema of arrays of several."""
    return type(values)(*(row_of(v, place) if isinstance(v, tuple) else v[place] for v in values))


def with_ground(scene: Scene) -> tuple[tuple[Body, ...], tuple[Joint, ...]]:
    """Bodies and joints, the ground a body held by six rows where the scene asks for it."""
    if scene.ground == "frame":
        return scene.body, scene.joint
    inertia = (1.0, 1.0, 1.0) if scene.has_mass() else None
    body = Body(name=GROUND, position=NONE, mass=1.0 if inertia else None, inertia=inertia)
    hold = Fixed.model_construct(name=GROUND, bodies=(FRAME, GROUND), anchor=NONE, type="fixed")
    return (*scene.body, body), (*scene.joint, hold)


def _once(function: Callable[[Any], Any], entries: Sequence[Any]) -> list[Any]:
    """A function of every entry, called once for one that stands there several times."""
    known: dict[int, Any] = {}
    for entry in entries:
        if id(entry) not in known:
            known[id(entry)] = function(entry)
    return [known[id(entry)] for entry in entries]


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


def _anchors(joint: Joint) -> tuple[float, ...]:
    """The anchors on the first and on the second body, world at t = 0."""
    first, second = joint.anchor_pair
    return *first, *second


def _of_joint(joint: Joint, driven: dict[str, int]) -> tuple[list[Primitive], np.ndarray]:
    """The primitives of a joint and its driver, and their vectors and lengths (p, 16): two points, then three
    directions, in the order of ``Structure.of_directions``."""
    found = [*primitives_of(joint), *([driver_primitive(joint)] if joint.name in driven else [])]
    numbers = [(*p.point_first, *p.point_second, *p.first, *p.turning, *p.second, p.length) for p in found]
    return found, np.array(numbers, dtype=float)


def _driver(driver: Driver, terms: int) -> tuple[float, ...]:
    """Amplitude, frequency, phase and polynomial."""
    sine, open_ = driver.sine or AT_REST, terms - len(driver.polynomial)
    return sine.amplitude, sine.frequency, sine.phase, *driver.polynomial, *(0.0,) * open_


def _numbers_of(load: Load, scene: Scene) -> tuple[float, ...]:
    """Seven world vectors at t = 0 (force, two points, axis, x and y on the first body, x on the second),
    stiffness, damping, natural length or angle; zero for those that a load has not."""
    if isinstance(load, Moment):
        return *load.moment, *NONE * 7
    if isinstance(load, Force):
        return *load.force, *load.point, *NONE * 6
    if isinstance(load, Spring):
        first, second = load.points
        return *NONE, *first, *second, *NONE * 4, load.stiffness, load.damping, load.natural_length
    x, y, z = frame(scene.joint_named(load.joint).axis)
    return *NONE * 3, *z, *x, *y, *x, load.stiffness, load.damping, load.natural_angle
