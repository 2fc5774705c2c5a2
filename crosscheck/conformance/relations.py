"""Metamorphic relations: a scene changed so that its motion, known or not, changes in a known way."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from crosscheck.conformance.changes import mapped, replaced
from crosscheck.conformance.replays import RESTARTED, REVERSED, joints_kept, pinned, replayed
from crosscheck.conformance.rewritings import (
    duplicated,
    negated,
    of_halves,
    relabelled,
    renamed,
    satisfied,
    split,
    stretched,
    swapped,
)
from crosscheck.conformance.trial import Outside
from crosscheck.judge.tolerances import ROUNDING
from mbref import rotations
from mbref.scene import Driver, Scene
from mbref.trajectory import Trajectory

Mapped = Callable[[Any], Any]
HEAVIER = 2.5
FLIP = np.diag([1.0, -1.0, 1.0])  # reflection of body frames in a mirrored scene; keeps them right-handed


@dataclass(frozen=True)
class Relation:
    """``about`` says it; ``change(scene, motion)`` is another scene, or the reason why there is none, and
    ``expect(scene, motion)`` the other scene's motion, made of the motion of the first."""

    about: str
    change: Callable[[Scene, Trajectory], Scene | Outside]
    expect: Callable[[Scene, Trajectory], Trajectory]


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
            "position": self.place,
            "anchor": self.place,
            "anchors": self.place,
            "point": self.place,
            "points": self.place,
            "velocity": self.polar,
            "force": self.polar,
            "axes": self.axial,
            "angular_velocity": self.axial,
            "moment": self.axial,
            "inertia": self.inertia,
            "orientation": self.turn,
        }
        # the axis of a driven displacement; others are of rotations
        along: dict[str | None, Callable[[Any], Any]] = {"displacement": self.polar}
        joints = [
            mapped(joint, {**fields, "axis": along.get(joint.facts.driven, self.axial)})
            for joint in scene.joint
        ]
        return scene.with_(
            gravity=self.polar(scene.gravity),
            body=tuple(mapped(body, fields) for body in scene.body),
            joint=tuple(joints),
            load=tuple(mapped(load, fields) for load in scene.load),
        )

    def expect(self, motion: Trajectory) -> Trajectory:
        """The motion moved as a whole, accelerations and reactions too."""
        moved = replace(
            motion,
            position=self.place(motion.position),
            orientation=self.turn(motion.orientation),
            velocity=self.polar(motion.velocity),
            angular_velocity=self.axial(motion.angular_velocity),
        )
        return with_pushes(moved, motion, self.polar, self.axial, self.polar, self.axial)


def with_pushes(
    to: Trajectory, motion: Trajectory, linear: Mapped, angular: Mapped, force: Mapped, moment: Mapped
) -> Trajectory:
    """A motion with another's accelerations and reactions, mapped; None where that has none."""
    return replace(
        to,
        acceleration=None if motion.acceleration is None else linear(motion.acceleration),
        angular_acceleration=(
            None if motion.angular_acceleration is None else angular(motion.angular_acceleration)
        ),
        reactions=motion.reactions
        and {name: np.hstack([force(w[:, :3]), moment(w[:, 3:])]) for name, w in motion.reactions.items()},
    )


def times(factor: float) -> Mapped:
    """Multiplication."""
    return lambda value: factor * np.asarray(value)


def scaled(scene: Scene, factor: float) -> Scene:
    """Masses, inertias, forces, stiffnesses and dampings times a factor: the motion stays the same."""

    fields = dict.fromkeys(("mass", "inertia", "force", "moment", "stiffness", "damping"), times(factor))
    return scene.with_(
        body=tuple(mapped(body, fields) for body in scene.body),
        load=tuple(mapped(load, fields) for load in scene.load),
    )


def reordered(scene: Scene) -> Scene:
    """Bodies, joints and loads listed in reverse: the motion stays the same."""
    return scene.with_(body=scene.body[::-1], joint=scene.joint[::-1], load=scene.load[::-1])


def shaken(scene: Scene, seed: int) -> Scene:
    """Every place (m) and direction of a scene is off by rounding, at random."""
    random = np.random.default_rng(seed)

    def shake(value: Any) -> np.ndarray:
        return np.asarray(value) + ROUNDING * random.standard_normal(np.shape(value))

    fields = dict.fromkeys(("position", "orientation", "anchor", "anchors", "axis", "axes"), shake)
    return scene.with_(
        body=tuple(mapped(body, fields) for body in scene.body),
        joint=tuple(mapped(joint, fields) for joint in scene.joint),
    )


