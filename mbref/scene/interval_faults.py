"""Faults of constraints that come and go, and of end stops: drivers, loads, couplings, armatures, stops and
conditions need joints that always hold."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from mbref.scene.fields import field_of
from mbref.scene.function_faults import QUANTITY_OF, Faults, listed
from mbref.scene.joints import JOINT_TYPES
from mbref.scene.references import entries, text_of
from mbref.scene.units import fits

COMES_AND_GOES = {"active": "intervals", "when": "a condition", "release": "a release"}  # field → its meaning
NEED_A_HOLDING_JOINT = "armature", "stop"  # fields of a joint
ALL_ROTATIONS = 3  # rotations that a joint with a single point leaves free


def comes_and_goes(data: Mapping[str, Any]) -> bool:
    """Return whether a joint or coupling has intervals, a condition, or an end stop."""
    constraints = [*entries(data, "joint"), *entries(data, "coupling")]
    return any(_sometimes(entry, (*COMES_AND_GOES, "stop")) for entry in constraints)


def _stop_faults(data: Mapping[str, Any], joints: list[Any]) -> Faults:
    """Yield end stops of driven coordinates, and their ends in other units than the coordinate's."""
    driven = {text_of(driver, "joint") for driver in entries(data, "driver")}
    for i, joint in enumerate(joints):
        if not (stop := field_of(joint, "stop")):
            continue
        kind = text_of(joint, "type")
        coordinate = JOINT_TYPES[kind].facts.driven if kind in JOINT_TYPES else None
        if coordinate is None:
            continue
        if text_of(joint, "name") in driven - {""}:
            yield f"joint[{i}].stop", "needs a joint without a driver, which prescribes the coordinate"
        for end in ("lower", "upper"):
            if not fits(value := field_of(stop, end), QUANTITY_OF[coordinate]):
                yield f"joint[{i}].stop.{end}", f"is of the {coordinate} of a {kind} joint, got {value!r}"


def _sometimes(entry: Any, fields: Iterable[str] = COMES_AND_GOES) -> bool:
    """Return whether a raw joint or coupling has intervals or conditions."""
    return any([field_of(entry, field) is not None for field in fields])


def interval_faults(data: Mapping[str, Any]) -> Faults:
    """Yield the entries that need a joint that always holds, and fields that need intervals or conditions."""
    joints = entries(data, "joint")
    passing = {text_of(joint, "name") for joint in joints if _sometimes(joint)}
    for key in ("joint", "coupling"):
        for i, entry in enumerate(entries(data, key)):
            yield from _holding_faults(f"{key}[{i}]", entry, NEED_A_HOLDING_JOINT if key == "joint" else ())
    yield from _stop_faults(data, joints)
    for path, given in _users(data) if passing else ():
        for name in listed(given) or [given]:
            if isinstance(name, str) and name in passing:
                yield path, f"needs a joint that always holds; {name!r} has intervals or conditions"


def _holding_faults(path: str, entry: Any, needing: Iterable[str]) -> Faults:
    """Yield the fields of a joint or coupling that contradict that it always holds, or that it does not, as
    the ``needing`` ones do."""
    has = [meaning for field, meaning in COMES_AND_GOES.items() if field_of(entry, field) is not None]
    if not has:
        if field_of(entry, "engages") not in (None, "anywhere"):
            yield f"{path}.engages", "is of a constraint with intervals; give active or when, too"
        if field_of(entry, "holds_at_start") is not None:
            yield f"{path}.holds_at_start", "is of a constraint with active, when or release"
        return
    if field_of(entry, "holds_at_start") is False and not _sometimes(entry, ("active", "when")):
        yield f"{path}.holds_at_start", "lets it never hold; give active or when, too"
    for field in needing:
        if field_of(entry, field):
            yield f"{path}.{field}", f"needs a joint that always holds, and this one has {has[0]}"


def _users(data: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield the path and the names of the joints on whose coordinates an entry acts."""
    for key, field in (("coupling", "joints"), ("driver", "joint"), ("load", "joint")):
        for i, entry in enumerate(entries(data, key)):
            yield f"{key}[{i}].{field}", field_of(entry, field)
    for key in ("joint", "coupling"):
        for i, entry in enumerate(entries(data, key)):
            yield f"{key}[{i}].when.joint", field_of(field_of(entry, "when"), "joint")


def condition_faults(path: str, entry: Any, types: Mapping[str, str]) -> Faults:
    """Yield contradicting or missing fields of ``when`` and ``release``, of joints with these types."""
    when, release = field_of(entry, "when"), field_of(entry, "release")
    name, ends = field_of(when, "joint"), [field_of(when, key) is not None for key in ("bodies", "points")]
    if when is not None:
        if (name is not None) == any(ends):
            yield f"{path}.when", "needs a joint, or bodies and points" + "; give one of them" * any(ends)
        elif any(ends) and not all(ends):
            yield f"{path}.when.{'points' if ends[0] else 'bodies'}", "is required for a distance of points"
        else:
            yield from _watched_faults(f"{path}.when", when, types)
    if release is not None:
        given = [field_of(release, key) is not None for key in ("force", "moment")]
        if sum(given) != 1:
            yield f"{path}.release", "needs a force or a moment" + ", not both" * all(given)
        if path.startswith("coupling") and field_of(release, "joint") is None:
            yield f"{path}.release.joint", "is required, a joint whose reaction releases the coupling"
        by = text_of(release, "joint") or text_of(entry, "name")
        kind = types.get(by, "")
        if given[1] and kind in JOINT_TYPES and JOINT_TYPES[kind].facts.free_rotations == ALL_ROTATIONS:
            yield f"{path}.release.moment", f"{by!r} is {kind}, whose moment is always zero"


def _watched_faults(path: str, when: Any, types: Mapping[str, str]) -> Faults:
    """Yield a coordinate that the joint lacks, and a value in another unit than the coordinate's."""
    name, coordinate, reaches = (field_of(when, key) for key in ("joint", "coordinate", "reaches"))
    if name is None:
        if coordinate is not None:
            yield f"{path}.coordinate", "is of a joint, and the distance of two points has no other"
        if not fits(reaches, "length"):
            yield f"{path}.reaches", f"is a distance, got {reaches!r}"
        return
    kind = types.get(name) if isinstance(name, str) else None
    if kind not in JOINT_TYPES or not (known := JOINT_TYPES[kind].facts.coordinates):
        return  # reported as a fault of the joint's name
    chosen = JOINT_TYPES[kind].facts.main if coordinate is None else text_of(when, "coordinate")
    if chosen in QUANTITY_OF and chosen not in known:
        yield f"{path}.coordinate", f"{name!r} is {kind}, which has no {chosen}"
    elif chosen in QUANTITY_OF and not fits(reaches, QUANTITY_OF[chosen]):
        yield f"{path}.reaches", f"is of the {chosen} of {name!r}, got {reaches!r}"
