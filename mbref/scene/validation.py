"""Faults of a scene: one message for each, under the path of the field."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import ValidationError

from mbref.printable import printable
from mbref.scene.body_faults import mass_faults
from mbref.scene.coupling_faults import coordinate_faults, count_faults
from mbref.scene.driver_faults import TURNS, direction_faults, driver_faults, point_faults
from mbref.scene.fields import checked_length, checked_size, field_of, meant, shown
from mbref.scene.function_faults import Faults, factor_faults, listed
from mbref.scene.interval_faults import condition_faults, interval_faults
from mbref.scene.joints import JOINT_TYPES
from mbref.scene.loads import LOAD_TYPES, JointLoad
from mbref.scene.references import GROUND, entries, joint_faults, text_of, unknown
from mbref.scene.shapes import SHAPE_TYPES

RESERVED = (GROUND, "the fixed frame")  # names that no body can have
LOADED = {  # load type → joint types along whose coordinate it can act
    kind: tuple(name for name, joint in JOINT_TYPES.items() if load.coordinate in joint.facts.loaded)
    for kind, load in LOAD_TYPES.items()
    if issubclass(load, JointLoad)
}
COUPLED = tuple(name for name, joint in JOINT_TYPES.items() if joint.facts.coordinates)
ACTS_ON = {name: load.acts_on for name, load in LOAD_TYPES.items()}
NUMBERS = {  # field → content of its list; all other lists contain three numbers
    "orientation": "four numbers (w, x, y, z), for an angle φ about z cos(φ/2), 0, 0, sin(φ/2)",
    "polynomial": "numbers, such as [0.0, 6.0], of a coupling at most nine",
    "table": "rows of time and value, such as [[0.0, 0.0], [0.5, 1.0], [1.0, 2.0], [1.5, 1.0]]",
    "bodies": "two names of bodies",
    "anchors": "two points of three numbers each",
    "axes": "two axes of three numbers each",
    "points": "two points of three numbers each",
    **{key: f"entries [[{key}]]" for key in ("body", "joint", "coupling", "driver", "load")},
    "joints": "two or more names of joints",
    "coordinates": 'a list of "angle" and "displacement"',
    "ratios": "numbers, one for each joint",
    "turn": TURNS,
    "active": "intervals of a begin and an end (s), such as [[0.0, 1.2], [2.0, 3.0]]",
}
PAIRS = {"table": "a time and a value", "active": "a begin and an end (s)"}  # field → pairs in its list
INERTIA_TOLERANCE = 1e-9  # relative, of the triangle inequality: equality holds for thin rods


class SceneError(Exception):
    """Error: a scene cannot be used; ``faults`` has one ``path: message`` for each fault."""

    def __init__(self, faults: Sequence[str]):
        self.faults = list(faults)
        super().__init__("\n".join(self.faults))

    def __reduce__(self) -> tuple[type[SceneError], tuple[list[str]]]:
        return type(self), (self.faults,)  # allows the error to be pickled


def checked_inertia(value: Any) -> tuple[Any, ...]:
    """Return three principal moments or a symmetric 3x3 as tuples; raises ValueError for a faulty value."""
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise ValueError("must be three numbers or a 3x3 matrix") from None
    if array.shape not in ((3,), (3, 3)):
        raise ValueError(f"must be three numbers or a 3x3 matrix, got {shown(value)}")
    if not np.isfinite(array).all():
        raise ValueError("must be finite")
    checked_size(float(abs(array).max()))
    matrix = np.diag(array) if array.ndim == 1 else array
    tolerance = INERTIA_TOLERANCE * abs(matrix).max()
    if abs(matrix - matrix.T).max() > tolerance:
        raise ValueError("must be symmetric")
    moments = np.linalg.eigvalsh(matrix)
    for moment in moments[moments > 0]:
        checked_length(float(moment))
    if moments[0] < -tolerance:
        raise ValueError(f"must have no negative principal moment, got {moments[0]:.6g}")
    if moments[2] > moments[0] + moments[1] + tolerance:
        raise ValueError(
            f"violates the triangle inequality: {moments[2]:.6g} > {moments[0]:.6g} + {moments[1]:.6g}; "
            "a flat body across z has [a, b, a + b]"
        )
    return tuple(array.tolist()) if array.ndim == 1 else tuple(map(tuple, array.tolist()))


def field_faults(error: ValidationError, tables: Mapping[str, Sequence[str]]) -> Faults:
    """Yield (path, message) for every fault that pydantic found, in the words of scene files. ``tables`` has
    the names of the fields by table; names of fields of joints and loads are known here."""
    for fault in error.errors(include_url=False):
        kind, got, limit = fault["type"], shown(fault["input"]), fault.get("ctx", {})
        expected = str(limit.get("expected_tags"))
        alike = meant(str(limit.get("tag")), re.findall(r"\w+", expected))
        tags = f"{expected}, got {shown(limit.get('tag'))}{alike}"
        messages = {
            "missing": "is required",
            "extra_forbidden": f"is not a known field{_meant_field(fault['loc'], tables)}",
            "greater_than": f"must be positive, got {got}",
            "greater_than_equal": f"must not be negative, got {got}",
            "less_than_equal": f"must be at most {limit.get('le')}, got {got}",
            "finite_number": f"must be finite, got {got}",
            "float_type": f"must be a number, got {got}",
            "string_type": f"must be a string, got {got}",
            "string_too_short": "must not be empty",
            "string_too_long": f"must have at most {limit.get('max_length')} characters, got {got}",
            "too_short": "must not be empty",
            "tuple_type": _must_hold(fault["loc"], got),
            "too_long": _must_hold(fault["loc"], got),
            "union_tag_not_found": "is required",
            "union_tag_invalid": f"must be one of {tags}",
            "literal_error": f"must be {limit.get('expected')}, got {got}",
            "model_type": "must be a table",
            "model_attributes_type": "must be a table",
            "value_error": str(limit.get("error", "")),
        }
        default = f"{fault['msg'][0].lower()}{fault['msg'][1:]}, got {got}"
        if kind == "too_short" and fault["input"]:
            continue  # the entries exist, but faulty ones were left out
        if kind == "missing" and isinstance(fault["loc"][-1], int):  # the list is too short
            yield _path(fault["loc"][:-1]), _must_hold(fault["loc"][:-1], got)
            continue
        path = _path(fault["loc"]) + (".type" if kind.startswith("union_tag") else "")
        yield path, messages.get(kind, default)


def _must_hold(location: Sequence[str | int], got: str) -> str:
    """Return the message for a list of the wrong length, or a value that is no list."""
    field = location[-1] if location else ""
    if isinstance(field, int) and len(location) > 1 and location[-2] in PAIRS:
        return f"must be {PAIRS[str(location[-2])]}, got {got}"
    return f"must be {NUMBERS.get(str(field), 'three numbers')}, got {got}"


def _meant_field(location: Sequence[str | int], tables: Mapping[str, Sequence[str]]) -> str:
    """Return the suggestion for an unknown field at a location such as ("joint", 0, "revolute", "axsi")."""
    key, above = str(location[-1]), [part for part in location[:-1] if isinstance(part, str)]
    types: dict[str, Any] = {**JOINT_TYPES, **LOAD_TYPES, **SHAPE_TYPES}
    table = above[-1] if above else ""
    known = types[table].model_fields if table in types else tables.get(table, ())
    return meant(key, known) or f"; known: {', '.join(known)}"


def named_paths(data: Mapping[str, Any], faults: Mapping[str, str]) -> Iterator[str]:
    """Return ``path: message`` for every fault, with a unique name as index: body[rod].mass."""
    for path, message in faults.items():
        match = re.match(r"(body|joint|coupling|driver)\[(\d+)\](?=\.|$)", path)
        if match and (name := _own_name(data, match[1], int(match[2]))):
            yield f"{match[1]}[{name}]{path[match.end() :]}: {message}"
        else:
            yield f"{path}: {message}"


def _own_name(data: Mapping[str, Any], key: str, place: int) -> str:
    """Return the name of an entry if no other entry has it and a path can contain it; otherwise an empty
    text."""
    fields = ("name", "joint") if key == "driver" else ("name",)
    names = [next(filter(None, (text_of(entry, f) for f in fields)), "") for entry in entries(data, key)]
    name = names[place] if place < len(names) else ""
    fits_a_path = not name.isdigit() and not set(name) & set("[]") and len(name) < 80 and name.isprintable()
    return name if fits_a_path and names.count(name) == 1 else ""


def _path(location: Sequence[str | int]) -> str:
    """Return the path body[2].mass of a location, without the tag that a union of joint, load or shape types
    adds."""
    parts = [part for k, part in enumerate(location) if not _is_tag(location, k)]
    text = ""
    for part in parts:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return printable(text) or "scene"


def _is_tag(location: Sequence[str | int], k: int) -> bool:
    place = location[k - 1] == "shape" if k > 2 else k == 2 and location[0] in ("joint", "load")
    return place and isinstance(location[k], str)


def _names(entries: Sequence[Any]) -> list[str]:
    return [text_of(entry, "name") for entry in entries]


def reference_faults(data: Mapping[str, Any]) -> Faults:
    """Yield faults between entries: duplicate names, unknown bodies and joints, drivers of the wrong joint.
    The arguments are raw tables, so that these faults are found together with the faults of single fields."""
    bodies, joints = entries(data, "body"), entries(data, "joint")
    yield from _duplicates("body", _names(bodies), reserved=RESERVED)
    yield from _duplicates("joint", _names(joints), (GROUND,) if data.get("ground") == "body" else ())
    for i, body in enumerate(bodies):
        yield from mass_faults(f"body[{i}]", body)
    known = {*_names(bodies), GROUND}
    for i, joint in enumerate(joints):
        yield from _pair_faults(f"joint[{i}].bodies", field_of(joint, "bodies"), known)
    types = {text_of(joint, "name"): text_of(joint, "type") for joint in joints}
    yield from point_faults(data, types, known)
    yield from direction_faults(data, types)
    types |= {
        text_of(driver, "name"): "free" for driver in entries(data, "driver") if text_of(driver, "name")
    }
    yield from _coupling_faults(data, types)
    yield from driver_faults(data, types)
    yield from interval_faults(data)
    yield from _condition_faults(data, types, known)
    for i, load in enumerate(entries(data, "load")):
        acts_on = ACTS_ON.get(text_of(load, "type"))
        if acts_on == "body":
            name = field_of(load, "body")
            if name == GROUND:
                yield f"load[{i}].body", "a load cannot act on the ground"
            elif isinstance(name, str) and name not in known:
                yield f"load[{i}].body", unknown("body", name, known - {GROUND})
        elif acts_on == "bodies":
            yield from _pair_faults(f"load[{i}].bodies", field_of(load, "bodies"), known)
        elif acts_on == "joint":
            kind = text_of(load, "type")
            yield from joint_faults(
                f"load[{i}].joint", field_of(load, "joint"), types, LOADED[kind], f"carry a {kind}"
            )
        yield from factor_faults(f"load[{i}].factor", field_of(load, "factor"), data)


def _coupling_faults(data: Mapping[str, Any], types: Mapping[str, Any]) -> Faults:
    """Yield couplings with the name of another entry, of unknown joints, or of coordinates that a joint
    lacks."""
    couplings = entries(data, "coupling")
    yield from _duplicates("coupling", _names(couplings))
    for i, coupling in enumerate(couplings):
        if (own := text_of(coupling, "name")) and own in types:
            yield f"coupling[{i}].name", f"{own!r} is already the name of a joint"
        names = listed(field_of(coupling, "joints"))
        if len(names) < 2:
            continue  # already reported as a fault of the field
        path = f"coupling[{i}].joints"
        for k, name in enumerate(names):
            yield from joint_faults(f"{path}[{k}]", name, types, COUPLED, "be coupled")
        if all(isinstance(name, str) and types.get(name) in COUPLED for name in names):
            yield from coordinate_faults(f"coupling[{i}]", coupling, names, types)
        else:
            yield from count_faults(f"coupling[{i}]", coupling, len(names))


def _condition_faults(data: Mapping[str, Any], types: Mapping[str, Any], known: set[str]) -> Faults:
    """Yield faults of the conditions of joints and couplings, with unknown joints and bodies."""
    for key in ("joint", "coupling"):
        for i, entry in enumerate(entries(data, key)):
            path, when, release = f"{key}[{i}]", field_of(entry, "when"), field_of(entry, "release")
            if when is None and release is None:
                continue
            yield from joint_faults(
                f"{path}.when.joint", field_of(when, "joint"), types, COUPLED, "be watched"
            )
            yield from _pair_faults(f"{path}.when.bodies", field_of(when, "bodies"), known)
            other = field_of(release, "joint")
            yield from joint_faults(f"{path}.release.joint", other, types, tuple(JOINT_TYPES), "release")
            yield from condition_faults(path, entry, types)


def _duplicates(key: str, names: Sequence[str], reserved: Sequence[str] = ()) -> Faults:
    first: dict[str, int] = {}
    for i, name in enumerate(names):
        if name in reserved:
            yield f"{key}[{i}].name", f"{name!r} is reserved for the fixed frame"
        elif name and first.setdefault(name, i) != i:
            yield f"{key}[{i}].name", f"{name!r} is already the name of {key}[{first[name]}]"


def _pair_faults(path: str, pair: Any, known: set[str]) -> Faults:
    if not isinstance(pair, list | tuple) or len(pair) != 2:
        return  # already reported as a fault of the field
    for k, name in enumerate(pair):
        if isinstance(name, str) and name and name not in known:
            yield f"{path}[{k}]", unknown("body", name, known)
    if pair[0] == pair[1]:
        yield path, f"must be two different bodies, got {pair[0]!r} twice"
