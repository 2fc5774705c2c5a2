"""The machine that a URDF means by its specification, wiki.ros.org/urdf/XML.

The root link is fixed to the world, which the specification leaves open. An axis gives a direction alone, and
without ``<axis>`` it is (1, 0, 0). A joint's frame is the child link's frame, so that axes are in it.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from typing import Any

import numpy as np

from crosscheck.engines.loaders.machine import (
    FIXED,
    REVOLUTE,
    TRANSLATIONAL,
    WORLD,
    Body,
    Coupling,
    Joint,
    Machine,
    coefficients,
    vector,
)
from crosscheck.engines.loaders.placing import ORIGIN, Place, of_rpy
from mbref.scene import SceneError
from mbref.scene.fields import LARGEST

TYPES = {
    "revolute": REVOLUTE,
    "continuous": REVOLUTE,
    "prismatic": TRANSLATIONAL,
    "fixed": FIXED,
    "floating": "free",
    "planar": "planar",
}
KNOWN = {  # outer elements → inner elements of the specification
    "robot": ("link", "joint", "material", "transmission", "gazebo", "sensor", "mujoco"),
    "link": ("inertial", "visual", "collision"),
    "joint": (
        *("origin", "parent", "child", "axis", "dynamics", "limit", "mimic", "calibration"),
        "safety_controller",
    ),
}


def meant(root: ET.Element, where: str) -> Machine:
    """Return the machine; raises SceneError if the links are no tree or a number is none."""
    links = {str(link.get("name")): link for link in root.findall("link")}
    joints = root.findall("joint")
    ends = {str(j.get("name")): (_link(j, "parent"), _link(j, "child")) for j in joints}
    carried = {child for _, child in ends.values()}
    roots = [name for name in links if name not in carried]
    if unknown := {end for pair in ends.values() for end in pair} - links.keys():
        raise SceneError(
            [f"{where}: joints name links that the file does not have: {', '.join(sorted(unknown))}"]
        )
    if len(roots) != 1 or len(carried) != len(joints):
        found = f"the links are no tree with one root: {', '.join(roots) or 'no root'}"
        raise SceneError([f"{where}: {found}; give every link but one a joint of which it is the child"])
    places = {roots[0]: ORIGIN}
    waiting = list(joints)
    while ready := [j for j in waiting if ends[str(j.get("name"))][0] in places]:
        for joint in ready:
            parent, child = ends[str(joint.get("name"))]
            places[child] = places[parent].then(_origin(joint))
            waiting.remove(joint)
    if waiting:
        name = waiting[0].get("name")
        raise SceneError([f"{where}: joint {name!r} belongs to a circle of links; URDF cannot close loops"])
    rooted = Joint(f"{roots[0]} fixed", FIXED, (WORLD, roots[0]))
    return Machine(
        bodies=tuple(_body(name, link, places[name]) for name, link in links.items()),
        joints=(rooted, *(_joint(j, ends[str(j.get("name"))], places) for j in joints)),
        couplings=tuple(_couplings(joints)),
        messages=tuple(_unknown(root)),
    )


def _link(joint: ET.Element, side: str) -> str:
    found = joint.find(side)
    if found is None or not found.get("link"):
        raise SceneError([f"joint {joint.get('name')!r}: names no {side} link"])
    return str(found.get("link"))


def _numbers(element: ET.Element | None, key: str, default: tuple[float, ...]) -> np.ndarray:
    text = element.get(key) if element is not None else None
    try:
        found = np.array([float(word) for word in text.split()] if text is not None else default)
    except ValueError:
        found = np.zeros(0)
    if found.shape != (len(default),) or not np.isfinite(found).all():
        raise SceneError([f"<{element.tag if element is not None else ''} {key}={text!r}>: must be numbers"])
    if element is not None and element.tag != "limit" and np.abs(found).max() > LARGEST:
        raise SceneError([f"<{element.tag} {key}={text!r}>: must be at most {LARGEST:g} in size"])
    return found


def _number(element: ET.Element | None, key: str, default: float) -> float:
    return float(_numbers(element, key, (default,))[0])


def _origin(element: ET.Element) -> Place:
    origin = element.find("origin")
    zero = (0.0, 0.0, 0.0)
    return of_rpy(_numbers(origin, "xyz", zero), _numbers(origin, "rpy", zero))


def _body(name: str, link: ET.Element, at: Place) -> Body:
    inertial = link.find("inertial")
    if inertial is None:
        return at.body(name, 0.0, np.zeros(3), np.zeros((3, 3)))
    found, own = inertial.find("inertia"), at.then(_origin(inertial))
    rows = [[_number(found, f"i{min(a, b)}{max(a, b)}", 0.0) for b in "xyz"] for a in "xyz"]
    return own.body(name, _number(inertial.find("mass"), "value", 0.0), np.zeros(3), np.array(rows))


def _joint(joint: ET.Element, pair: tuple[str, str], places: dict[str, Place]) -> Joint:
    name, given, at = str(joint.get("name")), str(joint.get("type")), places[pair[1]]
    if given not in TYPES:
        raise SceneError([f"joint {name!r}: type {given!r} is none of {', '.join(TYPES)}"])
    kind, anchor = TYPES[given], vector(at.position)
    damping = coefficients(_number(joint.find("dynamics"), "damping", 0.0))
    if kind in (FIXED, "free"):
        return Joint(name, kind, pair, anchor, damping=damping if kind == "free" else None)
    axis = _numbers(joint.find("axis"), "xyz", (1.0, 0.0, 0.0))
    if not (size := float(np.linalg.norm(axis))):
        raise SceneError([f"joint {name!r}: axis has no length; give xyz a direction, such as 0 0 1"])
    if kind == "planar":
        return Joint(name, kind, pair, anchor, at.direction(axis / size))
    limit, dynamics = joint.find("limit"), joint.find("dynamics")
    ends: dict[str, Any] = {"lower": -math.inf, "upper": math.inf}
    if given != "continuous" and limit is not None:
        ends = {end: _number(limit, end, 0.0) for end in ends}
    return Joint(
        name,
        kind,
        pair,
        anchor,
        at.direction(axis / size),
        damping=damping,
        stiffness=(),
        armature=0.0,
        friction=_number(dynamics, "friction", 0.0),
        reference=0.0,
        **ends,
    )


def _couplings(joints: list[ET.Element]) -> Iterator[Coupling]:
    for joint in joints:
        if (mimic := joint.find("mimic")) is not None:
            name, leader = str(joint.get("name")), str(mimic.get("joint"))
            law = _number(mimic, "offset", 0.0), _number(mimic, "multiplier", 1.0)
            yield Coupling(name, name, leader, coefficients(*law))


def _unknown(root: ET.Element) -> Iterator[str]:
    """Yield a sentence for each kind of element that the specification does not have."""
    for outer in (root, *root.findall("link"), *root.findall("joint")):
        for tag in dict.fromkeys(element.tag for element in outer):
            if isinstance(tag, str) and tag not in KNOWN[outer.tag]:
                yield f"<{tag}> in {outer.tag} {outer.get('name')!r}: the specification has no such element"
