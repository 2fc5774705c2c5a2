"""Differences between the machine that a file means and the machine that a reader built."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.engines.loaders.machine import (
    TRANSLATIONAL,
    Coupling,
    Joint,
    Loop,
)
from crosscheck.files.matching import Match, added_groups, ending, lost_groups
from crosscheck.files.merged import Group

LOST, ADDED, WRONG = "lost", "added", "wrong"
OF_JOINT = ("damping", "stiffness", "rest", "armature", "friction", "reference")  # numbers of a joint
MINOR = {*OF_JOINT, "limits"}  # differences that leave bodies, joints and constraints as they are


@dataclass(frozen=True)
class Difference:
    """A part (body, joint, loop, coupling, gravity, statics), its name and field, and both values.

    ``kind`` is LOST for what the reader does not have, ADDED for what the file does not have, and WRONG.
    """

    kind: str
    part: str
    name: str
    field: str
    file: Any
    reader: Any

    @property
    def is_minor(self) -> bool:
        """Return whether bodies, joints, constraints and gravity remain the file's."""
        return self.field in MINOR


LINEAR = 2  # coefficients of a linear law: offset and ratio


def of_reading(match: Match, tolerance: float) -> list[Difference]:
    """Return the differences of what was read."""
    return [
        *_of_bodies(match, tolerance),
        *_of_joints(match, tolerance),
        *_of_loops(match, tolerance),
        *_of_couplings(match, tolerance),
        *_of_gravity(match, tolerance),
    ]


def _of_bodies(match: Match, tolerance: float) -> Iterator[Difference]:
    for group in lost_groups(match):
        yield Difference(LOST, "body", group.name, "body", group.mass, None)
    for group in added_groups(match):
        yield Difference(ADDED, "body", group.name, "body", None, group.mass)
    for k, number in match.groups.items():
        if k >= 0 and number >= 0:
            yield from _of_body(match, match.of_file.groups[number], match.of_reader.groups[k], tolerance)


def _of_body(match: Match, file: Group, own: Group, tolerance: float) -> Iterator[Difference]:
    total = sum(group.mass or 0.0 for group in match.of_file.groups)
    if file.mass is not None and own.mass is not None:
        least = tolerance * max(abs(file.mass), tolerance * total)
        if abs(file.mass - own.mass) > least:
            yield Difference(WRONG, "body", file.name, "mass", file.mass, own.mass)
    if file.centre is None or own.centre is None or file.inertia is None or own.inertia is None:
        return
    if not file.mass and not own.mass:
        return
    if np.abs(file.centre - own.centre).max() > tolerance * match.size:
        yield Difference(WRONG, "body", file.name, "centre", file.centre.tolist(), own.centre.tolist())
    scale = max(np.abs(file.inertia).max(), tolerance * (file.mass or 0.0) * match.size**2)
    if np.abs(file.inertia - own.inertia).max() > tolerance * scale:
        values = file.inertia.tolist(), own.inertia.tolist()
        yield Difference(WRONG, "body", file.name, "inertia", *values)


def _of_joints(match: Match, tolerance: float) -> Iterator[Difference]:
    for joint in match.of_file.joints:
        own = match.joints.get(joint.name)
        if own is None:
            if joint.type != "free" and joint.name not in match.covered:
                yield Difference(LOST, "joint", joint.name, "joint", joint.type, None)
            continue
        yield from _of_joint(match, joint, own, tolerance)
    loops = {loop.name for loop in match.loops.values()}
    for joint in match.of_reader.joints:
        if joint not in match.used and joint.name not in loops:
            yield Difference(ADDED, "joint", joint.name, "joint", None, joint.type)


def _of_joint(match: Match, file: Joint, own: Joint, tolerance: float) -> Iterator[Difference]:
    if file.type != own.type:
        yield Difference(WRONG, "joint", file.name, "type", file.type, own.type)
        return
    for field, *values in (*_of_place(match, file, own, tolerance), *_of_axis(match, file, own, tolerance)):
        yield Difference(WRONG, "joint", file.name, field, *values)
    yield from _of_numbers(file, own, tolerance)


