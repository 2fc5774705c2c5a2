"""Exchanges and removals of joints that end all redundancy and keep the degrees of freedom of a mechanism."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mbref.design.along_motion import general_pose
from mbref.equations.counts import rank_of, scaled_jacobian
from mbref.equations.model import Model
from mbref.equations.offsets import assembled
from mbref.equations.placed import placed
from mbref.linear_algebra.least_norm import null_space
from mbref.motions.constraints import without_armatures
from mbref.scene import JOINT_TYPES, Joint, JointLoad, Scene
from mbref.scenes import find_scene
from mbref.stepping.run import NEARLY

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


def exchanges(scene: Scene | str | Path, most: int = 6) -> list[Exchange]:
    """Return sets of joints whose exchange or removal ends all redundancy, with the same freedoms.

    If at most four joints suffice, the smallest sets are returned. If more joints are needed, one set is
    found joint by joint. The rank is computed at a general pose, without drivers. A joint with a driver, an
    armature, a coupling or a torsion spring is exchanged only for a type that can have it, and is not
    removed.

    Parameters
    ----------
    scene : Scene, str or path
        The mechanism, the name of a built-in one, or a .toml file.
    most : int
        Largest number of sets without removed joints, and of sets with removed joints.

    Returns
    -------
    list of dict of str to str
        For each set, the new type of each joint, or ``"removed"``. Empty if nothing is redundant or no set is
        found.
    """
    scene = assembled(find_scene(scene))
    model = Model(without_armatures(scene).with_(driver=(), load=()))
    if not model.m:
        return []
    at_pose = Model(placed(model, general_pose(model)))
    rows = _rows_by_joint(at_pose)
    null = null_space(np.concatenate(list(rows.values())).T, NEARLY)  # vanishing combinations of rows
    ends, number = np.cumsum([len(r) for r in rows.values()])[:-1], null.shape[1]
    dependences = dict(zip(rows, np.split(null, ends), strict=True))
    part = {name: np.linalg.norm(of_joint, axis=1) for name, of_joint in dependences.items()}
    involved = [j.name for j in at_pose.scene.joint if j.name in part and part[j.name].max() > PART]
    choices = _weaker_types(scene, at_pose, rows, {name: dependences[name] for name in involved})
    kept = {name: {k: w for k, w in kinds.items() if k != REMOVED} for name, kinds in choices.items()}
    found = _smallest_sets(kept, number, most)
    found += [e for e in _smallest_sets(choices, number, most) if REMOVED in e.values()]
    found = found or [e for e in [_greedy_set(choices, number)] if e]
    return [exchange for exchange in found if _is_cure(rows, choices, exchange)]


class Weaker(NamedTuple):
    """A weaker joint type at the place of a joint: its rows, and the components of the row combinations that
    it lacks in the c dependences (left null vectors) of all rows.

    The rank is unchanged if the components of all lost combinations are independent.
    """

    rows: np.ndarray  # (k, n), of unit length
    lost: np.ndarray  # (d - k, c) for d rows of the joint


Choices = Mapping[str, Mapping[str, Weaker]]  # joint → type → remaining rows


def _keeps_rank(lost: np.ndarray) -> bool:
    """Return whether the rank is unchanged without row combinations that have these components (l, c)."""
    return bool(np.sum(np.linalg.svd(lost, compute_uv=False) > PART) == len(lost))


def _smallest_sets(choices: Choices, number: int, most: int) -> list[Exchange]:
    """Return the sets of the fewest joints that end all dependences, at most ``most``; none for more than
    four joints."""
    for size in range(1, MOST_EXCHANGES + 1):
        if found := list(itertools.islice(_sets_of_size(choices, number, size), most)):
            return found
    return []


def _sets_of_size(choices: Choices, number: int, size: int) -> Iterator[Exchange]:
    """Yield the exchanges of ``size`` joints that end all dependences, for a limited number of trials."""
    names, trials = list(choices), itertools.count(1)
    most = [max((len(weaker.lost) for weaker in choices[name].values()), default=0) for name in names]
    # rows that can be lost from joint k on
    reach = [sorted(most[k:], reverse=True) for k in range(len(names) + 1)]

    def extended(chosen: Exchange, lost: np.ndarray, first: int) -> Iterator[Exchange]:
        missing = size - len(chosen)
        if missing == 0:
            if len(lost) == number:
                yield chosen
            return
        for k in range(first, len(names)):
            if sum(reach[k][:missing]) < number - len(lost):
                return
            for kind, weaker in choices[names[k]].items():
                if next(trials) > MOST_TRIALS:
                    return
                if _keeps_rank(more := np.concatenate([lost, weaker.lost])):
                    yield from extended({**chosen, names[k]: kind}, more, k + 1)

    return extended({}, np.zeros((0, number)), 0)


def _greedy_set(choices: Choices, number: int) -> Exchange | None:
    """Return exchanges that end all dependences, found joint by joint: each exchange loses as many rows as
    possible. A joint is removed if no weaker type is left. Return None if no set is found.
    """
    chosen: Exchange = {}
    offers = [(name, kind) for name, kinds in choices.items() for kind in kinds]
    offers.sort(key=lambda offer: (offer[1] == REMOVED, -len(choices[offer[0]][offer[1]].lost)))
    lost = np.zeros((0, number))
    for name, kind in offers:
        more = np.concatenate([lost, choices[name][kind].lost])
        if name not in chosen and len(lost) < number and _keeps_rank(more):
            lost, chosen[name] = more, kind
    return {name: chosen[name] for name in choices if name in chosen} if len(lost) == number else None


def _is_cure(rows: Mapping[str, np.ndarray], choices: Choices, exchange: Exchange) -> bool:
    """Return whether the remaining rows are independent, and their number equals the rank."""
    left = {**rows, **{name: choices[name][kind].rows for name, kind in exchange.items()}}
    remaining, every = (np.concatenate(list(of.values())) for of in (left, rows))
    return rank_of(remaining, NEARLY) == rank_of(every, NEARLY) == len(remaining)


def _rows_by_joint(model: Model) -> dict[str, np.ndarray]:
    """Return the rows of Φ_q at the scene's poses, of unit length, by joint."""
    jacobian, owner = scaled_jacobian(model, 0.0, model.start()), np.array(model.row_joint)
    return {name: jacobian[owner == name] for name in dict.fromkeys(model.row_joint)}


