"""Scenes of one structure as the arrays that kernels read, packed at once: a single scene, or many variants.

Scenes are of one structure if they differ in numbers only (``parts.shape_of``). The first axis of every array
is the scene. An entry that scenes share is converted once.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache, partial
from typing import Any

import numpy as np

from mbref import rotations
from mbref.equations.couplings import coordinate_primitives, couplings_of
from mbref.equations.functions import functions_of_drivers, numbers_of, pieces_of
from mbref.equations.joints import Primitive, function_of, rows_of_joint, vectors_of
from mbref.equations.largest_distance import characteristic_lengths
from mbref.equations.load_numbers import (
    Values,
    anchors_of,
    directions_across,
    load_place,
    loaded_joints,
    numbers_of_load,
    turning_joints,
)
from mbref.equations.parts import FRAME, all_parts, shape_of
from mbref.equations.principal_axes import numbers_of_body, quaternions
from mbref.equations.structure import (
    MOST_KEPT,
    Places,
    PrimitivePlace,
    Structure,
    TurningPlace,
    parts_of_row,
    structure_of,
)
from mbref.equations.units import body_lengths, inverse_root, metric
from mbref.kernels.scene_layout import (
    Bodies,
    Functions,
    Loads,
    Primitives,
    SceneData,
    TurningJoints,
)
from mbref.scene import GROUND, Joint, Scene
from mbref.scene.scene import functions_of

OF_MASS = np.array([7, 7, 7, 8, 9, 10])  # indices of a body's parameters on the diagonal of M

_structures: dict[Hashable, Structure] = {}  # by shape


class Packs:
    """Assembled scenes of one shape: structure, SceneData, masses, frames and lengths. For s scenes of nb
    bodies: ``mass`` (s, 6 nb), the diagonal of M, and ``inverse_root``, M^(-1/2), 1 where the mass is zero;
    ``principal`` and ``orientation`` (s, nb, 4) of principal frames, from the body's own and from the world;
    ``length`` (s,), the largest distance between two centres of mass and joint anchors at t = 0 (m).
    ``to_local`` (s, nb + 1, 3, 3) turns world vectors at t = 0 to the principal frames. ``listed`` has the
    bodies of each scene, ``joints`` its joints."""

    def __init__(self, scenes: Sequence[Scene]):
        assert not any(c.offset for scene in scenes for c in scene.coupling), "pack assembled scenes"
        self.scenes = scenes
        self.found: dict[int, dict[Any, Any]] = {}  # by scene: results of functions, see ``Model.once``
        self.kinematic = not scenes[0].has_mass()
        listed = [all_parts(scene) for scene in scenes]
        self.listed, self.joints = [found.bodies for found in listed], [found.joints for found in listed]
        self._coupled = [
            couplings_of(scene) + found.couplings for scene, found in zip(scenes, listed, strict=True)
        ]
        self.bodies, self.nb = self.listed[0], len(self.listed[0])
        self.index = {body.name: b for b, body in enumerate(self.bodies)}
        self.index.setdefault(GROUND, self.nb)
        self.index[FRAME] = self.nb
        joints = [joint for joints in self.joints for joint in joints]
        of_joints = self._rows_of_joints(joints)
        driven = functions_of_drivers(scenes[0])
        of_couplings = [[*map(coordinate_primitives, found)] for found in self._coupled]
        self.structure = self._structure([found for found, _ in of_joints], of_couplings[0], driven)
        bodies = self._bodies()
        lengths = self._lengths(joints)
        primitives, loads, turning = self._fixed_in_bodies(
            self._in_order([rows for _, rows in of_joints], of_couplings), self._higher(of_couplings)
        )
        # gravity acts on the bodies of the scene, not on rotors or a modelled ground
        has_weight = np.arange(self.nb)[:, None] < (0 if self.kinematic else len(scenes[0].body))
        self.data = SceneData(
            gravity=np.where(has_weight, np.array([[scene.gravity] for scene in scenes], dtype=float), 0.0),
            lengths=lengths,
            metric_root=inverse_root(metric(self.mass, lengths)),
            bodies=bodies,
            primitives=primitives,
            turning=turning,
            row_bodies=self._all(self.structure.row_bodies),
            velocity_rows=self._all(self.structure.velocity_rows),
            functions=self._functions(),
            loads=loads,
        )

    def _rows_of_joints(self, joints: Sequence[Joint]) -> list[tuple[list[Primitive], list[Values]]]:
        """Return primitives and their numbers of the joints of all scenes, with their drivers."""
        of_scenes = [{d.joint: tuple(turn.axis for turn in d.turns) for d in s.driver} for s in self.scenes]
        if not any(axes for driven in of_scenes for axes in driven.values()):
            names = of_scenes[0]
            return _once(lambda joint: rows_of_joint(joint, names.get(joint.name)), joints)
        pairs = zip(of_scenes, self.joints, strict=True)
        return [rows_of_joint(joint, driven.get(joint.name)) for driven, own in pairs for joint in own]

    def _in_order(
        self,
        of_joints: Sequence[list[Values]],
        of_couplings: Sequence[Sequence[tuple[Primitive, ...]]],
    ) -> list[Values]:
        """Return the parameters of all primitives, scene by scene: joints first, then couplings."""
        if not any(of_couplings):
            return [numbers for rows in of_joints for numbers in rows]
        found: list[Values] = []
        count = len(self.joints[0])
        for k, pairs in enumerate(of_couplings):
            found += [numbers for rows in of_joints[k * count : (k + 1) * count] for numbers in rows]
            found += [vectors_of(primitive) for pair in pairs for primitive in pair]
        return found

    def _higher(self, of_couplings: Sequence[Sequence[tuple[Primitive, ...]]]) -> np.ndarray:
        """Return the factors (s, p, powers) of higher powers of all primitives' joint coordinates."""
        found = np.zeros((len(self.scenes), len(self.structure.kind), self.structure.places.powers))
        for k, rows in enumerate(of_couplings if found.size else ()):
            coordinates = [p for row in rows for p in row]
            for p, primitive in enumerate(coordinates, found.shape[1] - len(coordinates)):
                found[k, p, : len(primitive.higher)] = primitive.higher
        return found

    def _structure(
        self,
        primitives: Sequence[Sequence[Primitive]],
        coupled: Sequence[tuple[Primitive, ...]],
        driven: Mapping[str, tuple[int, ...]],
    ) -> Structure:
        """Return the structure of the scenes, found once for each shape."""
        shape = self.kinematic, shape_of(self.scenes[0])
        if shape not in _structures:
            if len(_structures) >= MOST_KEPT:
                _structures.pop(next(iter(_structures)), None)
            _structures[shape] = structure_of(self._places(primitives, coupled, driven))
        return _structures[shape]

    def _places(
        self,
        primitives: Sequence[Sequence[Primitive]],
        coupled: Sequence[tuple[Primitive, ...]],
        driven: Mapping[str, tuple[int, ...]],
    ) -> Places:
        """Return the first scene without its numbers, from the primitives of its joints and couplings."""
        scene, joints = self.scenes[0], self.joints[0]
        turning = {joint.name: k for k, joint in enumerate(turning_joints(joints))}
        ends = [(self.index[joint.bodies[0]], self.index[joint.bodies[1]]) for joint in joints]
        loads, functions = () if self.kinematic else scene.load, functions_of(scene)
        named = loaded_joints(scene)
        factor = itertools.count(len(scene.driver))
        return Places(
            nb=self.nb,
            primitives=tuple(
                PrimitivePlace(p.kind, joint.name, first, second, function_of(p, driven.get(joint.name, ())))
                for joint, (first, second), found in zip(joints, ends, primitives, strict=False)
                for p in found
            )
            + tuple(self._of_couplings(coupled)),
            loads=tuple(
                load_place(load, k, named, self.index, turning, next(factor) if load.over_time else -1)
                for k, load in enumerate(loads)
            ),
            turning=tuple(
                TurningPlace(joint.name, *bodies)
                for joint, bodies in zip(joints, ends, strict=True)
                if joint.name in turning
            ),
            anchored=tuple(body for bodies in ends for body in bodies),
            functions=tuple(len(function.pieces()) for function in functions),
            terms=max((len(function.coefficients) for function in functions), default=1),
            powers=max((len(p.higher) for row in coupled for p in row), default=0),
        )

    def _of_couplings(self, primitives: Sequence[tuple[Primitive, ...]]) -> Iterator[PrimitivePlace]:
        """Return the joint coordinates of the first scene's couplings, which share a row."""
        for coupling, found in zip(self._coupled[0], primitives, strict=True):
            for part, joint, p in zip(parts_of_row(len(found)), coupling.joints, found, strict=True):
                first, second = map(self.index.__getitem__, joint.bodies)
                yield PrimitivePlace(p.kind, coupling.name, first, second, -1, part, joint.name)

    def _all(self, array: np.ndarray) -> np.ndarray:
        """Return an array that is equal for all scenes."""
        many = len(self.scenes) > 1
        return np.broadcast_to(array, (len(self.scenes), *array.shape)) if many else array[None]

    def _rows(self, rows: Iterable[Any], width: int) -> np.ndarray:
        """Return rows of numbers (s, …, width) of entries, scene after scene."""
        return np.array([*rows], dtype=float).reshape(len(self.scenes), -1, width)

    def _bodies(self) -> Bodies:
        """Return masses and moments, positions and frames of the bodies, with the fixed frame last."""
        found = [_once(numbers_of_body, bodies) for bodies in self.listed]
        # zeros for the fixed frame, whose quaternion without a vector part is no rotation
        numbers = np.zeros((len(self.scenes), self.nb + 1, 11))
        numbers[:, :-1] = self._rows((own for rows in found for own, _ in rows), 11)
        axes = [axes for rows in found for _, axes in rows]
        if self.kinematic:
            numbers[..., 7:] = 1.0
        self.turns_frames = any(each is not None for each in axes)
        frames = numbers[..., 3:7]
        self.principal = quaternions(axes).reshape(len(self.scenes), self.nb, 4)
        if self.turns_frames:
            frames[:, :-1] = rotations.multiply(frames[:, :-1], self.principal)
        self.to_local = np.ascontiguousarray(rotations.to_matrix(frames).swapaxes(-1, -2))
        self._centres, self.orientation = numbers[..., :3], frames[:, :-1]
        self.mass = numbers[:, :-1].take(OF_MASS, axis=2).reshape(len(self.scenes), 6 * self.nb)
        self.inverse_root = inverse_root(self.mass)
        return Bodies(numbers[:, :-1, 7], numbers[:, :-1, 8:])

    def _lengths(self, joints: Sequence[Joint]) -> np.ndarray:
        """Return lengths (s, nb) of bodies, the vectors to their anchors, and the scenes' ``length``."""
        anchors = self._rows(_once(anchors_of, joints), 6).reshape(len(self.scenes), -1, 3)
        nb, nj = len(self.scenes[0].body), len(self.scenes[0].joint)
        points = np.concatenate((self._centres[:, :nb], anchors[:, : 2 * nj]), axis=1)
        mass = np.zeros_like(self.mass) if self.kinematic else self.mass
        self.length = characteristic_lengths(points, mass.reshape(len(points), self.nb, 6))
        anchored = self.structure.anchored
        return body_lengths(anchors - self._centres[:, anchored], anchored, self.nb)

    def _fixed_in_bodies(
        self, of_primitives: Sequence[Values], higher: np.ndarray
    ) -> tuple[Primitives, Loads, TurningJoints]:
        """Return primitives, loads and turning joints from the numbers of all primitives, and factors
        (s, p, powers) of higher powers. Vectors are rotated to the principal frames of the bodies in one
        operation."""
        structure, scenes = self.structure, () if self.kinematic else self.scenes
        numbers = self._rows(of_primitives, 16)
        named = [(scene, loaded_joints(scene)) for scene in scenes]
        of_loads = self._rows((numbers_of_load(l, joints) for scene, joints in named for l in scene.load), 15)
        turning = [joint for joints in self.joints for joint in turning_joints(joints)]
        of_angles = self._rows(_once(directions_across, turning), 9)
        (s, p), l = numbers.shape[:2], of_loads.shape[1]
        world = np.concatenate(
            [
                numbers[..., :15].reshape(s, 5 * p, 3),
                of_loads[..., 3:12].reshape(s, 3 * l, 3),
                of_angles.reshape(s, -1, 3),
            ],
            axis=1,
        )
        own = self.in_bodies(world)
        vectors_of, others = own[:, : 5 * p].reshape(s, p, 5, 3), own[:, 5 * p :].reshape(s, -1, 3, 3)
        places = (structure.kind, structure.first, structure.second, structure.driver, structure.row)
        places += (*structure.places_in_row,)
        directions = [vectors_of[:, :, k] for k in range(5)]
        primitives = Primitives._make([*map(self._all, places), *directions, numbers[..., 15], higher])
        ends, constants = [*map(self._all, structure.load)], [of_loads[..., k] for k in range(12, 15)]
        loads = Loads._make([*ends, of_loads[..., :3], *(others[:, :l, k] for k in range(3)), *constants])
        across = [others[:, l:, k] for k in range(3)]
        return primitives, loads, TurningJoints._make([*map(self._all, structure.turning), *across])

    def in_bodies(self, vectors: np.ndarray) -> np.ndarray:
        """Return world vectors (s, 5 p + 3 l + 3 a, 3) of the structure at t = 0 in the principal frames of
        its bodies."""
        origins = self._centres[:, self.structure.vector_origin]
        return self.directions(self.structure.vector_body, vectors - origins)

    def _functions(self) -> Functions:
        """Return all functions of time, with polynomials filled up with zeros to the highest degree."""
        functions = [function for scene in self.scenes for function in functions_of(scene)]
        if not functions:
            return _no_functions(len(self.scenes))
        terms, count = self.structure.places.terms, self.structure.places.functions
        numbers = self._rows(_once(partial(numbers_of, terms=terms), functions), 3 + terms)
        found = _once(pieces_of, functions)
        pieces = self._rows((piece for rows in found for piece in rows), 6)
        first = self._all(np.cumsum([0, *count], dtype=np.int64))
        amplitude, frequency, phase = (numbers[..., k] for k in range(3))
        begin, part, cubic = pieces[..., 0], pieces[..., 1], pieces[..., 2:]
        return Functions(first, amplitude, frequency, phase, numbers[..., 3:], begin, part, cubic)

    def directions(self, bodies: np.ndarray, vectors: np.ndarray) -> np.ndarray:
        """Return world vectors (…, k, 3) at t = 0, each in the principal frame (s, k, 3) of a body with index
        (k,)."""
        return (self.to_local[:, bodies] @ vectors[..., None])[..., 0]

    def points(self, bodies: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return world points (…, k, 3) at t = 0, each in the principal frame (s, k, 3) of a body with index
        (k,)."""
        return self.directions(bodies, points - self._centres[:, bodies])

    def start(self) -> np.ndarray:
        """Return coordinates (s, 7 nb) of the scenes' poses, for principal frames."""
        poses = np.concatenate([self._centres[:, : self.nb], self.orientation], axis=2)
        return poses.reshape(len(self.scenes), 7 * self.nb)


@lru_cache(maxsize=8)
def _no_functions(scenes: int) -> Functions:
    """Return the functions of time of scenes without any."""
    numbers, first = np.zeros((scenes, 0)), np.zeros((scenes, 1), dtype=np.int64)
    return Functions(first, numbers, numbers, numbers, np.zeros((scenes, 0, 1)), numbers, numbers,
                     np.zeros((scenes, 0, 4)))  # fmt: skip


def row_of(values: Any, place: Any) -> Any:
    """Return the arrays of one scene, or of several, from a schema with the arrays of all scenes."""
    return values._make([row_of(v, place) if isinstance(v, tuple) else v[place] for v in values])


def _once(function: Callable[[Any], Any], entries: Sequence[Any]) -> list[Any]:
    """Return a function's values for all entries; the function is called once for an entry that occurs
    several times."""
    places = [*map(id, entries)]
    known = {place: function(entry) for place, entry in dict(zip(places, entries, strict=True)).items()}
    return [*map(known.__getitem__, places)]
