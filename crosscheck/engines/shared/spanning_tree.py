"""A scene as a spanning tree with loop closures, for the engines that work in joint coordinates.

Nodes are the bodies and the ground, edges the joints.  A maximum-weight spanning tree by constraint rows
keeps the stiff joints, and every driven or coupled joint; every joint that is cut closes a loop:

- a cut spherical joint is a point that two links share;
- a cut joint of another type that the engine closes by itself is a closure of that type;
- any other cut joint carries a *ghost*: its second body's mass and inertia are divided in equal shares
  between the body and its ghosts, the ghost hangs from the first body by the joint itself, and a weld
  holds it to its body.  The motion equals the motion of the undivided body.

A distance joint is a *rod* with a spherical joint at either end.  The rod has the inertia of two point masses
at its ends, taken out of the two bodies, so the motion equals the motion of the scene; the moment of inertia
about its own axis is arbitrary, because a rod that starts without spin never spins.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, replace

import numpy as np

from crosscheck.engines.shared.geometry import cross_matrix, joint_frame
from mbref import rotations
from mbref.rotations import unit
from mbref.scene import Body, Coupling, Distance, Driver, Joint, JointFacts, JointLoad, Scene, Spherical
from mbref.scene.joints import DISPLACEMENT, Coordinate

GROUND_LINK = -1
NO_AXES = np.zeros((0, 3))
DRIVEN_WEIGHT = 10  # exceeds the number of rows of any joint, so that driven joints are cut last
ROD_SHARE = 0.1  # mass of a rod / smallest effective mass of a body at the anchors of its distance joint
BALL: JointFacts = Spherical.facts
ROD_END: str = Spherical.model_fields["type"].default
FREE, SLIDE, TURN, BALL_JOINT = "free", "slide", "turn", "ball"
COORDINATES = {FREE: 6, SLIDE: 1, TURN: 1, BALL_JOINT: 3}


@dataclass(frozen=True)
class Mobility:
    """One elementary motion of a link relative to its parent.

    The motion is a slide along or a turn about ``axis`` (3,), the free rotation of a ball, or the
    displacement and rotation of a free link.
    """

    kind: str
    axis: np.ndarray


def mobilities(facts: JointFacts, axes: np.ndarray) -> tuple[Mobility, ...]:
    """Return the chain of elementary motions that a joint leaves free, slides first; ``axes`` (n, 3) are the
    joint's axes.

    If a link carries the line of an inline joint, the ball is first, about the point of its parent.
    """
    free = [n for n in range(3) if n not in facts.forbidden_translations]
    slides = [Mobility(SLIDE, joint_frame(axes[0])[:, n] if n < 2 else axes[0]) for n in free]
    if facts.free_rotations == 3:
        return (*slides, Mobility(BALL_JOINT, np.zeros(3)))
    return (*slides, *(Mobility(TURN, axis) for axis in axes[: facts.free_rotations]))


@dataclass(frozen=True)
class Link:
    """A rigid piece of the tree and the joint that carries it.

    Its frame is at ``position`` (world), with world axes at t = 0. ``offset`` is the vector from ``position``
    to the centre of mass, to which ``inertia`` (3, 3) refers.  ``kind`` is the scene's joint type or
    ``"free"``, ``mobilities`` are the elementary motions that it leaves free; ``axes`` (n, 3) are unit
    vectors, from the parent's side to the child's, such that positive coordinates move the joint's second
    body relative to its first.
    """

    body: int  # index in scene.body; -1 for the rod of a distance joint
    position: np.ndarray
    mass: float
    offset: np.ndarray
    inertia: np.ndarray
    kind: str = FREE
    mobilities: tuple[Mobility, ...] = (Mobility(FREE, np.zeros(3)),)
    joint: int = -1  # index in scene.joint; -1 for a free link and the first end of a rod
    parent: int = GROUND_LINK
    anchor: np.ndarray = field(default_factory=lambda: np.zeros(3))
    axes: np.ndarray = field(default_factory=lambda: NO_AXES)
    ghost: bool = False
    ends: tuple[tuple[int, np.ndarray], ...] = ()  # for a rod: bodies and anchors (world)

    @property
    def freedoms(self) -> int:
        """Return the number of joint coordinates (velocities)."""
        return sum(COORDINATES[mobility.kind] for mobility in self.mobilities)


@dataclass(frozen=True)
class Closure:
    """A loop closure: a ``point`` shared by two links, a ``weld`` of the two parts of a split body, or the
    type of a joint that the engine closes by itself."""

    kind: str
    joint: int
    # links of the joint's first and second body; of a weld: the body's link and its ghost
    links: tuple[int, int]
    anchor: np.ndarray


@dataclass(frozen=True)
class Tree:
    """Links in depth-first order (parents first), closures, and the links of the scene's bodies and
    joints."""

    links: tuple[Link, ...]
    closures: tuple[Closure, ...]
    own: tuple[int, ...]  # link of each body of the scene
    starts: tuple[int, ...]  # index of the first joint velocity of each link

    @property
    def nv(self) -> int:
        """Return the number of joint velocities."""
        return sum(link.freedoms for link in self.links)

    def link_of(self, body: int) -> int:
        """Return the link of a scene's body; for -1 the link of the ground."""
        return self.own[body] if body >= 0 else GROUND_LINK

    def coordinate(self, scene: Scene, joint: str, kind: Coordinate | None = None) -> int:
        """Return the index of a joint's velocity, for its angle or displacement; by default for the driven
        coordinate."""
        index = [j.name for j in scene.joint].index(joint)
        link = next(k for k, item in enumerate(self.links) if item.joint == index)
        found = self.links[link]
        if (kind or scene.joint[index].facts.driven) != DISPLACEMENT:
            return self.starts[link] + found.freedoms - 1
        axis = np.array(scene.joint[index].directions[0])
        along = [abs(m.axis @ axis) if m.kind == SLIDE else -1.0 for m in found.mobilities]
        before = found.mobilities[: int(np.argmax(along))]  # a free joint has slides across its axis, too
        return self.starts[link] + sum(COORDINATES[m.kind] for m in before)

    def driven(self, scene: Scene) -> list[tuple[int, Driver]]:
        """Return the index of each driver's velocity, and the driver."""
        return [(self.coordinate(scene, driver.joint), driver) for driver in scene.driver]

    def coupled(self, scene: Scene, coupling: Coupling) -> list[int]:
        """Return the indices of the velocities that a coupling relates."""
        return [self.coordinate(scene, joint.name, kind) for joint, kind in scene.coupled(coupling)]

    def armatures(self, scene: Scene) -> list[tuple[int, float]]:
        """Return the index of the velocity of each joint with an armature, and its reflected inertia."""
        geared = [joint for joint in scene.joint if joint.reflected_inertia]
        return [(self.coordinate(scene, joint.name), joint.reflected_inertia) for joint in geared]


