"""Initial joint velocities of a tree that give the bodies the scene's consistent velocities."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from crosscheck.engine import Cannot, Owner
from crosscheck.engines.shared.driver_motion import motion
from crosscheck.engines.shared.geometry import cross_matrix
from crosscheck.engines.shared.spanning_tree import (
    BALL_JOINT,
    FREE,
    GROUND_LINK,
    SLIDE,
    TURN,
    Link,
    Tree,
    spanning_tree,
)
from crosscheck.judge.constraints import initial_poses, initial_twists, jacobian
from mbref.scene import Distance, Scene

RANK_TOLERANCE = 1e-9  # relative to the largest singular value


def lacks_mass(scene: Scene) -> Cannot | None:
    """Return the refusal of a scene without masses whose drivers do not determine the whole motion, or with
    massless links that a tree cannot have; None for all other scenes."""
    if any(body.mass == 0 for body in scene.body) and (reason := _unusable(scene)):
        return Cannot(Owner.ADAPTER, reason)
    if scene.has_mass() or not may_move_freely(scene):
        return None
    without = ", ".join(body.name for body in scene.body if body.mass is None)
    return Cannot(Owner.MODEL, f"the drivers do not prescribe the whole motion, and {without} has no mass")


def _unusable(scene: Scene) -> str:
    """Return why a tree cannot have a massless link; empty if it can have all.

    The rod of a distance joint takes its mass from the bodies at its ends. A link that moves no mass makes
    the mass matrix in joint coordinates singular, although closures may determine its motion.
    """
    massless = {body.name for body in scene.body if body.mass == 0}
    for joint in scene.joint:
        if isinstance(joint, Distance) and (at := massless.intersection(joint.bodies)):
            rod = f"distance joint {joint.name!r} at the massless link {min(at)!r}"
            return f"{rod}: its rod takes mass from the bodies at its ends"
    links = spanning_tree(scene).links
    moved = [link.mass for link in links]
    for k in reversed(range(len(links))):  # parents come first
        if links[k].parent != GROUND_LINK:
            moved[links[k].parent] += moved[k]
    for link, mass in zip(links, moved, strict=True):
        if link.freedoms and not mass:
            return f"massless link {scene.body[link.body].name!r}: it moves no mass in the tree of joints"
    return ""


def may_move_freely(scene: Scene) -> bool:
    """Return whether joints and drivers leave a degree of freedom at t = 0."""
    rows, _ = jacobian(scene, 0.0, *initial_poses(scene))
    return bool(np.linalg.matrix_rank(rows, RANK_TOLERANCE) < 6 * len(scene.body))


def initial_rates(scene: Scene, tree: Tree) -> np.ndarray:
    """Return joint velocities (nv,) at t = 0, in the order of the tree's links.

    The bodies move with `constraints.initial_twists`, parts of split bodies with their bodies, and rods do
    not spin about their own axes. Raises SceneError if the given velocities contradict the joints.
    """
    if tree.nv == 0:
        return np.zeros(0)
    twists = np.hstack(initial_twists(scene))
    rows, values = [], []
    for link, of_rates in zip(tree.links, twist_maps(tree), strict=True):
        if link.body >= 0:
            rows.append(of_rates)
            values.append(twists[link.body])
        else:
            ends = link.ends
            rows += [_at(of_rates, link, point)[:3] for _, point in ends]
            values += [_velocity(scene, twists, body, point) for body, point in ends]
            rows.append((ends[1][1] - ends[0][1])[None] @ of_rates[3:])
            values.append(np.zeros(1))
    rates = np.linalg.lstsq(np.vstack(rows), np.concatenate(values))[0]
    for i, driver in tree.driven(scene):
        rates[i] = motion(driver, 0.0)[1]
    return rates


def twist_maps(tree: Tree) -> np.ndarray:
    """Return (links, 6, nv): velocity of each link's frame and angular velocity (world) at t = 0 for unit
    joint velocities."""
    maps = np.zeros((len(tree.links), 6, tree.nv))
    for k, link in enumerate(tree.links):
        if link.parent != GROUND_LINK:
            maps[k] = _at(maps[link.parent], tree.links[link.parent], link.position)
        maps[k, :, tree.starts[k] : tree.starts[k] + link.freedoms] = _joint_map(link)
    return maps


def _at(twist_map: np.ndarray, link: Link, point: np.ndarray) -> np.ndarray:
    """Return (6, nv): the twist of a link at a point (world) instead of at its frame."""
    linear, angular = twist_map[:3], twist_map[3:]
    return np.vstack([linear - cross_matrix(point - link.position) @ angular, angular])


def _joint_map(link: Link) -> np.ndarray:
    """Return (6, freedoms): the twist of the link's frame for unit velocities of its own joint."""
    turning = np.vstack([-cross_matrix(link.position - link.anchor), np.eye(3)])
    sliding = np.vstack([np.eye(3), np.zeros((3, 3))])
    of_kind: dict[str, Callable[[np.ndarray], np.ndarray]] = {
        SLIDE: lambda axis: sliding @ axis[:, None],
        TURN: lambda axis: turning @ axis[:, None],
        BALL_JOINT: lambda axis: turning,
        FREE: lambda axis: np.eye(6),
    }
    return np.hstack([np.zeros((6, 0)), *(of_kind[m.kind](m.axis) for m in link.mobilities)])


def _velocity(scene: Scene, twists: np.ndarray, body: int, point: np.ndarray) -> np.ndarray:
    """Return the velocity (3,) of a point (world) of a body; zero for the ground (-1)."""
    if body < 0:
        return np.zeros(3)
    arm = point - np.array(scene.body[body].position)
    return twists[body, :3] + np.cross(twists[body, 3:], arm)
