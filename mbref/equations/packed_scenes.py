"""Scenes that were packed lately: a further run of the same scene finds its arrays and its start again.

A scene is frozen, so that all that follows from it holds as long as the object exists. Scenes are compared as
objects: a changed copy is another scene.
"""

from __future__ import annotations

from mbref.equations.packing import Packs
from mbref.scene import Scene

MOST_SCENES, MOST_SCENE_BODIES = (
    16,
    200,
)  # number of kept scenes, and of their bodies; longer runs need no such help

_kept: dict[int, tuple[Scene, Packs]] = {}


def packs_of(scene: Scene) -> Packs:
    """Return the packed arrays of a scene, kept from an earlier call if possible."""
    kept = _kept.get(id(scene))
    if kept is not None:  # the object is alive, because it is kept here
        return kept[1]
    packs = Packs([scene])
    if len(scene.body) <= MOST_SCENE_BODIES:
        while len(_kept) >= MOST_SCENES:
            _kept.pop(next(iter(_kept)), None)
        _kept[id(scene)] = scene, packs
    return packs
