"""MJCF files with one feature each: an arm of two bodies, or two arms."""

from __future__ import annotations

import math
from typing import Any

from crosscheck.engines.loaders.loader import MJCF
from crosscheck.files.corpus.case import Case

INERTIAL = '<inertial pos="0 0 0.2" mass="2" diaginertia="0.03 0.04 0.02"/>'
HINGE, ELBOW, SIDE = (
    f'<joint name="{name}" type="hinge" axis="0 1 0"/>' for name in ("shoulder", "elbow", "side")
)
INF = math.inf


def body(name: str, inside: str, place: str = 'pos="0 0 0.4"', inertial: str = INERTIAL) -> str:
    """Return a body with inertia."""
    return f'<body name="{name}" {place}>{inertial}{inside}</body>'


def lower() -> str:
    """Return the last body of an arm on a plain hinge."""
    return body("lower", ELBOW)


def model(inside: str, more: str = "", head: str = "", name: str = ' model="arm"') -> str:
    """Return a model with the worldbody's inside."""
    return f"<mujoco{name}>{head}<worldbody>{inside}</worldbody>{more}</mujoco>"


def arm(joint: str = HINGE, more: str = "", head: str = "", **of_body: str) -> str:
    """Return an arm: ``joint`` carries the body upper, the plain hinge elbow the body lower."""
    return model(body("upper", joint + lower(), **of_body), more, head)


def hinge(attributes: str) -> str:
    """Return the shoulder about y with more attributes."""
    return f'<joint name="shoulder" type="hinge" axis="0 1 0" {attributes}/>'


BOX = '<geom type="box" size="0.1 0.2 0.3" pos="0 0 0.2" density="100"/>'


def case(name: str, text: str, right: dict[str, Any], section: str, why: str) -> Case:
    """Return a case of this format."""
    return Case(name, MJCF, text, right, section, why)


