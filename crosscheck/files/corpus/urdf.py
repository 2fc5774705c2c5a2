"""URDF files with one feature each: an arm of two links on a base."""

from __future__ import annotations

import math
from typing import Any

from crosscheck.engines.loaders.loader import URDF
from crosscheck.files.corpus.case import Case

PLAIN = '<inertia ixx="0.03" iyy="0.04" izz="0.02" ixy="0" ixz="0" iyz="0"/>'
LIMIT = '<limit lower="-2" upper="2" effort="10" velocity="10"/>'
INERTIAL = f'<inertial><origin xyz="0 0 0.2"/><mass value="2"/>{PLAIN}</inertial>'
INF = math.inf


def link(name: str, inertial: str = INERTIAL) -> str:
    """Return a link."""
    return f'<link name="{name}">{inertial}</link>'


def joint(name: str, parent: str, child: str, kind: str = "revolute", inside: str = "") -> str:
    """Return a joint 0.4 m above its parent, about y and with limits unless something else is inside."""
    inside = inside or f'<axis xyz="0 1 0"/>{LIMIT}'
    origin = "" if "<origin" in inside else '<origin xyz="0 0 0.4"/>'
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{origin}{inside}</joint>'


def arm(
    kind: str = "revolute", inside: str = "", inertial: str = INERTIAL, more: str = "", base: str = ""
) -> str:
    """Return an arm: the joint shoulder carries the link upper, the plain hinge elbow the link lower."""
    parts = [
        link("base", base),
        link("upper", inertial),
        link("lower"),
        joint("shoulder", "base", "upper", kind, inside),
        joint("elbow", "upper", "lower"),
        more,
    ]
    return f'<robot name="arm">{"".join(parts)}</robot>'


def _follower(mimic: str, kind: str = "revolute") -> str:
    wrist = joint("wrist", "lower", "hand", kind, f'<axis xyz="0 1 0"/>{LIMIT}{mimic}')
    return link("hand") + wrist


def _case(name: str, text: str, right: dict[str, Any], section: str, why: str) -> Case:
    return Case(name, URDF, text, right, section, why)


