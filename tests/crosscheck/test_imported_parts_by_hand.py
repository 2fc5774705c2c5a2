"""Parts of imported files / motions of chains, faults of URDF files and loads of MJCF worked out by hand."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.engines.mujoco.importing import chains, loads, urdf_faults
from crosscheck.engines.mujoco.importing.chains import Chain, _recognised, freedoms, joints_of, rank
from crosscheck.engines.mujoco.importing.groups import Piece
from crosscheck.engines.mujoco.importing.left_out import Part
from mbref.scene import (
    Distance,
    JointForce,
    JointTorque,
    Planar,
    Revolute,
    SceneError,
    SlideSpring,
    Spherical,
    Spring,
    TorsionSpring,
    Translational,
)

X, Y, Z, O = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
EXTENT = 2.0  # m


def chain(*parts: tuple[str, Any, Any]) -> Chain:
    """A chain of joints: kind, anchor and axis of each."""
    kinds, anchors, axes = zip(*parts, strict=True)
    ends = Piece(0), Piece(1)
    return Chain(ends, tuple(range(len(parts))), kinds, np.array(anchors, float), np.array(axes, float))


def made(*parts: tuple[str, Any, Any]) -> Any:
    found = _recognised(chain(*parts), EXTENT)
    return None if found is None else [(kind.__name__, places) for kind, places in found]


# --- motions of chains ------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("parts", "wanted"),
    [
        ([("hinge", X, Z)], [("Revolute", {"anchor": [1, 0, 0], "axis": [0, 0, 1]})]),
        ([("slide", X, Y)], [("Translational", {"anchor": [1, 0, 0], "axis": [0, 1, 0]})]),
        ([("ball", Y, Z)], [("Spherical", {"anchor": [0, 1, 0], "axis": [0, 0, 1]})]),
        ([("free", O, Z)], []),
        ([("slide", O, X), ("slide", O, Y), ("slide", O, Z), ("ball", O, Z)], []),
        ([("slide", Y, Z), ("hinge", X, Z)], [("Cylindrical", {"anchor": [1, 0, 0], "axis": [0, 0, 1]})]),
        (
            [("hinge", X, Z), ("slide", Y, (0, 0, -1))],
            [("Cylindrical", {"anchor": [1, 0, 0], "axis": [0, 0, 1]})],
        ),
        ([("slide", O, X), ("hinge", X, Z)], None),
        ([("slide", O, X), ("slide", O, Y)], None),
        (
            [("hinge", (1, 0, 0), X), ("hinge", (0, 2, 0), Y)],
            [("Universal", {"anchor": [0, 0, 0], "axes": [[1, 0, 0], [0, 1, 0]]})],
        ),
        ([("hinge", O, X), ("hinge", (0, 0, 0.1), Y)], None),
        ([("hinge", O, X), ("hinge", O, (0.6, 0.8, 0.0))], None),
        (
            [("hinge", (3, 0, 0), X), ("hinge", (0, 2, 0), Y), ("hinge", (0, 0, 1), Z)],
            [("Spherical", {"anchor": [0, 0, 0]})],
        ),
        ([("hinge", O, X), ("hinge", O, Y), ("hinge", (0.1, 0, 0), Z)], None),
        (
            [("slide", O, X), ("slide", O, Y), ("hinge", X, Z)],
            [("Planar", {"anchor": [1, 0, 0], "axis": [0, 0, 1]})],
        ),
        ([("slide", O, X), ("slide", O, Z), ("hinge", X, Z)], None),
        (
            [("hinge", O, Z), ("hinge", X, Z), ("hinge", Y, Z)],
            [("Planar", {"anchor": [0, 1, 0], "axis": [0, 0, 1]})],
        ),
        (
            [("hinge", O, Z), ("hinge", (1.0, 0.0, 0.5), Z)],
            [
                ("Planar", {"anchor": [1, 0, 0.5], "axis": [0, 0, 1]}),
                ("Distance", {"anchors": ([0, 0, 0], [1, 0, 0])}),
            ],
        ),
        ([("hinge", O, Z), ("hinge", (0.0, 0.0, 0.5), Z)], None),
        (
            [("hinge", O, X), ("hinge", O, Y), ("ball", (1, 0, 2), Z)],
            [("Distance", {"anchors": ([0, 0, 0], [1, 0, 2])})],
        ),
        (
            [("ball", O, Z), ("hinge", (1, 0, 0), Y), ("hinge", (1, 0, 0), Z)],
            [("Distance", {"anchors": ([0, 0, 0], [1, 0, 0])})],
        ),
        (
            [("hinge", O, Y), ("hinge", O, Z), *[("hinge", (1, 0, 0), a) for a in (X, Y, Z)]],
            [("Distance", {"anchors": ([0, 0, 0], [1, 0, 0])})],
        ),
        ([("hinge", O, X), ("ball", (1, 0, 0), Z)], None),
        ([("hinge", O, X), ("hinge", (0, 0, 0.1), Y), ("ball", (1, 0, 2), Z)], None),
        ([("ball", O, Z), ("hinge", O, X), ("hinge", (0, 0, 0.1), Y)], None),
        (
            [("hinge", O, Z), ("hinge", (1.0, 0.0, 0.5), (0, 0, -1))],
            [
                ("Planar", {"anchor": [1, 0, 0.5], "axis": [0, 0, 1]}),
                ("Distance", {"anchors": ([0, 0, 0], [1, 0, 0])}),
            ],
        ),
    ],
)
def test_joints_with_the_motions_of_a_chain(parts, wanted):
    found = made(*parts)
    if wanted is None:
        assert found is None
        return
    assert [kind for kind, _ in found] == [kind for kind, _ in wanted]
    for (_, places), (_, expected) in zip(found, wanted, strict=True):
        assert places.keys() == expected.keys()
        for name, place in places.items():
            assert np.array(place) == pytest.approx(np.array(expected[name], float), abs=1e-14), name


@pytest.mark.parametrize(("off", "is_one"), [(0.9e-9, True), (1.1e-9, False)])
def test_how_nearly_axes_are_parallel_or_lines_meet(off, is_one):
    """A difference of 1e-9 of unit vectors, and of 1e-9 of the model's extent of 2 m, is rounding."""
    assert (made(("hinge", O, Z), ("slide", O, (off, 0.0, 1.0))) is not None) is is_one
    assert (made(("hinge", O, X), ("hinge", O, (off, 1.0, 0.0))) is not None) is is_one
    assert (made(("hinge", O, X), ("hinge", (0.0, 0.0, 4 * off), Y)) is not None) is is_one
    assert (made(("slide", O, X), ("slide", O, (0.0, 1.0, off)), ("hinge", X, Z)) is not None) is is_one


