"""Faults of the direction along which a driver moves the bodies of a joint."""

from __future__ import annotations

import math
from typing import Any

from mbref.scene.fields import field_of
from mbref.scene.function_faults import Faults, listed
from mbref.scene.joints import JOINT_TYPES, Z

# joint types that let the second body move along some directions of the first body
MOVED_ALONG = tuple(
    name
    for name, joint in JOINT_TYPES.items()
    if joint.facts.free_translations and joint.facts.condition is None
)
ROUNDED_DIRECTION = (
    1e-6  # sine of the angle between a direction and the nearest free direction that is rounding
)


def direction_faults(path: str, driver: Any, joint: Any) -> Faults:
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
