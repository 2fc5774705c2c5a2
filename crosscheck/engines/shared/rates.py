"""Names and kinds of the joint velocities of a spanning tree."""

from __future__ import annotations

from crosscheck.engines.shared.spanning_tree import Tree
from mbref.scene import Scene


def names_of_rates(scene: Scene, tree: Tree) -> tuple[str, ...]:
    """Return a name for each joint velocity of a tree: its joint, and which of the joint's velocities."""
    found: list[str] = []
    for k, link in enumerate(tree.links):
        joint = scene.joint[link.joint].name if link.joint >= 0 else f"link {k}"
        found += [joint] if link.freedoms == 1 else [f"{joint}[{i}]" for i in range(link.freedoms)]
    return tuple(found)


def rates_of_rods(tree: Tree) -> tuple[int, ...]:
    """Return the indices of the joint velocities that carry rods of distance joints."""
    rods = [k for k, link in enumerate(tree.links) if link.ends]
    return tuple(tree.starts[k] + i for k in rods for i in range(tree.links[k].freedoms))
