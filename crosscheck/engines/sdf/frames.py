"""World poses of the named frames of an SDF model: links, joints and frames, each given relative to another
frame."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mbref.scene import SceneError

MODEL = "__model__"
WORLD = "world"


class Pose(NamedTuple):
    """Position (3,) and rotation matrix (3, 3) of a frame in another frame."""

    position: np.ndarray
    turn: np.ndarray

    def then(self, inner: Pose) -> Pose:
        """Return the pose of a frame whose pose is given in this frame."""
        return Pose(self.position + self.turn @ inner.position, self.turn @ inner.turn)


ORIGIN = Pose(np.zeros(3), np.eye(3))


def numbers(element: ET.Element | None, where: str, count: int) -> np.ndarray:
    """Return the numbers of an element, zeros if it has no text; raises SceneError if the element has more or
    fewer numbers."""
    text = (element.text or "") if element is not None else ""
    try:
        found = np.array([float(word) for word in text.split()])
    except ValueError:
        found = np.full(1, math.nan)
    if not found.size:
        return np.zeros(count)
    if found.size != count or not np.isfinite(found).all():
        raise SceneError([f"{where}: must be {count} numbers, got {text.strip()!r}"])
    return found


def pose_of(element: ET.Element, where: str) -> Pose:
    """Return the pose that an element gives, by roll, pitch and yaw about fixed axes or by a quaternion."""
    found = element.find("pose")
    if found is None:
        return ORIGIN
    if found.get("rotation_format") == "quat_xyzw":
        x, y, z, *quaternion = numbers(found, where, 7)
        return Pose(np.array([x, y, z]), _of_quaternion(np.array(quaternion), where))
    scale = math.radians(1.0) if found.get("degrees", "false").lower() in ("true", "1") else 1.0
    values = numbers(found, where, 6)
    roll, pitch, yaw = values[3:] * scale
    return Pose(values[:3], _about(2, yaw) @ _about(1, pitch) @ _about(0, roll))


def _of_quaternion(xyzw: np.ndarray, where: str) -> np.ndarray:
    size = float(np.linalg.norm(xyzw))
    if not abs(size - 1.0) < 1e-6:
        raise SceneError([f"{where}: the quaternion must have length one, got {size:g}"])
    x, y, z, w = xyzw / size
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + 2 * w * cross + 2 * cross @ cross)


def _about(axis: int, angle: float) -> np.ndarray:
    """Return the rotation matrix about a coordinate axis."""
    c, s = math.cos(angle), math.sin(angle)
    i, j = ((1, 2), (2, 0), (0, 1))[axis]
    turn = np.eye(3)
    turn[i, i] = turn[j, j] = c
    turn[i, j], turn[j, i] = -s, s
    return turn


@dataclass
class Frames:
    """The frames of one flat model, each of which names the frame that it is given in."""

    model: ET.Element

    def __post_init__(self) -> None:
        self._elements: dict[str, ET.Element] = {}
        self._known: dict[str, Pose] = {WORLD: ORIGIN}
        for element in self.model:
            if element.tag in ("link", "joint", "frame"):
                self._elements[str(element.get("name"))] = element

    def has(self, name: str) -> bool:
        """Return whether the model has a link, joint or frame of this name."""
        return name in self._elements

    def world(self, name: str, within: tuple[str, ...] = ()) -> Pose:
        """Return the world pose of a frame; raises SceneError for an unknown frame and for frames that refer
        to each other in a circle."""
        if name in self._known:
            return self._known[name]
        if name not in self._elements:
            raise SceneError([f"frame {name!r}: the model has no link, joint or frame of this name"])
        if name in within:
            raise SceneError(
                [f"frame {name!r}: is given relative to itself, by {' → '.join((*within, name))}"]
            )
        element = self._elements[name]
        pose = element.find("pose")
        relative_to = str(pose.get("relative_to")) if pose is not None else WORLD
        base = self.world(relative_to, (*within, name))
        self._known[name] = base.then(pose_of(element, f"{element.tag} {name!r}: pose"))
        return self._known[name]

    def link_of(self, name: str) -> str:
        """Return the link to which a frame is attached, or the world."""
        seen: list[str] = []
        while name != WORLD:
            element = self._elements.get(name)
            if element is None or name in seen:
                raise SceneError([f"frame {name!r}: is attached to no link of the model"])
            if element.tag == "link":
                return name
            seen.append(name)
            name = element.findtext("child", "").strip() or element.get("attached_to") or ""
        return name
