"""A scene rewritten for other poses of its bodies."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from mbref import rotations
from mbref.equations.joint_angles import angles_by_joint, angles_of_pose
from mbref.equations.model import Model
from mbref.scene import Driver, Joint, Load, Scene, SlideSpring, TorsionSpring, Turn
from mbref.scene.joints import DISPLACEMENT, Coordinate
from mbref.scene.rolling import RollingLine, RollingWheel


def placed(model: Model, q: np.ndarray) -> Scene:
    """Return the model's scene with its bodies at coordinates q (7 nb,); joints and points of loads move with
    the bodies.

    A joint's anchor is read from the second body, its axis from the first body; of a wheel, its axis from the
    second body.
    """
    scene, zeros = model.scene, np.zeros((1, model.nb, 6))
    motion = model.motion(q.reshape(1, model.nb, 7), zeros, zeros)
    bodies = [
        body.model_copy(update={"position": _rounded(r, model.length), "orientation": tuple(p.tolist())})
        for body, r, p in zip(scene.body, motion["position"][0], motion["orientation"][0], strict=True)
    ]
    joints = [joint.model_copy(update=_moved_geometry(model, joint, q)) for joint in scene.joint]
    loads = [load.model_copy(update=_moved_points(model, load, q)) for load in scene.load]
    drivers = [driver.model_copy(update={"turn": _carried(model, driver, q)}) for driver in scene.driver]
    return scene.with_(body=bodies, joint=joints, load=loads, driver=drivers)


def placed_with_springs(model: Model, q: np.ndarray, angles: Mapping[str, float] | None = None) -> Scene:
    """Return ``placed`` with springs of joints as long or as twisted as before: their natural angles and
    displacements, and polynomials of couplings, count from the new poses.

    ``angles`` (rad) of joints, by name, may be more than half a turn.
    """
    found, turned = placed(model, q), angles or {}
    loads = tuple(_with_natural_value(model, q, load, turned) for load in found.load)
    couplings = tuple(
        each
        if each.powers == 1
        else each.from_pose(_coordinate(model, q, *model.scene.coupled(each)[0], turned))
        for each in found.coupling
    )
    if loads == found.load and couplings == found.coupling:
        return found
    return found.with_(load=loads, coupling=couplings)


def _with_natural_value(model: Model, q: np.ndarray, load: Load, turned: Mapping[str, float]) -> Load:
    """Return a load whose natural angle or displacement counts from the pose q of the model."""
    if not isinstance(load, TorsionSpring | SlideSpring):
        return load
    moved = _coordinate(model, q, model.scene.joint_named(load.joint), load.coordinate, turned)
    return load.model_copy(update={f"natural_{load.coordinate}": load.action.natural - moved})


def _coordinate(
    model: Model, q: np.ndarray, joint: Joint, coordinate: Coordinate, turned: Mapping[str, float]
) -> float:
    """Return the displacement (m) or the angle (rad) of a joint at q, by default within half a turn."""
    if coordinate == DISPLACEMENT:
        return _displacement(model, q, joint)
    if joint.name in turned:
        return turned[joint.name]
    return float(angles_by_joint(model.scene, model.structure, angles_of_pose(model, q)[None])[joint.name][0])


def _displacement(model: Model, q: np.ndarray, joint: Joint) -> float:
    """Return (r₂ - r₁)·axis, m, of the anchors and the axis that the first body carries, at q."""
    first, second = (_point(model, *end, q) for end in zip(joint.bodies, joint.anchor_pair, strict=True))
    axis = rotations.unit(_direction(model, joint.bodies[0], joint.directions[0], q))
    return float((second - first) @ axis)


def _moved_geometry(model: Model, joint: Joint, q: np.ndarray) -> dict[str, Any]:
    """Return the geometric fields of a joint at coordinates q."""
    ends = [*zip(joint.bodies, joint.anchor_pair, strict=True)]
    carried = zip(joint.bodies, joint.directions * 2, strict=False)
    axes = tuple(_rounded(_direction(model, *each, q)) for each in carried)
    found: dict[str, Any] = {"axis": axes[:1] and axes[0], "axes": axes}
    if isinstance(joint, RollingWheel):
        found |= {"normal": axes[0], "axis": axes[1]}
    if isinstance(joint, RollingLine):
        found["along"] = _rounded(_direction(model, joint.bodies[0], joint.along, q))
    if "anchors" in type(joint).model_fields:
        found["anchors"] = tuple(place(model, *end, q) for end in ends)
    else:
        found["anchor"] = place(model, *ends[1], q)
    return {key: value for key, value in found.items() if key in type(joint).model_fields}


def _carried(model: Model, driver: Driver, q: np.ndarray) -> tuple[Turn, ...]:
    """Return the turns of a driver about axes that the first body of its joint carries to coordinates q."""
    first = model.scene.joint_named(driver.joint).bodies[0]
    axes = [_rounded(_direction(model, first, turn.axis, q)) for turn in driver.turn]
    return tuple(turn.model_copy(update={"axis": axis}) for turn, axis in zip(driver.turn, axes, strict=True))


def _moved_points(model: Model, load: Any, q: np.ndarray) -> dict[str, Any]:
    if load.type == "force":
        return {"point": place(model, load.body, load.point, q)}
    if load.type == "point_damper":
        return {"point": place(model, load.bodies[1], load.point, q)}
    if load.type == "spring":
        ends = zip(load.bodies, load.points, strict=True)
        return {"points": tuple(place(model, *end, q) for end in ends)}
    return {}


def place(model: Model, body: str, point: tuple[float, float, float], q: np.ndarray) -> tuple[float, ...]:
    """Return the world position at coordinates q of a body-fixed point (world, t = 0)."""
    return _rounded(_point(model, body, point, q), model.length)


def _point(model: Model, body: str, point: tuple[float, float, float], q: np.ndarray) -> np.ndarray:
    """Return ``place`` (3,) with all digits."""
    b, local = model.index(body), model.point(body, point)
    if b == model.nb:
        return local
    r, p = np.split(q.reshape(model.nb, 7)[b], [3])
    return np.asarray(r + rotations.rotate(p, local))


def _direction(model: Model, body: str, axis: tuple[float, float, float], q: np.ndarray) -> np.ndarray:
    """Return a body-fixed direction (world, t = 0) as a world vector (3,) at coordinates q."""
    b, local = model.index(body), model.direction(body, axis)
    return local if b == model.nb else np.asarray(rotations.rotate(q.reshape(model.nb, 7)[b, 3:], local))


def _rounded(vector: np.ndarray, size: float = 1.0) -> tuple[float, ...]:
    """Return three numbers in which rounding errors of zeros are zero, for numbers of a size."""
    return tuple((np.round(vector, 15 - round(math.log10(size))) + 0.0).tolist())