def test_the_limits_of_axes_and_points(monkeypatch):
    """A quarter of unit vectors, and of the extent of 2 m, exactly; and a little more."""
    monkeypatch.setattr(chains, "ALIGNED", 0.25)
    for more, is_within in ((0.0, True), (1e-6, False)):
        off = 0.25 + more
        assert chains._parallel(np.array([Z, (off, 0.0, 1.0)])) is is_within
        tilted = chain(("slide", O, (1.0, 0.0, off)), ("slide", O, Y), ("hinge", X, Z))
        assert (chains._planar(tilted, EXTENT) is not None) is is_within
        crossed = chain(("hinge", O, X), ("hinge", O, (off, 1.0, 0.0)))
        assert (chains._universal(crossed, EXTENT) is not None) is is_within
        apart = chain(("hinge", O, Z), ("hinge", (2 * off, 0.0, 7.0), Z))
        assert (chains._two_hinges(apart, EXTENT) is None) is is_within
        missing = chain(("hinge", O, X), ("hinge", (0.0, 0.0, 4 * off), Y))
        found = chains._meeting(missing, slice(0, 2), EXTENT)
        assert found == ([0.0, 0.0, 0.5] if is_within else None)
    square = chain(("hinge", (3.0, 0.0, 0.0), X), ("hinge", (0.0, 2.0, 0.0), Y))
    for least, point in ((1.0, None), (0.999, [0.0, 0.0, 0.0])):
        monkeypatch.setattr(chains, "ALIGNED", least)
        assert chains._meeting(square, slice(0, 2), EXTENT) == point
    assert chains._meeting(square, slice(0, 1), EXTENT) is None
    monkeypatch.setattr(chains, "RANK", 0.25)
    for size, count in ((0.25, 1), (0.250001, 2)):
        assert rank(chain(("slide", O, X), ("slide", O, (0.0, size, 0.0))), EXTENT) == count


