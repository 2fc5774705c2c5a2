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


def pair(equality: str, first: str = "", second: str = "") -> str:
    """Return two arms on a massless root with an equality, and more inside their last bodies."""
    left = body("upper", HINGE + body("lower", ELBOW + first))
    right = body("other", SIDE + second, 'pos="0.3 0 0.4"')
    return model(f'<body name="root">{left}{right}</body>', f"<equality>{equality}</equality>")


def _case(name: str, text: str, right: dict[str, Any], section: str, why: str) -> Case:
    return Case(name, MJCF, text, right, section, why)


CASES = (
    _case("hinge", arm(), {"joint shoulder type": "revolute", "joint shoulder axis": (0, 1, 0), "joints": 2},
          "body/joint: type", "Rotation about the axis."),
    _case("hinge by default", arm('<joint name="shoulder"/>'), {"joint shoulder axis": (0, 0, 1)},
          "body/joint: type, axis", "A joint without type is a hinge; without axis it is about z."),
    _case("slide", arm('<joint name="shoulder" type="slide" axis="0 0 1"/>'),
          {"joint shoulder type": "translational"}, "body/joint: type", "Displacement along the axis."),
    _case("ball", arm('<joint name="shoulder" type="ball"/>'), {"joint shoulder type": "spherical"},
          "body/joint: type", "Three rotations about the point."),
    _case("free", arm('<freejoint name="shoulder"/>'), {"joint shoulder type": "free"},
          "body/freejoint", "Six motions; the body is a child of the world."),
    _case("two hinges of a body",
          arm(HINGE + '<joint name="second" type="hinge" axis="1 0 0"/>'), {"joint second axis": (1, 0, 0)},
          "body/joint", "Joints of one body act one after another, in the order of the file."),
    _case("slide and hinge of a body",
          arm('<joint name="rail" type="slide" axis="1 0 0"/>' + HINGE), {"joint rail type": "translational"},
          "body/joint", "Joints of one body act one after another, in the order of the file."),
    _case("anchor", arm(hinge('pos="0.1 0 0.05"')), {"joint shoulder anchor": (0.1, 0, 0.45)},
          "body/joint: pos", "The anchor is in the frame of the joint's body."),
    _case("axis of length two", arm('<joint name="shoulder" type="hinge" axis="0 2 0"/>'),
          {"joint shoulder axis": (0, 1, 0)}, "body/joint: axis", "The axis is normalised."),
    _case("reference", arm(hinge('ref="0.2"'), head='<compiler angle="radian"/>'),
          {"joint shoulder reference": 0.2},
          "body/joint: ref", "The coordinate's value in the pose of the file."),
    _case("spring", arm(hinge('stiffness="5"')), {"joint shoulder stiffness": (5,)},
          "body/joint: stiffness", "Torque -stiffness · (q - springref)."),
    _case("spring reference", arm(hinge('stiffness="5" springref="0.3"'), head='<compiler angle="radian"/>'),
          {"joint shoulder rest": 0.3},
          "body/joint: springref", "The coordinate at which the spring is at rest."),
    _case("spring polynomial", arm(hinge('stiffness="5 0 8"')), {"joint shoulder stiffness": (5, 0, 8)},
          "body/joint: stiffness", "Coefficients of rising powers of the displacement."),
    _case("damping", arm(hinge('damping="0.3"')), {"joint shoulder damping": (0.3,)},
          "body/joint: damping", "Torque -damping · rate."),
    _case("damping polynomial", arm(hinge('damping="0.3 0.2 0.1"')),
          {"joint shoulder damping": (0.3, 0.2, 0.1)},
          "body/joint: damping", "Coefficients of rising powers of the rate."),
    _case("damping of three numbers", arm(hinge('damping="0.3 0 0"')), {"joint shoulder damping": (0.3,)},
          "body/joint: damping", "Zeros at the end change nothing."),
    _case("armature", arm(hinge('armature="0.5"')), {"joint shoulder armature": 0.5},
          "body/joint: armature", "Inertia of a rotor, added to the diagonal of the mass matrix."),
    _case("friction", arm(hinge('frictionloss="0.4"')), {"joint shoulder friction": 0.4},
          "body/joint: frictionloss", "Dry friction of the joint."),
    _case("range in degrees", arm(hinge('range="-90 45"')), {"joint shoulder upper": math.pi / 4},
          "compiler: angle", "Angles are in degrees unless the compiler says radian."),
    _case("range in radians", arm(hinge('range="-1.5 0.5"'), head='<compiler angle="radian"/>'),
          {"joint shoulder upper": 0.5}, "compiler: angle", "With radian, ranges are in radians."),
    _case("range with reference",
          arm(hinge('range="-1 1" ref="0.2"'), head='<compiler angle="radian"/>'),
          {"joint shoulder lower": -1, "joint shoulder upper": 1},
          "body/joint: range, ref", "The range limits the coordinate, which is ref in the file's pose."),
    _case("range that is off", arm(hinge('range="-1 1" limited="false"')), {"joint shoulder upper": INF},
          "body/joint: limited", "The range has no effect where limited is false."),
    _case("default class",
          arm('<joint name="shoulder" class="stiff"/>',
              head='<default><default class="stiff"><joint axis="1 0 0" damping="0.3"/></default></default>'),
          {"joint shoulder axis": (1, 0, 0), "joint shoulder damping": (0.3,)},
          "default", "Attributes come from the class that an element names."),
    _case("child class",
          arm('<joint name="shoulder"/>', place='pos="0 0 0.4" childclass="stiff"',
              head='<default><default class="stiff"><joint axis="1 0 0"/></default></default>'),
          {"joint shoulder axis": (1, 0, 0)},
          "body: childclass", "The class holds for all elements of the body that name none."),
    _case("inertia of a shape", arm(inertial=BOX),
          {"body upper mass": 4.8, "body upper inertia": ((0.208, 0, 0), (0, 0.16, 0), (0, 0, 0.08))},
          "compiler: inertiafromgeom", "Without inertial, mass and inertia are of the geoms' volumes."),
    _case("mass of a shape", arm(inertial='<geom type="sphere" size="0.1" mass="2"/>'),
          {"body upper mass": 2, "body upper inertia": ((0.008, 0, 0), (0, 0.008, 0), (0, 0, 0.008))},
          "body/geom: mass", "A mass takes the place of the density."),
    _case("full inertia",
          arm(inertial='<inertial pos="0 0 0" mass="2" fullinertia="0.03 0.04 0.02 0.005 0.002 -0.003"/>'),
          {"body upper inertia": ((0.03, 0.005, 0.002), (0.005, 0.04, -0.003), (0.002, -0.003, 0.02))},
          "body/inertial: fullinertia", "Order xx, yy, zz, xy, xz, yz."),
    _case("inertia turned",
          arm(inertial='<inertial pos="0 0 0.2" quat="1 0 0 1" mass="2" diaginertia="0.03 0.04 0.02"/>'),
          {"body upper inertia": ((0.04, 0, 0), (0, 0.03, 0), (0, 0, 0.02))},
          "body/inertial: quat", "Moments are along the axes of the inertial frame."),
    _case("euler sequence",
          arm('<joint name="shoulder" type="hinge" axis="1 0 0"/>', place='pos="0 0 0.4" euler="90 0 90"',
              head='<compiler eulerseq="XYZ"/>'), {"joint shoulder axis": (0, 1, 0)},
          "compiler: eulerseq", "Upper-case letters turn about fixed axes."),
    _case("euler angles",
          arm('<joint name="shoulder" type="hinge" axis="1 0 0"/>', place='pos="0 0 0.4" euler="90 0 90"'),
          {"joint shoulder axis": (0, 0, 1)},
          "compiler: eulerseq", "By default angles turn about the axes x, y, z that move along."),
    _case("frame", model(f'<frame pos="0 0 1" euler="0 0 90">{body("upper", HINGE + lower())}</frame>'),
          {"joint shoulder anchor": (0, 0, 1.4), "joint shoulder axis": (-1, 0, 0)},
          "frame", "A frame moves its inside, and disappears."),
    _case("gravity", arm(head='<option gravity="0 -5 0"/>'), {"gravity": (0, -5, 0)},
          "option: gravity", "The acceleration of gravity."),
    _case("gravity off", arm(head='<option><flag gravity="disable"/></option>'), {"gravity": (0, 0, 0)},
          "option/flag: gravity", "The flag sets gravity to zero."),
    _case("model without a name", model(body("upper", HINGE + lower()), name=""), {"joints": 2},
          "mujoco: model", "The name of the model is optional."),
    _case("bodies side by side", model(body("upper", HINGE + lower()) + body("other", SIDE)), {"joints": 3},
          "worldbody", "The world may have several child bodies."),
    _case("connect", pair('<connect name="close" body1="lower" body2="other" anchor="0.1 0 0.1"/>'),
          {"loop close type": "spherical", "loop close anchors": ((0.1, 0, 0.9), (0.1, 0, 0.9))},
          "equality/connect", "A point of both bodies coincides; the anchor is in the first body's frame."),
    _case("connect of sites",
          pair('<connect name="close" site1="first" site2="second"/>',
               '<site name="first" pos="0.1 0 0.1"/>', '<site name="second" pos="-0.2 0 0.5"/>'),
          {"loop close anchors": ((0.1, 0, 0.9), (0.1, 0, 0.9))},
          "equality/connect: site1", "Two sites coincide."),
    _case("weld", pair('<weld name="close" body1="lower" body2="other"/>'), {"loop close type": "fixed"},
          "equality/weld", "Both bodies keep their relative pose of the file."),
    _case("equality that is off",
          pair('<connect name="close" body1="lower" body2="other" anchor="0.1 0 0.1" active="false"/>'),
          {"joints": 3}, "equality: active", "A constraint that is not active has no effect."),
    _case("coupling", pair('<joint name="gear" joint1="side" joint2="elbow" polycoef="0 2 0 0 0"/>'),
          {"coupling side coefficients": (0, 2)},
          "equality/joint", "The first joint follows a polynomial of the second, from their references."),
    _case("coupling polynomial",
          pair('<joint name="gear" joint1="side" joint2="elbow" polycoef="0 1 0.5 0 0"/>'),
          {"coupling side coefficients": (0, 1, 0.5)}, "equality/joint: polycoef", "Up to the fourth power."),
    _case("locked joint", pair('<joint name="lock" joint1="side" polycoef="0 0 0 0 0"/>'),
          {"coupling side leader": ""}, "equality/joint", "Without a second joint the first one is locked."),
)  # fmt: skip
