"""Faults of constraints with intervals: drivers, loads, couplings and armatures need joints that always
hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mbref.scene.fields import field_of
from mbref.scene.function_faults import Faults, listed


def interval_faults(data: Mapping[str, Any]) -> Faults:
    """Yield the entries that need a joint that always holds, and a way to engage without intervals."""
    joints = listed(data.get("joint", ()))
    sometimes = {field_of(joint, "name") for joint in joints if field_of(joint, "active") is not None}
    for key in ("joint", "coupling"):
        for i, entry in enumerate(listed(data.get(key, ()))):
            if field_of(entry, "active") is None and field_of(entry, "engages") not in (None, "anywhere"):
                yield f"{key}[{i}].engages", "is of a constraint with intervals; give active, too"
    for i, joint in enumerate(joints):
        if field_of(joint, "active") is not None and field_of(joint, "armature"):
            yield f"joint[{i}].armature", "needs a joint that always holds, and this one has intervals"
    for key, field in (("coupling", "joints"), ("driver", "joint"), ("load", "joint")):
        for i, entry in enumerate(listed(data.get(key, ()))):
            given = field_of(entry, field)
            for name in listed(given) or [given]:
                if isinstance(name, str) and name in sometimes:
                    yield f"{key}[{i}].{field}", f"needs a joint that always holds; {name!r} has intervals"