def test_freedoms_and_independent_motions():
    """Two slides along one line move alike, and so do two hinges on one line."""
    assert freedoms(chain(("free", O, Z), ("ball", O, Z), ("hinge", O, Z), ("slide", O, Z))) == 11
    for parts, independent in (
        ([("free", O, Z)], 6),
        ([("ball", O, Z)], 3),
        ([("slide", O, X), ("slide", O, (-1.0, 0.0, 0.0))], 1),
        ([("hinge", O, Z), ("hinge", (0, 0, 3), Z)], 1),
        ([("hinge", O, Z), ("hinge", (1, 0, 3), Z)], 2),
        ([("ball", O, Z), ("hinge", O, Y)], 3),
        ([("ball", O, Z), ("hinge", X, Y)], 4),
    ):
        assert rank(chain(*parts), EXTENT) == independent
    assert made(("hinge", O, Z), ("hinge", (0, 0, 3), Z)) is None, "two freedoms of one motion"


def test_names_of_the_joints_of_a_chain():
    """The first name of its joints, otherwise the name of the body; a second joint adds its type."""
    names = {0: "", 1: "elbow"}
    groups = SimpleNamespace(
        model=SimpleNamespace(joint=lambda j: SimpleNamespace(name=names[j])),
        name=lambda piece: {0: "ground", 1: "arm"}[piece.group],
    )
    parts = ("hinge", O, Z), ("hinge", X, Z)
    planar, distance = joints_of(chain(*parts), groups, EXTENT)
    assert isinstance(planar, Planar) and isinstance(distance, Distance)
    assert (planar.name, distance.name) == ("elbow", "elbow distance")
    assert planar.bodies == distance.bodies == ("ground", "arm")
    [single] = joints_of(chain(("ball", X, Z)), groups, EXTENT)
    assert isinstance(single, Spherical) and single.name == "arm joint"
    assert joints_of(chain(("slide", O, X), ("slide", O, Y)), groups, EXTENT) is None
    assert joints_of(chain(("free", O, Z)), groups, EXTENT) == []


# --- faults of URDF files ---------------------------------------------------------------------------------
def joint(name: str, parent: str, child: str, kind: str = "revolute") -> str:
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/></joint>'


def robot(*parts: str, links: str = "abc") -> ET.Element:
    named = "".join(f'<link name="{link}"/>' for link in links)
    return ET.fromstring(f"<robot>{named}{''.join(parts)}</robot>")


TREE = joint("J", "a", "b"), joint("K", "b", "c")


@pytest.mark.parametrize(
    ("root", "faults"),
    [
        (robot(*TREE), []),
        (robot(*TREE, links="abcc"), ["link 'c': is in the file 2 times"]),
        (
            robot(joint("J", "a", "b"), joint("K", "x", "c")),
            ["joint 'K': its parent link 'x' is not in the file"],
        ),
        (
            robot(*TREE, joint("L", "a", "y")),
            ["joint 'L': its child link 'y' is not in the file"],
        ),
        (
            robot(*TREE, joint("L", "a", "c")),
            [
                "link 'c': is the child of two joints, 'K' and 'L'; let the second joint carry a link of its "
                "own, and close the loop with --close"
            ],
        ),
        (
            robot(*TREE, joint("L", "c", "a")),
            ["every link is the child of a joint: the joints form a circle; close loops with --close"],
        ),
        (
            robot(TREE[0]),
            ["links 'a', 'c': no joint carries them; a URDF has one such link, its base"],
        ),
        (
            robot(links="abcdefg"),
            [
                "links 'a', 'b', 'c', 'd', 'e', 'f' and more: no joint carries them; "
                "a URDF has one such link, its base"
            ],
        ),
        (robot(links=""), []),
        (
            robot(
                *TREE, '<link name="d"><inertial><mass value="-2"/></inertial></link>', joint("L", "c", "d")
            ),
            ["link 'd': its mass must not be negative, got -2"],
        ),
        (
            robot(
                *TREE, '<link name="d"><inertial><mass value="0"/></inertial></link>', joint("L", "c", "d")
            ),
            [],
        ),
        (robot(joint("J", "a", "b", "floating"), TREE[1]), []),
        (
            robot(TREE[0], joint("K", "b", "c", "floating")),
            ["joint 'K': floats on link 'b', which is not the base of the file"],
        ),
    ],
)
def test_faults_of_a_urdf(root, faults):
    if not faults:
        urdf_faults.check(root)
        return
    with pytest.raises(SceneError) as caught:
        urdf_faults.check(root)
    assert list(caught.value.faults) == faults


