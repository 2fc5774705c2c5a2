"""A tree as bodies with joints of one elementary motion each, for engines without joints of several freedoms.

Auxiliary bodies between the joints of a chain have a negligible mass, but not zero mass: engines would warn,
or divide by zero.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.engines.shared.spanning_tree import GROUND_LINK, Mobility, Tree

O = np.zeros(3)


@dataclass(frozen=True)
class Piece:
    """A body with a frame at ``origin``, with world axes at t = 0, and the joint at ``anchor`` that carries
    it.

    The joint is fixed if ``mobility`` is None. Points are in the world.

    ``link`` is the tree's link, or -1 for an auxiliary body. ``parent`` is the index of a piece, or -1 for
    the ground. ``velocity`` is the index of the joint's first velocity in the tree.  The centre of mass is at
    ``offset`` from the origin.
    """

    link: int
    parent: int
    mobility: Mobility | None
    velocity: int
    origin: np.ndarray
    anchor: np.ndarray
    mass: float
    offset: np.ndarray
    inertia: np.ndarray


def pieces(tree: Tree, negligible: float) -> list[Piece]:
    """Return the pieces of a tree, parents first and depth first.

    Auxiliary bodies have the fraction ``negligible`` of mass and inertia of the link that follows them.
    """
    found: list[Piece] = []
    last = {GROUND_LINK: -1}
    for k, link in enumerate(tree.links):
        parent = last[link.parent]
        for n, mobility in enumerate(link.mobilities[:-1]):
            light = (negligible * link.mass, O, negligible * np.trace(link.inertia) * np.eye(3))
            found.append(Piece(-1, parent, mobility, tree.starts[k] + n, link.anchor, link.anchor, *light))
            parent = len(found) - 1
        own = link.mobilities[-1] if link.mobilities else None
        velocity = tree.starts[k] + max(0, len(link.mobilities) - 1)
        found.append(
            Piece(k, parent, own, velocity, link.position, link.anchor, link.mass, link.offset, link.inertia)
        )
        last[k] = len(found) - 1
    return found


def assembled(
    tree: Tree, negligible: float, ground: Any, add: Callable[[str, Piece, Any, np.ndarray, np.ndarray], Any]
) -> tuple[list[Any], dict[int, Any]]:
    """Add the pieces of a tree to an engine; returns the engine's bodies of the tree's links, and its joints
    that move, by the first joint velocity of the tree.

    ``add`` returns the engine's joint and body for a name, a piece, the engine's body of the piece's parent
    (``ground`` for the ground), and the joint's place in the frames of the parent and of the piece.
    """
    parts = pieces(tree, negligible)
    bodies: list[Any] = []
    joints: dict[int, Any] = {}
    for n, piece in enumerate(parts):
        parent, start = (
            (bodies[piece.parent], parts[piece.parent].origin) if piece.parent >= 0 else (ground, O)
        )
        joint, body = add(str(n), piece, parent, piece.anchor - start, piece.anchor - piece.origin)
        bodies.append(body)
        if piece.mobility:
            joints[piece.velocity] = joint
    return [body for piece, body in zip(parts, bodies, strict=True) if piece.link >= 0], joints
