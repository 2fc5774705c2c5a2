"""URDF: a text that MuJoCo can read without shapes, and the loops of ``<loop>`` elements (URDF+)."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from mbref.scene import Fixed, Joint, Revolute, SceneError, Spherical, Translational

PARTS = ("visual", "collision", "loop", "coupling", "transmission", "gazebo", "ros2_control")
TYPES: dict[str, Any] = {
    "fixed": Fixed, "revolute": Revolute, "continuous": Revolute, "prismatic": Translational,
    "spherical": Spherical, "ball": Spherical,
}  # fmt: skip
OPEN = 1e-6  # m; a wider loop is a fault
Place = Callable[[str, np.ndarray], tuple[int, np.ndarray]]


def _root(text: str) -> ET.Element:
    try:
        return ET.fromstring(text)
    except ET.ParseError as error:
        raise SceneError([f"URDF: is no XML: {error}"]) from None


def without_shapes(text: str) -> str:
    """The URDF without shapes, loops and actuators, its links kept as they are."""
    root = _root(text)
    for parent in list(root.iter()):
        for child in [c for c in parent if c.tag in PARTS]:
            parent.remove(child)
    options = ET.SubElement(ET.SubElement(root, "mujoco"), "compiler")
    options.attrib.update(fusestatic="false", discardvisual="true", balanceinertia="false")
    return ET.tostring(root, encoding="unicode")


def closures(text: str, place: Place, name_of: Callable[[int], str]) -> Iterator[Joint]:
    """The joints of the loops, at their predecessors' origins.

    ``<loop name type><predecessor link><origin/></predecessor><successor link>…</successor><axis/></loop>``,
    the axis in the predecessor's origin frame.  ``place`` gives the body and the world place of a point of
    a link.  Raises SceneError for an unknown type or a loop that is open at the reference position.
    """
    for loop in _root(text).iter("loop"):
        name, kind = loop.get("name", "loop"), loop.get("type", "")
        if kind not in TYPES:
            raise SceneError([f"loop {name!r}: type {kind!r} is none of {', '.join(TYPES)}"])
        ends = [_end(loop, side, place, name) for side in ("predecessor", "successor")]
        gap = math.dist(ends[0][1], ends[1][1])
        if gap > OPEN:
            raise SceneError([f"loop {name!r}: is open by {gap:.3g} m at the reference position"])
        pair = (name_of(ends[0][0]), name_of(ends[1][0]))
        axis = ends[0][2] @ _numbers(loop.find("axis"), "xyz", (1.0, 0.0, 0.0))
        yield TYPES[kind].at(name, pair, anchor=ends[0][1], axis=axis)


def _end(loop: ET.Element, side: str, place: Place, name: str) -> tuple[int, np.ndarray, np.ndarray]:
    """Body, world place and world axes (3, 3) of one side of a loop."""
    found = loop.find(side)
    if found is None or not found.get("link"):
        raise SceneError([f"loop {name!r}: names no {side}"])
    link, origin = str(found.get("link")), found.find("origin")
    at = _numbers(origin, "xyz", (0.0, 0.0, 0.0))
    body, where = place(link, at)
    axes = np.array([place(link, at + e)[1] - where for e in np.eye(3)]).T
    return body, where, axes @ _roll_pitch_yaw(_numbers(origin, "rpy", (0.0, 0.0, 0.0)))


def _numbers(element: Any, key: str, default: tuple[float, float, float]) -> np.ndarray:
    text = element.get(key) if element is not None else None
    return np.array([float(word) for word in text.split()] if text else default)


def _roll_pitch_yaw(angles: np.ndarray) -> np.ndarray:
    """Rotation matrix of fixed-axis angles about x, y, z."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a), math.sin(a)) for a in angles)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
