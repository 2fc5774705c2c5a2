"""Numbers of single elements of an SDF file: pitches, axes, inertias; and the elements that are read."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from typing import Any

import numpy as np

from crosscheck.engines.mujoco.importing.left_out import Part
from crosscheck.engines.sdf.frames import Frames, Pose, numbers
from crosscheck.engines.shared import xml_files
from mbref.formats import numbered
from mbref.scene import SceneError

ENDS = (("lower", -math.inf), ("upper", math.inf))
KNOWN = {  # outer elements → inner elements that are read, listed otherwise, or have no influence on a motion
    "sdf": ("world", "model", "include", "actor", "light"),
    "world": (
        *("name", "gravity", "include", "model", "frame", "joint", "actor", "light", "plugin", "audio"),
        *("physics", "scene", "gui", "spherical_coordinates", "magnetic_field", "atmosphere", "road"),
        *("wind", "state"),
    ),
    "model": (
        *("static", "self_collide", "allow_auto_disable", "include", "model", "frame", "pose", "link"),
        *("joint", "plugin", "gripper", "sensor", "enable_wind"),
    ),
    "link": (
        *("gravity", "kinematic", "self_collide", "must_be_base_link", "velocity_decay"),
        *("pose", "inertial", "collision"),
        *("visual", "sensor", "projector", "audio_sink", "audio_source", "battery", "light", "plugin"),
        *("particle_emitter", "enable_wind"),
    ),
    "inertial": ("mass", "pose", "inertia", "fluid_added_mass", "density", "auto_inertia_params"),
    "joint": (
        *("parent", "child", "pose", "axis", "axis2", "gearbox_ratio", "gearbox_reference_body"),
        *("thread_pitch", "screw_thread_pitch", "sensor"),
    ),
    "axis": ("xyz", "dynamics", "limit", "mimic", "initial_position"),
    "axis2": ("xyz", "dynamics", "limit", "mimic", "initial_position"),
    "mimic": ("multiplier", "offset", "reference"),
    "dynamics": ("damping", "friction", "spring_reference", "spring_stiffness"),
}

UNUSED = {
    "plugin": ("plugin", "plugins"),
    "actor": ("actor", "actors"),
    "light": ("light", "lights"),
    "gripper": ("gripper", "grippers"),
    "collision": ("shape that could touch others", "shapes that could touch others"),
    "sensor": ("sensor", "sensors"),
}


def unused(root: ET.Element) -> Iterator[str]:
    """Return sentences on parts that a scene cannot contain and that do not change a motion without
    contacts."""
    yield from xml_files.unread(root, KNOWN)
    if root.find("world/physics/gravity") is not None:
        yield "<gravity> of a physics: is not read; since SDF 1.6 it is an element of the world"
    counts = [(len(list(root.iter(tag))), *names) for tag, names in UNUSED.items()]
    limits = sum(limit.find("lower") is not None for limit in root.iter("limit"))
    for count in (*counts, (limits, "limit of a joint", "limits of joints")):
        if count[0]:
            yield numbered(*count)


def of_world(root: ET.Element) -> Iterator[Part]:
    """Return the state and the wind of a world, which change the motion of its models."""
    for state in root.findall("world/state"):
        yield Part("start", f"state of world {state.get('world_name', '')!r}")
    wind = root.find("world/wind/linear_velocity")
    if wind is not None and np.any(numbers(wind, "wind", 3)):
        for model in root.findall("world/model"):
            yield from (Part("fluid", f"wind at link {name!r}") for name in _blown(model))


def _blown(model: ET.Element, outer: ET.Element | None = None) -> Iterator[str]:
    """Return the names of the links of a model that wind blows on; a link or model without its own element
    has the one of the model around it."""
    if is_true(model.find("static")):
        return
    whole = model.find("enable_wind")
    whole = outer if whole is None else whole
    for link in model.findall("link"):
        own = link.find("enable_wind")
        if is_true(whole if own is None else own):
            yield str(link.get("name"))
    for inner in model.findall("model"):
        yield from _blown(inner, whole)


def pitch(joint: ET.Element) -> float:
    """Return the displacement of a screw per turn (m), as libsdformat reads it.

    ``screw_thread_pitch`` p is p m a turn, ``thread_pitch`` p is -2π / p m a turn, and neither 1 m a turn.
    """
    where = f"joint {joint.get('name')!r}"
    own, old = joint.find("screw_thread_pitch"), joint.find("thread_pitch")
    if own is None and old is None:
        return 1.0
    tag = "thread_pitch" if own is None else "screw_thread_pitch"
    given = number(old if own is None else own, f"{where}: {tag}", 1.0)
    if not given:
        raise SceneError([f"{where}: {tag} must not be 0"])
    return -2 * math.pi / given if own is None else given


def direction(axis: ET.Element | None, name: str, at: Pose, frames: Frames) -> np.ndarray:
    """Return the world direction (3,) of a joint's axis."""
    if axis is None:
        return np.array(at.turn[:, 2])
    where = f"joint {name!r}: axis"
    xyz = axis.find("xyz")
    given = np.array([0.0, 0.0, 1.0]) if xyz is None else numbers(xyz, where, 3)
    size = float(np.linalg.norm(given))
    if not size:
        raise SceneError([f"{where}: has no length; give xyz a direction, such as 0 0 1"])
    expressed = xyz.get("expressed_in") if xyz is not None else None
    turn = at.turn if expressed is None else frames.world(expressed).turn
    return np.asarray(turn @ given / size)


