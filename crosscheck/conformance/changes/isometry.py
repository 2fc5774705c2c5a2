"""Scenes moved as a whole: rotated, translated or mirrored; their motions are moved, too."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from crosscheck.conformance.changes.copies import mapped
from crosscheck.conformance.changes.units import times, with_coordinates_times
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import Coupling, Joint, JointLoad, Scene

Mapped = Callable[[Any], Any]
# reflects the body frames of a mirrored scene, so that they stay right-handed
FLIP = np.diag([1.0, -1.0, 1.0])
# rotation about a skew axis
ASKEW = rotations.to_matrix(rotations.from_vector(np.array([0.7, -0.4, 1.1])))


@dataclass(frozen=True)
class Isometry:
    """Map x → matrix x + shift: a rotation, a translation, or, with determinant -1, a mirror image."""

    matrix: np.ndarray  # (3, 3) orthogonal
    shift: np.ndarray  # (3,) m

    def place(self, point: Any) -> Any:
        """Return the images of points (…, 3)."""
        return np.asarray(point) @ self.matrix.T + self.shift

    def polar(self, vector: Any) -> Any:
        """Return the images of polar vectors (…, 3): velocities and forces."""
        return np.asarray(vector) @ self.matrix.T

    def axial(self, vector: Any) -> Any:
        """Return the images of axial vectors (…, 3): angular velocities, moments and axes of rotation.

        A mirror keeps their component normal to its plane.
        """
        return np.linalg.det(self.matrix) * self.polar(vector)

    def turn(self, orientation: Any) -> np.ndarray:
        """Return the images of orientations, unit quaternions (…, 4)."""
        return rotations.from_matrix(self.matrix @ rotations.to_matrix(orientation) @ self._body())

    def inertia(self, value: Any) -> Any:
        """Return the image of an inertia: principal moments, or a matrix in body axes."""
        array = np.asarray(value)
        return array if array.ndim == 1 else self._body() @ array @ self._body()

    def _body(self) -> np.ndarray:
        return np.eye(3) if np.linalg.det(self.matrix) > 0 else FLIP

    def change(self, scene: Scene) -> Scene:
        """Return the scene moved as a whole, including gravity and loads."""
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
        # this axis belongs to a displacement and is a polar vector, axes of rotations are axial
        along: dict[str | None, Callable[[Any], Any]] = {"displacement": self.polar}
        joints = [
            mapped(joint, {**fields, "axis": along.get(joint.facts.driven, self.axial)})
            for joint in scene.joint
        ]
        return scene.with_(
            gravity=self.polar(scene.gravity),
            body=tuple(mapped(body, fields) for body in scene.body),
            joint=tuple(joints),
            coupling=tuple(self._coupled(scene, coupling) for coupling in scene.coupling),
            load=tuple(self._load(scene, load, fields) for load in scene.load),
        )

    def _load(self, scene: Scene, load: Any, fields: Mapping[str, Mapped]) -> Any:
        """Return the load moved as a whole; a mirror reverses displacements along an axis of rotation."""
        if not isinstance(load, JointLoad):
            return mapped(load, fields)
        turned = times(self._sign(scene.joint_named(load.joint), load.coordinate))
        return mapped(load, dict.fromkeys(("force", "natural_displacement"), turned))

    def _coupled(self, scene: Scene, coupling: Coupling) -> Coupling:
        return with_coordinates_times(coupling, [self._sign(*end) for end in scene.coupled(coupling)])

    def _sign(self, joint: Joint, coordinate: str) -> float:
        """Return -1 for a displacement along an axis of rotation that a mirror reverses, otherwise 1."""
        is_reversed = joint.facts.driven != coordinate and np.linalg.det(self.matrix) < 0
        return -1.0 if is_reversed else 1.0

    def expect(self, motion: Trajectory) -> Trajectory:
        """Return the motion moved as a whole, including accelerations and reactions."""
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
    """Return the motion ``to`` with accelerations and reactions of another motion, mapped by functions; None
    in place of arrays that the other motion lacks."""
    return replace(
        to,
        acceleration=None if motion.acceleration is None else linear(motion.acceleration),
        angular_acceleration=(
            None if motion.angular_acceleration is None else angular(motion.angular_acceleration)
        ),
        reactions=motion.reactions
        and {name: np.hstack([force(w[:, :3]), moment(w[:, 3:])]) for name, w in motion.reactions.items()},
    )