@dataclass(frozen=True)
class _Edge:
    kind: str
    facts: JointFacts
    joint: int
    nodes: tuple[int, int]
    anchor: np.ndarray
    axes: np.ndarray
    weight: int


def spanning_tree(scene: Scene, closes: Collection[str] = (ROD_END,), between_links: bool = False) -> Tree:
    """Return the scene as links and closures; bodies without mass (kinematics) have 1 kg and 1 kg m².

    ``closes`` are the types of joints that the engine closes by itself, without splitting a body, unless a
    driver, coupling or load needs the joint's coordinate. With ``between_links`` no closure is at the ground:
    of joints with equally many rows the ones at the ground are cut last, and such a cut splits a body.
    """
    nodes = [_body_link(b, body) for b, body in enumerate(scene.body)]
    edges = []
    acting = {driver.joint for driver in scene.driver}
    acting |= {name for coupling in scene.coupling for name in coupling.joints}
    acting |= {joint.name for joint in scene.joint if joint.end_stop}
    for j, joint in enumerate(scene.joint):
        first, second = joint.bodies
        pair = (scene.body_index(first), scene.body_index(second))
        if isinstance(joint, Distance):
            edges += _rod(nodes, j, pair, np.array(joint.anchors))
        else:
            weight = joint.facts.rows + DRIVEN_WEIGHT * (joint.name in acting)
            anchor = np.array(joint.anchor_pair[0])
            edges.append(_Edge(joint.type, joint.facts, j, pair, anchor, _axes(joint), weight))
    if between_links:
        edges.sort(key=lambda edge: GROUND_LINK not in edge.nodes)
    kept, cut = _kruskal(len(nodes), edges)
    acting |= {load.joint for load in scene.load if isinstance(load, JointLoad)}
    needed = {j for j, joint in enumerate(scene.joint) if joint.name in acting}  # joints with a coordinate
    barred = {GROUND_LINK} if between_links else set()
    closable = [
        edge.kind in closes and edge.joint not in needed and not barred & set(edge.nodes) for edge in cut
    ]
    closures = _cut_open(nodes, kept, list(zip(cut, closable, strict=True)))
    return _depth_first(nodes, kept, closures, len(scene.body))


def _body_link(index: int, body: Body) -> Link:
    rotation = rotations.to_matrix(np.array(body.orientation))
    inertia = np.array(body.inertia if body.inertia is not None else (1.0, 1.0, 1.0), dtype=float)
    inertia = np.diag(inertia) if inertia.ndim == 1 else inertia
    mass = 1.0 if body.mass is None else body.mass
    return Link(
        index, np.array(body.position, dtype=float), mass, np.zeros(3), rotation @ inertia @ rotation.T
    )


def _axes(joint: Joint) -> np.ndarray:
    """Return the unit axes (n, 3) of a joint, the first body's first."""
    return np.array([unit(axis) for axis in joint.directions]).reshape(-1, 3)


def effective_mass(link: Link, point: np.ndarray) -> float:
    """Return the smallest effective mass (kg) of a free link for a force at a point (world), over all
    directions."""
    arm = cross_matrix(point - link.position - link.offset)
    mobility = np.eye(3) / link.mass - arm @ np.linalg.pinv(link.inertia, hermitian=True) @ arm
    return 1 / np.linalg.eigvalsh(mobility)[-1]