def _admissible_types(scene: Scene, name: str) -> list[str]:
    """Return the joint types that can have the driver, the armature, the loads and the couplings of the joint
    of that name."""
    joint = scene.joint_named(name)
    if any(driver.joint == name and driver.turn for driver in scene.driver):
        return [joint.type]
    couplings = [c for c in scene.coupling if name in c.joints]
    coupled = {coordinate for c in couplings for end, coordinate in scene.coupled(c) if end.name == name}
    by_default = any(c.coordinates is None for c in couplings)
    prescribed = name in {d.joint for d in scene.driver} or joint.reflected_inertia or by_default
    driven = joint.facts.driven if prescribed else None
    acting = {load.coordinate for load in scene.load if isinstance(load, JointLoad) and load.joint == name}
    facts = {kind: other.facts for kind, other in JOINT_TYPES.items()}
    return [
        kind
        for kind, f in facts.items()
        if driven in (None, f.driven) and acting <= {*f.loaded} and coupled <= {*f.coordinates}
    ]


def _weaker_types(
    scene: Scene, model: Model, rows: Mapping[str, np.ndarray], names: Mapping[str, np.ndarray]
) -> Choices:
    """Return the weaker types of joints, and their removal, that keep the rank at the model's poses.

    ``names`` gives the dependences (d, c) of each of these joints.
    """
    bearing = {name: _admissible_types(scene, name) for name in names}
    found: dict[str, dict[str, Weaker]] = {name: {} for name in names}
    for kind in dict.fromkeys(itertools.chain(*WEAKER.values())):
        changed = [
            n for n in names if kind in WEAKER.get(scene.joint_named(n).type, ()) and kind in bearing[n]
        ]
        joints = tuple(_retyped(j, kind) if j.name in changed else j for j in model.scene.joint)
        weaker_rows = _rows_by_joint(Model(model.scene.with_(joint=joints, coupling=()))) if changed else {}
        for name in changed:
            found[name][kind] = _remaining(weaker_rows[name], rows[name], names[name])
    for name in names:
        order = WEAKER.get(scene.joint_named(name).type, ())
        found[name] = {kind: found[name][kind] for kind in order if kind in found[name]}
        if len(bearing[name]) == len(JOINT_TYPES):
            found[name][REMOVED] = _remaining(rows[name][:0], rows[name], names[name])
    return {name: {k: w for k, w in kinds.items() if _keeps_rank(w.lost)} for name, kinds in found.items()}


def _remaining(rows: np.ndarray, own: np.ndarray, dependences: np.ndarray) -> Weaker:
    """Return a weaker type with rows (k, n) from a joint's own rows (d, n) and their dependences (d, c)."""
    _, _, vt = np.linalg.svd((rows @ np.linalg.pinv(own)).reshape(-1, len(own)))
    return Weaker(rows, vt[len(rows) :] @ dependences)


def _retyped(joint: Joint, kind: str) -> Joint:
    """Return the joint as another type at the same place; a universal joint gets the old axis as its first
    axis."""
    axis = np.array(joint.directions[0] if joint.directions else (0.0, 0.0, 1.0))
    across = np.cross(axis, np.eye(3)[np.argmin(abs(axis))])
    anchor = joint.anchor_pair[1]
    places = {"anchor": anchor, "axis": tuple(axis), "axes": (tuple(axis), tuple(across))}
    return JOINT_TYPES[kind].at(joint.name, joint.bodies, **places)
