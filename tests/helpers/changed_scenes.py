"""A mechanism in other units, in another frame, or in another order: its motion follows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from mbref import rotations
from mbref.scene import Scene
from mbref.scene_joints import default_coordinates

Change = Callable[[np.ndarray], np.ndarray]
POWERS = {  # of mass, length and time in the unit of a field
    "mass": (1, 0, 0),
    "inertia": (1, 2, 0),
    "velocity": (0, 1, -1),
    "angular_velocity": (0, 0, -1),
    "force": (1, 1, -2),
    "moment": (1, 2, -2),
    "torque": (1, 2, -2),
    "gravity": (0, 1, -2),
    "duration": (0, 0, 1),
    **dict.fromkeys(("position", "anchor", "anchors", "point", "points"), (0, 1, 0)),
    **dict.fromkeys(("natural_length", "natural_displacement"), (0, 1, 0)),
}
LINEAR = {"stiffness": (1, 0, -2), "damping": (1, 0, -1), "armature": (1, 0, 0)}
TURNING = {"stiffness": (1, 2, -2), "damping": (1, 2, -1), "armature": (1, 2, 0)}
POINTS = ("position", "anchor", "anchors", "point", "points")
VECTORS = ("velocity", "angular_velocity", "axis", "axes", "force", "moment", "gravity")


def changed(entry: Mapping[str, Any], changes: Mapping[str, Change]) -> dict[str, Any]:
    """Return an entry of a scene with functions applied to its fields, where it has them."""
    return {
        name: changes[name](np.array(value)).tolist() if name in changes and value is not None else value
        for name, value in entry.items()
    }


def in_other_units(scene: Scene, mass: float, length: float, time: float) -> Scene:
    """Return the scene with each number as if units were smaller by the factors of mass, length and time."""

    def convert(entry: Mapping[str, Any], further: Mapping[str, tuple[int, int, int]]) -> dict[str, Any]:
        sizes = {n: mass**m * length**s * time**t for n, (m, s, t) in {**POWERS, **further}.items()}
        found = changed(entry, {name: lambda value, by=by: value * by for name, by in sizes.items()})
        return found | ({"factor": slower(found["factor"], 1.0, time)} if found.get("factor") else {})

    slides = {joint.name for joint in scene.joint if joint.facts.driven == "displacement"}
    dump = convert(scene.model_dump(), {})
    dump["body"] = [convert(entry, {}) for entry in dump["body"]]
    dump["joint"] = [convert(e, LINEAR if e["name"] in slides else TURNING) for e in dump["joint"]]
    dump["load"] = [convert(e, TURNING if e["type"] == "torsion_spring" else LINEAR) for e in dump["load"]]
    dump["driver"] = [slower(e, length if e["joint"] in slides else 1.0, time) for e in dump["driver"]]
    for entry in dump["coupling"]:
        first, second = (length if c == "displacement" else 1.0 for c in coordinates(scene, entry))
        entry["ratio"], entry["offset"] = entry["ratio"] * second / first, entry["offset"] * second
    return Scene.model_validate(dump)


def coordinates(scene: Scene, coupling: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the two coordinates, angle or displacement, that a coupling joins."""
    first, second = (scene.joint_named(name) for name in coupling["joints"])
    return coupling["coordinates"] or default_coordinates((first.facts, second.facts), first is second)


def slower(function: Mapping[str, Any], amount: float, time: float) -> dict[str, Any]:
    """Return a function of time with its values and its times multiplied by factors."""
    found = dict(function)
    if found.get("polynomial"):
        found["polynomial"] = [amount * c / time**k for k, c in enumerate(found["polynomial"])]
    if found.get("sine"):
        sine = found["sine"]
        frequency = sine["frequency"] / time
        found["sine"] = {**sine, "amplitude": amount * sine["amplitude"], "frequency": frequency}
    if found.get("table"):
        found["table"] = [[time * t, amount * value] for t, value in found["table"]]
    return found | {name: time * found[name] for name in ("start", "stop") if found.get(name)}


def in_another_frame(scene: Scene, turn: np.ndarray, shift: np.ndarray) -> Scene:
    """Return the scene turned by a unit quaternion (4,) and then shifted by a vector (3,), m."""

    def vector(value: np.ndarray) -> np.ndarray:
        return rotations.rotate(turn, value) if value.ndim else value  # the force along a joint is a number

    changes: dict[str, Change] = dict.fromkeys(VECTORS, vector)
    changes |= dict.fromkeys(POINTS, lambda value: vector(value) + shift)
    changes["orientation"] = lambda value: rotations.multiply(turn, value)
    dump = changed(scene.model_dump(), changes)
    for kind in ("body", "joint", "load"):
        dump[kind] = [changed(entry, changes) for entry in dump[kind]]
    return Scene.model_validate(dump)


def in_another_order(scene: Scene) -> Scene:
    """Return the scene with bodies, joints, loads, drivers and couplings in reverse order."""
    kinds = ("body", "joint", "load", "driver", "coupling")
    return scene.with_(**{kind: getattr(scene, kind)[::-1] for kind in kinds})
