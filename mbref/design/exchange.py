"""Exchanges and removals of joints that end all redundancy and keep the degrees of freedom of a mechanism."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from mbref.design.along_motion import ROUNDING, general_pose
from mbref.design.placed import placed
from mbref.equations.diagnosis import scaled_jacobian
from mbref.equations.model import Model
from mbref.scene import JOINT_TYPES, Joint, JointLoad, Scene

WEAKER = {  # joint type → types that allow at least its motion, beginning with most rows
    "revolute": ("cylindrical", "universal", "spherical", "inline"),
    "translational": ("cylindrical", "planar", "inline"),
    "cylindrical": ("inline",),
    "universal": ("spherical", "inline"),
    "spherical": ("inline",),
    "fixed": ("universal", "spherical"),
}
MOST_EXCHANGES = 4  # largest number of joints in a set; a search of larger sets takes too long
MOST_TRIALS = 5_000  # number of exchanges tried in the search for smallest sets, about 1 s
PART = 1e-6  # weight of a row in a dependence above which its joint takes part

REMOVED = "removed"  # stands for a joint type where a joint is removed
Exchange = dict[str, str]  # joint → its new type, or REMOVED


def exchanges(scene: Scene, most: int = 6) -> list[Exchange]:
    """Return sets of joints whose exchange or removal ends all redundancy, with the same freedoms.

    If at most four joints suffice, the smallest sets are returned: at most ``most`` without and ``most`` with
    removed joints. If more joints are needed, one set is found joint by joint. The result is empty if nothing
    is redundant or no set is found. The rank is computed at a general pose, without drivers. A joint with a
    driver or a torsion spring is exchanged only for a type that can have it, and is not removed.
    """
    model = Model(scene.with_(driver=(), load=()))
    if not model.m:
        return []
    at_pose = Model(placed(model, general_pose(model)))
    rows = _rows(at_pose)
    redundant = Combinations.of(rows)
    if not redundant.number:
        return []
    involved = [joint.name for joint in at_pose.scene.joint if redundant.involves(joint.name)]
    choices = {
        name: {kind: w for kind, w in kinds.items() if redundant.with_exchange(name, w) is not None}
        for name, kinds in _choices(scene, at_pose, rows, involved).items()
    }
    kept = {name: {k: w for k, w in kinds.items() if k != REMOVED} for name, kinds in choices.items()}
    found = _smallest(redundant, kept, most)
    found += [e for e in _smallest(redundant, choices, most) if REMOVED in e.values()]
    found = found or [e for e in [_joint_by_joint(redundant, choices)] if e]
    return [exchange for exchange in found if _is_cure(rows, choices, exchange)]


class Weaker(NamedTuple):
    """A weaker joint type at the place of a joint: its rows, and their coefficients in the rows of the
    joint."""

    rows: np.ndarray  # (k, n), of unit length
    kept: np.ndarray  # (k, d): rows of the weaker type as combinations of the d rows of the joint
    lost: np.ndarray  # (d - k, d): orthonormal basis of the row combinations that the weaker type lacks


Choices = Mapping[str, Mapping[str, Weaker]]  # joint → type → remaining rows


class Combinations:
    """A basis of the vanishing linear combinations of the rows of Φ_q (its left null vectors), by joint.

    After an exchange the combinations without the lost rows remain. The rank is unchanged if each lost row
    removes one combination.
    """

    def __init__(self, parts: Mapping[str, np.ndarray], number: int):
        self.parts, self.number = parts, number  # joint → (rows of the joint, number)

    @classmethod
    def of(cls, rows: Mapping[str, np.ndarray]) -> Combinations:
        """Return the vanishing combinations of rows (d, n) by joint."""
        left, values, _ = np.linalg.svd(np.concatenate(list(rows.values())))
        null = left[:, int(np.sum(values > ROUNDING * values[0])) :]
        ends = np.cumsum([len(r) for r in rows.values()])[:-1]
        return cls(dict(zip(rows, np.split(null, ends), strict=True)), null.shape[1])

    def involves(self, joint: str) -> bool:
        """Return whether a combination contains a row of the joint."""
        return bool(np.linalg.norm(self.parts[joint], axis=1).max() > PART)

    def with_exchange(self, name: str, weaker: Weaker) -> Combinations | None:
        """Return the combinations that remain after an exchange; None if the exchange lowers the rank."""
        _, values, vt = np.linalg.svd(weaker.lost @ self.parts[name])
        if len(weaker.lost) > self.number or np.sum(values > PART) < len(weaker.lost):
            return None
        left = vt[len(weaker.lost) :].T
        parts = {joint: part @ left for joint, part in self.parts.items()}
        parts[name] = np.linalg.pinv(weaker.kept.T) @ parts[name]
        return Combinations(parts, left.shape[1])


def _smallest(redundant: Combinations, choices: Choices, most: int) -> list[Exchange]:
    """Return the sets of the fewest joints that end the redundancy, at most ``most``; none for more than four
    joints."""
    for size in range(1, MOST_EXCHANGES + 1):
        if found := list(itertools.islice(_of_size(redundant, choices, size), most)):
            return found
    return []


def _of_size(redundant: Combinations, choices: Choices, size: int) -> Iterator[Exchange]:
    """Yield the exchanges of ``size`` joints that end the redundancy, for a limited number of trials."""
    names, trials = list(choices), itertools.count(1)
    most = [max((len(weaker.lost) for weaker in choices[name].values()), default=0) for name in names]
    # rows that can be lost from joint k on
    reach = [sorted(most[k:], reverse=True) for k in range(len(names) + 1)]

    def extended(chosen: Exchange, left: Combinations, first: int) -> Iterator[Exchange]:
        missing = size - len(chosen)
        if missing == 0:
            if left.number == 0:
                yield chosen
            return
        for k in range(first, len(names)):
            if sum(reach[k][:missing]) < left.number:
                return
            for kind, weaker in choices[names[k]].items():
                if next(trials) > MOST_TRIALS:
                    return
                if (rest := left.with_exchange(names[k], weaker)) is not None:
                    yield from extended({**chosen, names[k]: kind}, rest, k + 1)

    return extended({}, redundant, 0)


def _joint_by_joint(redundant: Combinations, choices: Choices) -> Exchange | None:
    """Return exchanges that end the redundancy, found joint by joint: each exchange loses as many rows as
    possible. A joint is removed if no weaker type is left. Return None if no set is found.
    """
    chosen: Exchange = {}
    offers = [(name, kind) for name, kinds in choices.items() for kind in kinds]
    offers.sort(key=lambda offer: (offer[1] == REMOVED, -len(choices[offer[0]][offer[1]].lost)))
    for name, kind in offers:
        if name not in chosen and redundant.number:
            left = redundant.with_exchange(name, choices[name][kind])
            if left is not None:
                redundant, chosen[name] = left, kind
    return None if redundant.number else {name: chosen[name] for name in choices if name in chosen}


def _is_cure(rows: Mapping[str, np.ndarray], choices: Choices, exchange: Exchange) -> bool:
    """Return whether the remaining rows are independent, and their number equals the rank."""
    left = {**rows, **{name: choices[name][kind].rows for name, kind in exchange.items()}}
    return _rank(left.values()) == _rank(rows.values()) == sum(map(len, left.values()))


def _rows(model: Model) -> dict[str, np.ndarray]:
    """Return the rows of Φ_q at the scene's poses, of unit length, by joint."""
    jacobian, owner = scaled_jacobian(model, 0.0, model.start()), np.array(model.row_joint)
    return {name: jacobian[owner == name] for name in dict.fromkeys(model.row_joint)}


