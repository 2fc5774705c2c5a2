"""Faults of couplings that concern several fields: numbers of entries, coordinates, units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, get_args

from mbref.scene.couplings import MOST_POWERS, default_coordinates
from mbref.scene.fields import field_of
from mbref.scene.function_faults import QUANTITY_OF, Faults, listed
from mbref.scene.joints import JOINT_TYPES, Coordinate
from mbref.scene.units import QUANTITIES, dimension_of, fits, unit

COORDINATES = get_args(Coordinate)
LAWS = ("ratio", "ratios", "polynomial")  # of which a coupling has one


def count_faults(path: str, coupling: Any, count: int) -> Faults:
    """Yield ratios and coordinates that are not one for each joint, and ratios that are missing or given
    twice."""
    given = [name for name in LAWS if field_of(coupling, name) is not None]
    if not given:
        yield f"{path}.{'ratio' if count == 2 else 'ratios'}", "is required"
    elif len(given) > 1:
        yield f"{path}.{given[1]}", f"or {given[0]}, not both"
    elif given != ["ratios"] and count != 2:
        yield f"{path}.{given[0]}", f"relates two joints; {count} joints need ratios, one for each"
    for field in ("ratios", "coordinates"):
        given = field_of(coupling, field)
        if isinstance(given, list | tuple) and len(given) != count:
            yield f"{path}.{field}", f"must be {count}, one for each joint, got {len(given)}"


def coordinate_faults(path: str, coupling: Any, names: Sequence[str], types: Mapping[str, str]) -> Faults:
    """Yield coupled coordinates that joints of these types lack, or that appear twice, and wrong units."""
    yield from count_faults(path, coupling, len(names))
    facts = [JOINT_TYPES[types[name]].facts for name in names]
    asked = listed(field_of(coupling, "coordinates"))
    chosen = asked if len(asked) == len(names) else default_coordinates(names, facts)
    for name, fact, coordinate in zip(names, facts, chosen, strict=True):
        if coordinate in COORDINATES and coordinate not in fact.coordinates:
            yield f"{path}.joints", f"{name!r} is {types[name]}, which has no {coordinate} to be coupled"
            return
    ends = list(zip(names, chosen, strict=True))
    for name, coordinate in dict.fromkeys(end for end in ends if ends.count(end) > 1):
        yield f"{path}.joints", f"must be different coordinates, got the {coordinate} of {name!r} twice"
    if set(chosen) <= set(COORDINATES):
        yield from _unit_faults(path, coupling, ends)


def _unit_faults(path: str, coupling: Any, ends: Sequence[tuple[str, str]]) -> Faults:
    """Yield an offset and ratios in units that do not fit the coordinates."""
    name, last = ends[-1]
    offset, ratio = field_of(coupling, "offset"), field_of(coupling, "ratio")
    if not fits(offset, QUANTITY_OF[last]):
        yield f"{path}.offset", f"is of the {last} of {name!r}, got {offset!r}"
    over, *under = (QUANTITIES[QUANTITY_OF[each]][0] for each in (last, *(kind for _, kind in ends)))
    ratios = [("ratio", ratio, under[0])] if ratio is not None else []
    every = enumerate(zip(listed(field_of(coupling, "ratios")), under, strict=False))
    ratios += [(f"ratios[{k}]", each, of) for k, (each, of) in every]
    powers = enumerate(listed(field_of(coupling, "polynomial"))[:MOST_POWERS])
    ratios += [(f"polynomial[{k}]", each, f"{under[0]}^{k + 1}" if k else under[0]) for k, each in powers]
    for field, value, of in ratios:
        if dimension_of(value) not in (None, unit(f"{over}/{of}").dimension):
            yield f"{path}.{field}", f"is in {over}/{of}, got {value!r}"