def _of_place(match: Match, file: Joint, own: Joint, tolerance: float) -> Iterator[tuple[str, Any, Any]]:
    """Yield other bodies, and another anchor; every point on an axis is an anchor."""
    pair, theirs = match.of_file.pair(file.bodies), match.in_file(own.bodies)
    named = [tuple(map(ending, joint.bodies)) for joint in (file, own)]
    if None not in theirs and theirs not in (pair, pair[::-1]) and named[0] != named[1]:
        yield "bodies", list(file.bodies), list(own.bodies)
    if file.anchor is None or own.anchor is None or file.type in (TRANSLATIONAL, "free", "planar"):
        return
    apart = np.array(file.anchor) - np.array(own.anchor)
    if file.axis is not None:
        axis = np.array(file.axis)
        apart -= axis * (axis @ apart) / (axis @ axis)
    if np.abs(apart).max() > tolerance * match.size:
        yield "anchor", list(file.anchor), list(own.anchor)


def _of_axis(match: Match, file: Joint, own: Joint, tolerance: float) -> Iterator[tuple[str, Any, Any]]:
    """Yield another axis; it is reversed where the reader's joint leads from the child to the parent."""
    if file.axis is None or own.axis is None:
        return
    pair, theirs = match.of_file.pair(file.bodies), match.in_file(own.bodies)
    is_reversed = theirs == pair[::-1] and theirs != pair
    axis, other = np.array(file.axis), np.array(own.axis) * (-1.0 if is_reversed else 1.0)
    apart = [np.abs(axis - other).max()]
    if file.type == "planar":  # a normal has no sign
        apart.append(np.abs(axis + other).max())
    if min(apart) > tolerance * max(1.0, np.abs(axis).max()):
        yield "axis", axis.tolist(), other.tolist()


def _of_numbers(file: Joint, own: Joint, tolerance: float) -> Iterator[Difference]:
    """Yield other limits, forces of the joint, armatures and coordinates at the reference pose."""
    ends = [(joint.lower, joint.upper) for joint in (file, own)]
    known = None not in ends[0] and None not in ends[1]
    if known and not _same(*_from_reference(file, own, ends), tolerance):
        kind = LOST if np.isinf(np.array(ends[1], float)).all() else WRONG
        yield Difference(kind, "joint", file.name, "limits", list(ends[0]), list(ends[1]))
    for field in (*OF_JOINT, "pitch"):
        first, second = getattr(file, field), getattr(own, field)
        if first is None or second is None:
            continue
        values = _from_reference(file, own, [first, second]) if field == "rest" else (first, second)
        if not _same(*values, tolerance):
            kind = LOST if field not in ("rest", "reference") and _is_part(second, first) else WRONG
            yield Difference(kind, "joint", file.name, field, first, second)


def _is_part(own: Any, file: Any) -> bool:
    """Return whether nothing is left of the file's value, or only its first coefficients."""
    if not np.any(own):
        return True
    return isinstance(file, tuple) and len(own) < len(file) and np.allclose(own, file[: len(own)])


def _from_reference(file: Joint, own: Joint, values: Sequence[Any]) -> tuple[Any, Any]:
    """Return coordinates of both joints as displacements from the reference pose."""
    first, second = (np.array(value, float) for value in values)
    return first - (file.reference or 0.0), second - (own.reference or 0.0)


def _same(first: Any, second: Any, tolerance: float) -> bool:
    """Return whether numbers or coefficients agree; missing coefficients are zeros."""
    a, b = (np.atleast_1d(np.array(v, float)) for v in (first, second))
    size = max(len(a), len(b))
    a, b = (np.concatenate([v, np.zeros(size - len(v))]) for v in (a, b))
    infinite = np.isinf(a) | np.isinf(b)
    if not np.array_equal(a[infinite], b[infinite]):
        return False
    a, b = a[~infinite], b[~infinite]
    return bool(not len(a) or np.abs(a - b).max() <= tolerance * max(np.abs(a).max(), np.abs(b).max()))