def _rank(rows: Iterable[np.ndarray]) -> int:
    values = np.linalg.svd(np.concatenate(list(rows)), compute_uv=False)
    return int(np.sum(values > ROUNDING * values[0]))


def _bearing(scene: Scene, name: str) -> list[str]:
    """Return the joint types that can have the driver and the loads of the joint of that name."""
    driven = scene.joint_named(name).facts.driven if name in {d.joint for d in scene.driver} else None
    acting = {load.coordinate for load in scene.load if isinstance(load, JointLoad) and load.joint == name}
    facts = {kind: joint.facts for kind, joint in JOINT_TYPES.items()}
    return [k for k, f in facts.items() if driven in (None, f.driven) and acting <= {*f.loaded}]


def _choices(scene: Scene, model: Model, rows: Mapping[str, np.ndarray], names: Sequence[str]) -> Choices:
    """Return the weaker types of the named joints, and their removal, at the model's poses."""
    bearing = {name: _bearing(scene, name) for name in names}
    found: dict[str, dict[str, Weaker]] = {name: {} for name in names}
    for kind in dict.fromkeys(itertools.chain(*WEAKER.values())):
        changed = [
            n for n in names if kind in WEAKER.get(scene.joint_named(n).type, ()) and kind in bearing[n]
        ]
        joints = tuple(_as(j, kind) if j.name in changed else j for j in model.scene.joint)
        weaker_rows = _rows(Model(model.scene.with_(joint=joints))) if changed else {}
        for name in changed:
            found[name][kind] = _weaker(weaker_rows[name], rows[name])
    for name in names:
        order = WEAKER.get(scene.joint_named(name).type, ())
        found[name] = {kind: found[name][kind] for kind in order if kind in found[name]}
        if len(bearing[name]) == len(JOINT_TYPES):
            found[name][REMOVED] = _weaker(rows[name][:0], rows[name])
    return found


def _weaker(rows: np.ndarray, own: np.ndarray) -> Weaker:
    """Return the coefficients of rows (k, n) in a joint's own rows (d, n), and the combinations that the rows
    (k, n) lack."""
    kept = rows @ np.linalg.pinv(own)
    _, _, vt = np.linalg.svd(kept.reshape(-1, len(own)))
    return Weaker(rows, kept, vt[len(rows) :])


def _as(joint: Joint, kind: str) -> Joint:
    """Return the joint as another type at the same place; a universal joint gets the old axis as its first
    axis."""
    axis = np.array(joint.directions[0] if joint.directions else (0.0, 0.0, 1.0))
    across = np.cross(axis, np.eye(3)[np.argmin(abs(axis))])
    anchor = joint.anchor_pair[1]
    places = {"anchor": anchor, "axis": tuple(axis), "axes": (tuple(axis), tuple(across))}
    return JOINT_TYPES[kind].at(joint.name, joint.bodies, **places)
