"""World poses of the named frames of an SDF model: links, joints and frames, each given relative to another
frame."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mbref.scene import SceneError
from mbref.scene.fields import LARGEST, shown

MODEL = "__model__"
WORLD = "world"
NAMED = ("link", "joint", "frame")


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
    if found.size != count or not (np.abs(found) <= LARGEST).all():
        what = "a number" if count == 1 else f"{count} numbers"
        what += f" of at most {LARGEST:g} in size" if found.size == count else ""
        raise SceneError([f"{where}: must be {what}, got {shown(text.strip())}"])
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
        self._known: dict[int, Pose] = {}
        own = self.model.findall(f"frame[@name='{MODEL}']")
        named = (element for tag in NAMED for element in self.model.findall(tag))
        for element in (*own, *named):  # a link has its name before a joint and a frame, as in libsdformat
            self._elements.setdefault(str(element.get("name")), element)

    def has(self, name: str) -> bool:
        """Return whether the model has a link, joint or frame of this name."""
        return name in self._elements

    def world(self, name: str) -> Pose:
        """Return the world pose of a named frame; raises SceneError as ``pose``."""
        return ORIGIN if name == WORLD else self.pose(self._named(name))

    def pose(self, element: ET.Element) -> Pose:
        """Return the world pose of a link, joint or frame, whose name another element may have too.

        Raises SceneError for an unknown frame and for frames that refer to each other in a circle.
        """
        way, passed_ones = [element], {id(element)}
        while id(way[-1]) not in self._known and (base := _base(way[-1])) != WORLD:
            way.append(self._named(base))
            if id(way[-1]) in passed_ones:
                names = [str(passed.get("name")) for passed in way]
                raise SceneError(
                    [f"frame {names[-1]!r}: is given relative to itself, by {' → '.join(names)}"]
                )
            passed_ones.add(id(way[-1]))
        found = self._known.get(id(way[-1]), ORIGIN)
        for passed in reversed(way):
            if id(passed) not in self._known:
                where = f"{passed.tag} {passed.get('name')!r}: pose"
                self._known[id(passed)] = found.then(pose_of(passed, where))
            found = self._known[id(passed)]
        return found

    def _named(self, name: str) -> ET.Element:
        if name not in self._elements:
            raise SceneError([f"frame {name!r}: the model has no link, joint or frame of this name"])
        return self._elements[name]

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


def _base(element: ET.Element) -> str:
    """Return the name of the frame in which an element gives its pose."""
    pose = element.find("pose")
    return WORLD if pose is None else str(pose.get("relative_to"))


def check_names(model: ET.Element) -> None:
    """Raise SceneError for a link or frame without a name, or with the name of the fixed frame."""
    for element in (part for tag in ("link", "frame") for part in model.findall(tag)):
        own = str(element.get("name")).rpartition("::")[2]
        if own in (WORLD, "None", ""):
            why = f"{own!r}: the name means the fixed frame" if own == WORLD else "without a name"
            raise SceneError([f"{element.tag} {why}; give it another name"])
