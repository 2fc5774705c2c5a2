"""Laws of couplings: polynomials of joint coordinates, c₁ q + c₂ q² + …, whose sum is the offset."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from crosscheck.judge.joint_coordinates import COORDINATES, coordinates, pose_coordinates
from crosscheck.judge.joint_residuals import JointFrames, grounded, joint_frames, with_ground
from mbref.motions.trajectory import Trajectory
from mbref.scene import Coupling, Scene
from mbref.scene.joints import ANGLE

Law = tuple[float, ...]


def law_value(law: Sequence[Any], q: Any, derivative: int = 0) -> Any:
    """Return a law, or its first or second derivative, at coordinates q of any shape and arithmetic."""
    terms = list(enumerate(law, 1))
    for _ in range(derivative):
        terms = [(power - 1, power * factor) for power, factor in terms if power]
    total = 0 * q
    for power in range(terms[-1][0] if terms else -1, -1, -1):  # Horner's scheme
        total = total * q + sum(factor for own, factor in terms if own == power)
    return total


def coupled_rows(scene: Scene, term: Callable[[JointFrames, Law, int], np.ndarray]) -> dict[str, np.ndarray]:
    """Return the sum (…, 1) of the laws of each coupling's coordinates, or of its time derivatives; ``term``
    has the part of a joint's angle (column 0) or displacement (column 1)."""
    joints = {joint.name: joint for joint in joint_frames(scene)}
    found = {}
    for coupling in scene.coupling:
        ends = zip(scene.coupled(coupling), coupling.laws, strict=True)
        terms = [term(joints[j.name], law, COORDINATES.index(kind)) for (j, kind), law in ends]
        found[coupling.name] = sum(terms[1:], terms[0])[..., None]
    return found


def slope_at(joint: JointFrames, law: Law, column: int, motion: Sequence[np.ndarray], order: int = 1) -> Any:
    """Return the first or the second derivative of a law at poses (…); a law that bends depends on angles
    within half a turn (see ``unwound``)."""
    if len(law) == 1:
        return law[0] if order == 1 else 0.0
    return law_value(law, pose_coordinates(joint, *motion[:2])[..., column], order)


def from_coordinate(coupling: Coupling, moved: float) -> Coupling:
    """Return a coupling whose first coordinate counts from a place ``moved`` (rad or m): P(moved + q) -
    P(moved)."""
    if coupling.powers == 1:
        return coupling
    law, factorial, found = coupling.polynomial or (), 1.0, []
    terms: list[float] = [0.0, *law]
    for power in range(1, len(law) + 1):
        terms = [k * c for k, c in enumerate(terms)][1:]
        factorial *= power
        found.append(float(np.polyval(terms[::-1], moved)) / factorial)
    return coupling.model_copy(update={"polynomial": tuple(found)})


def bent_couplings(scene: Scene) -> list[Coupling]:
    """Return the couplings whose polynomials depend on the full turns of an angle."""
    return [c for c in scene.coupling if c.powers > 1 and scene.coupled(c)[0][1] == ANGLE]


def unwound(scene: Scene, motion: Trajectory) -> list[Scene]:
    """Return for each sample the scene whose couplings act alike at angles within half a turn, which a pose
    gives: polynomials of angles count from the full turns at this sample. They are NaN where full turns
    cannot be counted."""
    bent = bent_couplings(scene)
    if not bent or not len(motion.times):
        return [scene] * len(motion.times)
    pose = with_ground(motion.position, motion.orientation)
    spins, joints = grounded(motion.angular_velocity), {each.name: each for each in joint_frames(scene)}
    turns = []
    for coupling in bent:
        angle = coordinates(joints[coupling.joints[0]], motion.times, *pose, spins, motion.angles)[:, 0]
        turns.append(np.round(angle / (2 * np.pi)))
    found: dict[tuple[float, ...], Scene] = {(0.0,) * len(bent): scene}
    uncounted = np.isnan(turns).any(axis=0)
    keys = [tuple(row) for row in np.where(uncounted, np.inf, turns).T.tolist()]
    for key in keys:
        if key not in found:
            found[key] = _counted_from(scene, {c.name: 2 * np.pi * n for c, n in zip(bent, key, strict=True)})
    return [found[key] for key in keys]


def _counted_from(scene: Scene, moved: Mapping[str, float]) -> Scene:
    with np.errstate(invalid="ignore"):  # a law about an unknown angle is NaN
        couplings = [from_coordinate(each, moved.get(each.name, 0.0)) for each in scene.coupling]
    return scene.with_(coupling=couplings)
