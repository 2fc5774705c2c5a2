"""Joint reactions of a tree by Newton-Euler recursion, from an engine's accelerations and closure forces.

Wrenches are (force, moment about the world's origin), world axes.  In redundant joints the reaction depends
on the engine. If a body was split at a cut joint, the joint of its second part has the reaction of the cut
joint.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from crosscheck.engines.shared.sampling import UNKNOWN, Sample
from crosscheck.engines.shared.spanning_tree import GROUND_LINK, Tree
from crosscheck.engines.shared.spring_force import spring_force
from crosscheck.judge.loads import at_time
from crosscheck.judge.time_functions import value
from mbref import rotations
from mbref.rotations import cross
from mbref.scene import Distance, Force, JointLoad, Load, Moment, PointDamper, RotationalDamper, Scene, Spring
from mbref.scene.joints import ANGLE

ZERO = np.zeros(3)


@dataclass(frozen=True)
class LinkMotion:
    """Motion of the links' frames in the world: rotation since t = 0 (n, 3, 3); all other arrays have the
    shape (n, 3).

    ``coordinates`` and ``rates`` (nv,) are the joint coordinates, meaningful if a joint has a single angle.
    Accelerations are UNKNOWN if the engine does not give them.
    """

    rotation: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    coordinates: np.ndarray
    rates: np.ndarray
    acceleration: np.ndarray = field(default_factory=lambda: UNKNOWN)
    angular_acceleration: np.ndarray = field(default_factory=lambda: UNKNOWN)
    time: float = 0.0  # s, at which loads over time act


def wrench(force: np.ndarray, point: np.ndarray, moment: np.ndarray = ZERO) -> np.ndarray:
    """Return the wrench (6,) of a force at a point and a moment."""
    return np.concatenate([force, moment + cross(point, force)])


def sample_of(scene: Scene, tree: Tree, motion: LinkMotion, closing: Sequence[np.ndarray] | None) -> Sample:
    """Return the scene's bodies and joints for a motion of the links.

    The sample has no reactions if ``closing`` is None or the scene has no masses.
    """
    own = list(tree.own)
    start = np.array([body.orientation for body in scene.body])
    weighed = closing is not None and scene.has_mass()
    return Sample(
        position=motion.position[own],
        orientation=rotations.multiply(rotations.from_matrix(motion.rotation[own]), start),
        velocity=motion.velocity[own],
        angular_velocity=motion.angular_velocity[own],
        acceleration=motion.acceleration[own] if motion.acceleration.size else UNKNOWN,
        angular_acceleration=motion.angular_acceleration[own] if motion.acceleration.size else UNKNOWN,
        reactions=joint_reactions(scene, tree, motion, closing or ()) if weighed else {},
    )


def applied(scene: Scene, tree: Tree, motion: LinkMotion) -> list[tuple[int, np.ndarray, np.ndarray]]:
    """Return the links on which loads act, each with a force and a moment about the origin of its frame,
    world."""
    loads = scene.load if scene.has_mass() else ()
    found = [pair for load in loads for pair in _applied(scene, tree, motion, load)]
    return [
        (link, on_link[:3], on_link[3:] - cross(motion.position[link], on_link[:3]))
        for link, on_link in found
        if link != GROUND_LINK
    ]


def joint_reactions(
    scene: Scene, tree: Tree, motion: LinkMotion, closing: Sequence[np.ndarray]
) -> dict[str, np.ndarray]:
    """Return force and moment (6,) on each joint's second body at the anchor on that body, world axes.

    ``closing`` has, for each closure of the tree, the wrench on its second link.
    """
    carried = _carried(scene, tree, motion, closing)
    by_joint = np.zeros((len(scene.joint), 6))
    for closure, on_second in zip(tree.closures, closing, strict=True):
        if closure.kind == "point":
            by_joint[closure.joint] = on_second
    second = [scene.body_index(joint.bodies[1]) for joint in scene.joint]
    for k, link in enumerate(tree.links):
        if link.joint >= 0:
            child_is_second = link.body == second[link.joint] and not link.ends
            by_joint[link.joint] = carried[k] if child_is_second else -carried[k]
    at_anchors = _at_second_anchors(scene, tree, motion, by_joint)
    return {joint.name: found for joint, found in zip(scene.joint, at_anchors, strict=True)}


def _carried(scene: Scene, tree: Tree, motion: LinkMotion, closing: Sequence[np.ndarray]) -> np.ndarray:
    """Return the wrench (n, 6) on every link through the joint that carries it."""
    needed = np.vstack(
        [_inertial(scene, tree, motion), np.zeros(6)]
    )  # the last row, index -1, is the ground's
    for load in scene.load:
        for link, applied in _applied(scene, tree, motion, load):
            needed[link] -= applied
    for closure, applied in zip(tree.closures, closing, strict=True):
        first, second = closure.links
        needed[first] += applied
        needed[second] -= applied
    for k in reversed(range(len(tree.links))):
        needed[tree.links[k].parent] += needed[k]
    return needed[:-1]


def _inertial(scene: Scene, tree: Tree, motion: LinkMotion) -> np.ndarray:
    """Return the wrenches (n, 6) that accelerate the links, without their weights."""
    rotation, omega, angular = motion.rotation, motion.angular_velocity, motion.angular_acceleration
    mass = np.array([link.mass for link in tree.links])
    arm = np.einsum("kij,kj->ki", rotation, np.array([link.offset for link in tree.links]))
    acceleration = motion.acceleration + cross(angular, arm) + cross(omega, cross(omega, arm))
    inertia = rotation @ np.array([link.inertia for link in tree.links]) @ rotation.transpose(0, 2, 1)
    moment = np.einsum("kij,kj->ki", inertia, angular)
    moment += cross(omega, np.einsum("kij,kj->ki", inertia, omega))
    force = mass[:, None] * (acceleration - np.array(scene.gravity))
    return np.concatenate([force, moment + cross(motion.position + arm, force)], axis=1)


def _arm(tree: Tree, motion: LinkMotion, link: int, point: Sequence[float] | np.ndarray) -> np.ndarray:
    return motion.rotation[link] @ (np.array(point) - tree.links[link].position)


def _point(
    tree: Tree, motion: LinkMotion, link: int, point: Sequence[float] | np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return present position and velocity of a point of a link (or of the ground), given in the world at t =
    0."""
    if link == GROUND_LINK:
        return np.array(point), ZERO
    arm = _arm(tree, motion, link, point)
    return motion.position[link] + arm, motion.velocity[link] + cross(motion.angular_velocity[link], arm)