def in_other_units(scene: Scene, length: float, time: float) -> Scene:
    """The scene with its lengths and times multiplied, and all else as its units say; masses stay."""
    speed, push = length / time, length / time**2

    places = dict.fromkeys(
        ("position", "anchor", "anchors", "point", "points", "natural_length"), times(length)
    )
    bodies = {
        **places,
        "velocity": times(speed),
        "angular_velocity": times(1 / time),
        "inertia": times(length**2),
    }
    loads = {**places, "force": times(push), "moment": times(length * push)}
    linear = {"stiffness": times(1 / time**2), "damping": times(1 / time)}
    turning = {"stiffness": times(length * push), "damping": times(length * speed)}
    slides = {joint.name for joint in scene.joint if joint.facts.driven == "displacement"}
    return scene.with_(
        gravity=times(push)(scene.gravity).tolist(),
        duration=scene.duration * time,
        body=tuple(mapped(body, bodies) for body in scene.body),
        joint=tuple(mapped(joint, places) for joint in scene.joint),
        driver=tuple(_slower(d, length if d.joint in slides else 1.0, time) for d in scene.driver),
        load=tuple(mapped(x, {**loads, **(linear if x.type == "spring" else turning)}) for x in scene.load),
    )


def _slower(driver: Driver, amount: float, time: float) -> Driver:
    polynomial = tuple(amount * c / time**k for k, c in enumerate(driver.polynomial))
    wave = driver.sine and replaced(
        driver.sine, amplitude=amount * driver.sine.amplitude, frequency=driver.sine.frequency / time
    )
    return replaced(driver, polynomial=polynomial, sine=wave)


def _other_units(about: str, length: float, time: float) -> Relation:
    def expect(scene: Scene, motion: Trajectory) -> Trajectory:
        push = length / time**2
        moved = replace(
            motion,
            times=time * motion.times,
            position=length * motion.position,
            velocity=length / time * motion.velocity,
            angular_velocity=motion.angular_velocity / time,
        )
        turning = times(1 / time**2), times(push), times(length * push)
        return with_pushes(moved, motion, times(push), *turning)

    return Relation(about, lambda scene, motion: in_other_units(scene, length, time), expect)


def same(scene: Scene, motion: Trajectory) -> Trajectory:
    """The motion itself, of a change that leaves it what it is."""
    return motion


def heavier(scene: Scene, motion: Trajectory) -> Trajectory:
    """The motion with reactions times HEAVIER."""
    return with_pushes(motion, motion, times(1), times(1), times(HEAVIER), times(HEAVIER))


def opposite(scene: Scene, motion: Trajectory) -> Trajectory:
    """The motion with reactions reversed, of joints whose anchors stay together."""
    kept = joints_kept(motion, pinned(scene))
    return with_pushes(kept, kept, times(1), times(1), times(-1), times(-1))


def undriven(scene: Scene, motion: Trajectory) -> Trajectory:
    """The motion without the reactions of driven joints."""
    driven = [driver.joint for driver in scene.driver]
    return joints_kept(motion, [joint.name for joint in scene.joint if joint.name not in driven])


ASKEW = rotations.to_matrix(rotations.from_vector(np.array([0.7, -0.4, 1.1])))
IN_PLANE = rotations.to_matrix(rotations.from_vector(np.array([0.0, 0.0, 0.8])))
NORMAL = np.array([0.6, 0.8, 0.0])


def _isometry(about: str, matrix: np.ndarray, shift: Sequence[float] = (0.0, 0.0, 0.0)) -> Relation:
    isometry = Isometry(matrix, np.array(shift))
    return Relation(about, lambda scene, _: isometry.change(scene), lambda _, motion: isometry.expect(motion))


def unchanged(about: str, change: Callable[[Scene], Scene | Outside]) -> Relation:
    """The relation of a change that leaves the motion unchanged."""
    return Relation(about, lambda scene, motion: change(scene), same)


RELATIONS = {
    "rotated": _isometry("rotated about a skew axis, the motion rotates too", ASKEW),
    "turned": _isometry("rotated about z, the motion rotates too", IN_PLANE),
    "translated": _isometry("translated, the motion is translated too", np.eye(3), (0.3, -0.5, 0.0)),
    "mirrored": _isometry("mirrored, the motion is mirrored too", np.eye(3) - 2 * np.outer(NORMAL, NORMAL)),
    "scaled": Relation(
        "with masses and loads times 2.5, the motion stays", lambda s, _: scaled(s, HEAVIER), heavier
    ),
    "reordered": unchanged("with bodies and joints in reverse order, the motion stays", reordered),
    "relabelled": Relation("with other names, the motion stays", lambda s, _: relabelled(s), renamed),
    "swapped": Relation(
        "with the bodies of every joint exchanged, the motion stays", lambda s, _: swapped(s), opposite
    ),
    "stretched": unchanged("with axis vectors 1000 times as long, the motion stays", stretched),
    "duplicated": unchanged("with a duplicate joint, the motion stays", duplicated),
    "satisfied": unchanged("with a joint that the motion satisfies anyway, the motion stays", satisfied),
    "split": Relation("with a body as two welded halves, the motion stays", lambda s, _: split(s), of_halves),
    "negated": unchanged("with the other sign of every quaternion, the motion stays", negated),
    "enlarged": _other_units("four times as large, the motion is twice as slow (Froude)", 4.0, 2.0),
    "in millimetres": _other_units("with its lengths in millimetres, the motion stays", 1000.0, 1.0),
    "restarted": Relation("restarted from its state half way, the motion is continued", *RESTARTED),
    "reversed": Relation(
        "started from the last state with reversed velocities, the motion runs backwards", *REVERSED
    ),
    "replayed": Relation("with the driver replaced by its moment, the motion stays", replayed, undriven),
}
