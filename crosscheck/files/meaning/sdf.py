"""The machine that an SDF file means by its specification, sdformat.org/spec.

Joints are taken in the order of the file: a joint that connects a new link is part of the tree, a joint
between connected links closes a loop. Links that no joint connects to the world are free.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engines.loaders.machine import (
    FIXED,
    REVOLUTE,
    SCALAR,
    TRANSLATIONAL,
    UNLIMITED_IN_SDF,
    WORLD,
    Body,
    Coupling,
    Joint,
    Loop,
    Machine,
    coefficients,
    limits,
    vector,
)
from crosscheck.engines.loaders.placing import Place
from crosscheck.engines.sdf.elements import direction, inertia_of, limits_of, number, pitch
from crosscheck.engines.sdf.flattening import STATIC, flattened
from crosscheck.engines.sdf.frames import Frames, check_names, numbers, pose_of
from crosscheck.engines.sdf.including import expanded
from mbref.scene import SceneError

GRAVITY = (0.0, 0.0, -9.8)  # m/s², default of the element <gravity> of a world
TYPES = {
    "revolute": REVOLUTE,
    "continuous": REVOLUTE,
    "prismatic": TRANSLATIONAL,
    "fixed": FIXED,
    "ball": "spherical",
    "universal": "universal",
    "revolute2": "universal",
    "screw": "screw",
    "gearbox": "gearbox",
}


def meant(root: ET.Element, path: Path) -> Machine:
    """Return the machine of all models; raises SceneError, OSError."""
    if root.find("model") is None and root.find("world") is None:
        raise SceneError([f"{path}: has no model"])
    root = expanded(root, path)
    flat = flattened(root)
    check_names(flat)
    frames = Frames(flat)
    links = flat.findall("link")
    made = [_joint(joint, frames) for joint in flat.findall("joint")]
    tree, loops = _split(made, links)
    given = root.find("world/gravity")
    return Machine(
        bodies=tuple(_body(link, frames) for link in links),
        joints=tuple(tree),
        loops=tuple(loops),
        couplings=tuple(_couplings(flat)),
        gravity=GRAVITY if given is None else vector(numbers(given, "gravity", 3)),
    )


def _body(link: ET.Element, frames: Frames) -> Body:
    name, at, inertial = str(link.get("name")), frames.pose(link), link.find("inertial")
    place = Place(at.position, at.turn)
    if inertial is None:
        return place.body(name, 1.0, np.zeros(3), np.eye(3))
    inner = pose_of(inertial, f"link {name!r}: inertial")
    mass = number(inertial.find("mass"), f"link {name!r}: mass", 1.0)
    own = place.then(Place(inner.position, inner.turn))
    return own.body(name, mass, np.zeros(3), inertia_of(inertial.find("inertia"), name))


def _joint(joint: ET.Element, frames: Frames) -> Joint:
    name, given = str(joint.get("name")), str(joint.get("type"))
    if given not in TYPES:
        raise SceneError([f"joint {name!r}: type {given!r} is none of {', '.join(TYPES)}"])
    ends = [joint.findtext(side, "").strip() for side in ("parent", "child")]
    pair = frames.link_of(ends[0]), frames.link_of(ends[1])
    at, kind = frames.pose(joint), TYPES[given]
    anchor, axis = vector(at.position), joint.find("axis")
    if kind in (FIXED, "universal", "gearbox"):
        return Joint(name, kind, pair, anchor)
    if kind == "spherical":
        return Joint(name, kind, pair, anchor, damping=_dynamics(axis, name)["damping"])
    along = vector(direction(axis, name, at, frames))
    if kind == "screw":
        return Joint(name, kind, pair, anchor, along, pitch=pitch(joint))
    span = (-math.inf, math.inf) if axis is None or given == "continuous" else limits_of(axis, name)
    return Joint(name, kind, pair, anchor, along, **limits(*span, UNLIMITED_IN_SDF), **_dynamics(axis, name))


def _dynamics(axis: ET.Element | None, name: str) -> dict[str, Any]:
    found = None if axis is None else axis.find("dynamics")

    def value(tag: str) -> float:
        return number(None if found is None else found.find(tag), f"joint {name!r}: {tag}", 0.0)

    stiffness = coefficients(value("spring_stiffness"))
    return {
        "damping": coefficients(value("damping")),
        "friction": value("friction"),
        "stiffness": stiffness,
        "rest": value("spring_reference") if stiffness else None,
        "armature": 0.0,
        "reference": 0.0,
    }


def _split(joints: list[Joint], links: list[ET.Element]) -> tuple[list[Joint], list[Loop]]:
    """Return the joints of the tree, among them those that free and static links have, and the loops."""
    root = {str(link.get("name")): str(link.get("name")) for link in links} | {WORLD: WORLD}

    def end(name: str) -> str:
        return name if root[name] == name else end(root[name])

    tree, loops = list[Joint](), list[Loop]()
    for link in links:
        if link.get(STATIC) == "true":
            name = str(link.get("name"))
            tree.append(Joint(f"{name} fixed", FIXED, (WORLD, name)))
            root[name] = WORLD
    for joint in joints:
        first, second = map(end, joint.bodies)
        if first == second or joint.type == "gearbox":
            anchor = joint.anchor or ()
            loops.append(Loop(joint.name, joint.type, joint.bodies, (anchor, anchor), joint.axis))
            continue
        tree.append(joint)
        root[second if second != WORLD else first] = first if second != WORLD else second
    for name in root:
        if (base := end(name)) != WORLD:
            tree.append(Joint(f"{base} free", "free", (WORLD, base)))
            root[base] = WORLD
    return tree, loops


def _couplings(flat: ET.Element) -> Iterator[Coupling]:
    for joint in flat.findall("joint"):
        for axis in joint.findall("axis"):
            if (mimic := axis.find("mimic")) is None or TYPES.get(str(joint.get("type"))) not in SCALAR:
                continue
            name, where = str(joint.get("name")), f"joint {joint.get('name')!r}: mimic"
            ratio, offset, reference = (
                number(mimic.find(tag), f"{where} {tag}", default)
                for tag, default in (("multiplier", 1.0), ("offset", 0.0), ("reference", 0.0))
            )
            law = coefficients(offset - ratio * reference, ratio)
            yield Coupling(name, name, str(mimic.get("joint")), law)