def test_macros_are_the_only_fault():
    """The first macro is named, and the remaining file is not checked."""
    text = '<robot xmlns:xacro="http://x/xacro"><link name="a"/><link name="b"/>{}</robot>'
    for part, fault in (
        (
            "<xacro:arm/>",
            "element <xacro:arm>: is a macro of xacro",
        ),
        (
            '<mass value="${m}"/>',
            "<mass value='${m}'>: is an expression of xacro",
        ),
        (
            '<mass value="$(arg m)"/><xacro:arm/>',
            "<mass value='$(arg m)'>: is an expression of xacro",
        ),
    ):
        with pytest.raises(SceneError) as caught:
            urdf_faults.check(ET.fromstring(text.format(part)))
        assert list(caught.value.faults) == [f"{fault}; write the URDF with `xacro FILE > robot.urdf`"]


def test_floating_joints_that_are_held():
    root = robot(joint("J", "a", "b", "floating"), joint("K", "b", "c", "planar"))
    urdf_faults.hold(root, ["c"])
    assert [each.get("type") for each in root.findall("joint")] == ["floating", "fixed"]
    with pytest.raises(SceneError, match="--hold c: is no link of a floating or planar joint; known: b"):
        urdf_faults.hold(root, ["b", "c"])
    with pytest.raises(SceneError, match="known: none, so that the base is fixed to the ground already"):
        urdf_faults.hold(robot(*TREE), ["b"])
    assert (
        urdf_faults.base(robot(*TREE)) == "a" and urdf_faults.base(robot(*TREE, joint("L", "c", "a"))) == ""
    )


# --- loads of MJCF ----------------------------------------------------------------------------------------
mujoco = pytest.importorskip("mujoco")

FILE = """<mujoco><option {option}/><compiler angle="radian"/><worldbody>
<site name="o" pos="0 0 1"/>
<body name="arm" pos="0 0 1"><joint name="turn" type="hinge" axis="0 1 0" {turn}/>
<geom size=".1" pos=".5 0 0"/><site name="s" pos=".5 0 0"/>
<body name="cart" pos="1 0 0"><joint name="slip" type="slide" axis="1 0 0" {slip}/><geom size=".1"/>
<site name="t" pos=".25 0 0"/></body></body></worldbody>
<tendon>{tendon}</tendon><actuator>{actuator}</actuator>
<keyframe><key qpos=".5 .25" ctrl="{ctrl}"/></keyframe></mujoco>"""


def read(**parts: str) -> tuple[Any, Any]:
    given = {"option": "", "turn": "", "slip": "", "tendon": "", "actuator": "", "ctrl": "", **parts}
    model = mujoco.MjModel.from_xml_string(FILE.format(**given))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return model, data


HINGE = Revolute(name="A", bodies=("ground", "arm"), anchor=O, axis=Y)
SLIDE = Translational(name="B", bodies=("arm", "cart"), anchor=O, axis=X)


def of_joints(known: Any = None, **parts: str) -> list[Any]:
    model, data = read(**parts)
    return list(loads.of_joints(mujoco, model, data, {0: HINGE, 1: SLIDE} if known is None else known))


def test_springs_of_joints_count_from_the_pose_of_the_keyframe():
    """The hinge rests at 0.75 rad and stands at 0.5; the slide rests at 0.1 m and stands at 0.25."""
    found = of_joints(turn='stiffness="3" damping="0.5" springref=".75"', slip='stiffness="7" springref=".1"')
    twist, push = found
    assert isinstance(twist, TorsionSpring) and isinstance(push, SlideSpring)
    assert (twist.joint, twist.stiffness, twist.damping) == ("A", 3.0, 0.5)
    assert twist.natural_angle == pytest.approx(0.25)
    assert (push.joint, push.stiffness, push.damping) == ("B", 7.0, 0.0)
    assert push.natural_displacement == pytest.approx(-0.15)
    [damper] = of_joints(slip='damping="2" springref=".1"')
    assert (damper.stiffness, damper.damping, damper.natural_displacement) == (0.0, 2.0, 0.0)
    assert of_joints() == []


