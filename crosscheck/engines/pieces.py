"""A tree as bodies with joints of one elementary motion each, for engines without joints of several freedoms.

Between the joints of a chain are bodies of next to no mass: engines warn of none, or divide by it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crosscheck.engine import Supports
from crosscheck.engines.spanning_tree import GROUND_LINK, Mobility, Tree
from mbref.scene import JOINT_TYPES

EVERYTHING = Supports(
    joints=tuple(kind for kind in JOINT_TYPES if kind != "inline"),
    drivers=("angle", "displacement"),
    loads=("moment", "force", "spring", "torsion_spring"),
    couplings=("angle", "displacement"),
    armatures=("angle", "displacement"),
)
O = np.zeros(3)


@dataclass(frozen=True)
class Piece:
    """A body whose frame sits at ``origin`` with world-aligned axes at t = 0, and the joint at ``anchor``
    that carries it, fixed where ``mobility`` is None; places are in the world.

    ``link`` is the tree's link or -1 of a body in a chain, ``parent`` the index of a piece or -1 of the
    ground, ``velocity`` the first velocity of the tree.  The centre of mass is at ``offset`` from the origin.
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
    """The pieces of a tree, parents first and depth first; bodies in chains have the part ``negligible`` of
    the mass and inertia of the link behind them."""
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


def origin(of: list[Piece], piece: int) -> np.ndarray:
    """Origin (3,) of a piece's frame, world at t = 0; of the ground's for -1."""
    return of[piece].origin if piece >= 0 else O