def number(element: ET.Element | None, where: str, default: float) -> float:
    """Return the number of an element, the default without element; raises SceneError for other text."""
    return default if element is None else float(numbers(element, where, 1)[0])


def is_true(element: ET.Element | None) -> bool:
    """Return whether an element says true or 1."""
    return element is not None and (element.text or "").strip().lower() in ("true", "1")


def inertia_of(element: ET.Element | None, link: str) -> np.ndarray:
    """Return the inertia matrix (3, 3) of an element, with ones in the diagonal if the element gives no
    inertia."""
    if element is None:
        return np.eye(3)

    def entry(i: int, j: int) -> float:
        tag = f"i{'xyz'[min(i, j)]}{'xyz'[max(i, j)]}"
        return number(element.find(tag), f"link {link!r}: {tag}", float(i == j))

    return np.array([[entry(i, j) for j in range(3)] for i in range(3)])


def plain(inertia: np.ndarray) -> Any:
    """Return principal moments if the matrix is diagonal, otherwise the matrix."""
    inertia = (inertia + inertia.T) / 2
    diagonal = np.diag(inertia)
    is_diagonal = np.abs(inertia - np.diag(diagonal)).max() <= 1e-15 * np.abs(inertia).max()
    return (diagonal if is_diagonal else inertia).tolist()


def limits_of(axis: ET.Element, joint: str) -> tuple[float, float]:
    """Return the lower and upper limit (rad or m) of an axis; raises SceneError if they contradict each
    other."""
    found = axis.find("limit")
    if found is None:
        return -math.inf, math.inf
    ends = [_limit(found.find(tag), f"joint {joint!r}: {tag} limit", infinite) for tag, infinite in ENDS]
    if ends[0] > ends[1]:
        raise SceneError(
            [f"joint {joint!r}: its lower limit {ends[0]:g} is above its upper limit {ends[1]:g}"]
        )
    return ends[0], ends[1]


def _limit(element: ET.Element | None, where: str, infinite: float) -> float:
    """Return a limit; the format also writes ``inf`` and numbers above 1e16 for an axis without limit."""
    text = "" if element is None else (element.text or "").strip()
    if element is None or text.lower().lstrip("+-") in ("inf", "infinity"):
        return infinite
    return number(element, where, infinite)
