"""Metamorphic relations: a change of a scene changes its motion in a known way, even if the motion itself is
unknown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from crosscheck.conformance.changes.copies import Outside, mapped
from crosscheck.conformance.changes.isometry import ASKEW, Isometry, with_pushes
from crosscheck.conformance.changes.replays import RESTARTED, REVERSED, joints_kept, pinned, replayed
from crosscheck.conformance.changes.rewritings import (
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
from crosscheck.conformance.changes.units import in_other_units, scaled, times
from crosscheck.judge.tolerances import ROUNDING
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

HEAVIER = 2.5


@dataclass(frozen=True)
class Relation:
    """A relation: ``about`` describes it, ``change(scene, motion)`` returns the changed scene, or the reason
    why the scene cannot be changed.

    ``expect(scene, motion)`` returns the expected motion of the changed scene, computed from the motion of
    the first scene.
    """

    about: str
    change: Callable[[Scene, Trajectory], Scene | Outside]
    expect: Callable[[Scene, Trajectory], Trajectory]


def reordered(scene: Scene) -> Scene:
    """Return the scene with bodies, joints and loads in reverse order; its motion is unchanged."""
    return scene.with_(body=scene.body[::-1], joint=scene.joint[::-1], load=scene.load[::-1])


def shaken(scene: Scene, seed: int) -> Scene:
    """Return the scene with random changes by rounding of every position (m) and direction."""
    random = np.random.default_rng(seed)

    def shake(value: Any) -> np.ndarray:
        return np.asarray(value) + ROUNDING * random.standard_normal(np.shape(value))

    fields = dict.fromkeys(("position", "orientation", "anchor", "anchors", "axis", "axes"), shake)
    return scene.with_(
        body=tuple(mapped(body, fields) for body in scene.body),
        joint=tuple(mapped(joint, fields) for joint in scene.joint),
    )


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
    """Return the motion itself, for changes that leave it unchanged."""
    return motion


def heavier(scene: Scene, motion: Trajectory) -> Trajectory:
    """Return the motion with reactions multiplied by HEAVIER."""
    return with_pushes(motion, motion, times(1), times(1), times(HEAVIER), times(HEAVIER))


def opposite(scene: Scene, motion: Trajectory) -> Trajectory:
    """Return the motion with reactions reversed, for joints whose two anchors stay together."""
    kept = joints_kept(motion, pinned(scene))
    return with_pushes(kept, kept, times(1), times(1), times(-1), times(-1))


def undriven(scene: Scene, motion: Trajectory) -> Trajectory:
    """Return the motion without the reactions of driven joints."""
    driven = [driver.joint for driver in scene.driver]
    return joints_kept(motion, [joint.name for joint in scene.joint if joint.name not in driven])


IN_PLANE = rotations.to_matrix(rotations.from_vector(np.array([0.0, 0.0, 0.8])))
NORMAL = np.array([0.6, 0.8, 0.0])


def _isometry(about: str, matrix: np.ndarray, shift: Sequence[float] = (0.0, 0.0, 0.0)) -> Relation:
    isometry = Isometry(matrix, np.array(shift))
    return Relation(about, lambda scene, _: isometry.change(scene), lambda _, motion: isometry.expect(motion))


def unchanged(about: str, change: Callable[[Scene], Scene | Outside]) -> Relation:
    """Return the relation of a change that leaves the motion unchanged."""
    return Relation(about, lambda scene, motion: change(scene), same)


RELATIONS = {
    "rotated": _isometry("rotated about a skew axis, the motion rotates too", ASKEW),
    "turned": _isometry("rotated about z, the motion rotates too", IN_PLANE),
    "translated": _isometry("translated, the motion is translated too", np.eye(3), (0.3, -0.5, 0.0)),
    "mirrored": _isometry("mirrored, the motion is mirrored too", np.eye(3) - 2 * np.outer(NORMAL, NORMAL)),
    "scaled": Relation(
        "with masses and loads times 2.5, the motion is unchanged", lambda s, _: scaled(s, HEAVIER), heavier
    ),
    "reordered": unchanged("with bodies and joints in reverse order, the motion is unchanged", reordered),
    "relabelled": Relation("with other names, the motion is unchanged", lambda s, _: relabelled(s), renamed),
    "swapped": Relation(
        "with the bodies of every joint exchanged, the motion is unchanged", lambda s, _: swapped(s), opposite
    ),
    "stretched": unchanged("with axis vectors 1000 times as long, the motion is unchanged", stretched),
    "duplicated": unchanged("with a duplicate joint, the motion is unchanged", duplicated),
    "satisfied": unchanged(
        "with a joint that the motion satisfies anyway, the motion is unchanged", satisfied
    ),
    "split": Relation(
        "with a body as two welded halves, the motion is unchanged", lambda s, _: split(s), of_halves
    ),
    "negated": unchanged("with the other sign of every quaternion, the motion is unchanged", negated),
    "enlarged": _other_units("four times as large, the motion is twice as slow (Froude)", 4.0, 2.0),
    "in millimetres": _other_units("with its lengths in millimetres, the motion is unchanged", 1000.0, 1.0),
    "restarted": Relation("restarted from its state half way, the motion is continued", *RESTARTED),
    "reversed": Relation(
        "started from the last state with reversed velocities, the motion runs backwards", *REVERSED
    ),
    "replayed": Relation(
        "with the driver replaced by its moment, the motion is unchanged", replayed, undriven
    ),
}
