"""A scene written again for other poses and velocities of its bodies, so that engines can start from them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from crosscheck.judge.loads import attachment
from mbref import rotations
from mbref.scene import Joint, JointLoad, Scene

Vector = tuple[float, ...]


class Carried:
    """Points and directions of bodies at new positions (nb, 3) and orientations (nb, 4)."""

    def __init__(self, scene: Scene, position: np.ndarray, orientation: np.ndarray):
        self.scene, self.position, self.orientation = scene, position, orientation

    def point(self, body: str, point: Sequence[float]) -> Vector:
        """Return the new world position of a point that is given in the world at t = 0."""
        b, local = attachment(self.scene, body, point)
        if b < 0:
            return tuple(local.tolist())
        return tuple((self.position[b] + rotations.rotate(self.orientation[b], local)).tolist())

    def direction(self, body: str, axis: Sequence[float]) -> Vector:
        """Return the new world direction of a body-fixed direction."""
        b = self.scene.body_index(body)
        if b < 0:
            return tuple(axis)
        back = rotations.conjugate(np.array(self.scene.body[b].orientation))
        return tuple(rotations.rotate(self.orientation[b], rotations.rotate(back, np.array(axis))).tolist())


def posed(
    scene: Scene,
    position: np.ndarray,
    orientation: np.ndarray,
    twists: np.ndarray,
    coordinates: dict[tuple[str, str], float],
) -> Scene:
    """Return the scene with its bodies at new poses and with twists (nb, 6), world.

    Anchors, axes and points of loads move with the bodies. ``coordinates`` are the coordinates (kind, joint)
    on which springs of joints act, at the new pose: natural values count from it.
    """
    carried = Carried(scene, position, orientation)
    bodies = [
        body.model_copy(
            update={
                "position": tuple(r.tolist()),
                "orientation": tuple(p.tolist()),
                "velocity": tuple(x[:3].tolist()),
                "angular_velocity": tuple(x[3:].tolist()),
            }
        )
        for body, r, p, x in zip(scene.body, position, orientation, twists, strict=True)
    ]
    joints = [joint.model_copy(update=_geometry(carried, joint)) for joint in scene.joint]
    loads = [load.model_copy(update=_load(carried, load, coordinates)) for load in scene.load]
    return scene.with_(body=bodies, joint=joints, load=loads)


def _geometry(carried: Carried, joint: Joint) -> dict[str, Any]:
    """Return the geometric fields of a joint: the second body carries its anchor, the first its axis."""
    ends = tuple(carried.point(*end) for end in zip(joint.bodies, joint.anchor_pair, strict=True))
    axes = tuple(carried.direction(*end) for end in zip(joint.bodies, joint.directions * 2, strict=False))
    every = {"anchor": ends[1], "anchors": ends, "axis": axes[:1] and axes[0], "axes": axes}
    return {key: value for key, value in every.items() if key in type(joint).model_fields}


def _load(carried: Carried, load: Any, coordinates: dict[tuple[str, str], float]) -> dict[str, Any]:
    if load.type == "force":
        return {"point": carried.point(load.body, load.point)}
    if load.type == "point_damper":
        return {"point": carried.point(load.bodies[1], load.point)}
    if load.type == "spring":
        ends = zip(load.bodies, load.points, strict=True)
        return {"points": tuple(carried.point(*end) for end in ends)}
    if isinstance(load, JointLoad) and load.action.stiffness:
        field = f"natural_{load.coordinate}"
        return {field: load.action.natural - coordinates[load.coordinate, load.joint]}
    return {}
