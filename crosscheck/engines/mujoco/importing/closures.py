"""Closures of loops between frames of two bodies: their residuals and Jacobians, and the joints of the
scene."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.engines.mujoco.importing.groups import Groups
from crosscheck.engines.shared.entries import entry
from mbref import rotations
from mbref.scene import Cylindrical, Fixed, Joint, Revolute, SceneError, Spherical, Translational

TYPES: dict[str, Any] = {
    "spherical": Spherical,
    "ball": Spherical,
    "fixed": Fixed,
    "revolute": Revolute,
    "continuous": Revolute,
    "prismatic": Translational,
    "translational": Translational,
    "cylindrical": Cylindrical,
}


@dataclass(frozen=True)
class Frame:
    """A frame fixed in MuJoCo's body: origin (3,) and axes (3, 3) in the body's frame."""

    body: int
    origin: np.ndarray
    axes: np.ndarray

    def place(self, data: Any) -> np.ndarray:
        """Return the world position (3,) of the origin."""
        return np.asarray(data.xpos[self.body] + data.xmat[self.body].reshape(3, 3) @ self.origin)

    def turn(self, data: Any) -> np.ndarray:
        """Return the world axes (3, 3) as columns."""
        return np.asarray(data.xmat[self.body].reshape(3, 3) @ self.axes)


@dataclass(frozen=True)
class Closure:
    """A joint that closes a loop: its type, and a frame on each body with z along the axis."""

    name: str
    type: type[Any]
    frames: tuple[Frame, Frame]

    def gap(self, data: Any) -> np.ndarray:
        """Return residuals (rows,) at a pose: m along the first frame's axes, then rad."""
        first, second = self.frames
        turn = first.turn(data)
        apart = turn.T @ (second.place(data) - first.place(data))
        twist = _rotation_vector(turn.T @ second.turn(data))
        return np.concatenate([apart[self._lengths], twist[self._angles]])

    def opening(self, data: Any) -> float:
        """Return the gap's distance (m) or its angle (rad), whichever number is larger."""
        distance, angle = np.split(self.gap(data), [len(self._lengths)])
        return float(max(np.linalg.norm(distance), np.linalg.norm(angle)))

    def rows(self, mujoco: Any, model: Any, data: Any) -> np.ndarray:
        """Return the Jacobian (rows, nv) of the residuals at a closed pose."""
        first, second = self.frames
        turn, found = first.turn(data), np.zeros((2, 6, model.nv))
        for frame, jacobian in zip(self.frames, found, strict=True):
            mujoco.mj_jac(model, data, jacobian[:3], jacobian[3:], second.place(data), frame.body)
        apart = turn.T @ (found[1, :3] - found[0, :3])
        twist = turn.T @ (found[1, 3:] - found[0, 3:])
        return np.concatenate([apart[self._lengths], twist[self._angles]])

    @property
    def are_lengths(self) -> np.ndarray:
        """Whether each residual (rows,) is a length."""
        return np.repeat([True, False], [len(self._lengths), len(self._angles)])

    @property
    def _lengths(self) -> list[int]:
        return list(self.type.facts.forbidden_translations)

    @property
    def _angles(self) -> list[int]:
        return list(self.type.facts.forbidden_rotations)

    def joint(self, data: Any, groups: Groups) -> Joint:
        """Return the scene's joint at a closed pose; raises SceneError if both sides are on one body."""
        first, second = (groups.name_of(frame.body) for frame in self.frames)
        if first == second:
            raise SceneError([f"closure {self.name!r}: both sides are on {first!r}, or fixed to it"])
        at, axis = self.frames[1].place(data).tolist(), self.frames[0].turn(data)[:, 2].tolist()
        where = f"closure {self.name!r}"
        made: Joint = entry(where, self.type.at, self.name, (first, second), anchor=at, axis=axis)
        return made


def of_equalities(mujoco: Any, model: Any) -> Iterator[Closure]:
    """Return the active connect and weld equalities, each with the frames that MuJoCo keeps together.

    A weld whose torquescale is zero constrains no rotation: it is a spherical joint.
    """
    for e in range(model.neq):
        name = model.equality(e).name or f"equality {e}"
        if not model.eq_active0[e]:
            continue
        if model.eq_type[e] == mujoco.mjtEq.mjEQ_CONNECT:
            yield Closure(name, Spherical, _ends(mujoco, model, e))
        elif model.eq_type[e] == mujoco.mjtEq.mjEQ_WELD:
            yield Closure(name, Fixed if model.eq_data[e, 10] else Spherical, _ends(mujoco, model, e))


def _ends(mujoco: Any, model: Any, e: int) -> tuple[Frame, Frame]:
    first, second = int(model.eq_obj1id[e]), int(model.eq_obj2id[e])
    if model.eq_objtype[e] == mujoco.mjtObj.mjOBJ_SITE:
        return of_site(model, first), of_site(model, second)
    data = model.eq_data[e]
    if model.eq_type[e] == mujoco.mjtEq.mjEQ_CONNECT:
        return Frame(first, data[0:3].copy(), np.eye(3)), Frame(second, data[3:6].copy(), np.eye(3))
    relative = rotations.to_matrix(data[6:10] / np.linalg.norm(data[6:10]))
    # pose of the second body's frame in the first body's frame, at the second body's anchor
    anchor = data[0:3].copy()
    return Frame(first, data[3:6].copy(), relative), Frame(second, anchor, np.eye(3))


def of_site(model: Any, s: int) -> Frame:
    """Return the frame of a site."""
    return Frame(int(model.site_bodyid[s]), model.site_pos[s].copy(), rotations.to_matrix(model.site_quat[s]))


def _rotation_vector(matrix: np.ndarray) -> np.ndarray:
    """Return the rotation vector (3,) of a rotation matrix, at most half a turn long."""
    q = rotations.from_matrix(matrix)  # with w ≥ 0
    sine = float(np.linalg.norm(q[1:]))
    return np.asarray(q[1:] * (2 * np.arctan2(sine, q[0]) / sine if sine > 0 else 2.0))
