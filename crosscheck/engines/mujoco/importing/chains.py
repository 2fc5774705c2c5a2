"""Elementary motions between two bodies with mass, and the joints of a scene with exactly these motions."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.engines.mujoco.importing.groups import WORLD, Groups, Piece
from crosscheck.engines.shared.entries import entry
from mbref.scene import (
    Cylindrical,
    Distance,
    Joint,
    Planar,
    Revolute,
    Spherical,
    Translational,
    Universal,
)

ALIGNED = 1e-9  # largest difference of unit vectors, and of points / extent of the model
RANK = 1e-9  # singular value / largest one; smaller ones belong to dependent motions
OF_PLANAR = ("_TX", "_TY", "_RZ")  # ends of the names of MuJoCo's joints for a planar joint of a URDF
Made = list[tuple[type[Any], dict[str, Any]]]


@dataclass(frozen=True)
class Chain:
    """The motions of a body of the scene relative to the body that carries it.

    ``kinds`` are free, ball, slide or hinge; ``anchors`` and ``axes`` (n, 3) are in the world, from the
    carrying body to the carried one; ``joints`` are MuJoCo's numbers.
    """

    ends: tuple[Piece, Piece]
    joints: tuple[int, ...]
    kinds: tuple[str, ...]
    anchors: np.ndarray
    axes: np.ndarray

    def parts(self, groups: Groups) -> list[Chain]:
        """Return chains of one joint each, with massless links between them."""
        links = [_link_after(groups, j) for j in self.joints[:-1]]
        ends = zip([self.ends[0], *links], [*links, self.ends[1]], strict=True)
        return [
            Chain(pair, (j,), (kind,), self.anchors[k : k + 1], self.axes[k : k + 1])
            for k, (pair, j, kind) in enumerate(zip(ends, self.joints, self.kinds, strict=True))
        ]


def _link_after(groups: Groups, joint: int) -> Piece:
    """Return the massless link that a joint is the last to move, which is a group without mass if no joint
    of the group follows."""
    group = int(groups.model.jnt_bodyid[joint])
    return Piece(group, -1 if joint == groups.joints(group)[-1] else joint)


def chains(mujoco: Any, groups: Groups, data: Any) -> Iterator[Chain]:
    """Return the chain of every group that is a body of the scene."""
    own = {piece.group for piece in groups.pieces if piece.last < 0} | {WORLD}
    for group in sorted(own - {WORLD}, key=list(groups.members).index):
        joints, parent = groups.joints(group), groups.parent(group)
        while parent not in own:
            joints, parent = [*groups.joints(parent), *joints], groups.parent(parent)
        kinds = tuple(kind_of(mujoco, groups.model, j) for j in joints)
        ends = Piece(parent), Piece(group)
        yield Chain(ends, tuple(joints), kinds, data.xanchor[joints], data.xaxis[joints])


def kind_of(mujoco: Any, model: Any, joint: int) -> str:
    """Return the kind of a MuJoCo joint: free, ball, slide or hinge."""
    return str(mujoco.mjtJoint(model.jnt_type[joint]).name.removeprefix("mjJNT_").lower())


def without_effect(groups: Groups, held: Collection[int]) -> list[int]:
    """Return groups whose motion nothing determines.

    Such a group has no mass and is not in ``held``; nor does it carry a group with mass or a group in
    ``held``.
    """

    def carries(group: int) -> bool:
        return group in held or any(
            groups.mass[child] > 0 or carries(child) for child in groups.children(group)
        )

    return [g for g in groups.members if g != WORLD and not groups.mass[g] > 0 and not carries(g)]


def branching(groups: Groups, held: Collection[int]) -> list[int]:
    """Return groups without mass that are among ``held``, or carry several groups whose motion has an
    effect."""
    idle = without_effect(groups, held)
    light = [g for g in groups.members if g != WORLD and not groups.mass[g] > 0]
    return [g for g in light if g in held or sum(c not in idle for c in groups.children(g)) > 1]


def joints_of(chain: Chain, groups: Groups, extent: float) -> list[Joint] | None:
    """Return the scene's joints with the motions of a chain without links between them; none for a free body,
    None if no joints of a scene have these motions."""
    pair = (groups.name(chain.ends[0]), groups.name(chain.ends[1]))
    made = _recognised(chain, extent)
    if made is None:
        return None
    own = [groups.model.joint(j).name for j in chain.joints]
    name = next((n for n in own if n), f"{pair[1]} joint")
    if own == [name.removesuffix(OF_PLANAR[0]) + suffix for suffix in OF_PLANAR]:
        name = name.removesuffix(OF_PLANAR[0])
    found: list[Joint] = []
    for kind, places in made:
        label = name if not found else f"{name} {kind.__name__.lower()}"
        found.append(entry(f"joint {label!r}", kind.at, label, pair, **places))
    return found


def _recognised(chain: Chain, extent: float) -> Made | None:
    """Return types of joints and their places; None if a scene has no such joints."""
    if rank(chain, extent) < freedoms(chain):
        return None
    for recognise in (_free, _single, _cylindrical, _universal, _spherical, _planar, _two_hinges, _rod):
        found = recognise(chain, extent)
        if found is not None:
            return found
    return None


def freedoms(chain: Chain) -> int:
    """Return the number of joint velocities of a chain."""
    return sum({"free": 6, "ball": 3}.get(kind, 1) for kind in chain.kinds)


def rank(chain: Chain, extent: float) -> int:
    """Return the number of independent motions at the pose."""
    twists: list[np.ndarray] = []
    for kind, anchor, axis in zip(chain.kinds, chain.anchors, chain.axes, strict=True):
        if kind in ("free", "slide"):
            twists += [np.concatenate([v, np.zeros(3)]) for v in (np.eye(3) if kind == "free" else [axis])]
        if kind != "slide":
            turns = [axis] if kind == "hinge" else list(np.eye(3))
            arm = (anchor - chain.anchors[0]) / extent
            twists += [np.concatenate([np.cross(arm, w), w]) for w in turns]
    sizes = np.linalg.svd(np.array(twists), compute_uv=False)
    return int(np.sum(sizes > RANK * sizes[0]))


def _free(chain: Chain, extent: float) -> Made | None:
    return [] if freedoms(chain) == 6 else None


def _single(chain: Chain, extent: float) -> Made | None:
    kinds: dict[str, type[Any]] = {"hinge": Revolute, "slide": Translational, "ball": Spherical}
    if len(chain.kinds) != 1 or chain.kinds[0] not in kinds:
        return None
    return [(kinds[chain.kinds[0]], {"anchor": chain.anchors[0].tolist(), "axis": chain.axes[0].tolist()})]


def _cylindrical(chain: Chain, extent: float) -> Made | None:
    if sorted(chain.kinds) != ["hinge", "slide"] or not _parallel(chain.axes):
        return None
    turn = chain.kinds.index("hinge")
    return [(Cylindrical, {"anchor": chain.anchors[turn].tolist(), "axis": chain.axes[turn].tolist()})]


def _universal(chain: Chain, extent: float) -> Made | None:
    if chain.kinds != ("hinge", "hinge") or abs(chain.axes[0] @ chain.axes[1]) > ALIGNED:
        return None
    point = _meeting(chain, slice(0, 2), extent)
    return None if point is None else [(Universal, {"anchor": point, "axes": chain.axes.tolist()})]


def _spherical(chain: Chain, extent: float) -> Made | None:
    if chain.kinds != ("hinge",) * 3:
        return None
    point = _meeting(chain, slice(0, 3), extent)
    return None if point is None else [(Spherical, {"anchor": point})]


def _planar(chain: Chain, extent: float) -> Made | None:
    """Recognise three independent motions in a plane: hinges along its normal, slides across."""
    turns = [k for k, kind in enumerate(chain.kinds) if kind == "hinge"]
    slides = [k for k, kind in enumerate(chain.kinds) if kind == "slide"]
    if len(chain.kinds) != 3 or len(turns) + len(slides) != 3 or not turns:
        return None
    normal = chain.axes[turns[0]]
    across = np.abs(chain.axes[slides] @ normal).max(initial=0.0) <= ALIGNED
    if not across or not _parallel(chain.axes[turns]):
        return None
    return [(Planar, {"anchor": chain.anchors[turns[-1]].tolist(), "axis": normal.tolist()})]


def _two_hinges(chain: Chain, extent: float) -> Made | None:
    """Recognise two parallel hinges at a distance: a rod without mass in a plane, which keeps their
    distance."""
    if chain.kinds != ("hinge", "hinge") or not _parallel(chain.axes):
        return None
    first, second = chain.anchors
    normal = chain.axes[0]
    second = second - normal * (normal @ (second - first))
    if np.linalg.norm(second - first) <= ALIGNED * extent:
        return None
    places = {"anchor": chain.anchors[1].tolist(), "axis": normal.tolist()}
    return [(Planar, places), (Distance, {"anchors": (first.tolist(), second.tolist())})]


def _rod(chain: Chain, extent: float) -> Made | None:
    """Recognise five rotations about two points: a rod without mass between them, which keeps their
    distance."""
    for turns in (2, 3):
        points = [_centre(chain, part, extent) for part in _halves(chain, turns)]
        if len(points) == 2 and points[0] is not None and points[1] is not None:
            return [(Distance, {"anchors": (points[0], points[1])})]
    return None


def _halves(chain: Chain, turns: int) -> list[slice]:
    """Return the first ``turns`` rotations of five and the remaining ones; none if a ball joint would be
    divided."""
    sizes = [{"hinge": 1, "ball": 3}.get(kind, 9) for kind in chain.kinds]
    ends = np.cumsum(sizes)
    if ends[-1] != 5 or turns not in ends:
        return []
    k = int(np.flatnonzero(ends == turns)[0]) + 1
    return [slice(0, k), slice(k, len(sizes))]


def _centre(chain: Chain, part: slice, extent: float) -> list[float] | None:
    kinds = chain.kinds[part]
    return chain.anchors[part][0].tolist() if kinds == ("ball",) else _meeting(chain, part, extent)


def _parallel(axes: np.ndarray) -> bool:
    across = axes - np.outer(axes @ axes[0], axes[0])
    return bool(np.linalg.norm(across, axis=1).max() <= ALIGNED)


def _meeting(chain: Chain, part: slice, extent: float) -> list[float] | None:
    """Return the point (3,) in which the lines of several hinges meet; None if they do not meet."""
    axes, anchors = chain.axes[part], chain.anchors[part]
    if len(axes) < 2:
        return None
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    total = across.sum(axis=0)
    if np.linalg.svd(total, compute_uv=False)[-1] <= ALIGNED:
        return None
    point = np.linalg.solve(total, np.einsum("kij,kj->i", across, anchors - anchors[0])) + anchors[0]
    missed = np.linalg.norm(np.einsum("kij,kj->ki", across, anchors - point), axis=1).max()
    found: list[float] = point.tolist()
    return found if missed <= ALIGNED * extent else None


def renamed(joints: Sequence[Joint]) -> Iterator[Joint]:
    """Return joints with unique names: a repeated name gets a number."""
    seen: set[str] = set()
    for joint in joints:
        name, number = joint.name, 2
        while name in seen:
            name, number = f"{joint.name} {number}", number + 1
        seen.add(name)
        yield joint.model_copy(update={"name": name})
