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


def _follower(mimic: str) -> str:
    hand = joint("wrist", ("lower", "hand"), axis=Y + mimic)
    return arm(also=link("hand", 1.2) + hand, version="1.11")


def _dynamics(inside: str) -> str:
    return arm(axis=f"{Y}<dynamics>{inside}</dynamics>")


def _case(name: str, text: str, right: dict[str, Any], section: str, why: str) -> Case:
    return Case(name, SDF, text, right, section, why)


CASES = (
    _case("revolute", arm(), {"joint shoulder type": "revolute", "joint shoulder axis": (0, 1, 0),
          "joints": 2},
          "joint: type", "A hinge about the axis."),
    _case("continuous", arm("continuous"), {"joint shoulder upper": INF},
          "joint: type", "A hinge without limits."),
    _case("prismatic", arm("prismatic"), {"joint shoulder type": "translational"},
          "joint: type", "A slide along the axis."),
    _case("fixed", arm("fixed", ""), {"joints": 1}, "joint: type", "No motion."),
    _case("ball", arm("ball", ""), {"joint shoulder type": "spherical"}, "joint: type", "Three rotations."),
    _case("universal", arm("universal", "<xyz>1 0 0</xyz>", f"<axis2>{Y}</axis2>"),
          {"joint shoulder type": "universal"}, "joint: type", "Two rotations about perpendicular axes."),
    _case("screw", arm("screw", "<xyz>0 0 1</xyz>", "<screw_thread_pitch>0.1</screw_thread_pitch>",
          version="1.10"),
          {"joint shoulder pitch": 0.1}, "joint: screw_thread_pitch", "Displacement in m per turn."),
    _case("screw by thread pitch", arm("screw", "<xyz>0 0 1</xyz>", "<thread_pitch>-10</thread_pitch>"),
          {"joint shoulder pitch": 2 * math.pi / 10},
          "joint: thread_pitch", "-2π / thread_pitch m per turn."),
    _case("axis default", arm(axis=" "), {"joint shoulder axis": (0, 0, 1)},
          "joint: axis/xyz", "Without a vector the axis is (0, 0, 1)."),
    _case("axis of length two", arm(axis="<xyz>0 2 0</xyz>"), {"joint shoulder axis": (0, 1, 0)},
          "joint: axis/xyz", "The axis is normalised."),
    _case("axis expressed in the model",
          arm(axis='<xyz expressed_in="__model__">1 0 0</xyz>',
              more=f"<pose>0 0 0 0 0 {math.pi / 2}</pose>", version="1.9"),
          {"joint shoulder axis": (1, 0, 0)}, "joint: axis/xyz@expressed_in", "The vector is in that frame."),
    _case("axis in the joint's frame",
          arm(axis="<xyz>1 0 0</xyz>", more=f"<pose>0 0 0 0 0 {math.pi / 2}</pose>"),
          {"joint shoulder axis": (0, 1, 0)}, "joint: axis/xyz",
          "From 1.5 on the vector is in the joint's frame."),
    _case("axis of version 1.4",
          arm(axis="<xyz>1 0 0</xyz>", more=f"<pose>0 0 0 0 0 {math.pi / 2}</pose>", version="1.4"),
          {"joint shoulder axis": (1, 0, 0)}, "joint: axis/xyz",
          "Up to 1.4 the vector is in the model's frame."),
    _case("use parent model frame",
          arm(axis="<xyz>1 0 0</xyz><use_parent_model_frame>true</use_parent_model_frame>",
              more=f"<pose>0 0 0 0 0 {math.pi / 2}</pose>", version="1.6"),
          {"joint shoulder axis": (1, 0, 0)},
          "joint: axis/use_parent_model_frame", "True: the vector is in the model's frame (1.5 and 1.6)."),
    _case("pose of a joint", arm(more="<pose>0.1 0 0.2 0 0 0</pose>"),
          {"joint shoulder anchor": (0.1, 0, 0.6)},
          "joint: pose", "The pose is in the frame of the child link."),
    _case("pose relative to", arm(more='<pose relative_to="lower">0.1 0 0 0 0 0</pose>', version="1.9"),
          {"joint shoulder anchor": (0.1, 0, 0.8)}, "pose: relative_to", "The pose is in that frame."),
    _case("pose by quaternion",
          arm(more='<pose rotation_format="quat_xyzw">0 0 0 0 0 0.7071067811865476 0.7071067811865476</pose>',
              axis="<xyz>1 0 0</xyz>", version="1.9"),
          {"joint shoulder axis": (0, 1, 0)}, "pose: rotation_format",
          "Position, then quaternion x, y, z, w."),
    _case("pose in degrees",
          arm(more='<pose degrees="true">0 0 0 0 0 90</pose>', axis="<xyz>1 0 0</xyz>", version="1.9"),
          {"joint shoulder axis": (0, 1, 0)}, "pose: degrees", "Angles are in degrees where this is true."),
    _case("pose of the model",
          model("<pose>0 0 1 0 0 0</pose>" + link("upper", 0.4) + link("lower", 0.8) + SHOULDER + ELBOW),
          {"joint shoulder anchor": (0, 0, 1.4)}, "model: pose", "The pose moves all links of the model."),
    _case("frame element",
          arm(also='<frame name="tool" attached_to="upper"><pose>0 0 0.1 0 0 0</pose></frame>'
              + link("hand", 1.2) + joint("wrist", ("tool", "hand")), version="1.9"),
          {"joints": 3, "joint wrist bodies": ("upper", "hand")},
          "frame: attached_to", "A joint on a frame acts on the link that carries the frame."),
    _case("inertia products",
          arm(inertial="<inertial><mass>2</mass><inertia><ixx>0.03</ixx><iyy>0.04</iyy><izz>0.02</izz>"
              "<ixy>0.005</ixy><ixz>0.002</ixz><iyz>-0.003</iyz></inertia></inertial>"),
          {"body upper inertia": ((0.03, 0.005, 0.002), (0.005, 0.04, -0.003), (0.002, -0.003, 0.02))},
          "link: inertial/inertia",
          "The six numbers are the entries of the matrix, about the centre of mass."),
    _case("inertia turned",
          arm(inertial=f"<inertial><pose>0.1 0 0 0 0 {math.pi / 2}</pose><mass>2</mass>{PLAIN}</inertial>"),
          {"body upper inertia": ((0.04, 0, 0), (0, 0.03, 0), (0, 0, 0.02)),
          "body upper centre": (0.1, 0, 0.4)},
          "link: inertial/pose", "The matrix is in the frame of the centre of mass, which the pose turns."),
    _case("inertia default", arm(inertial=""), {"body upper mass": 1},
          "link: inertial", "Without inertial the mass is 1 kg, with unit moments of inertia."),
    _case("damping", _dynamics("<damping>0.3</damping>"), {"joint shoulder damping": (0.3,)},
          "joint: dynamics/damping", "Viscous damping of the coordinate."),
    _case("friction", _dynamics("<friction>0.4</friction>"), {"joint shoulder friction": 0.4},
          "joint: dynamics/friction", "Static friction of the joint."),
    _case("spring",
          _dynamics("<spring_stiffness>5</spring_stiffness><spring_reference>0.3</spring_reference>"),
          {"joint shoulder stiffness": (5,), "joint shoulder rest": 0.3},
          "joint: dynamics/spring_stiffness", "A spring that is at rest at spring_reference."),
    _case("limits", arm(axis=f"{Y}<limit><lower>-0.5</lower><upper>1.5</upper></limit>"),
          {"joint shoulder lower": -0.5, "joint shoulder upper": 1.5},
          "joint: limit", "Ends of the coordinate in rad."),
    _case("limits by large numbers", arm(axis=f"{Y}<limit><lower>-1e16</lower><upper>1e16</upper></limit>"),
          {"joints": 2}, "joint: limit", "The defaults ±1e16 mean no limit."),
    _case("mimic", _follower('<mimic joint="elbow"><multiplier>2</multiplier></mimic>'),
          {"coupling wrist coefficients": (0, 2)}, "joint: mimic",
          "multiplier · (value of the other joint - reference) + offset."),
    _case("mimic with reference",
          _follower('<mimic joint="elbow"><multiplier>2</multiplier><offset>0.1</offset>'
                    "<reference>0.3</reference></mimic>"),
          {"coupling wrist coefficients": (-0.5, 2)}, "joint: mimic",
          "multiplier · (value of the other joint - reference) + offset."),
    _case("free link", model(link("upper", 0.4) + link("lower", 0.8) + ELBOW), {"joints": 2},
          "model", "Links that no joint connects to the world are free."),
    _case("static model", arm(also="") .replace("</world>", '<model name="wall"><static>true</static>'
          '<link name="stone"/></model></world>'), {"joint arm::shoulder type": "revolute", "joints": 2},
          "model: static", "A static model does not move."),
    _case("two models",
          arm().replace("</world>", f'<model name="second">{link("bar", 0.4)}'
                        f'{joint("pivot", ("world", "bar"))}</model></world>'),
          {"joint second::pivot type": "revolute", "joints": 3},
          "world", "A world may have several models; each has its own names."),
    _case("nested model",
          arm(also=f'<model name="tool">{link("hand", 1.2)}</model>' + joint("wrist", ("lower",
          "tool::hand")), version="1.9"),
          {"joints": 3}, "model: model", "A model may have models inside; their names begin with its name."),
    _case("gravity", arm(head="<gravity>0 -5 0</gravity>"), {"gravity": (0, -5, 0)},
          "world: gravity", "The acceleration of gravity of the world."),
    _case("gravity default", arm(), {"gravity": (0, 0, -9.8)},
          "world: gravity", "Without the element it is (0, 0, -9.8)."),
    _case("loop",
          arm(also=link("other", 0.4) + joint("side", ("world", "other"))
              + joint("close", ("lower", "other"), more="<pose>0 0 0.4 0 0 0</pose>")),
          {"loop close type": "revolute"}, "joint", "Joints may form loops; each of them holds."),
)  # fmt: skip
