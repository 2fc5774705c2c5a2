"""Faults of drivers: unknown or wrong joints, points and directions, units, and second drivers of a joint."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from mbref.scene.fields import field_of
from mbref.scene.function_faults import Faults, listed, table_faults, turn_faults, unit_faults
from mbref.scene.interval_faults import comes_and_goes
from mbref.scene.joints import JOINT_TYPES, Z
from mbref.scene.references import GROUND, entries, joint_faults, text_of, unknown

DRIVABLE = tuple(name for name, joint in JOINT_TYPES.items() if joint.facts.driven)
ORIENTED = tuple(name for name, joint in JOINT_TYPES.items() if joint.facts.oriented)
TURNS = "one to three entries [[driver.turn]], each with an axis"
# joint types that let the second body move along some directions of the first body
MOVED_ALONG = tuple(
    name
    for name, joint in JOINT_TYPES.items()
    if joint.facts.free_translations and joint.facts.condition is None
)
ROUNDED_DIRECTION = (
    1e-6  # sine of the angle between a direction and the nearest free direction that is rounding
)


def point_faults(data: Mapping[str, Any], types: Mapping[str, Any], known: set[str]) -> Faults:
    """Yield driven points of unknown bodies, or with the name of a joint."""
    for i, driver in enumerate(entries(data, "driver")):
        if (name := text_of(driver, "name")) in types and name:
            yield f"driver[{i}].name", f"{name!r} is already the name of a joint"
        if (body := text_of(driver, "body")) == GROUND:
            yield f"driver[{i}].body", "a point of the ground cannot be driven"
        elif body and body not in known:
            yield f"driver[{i}].body", unknown("body", body, known - {GROUND})


def direction_faults(data: Mapping[str, Any], types: Mapping[str, Any]) -> Faults:
    """Yield drivers along directions in which a joint does not let its bodies move."""
    joints = {text_of(joint, "name"): joint for joint in entries(data, "joint")}
    for i, driver in enumerate(entries(data, "driver")):
        if field_of(driver, "along") is not None and (name := text_of(driver, "joint")):
            yield from joint_faults(
                f"driver[{i}].joint", name, types, MOVED_ALONG, "be driven along a direction"
            )
            yield from _faults_of_direction(f"driver[{i}].along", driver, joints.get(name))


def driver_faults(data: Mapping[str, Any], types: Mapping[str, Any]) -> Faults:
    """Yield drivers of unknown or wrong joints, and second drivers of a joint."""
    driven: set[str] = set()
    for i, driver in enumerate(entries(data, "driver")):
        field = "name" if text_of(driver, "name") else "joint"
        name = field_of(driver, field)
        turns = listed(field_of(driver, "turn"))
        if turns:
            yield from joint_faults(f"driver[{i}].{field}", name, types, ORIENTED, "be driven by turns")
        elif types.get(name if isinstance(name, str) else "") in ORIENTED:
            yield f"driver[{i}].{field}", f"{name!r} is {types[name]}; its driver has {TURNS}"
        else:
            yield from joint_faults(f"driver[{i}].{field}", name, types, DRIVABLE, "be driven")
        if isinstance(name, str):
            if name in driven:
                yield f"driver[{i}].{field}", f"{name!r} already has a driver"
            driven.add(name)
            yield from unit_faults(f"driver[{i}]", driver, types.get(name))
        yield from table_faults(f"driver[{i}].table", driver, data, 0.0, math.inf)
        for k, turn in enumerate(turns):
            yield from turn_faults(f"driver[{i}].turn[{k}]", turn)
            yield from table_faults(f"driver[{i}].turn[{k}].table", turn, data, 0.0, math.inf)
        if turns and comes_and_goes(data):
            yield f"driver[{i}].turn", "needs a scene without intervals, conditions and end stops"


def _faults_of_direction(path: str, driver: Any, joint: Any) -> Faults:
    """Yield the fault of a direction ``along`` in which a joint does not let its bodies move."""
    along, axis = (_numbers(field_of(entry, key)) for entry, key in ((driver, "along"), (joint, "axis")))
    kind = field_of(joint, "type")
    if kind not in MOVED_ALONG or not along or not axis:
        return  # already reported as a fault of another field
    forbidden = JOINT_TYPES[kind].facts.forbidden_translations
    name = field_of(joint, "name")
    cosine = (
        abs(sum(a * b for a, b in zip(along, axis, strict=True))) / math.hypot(*along) / math.hypot(*axis)
    )
    if forbidden == (Z,) and cosine > ROUNDED_DIRECTION:
        yield path, f"must lie in the plane of joint {name!r}, perpendicular to its axis"
    if len(forbidden) == 2 and math.sqrt(max(0.0, 1.0 - cosine * cosine)) > ROUNDED_DIRECTION:
        yield path, f"must be along the axis of joint {name!r}"


def _numbers(vector: Any) -> list[float]:
    """Return three numbers that have a length; an empty list for anything else."""
    found = listed(vector)
    is_vector = len(found) == 3 and all(isinstance(x, int | float) for x in found)
    return [float(x) for x in found] if is_vector and any(found) else []
