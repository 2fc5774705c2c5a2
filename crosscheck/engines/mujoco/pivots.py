"""The least inertia with which MuJoCo computes: `mjMINVAL` replaces smaller pivots of the mass matrix."""

from __future__ import annotations

import numpy as np

from crosscheck.engine import Cannot, Owner
from crosscheck.engines.shared.geometry import cross_matrix
from crosscheck.engines.shared.initial_velocities import twist_maps
from crosscheck.engines.shared.spanning_tree import Tree, spanning_tree
from mbref.scene import Scene

LEAST_INERTIA = 1e-15  # kg or kg m²: mjMINVAL, also the least mass and moment of a body that MuJoCo reads


def refusal(scene: Scene) -> Cannot | None:
    """Return the refusal of a scene in which a joint coordinate moves too small an inertia at t = 0."""
    if not scene.has_mass():
        return None
    tree = spanning_tree(scene)
    if all(min(link.mass, np.linalg.eigvalsh(link.inertia)[0]) > LEAST_INERTIA for link in tree.links):
        return None  # a pivot is at least the inertia of its own link
    small = np.flatnonzero(_pivots(scene, tree) < LEAST_INERTIA)
    if not small.size:
        return None
    body = tree.links[int(np.searchsorted(tree.starts, small[-1], side="right")) - 1].body
    of = f"body {scene.body[body].name!r}" if body >= 0 else "the rod of a distance joint"
    limit = f"below {LEAST_INERTIA:g} kg or kg m², for which MuJoCo takes {LEAST_INERTIA:g}"
    return Cannot(Owner.ENGINE, f"a coordinate of {of} moves an inertia {limit}")


def _pivots(scene: Scene, tree: Tree) -> np.ndarray:
    """Return D (nv,) of the mass matrix M = Lᵀ D L at t = 0, found from the last coordinate to the first."""
    mass = np.zeros((tree.nv, tree.nv))
    for link, of_rates in zip(tree.links, twist_maps(tree), strict=True):
        linear, angular = of_rates[:3] - cross_matrix(link.offset) @ of_rates[3:], of_rates[3:]
        mass += link.mass * linear.T @ linear + angular.T @ link.inertia @ angular
    for i, armature in tree.armatures(scene):
        mass[i, i] += armature
    for i in reversed(range(tree.nv)):
        if mass[i, i] > 0:
            mass[:i, :i] -= np.outer(mass[:i, i], mass[:i, i]) / mass[i, i]
    return np.diagonal(mass)
