"""Metamorphic relations: a scene changed so that its motion, known or not, changes in a known way."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from crosscheck.judge.tolerances import ROUNDING
from mbref import rotations
from mbref.scene import Scene
from mbref.trajectory import Trajectory

FLIP = np.diag([1.0, -1.0, 1.0])  # of the body frames of a mirrored scene, which stay right-handed


@dataclass(frozen=True)
class Relation:
    """``about`` says it; ``change(scene)`` is another scene, and ``expect(trajectory)`` its motion, made of
    the motion of the first."""

    about: str
    change: Callable[[Scene], Scene]
    expect: Callable[[Trajectory], Trajectory]


@dataclass(frozen=True)
class Isometry:
    """x → matrix x + shift: a rotation, a translation, or, with determinant -1, a mirror image."""

    matrix: np.ndarray  # (3, 3) orthogonal
    shift: np.ndarray  # (3,) m

    def place(self, point: Any) -> Any:
        """Points (…, 3)."""
        return np.asarray(point) @ self.matrix.T + self.shift

    def polar(self, vector: Any) -> Any:
        """Velocities, forces (…, 3)."""
        return np.asarray(vector) @ self.matrix.T

    def axial(self, vector: Any) -> Any:
        """Angular velocities, moments and axes of rotation (…, 3), which a mirror leaves along itself."""
        return np.linalg.det(self.matrix) * self.polar(vector)

    def turn(self, orientation: Any) -> np.ndarray:
        """Unit quaternions (…, 4)."""
        return rotations.from_matrix(self.matrix @ rotations.to_matrix(orientation) @ self._body())

    def inertia(self, value: Any) -> Any:
        """Principal moments, or a matrix along the body axes."""
        array = np.asarray(value)
        return array if array.ndim == 1 else self._body() @ array @ self._body()

    def _body(self) -> np.ndarray:
        return np.eye(3) if np.linalg.det(self.matrix) > 0 else FLIP

    def change(self, scene: Scene) -> Scene:
        """The scene moved as a whole, gravity and loads included."""
        fields = {
            "position": self.place, "anchor": self.place, "anchors": self.place, "point": self.place,
            "points": self.place, "velocity": self.polar, "force": self.polar, "axes": self.axial,
            "angular_velocity": self.axial, "moment": self.axial, "inertia": self.inertia,
            "orientation": self.turn,
        }  # fmt: skip
        along = {"displacement": self.polar}  # the axis of a driven displacement; others are of rotations
        joints = [
            _with(joint, {**fields, "axis": along.get(joint.facts.driven, self.axial)})
            for joint in scene.joint
        ]
        return scene.with_(
            gravity=self.polar(scene.gravity),
            body=tuple(_with(body, fields) for body in scene.body),
            joint=tuple(joints),
            load=tuple(_with(load, fields) for load in scene.load),
        )

    def expect(self, motion: Trajectory) -> Trajectory:
        """The motion moved as a whole; accelerations and reactions are left out."""
        return replace(
            motion, position=self.place(motion.position), orientation=self.turn(motion.orientation),
            velocity=self.polar(motion.velocity), angular_velocity=self.axial(motion.angular_velocity),
            acceleration=None, angular_acceleration=None, reactions=None,
        )  # fmt: skip


def _with(item: Any, fields: dict[str, Callable[[Any], Any]]) -> Any:
    """A validated copy of a body, joint or load with the named fields mapped, where it has them."""
    given = {name: getattr(item, name) for name in type(item).model_fields}
    changed = {n: f(given[n]).tolist() for n, f in fields.items() if given.get(n) is not None}
    return type(item)(**{**given, **changed})


def scaled(scene: Scene, factor: float) -> Scene:
    """Masses, inertias, forces, stiffnesses and dampings times a factor: the motion stays the same."""

    def times(value: Any) -> np.ndarray:
        return factor * np.asarray(value)

    fields = dict.fromkeys(("mass", "inertia", "force", "moment", "stiffness", "damping"), times)
    return scene.with_(
        body=tuple(_with(body, fields) for body in scene.body),
        load=tuple(_with(load, fields) for load in scene.load),
    )


def reordered(scene: Scene) -> Scene:
    """Bodies, joints and loads listed in reverse: the motion stays the same."""
    return scene.with_(body=scene.body[::-1], joint=scene.joint[::-1], load=scene.load[::-1])


def shaken(seed: int) -> Relation:
    """Every place (m) and direction of a scene is off by rounding, at random."""

    def change(scene: Scene) -> Scene:
        random = np.random.default_rng(seed)

        def shake(value: Any) -> np.ndarray:
            return np.asarray(value) + ROUNDING * random.standard_normal(np.shape(value))

        fields = dict.fromkeys(("position", "orientation", "anchor", "anchors", "axis", "axes"), shake)
        return scene.with_(
            body=tuple(_with(body, fields) for body in scene.body),
            joint=tuple(_with(joint, fields) for joint in scene.joint),
        )

    return Relation("places and directions off by rounding, the motion stays, to rounding", change, _same)


def _same(motion: Trajectory) -> Trajectory:
    return motion


ASKEW = rotations.to_matrix(rotations.from_vector([0.7, -0.4, 1.1]))
IN_PLANE = rotations.to_matrix(rotations.from_vector([0.0, 0.0, 0.8]))
NORMAL = np.array([0.6, 0.8, 0.0])


def _isometry(about: str, matrix: np.ndarray, shift: Sequence[float] = (0.0, 0.0, 0.0)) -> Relation:
    isometry = Isometry(matrix, np.array(shift))
    return Relation(about, isometry.change, isometry.expect)


RELATIONS = {
    "rotated": _isometry("about an axis askew, its motion rotates with it", ASKEW),
    "turned": _isometry("about z, its motion rotates with it", IN_PLANE),
    "translated": _isometry("its motion moves with it", np.eye(3), (0.3, -0.5, 0.0)),
    "mirrored": _isometry("its motion is the mirror image", np.eye(3) - 2 * np.outer(NORMAL, NORMAL)),
    "scaled": Relation("masses and loads times 2.5, the motion stays", lambda s: scaled(s, 2.5), _same),
    "reordered": Relation("bodies and joints listed in reverse, the motion stays", reordered, _same),
}
