"""Loops and couplings of a machine in joint coordinates: errors, Jacobian, and poses that obey them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from crosscheck.engines.loaders.constrained import DEPENDENT
from crosscheck.engines.loaders.machine import REVOLUTE, SCALAR, Coupling, Loop, Machine, Rows, matrix
from crosscheck.engines.loaders.placing import Place, vector_of
from crosscheck.engines.loaders.posed import Pose, Posed
from mbref import rotations

ALL, ACROSS, ALONG, NONE = "all", "across", "along", "none"  # directions, relative to the axis
LOCKED = {  # type of a loop: directions in which relative displacements and rotations are locked
    "spherical": (ALL, NONE),
    "fixed": (ALL, ALL),
    "revolute": (ALL, ACROSS),
    "translational": (ACROSS, ALL),
    "cylindrical": (ACROSS, ACROSS),
    "planar": (ALONG, ACROSS),
}
CLOSED = 1e-11  # error / size, or rad, of a pose that obeys the constraints
ROUNDS = 40  # of Newton's method, which converges in about six or not at all
LONGEST = 0.5  # rad or sizes, of a step
SMALLER = (1.0, 0.5, 0.25, 0.1)  # parts of a random pose from which a closed pose is sought


class Constraint(NamedTuple):
    """A loop or coupling by its kind and name: errors (m,) and rows (m, n); lengths relative to the size."""

    kind: str
    name: str
    error: np.ndarray
    rows: np.ndarray


def unknown(machine: Machine) -> str:
    """Return why the rows of a machine are unknown; empty if they are known."""
    single = {joint.name for joint in machine.joints if joint.type in SCALAR}
    if not single:
        return "no hinge or slide"
    for loop in machine.loops or ():
        if loop.type not in LOCKED or loop.anchors is None or not all(loop.anchors):
            return f"loop {loop.name} of type {loop.type}"
        if loop.axis is None and {ACROSS, ALONG} & set(LOCKED[loop.type]):
            return f"loop {loop.name} without a known axis"
    for coupling in machine.couplings or ():
        if not {coupling.follower, *coupling.slopes({})} <= single:
            return f"coupling {coupling.name or coupling.follower} of other joints than hinges and slides"
    return ""


def constraints(machine: Machine, pose: Mapping[str, float], size: float) -> Iterator[Constraint]:
    """Yield the constraints at a pose; ``size`` is the machine's, m."""
    at = Posed(machine, pose)
    for loop in machine.loops or ():
        yield _of_loop(loop, at, size)
    for coupling in machine.couplings or ():
        yield _of_coupling(coupling, at, pose)


def rows_of(machine: Machine, pose: Mapping[str, float], size: float) -> Rows:
    """Return the Jacobian of all constraints."""
    found = [row for each in constraints(machine, pose, size) for row in each.rows]
    return Rows(Posed(machine, pose).joints, matrix(found))


def _of_loop(loop: Loop, at: Posed, size: float) -> Constraint:
    assert loop.anchors is not None
    first, second = (at.places[body] for body in loop.bodies)
    ends = [np.array(place.point(p)) for place, p in zip((first, second), loop.anchors, strict=True)]
    relative = at.columns(loop.bodies[0], ends[1]) - at.columns(loop.bodies[1], ends[1])
    shift, turn = (_directions(kind, loop, first) for kind in LOCKED[loop.type])
    error = [shift @ (ends[0] - ends[1]) / size, turn @ _rotation(loop, first, second)]
    return Constraint(
        "loop",
        loop.name,
        np.concatenate(error),
        np.vstack([shift @ relative[:3] / size, turn @ relative[3:]]),
    )


def _directions(kind: str, loop: Loop, first: Place) -> np.ndarray:
    """Return the locked directions (k, 3), which the first body carries."""
    if kind in (ALL, NONE):
        return np.eye(3)[: 3 if kind == ALL else 0]
    axis = rotations.unit(np.array(loop.axis))[None]
    return np.asarray((axis if kind == ALONG else np.linalg.svd(axis)[2][1:]) @ first.turn.T)


def _rotation(loop: Loop, first: Place, second: Place) -> np.ndarray:
    """Return the rotation from the second body to the first, rad, or of the axis if it is free."""
    if loop.axis is None or LOCKED[loop.type][1] == ALL:
        return vector_of(first.turn @ second.turn.T)
    return np.cross(second.direction(loop.axis), first.direction(loop.axis))


def _of_coupling(coupling: Coupling, at: Posed, pose: Mapping[str, float]) -> Constraint:
    row = np.zeros(len(at.joints))
    row[at.joints.index(coupling.follower)] = 1.0
    for name, slope in coupling.slopes(pose).items():
        row[at.joints.index(name)] -= slope
    error = pose.get(coupling.follower, 0.0) - coupling.value(pose)
    return Constraint("coupling", coupling.follower, np.array([error]), row[None])


def scales(machine: Machine, size: float) -> np.ndarray:
    """Return the unit of each hinge (1 rad) and slide (the machine's size, m)."""
    single = [joint for joint in machine.joints if joint.type in SCALAR]
    return np.array([1.0 if joint.type == REVOLUTE else size for joint in single])


def closed(machine: Machine, pose: Pose, size: float) -> Pose | None:
    """Return the near pose that obeys the constraints; None if Newton's method finds none."""
    for part in SMALLER:
        at = {name: part * value for name, value in pose.items()}
        for _ in range(ROUNDS):
            found = list(constraints(machine, at, size))
            error = np.concatenate([each.error for each in found])
            if np.abs(error).max() <= CLOSED:
                return at
            unit = scales(machine, size)
            rows = np.vstack([each.rows for each in found]) * unit
            step = -np.linalg.lstsq(rows, error, rcond=DEPENDENT)[0]
            step *= min(1.0, LONGEST / max(float(np.abs(step).max()), LONGEST)) * unit
            names = Posed(machine, at).joints
            at = {**at, **{name: at.get(name, 0.0) + float(x) for name, x in zip(names, step, strict=True)}}
    return None


def projected(machine: Machine, pose: Pose, rates: Pose, size: float) -> Pose:
    """Return the nearest rates that the constraints admit."""
    rows, unit = rows_of(machine, pose, size), scales(machine, size)
    v = np.array([rates[name] for name in rows.joints]) / unit
    v = v - np.linalg.pinv(rows.of(rows.joints) * unit, rcond=DEPENDENT) @ (rows.of(rows.joints) * unit @ v)
    return dict(zip(rows.joints, (v * unit).tolist(), strict=True))
