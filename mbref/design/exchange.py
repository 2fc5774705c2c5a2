"""Exchanges and removals of joints that end all redundancy and leave the freedoms of a mechanism."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterable, Iterator, Mapping

import numpy as np

from mbref.design.along_motion import ROUNDING, general_pose
from mbref.design.placed import placed
from mbref.equations.diagnosis import scaled_jacobian
from mbref.equations.model import Model
from mbref.scene import JOINT_TYPES, Joint, Scene

WEAKER = {  # types that allow the motion of the first and more, those that keep most rows first
    "revolute": ("cylindrical", "universal", "spherical", "inline"),
    "translational": ("cylindrical", "planar", "inline"),
    "cylindrical": ("inline",),
    "universal": ("spherical",),
    "fixed": ("universal", "spherical"),
}
MOST_EXCHANGES = 4  # joints exchanged at once
MOST_TRIALS = 3000
PART = 1e-6  # weight of a row in a redundancy above which its joint takes part

REMOVED = "removed"  # stands for a joint type
Exchange = dict[str, str]  # joint → its new type, or REMOVED


def exchanges(scene: Scene, most: int = 6) -> list[Exchange]:
    """The smallest sets of joints whose exchange or removal ends all redundancy, with the same freedoms.

    At most ``most`` of them, of up to four joints; empty where nothing is redundant or nothing is found.
    Asked at a general pose, without drivers.  A joint on which a driver or a torsion spring acts becomes only
    a type that can bear it, and is not removed.
    """
    model = Model(scene.with_(driver=(), load=()))
    if not model.m:
        return []
    at_pose = Model(placed(model, general_pose(model)))
    rows = _rows(at_pose)
    rank, involved = _rank(rows.values()), _involved(at_pose, rows)
    choices = {name: _weaker(at_pose.scene, name, _bearing(scene, name)) for name in involved}
    for size in range(1, MOST_EXCHANGES + 1):
        found = _sets(rows, choices, rank, size)
        if chosen := list(itertools.islice(found, most)):
            return chosen
    return []


def _sets(
    rows: Mapping[str, np.ndarray], choices: Mapping[str, Mapping[str, np.ndarray]], rank: int, size: int
) -> Iterator[Exchange]:
    """Exchanges of ``size`` joints that leave as many rows as the rank, all of them independent."""
    total, tried = sum(map(len, rows.values())), 0
    for names in itertools.combinations(choices, size):
        for types in itertools.product(*(choices[name] for name in names)):
            new = {name: choices[name][kind] for name, kind in zip(names, types, strict=True)}
            left = total + sum(len(r) - len(rows[name]) for name, r in new.items())
            if left != rank:
                continue
            if (tried := tried + 1) > MOST_TRIALS:
                return
            if _rank({**rows, **new}.values()) == rank:
                yield dict(zip(names, types, strict=True))


def _rows(model: Model) -> dict[str, np.ndarray]:
    """Rows of Φ_q at the scene's poses, of unit length, by joint."""
    jacobian, owner = scaled_jacobian(model, 0.0, model.start()), np.array(model.row_joint)
    return {name: jacobian[owner == name] for name in dict.fromkeys(model.row_joint)}


def _rank(rows: Iterable[np.ndarray]) -> int:
    values = np.linalg.svd(np.concatenate(list(rows)), compute_uv=False)
    return int(np.sum(values > ROUNDING * values[0]))


def _involved(model: Model, rows: Mapping[str, np.ndarray]) -> list[str]:
    """The joints of the scene that have a row in a redundancy."""
    left, values, _ = np.linalg.svd(np.concatenate(list(rows.values())))
    null = left[:, int(np.sum(values > ROUNDING * values[0])) :]
    owner = np.repeat(list(rows), [len(r) for r in rows.values()])
    shared = set(owner[np.linalg.norm(null, axis=1) > PART])
    return [joint.name for joint in model.scene.joint if joint.name in shared]


def _bearing(scene: Scene, name: str) -> list[str]:
    """The types that can bear the driver and the torsion springs of the joint of that name."""
    driven = scene.joint_named(name).facts.driven if name in {d.joint for d in scene.driver} else None
    is_sprung = any(load.type == "torsion_spring" and load.joint == name for load in scene.load)
    facts = {kind: joint.facts for kind, joint in JOINT_TYPES.items()}
    return [k for k, f in facts.items() if driven in (None, f.driven) and f.takes_torsion_spring >= is_sprung]


def _weaker(scene: Scene, name: str, kinds: Collection[str]) -> dict[str, np.ndarray]:
    """Rows of the joint of that name as each weaker type, of these ``kinds``."""
    joint = scene.joint_named(name)
    found = {}
    for kind in (k for k in WEAKER.get(joint.type, ()) if k in kinds):
        others = tuple(_as(j, kind) if j.name == name else j for j in scene.joint)
        found[kind] = _rows(Model(scene.with_(joint=others)))[name]
    if len(kinds) == len(JOINT_TYPES):
        found[REMOVED] = _rows(Model(scene))[name][:0]
    return found


def _as(joint: Joint, kind: str) -> Joint:
    """The joint as another type at the same place, a universal one with its first axis along the old."""
    axis = np.array(joint.directions[0] if joint.directions else (0.0, 0.0, 1.0))
    across = np.cross(axis, np.eye(3)[np.argmin(abs(axis))])
    anchor = joint.anchor_pair[1]
    places = {"anchor": anchor, "axis": tuple(axis), "axes": (tuple(axis), tuple(across))}
    return JOINT_TYPES[kind].at(joint.name, joint.bodies, **places)
