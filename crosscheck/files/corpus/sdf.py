"""SDF files with one feature each: an arm of two links whose first joint is fixed in the world."""

from __future__ import annotations

import math
from typing import Any

from crosscheck.engines.loaders.loader import SDF
from crosscheck.files.corpus.case import Case

PLAIN = "<inertia><ixx>0.03</ixx><iyy>0.04</iyy><izz>0.02</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia>"
INERTIAL = f"<inertial><pose>0 0 0.2 0 0 0</pose><mass>2</mass>{PLAIN}</inertial>"
Y = "<xyz>0 1 0</xyz>"
INF = math.inf


def link(name: str, height: float, inertial: str = INERTIAL) -> str:
    """Return a link at a height in the model."""
    return f'<link name="{name}"><pose>0 0 {height:g} 0 0 0</pose>{inertial}</link>'


def joint(name: str, ends: tuple[str, str], kind: str = "revolute", axis: str = Y, more: str = "") -> str:
    """Return a joint at the origin of its child."""
    inside = f"<axis>{axis}</axis>" if axis else ""
    bodies = f"<parent>{ends[0]}</parent><child>{ends[1]}</child>"
    return f'<joint name="{name}" type="{kind}">{bodies}{inside}{more}</joint>'


def model(inside: str, version: str = "1.6", head: str = "", name: str = "arm") -> str:
    """Return a world with one model."""
    inner = f'<world name="default">{head}<model name="{name}">{inside}</model></world>'
    return f'<sdf version="{version}">{inner}</sdf>'


ELBOW = joint("elbow", ("upper", "lower"))
SHOULDER = joint("shoulder", ("world", "upper"))


def arm(
    kind: str = "revolute", axis: str = Y, more: str = "", inertial: str = INERTIAL, also: str = "", **of: str
) -> str:
    """Return an arm: the joint shoulder carries the link upper, the plain hinge elbow the link lower."""
    shoulder = joint("shoulder", ("world", "upper"), kind, axis, more)
    return model(link("upper", 0.4, inertial) + link("lower", 0.8) + shoulder + ELBOW + also, **of)


def case(name: str, text: str, right: dict[str, Any], section: str, why: str) -> Case:
    """Return a case of this format."""
    return Case(name, SDF, text, right, section, why)


