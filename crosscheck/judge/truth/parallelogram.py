"""Cranks that turn by equal angles about parallel axes, and bodies that they move without rotation.

One crank alone is a pendulum; two of equal length and a coupler are a parallelogram, more couplers the
five-bar.  On this branch every crank has turned by the same angle θ - θ₀, and a coupler has moved along
the circle of the crank pin that holds it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crosscheck.judge.loads import initial_rotations
from crosscheck.judge.tolerances import PARALLEL
from crosscheck.judge.truth.one_dof import DrivenSign, Path, Pose, circle, turned
from crosscheck.judge.truth.picard import REAL
from mbref.scene import GROUND, Cylindrical, Distance, Driver, Revolute, Scene


def parallelogram(scene: Scene) -> Path | None:
    """Return the path of a scene that may be such a parallelogram, or None."""
    pivots = pivots_of(scene)
    if not pivots:
        return None
    axis = unit(next(iter(pivots.values())).axis)
    if any(abs(abs(unit(joint.axis) @ axis) - 1) > PARALLEL for joint in pivots.values()):
        return None
    arms = [arm for body in scene.body if (arm := _arm(scene, pivots, body.name)) is not None]
    if len(arms) < len(scene.body):
        return None
    turns = np.array([float(body.name in pivots) for body in scene.body])
    rotation0 = initial_rotations(scene)
    position0 = np.array([body.position for body in scene.body])

    def poses(q: np.ndarray) -> Pose:
        arcs = [circle(axis, q, arm) for arm in arms]
        position, dposition, ddposition = (np.stack([a[order] for a in arcs], axis=1) for order in range(3))
        rotation = np.stack(
            [turned(axis, q * turn) @ r for turn, r in zip(turns, rotation0, strict=True)], axis=1
        )
        spin = np.ones_like(q)[:, None, None] * turns[:, None] * axis
        moved = position - np.array(arms) + position0
        return Pose(moved, rotation, q[:, None] * turns, dposition, ddposition, spin, np.zeros_like(spin))

    return Path(
        "pendulum" if len(arms) == 1 else "parallelogram", poses, axis, turning_driver(scene, axis, turns)
    )


def pivots_of(scene: Scene) -> dict[str, Revolute]:
    """Return the revolute joints to the ground, by the body that they carry."""
    found = [j for j in scene.joint if isinstance(j, Revolute) and GROUND in j.bodies]
    return {name: joint for joint in found for name in joint.bodies if name != GROUND}


def turning_driver(scene: Scene, axis: np.ndarray, turns: np.ndarray) -> DrivenSign:
    """Return the function driven_sign of a path whose bodies turn by `turns` (nb,) times q about `axis`."""

    def sign(driver: Driver) -> float | None:
        joint = next(j for j in scene.joint if j.name == driver.joint)
        if not isinstance(joint, Revolute | Cylindrical):
            return None
        first, second = (0.0 if n == GROUND else turns[scene.body_index(n)] for n in joint.bodies)
        along = float(unit(joint.axis) @ axis) * (second - first)
        return along if abs(abs(along) - 1) < PARALLEL else None

    return sign


def unit(vector: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return the vector (3,) at length one, in extended precision."""
    given = np.array(vector, dtype=REAL)
    return given / np.sqrt(np.sum(given * given))


def _arm(scene: Scene, pivots: dict[str, Revolute], name: str) -> np.ndarray | None:
    """Return the vector from a pivot to the point that moves with a body's centre: the centre of a crank, the
    crank pin of a coupler."""
    if name in pivots:
        return np.array(scene.body[scene.body_index(name)].position) - np.array(pivots[name].anchor)
    for joint in scene.joint:
        if name in joint.bodies and not isinstance(joint, Distance):
            other = joint.bodies[1 - joint.bodies.index(name)]
            if other in pivots:
                return np.array(joint.anchor) - np.array(pivots[other].anchor)
    return None