def test_springs_that_a_file_disables():
    both = {"turn": 'stiffness="3" damping="0.5"'}
    option = '><flag {}="disable"/></option><option '
    [damper] = of_joints(**both, option=option.format("spring"))
    assert (damper.stiffness, damper.damping) == (0.0, 0.5)
    [spring] = of_joints(**both, option=option.format("damper"))
    assert (spring.stiffness, spring.damping) == (3.0, 0.0)


def test_plastic_springs_are_parts_without_stiffness():
    model, data = read(
        turn='stiffness="3"',
        slip='stiffness="2"',
        tendon='<spatial name="r" stiffness="9"><site site="o"/><site site="s"/></spatial>',
    )
    model.jnt_springyield[1], model.tendon_springyield[0] = 1.0, 1.0
    first, second, spring = loads.of_joints(mujoco, model, data, {0: HINGE, 1: SLIDE})
    assert (first, second) == (
        Part("springs", "plastic spring of joint 'slip'"),
        Part("springs", "plastic spring of tendon 'r'"),
    )
    assert (spring.joint, spring.stiffness) == ("A", 3.0)
    assert model.jnt_stiffness.tolist() == [3.0, 0.0] and model.tendon_stiffness.tolist() == [0.0]


def test_springs_and_dampers_that_are_not_constant():
    """Each joint and tendon is named once, in the order of joints' and tendons' springs and dampers."""
    tendons = "".join(
        f'<spatial name="{name}"><site site="o"/><site site="s"/></spatial>' for name in ("p", "q")
    )
    model, data = read(tendon=tendons)
    numbers = (
        model.jnt_stiffnesspoly,
        model.dof_dampingpoly,
        model.tendon_stiffnesspoly,
        model.tendon_dampingpoly,
    )
    for rows, row in zip(numbers, (1, 0, 1, 0), strict=True):
        rows[row, 0] = 2.0
    assert list(loads.of_joints(mujoco, model, data, {0: HINGE, 1: SLIDE})) == [
        Part("springs", "polynomial springs of joint 'slip'"),
        Part("damping", "polynomial damping of joint 'turn'"),
        Part("springs", "polynomial springs of tendon 'q'"),
        Part("damping", "polynomial damping of tendon 'p'"),
    ]
    assert not any(rows.any() for rows in numbers)


