"""Dampers between bodies in MuJoCo: damping of the tree's joint, or actuators whose forces are -damping times
their rates.

An actuator between two sites has the rate of one component of their relative motion as seen from the first
site. MuJoCo takes the first body's rotation from it where the first body carries the second one in the tree.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from crosscheck.engine import Cannot, Owner
from crosscheck.engines.shared.spanning_tree import (
    BALL_JOINT,
    COORDINATES,
    FREE,
    GROUND_LINK,
    TURN,
    Tree,
    spanning_tree,
)
from mbref.scene import GROUND, PointDamper, RotationalDamper, Scene

Damper = RotationalDamper | PointDamper


def turning_joints(scene: Scene, tree: Tree, load: Damper) -> list[int]:
    """Return the first velocities of the hinges and the ball of the tree's joint between the bodies of a
    rotational damper; none if the tree has no such joint."""
    for k, link in enumerate(tree.links) if isinstance(load, RotationalDamper) else ():
        joint = scene.joint[link.joint] if link.joint >= 0 else None
        if joint and joint.type != "distance" and {*joint.bodies} == {*load.bodies}:
            counts = [COORDINATES[each.kind] for each in link.mobilities]
            places = enumerate(link.mobilities)
            return [tree.starts[k] + sum(counts[:i]) for i, each in places if each.kind in (TURN, BALL_JOINT)]
    return []


def of_free_link(scene: Scene, tree: Tree, k: int) -> list[Damper]:
    """Return the rotational and the point damper that together are the damping of a link's free joint: equal
    numbers against the ground, at the centre of mass; none otherwise."""
    link = tree.links[k]
    if link.joint >= 0 or link.parent != GROUND_LINK or [each.kind for each in link.mobilities] != [FREE]:
        return []
    body = scene.body[link.body]
    found = [x for x in scene.load if isinstance(x, Damper) and x.bodies == (GROUND, body.name)]
    turners = [x for x in found if isinstance(x, RotationalDamper)]
    others = [x for x in found if isinstance(x, PointDamper) and x.point == body.position]
    alone = len(turners) == len(others) == 1 and turners[0].damping == others[0].damping
    return [*turners, *others] if alone else []


def points_of(load: Damper, centres: Sequence[np.ndarray]) -> Sequence[Any]:
    """Return the points (world at t = 0) of both sites of a damper, for the centres of its bodies' links."""
    return (load.point, load.point) if isinstance(load, PointDamper) else centres


def add_actuators(mujoco: Any, spec: Any, name: str, sites: Sequence[str], load: Damper) -> None:
    """Add the actuators of a damper between two sites, one along each axis of the first."""
    gears = np.eye(6)[:3] if isinstance(load, PointDamper) else np.eye(6)[3:]
    for axis, gear in zip("xyz", gears, strict=True):
        actuator = spec.add_actuator(name=f"{name}.{axis}", refsite=sites[0], target=sites[1], gear=gear)
        actuator.trntype, actuator.biastype = mujoco.mjtTrn.mjTRN_SITE, mujoco.mjtBias.mjBIAS_AFFINE
        actuator.gainprm[0], actuator.biasprm[2] = 0.0, -load.damping


def refusal(scene: Scene) -> Cannot | None:
    """Refuse a point damper whose first body does not carry the second one in the tree."""
    damped = [
        (k, x) for k, x in enumerate(scene.load) if isinstance(x, PointDamper) and x.bodies[0] != GROUND
    ]
    if not damped:
        return None
    tree = spanning_tree(scene)
    for k, load in damped:
        first, link = (GROUND_LINK if n == GROUND else tree.link_of(scene.body_index(n)) for n in load.bodies)
        while link not in (first, GROUND_LINK):
            link = tree.links[link].parent
        if link != first:
            why = f"load[{k}] damps a point as seen from {load.bodies[0]!r}, which does not carry it"
            return Cannot(Owner.ENGINE, f"{why} in the tree; no actuator of MuJoCo has such a force")
    return None
