"""Parts of a reader's machine that stand for parts of the file: by names, and then by geometry."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from crosscheck.engines.loaders.loader import DOUBLE
from crosscheck.engines.loaders.machine import (
    REVOLUTE,
    SCALAR,
    TRANSLATIONAL,
    Coupling,
    Joint,
    Loop,
    Machine,
)
from crosscheck.files.merged import NO_MASS, Group, Merged, merged, size_of

Part = TypeVar("Part")
COUNTS = {  # slides and turns of a chain, and the joint that they are together
    (2, 1): "planar",
    (0, 3): "spherical",
    (0, 2): "universal",
    (3, 3): "free",
    (1, 1): "screw",
}

WITH_AXIS = ("planar", "screw")


@dataclass(frozen=True)
class Match:
    """A file's machine and a reader's machine, and which of its parts stand for which parts of the file.

    ``groups`` maps the numbers of the reader's groups to the file's, with -1 for the world. ``chains`` are
    joints with one coordinate each by which a reader describes a joint with several, and ``covered`` are
    such joints of the file with the reader's joint that they are together.
    """

    file: Machine
    own: Machine
    size: float
    of_file: Merged
    of_reader: Merged
    groups: dict[int, int]
    joints: dict[str, Joint]
    loops: dict[str, Loop]
    couplings: dict[str, Coupling]
    chains: dict[str, list[Joint]]
    covered: dict[str, Joint]

    @property
    def used(self) -> list[Joint]:
        """Return the reader's joints that stand for joints of the file."""
        chains = [joint for chain in self.chains.values() for joint in chain]
        return [*self.joints.values(), *self.covered.values(), *chains]

    def in_file(self, pair: Sequence[str]) -> tuple[int | None, ...]:
        """Return the file's groups of two bodies of the reader; None for a body that the file lacks."""
        return tuple(self.groups.get(k) for k in self.of_reader.pair(pair))


def matched(file: Machine, own: Machine, tolerance: float) -> Match:
    """Return the match; ``tolerance`` is a part of the machine's size and mass."""
    size, left, right = size_of(file), merged(file), merged(own)
    groups = _groups(left, right, size, tolerance)
    match = Match(file, own, size, left, right, groups, {}, {}, {}, {}, {})
    loops = own.loops or ()
    match.covered.update(_covered(match))
    wanted = [joint for joint in left.joints if joint.name not in match.covered]
    others = [joint for joint in right.joints if joint not in match.covered.values()]
    match.joints.update(_by_name_then(wanted, others, lambda a, b: _alike(match, a, b)))
    match.chains.update(_chains(match))
    for name, chain in match.chains.items():
        match.joints[name] = _joined(name, chain)
    as_loops = [_as_loop(joint) for joint in right.joints if joint not in match.used]
    match.loops.update(
        _by_name_then(file.loops or (), [*loops, *as_loops], lambda a, b: _same_loop(match, a, b))
    )
    laws, theirs = file.couplings or (), own.couplings or ()
    match.couplings.update(_by_name_then(laws, theirs, _same_coupling, lambda c: c.follower))
    return match


def _as_loop(joint: Joint) -> Loop:
    anchors = None if joint.anchor is None else (joint.anchor, joint.anchor)
    return Loop(joint.name, joint.type, joint.bodies, anchors)


def ending(name: str) -> str:
    """Return a name without the names of models that readers put before it."""
    return re.split(r"::|/", name)[-1]


def _groups(left: Merged, right: Merged, size: float, tolerance: float) -> dict[int, int]:
    found = {-1: -1}
    numbers = {name: k for k, group in enumerate(left.groups) for name in group.names}
    endings = {ending(name): k for name, k in numbers.items()}
    for k, group in enumerate(right.groups):
        known = [numbers[n] for n in group.names if n in numbers]
        known = known or [endings[ending(n)] for n in group.names if ending(n) in endings]
        if known:
            found[k] = known[0]
    free = [k for k in range(len(left.groups)) if k not in found.values()]
    for k, group in enumerate(right.groups):
        alike = [n for n in free if k not in found and _same_group(left.groups[n], group, size, tolerance)]
        if alike:
            found[k] = alike[0]
            free.remove(alike[0])
    return found


def _same_group(first: Group, second: Group, size: float, tolerance: float) -> bool:
    if first.centre is None or second.centre is None or not first.mass or not second.mass:
        return False
    is_near = np.abs(first.centre - second.centre).max() <= tolerance * size
    return bool(is_near and abs(first.mass - second.mass) <= tolerance * first.mass)