def _without_point_mass(link: Link, point: np.ndarray, mass: float) -> Link:
    """Return a link after a point mass at a point (world) was removed from it."""
    rest = link.mass - mass
    arm = point - link.position
    offset = (link.mass * link.offset - mass * arm) / rest
    lever = cross_matrix(arm - link.offset)
    inertia = link.inertia + (link.mass * mass / rest) * lever @ lever
    return replace(link, mass=rest, offset=offset, inertia=inertia)


def _rod(nodes: list[Link], joint: int, pair: tuple[int, int], anchors: np.ndarray) -> list[_Edge]:
    """Add the rod of a distance joint to the nodes; returns its two edges."""
    ends = [(b, anchor) for b, anchor in zip(pair, anchors, strict=True) if b >= 0]
    mass = ROD_SHARE * min(effective_mass(nodes[b], anchor) for b, anchor in ends)
    for b, anchor in ends:
        nodes[b] = _without_point_mass(nodes[b], anchor, mass)
    moment = mass * np.sum((anchors[1] - anchors[0]) ** 2) / 2
    rod = len(nodes)
    inertia = moment * np.eye(3)
    ties = tuple(zip(pair, anchors, strict=True))
    nodes.append(Link(-1, anchors.mean(axis=0), 2 * mass, np.zeros(3), inertia, ends=ties))
    return [
        _Edge(ROD_END, BALL, -1, (pair[0], rod), anchors[0], NO_AXES, BALL.rows),
        _Edge(ROD_END, BALL, joint, (rod, pair[1]), anchors[1], NO_AXES, BALL.rows),
    ]


def _kruskal(count: int, edges: list[_Edge]) -> tuple[list[_Edge], list[_Edge]]:
    """Return the edges of a maximum-weight spanning forest, ground included, and the cut edges."""
    group = list(range(count + 1))  # the last entry is the ground, -1
    kept: list[_Edge] = []
    cut: list[_Edge] = []
    for edge in sorted(edges, key=lambda edge: -edge.weight):
        a, b = group[edge.nodes[0]], group[edge.nodes[1]]
        (cut if a == b else kept).append(edge)
        group = [a if g == b else g for g in group]
    return kept, cut


def _cut_open(nodes: list[Link], kept: list[_Edge], cut: list[tuple[_Edge, bool]]) -> list[Closure]:
    """Return the closures of the cut edges, each with whether the engine closes its joint by itself; adds the
    ghosts to the nodes and their joints to the kept edges."""
    closures: list[Closure] = []
    ghosts: dict[int, list[int]] = {}
    for edge, is_closable in cut:
        if is_closable:
            kind = "point" if edge.facts == BALL else edge.kind
            closures.append(Closure(kind, edge.joint, edge.nodes, edge.anchor))
            continue
        end = 1 if edge.nodes[1] != GROUND_LINK else 0
        body, ghost = edge.nodes[end], len(nodes)
        nodes.append(replace(nodes[body], ghost=True))
        ends = (edge.nodes[0], ghost) if end else (ghost, edge.nodes[1])
        kept.append(replace(edge, nodes=ends))
        closures.append(Closure("weld", edge.joint, (body, ghost), edge.anchor))
        ghosts.setdefault(body, []).append(ghost)
    for body, copies in ghosts.items():
        share = 1 / (1 + len(copies))
        for n in (body, *copies):
            nodes[n] = replace(nodes[n], mass=nodes[n].mass * share, inertia=nodes[n].inertia * share)
    return closures


def _depth_first(nodes: list[Link], edges: list[_Edge], closures: list[Closure], bodies: int) -> Tree:
    """Number the nodes depth first from the ground; a part of the mechanism without connection to the ground
    begins with a free link."""
    number: dict[int, int] = {GROUND_LINK: GROUND_LINK}
    links: list[Link] = []

    def add(node: int, link: Link) -> None:
        number[node] = len(links)
        links.append(link)
        grow(node)

    def grow(node: int) -> None:
        for edge in edges:
            if node not in edge.nodes or set(edge.nodes) <= number.keys():
                continue
            forward = edge.nodes[0] == node
            child = edge.nodes[1] if forward else edge.nodes[0]
            axes = edge.axes if forward else -edge.axes[::-1]
            chain = mobilities(edge.facts, axes)
            add(
                child,
                replace(
                    nodes[child],
                    kind=edge.kind,
                    mobilities=chain if forward or edge.facts.free_rotations < 3 else chain[::-1],
                    joint=edge.joint,
                    parent=number[node],
                    anchor=edge.anchor,
                    axes=axes,
                ),
            )

    grow(GROUND_LINK)
    for node in range(len(nodes)):
        if node not in number:
            add(node, replace(nodes[node], anchor=nodes[node].position))
    starts = np.cumsum([0, *(link.freedoms for link in links)])[:-1]
    return Tree(
        links=tuple(links),
        closures=tuple(replace(c, links=(number[c.links[0]], number[c.links[1]])) for c in closures),
        own=tuple(number[b] for b in range(bodies)),
        starts=tuple(starts.tolist()),
    )