def test_a_ball_with_damping_is_one_part():
    """Its three coordinates have no load in a scene; a ball's polynomial is named once."""
    text = """<mujoco><worldbody><body><joint name="h"/><geom size=".1"/>
    <body><joint name="b" type="ball" damping="2"/><geom size=".1"/></body></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    model.dof_damping[0], model.dof_dampingpoly[1:] = 5.0, 1.0
    found = list(loads.of_joints(mujoco, model, mujoco.MjData(model), {0: HINGE, 1: HINGE}))
    assert [getattr(part, "sentence", "") for part in found] == [
        "",
        "damping of joint 'b'",
        "polynomial damping of joint 'b'",
    ]
    assert model.dof_damping.tolist() == [5.0, 0.0, 0.0, 0.0]


def test_springs_of_joints_that_the_scene_does_not_have():
    model, data = read(turn='stiffness="3" damping="0.5"', slip='damping="2"')
    found = list(loads.of_joints(mujoco, model, data, {0: SLIDE}))
    assert found == [
        Part("springs", "stiffness of joint 'turn'"),
        Part("damping", "damping of joint 'turn'"),
        Part("damping", "damping of joint 'slip'"),
    ]
    assert not model.jnt_stiffness.any() and not model.dof_damping.any(), "the model has them no longer"


MOTORS = (
    '<motor joint="turn" gear="4" ctrlrange="-1 .5" ctrllimited="true" name="m"/>'
    '<motor joint="slip" gear="2" forcerange="-3 3" forcelimited="true"/>'
    '<position joint="slip" kp="5" name="servo"/>'
)


def of_motors(ctrl: str, known: Any = None, **parts: str) -> list[Any]:
    model, _ = read(actuator=MOTORS, ctrl=ctrl, **parts)
    return list(loads.of_motors(mujoco, model, 0, {0: HINGE, 1: SLIDE} if known is None else known))


def test_motors_with_a_control_value():
    """Gear 4 times a control of at most 0.5; gear 2 times a force of at most 3."""
    assert of_motors("0 0 0") == []
    assert of_motors("2 1.5 0") == [JointTorque(joint="A", torque=2.0), JointForce(joint="B", force=3.0)]
    assert of_motors("-2 -9 0") == [JointTorque(joint="A", torque=-4.0), JointForce(joint="B", force=-6.0)]
    assert of_motors("0.25 0 0") == [JointTorque(joint="A", torque=1.0)]
    assert of_motors("0 0 1") == [
        Part("motors", "control value of 'servo' in the keyframe, no motor of a joint")
    ]
    assert [part.sentence for part in of_motors("1 1 0", {})] == [
        "control value of 'm' in the keyframe, no motor of a joint",
        "control value of 'actuator 1' in the keyframe, no motor of a joint",
    ]
    assert all(isinstance(part, Part) for part in of_motors("1 1 0", {0: SLIDE, 1: HINGE}))
    assert of_motors("1 1 1", option='><flag actuation="disable"/></option><option ') == []
    model, _ = read(actuator=MOTORS, ctrl="1 1 1")
    assert loads.controlled(mujoco, model, -1) == [] and loads.controlled(mujoco, model, 0) == [0, 1, 2]


GROUPS = SimpleNamespace(name_of=lambda body: ("ground", "arm", "cart")[body])


def of_tendons(*tendons: str) -> tuple[list[Any], Any]:
    model, data = read(tendon="".join(tendons))
    return list(loads.of_tendons(mujoco, model, data, GROUPS)), model


def test_a_tendon_between_two_sites_is_a_spring():
    """The arm is turned by 0.5 rad about y: its site is at (0.5 cos, 0, 1 - 0.5 sin)."""
    found, _ = of_tendons(
        '<spatial stiffness="9" damping="2" springlength=".4"><site site="o"/><site site="s"/></spatial>',
        '<spatial><site site="o"/><site site="t"/></spatial>',
    )
    [spring] = found
    assert isinstance(spring, Spring) and spring.bodies == ("ground", "arm")
    assert (spring.stiffness, spring.damping, spring.natural_length) == (9.0, 2.0, 0.4)
    assert spring.points[0] == (0.0, 0.0, 1.0)
    assert spring.points[1] == pytest.approx((0.5 * np.cos(0.5), 0.0, 1 - 0.5 * np.sin(0.5)))


@pytest.mark.parametrize(
    ("tendon", "part"),
    [
        (
            '<spatial name="r" stiffness="9" springlength=".2 .4"><site site="o"/><site site="s"/></spatial>',
            Part("springs", "tendon 'r', whose spring is slack over a range"),
        ),
        (
            '<spatial stiffness="9"><site site="o"/><site site="s"/><site site="t"/></spatial>',
            Part("springs", "tendon 'tendon 0', which is not a spring between two sites"),
        ),
        (
            '<fixed name="f" damping="2"><joint joint="turn" coef="1"/></fixed>',
            Part("damping", "tendon 'f', which is not a spring between two sites"),
        ),
        (
            '<fixed name="f" stiffness="2"><joint joint="turn" coef="1"/>'
            '<joint joint="slip" coef="1"/></fixed>',
            Part("springs", "tendon 'f', which is not a spring between two sites"),
        ),
    ],
)
def test_tendons_that_are_no_springs(tendon, part):
    found, model = of_tendons(tendon)
    assert found == [part] and not model.tendon_stiffness.any() and not model.tendon_damping.any()


def test_a_damper_without_a_spring_is_never_slack():
    [damper], _ = of_tendons(
        '<spatial damping="2" springlength=".2 .4"><site site="o"/><site site="s"/></spatial>'
    )
    assert (damper.stiffness, damper.damping, damper.natural_length) == (0.0, 2.0, 0.2)
