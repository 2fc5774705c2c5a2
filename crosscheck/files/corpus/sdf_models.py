"""SDF files with one feature each: inertias, forces of joints, couplings, models, gravity and a loop."""

from __future__ import annotations

import math

from crosscheck.files.corpus.sdf import ELBOW, PLAIN, Y, arm, case, joint, link, model


def _follower(mimic: str) -> str:
    hand = joint("wrist", ("lower", "hand"), axis=Y + mimic)
    return arm(also=link("hand", 1.2) + hand, version="1.11")


def _dynamics(inside: str) -> str:
    return arm(axis=f"{Y}<dynamics>{inside}</dynamics>")


CASES = (
    case(
        "inertia products",
        arm(
            inertial="<inertial><mass>2</mass><inertia><ixx>0.03</ixx><iyy>0.04</iyy><izz>0.02</izz>"
            "<ixy>0.005</ixy><ixz>0.002</ixz><iyz>-0.003</iyz></inertia></inertial>"
        ),
        {"body upper inertia": ((0.03, 0.005, 0.002), (0.005, 0.04, -0.003), (0.002, -0.003, 0.02))},
        "link: inertial/inertia",
        "The six numbers are the entries of the matrix, about the centre of mass.",
    ),
    case(
        "inertia turned",
        arm(inertial=f"<inertial><pose>0.1 0 0 0 0 {math.pi / 2}</pose><mass>2</mass>{PLAIN}</inertial>"),
        {
            "body upper inertia": ((0.04, 0, 0), (0, 0.03, 0), (0, 0, 0.02)),
            "body upper centre": (0.1, 0, 0.4),
        },
        "link: inertial/pose",
        "The matrix is in the frame of the centre of mass, which the pose turns.",
    ),
    case(
        "inertia default",
        arm(inertial=""),
        {"body upper mass": 1},
        "link: inertial",
        "Without inertial the mass is 1 kg, with unit moments of inertia.",
    ),
    case(
        "damping",
        _dynamics("<damping>0.3</damping>"),
        {"joint shoulder damping": (0.3,)},
        "joint: dynamics/damping",
        "Viscous damping of the coordinate.",
    ),
    case(
        "friction",
        _dynamics("<friction>0.4</friction>"),
        {"joint shoulder friction": 0.4},
        "joint: dynamics/friction",
        "Static friction of the joint.",
    ),
    case(
        "spring",
        _dynamics("<spring_stiffness>5</spring_stiffness><spring_reference>0.3</spring_reference>"),
        {"joint shoulder stiffness": (5,), "joint shoulder rest": 0.3},
        "joint: dynamics/spring_stiffness",
        "A spring that is at rest at spring_reference.",
    ),
    case(
        "limits",
        arm(axis=f"{Y}<limit><lower>-0.5</lower><upper>1.5</upper></limit>"),
        {"joint shoulder lower": -0.5, "joint shoulder upper": 1.5},
        "joint: limit",
        "Ends of the coordinate in rad.",
    ),
    case(
        "limits by large numbers",
        arm(axis=f"{Y}<limit><lower>-1e16</lower><upper>1e16</upper></limit>"),
        {"joints": 2},
        "joint: limit",
        "The defaults ±1e16 mean no limit.",
    ),
    case(
        "mimic",
        _follower('<mimic joint="elbow"><multiplier>2</multiplier></mimic>'),
        {"coupling wrist coefficients": (0, 2)},
        "joint: mimic",
        "multiplier · (value of the other joint - reference) + offset.",
    ),
    case(
        "mimic with reference",
        _follower(
            '<mimic joint="elbow"><multiplier>2</multiplier><offset>0.1</offset>'
            "<reference>0.3</reference></mimic>"
        ),
        {"coupling wrist coefficients": (-0.5, 2)},
        "joint: mimic",
        "multiplier · (value of the other joint - reference) + offset.",
    ),
    case(
        "free link",
        model(link("upper", 0.4) + link("lower", 0.8) + ELBOW),
        {"joints": 2},
        "model",
        "Links that no joint connects to the world are free.",
    ),
    case(
        "static model",
        arm(also="").replace(
            "</world>", '<model name="wall"><static>true</static><link name="stone"/></model></world>'
        ),
        {"joint arm::shoulder type": "revolute", "joints": 2},
        "model: static",
        "A static model does not move.",
    ),
    case(
        "two models",
        arm().replace(
            "</world>",
            f'<model name="second">{link("bar", 0.4)}{joint("pivot", ("world", "bar"))}</model></world>',
        ),
        {"joint second::pivot type": "revolute", "joints": 3},
        "world",
        "A world may have several models; each has its own names.",
    ),
    case(
        "nested model",
        arm(
            also=f'<model name="tool">{link("hand", 1.2)}</model>' + joint("wrist", ("lower", "tool::hand")),
            version="1.9",
        ),
        {"joints": 3},
        "model: model",
        "A model may have models inside; their names begin with its name.",
    ),
    case(
        "gravity",
        arm(head="<gravity>0 -5 0</gravity>"),
        {"gravity": (0, -5, 0)},
        "world: gravity",
        "The acceleration of gravity of the world.",
    ),
    case(
        "gravity default",
        arm(),
        {"gravity": (0, 0, -9.8)},
        "world: gravity",
        "Without the element it is (0, 0, -9.8).",
    ),
    case(
        "loop",
        arm(
            also=link("other", 0.4)
            + joint("side", ("world", "other"))
            + joint("close", ("lower", "other"), more="<pose>0 0 0.4 0 0 0</pose>")
        ),
        {"loop close type": "revolute"},
        "joint",
        "Joints may form loops; each of them holds.",
    ),
)
