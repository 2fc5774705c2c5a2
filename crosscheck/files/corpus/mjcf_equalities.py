"""MJCF files with one feature each: frames, gravity, several bodies, and equalities."""

from __future__ import annotations

from crosscheck.files.corpus.mjcf import ELBOW, HINGE, SIDE, arm, body, case, lower, model


def pair(equality: str, first: str = "", second: str = "") -> str:
    """Return two arms on a massless root with an equality, and more inside their last bodies."""
    left = body("upper", HINGE + body("lower", ELBOW + first))
    right = body("other", SIDE + second, 'pos="0.3 0 0.4"')
    return model(f'<body name="root">{left}{right}</body>', f"<equality>{equality}</equality>")


CASES = (
    case(
        "frame",
        model(f'<frame pos="0 0 1" euler="0 0 90">{body("upper", HINGE + lower())}</frame>'),
        {"joint shoulder anchor": (0, 0, 1.4), "joint shoulder axis": (-1, 0, 0)},
        "frame",
        "A frame moves its inside, and disappears.",
    ),
    case(
        "gravity",
        arm(head='<option gravity="0 -5 0"/>'),
        {"gravity": (0, -5, 0)},
        "option: gravity",
        "The acceleration of gravity.",
    ),
    case(
        "gravity off",
        arm(head='<option><flag gravity="disable"/></option>'),
        {"gravity": (0, 0, 0)},
        "option/flag: gravity",
        "The flag sets gravity to zero.",
    ),
    case(
        "model without a name",
        model(body("upper", HINGE + lower()), name=""),
        {"joints": 2},
        "mujoco: model",
        "The name of the model is optional.",
    ),
    case(
        "bodies side by side",
        model(body("upper", HINGE + lower()) + body("other", SIDE)),
        {"joints": 3},
        "worldbody",
        "The world may have several child bodies.",
    ),
    case(
        "connect",
        pair('<connect name="close" body1="lower" body2="other" anchor="0.1 0 0.1"/>'),
        {"loop close type": "spherical", "loop close anchors": ((0.1, 0, 0.9), (0.1, 0, 0.9))},
        "equality/connect",
        "A point of both bodies coincides; the anchor is in the first body's frame.",
    ),
    case(
        "connect of sites",
        pair(
            '<connect name="close" site1="first" site2="second"/>',
            '<site name="first" pos="0.1 0 0.1"/>',
            '<site name="second" pos="-0.2 0 0.5"/>',
        ),
        {"loop close anchors": ((0.1, 0, 0.9), (0.1, 0, 0.9))},
        "equality/connect: site1",
        "Two sites coincide.",
    ),
    case(
        "weld",
        pair('<weld name="close" body1="lower" body2="other"/>'),
        {"loop close type": "fixed"},
        "equality/weld",
        "Both bodies keep their relative pose of the file.",
    ),
    case(
        "equality that is off",
        pair('<connect name="close" body1="lower" body2="other" anchor="0.1 0 0.1" active="false"/>'),
        {"joints": 3},
        "equality: active",
        "A constraint that is not active has no effect.",
    ),
    case(
        "coupling",
        pair('<joint name="gear" joint1="side" joint2="elbow" polycoef="0 2 0 0 0"/>'),
        {"coupling side coefficients": (0, 2)},
        "equality/joint",
        "The first joint follows a polynomial of the second, from their references.",
    ),
    case(
        "coupling polynomial",
        pair('<joint name="gear" joint1="side" joint2="elbow" polycoef="0 1 0.5 0 0"/>'),
        {"coupling side coefficients": (0, 1, 0.5)},
        "equality/joint: polycoef",
        "Up to the fourth power.",
    ),
    case(
        "locked joint",
        pair('<joint name="lock" joint1="side" polycoef="0 0 0 0 0"/>'),
        {"coupling side leader": ""},
        "equality/joint",
        "Without a second joint the first one is locked.",
    ),
)
