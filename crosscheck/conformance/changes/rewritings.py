"""Equivalent forms of a mechanism: other names, another order, a duplicated joint, a body split in two."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np

from crosscheck.conformance.changes.copies import Outside, mapped, replaced
from crosscheck.judge.constraints import initial_twists
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import GROUND, Body, Cylindrical, Fixed, Joint, Scene, SceneError

HALF = " half"  # suffix of the second half's name
LIMIT = 0.2  # part of the middle principal moment that is due to the distance of the halves; 0.5 is the most
UNCHANGED = 1e-12  # fraction of the largest velocity: a smaller change is rounding


def relabelled(scene: Scene) -> Scene:
    """Return the scene with other names, whose alphabetical order differs."""
    names = {body.name: _name(scene, k) for k, body in enumerate(scene.body)} | {GROUND: GROUND}
    joints = _joints(scene)

    def pair(bodies: Any) -> tuple[str, ...]:
        return tuple(names[name] for name in bodies)

    def coupled(ends: Any) -> tuple[str, ...]:
        return tuple(joints[name] for name in ends)

    fields = {"bodies": pair, "body": names.__getitem__, "joint": joints.__getitem__}
    return scene.with_(
        body=tuple(replaced(body, name=names[body.name]) for body in scene.body),
        joint=tuple(replaced(mapped(j, fields), name=joints[j.name]) for j in scene.joint),
        coupling=tuple(mapped(coupling, {"joints": coupled}) for coupling in scene.coupling),
        driver=tuple(mapped(driver, fields) for driver in scene.driver),
        load=tuple(mapped(load, fields) for load in scene.load),
    )


def renamed(scene: Scene, motion: Trajectory) -> Trajectory:
    """Return the motion under the names that `relabelled` gives."""
    joints = _joints(scene)
    tables: dict[str, Any] = {
        key: values and {joints.get(name, name): rows for name, rows in values.items()}
        for key in ("reactions", "angles")
        for values in [getattr(motion, key)]
    }
    return replace(motion, bodies=tuple(_name(scene, k) for k in range(len(scene.body))), **tables)


def _joints(scene: Scene) -> dict[str, str]:
    return {joint.name: f"joint {chr(122 - k % 26)}{k}" for k, joint in enumerate(scene.joint)}


def _name(scene: Scene, k: int) -> str:
    return f"part {chr(122 - k % 26)}{k}"


def swapped(scene: Scene) -> Scene | Outside:
    """Return the scene with the two bodies of every joint exchanged.

    Axes are reversed, so that drivers and torsion springs keep their direction.
    """
    if not scene.joint:
        return Outside("the scene has no joint")
    return scene.with_(joint=tuple(map(_exchanged, scene.joint)))


def _exchanged(joint: Joint) -> Joint:
    turn = {"axis": lambda axis: -np.array(axis)}
    fields = {"bodies": _back, "anchors": _back, "axes": _back, **turn}
    return mapped(joint, fields)


def _back(pair: Any) -> Any:
    return pair[::-1]


def stretched(scene: Scene) -> Scene | Outside:
    """Return the scene with axis vectors 1000 times as long: only their directions matter."""
    if not any(hasattr(joint, "axis") or hasattr(joint, "axes") for joint in scene.joint):
        return Outside("no joint has an axis")
    longer = {name: lambda axes: 1000.0 * np.array(axes) for name in ("axis", "axes")}
    return scene.with_(joint=tuple(mapped(joint, longer) for joint in scene.joint))


def duplicated(scene: Scene) -> Scene | Outside:
    """Return the scene with its last joint given twice, once without armature, which makes rows redundant."""
    if not scene.joint:
        return Outside("the scene has no joint")
    return scene.with_(joint=(*scene.joint, _again(scene.joint[-1])))


def _again(joint: Joint) -> Joint:
    return replaced(joint, name="again", **{"armature": 0.0} if joint.reflected_inertia else {})


def satisfied(scene: Scene) -> Scene | Outside:
    """Return the scene with an additional cylindrical joint on the axis of a revolute joint, which makes rows
    redundant."""
    hinges = [joint for joint in scene.joint if joint.type == "revolute"]
    if not hinges:
        return Outside("the scene has no revolute joint, on whose axis a second joint could be added")
    hinge = hinges[0]
    axis: Any = rotations.unit(hinge.axis)
    place = np.array(hinge.anchor) + 0.3 * axis
    twin = Cylindrical(name="sleeve", bodies=hinge.bodies, anchor=place, axis=axis)
    return scene.with_(joint=(*scene.joint, twin))


def split(scene: Scene) -> Scene | Outside:
    """Return the scene with the last body split into two welded halves on both sides of its centre; joints
    and loads stay on one half."""
    body = scene.body[-1]
    if body.mass is None:
        return Outside("bodies have no mass to split")
    if body.velocity is None or body.angular_velocity is None:
        return Outside("the velocities of the body are not given")
    if _is_corrected(scene):
        return Outside(
            "given velocities contradict the joints, and their correction depends on the number of bodies"
        )
    try:
        return _in_halves(scene, body)
    except SceneError as error:
        return Outside(f"the halves are not valid bodies: {error.faults[0]}")


def _is_corrected(scene: Scene) -> bool:
    """Return whether the velocities that a scene gives contradict its joints, so that they are corrected."""
    linear, angular = initial_twists(scene)
    pairs = [(body.velocity, found) for body, found in zip(scene.body, linear, strict=True)]
    pairs += [(body.angular_velocity, found) for body, found in zip(scene.body, angular, strict=True)]
    apart = [np.abs(np.subtract(given, found)).max() for given, found in pairs if given is not None]
    return max(apart) > UNCHANGED * max(np.abs(linear).max(), np.abs(angular).max())


def _in_halves(scene: Scene, body: Body) -> Scene:
    arm = _arm(body)
    moved = _mass(body) * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    reach = rotations.rotate(np.array(body.orientation), arm)
    swing = np.cross(np.array(body.angular_velocity), reach)
    common = {"mass": _mass(body) / 2, "inertia": (_inertia(body) - moved) / 2}
    halves = [
        replaced(
            body,
            **common,
            name=name,
            position=np.array(body.position) + side * reach,
            velocity=np.array(body.velocity) + side * swing,
        )
        for name, side in ((body.name, 1.0), (body.name + HALF, -1.0))
    ]
    weld = Fixed(name="weld", bodies=(body.name, body.name + HALF), anchor=body.position)
    return scene.with_(body=(*scene.body[:-1], *halves), joint=(*scene.joint, weld))


def of_halves(scene: Scene, motion: Trajectory) -> Trajectory:
    """Return the motion with two halves in place of the last body, without accelerations."""
    arm = rotations.rotate(motion.orientation[:, -1], _arm(scene.body[-1]))
    swing = np.cross(motion.angular_velocity[:, -1], arm)
    name = scene.body[-1].name
    parts = {
        "position": [motion.position[:, -1] + arm, motion.position[:, -1] - arm],
        "velocity": [motion.velocity[:, -1] + swing, motion.velocity[:, -1] - swing],
        "orientation": [motion.orientation[:, -1]] * 2,
        "angular_velocity": [motion.angular_velocity[:, -1]] * 2,
    }
    arrays: dict[str, Any] = {
        key: np.concatenate([getattr(motion, key)[:, :-1], np.stack(ends, axis=1)], axis=1)
        for key, ends in parts.items()
    }
    return replace(
        motion,
        bodies=(*motion.bodies[:-1], name, name + HALF),
        acceleration=None,
        angular_acceleration=None,
        **arrays,
    )


def _arm(body: Body) -> np.ndarray:
    """Return the vector from the centre of a body to the centre of its first half, in body axes."""
    moments, axes = np.linalg.eigh(_inertia(body))
    axis = axes[:, 0] * np.sign(axes[np.argmax(np.abs(axes[:, 0])), 0])
    return np.sqrt(LIMIT * moments[1] / _mass(body)) * axis


def _mass(body: Body) -> float:
    return cast(float, body.mass)  # `split` refuses bodies without mass


def _inertia(body: Body) -> np.ndarray:
    """Return the inertia matrix (3, 3) about the centre of a body, along its axes."""
    given = np.array(body.inertia)
    return np.diag(given) if given.ndim == 1 else given


def negated(scene: Scene) -> Scene:
    """Return the scene with every orientation given by its negative quaternion, which describes the
    orientation equally."""
    return scene.with_(body=tuple(replaced(b, orientation=[-x for x in b.orientation]) for b in scene.body))
