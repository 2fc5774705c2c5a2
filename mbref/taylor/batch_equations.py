"""The equations of many scenes of one structure, computed at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from mbref.equations.model import Model
from mbref.equations.packing import Packs, row_of
from mbref.kernels.memory_pool import arrays_in
from mbref.kernels.scene_layout import Loads, Primitives, SceneData, TurningJoints
from mbref.taylor.layout import TaylorMemory
from mbref.taylor.natural import NaturalCoordinates, pose_of, unit_of_length
from mbref.taylor.numbers import ManyScenes
from mbref.taylor.polynomials import Geometry


class JointNumbers(NamedTuple):
    """A joint of many scenes: the facts of its type, its bodies, and the numbers of its geometry."""

    facts: Any
    bodies: tuple[str, str]
    directions: tuple[np.ndarray, ...]
    anchor_pair: tuple[np.ndarray, np.ndarray]


class Models:
    """One model of many scenes, whose numbers hold the values of all scenes (``taylor.numbers``).

    Masses, gravity and forces of ``data`` are arrays whose first axis counts the scenes.
    """

    def __init__(self, packs: Packs, places: Sequence[int], batch: ManyScenes):
        first = Model(packs.scenes[places[0]], packs, places[0])
        self.nb, self.index, self.length = first.nb, first.index, first.length
        self.bodies = first.bodies
        self.joints = [
            _joint(joints, batch) for joints in zip(*(packs.joints[k] for k in places), strict=True)
        ]
        self.to_local = batch.together(packs.to_local[places])
        self.data = _numbers(row_of(packs.data, places), batch)


def _joint(joints: Sequence[Any], batch: ManyScenes) -> JointNumbers:
    """Return one joint with the numbers of all scenes."""
    first = joints[0]
    directions, anchors = (
        batch.together(np.array([getattr(joint, name) for joint in joints], dtype=float))
        for name in ("directions", "anchor_pair")
    )
    return JointNumbers(first.facts, first.bodies, tuple(directions), tuple(anchors))


def _numbers(data: SceneData, batch: ManyScenes) -> SceneData:
    """Return data with the numbers of all scenes."""
    loads = Loads(*map(batch.together, data.loads))._replace(force=data.loads.force)
    primitives = Primitives(*map(batch.together, data.primitives))
    turning = TurningJoints(*map(batch.together, data.turning))
    return data._replace(primitives=primitives, turning=turning, loads=loads)


def equations_of_all(
    packs: Packs, q: np.ndarray, places: Sequence[int], moving: np.ndarray, driven: bool, memory: TaylorMemory
) -> tuple[list[tuple[np.ndarray, np.ndarray]], list[int]]:
    """Return the arrays of memory in which the scenes with these indices differ, each with one row for every
    scene of ``packs``.

    Also return the indices of scenes whose equations have the structure of the equations in memory. q (s, 7
    nb) are the coordinates of all scenes at the start.
    """
    if not places:
        return [], []
    batch, of_places = ManyScenes(len(places)), [*places]
    unit = unit_of_length(packs.length[places[0]])
    batch.agree &= np.array([unit_of_length(length) == unit for length in packs.length[of_places]])
    models: Any = Models(packs, places, batch)
    pose = pose_of(q[of_places])
    numbers = pose._replace(centres=batch.together(pose.centres), axes=batch.together(pose.axes))
    geometry = Geometry(NaturalCoordinates(models, numbers, moving, driven, batch))
    found = geometry.polynomials(models), geometry.pose_maps, geometry.tableau
    targets = memory.polynomials, memory.pose_maps, (memory.solver.linear, memory.solver.place)
    varied = []
    for target, source in zip(arrays_in(targets), arrays_in(found), strict=True):
        values = _values_of_all(target, source, batch)
        if values is None:
            return [], []
        if not (values == target).all():
            rows = np.zeros((len(packs.scenes), *target.shape), target.dtype)
            rows[of_places] = values
            varied.append((target, rows))
    return varied, [place for place, agrees in zip(places, batch.agree, strict=True) if agrees]


def _values_of_all(target: np.ndarray, source: np.ndarray, batch: ManyScenes) -> np.ndarray | None:
    """Return the values (s, …) of an array of the equations; None if the array has another structure."""
    if source.dtype == object:
        source = batch.spread(source)
    elif source.ndim == target.ndim:
        source = source[None]
    if source.shape[1:] != target.shape:
        return None
    if target.dtype != float and not np.array_equal(source[0], target):
        return None
    return source
