"""Loops that the user closes: pairs of frames, from ``--close`` or a YAML file; and frames that coincide."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engines.mujoco.importing.closures import TYPES, Closure, Frame, of_site
from crosscheck.engines.mujoco.importing.groups import WORLD, Groups
from crosscheck.engines.shared.geometry import joint_frame
from mbref.files import content
from mbref.scene import GROUND, SceneError

AXES = dict(zip("xyz", np.eye(3), strict=True))
SHORT = {"3d": "spherical", "6d": "fixed"}  # numbers of equations, as in YAML files of parallel robots
COINCIDENT = 1e-6  # distance / extent of the model at which frames coincide
GRAMMAR = "frame_a=frame_b[:type[:axis]] or a .yaml file"


class Frames:
    """The named frames of a model: bodies, sites and joints; a joint's frame moves with its child link."""

    def __init__(self, mujoco: Any, model: Any, root: str, child_links: Mapping[str, str]):
        self.mujoco, self.model, self.root, self.child_links = mujoco, model, root, child_links
        kinds = mujoco.mjtObj
        self._kinds = (kinds.mjOBJ_SITE, kinds.mjOBJ_BODY)

    def find(self, name: str) -> Frame:
        """Return the frame of a site, body, link or joint; raises SceneError that names similar ones."""
        if name in (GROUND, "world", self.root):
            return Frame(WORLD, np.zeros(3), np.eye(3))
        site, body = (self.mujoco.mj_name2id(self.model, kind, name) for kind in self._kinds)
        if site >= 0:
            return of_site(self.model, site)
        joint = self.mujoco.mj_name2id(self.model, self.mujoco.mjtObj.mjOBJ_JOINT, name)
        if body == -1 and joint >= 0:
            return Frame(int(self.model.jnt_bodyid[joint]), np.array(self.model.jnt_pos[joint]), np.eye(3))
        if body == -1 and name in self.child_links:  # a fixed joint
            return self.find(self.child_links[name])
        if body == -1:
            known = list(self.names())
            near = difflib.get_close_matches(name, known)
            meant = f"; did you mean {near[0]!r}?" if near else f"; known: {', '.join(known)}"
            raise SceneError([f"--close: no link, body, site or joint {name!r}{meant}"])
        return Frame(int(body), np.zeros(3), np.eye(3))

    def names(self) -> Iterator[str]:
        """Return the names of all bodies, all sites, then of all joints."""
        model, kinds = self.model, (*reversed(self._kinds), self.mujoco.mjtObj.mjOBJ_JOINT)
        for kind, count in zip(kinds, (model.nbody, model.nsite, model.njnt), strict=True):
            yield from filter(None, (self.mujoco.mj_id2name(model, kind, k) for k in range(count)))


def asked(options: Sequence[str], frames: Frames) -> Iterator[Closure]:
    """Return the closures of the ``--close`` options; raises SceneError, OSError."""
    for text in options:
        if text.endswith((".yaml", ".yml")):
            yield from _of_yaml(Path(text), frames)
        else:
            yield _of_text(text, frames)


def _of_text(text: str, frames: Frames) -> Closure:
    pair, _, rest = text.partition(":")
    kind, _, axis = rest.partition(":")
    first, _, second = pair.partition("=")
    if not first or not second:
        raise SceneError([f"--close {text}: must be {GRAMMAR}"])
    return _closure(first, second, kind or "spherical", axis or "z", frames)


def _closure(first: str, second: str, kind: str, axis: str, frames: Frames) -> Closure:
    name, kind = f"{first}={second}", SHORT.get(kind.lower(), kind)
    if kind not in TYPES:
        raise SceneError([f"--close {name}: type {kind!r} is none of {', '.join((*TYPES, *SHORT))}"])
    if axis not in AXES:
        raise SceneError([f"--close {name}: axis {axis!r} is none of x, y, z (of both frames)"])
    turn = joint_frame(AXES[axis])
    ends = [frames.find(end) for end in (first, second)]
    a, b = (Frame(end.body, end.origin, end.axes @ turn) for end in ends)
    return Closure(name, TYPES[kind], (a, b))


def _of_yaml(path: Path, frames: Frames) -> Iterator[Closure]:
    """Read ``closed_loop: [[frame_a, frame_b], …]`` with optional ``type: [3d, …]`` and ``axis: [z, …]``."""
    try:
        import yaml
    except ImportError:
        raise SceneError([f"{path}: reading YAML needs pip install pyyaml"]) from None
    try:
        found = yaml.safe_load(content(path).decode())
    except yaml.YAMLError as error:
        raise SceneError([f"{path}: is no YAML: {' '.join(str(error).split())}"]) from None
    pairs = found.get("closed_loop") if isinstance(found, dict) else None
    if not isinstance(pairs, list) or not all(isinstance(p, list) and len(p) == 2 for p in pairs):
        raise SceneError([f"{path}: closed_loop must be a list of pairs of frames"])
    kinds = _as_many(found.get("type"), len(pairs), "spherical", path, "type")
    axes = _as_many(found.get("axis"), len(pairs), "z", path, "axis")
    for (first, second), kind, axis in zip(pairs, kinds, axes, strict=True):
        yield _closure(str(first), str(second), str(kind), str(axis), frames)


def _as_many(value: Any, count: int, default: str, path: Path, key: str) -> list[Any]:
    value = [default] * count if value is None else value if isinstance(value, list) else [value] * count
    if len(value) != count:
        raise SceneError([f"{path}: {key} has {len(value)} entries for {count} loops"])
    return list(value)


def unclosed(groups: Groups, data: Any, closed: Sequence[Closure], extent: float) -> Iterator[str]:
    """Return a sentence for every two frames without mass that coincide on bodies that no joint connects
    there."""
    places = [(name, int(groups.of[f.body]), f.place(data)) for name, f in _marks(groups)]
    taken = [c.frames[0].place(data) for c in closed] + list(data.xanchor)
    for i, (first, a, place) in enumerate(places):
        for second, b, other in places[i + 1 :]:
            near = COINCIDENT * extent
            apart = a != b and np.linalg.norm(place - other) <= near
            if apart and all(np.linalg.norm(place - t) > near for t in taken):
                yield (
                    f"frames {first!r} (on {groups.names[a]!r}) and {second!r} (on {groups.names[b]!r}) "
                    f"coincide without a joint; --close {first}={second} closes the loop"
                )


def _marks(groups: Groups) -> Iterator[tuple[str, Frame]]:
    """Return named sites, and named bodies without mass or children that are fixed to another body."""
    model = groups.model
    parents = set(model.body_parentid.tolist())
    for b in range(model.nbody):  # the world carries others
        if model.body_mass[b] == 0 and not model.body_jntnum[b] and b not in parents and model.body(b).name:
            yield model.body(b).name, Frame(b, np.zeros(3), np.eye(3))
    for s in range(model.nsite):
        if model.site(s).name:
            yield model.site(s).name, of_site(model, s)