CASES = (
    case(
        "hinge",
        arm(),
        {"joint shoulder type": "revolute", "joint shoulder axis": (0, 1, 0), "joints": 2},
        "body/joint: type",
        "Rotation about the axis.",
    ),
    case(
        "hinge by default",
        arm('<joint name="shoulder"/>'),
        {"joint shoulder axis": (0, 0, 1)},
        "body/joint: type, axis",
        "A joint without type is a hinge; without axis it is about z.",
    ),
    case(
        "slide",
        arm('<joint name="shoulder" type="slide" axis="0 0 1"/>'),
        {"joint shoulder type": "translational"},
        "body/joint: type",
        "Displacement along the axis.",
    ),
    case(
        "ball",
        arm('<joint name="shoulder" type="ball"/>'),
        {"joint shoulder type": "spherical"},
        "body/joint: type",
        "Three rotations about the point.",
    ),
    case(
        "free",
        arm('<freejoint name="shoulder"/>'),
        {"joint shoulder type": "free"},
        "body/freejoint",
        "Six motions; the body is a child of the world.",
    ),
    case(
        "two hinges of a body",
        arm(HINGE + '<joint name="second" type="hinge" axis="1 0 0"/>'),
        {"joint second axis": (1, 0, 0)},
        "body/joint",
        "Joints of one body act one after another, in the order of the file.",
    ),
    case(
        "slide and hinge of a body",
        arm('<joint name="rail" type="slide" axis="1 0 0"/>' + HINGE),
        {"joint rail type": "translational"},
        "body/joint",
        "Joints of one body act one after another, in the order of the file.",
    ),
    case(
        "anchor",
        arm(hinge('pos="0.1 0 0.05"')),
        {"joint shoulder anchor": (0.1, 0, 0.45)},
        "body/joint: pos",
        "The anchor is in the frame of the joint's body.",
    ),
    case(
        "axis of length two",
        arm('<joint name="shoulder" type="hinge" axis="0 2 0"/>'),
        {"joint shoulder axis": (0, 1, 0)},
        "body/joint: axis",
        "The axis is normalised.",
    ),
    case(
        "reference",
        arm(hinge('ref="0.2"'), head='<compiler angle="radian"/>'),
        {"joint shoulder reference": 0.2},
        "body/joint: ref",
        "The coordinate's value in the pose of the file.",
    ),
    case(
        "spring",
        arm(hinge('stiffness="5"')),
        {"joint shoulder stiffness": (5,)},
        "body/joint: stiffness",
        "Torque -stiffness · (q - springref).",
    ),
    case(
        "spring reference",
        arm(hinge('stiffness="5" springref="0.3"'), head='<compiler angle="radian"/>'),
        {"joint shoulder rest": 0.3},
        "body/joint: springref",
        "The coordinate at which the spring is at rest.",
    ),
    case(
        "spring polynomial",
        arm(hinge('stiffness="5 0 8"')),
        {"joint shoulder stiffness": (5, 0, 8)},
        "body/joint: stiffness",
        "Coefficients of rising powers of the displacement.",
    ),
    case(
        "damping",
        arm(hinge('damping="0.3"')),
        {"joint shoulder damping": (0.3,)},
        "body/joint: damping",
        "Torque -damping · rate.",
    ),
    case(
        "damping polynomial",
        arm(hinge('damping="0.3 0.2 0.1"')),
        {"joint shoulder damping": (0.3, 0.2, 0.1)},
        "body/joint: damping",
        "Coefficients of rising powers of the rate.",
    ),
    case(
        "damping of three numbers",
        arm(hinge('damping="0.3 0 0"')),
        {"joint shoulder damping": (0.3,)},
        "body/joint: damping",
        "Zeros at the end change nothing.",
    ),
    case(
        "armature",
        arm(hinge('armature="0.5"')),
        {"joint shoulder armature": 0.5},
        "body/joint: armature",
        "Inertia of a rotor, added to the diagonal of the mass matrix.",
    ),
    case(
        "friction",
        arm(hinge('frictionloss="0.4"')),
        {"joint shoulder friction": 0.4},
        "body/joint: frictionloss",
        "Dry friction of the joint.",
    ),
    case(
        "range in degrees",
        arm(hinge('range="-90 45"')),
        {"joint shoulder upper": math.pi / 4},
        "compiler: angle",
        "Angles are in degrees unless the compiler says radian.",
    ),
    case(
        "range in radians",
        arm(hinge('range="-1.5 0.5"'), head='<compiler angle="radian"/>'),
        {"joint shoulder upper": 0.5},
        "compiler: angle",
        "With radian, ranges are in radians.",
    ),
    case(
        "range with reference",
        arm(hinge('range="-1 1" ref="0.2"'), head='<compiler angle="radian"/>'),
        {"joint shoulder lower": -1, "joint shoulder upper": 1},
        "body/joint: range, ref",
        "The range limits the coordinate, which is ref in the file's pose.",
    ),
    case(
        "range that is off",
        arm(hinge('range="-1 1" limited="false"')),
        {"joint shoulder upper": INF},
        "body/joint: limited",
        "The range has no effect where limited is false.",
    ),
    case(
        "default class",
        arm(
            '<joint name="shoulder" class="stiff"/>',
            head='<default><default class="stiff"><joint axis="1 0 0" damping="0.3"/></default></default>',
        ),
        {"joint shoulder axis": (1, 0, 0), "joint shoulder damping": (0.3,)},
        "default",
        "Attributes come from the class that an element names.",
    ),
    case(
        "child class",
        arm(
            '<joint name="shoulder"/>',
            place='pos="0 0 0.4" childclass="stiff"',
            head='<default><default class="stiff"><joint axis="1 0 0"/></default></default>',
        ),
        {"joint shoulder axis": (1, 0, 0)},
        "body: childclass",
        "The class holds for all elements of the body that name none.",
    ),
    case(
        "inertia of a shape",
        arm(inertial=BOX),
        {"body upper mass": 4.8, "body upper inertia": ((0.208, 0, 0), (0, 0.16, 0), (0, 0, 0.08))},
        "compiler: inertiafromgeom",
        "Without inertial, mass and inertia are of the geoms' volumes.",
    ),
    case(
        "mass of a shape",
        arm(inertial='<geom type="sphere" size="0.1" mass="2"/>'),
        {"body upper mass": 2, "body upper inertia": ((0.008, 0, 0), (0, 0.008, 0), (0, 0, 0.008))},
        "body/geom: mass",
        "A mass takes the place of the density.",
    ),
    case(
        "full inertia",
        arm(inertial='<inertial pos="0 0 0" mass="2" fullinertia="0.03 0.04 0.02 0.005 0.002 -0.003"/>'),
        {"body upper inertia": ((0.03, 0.005, 0.002), (0.005, 0.04, -0.003), (0.002, -0.003, 0.02))},
        "body/inertial: fullinertia",
        "Order xx, yy, zz, xy, xz, yz.",
    ),
    case(
        "inertia turned",
        arm(inertial='<inertial pos="0 0 0.2" quat="1 0 0 1" mass="2" diaginertia="0.03 0.04 0.02"/>'),
        {"body upper inertia": ((0.04, 0, 0), (0, 0.03, 0), (0, 0, 0.02))},
        "body/inertial: quat",
        "Moments are along the axes of the inertial frame.",
    ),
    case(
        "euler sequence",
        arm(
            '<joint name="shoulder" type="hinge" axis="1 0 0"/>',
            place='pos="0 0 0.4" euler="90 0 90"',
            head='<compiler eulerseq="XYZ"/>',
        ),
        {"joint shoulder axis": (0, 1, 0)},
        "compiler: eulerseq",
        "Upper-case letters turn about fixed axes.",
    ),
    case(
        "euler angles",
        arm('<joint name="shoulder" type="hinge" axis="1 0 0"/>', place='pos="0 0 0.4" euler="90 0 90"'),
        {"joint shoulder axis": (0, 0, 1)},
        "compiler: eulerseq",
        "By default angles turn about the axes x, y, z that move along.",
    ),
)
