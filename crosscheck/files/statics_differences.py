"""Differences between an engine's own mass matrix and gravity torques and the ones of the file's machine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from crosscheck.engines.loaders.machine import Machine, Statics
from crosscheck.files.differences import WRONG, Difference
from crosscheck.files.matching import Match, ending
from crosscheck.files.merged import size_of
from crosscheck.files.statics import Pose, reduced, statics_of

SMALL = 1e-6  # mass matrix or gravity torque / its size for the whole machine; smaller entries are rounding
Worst = dict[str, tuple[float, Difference]]  # largest relative difference of each quantity of statics


def of_statics(
    match: Match, own: Sequence[Statics], poses: Sequence[Pose], gravity: Any, tolerance: float
) -> list[Difference]:
    """Return the largest difference of mass matrices, gravity torques and centres of mass over the poses.

    They are compared if the reader has the file's joints, or all but followers.
    """
    file = match.file
    called = {joint.name: name for name, joint in match.joints.items()}
    worst: Worst = {}
    size, heavy = size_of(file), sum(body.mass or 0.0 for body in file.bodies)
    for pose, found in zip(poses, own, strict=False):
        moved = any(pose.values())  # by names: joints found by geometry stayed where they were
        names = {ending(n) if moved else called.get(n, ending(n)): n for n in found.joints}
        right = statics_of(file, pose, gravity)
        if found.mass is None:
            _note_places(worst, file, right, found)
        followers = {c.follower for c in file.couplings or ()}
        if {n for n in right.joints if n not in followers} - names.keys():
            continue
        kept = [n for n in right.joints if n in names]
        right = reduced(right, kept, file.couplings or (), pose)
        order = [found.joints.index(names[n]) for n in kept]
        if found.mass is not None and kept:
            mass = np.array(found.mass)[np.ix_(order, order)]
            _note(worst, "mass matrix", kept, np.array(right.mass), mass, heavy * size**2)
        if found.gravity is not None and kept:
            torque = np.array(found.gravity)[order]
            weight = heavy * size * float(np.linalg.norm(gravity))
            _note(worst, "gravity torque", kept, np.array(right.gravity), torque, weight)
    return [difference for size, difference in worst.values() if size > tolerance]


def _note_places(
    worst: dict[str, tuple[float, Difference]], file: Machine, right: Statics, own: Statics
) -> None:
    """Keep the largest distance of centres of mass of a reader that has only kinematics."""
    size = size_of(file)
    for body in file.bodies:
        if body.mass and body.name in own.centres:
            place, other = (np.array(s.centres[body.name]) for s in (right, own))
            apart = float(np.abs(place - other).max()) / size
            if apart > worst.get("place", (0.0, None))[0]:
                values = place.tolist(), other.tolist()
                worst["place"] = apart, Difference(WRONG, "statics", body.name, "place", *values)


def _note(worst: Worst, field: str, names: Sequence[str], right: Any, found: Any, whole: float) -> None:
    """Keep the difference of two arrays, relative to the largest entry, if it is the largest so far.

    ``whole`` is the size of the quantity for the whole machine: entries below SMALL of it are zeros.
    """
    scale = float(max(np.abs(right).max(), np.abs(found).max(), SMALL * whole)) or 1.0
    apart = np.abs(right - found) / scale
    size = float(apart.max())
    if size > worst.get(field, (0.0, None))[0]:
        place = np.unravel_index(int(apart.argmax()), apart.shape)
        where = ", ".join(dict.fromkeys(names[int(k)] for k in place))
        values = float(right[place]), float(found[place])
        worst[field] = size, Difference(WRONG, "statics", where, field, *values)