CASES = (
    case(
        "revolute",
        arm(),
        {"joint shoulder type": "revolute", "joint shoulder axis": (0, 1, 0), "joints": 2},
        "joint: type",
        "A hinge about the axis.",
    ),
    case(
        "continuous",
        arm("continuous"),
        {"joint shoulder upper": INF},
        "joint: type",
        "A hinge without limits.",
    ),
    case(
        "prismatic",
        arm("prismatic"),
        {"joint shoulder type": "translational"},
        "joint: type",
        "A slide along the axis.",
    ),
    case("fixed", arm("fixed", ""), {"joints": 1}, "joint: type", "No motion."),
    case("ball", arm("ball", ""), {"joint shoulder type": "spherical"}, "joint: type", "Three rotations."),
    case(
        "universal",
        arm("universal", "<xyz>1 0 0</xyz>", f"<axis2>{Y}</axis2>"),
        {"joint shoulder type": "universal"},
        "joint: type",
        "Two rotations about perpendicular axes.",
    ),
    case(
        "screw",
        arm("screw", "<xyz>0 0 1</xyz>", "<screw_thread_pitch>0.1</screw_thread_pitch>", version="1.10"),
        {"joint shoulder pitch": 0.1},
        "joint: screw_thread_pitch",
        "Displacement in m per turn.",
    ),
    case(
        "screw by thread pitch",
        arm("screw", "<xyz>0 0 1</xyz>", "<thread_pitch>-10</thread_pitch>"),
        {"joint shoulder pitch": 2 * math.pi / 10},
        "joint: thread_pitch",
        "-2π / thread_pitch m per turn.",
    ),
    case(
        "axis default",
        arm(axis=" "),
        {"joint shoulder axis": (0, 0, 1)},
        "joint: axis/xyz",
        "Without a vector the axis is (0, 0, 1).",
    ),
    case(
        "axis of length two",
        arm(axis="<xyz>0 2 0</xyz>"),
        {"joint shoulder axis": (0, 1, 0)},
        "joint: axis/xyz",
        "The axis is normalised.",
    ),
    case(
        "axis expressed in the model",
        arm(
            axis='<xyz expressed_in="__model__">1 0 0</xyz>',
            more=f"<pose>0 0 0 0 0 {math.pi / 2}</pose>",
            version="1.9",
        ),
        {"joint shoulder axis": (1, 0, 0)},
        "joint: axis/xyz@expressed_in",
        "The vector is in that frame.",
    ),
    case(
        "axis in the joint's frame",
        arm(axis="<xyz>1 0 0</xyz>", more=f"<pose>0 0 0 0 0 {math.pi / 2}</pose>"),
        {"joint shoulder axis": (0, 1, 0)},
        "joint: axis/xyz",
        "From 1.5 on the vector is in the joint's frame.",
    ),
    case(
        "axis of version 1.4",
        arm(axis="<xyz>1 0 0</xyz>", more=f"<pose>0 0 0 0 0 {math.pi / 2}</pose>", version="1.4"),
        {"joint shoulder axis": (1, 0, 0)},
        "joint: axis/xyz",
        "Up to 1.4 the vector is in the model's frame.",
    ),
    case(
        "use parent model frame",
        arm(
            axis="<xyz>1 0 0</xyz><use_parent_model_frame>true</use_parent_model_frame>",
            more=f"<pose>0 0 0 0 0 {math.pi / 2}</pose>",
            version="1.6",
        ),
        {"joint shoulder axis": (1, 0, 0)},
        "joint: axis/use_parent_model_frame",
        "True: the vector is in the model's frame (1.5 and 1.6).",
    ),
    case(
        "pose of a joint",
        arm(more="<pose>0.1 0 0.2 0 0 0</pose>"),
        {"joint shoulder anchor": (0.1, 0, 0.6)},
        "joint: pose",
        "The pose is in the frame of the child link.",
    ),
    case(
        "pose relative to",
        arm(more='<pose relative_to="lower">0.1 0 0 0 0 0</pose>', version="1.9"),
        {"joint shoulder anchor": (0.1, 0, 0.8)},
        "pose: relative_to",
        "The pose is in that frame.",
    ),
    case(
        "pose by quaternion",
        arm(
            more='<pose rotation_format="quat_xyzw">0 0 0 0 0 0.7071067811865476 0.7071067811865476</pose>',
            axis="<xyz>1 0 0</xyz>",
            version="1.9",
        ),
        {"joint shoulder axis": (0, 1, 0)},
        "pose: rotation_format",
        "Position, then quaternion x, y, z, w.",
    ),
    case(
        "pose in degrees",
        arm(more='<pose degrees="true">0 0 0 0 0 90</pose>', axis="<xyz>1 0 0</xyz>", version="1.9"),
        {"joint shoulder axis": (0, 1, 0)},
        "pose: degrees",
        "Angles are in degrees where this is true.",
    ),
    case(
        "pose of the model",
        model("<pose>0 0 1 0 0 0</pose>" + link("upper", 0.4) + link("lower", 0.8) + SHOULDER + ELBOW),
        {"joint shoulder anchor": (0, 0, 1.4)},
        "model: pose",
        "The pose moves all links of the model.",
    ),
    case(
        "frame element",
        arm(
            also='<frame name="tool" attached_to="upper"><pose>0 0 0.1 0 0 0</pose></frame>'
            + link("hand", 1.2)
            + joint("wrist", ("tool", "hand")),
            version="1.9",
        ),
        {"joints": 3, "joint wrist bodies": ("upper", "hand")},
        "frame: attached_to",
        "A joint on a frame acts on the link that carries the frame.",
    ),
)