def _by_name_then(
    wanted: Iterable[Part],
    found: Iterable[Part],
    alike: Callable[[Part, Part], bool],
    name_of: Callable[[Part], str] = lambda part: str(part.name),  # type: ignore[attr-defined]
) -> dict[str, Part]:
    """Return the part that stands for each wanted one, by its name, else by likeness."""
    free, pairs, wanted = list(found), dict[str, Part](), list(wanted)
    for exact, part in itertools.product((True, False), wanted):
        name = name_of(part)
        same = [f for f in free if (name_of(f) == name if exact else ending(name_of(f)) == ending(name))]
        if name not in pairs and same:
            pairs[name] = same[0]
            free.remove(same[0])
    for part in wanted:
        if name_of(part) not in pairs and (same := [f for f in free if alike(part, f)]):
            pairs[name_of(part)] = same[0]
            free.remove(same[0])
    return pairs


def _alike(match: Match, first: Joint, second: Joint) -> bool:
    """Return whether two joints of one type have the same bodies, or a hinge the same line."""
    pair = match.in_file(second.bodies)
    own = match.of_file.pair(first.bodies)
    return first.type == second.type and (pair in (own, own[::-1]) or _same_line(match, first, second))


def _same_line(match: Match, first: Joint, second: Joint) -> bool:
    if first.type != REVOLUTE or None in (first.axis, second.axis, first.anchor, second.anchor):
        return False
    axes, points = np.array([first.axis, second.axis]), np.array([first.anchor, second.anchor])
    apart = np.cross(points[1] - points[0], axes[0])
    return bool(np.abs(np.cross(*axes)).max() <= DOUBLE and np.abs(apart).max() <= DOUBLE * match.size)


def _covered(match: Match) -> dict[str, Joint]:
    """Return the file's joints of one body with one coordinate each that a reader describes as one joint."""
    found: dict[str, Joint] = {}
    for k, number in match.groups.items():
        chain = [j for j in match.of_file.joints if match.of_file.pair(j.bodies)[1] == number]
        own = [j for j in match.of_reader.joints if match.of_reader.pair(j.bodies)[1] == k]
        counts = _counts(chain)
        together = {COUNTS.get(counts), "cylindrical" if counts == (1, 1) else ""}
        if len(chain) == sum(counts) > 1 and len(own) == 1 and own[0].type in together:
            found |= {joint.name: own[0] for joint in chain}
    return found


def _chains(match: Match) -> dict[str, list[Joint]]:
    """Return the reader's joints with one coordinate that stand for joints of the file with several."""
    free = [j for j in match.of_reader.joints if j not in match.used and j.type in SCALAR]
    found: dict[str, list[Joint]] = {}
    for joint in match.of_file.joints:
        wanted = [k for k, kind in COUNTS.items() if kind == joint.type]
        if joint.name in match.joints or not wanted:
            continue
        child = match.of_file.pair(joint.bodies)[1]
        chain = [j for j in free if match.in_file(j.bodies)[1] == child]
        own = [j for j in chain if ending(j.name).rpartition(":")[0] == joint.name]
        if own or _counts(chain) in wanted:
            found[joint.name] = own or chain
    return found


def _joined(name: str, chain: Sequence[Joint]) -> Joint:
    """Return the joint with several coordinates that a chain describes."""
    slides, turns = _counts(chain)
    kind = COUNTS.get((slides, turns), f"{slides} slides and {turns} turns")
    pair = chain[0].bodies[0], chain[-1].bodies[1]
    axis = next((j.axis for j in chain if j.type == REVOLUTE), None) if kind in WITH_AXIS else None
    return Joint(name, kind, pair, chain[-1].anchor, axis)


def _counts(chain: Sequence[Joint]) -> tuple[int, int]:
    """Return the numbers of slides and of turns."""
    return sum(j.type == TRANSLATIONAL for j in chain), sum(j.type == REVOLUTE for j in chain)


def _same_loop(match: Match, first: Loop, second: Loop) -> bool:
    own = match.of_file.pair(first.bodies)
    return not any(second.bodies) or match.in_file(second.bodies) in (own, own[::-1])


def _same_coupling(first: Coupling, second: Coupling) -> bool:
    ends = {ending(first.follower), ending(first.leader)}
    return not second.follower or ends == {ending(second.follower), ending(second.leader)}


def lost_groups(match: Match) -> list[Group]:
    """Return the file's groups with mass that the reader does not have."""
    known = set(match.groups.values())
    total = sum(group.mass or 0.0 for group in match.of_file.groups)
    parts = enumerate(match.of_file.groups)
    return [g for k, g in parts if k not in known and (g.mass or 0.0) > NO_MASS * total]


def added_groups(match: Match) -> list[Group]:
    """Return the reader's groups with mass that stand for nothing in the file."""
    total = sum(group.mass or 0.0 for group in match.of_file.groups)
    parts = enumerate(match.of_reader.groups)
    return [g for k, g in parts if k not in match.groups and (g.mass or 0.0) > NO_MASS * total]
