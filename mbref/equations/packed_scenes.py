"""Scenes that were packed lately: a further run of an equal scene finds its arrays and its start again.

A scene is frozen, so that all that follows from it holds for every scene that equals it.
"""

from __future__ import annotations

from functools import lru_cache

from mbref.equations.packing import Packs
from mbref.scene import Scene

MOST_SCENES, MOST_SCENE_BODIES = (
    16,
    200,
)  # number of kept scenes, and of their bodies; longer runs need no such help


def packs_of(scene: Scene) -> Packs:
    """Return the packed arrays of a scene, kept from an earlier call if possible."""
    return _kept(scene) if len(scene.body) <= MOST_SCENE_BODIES else Packs([scene])


@lru_cache(maxsize=MOST_SCENES)
def _kept(scene: Scene) -> Packs:
    return Packs([scene])