def _applied(scene: Scene, tree: Tree, motion: LinkMotion, load: Load) -> list[tuple[int, np.ndarray]]:
    """Return the links on which a load acts, each with the wrench on it."""
    if isinstance(load, JointLoad):
        return _along_joint(scene, tree, motion, load)
    load = at_time(load, motion.time)
    if isinstance(load, Moment):
        return [(tree.link_of(scene.body_index(load.body)), np.array([*ZERO, *load.moment]))]
    if isinstance(load, Force):
        link = tree.link_of(scene.body_index(load.body))
        return [(link, wrench(np.array(load.force), _point(tree, motion, link, load.point)[0]))]
    if isinstance(load, Spring):
        links = [tree.link_of(scene.body_index(name)) for name in load.bodies]
        (p, u), (q, v) = (_point(tree, motion, k, x) for k, x in zip(links, load.points, strict=True))
        force = spring_force(load, q - p, v - u)
        return [(links[0], wrench(force, p)), (links[1], wrench(-force, q))]
    if isinstance(load, RotationalDamper | PointDamper):
        first, second = (tree.link_of(scene.body_index(name)) for name in load.bodies)
        on_first = load.damping * _resisted(tree, motion, first, second, load)
        return [(first, on_first), (second, -on_first)]
    raise TypeError(f"no wrench of a load of type {load.type!r}")


def _resisted(
    tree: Tree, motion: LinkMotion, first: int, second: int, load: RotationalDamper | PointDamper
) -> np.ndarray:
    """Return the wrench (6,) per damping coefficient of a damper on its first link."""
    spins = [ZERO if k == GROUND_LINK else motion.angular_velocity[k] for k in (first, second)]
    if isinstance(load, RotationalDamper):
        return np.array([*ZERO, *(spins[1] - spins[0])])
    place, rate = _point(tree, motion, second, load.point)
    if first != GROUND_LINK:
        rate = rate - motion.velocity[first] - cross(spins[0], place - motion.position[first])
    return wrench(rate, place)


def _along_joint(
    scene: Scene, tree: Tree, motion: LinkMotion, load: JointLoad
) -> list[tuple[int, np.ndarray]]:
    i, action, factor = tree.coordinate(scene, load.joint, load.coordinate), load.action, 1.0
    if load.over_time is not None:
        factor = float(value(load.over_time, motion.time))
    child = next(
        k for k, n in enumerate(tree.links) if n.joint >= 0 and scene.joint[n.joint].name == load.joint
    )
    moved, rate = motion.coordinates[i], motion.rates[i]
    size = action.amount * factor - action.stiffness * (moved - action.natural) - action.damping * rate
    along = size * (motion.rotation[child] @ tree.links[child].axes[0])
    if load.coordinate == ANGLE:
        on_child = np.concatenate([ZERO, along])
    else:
        on_child = wrench(along, _point(tree, motion, child, tree.links[child].anchor)[0])
    return [(child, on_child), (tree.links[child].parent, -on_child)]


def _at_second_anchors(scene: Scene, tree: Tree, motion: LinkMotion, on_second: np.ndarray) -> np.ndarray:
    """Return the joints' wrenches (nj, 6) at the anchors on their second bodies; the end mass of a rod counts
    as part of the body."""
    links = [tree.link_of(scene.body_index(joint.bodies[1])) for joint in scene.joint]
    pairs = zip(links, scene.joint, strict=True)
    anchors = [_point(tree, motion, link, joint.anchor_pair[1])[0] for link, joint in pairs]
    force = on_second[:, :3].copy()
    moment = on_second[:, 3:] - cross(np.array(anchors).reshape(-1, 3), force)
    for j, joint in enumerate(scene.joint):
        if isinstance(joint, Distance):
            force[j] += _force_on_end(scene, tree, motion, links[j], joint)
    return np.concatenate([force, moment], axis=1)


def _force_on_end(scene: Scene, tree: Tree, motion: LinkMotion, link: int, joint: Distance) -> np.ndarray:
    """Return the force (3,) that accelerates the half mass of a rod at its second end, without its weight."""
    rod = next(
        n
        for n in tree.links
        if n.ends
        and np.array_equal(n.ends[1][1], joint.anchors[1])
        and np.array_equal(n.ends[0][1], joint.anchors[0])
    )
    return rod.mass / 2 * (_acceleration(tree, motion, link, joint.anchors[1]) - np.array(scene.gravity))


def _acceleration(tree: Tree, motion: LinkMotion, link: int, point: Sequence[float]) -> np.ndarray:
    if link == GROUND_LINK:
        return ZERO
    arm, omega = _arm(tree, motion, link, point), motion.angular_velocity[link]
    centripetal = cross(omega, cross(omega, arm))
    return motion.acceleration[link] + cross(motion.angular_acceleration[link], arm) + centripetal
