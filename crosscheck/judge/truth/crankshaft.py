"""Slider-cranks side by side whose cranks are fixed to each other: each slider-crank moves along its own
path."""

from __future__ import annotations

import numpy as np
from scipy.sparse.csgraph import connected_components

from crosscheck.judge.truth.one_dof import Path, Pose
from crosscheck.judge.truth.parallelogram import pivots_of, turning_driver
from crosscheck.judge.truth.planar_slider_crank import planar_slider_crank
from mbref.scene import GROUND, Fixed, Scene


def crankshaft(scene: Scene) -> Path | None:
    """Return the path of a scene that may be such a crankshaft, or None."""
    groups = _without_shaft(scene)
    if len(groups) < 2:
        return None
    guesses = [planar_slider_crank(_part(scene, group)) for group in groups]
    paths = [path for path in guesses if path is not None]
    if len(paths) < len(groups):
        return None
    order = np.argsort(np.concatenate(groups))

    def poses(q: np.ndarray) -> Pose:
        found = [path.poses(q) for path in paths]
        joined = {
            key: np.concatenate([getattr(pose, key) for pose in found], axis=1)[:, order]
            for key in Pose.__dataclass_fields__
        }
        return Pose(**joined)

    pivots = pivots_of(scene)
    turns = np.array([1.0 if body.name in pivots else np.nan for body in scene.body])
    return Path("crankshaft", poses, paths[0].axis, turning_driver(scene, paths[0].axis, turns))


def _without_shaft(scene: Scene) -> list[np.ndarray]:
    """Return the indices of connected bodies, when the ground and fixed joints are ignored."""
    linked = np.zeros((len(scene.body), len(scene.body)))
    for joint in scene.joint:
        if GROUND not in joint.bodies and not isinstance(joint, Fixed):
            linked[tuple(scene.body_index(name) for name in joint.bodies)] = True
    _, label = connected_components(linked, directed=False)
    return [np.flatnonzero(label == k) for k in range(label.max() + 1)]


def _part(scene: Scene, group: np.ndarray) -> Scene:
    """Return the scene of a group of bodies, with the joints among them and to the ground."""
    names = {scene.body[b].name for b in group} | {GROUND}
    joints = tuple(joint for joint in scene.joint if names.issuperset(joint.bodies))
    return scene.with_(body=tuple(scene.body[b] for b in group), joint=joints, driver=(), load=())