def _of_loops(match: Match, tolerance: float) -> Iterator[Difference]:
    if match.own.loops is None:
        return
    for loop in match.file.loops or ():
        own = match.loops.get(loop.name)
        if own is None:
            yield Difference(LOST, "loop", loop.name, "loop", _said(loop), None)
            continue
        if own.type and own.type != loop.type:
            yield Difference(WRONG, "loop", loop.name, "type", loop.type, own.type)
        if bad := _anchors(match, loop, own, tolerance):
            yield Difference(WRONG, "loop", loop.name, "anchor", *bad)
    for own in match.own.loops:
        if own not in match.loops.values():
            yield Difference(ADDED, "loop", own.name or _said(own), "loop", None, _said(own))


def _said(loop: Loop) -> str:
    if not any(loop.bodies):
        return loop.type or "a constraint"
    return f"{loop.type} of {' and '.join(loop.bodies)}"


def _anchors(match: Match, file: Loop, own: Loop, tolerance: float) -> tuple[Any, Any] | None:
    """Return both anchors of a loop if they differ; a weld holds at every point."""
    if file.anchors is None or own.anchors is None or file.type == "fixed" or not all(file.anchors):
        return None
    is_turned = match.in_file(own.bodies) != match.of_file.pair(file.bodies)
    theirs = own.anchors[::-1] if is_turned else own.anchors
    apart = np.abs(np.array(file.anchors) - np.array(theirs)).max()
    return (list(file.anchors), list(theirs)) if apart > tolerance * match.size else None


def _of_couplings(match: Match, tolerance: float) -> Iterator[Difference]:
    if match.own.couplings is None:
        return
    of_file, of_reader = match.file.couplings or (), match.own.couplings
    for file in of_file:
        own = match.couplings.get(file.follower)
        if own is None:
            said = f"{file.follower} = {law(file)}"
            yield Difference(LOST, "coupling", file.follower, "coupling", said, None)
        elif own.coefficients:
            theirs = own if ending(own.follower) == ending(file.follower) else _inverse(own)
            laws = direct(file, of_file), direct(theirs, of_reader)
            names = sorted({ending(name) for each in laws for name, _ in each.others})
            sums = [{ending(name): factor for name, factor in each.others} for each in laws]
            more = [[each.get(name, 0.0) for name in names] for each in sums]
            same = _same(laws[0].coefficients, laws[1].coefficients, tolerance)
            if not (same and _same(more[0], more[1], tolerance)):
                yield Difference(WRONG, "coupling", file.follower, "law", law(file), law(theirs))
    for own in match.own.couplings:
        if own not in match.couplings.values():
            yield Difference(ADDED, "coupling", own.follower, "coupling", None, law(own))


def direct(coupling: Coupling, others: Sequence[Coupling]) -> Coupling:
    """Return the coupling of a follower to the first leader, if all laws between them are linear."""
    laws = {other.follower: other for other in others}
    for _ in others:
        outer = laws.get(coupling.leader)
        if outer is None or coupling.others or outer.others:
            break
        if max(len(coupling.coefficients), len(outer.coefficients)) > LINEAR:
            break
        offset, ratio = (*coupling.coefficients, 0.0, 0.0)[:LINEAR]
        first, slope = (*outer.coefficients, 0.0, 0.0)[:LINEAR]
        numbers = (offset + ratio * first, ratio * slope)
        coupling = Coupling(coupling.name, coupling.follower, outer.leader, numbers)
    return coupling


def _inverse(coupling: Coupling) -> Coupling:
    offset, ratio = (*coupling.coefficients, 0.0, 0.0)[:2]
    numbers = (-offset / ratio, 1.0 / ratio) if ratio else ()
    return Coupling(coupling.name, coupling.leader, coupling.follower, numbers)


def law(coupling: Coupling) -> str:
    """Return the law of a coupling, such as ``0.1 + 2 crank``."""
    leader = coupling.leader or "its leader"
    powers = ["", f" {leader}", *(f" {leader}^{k}" for k in range(2, len(coupling.coefficients)))]
    terms = [f"{c:.6g}{power}" for c, power in zip(coupling.coefficients, powers, strict=False) if c]
    terms += [f"{factor:.6g} {name}" for name, factor in coupling.others]
    return " + ".join(terms) or "0"


def _of_gravity(match: Match, tolerance: float) -> Iterator[Difference]:
    file, own = match.file.gravity, match.own.gravity
    if file is not None and own is not None and not _same(file, own, tolerance):
        yield Difference(WRONG, "gravity", "gravity", "gravity", list(file), list(own))
