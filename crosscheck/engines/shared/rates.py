"""Names and kinds of the joint velocities of a spanning tree."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from crosscheck.engines.shared.spanning_tree import Tree
from mbref.rotations import unit
from mbref.scene import Scene

Turning = tuple[np.ndarray, np.ndarray]


def names_of_rates(scene: Scene, tree: Tree) -> tuple[str, ...]:
    """Return a name for each joint velocity of a tree: its joint, and which of the joint's velocities."""
    found: list[str] = []
    for k, link in enumerate(tree.links):
        joint = scene.joint[link.joint].name if link.joint >= 0 else f"link {k}"
        found += [joint] if link.freedoms == 1 else [f"{joint}[{i}]" for i in range(link.freedoms)]
    return tuple(found)


def spins_of_rods(tree: Tree, now: Callable[[int], Turning], first: Callable[[int], Turning]) -> np.ndarray:
    """Return the rates (k,) at which rods of distance joints spin about their own axes.

    ``now`` and ``first`` give a link's rotation matrix and angular velocity (world), now and at t = 0.
    """
    found = []
    for k, link in enumerate(tree.links):
        if link.ends:
            (_, one), (_, other) = link.ends
            rotation, spin = now(k)
            found.append(float(spin @ rotation @ first(k)[0].T @ unit(other - one)))
    return np.array(found)
