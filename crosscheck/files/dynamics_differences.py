"""Differences between an engine's rows, accelerations and motion and the ones of the file's machine."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from crosscheck.engines.loaders.constrained import DEPENDENT
from crosscheck.engines.loaders.machine import Machine, Rows
from crosscheck.engines.loaders.posed import Pose
from crosscheck.files.constraints import constraints, rows_of, scales
from crosscheck.files.differences import WRONG, Difference
from crosscheck.files.matching import Match, ending

UNUSED = ("read, and not used by its dynamics", "read, and used by its dynamics in the first number only")
SMALLEST = {"acceleration": 1e-3, "displacement": 1e-6}  # rad or m, and s; less is rounding of zeros
Values = Sequence[Mapping[str, float]]


def of_rows(match: Match, own: Sequence[Rows], poses: Sequence[Pose], tolerance: float) -> list[Difference]:
    """Return the loops and couplings that an engine's rows do not hold, and whether it holds more.

    Rows differ by scale and order, so that the spaces are compared that the rows span.
    """
    file, size = match.file, match.size
    unit = scales(file, size)
    for pose, found in zip(poses, own, strict=False):
        names = rows_of(file, pose, size).joints
        if set(names) - {ending(name) for name in found.joints}:
            return []
        theirs = Rows(tuple(map(ending, found.joints)), found.matrix).of(names) * unit
        ours = [(each, each.rows * unit) for each in constraints(file, pose, size)]
        spanned = [_spanned(rows) for rows in (theirs, np.vstack([rows for _, rows in ours]))]
        lost = [
            Difference(WRONG, each.kind, each.name, "Jacobian", "held", f"open by {angle:.3g} rad")
            for each, rows in ours
            if (angle := _angle(_spanned(rows), spanned[0])) > tolerance
        ]
        if not lost and len(spanned[0]) > len(spanned[1]):
            ranks = len(spanned[1]), len(spanned[0])
            lost = [Difference(WRONG, "statics", "loops and couplings", "rank of the rows", *ranks)]
        if lost:
            return lost
    return []


def _spanned(rows: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (k, n) of the space that rows (m, n) span."""
    _, values, across = np.linalg.svd(rows, full_matrices=False)
    return np.asarray(across[values > DEPENDENT * max(values, default=0.0)])


def _angle(rows: np.ndarray, space: np.ndarray) -> float:
    """Return the largest angle (rad) between directions of orthonormal rows and a space."""
    outside = rows - rows @ space.T @ space
    return float(np.arcsin(min(1.0, float(np.linalg.norm(outside, 2))))) if len(rows) else 0.0


def of_values(
    match: Match, own: Values, right: Callable[[Machine], Values], field: str, tolerance: float
) -> list[Difference]:
    """Return the largest difference of a quantity of joints, such as accelerations, relative to the largest.

    ``right`` computes it for a machine. If it is the quantity without dampers or springs, or with the linear
    ones alone, the numbers of these are returned.
    """
    size, found = _worst(match.file, own, right, field)
    if found is None or size <= tolerance:
        return []
    for part, (kept, words) in itertools.product(("damping", "stiffness"), enumerate(UNUSED)):
        having = [joint for joint in match.file.joints if len(getattr(joint, part) or ()) > kept]
        less: dict[str, Any] = {j.name: {part: getattr(j, part)[:kept]} for j in having}
        joints = tuple(replace(joint, **less.get(joint.name, {})) for joint in match.file.joints)
        rest, known = _worst(replace(match.file, joints=joints), own, right, field)
        if having and known and rest <= tolerance:
            return [Difference(WRONG, "joint", j.name, part, getattr(j, part), words) for j in having]
    return [found]


def _worst(
    machine: Machine, own: Values, right: Callable[[Machine], Values], field: str
) -> tuple[float, Difference | None]:
    """Return the largest relative difference; none if the reader lacks a joint other than followers, or if
    the right values are unknown."""
    followers = {coupling.follower for coupling in machine.couplings or ()}
    pairs: list[tuple[str, float, float]] = []
    for found, expected in zip(own, right(machine) if own else (), strict=False):
        named = {ending(name): value for name, value in found.items()}
        if expected.keys() - named.keys() - followers:
            return 0.0, None
        pairs += [(name, value, named[name]) for name, value in expected.items() if name in named]
    if not pairs:
        return 0.0, None
    sizes = [abs(value) for _, *both in pairs for value in both]
    scale = max([SMALLEST[field], *(size for size in sizes if math.isfinite(size))])
    gaps = [abs(other - value) / scale for _, value, other in pairs]
    gaps = [gap if math.isfinite(gap) else math.inf for gap in gaps]
    (name, value, other), largest = pairs[int(np.argmax(gaps))], max(gaps)
    return largest, Difference(WRONG, "motion", name, field, value, other)
