"""Joints: type → the function that lists its primitive constraints."""

from collections.abc import Callable
from typing import Any

from mbref.equations.joints import (
    cylindrical,
    distance,
    fixed,
    inline,
    planar,
    revolute,
    spherical,
    translational,
    universal,
)
from mbref.equations.joints.base import Primitive, driven_angle, driven_displacement
from mbref.scene import Joint, SceneError

JOINTS: dict[str, Callable[[Any], list[Primitive]]] = {
    "fixed": fixed.primitives,
    "revolute": revolute.primitives,
    "universal": universal.primitives,
    "spherical": spherical.primitives,
    "translational": translational.primitives,
    "cylindrical": cylindrical.primitives,
    "planar": planar.primitives,
    "inline": inline.primitives,
    "distance": distance.primitives,
}


def primitives_of(joint: Joint) -> list[Primitive]:
    """Return the primitive constraints of a joint; raises SceneError for a joint type without equations."""
    if joint.type not in JOINTS:
        raise SceneError([f"joint {joint.name!r}: mbref has no equations for joints of type {joint.type!r}"])
    return JOINTS[joint.type](joint)


def driver_primitive(joint: Joint) -> Primitive:
    """Return the row of a driver of the joint; raises SceneError if the joint cannot be driven."""
    if joint.facts.driven is None:
        raise SceneError([f"joint {joint.name!r}: joints of type {joint.type!r} cannot be driven"])
    axis, anchor = joint.directions[0], joint.anchor_pair[0]
    return driven_angle(axis) if joint.facts.driven == "angle" else driven_displacement(anchor, axis)
