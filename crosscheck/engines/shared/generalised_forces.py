"""Gravity, loads and gyroscopic moments of a scene as generalised forces in (v, ω') coordinates.

Arrays may have leading shape (…); vectors are columns, as in the constraints' Frames.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crosscheck.engines.shared.constraint_equations import Frames
from crosscheck.engines.shared.geometry import in_body, joint_frame, point_in_body
from crosscheck.engines.shared.spring_force import spring_force
from crosscheck.judge.constraints import inertia_matrices
from mbref.rotations import cross
from mbref.scene import Force, Moment, Scene, Spring, TorsionSpring


class Forces:
    """Forces of a scene on its bodies, and the mass matrix; without masses all masses are 1 and there are no
    forces.

    The angle of a torsion spring counts turns: it is the angle nearest to an estimate of the caller.
    ``turning`` returns the rate of the angle.
    """

    def __init__(self, scene: Scene):
        self.scene, self.nb = scene, len(scene.body)
        weighed = scene.has_mass()
        mass = np.array([body.mass for body in scene.body]) if weighed else np.ones(self.nb)
        self.inertia = inertia_matrices(scene) if weighed else np.array([np.eye(3)] * self.nb)
        self.weight = (
            np.outer(mass, np.array(scene.gravity))[..., None] if weighed else np.zeros((self.nb, 3, 1))
        )
        self.mass = np.zeros((6 * self.nb, 6 * self.nb))
        for b in range(self.nb):
            self.mass[6 * b : 6 * b + 3, 6 * b : 6 * b + 3] = mass[b] * np.eye(3)
            self.mass[6 * b + 3 : 6 * b + 6, 6 * b + 3 : 6 * b + 6] = self.inertia[b]
        loads = scene.load if weighed else ()
        self.moments = [
            (scene.body_index(x.body), np.array(x.moment)[:, None]) for x in loads if isinstance(x, Moment)
        ]
        self.pulls = [
            (self._end(x.body, x.point), np.array(x.force)[:, None]) for x in loads if isinstance(x, Force)
        ]
        self.springs = [
            (x, [self._end(*end) for end in zip(x.bodies, x.points, strict=True)])
            for x in loads
            if isinstance(x, Spring)
        ]
        self.twists = [(x, *self._hinge(x.joint)) for x in loads if isinstance(x, TorsionSpring)]

    def _end(self, name: str, point: Sequence[float]) -> tuple[int, np.ndarray]:
        place = point_in_body(self.scene, name, np.array(point))
        return self.scene.body_index(name), place[:, None]

    def _hinge(self, name: str) -> tuple[tuple[int, ...], list[np.ndarray]]:
        """Return the bodies of a joint, and the axes (3, 3, columns) of the joint's frame on each body."""
        joint = self.scene.joint_named(name)
        frame = joint_frame(joint.directions[0]).T
        axes = [in_body(self.scene, body, frame).T for body in joint.bodies]
        return tuple(self.scene.body_index(body) for body in joint.bodies), axes

    def __call__(self, f: Frames, omega: np.ndarray, angles: np.ndarray) -> np.ndarray:
        """Return generalised forces (…, 6 nb) for angular velocities ``omega`` (…, nb, 3) in body axes and
        estimated ``angles`` (…, springs) of the torsion springs."""
        total = np.zeros((*f.r.shape[:-3], self.nb + 1, 6, 1))
        total[..., : self.nb, :3, :] += self.weight
        momentum = np.einsum("bij,...bj->...bi", self.inertia, omega)
        total[..., : self.nb, 3:, 0] -= cross(omega, momentum)
        for body, moment in self.moments:
            total[..., body, 3:, :] += _to_body(f, body, moment)
        for end, force in self.pulls:
            _pull(f, end, force, total)
        for spring, ends in self.springs:
            force = _tension(f, spring, ends)
            _pull(f, ends[0], force, total)
            _pull(f, ends[1], -force, total)
        for k, (load, bodies, axes) in enumerate(self.twists):
            angle = _near(self.angle(f, k), angles[..., k])
            back = load.stiffness * (angle - load.natural_angle) + load.damping * self.turning(f)[..., k]
            for body, axis, sign in zip(bodies, axes, (1, -1), strict=True):
                total[..., body, 3:, 0] += sign * back[..., None] * axis[:, 2]
        return total[..., : self.nb, :, 0].reshape(*total.shape[:-3], 6 * self.nb)

    def angle(self, f: Frames, k: int) -> np.ndarray:
        """Return the angle (…,) of the joint of torsion spring k, up to full turns."""
        _, (i, j), (on_i, on_j) = self.twists[k]
        turned = np.swapaxes(f.a[..., i, :, :] @ on_i, -1, -2) @ f.a[..., j, :, :] @ on_j
        return np.arctan2(turned[..., 1, 0], turned[..., 0, 0])

    def turning(self, f: Frames) -> np.ndarray:
        """Return the rates (…, springs) of the angles."""
        rates = np.zeros((*f.r.shape[:-3], len(self.twists)))
        for k, (_, (i, j), (on_i, _)) in enumerate(self.twists):
            axis = f.a[..., i, :, :] @ on_i
            change = f.a1[..., j, :, :] @ np.swapaxes(f.a[..., j, :, :], -1, -2)
            change = change - f.a1[..., i, :, :] @ np.swapaxes(f.a[..., i, :, :], -1, -2)
            seen = np.swapaxes(axis, -1, -2) @ change @ axis
            rates[..., k] = seen[..., 1, 0]
        return rates


def _near(angle: np.ndarray, estimate: np.ndarray) -> np.ndarray:
    """Return the angle (…,), known up to full turns, that is nearest to the estimate."""
    return angle + 2 * np.pi * np.round((estimate - angle) / (2 * np.pi))


def _to_body(f: Frames, body: int, vector: np.ndarray) -> np.ndarray:
    return np.swapaxes(f.a[..., body, :, :], -1, -2) @ vector


def _pull(f: Frames, end: tuple[int, np.ndarray], force: np.ndarray, total: np.ndarray) -> None:
    """Add a world force (…, 3, 1) at a body-fixed point."""
    body, place = end
    local = _to_body(f, body, force)
    total[..., body, :3, :] += force
    total[..., body, 3:, 0] += cross(place[:, 0], local[..., 0])


def _tension(f: Frames, spring: Spring, ends: list[tuple[int, np.ndarray]]) -> np.ndarray:
    """Return the world force (…, 3, 1) of a spring on its first body."""
    p, q = (f.r[..., b, :, :] + f.a[..., b, :, :] @ s for b, s in ends)
    u, v = (f.v[..., b, :, :] + f.a1[..., b, :, :] @ s for b, s in ends)
    return spring_force(spring, (q - p)[..., 0], (v - u)[..., 0])[..., None]