CASES = (
    _case(
        "revolute",
        arm(),
        {"joint shoulder type": "revolute", "joint shoulder axis": (0, 1, 0), "joints": 2},
        "joint: type",
        "A hinge about the axis, with limits.",
    ),
    _case(
        "continuous",
        arm("continuous", '<axis xyz="0 1 0"/>'),
        {"joint shoulder upper": INF},
        "joint: type",
        "A hinge without limits.",
    ),
    _case(
        "prismatic",
        arm("prismatic"),
        {"joint shoulder type": "translational"},
        "joint: type",
        "A slide along the axis.",
    ),
    _case(
        "fixed",
        arm("fixed", " "),
        {"joint shoulder type": "fixed", "joints": 1},
        "joint: type",
        "No motion: both links are one rigid body.",
    ),
    _case(
        "floating",
        arm("floating", " "),
        {"joint shoulder type": "free"},
        "joint: type",
        "All six motions are free.",
    ),
    _case(
        "planar",
        arm("planar", '<axis xyz="1 0 0"/>'),
        {"joint shoulder axis": (1, 0, 0)},
        "joint: type, axis",
        "Motion in the plane whose normal is the axis.",
    ),
    _case(
        "axis default",
        arm("continuous", " "),
        {"joint shoulder axis": (1, 0, 0)},
        "joint: axis",
        "Without an axis it is (1, 0, 0).",
    ),
    _case(
        "axis skew",
        arm("continuous", '<axis xyz="0.6 0 0.8"/>'),
        {"joint shoulder axis": (0.6, 0, 0.8)},
        "joint: axis",
        "Any unit vector of the joint's frame.",
    ),
    _case(
        "axis negative",
        arm("continuous", '<axis xyz="0 -1 0"/>'),
        {"joint shoulder axis": (0, -1, 0)},
        "joint: axis",
        "The axis gives the coordinate its sign.",
    ),
    _case(
        "axis of length two",
        arm("continuous", '<axis xyz="0 2 0"/>'),
        {"joint shoulder axis": (0, 1, 0)},
        "joint: axis",
        "The axis is a direction; the vector should be normalised.",
    ),
    _case(
        "slide axis of length two",
        arm("prismatic", f'<axis xyz="0 0 2"/>{LIMIT}'),
        {"joint shoulder axis": (0, 0, 1)},
        "joint: axis",
        "The axis is a direction; the coordinate is in m.",
    ),
    _case(
        "axis in turned frame",
        arm("continuous", f'<origin xyz="0 0 0.4" rpy="0 0 {math.pi / 2}"/><axis xyz="1 0 0"/>'),
        {"joint shoulder axis": (0, 1, 0)},
        "joint: origin, axis",
        "The axis is in the frame of the joint, which the origin turns.",
    ),
    _case(
        "origin roll pitch yaw",
        arm("continuous", f'<origin xyz="0 0 0.4" rpy="{math.pi / 2} 0 {math.pi / 2}"/><axis xyz="0 1 0"/>'),
        {"joint shoulder axis": (0, 0, 1)},
        "joint: origin",
        "Roll, pitch and yaw are about fixed axes x, y, z, in this order.",
    ),
    _case(
        "inertia products",
        arm(
            inertial='<inertial><mass value="2"/>'
            '<inertia ixx="0.03" iyy="0.04" izz="0.02" ixy="0.005" ixz="0.002" iyz="-0.003"/></inertial>'
        ),
        {"body upper inertia": ((0.03, 0.005, 0.002), (0.005, 0.04, -0.003), (0.002, -0.003, 0.02))},
        "link: inertia",
        "The six numbers are the entries of the matrix, about the centre of mass.",
    ),
    _case(
        "inertia turned",
        arm(
            inertial=f'<inertial><origin xyz="0.1 0 0" rpy="0 0 {math.pi / 2}"/><mass value="2"/>{PLAIN}'
            "</inertial>"
        ),
        {
            "body upper inertia": ((0.04, 0, 0), (0, 0.03, 0), (0, 0, 0.02)),
            "body upper centre": (0.1, 0, 0.4),
        },
        "link: inertial origin",
        "The matrix is in the inertial frame, which the origin turns.",
    ),
    _case(
        "mass of root",
        arm(base=INERTIAL),
        {"body base mass": 2},
        "link: inertial",
        "The root link has inertia; it is fixed here.",
    ),
    _case(
        "massless link",
        arm(inertial=""),
        {"body upper mass": 0},
        "link: inertial",
        "Without inertial a link has zero mass and zero inertia.",
    ),
    _case(
        "fixed sensor",
        arm(more=link("sensor", "") + joint("mount", "lower", "sensor", "fixed", " ")),
        {"body sensor mass": 0, "joints": 2},
        "link: inertial",
        "A frame without mass on a link changes nothing.",
    ),
    _case(
        "fixed tool",
        arm(more=link("tool") + joint("mount", "lower", "tool", "fixed", " ")),
        {"body tool mass": 2, "joints": 2},
        "joint: type fixed",
        "A body that is fixed to a link adds its mass there.",
    ),
    _case(
        "damping",
        arm(inside=f'<axis xyz="0 1 0"/>{LIMIT}<dynamics damping="0.3"/>'),
        {"joint shoulder damping": (0.3,)},
        "joint: dynamics",
        "Viscous torque of the joint, N m s/rad.",
    ),
    _case(
        "friction",
        arm(inside=f'<axis xyz="0 1 0"/>{LIMIT}<dynamics friction="0.4"/>'),
        {"joint shoulder friction": 0.4},
        "joint: dynamics",
        "Static friction of the joint, N m.",
    ),
    _case(
        "limits",
        arm(inside='<axis xyz="0 1 0"/><limit lower="-0.5" upper="1.5" effort="1" velocity="1"/>'),
        {"joint shoulder lower": -0.5, "joint shoulder upper": 1.5},
        "joint: limit",
        "Ends of the coordinate in rad.",
    ),
    _case(
        "limits default",
        arm(inside='<axis xyz="0 1 0"/><limit effort="1" velocity="1"/>'),
        {"joint shoulder lower": 0, "joint shoulder upper": 0},
        "joint: limit",
        "Ends that are not written are 0: the joint is locked.",
    ),
    _case(
        "mimic",
        arm(more=_follower('<mimic joint="elbow" multiplier="2"/>')),
        {"coupling wrist coefficients": (0, 2)},
        "joint: mimic",
        "value = multiplier · value of the other joint + offset.",
    ),
    _case(
        "mimic default",
        arm(more=_follower('<mimic joint="elbow"/>')),
        {"coupling wrist coefficients": (0, 1)},
        "joint: mimic",
        "Multiplier 1 and offset 0 unless written.",
    ),
    _case(
        "mimic offset",
        arm(more=_follower('<mimic joint="elbow" multiplier="-1" offset="0.3"/>')),
        {"coupling wrist coefficients": (0.3, -1)},
        "joint: mimic",
        "The follower is at the offset where the leader is at 0.",
    ),
    _case(
        "mimic of a slide",
        arm(more=_follower('<mimic joint="elbow" multiplier="0.1"/>', "prismatic")),
        {"coupling wrist coefficients": (0, 0.1)},
        "joint: mimic",
        "A slide follows a hinge by 0.1 m/rad.",
    ),
    _case(
        "mimic of a mimic",
        arm(
            more=_follower('<mimic joint="elbow" multiplier="2"/>')
            + link("tip")
            + joint("last", "hand", "tip", inside=f'<axis xyz="0 1 0"/>{LIMIT}<mimic joint="wrist"/>')
        ),
        {"coupling last leader": "wrist"},
        "joint: mimic",
        "The leader may follow another joint itself.",
    ),
    _case(
        "branches",
        arm(more=link("other") + joint("side", "base", "other")),
        {"joints": 3},
        "robot",
        "Several joints may hang on one link.",
    ),
    _case(
        "joints in reverse order",
        f'<robot name="arm">{joint("elbow", "upper", "lower")}{joint("shoulder", "base", "upper")}'
        f"{link('lower')}{link('upper')}{link('base', '')}</robot>",
        {"joints": 2, "joint elbow anchor": (0, 0, 0.8)},
        "robot",
        "The order of links and joints has no meaning.",
    ),
)
