"""Faults of constraints with intervals, and of end stops: drivers, loads, couplings, armatures and stops need
joints that always hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mbref.scene.fields import field_of
from mbref.scene.function_faults import QUANTITY_OF, Faults, listed
from mbref.scene.joints import JOINT_TYPES
from mbref.scene.units import fits


def _text(entry: Any, key: str) -> str:
    """Return a name or type of an entry; empty if it is no text, which its field reports."""
    found = field_of(entry, key)
    return found if isinstance(found, str) else ""


def _stop_faults(data: Mapping[str, Any], joints: list[Any]) -> Faults:
    """Yield end stops of driven coordinates, and their ends in other units than the coordinate's."""
    driven = {_text(driver, "joint") for driver in listed(data.get("driver", ()))}
    for i, joint in enumerate(joints):
        kind, stop = _text(joint, "type"), field_of(joint, "stop")
        coordinate = JOINT_TYPES[kind].facts.driven if kind in JOINT_TYPES else None
        if not stop or coordinate is None:
            continue
        if _text(joint, "name") in driven - {""}:
            yield f"joint[{i}].stop", "needs a joint without a driver, which prescribes the coordinate"
        for end in ("lower", "upper"):
            if not fits(value := field_of(stop, end), QUANTITY_OF[coordinate]):
                yield f"joint[{i}].stop.{end}", f"is of the {coordinate} of a {kind} joint, got {value!r}"


def interval_faults(data: Mapping[str, Any]) -> Faults:
    """Yield the entries that need a joint that always holds, and a way to engage without intervals."""
    joints = listed(data.get("joint", ()))
    sometimes = {_text(joint, "name") for joint in joints if field_of(joint, "active") is not None}
    for key in ("joint", "coupling"):
        for i, entry in enumerate(listed(data.get(key, ()))):
            if field_of(entry, "active") is None and field_of(entry, "engages") not in (None, "anywhere"):
                yield f"{key}[{i}].engages", "is of a constraint with intervals; give active, too"
    for i, joint in enumerate(joints):
        if field_of(joint, "active") is not None and field_of(joint, "armature"):
            yield f"joint[{i}].armature", "needs a joint that always holds, and this one has intervals"
        if field_of(joint, "active") is not None and field_of(joint, "stop"):
            yield f"joint[{i}].stop", "needs a joint that always holds, and this one has intervals"
    yield from _stop_faults(data, joints)
    for key, field in (("coupling", "joints"), ("driver", "joint"), ("load", "joint")):
        for i, entry in enumerate(listed(data.get(key, ()))):
            given = field_of(entry, field)
            for name in listed(given) or [given]:
                if isinstance(name, str) and name in sometimes:
                    yield f"{key}[{i}].{field}", f"needs a joint that always holds; {name!r} has intervals"
