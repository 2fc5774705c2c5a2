"""Scenes written as MJCF, and sentences and names of files that are read / worked out by hand."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest

from crosscheck.engines.mujoco import original, projection, writing
from crosscheck.engines.mujoco.families import MAX_STEPS
from crosscheck.engines.mujoco.importing import agreement, asked_closures, reading
from crosscheck.engines.mujoco.importing.closures import Closure, Frame
from crosscheck.engines.mujoco.importing.groups import Groups
from crosscheck.engines.sampling import Failed
from mbref.formats import ImportOptions
from mbref.scene import (
    Body,
    Coupling,
    Cylindrical,
    Distance,
    Driver,
    Force,
    JointForce,
    JointTorque,
    Moment,
    Revolute,
    Scene,
    SceneError,
    SlideSpring,
    Spherical,
    Spring,
    TorsionSpring,
)
from mbref.trajectory import Outcome

BODY = Body(name="b", mass=4.0, inertia=(1.0, 2.0, 2.5), position=(1.0, 0.0, 0.0))
HINGE = Revolute(
    name="H", bodies=("ground", "b"), anchor=(0.25, 0.0, 0.0), axis=(0.0, 0.0, 1.0), armature=0.5
)
SLEEVE = Cylindrical(name="C", bodies=("b", "c"), anchor=(1.0, 2.0, 0.0), axis=(0.0, 3.0, 0.0))
OTHER = BODY.model_copy(update={"name": "c", "position": (1.0, 3.0, 0.0)})


def scene(**parts: Any) -> Scene:
    given = {"name": "s", "body": (BODY,), "joint": (HINGE,), "duration": 2.0, "gravity": (0.0, 0.5, -9.0)}
    return Scene(**{**given, **parts})


def written(given: Scene) -> tuple[ET.Element, tuple[str, ...]]:
    found = writing.write(given)
    return ET.fromstring(found.text), found.left_out


def numbers(element: ET.Element, key: str) -> list[float]:
    return [float(word) for word in element.attrib[key].split()]


# --- MJCF -------------------------------------------------------------------------------------------------
def test_bodies_and_joints_of_a_file() -> None:
    root, left_out = written(scene(body=(BODY, OTHER), joint=(HINGE, SLEEVE)))
    assert root.tag == "mujoco" and root.get("model") == "s"
    assert root.find("compiler").attrib == {"angle": "radian"}
    assert numbers(root.find("option"), "gravity") == [0.0, 0.5, -9.0]
    first = root.find("worldbody/body")
    assert first.get("name") == "b" and numbers(first, "pos") == [1.0, 0.0, 0.0]
    inertial = first.find("inertial")
    assert numbers(inertial, "mass") == [4.0] and numbers(inertial, "pos") == [0.0, 0.0, 0.0]
    assert numbers(inertial, "diaginertia") == [1.0, 2.0, 2.5] and numbers(inertial, "quat") == [1, 0, 0, 0]
    hinge = first.find("joint")
    assert hinge.attrib.keys() == {"name", "type", "pos", "axis", "armature"}
    assert (hinge.get("name"), hinge.get("type")) == ("H", "hinge")
    assert numbers(hinge, "pos") == [-0.75, 0.0, 0.0] and numbers(hinge, "axis") == [0.0, 0.0, 1.0]
    assert numbers(hinge, "armature") == [0.5]
    second = first.find("body")
    assert second.get("name") == "c" and numbers(second, "pos") == [0.0, 3.0, 0.0]
    slide, turn = second.findall("joint")
    assert [(j.get("name"), j.get("type")) for j in (slide, turn)] == [("C 1", "slide"), ("C 2", "hinge")]
    assert numbers(turn, "pos") == [0.0, -1.0, 0.0] and numbers(turn, "axis") == [0.0, 1.0, 0.0]
    assert left_out == ("exactness of joints: MuJoCo's equalities are soft (solref, solimp)",)
    for section in ("equality", "tendon", "actuator", "keyframe"):
        assert root.find(section) is None, section


def test_free_bodies_and_balls_have_no_axis() -> None:
    ball = Spherical(name="B", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0))
    root, _ = written(scene(body=(BODY, OTHER), joint=(ball,)))
    one, free = (body.find("joint").attrib for body in root.findall("worldbody/body"))
    assert one == {"name": "B", "type": "ball", "pos": "-1.0 0.0 0.0"}
    assert free == {"name": "free 1", "type": "free"}


def test_springs_motors_and_couplings_of_a_file() -> None:
    spring = Spring(
        bodies=("ground", "c"),
        points=((0.0, 0.0, 0.0), (1.0, 3.0, 1.0)),
        stiffness=7.0,
        damping=0.5,
        natural_length=0.25,
    )
    loads = (
        TorsionSpring(joint="H", stiffness=3.0, damping=0.125, natural_angle=0.5),
        SlideSpring(joint="C", stiffness=11.0),
        JointTorque(joint="H", torque=5.0),
        JointForce(joint="C", force=-2.0),
        JointTorque(joint="H", torque=6.0, factor={"stop": 1.0}),
        spring,
    )
    coupling = Coupling(name="K", joints=("H", "C"), ratio=2.5)
    root, left_out = written(
        scene(body=(BODY, OTHER), joint=(HINGE, SLEEVE), load=loads, coupling=(coupling,))
    )
    hinge = root.find("worldbody/body/joint")
    assert [numbers(hinge, k) for k in ("stiffness", "damping", "springref")] == [[3.0], [0.125], [0.5]]
    slide = root.find("worldbody/body/body/joint")
    assert numbers(slide, "stiffness") == [11.0] and "springref" not in slide.attrib
    equality = root.find("equality/joint").attrib
    assert equality == {"name": "K", "polycoef": "0.0 2.5 0.0 0.0 0.0", "joint1": "C 2", "joint2": "H"}
    tendon = root.find("tendon/spatial")
    assert [numbers(tendon, k) for k in ("springlength", "stiffness", "damping")] == [
        [0.25, 0.25],
        [7],
        [0.5],
    ]
    assert [site.get("site") for site in tendon] == [
        root.find("worldbody/site").get("name"),
        root.find("worldbody/body/body/site").get("name"),
    ]
    assert numbers(root.find("worldbody/body/body/site"), "pos") == [0.0, 0.0, 1.0]
    assert [(m.get("name"), m.get("joint")) for m in root.findall("actuator/motor")] == [
        ("motor 0 of H", "H"),
        ("motor 1 of C 1", "C 1"),
    ]
    key = root.find("keyframe/key")
    assert key.get("name") == writing.KEYFRAME and numbers(key, "ctrl") == [5.0, -2.0]
    motor = "its motor is controlled in keyframe 'loads'"
    assert left_out[:-1] == (
        f"load[2] (joint_torque of H): {motor}",
        f"load[3] (joint_force of C): {motor}",
        "load[4] (joint_torque of H): MJCF has no loads over time",
    )


def test_parts_that_mjcf_cannot_describe_are_named() -> None:
    moving = BODY.model_copy(update={"velocity": (0.0, 0.0, 0.0)})
    turning = OTHER.model_copy(update={"angular_velocity": (0.0, 0.0, 0.0)})
    loads = (
        Moment(body="b", moment=(1.0, 0.0, 0.0)),
        Force(body="c", point=(0.0, 0.0, 0.0), force=(1.0, 0.0, 0.0)),
        TorsionSpring(joint="H", stiffness=1.0),
    )
    driver = Driver(joint="H")
    given = scene(body=(moving, turning), joint=(HINGE, SLEEVE), load=loads, driver=(driver,))
    root, left_out = written(given)
    assert left_out[:-1] == (
        "driver of H: MJCF prescribes no motion over time",
        "load[0] (moment on b): apply it by mjData.xfrc_applied",
        "load[1] (force on c): apply it by mjData.xfrc_applied",
        "initial velocity of b: set mjData.qvel",
        "initial velocity of c: set mjData.qvel",
    )
    assert [body.get("name") for body in root.iter("body")] == ["b", "c"] and root.find("equality") is None


def test_closures_and_shares_of_a_file() -> None:
    again = HINGE.model_copy(update={"name": "I", "anchor": (0.25, 0.0, 1.0), "armature": 0.0})
    root, _ = written(scene(joint=(HINGE, again)))
    assert [body.get("name") for body in root.iter("body")] == ["b", "b (share 1)"]
    assert root.find("equality/weld").attrib == {
        "name": "closure 0",
        "site1": "closure 0.0",
        "site2": "closure 0.1",
    }
    assert [numbers(body.find("inertial"), "mass") for body in root.iter("body")] == [[2.0], [2.0]]
    rod = Distance(name="R", bodies=("b", "ground"), anchors=((2.0, 0.0, 0.0), (2.0, 5.0, 0.0)))
    root, _ = written(scene(joint=(HINGE, rod)))
    names = [body.get("name") for body in root.iter("body")]
    assert names[0] == "b" and "rod of a distance joint (share 1)" in names


def test_scenes_that_mjcf_cannot_hold() -> None:
    with pytest.raises(SceneError, match="s: MJCF needs the mass and inertia of every body"):
        writing.write(scene(body=(BODY.model_copy(update={"mass": None, "inertia": None}),), load=()))
    light = BODY.model_copy(update={"name": "l", "mass": 0.0, "inertia": (0.0, 0.0, 0.0)})
    chain = SLEEVE.model_copy(update={"bodies": ("l", "b")})
    with pytest.raises(SceneError, match="body 'l': is a massless link; MuJoCo reads no moving body"):
        writing.write(
            scene(body=(BODY, light), joint=(HINGE.model_copy(update={"bodies": ("ground", "l")}), chain))
        )


@pytest.mark.parametrize(
    ("inertia", "wanted"),
    [
        ((1.0, 2.0, 2.5), [1.0, 2.0, 2.5]),
        ((1.0, 2.0, 3.0), [1.0, 2.0, 3.0]),
        ((0.0, 2.0, 2.0), [0.0, 2.0, 2.0]),
    ],
)
def test_the_largest_moment_is_at_most_the_sum_of_the_others(inertia: Any, wanted: list[float]) -> None:
    link: Any = SimpleNamespace(inertia=np.diag(inertia), mass=3.0, offset=np.array([1.0, 2.0, 3.0]))
    body: Any = SimpleNamespace()
    writing._true_inertia(body, link)
    assert body.inertia.tolist() == pytest.approx(wanted, rel=1e-14)
    assert body.inertia[2] <= body.inertia[0] + body.inertia[1] and body.mass == 3.0
    assert body.ipos.tolist() == [1.0, 2.0, 3.0] and abs(body.iquat[0]) == pytest.approx(1.0)
    slightly: Any = SimpleNamespace(inertia=np.diag([-1e-20, 2.0, 2.0]), mass=1.0, offset=np.zeros(3))
    writing._true_inertia(body, slightly)
    assert body.inertia.min() >= 0.0


def test_axes_of_moments_are_right_handed() -> None:
    matrix = np.array([[2.0, 0.5, 0.0], [0.5, 3.0, 0.25], [0.0, 0.25, 2.25]])
    body: Any = SimpleNamespace()
    writing._true_inertia(body, SimpleNamespace(inertia=matrix, mass=1.0, offset=np.zeros(3)))  # type: ignore[arg-type]
    from mbref import rotations

    axes = rotations.to_matrix(np.asarray(body.iquat))
    assert axes @ np.diag(body.inertia) @ axes.T == pytest.approx(matrix)


# --- Files that are read ----------------------------------------------------------------------------------
def test_repeated_names_of_joints_get_numbers() -> None:
    joints = [HINGE.model_copy(update={"name": name}) for name in ("a", "a", "a 2", "a", "b")]
    assert [joint.name for joint in reading._renamed(joints)] == ["a", "a 2", "a 2 2", "a 3", "b"]


def test_the_extent_is_the_widest_along_an_axis() -> None:
    lump = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    places = ("1 0 0", "0 0 2", "0 -3 0.5")
    bodies = "".join(f'<body pos="{at}"><joint/>{lump}</body>' for at in places)
    text = "<mujoco><worldbody>{}</worldbody></mujoco>"
    assert reading._extent(mujoco, mujoco.MjModel.from_xml_string(text.format(bodies))) == 3.0
    one = text.format(f"<body><joint/>{lump}</body>")
    assert reading._extent(mujoco, mujoco.MjModel.from_xml_string(one)) == 1e-3


def read(tmp_path: Path, text: str, **options: Any) -> reading.Source:
    (tmp_path / "m.xml").write_text(f'<mujoco><compiler angle="radian"/>{text}</mujoco>')
    return reading.source(tmp_path / "m.xml", ImportOptions(**options))


LUMP = '<inertial pos="0.5 0 0" mass="1" diaginertia="1 1.5 2"/>'
PAIR = f"""<worldbody><body name="a"><joint name="A" axis="0 0 1"/>{LUMP}
<body name="m" pos="1 0 0">{LUMP}</body></body>
<body name="b" pos="0 2 0"><joint name="B" axis="0 0 1"/>{LUMP}</body></worldbody>"""


def test_couplings_locks_and_merged_bodies(tmp_path: Path) -> None:
    text = """<equality><joint name="A" joint1="B" joint2="A" polycoef="0 3 0 0 0"/>
    <joint name="lock" joint1="A"/></equality>"""
    found = read(tmp_path, PAIR + text).imported
    [coupling] = found.scene.coupling
    assert (coupling.name, coupling.joints, coupling.ratio) == ("coupling A", ("A", "B"), 3.0)
    assert coupling.coordinates is None and [driver.joint for driver in found.scene.driver] == ["A"]
    assert found.notes == ("fixed to 'a' and part of it: 'm'",)
    assert [(body.name, body.mass) for body in found.scene.body] == [("a", 2.0), ("b", 1.0)]


def test_bodies_fixed_to_the_ground_have_no_note(tmp_path: Path) -> None:
    fixed = PAIR.replace("<worldbody>", f'<worldbody><body name="pillar">{LUMP}</body>')
    assert read(tmp_path, fixed).imported.notes == ("fixed to 'a' and part of it: 'm'",)


def test_velocities_of_a_keyframe_obey_the_closures(tmp_path: Path) -> None:
    """B follows A with the ratio 3: the nearest velocities to (1, 2) are (0.7, 2.1)."""
    text = '<equality><joint name="K" joint1="B" joint2="A" polycoef="0 3 0 0 0"/></equality>'
    keys = '<keyframe><key name="k" qpos="0.1 0.3" qvel="1 2"/></keyframe>'
    found = read(tmp_path, PAIR + text + keys, keyframe="k")
    assert found.qvel == pytest.approx([0.7, 2.1]) and found.qpos == pytest.approx([0.1, 0.3])
    assert found.imported.scene.body[1].angular_velocity == pytest.approx((0.0, 0.0, 2.1))
    free = read(tmp_path, PAIR + keys, keyframe="k")
    assert free.qvel.tolist() == [1.0, 2.0]
    assert read(tmp_path, PAIR + keys).imported.scene.body[0].velocity is None


def test_features_that_a_file_switches_off(tmp_path: Path) -> None:
    text = """<equality><joint name="K" joint1="B" joint2="A"/>
    <connect body1="a" body2="b" anchor="1 1 0"/></equality>"""
    for flag in ("equality", "constraint"):
        found = read(tmp_path, f'<option><flag {flag}="disable"/></option>{PAIR}{text}').imported.scene
        assert not found.coupling and [joint.name for joint in found.joint] == ["A", "B"]
    off = read(tmp_path, f'<option gravity="0 0 -5"><flag gravity="disable"/></option>{PAIR}').imported.scene
    assert off.gravity == (0.0, 0.0, 0.0)
    assert read(tmp_path, f'<option gravity="0 1 -5"/>{PAIR}').imported.scene.gravity == (0.0, 1.0, -5.0)


def test_a_closure_within_a_body_is_noted(tmp_path: Path) -> None:
    text = '<equality><connect name="w" body1="a" body2="m" anchor="0 0 0"/></equality>'
    found = read(tmp_path, PAIR + text).imported
    assert "closure 'w': both sides are on 'a'" in found.notes and len(found.scene.joint) == 2


@pytest.mark.parametrize("text", ['<joint name="K" joint1="A" joint2="q"/>', '<joint name="K" joint1="p"/>'])
def test_rows_of_joints_in_a_sleeve(text: str, tmp_path: Path) -> None:
    """A coupling acts along the angle of a sleeve; a locked displacement is of a link without mass."""
    sleeve = f"""<body name="s" pos="0 5 0"><joint name="p" type="slide" axis="0 0 1"/>
    <joint name="q" axis="0 0 1"/>{LUMP}</body></worldbody>"""
    both = PAIR.replace("</worldbody>", sleeve)
    found = read(tmp_path, f"{both}<equality>{text}</equality>").imported.scene
    if "joint2" in text:
        [coupling] = found.coupling
        assert (coupling.joints, coupling.ratio, coupling.coordinates) == (("p", "A"), 1.0, None)
    else:
        assert [driver.joint for driver in found.driver] == ["p"] and len(found.body) == 4


# --- Frames that coincide ---------------------------------------------------------------------------------
MARKS = f"""<mujoco><worldbody>
<body name="a"><joint/>{LUMP}<site name="p" pos="1 0 0"/><site pos="1 0 0"/>
<site name="here" pos="1 0 0"/></body>
<body name="b" pos="0.75 0 0"><joint axis="0 1 0"/>{LUMP}<site name="q" pos="0.25 0 0"/>
  <body name="end" pos="0.25 0 0"/></body></worldbody></mujoco>"""


def coincide(text: str = MARKS, extent: float = 1.0, closed: Any = ()) -> list[str]:
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return list(asked_closures.unclosed(Groups(mujoco, model), data, closed, extent))


def test_frames_of_two_bodies_at_one_place() -> None:
    assert [sentence.partition("--close ")[2] for sentence in coincide()] == [
        "end=p closes the loop",
        "end=here closes the loop",
        "p=q closes the loop",
        "here=q closes the loop",
    ]
    assert coincide()[2].startswith("frames 'p' (on 'a') and 'q' (on 'b') coincide without a joint; ")


def test_frames_that_are_apart_or_joined() -> None:
    moved = MARKS.replace('name="q" pos="0.25 0 0"', 'name="q" pos="0.2500015 0 0"').replace(
        '<body name="end" pos="0.25 0 0"/>', ""
    )
    assert coincide(moved) == [] and len(coincide(moved, 2.0)) == 2
    joined = MARKS.replace('<joint axis="0 1 0"/>', '<joint axis="0 1 0" pos="0.25 0 0"/>')
    assert coincide(joined) == []
    one, other = (Frame(b, np.array([x, 0.0, 0.0]), np.eye(3)) for b, x in ((1, 1.0), (2, 0.25)))
    assert coincide(closed=[Closure("c", Spherical, (one, other))]) == []
    elsewhere = Frame(1, np.array([0.9, 0.0, 0.0]), np.eye(3))
    assert len(coincide(closed=[Closure("c", Spherical, (elsewhere, other))])) == 4


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('<body name="end" pos="0.25 0 0"/>', f'<body name="end" pos="0.25 0 0">{LUMP}</body>'),
        ('<body name="end" pos="0.25 0 0"/>', '<body pos="0.25 0 0"/>'),
        (
            '<body name="end" pos="0.25 0 0"/>',
            f'<body name="end" pos="0.25 0 0"><body pos="9 9 9">{LUMP}</body></body>',
        ),
    ],
)
def test_bodies_that_are_no_frames(old: str, new: str) -> None:
    assert len(coincide(MARKS.replace(old, new))) == 2


# --- Comparison with the file -----------------------------------------------------------------------------
def test_rows_have_length_one_and_short_rows_are_left_out() -> None:
    found = agreement._unit(np.array([[3.0, 4.0], [0.3, 0.4], [0.0, 0.5]]), 0.5)
    assert found.tolist() == [[0.6, 0.8]]
    assert agreement.rank(np.zeros((0, 3))) == 0 and agreement.rank(np.zeros((2, 3))) == 0
    assert agreement.rank(np.array([[1.0, 0.0], [0.0, 2e-8]])) == 2
    assert agreement.rank(np.array([[1.0, 0.0], [0.0, 0.5e-8]])) == 1


def test_weight_and_springs_of_massless_bodies() -> None:
    bodies = (BODY, OTHER.model_copy(update={"mass": 0.0, "inertia": (0.0, 0.0, 0.0)}))
    given = scene(body=bodies, joint=())
    pose = np.zeros((2, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))
    found = agreement._pushes(given, pose, np.zeros((2, 6)))
    assert found.tolist() == [0.0, 2.0, -36.0, *[0.0] * 9]
    assert agreement._masses(given, pose[1])[:3, :3].tolist() == (4.0 * np.eye(3)).tolist()
    assert not agreement._masses(given, pose[1])[6:9].any()


class Posed:
    """Poses that can or cannot be closed."""

    def __init__(self, closes: bool, extent: float = 1.0) -> None:
        self.data: Any = SimpleNamespace(qpos=np.array([5.0, 6.0]))
        self.extent, self.closes, self.places = extent, closes, 0

    def place(self) -> None:
        self.places += 1

    def close(self) -> None:
        if not self.closes:
            raise SceneError(["open"])


def comparison(poses: Posed, steps: list[np.ndarray]) -> agreement.Agreement:
    found: Any = object.__new__(agreement.Agreement)
    found.poses, found.model = poses, SimpleNamespace(nv=2)

    def integrate(model: Any, qpos: np.ndarray, step: np.ndarray, dt: float) -> None:
        steps.append(step.copy())
        assert qpos.tolist() == [5.0, 6.0] and dt == 1.0
        qpos += step

    found.mujoco = SimpleNamespace(mj_integratePos=integrate)
    return found


@pytest.mark.parametrize(("extent", "reach"), [(0.5, 0.125), (3.0, 0.25)])
def test_random_poses_come_nearer_until_one_can_be_closed(extent: float, reach: float) -> None:
    steps: list[np.ndarray] = []
    start = np.array([5.0, 6.0])
    open_ones = Posed(False, extent)
    assert not comparison(open_ones, steps)._random_pose(start, np.random.default_rng(3))
    drawn = np.random.default_rng(3).uniform(-reach, reach, (12, 2))
    assert np.array(steps) == pytest.approx(drawn * 0.7 ** np.arange(12)[:, None]) and open_ones.places == 12
    steps.clear()
    assert comparison(Posed(True, extent), steps)._random_pose(start, np.random.default_rng(3))
    assert len(steps) == 1


def test_a_file_is_compared_at_its_pose_and_at_two_random_poses() -> None:
    compared: list[list[float]] = []
    for closes, count in ((True, 3), (False, 1)):
        compared.clear()
        poses = Posed(closes)
        found: Any = comparison(poses, [])
        found._at_pose = lambda scene, tree, random, poses=poses: compared.append(poses.data.qpos.tolist())
        found.check(scene(), ["H"])
        assert len(compared) == count and compared[0] == [5.0, 6.0] == poses.data.qpos.tolist()
        assert [5.0, 6.0] not in compared[1:] and poses.places == (3 if closes else 25)


def test_gaps_are_noted_from_a_millionth_of_the_extent_on() -> None:
    for gap, notes in (
        (3.9e-6, []),
        (4.1e-6, ["closure 'r' was open by 4.1e-06 m or rad; the joints moved"]),
    ):
        reader: Any = object.__new__(reading._Reader)
        reader.notes, closed = [], []
        reader.poses = SimpleNamespace(
            extent=4.0,
            gaps=lambda gap=gap: {"r": gap},
            close=lambda closed=closed: closed.append(1),
            data=SimpleNamespace(qvel=0),
        )
        reader._close()
        assert [note.partition(" to close it")[0] for note in reader.notes] == notes and closed == [1]


def test_velocities_lose_what_independent_rows_forbid() -> None:
    """A row counts from 1e-9 of the largest singular value on."""
    for small, wanted in ((1.5e-9, [0.0, 0.0]), (0.9e-9, [0.0, 7.0])):
        reader: Any = object.__new__(reading._Reader)
        data = SimpleNamespace(qvel=np.array([3.0, 7.0]))
        reader.poses = SimpleNamespace(data=data, jacobian=lambda small=small: np.diag([1.0, small]))
        reader._keep_velocities()
        assert data.qvel == pytest.approx(wanted, abs=1e-6)


# --- A file's own model -----------------------------------------------------------------------------------
def test_runs_of_a_file_have_ever_smaller_steps(tmp_path: Path) -> None:
    found = read(tmp_path, f'<option timestep="0.01"/>{PAIR}')
    path = tmp_path / "m.xml"
    runs = original.originals(path, ImportOptions(), found)
    assert [run.family for run in runs] == [
        original.AS_IN_FILE,
        *[original.FINER] * 6,
        *[original.STIFFER] * 6,
        *[original.STIFFER_RK4] * 6,
    ]
    assert [run.options["step"] for run in runs[1:7]] == pytest.approx([0.01, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4])
    assert runs[0].options["file"] == str(path) and "import" not in runs[0].options
    named = original.originals(path, ImportOptions(without=["motors"]), found)
    assert named[1].options["import"] == "--without motors"
    assert original.originals(path, ImportOptions(close=["a=b"]), found) == ()
    assert original.originals(path.with_suffix(".urdf"), ImportOptions(), found) == ()


def test_files_with_short_steps_have_fewer_runs(tmp_path: Path) -> None:
    found = read(tmp_path, f'<option timestep="0.01"/>{PAIR}')
    duration = found.imported.scene.duration
    for step, count in (
        (duration / MAX_STEPS, 1),
        (2 * duration / MAX_STEPS, 2),
        (0.1 * duration / MAX_STEPS, 1),
    ):
        found.original.opt.timestep = step * (1 + 1e-12)
        runs = original.originals(tmp_path / "m.xml", ImportOptions(), found)
        assert len(runs) == 1 + 3 * count, step


def simulated(tmp_path: Path, family: str, more: str = "", **options: Any) -> original._Original:
    text = f"""<option timestep="0.01" gravity="0 0 0"/><worldbody><body name="a">
    <joint name="A" type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body>
    </worldbody><actuator><motor name="m" joint="A" gear="3"/></actuator>
    <keyframe><key name="k" qpos="0.5" qvel="1" ctrl="4"/></keyframe>{more}"""
    read(tmp_path, text, keyframe="k")
    given = {"file": str(tmp_path / "m.xml"), "import": "--keyframe k", **options}
    from crosscheck.engine import Setting

    return original._Original(mujoco, Setting(family, given))


def test_a_motor_pushes_its_own_joint(tmp_path: Path) -> None:
    """A ball follows on a ball joint. The bias forces of the balls are rounding without weight."""
    text = """<option timestep="0.01" gravity="0 0 0"/><worldbody><body name="a">
    <joint name="A" type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
    <body name="b"><joint type="ball"/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body></body>
    </worldbody><actuator><motor name="m" joint="A" gear="3"/></actuator>
    <keyframe><key name="k" ctrl="4"/></keyframe>"""
    read(tmp_path, text, keyframe="k")
    from crosscheck.engine import Setting

    given = {"file": str(tmp_path / "m.xml"), "import": "--keyframe k"}
    found = original._Original(mujoco, Setting(original.AS_IN_FILE, given))
    assert found.data.qfrc_applied.tolist() == [12.0, 0.0, 0.0, 0.0]


def test_motors_of_a_file_push_along_their_joints(tmp_path: Path) -> None:
    """12 N accelerate 2 kg by 6 m/s² from 0.5 m and 1 m/s."""
    found = simulated(tmp_path, original.AS_IN_FILE)
    assert found.data.qfrc_applied.tolist() == [12.0]
    assert (found.data.qpos.tolist(), found.data.qvel.tolist()) == ([0.5], [1.0])
    left = simulated(tmp_path, original.AS_IN_FILE, **{"import": "--keyframe k --without motors"})
    assert left.data.qfrc_applied.tolist() == [0.0]
    sample = found.sample(0.0)
    assert sample.position.tolist() == [[0.5, 0.0, 0.0]] and sample.velocity.tolist() == [[1.0, 0.0, 0.0]]
    assert sample.acceleration == pytest.approx(np.array([[6.0, 0.0, 0.0]]))
    assert sample.angular_velocity.tolist() == sample.angular_acceleration.tolist() == [[0.0, 0.0, 0.0]]


def test_a_sample_between_steps_is_reached_by_a_copy(tmp_path: Path) -> None:
    """Semi-implicit Euler: v = 1 + 6 t at steps; x grows by v h."""
    found = simulated(tmp_path, original.AS_IN_FILE)
    found.advance(0.0, 0.025)
    assert found.data.time == 0.02 and (found.counts.steps, found.counts.rhs) == (3, 3)
    assert found.data.qvel == pytest.approx([1.12]) and found.between.qvel == pytest.approx([1.15])
    assert found.between.qpos == pytest.approx([0.5 + 0.0106 + 0.0112 + 1.15 * 0.005])
    assert found.model.opt.timestep == 0.01
    found.advance(0.025, 0.03)
    assert found.data.time == 0.03 and found.counts.steps == 4 and found.between.qvel == pytest.approx([1.18])
    assert found.sample(0.03).velocity == pytest.approx(np.array([[1.18, 0.0, 0.0]]))
    rk4 = simulated(tmp_path, original.STIFFER_RK4, step=0.005)
    rk4.advance(0.0, 0.01)
    assert (rk4.counts.steps, rk4.counts.rhs) == (2, 8) and rk4.step == 0.005
    assert rk4.data.qpos == pytest.approx([0.5 + 0.01 + 3e-4])


def test_a_state_of_a_file_that_is_not_finite(tmp_path: Path) -> None:
    for name in ("qpos", "qvel"):
        found = simulated(tmp_path, original.AS_IN_FILE)
        getattr(found.data, name)[0] = math.nan
        with pytest.raises(Failed, match=r"infinite or NaN between 0\.02 s and 0\.02 s") as failed:
            found.advance(0.02, 0.02)
        assert failed.value.outcome is Outcome.NOT_FINITE and failed.value.t == 0.02


def test_stiffer_closures_of_a_file(tmp_path: Path) -> None:
    more = '<equality><joint joint1="A" polycoef="0.5 0 0 0 0"/></equality>'
    plain = simulated(tmp_path, original.FINER, more, step=0.002)
    assert plain.model.eq_solref[0].tolist() == [0.02, 1.0] and plain.step == 0.002
    for family, integrator in ((original.STIFFER, "EULER"), (original.STIFFER_RK4, "RK4")):
        found = simulated(tmp_path, family, more, step=0.002)
        assert found.model.eq_solref[0].tolist() == [0.004, 1.0]
        assert found.model.eq_solimp[0].tolist() == [0.9999, 0.9999, 0.001, 0.5, 2.0]
        assert found.model.opt.integrator == getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
        assert found.settings["step"] == 0.002 and found.settings["solref"] == "0.004 1"


# --- Projection -------------------------------------------------------------------------------------------
SLIDES = """<mujoco><worldbody>
<body><joint name="a" type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
<body><joint name="b" type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="3" diaginertia="1 1 1"/></body>
</worldbody><equality><joint joint1="a" joint2="b" polycoef="0.4 2 0 0 0"/></equality></mujoco>"""


def projected(y: Any, drivers: Any = (), t: float = 0.0) -> np.ndarray:
    model = mujoco.MjModel.from_xml_string(SLIDES)
    data = mujoco.MjData(model)

    def load(t: float, y: np.ndarray) -> None:
        data.time, data.qpos[:], data.qvel[:] = t, y[:2], y[2:]

    return projection.projected(mujoco, model, data, lambda: drivers, t, load, np.array(y))


def test_states_are_moved_by_the_least_kinetic_energy() -> None:
    """a = 0.4 + 2 b, with masses of 1 and 3 kg: a = 1.2/7 and b = -0.8/7; rates (1, 2) lack 3 m/s."""
    found = projected([0.0, 0.0, 1.0, 2.0])
    assert found == pytest.approx([1.2 / 7, -0.8 / 7, 1 + 9 / 7, 2 - 6 / 7])
    assert projected([0.8, 0.2, 2.0, 1.0]) == pytest.approx([0.8, 0.2, 2.0, 1.0], abs=1e-15)


def test_a_driver_moves_the_value_and_the_rate_of_its_row() -> None:
    """The residual a - 0.4 - 2 b is 2 t = 0.7 at 0.35 s, and its rate 2 m/s."""
    found = projected([1.1, 0.0, 2.0, 0.0], [(0, Driver(joint="a", polynomial=(0.0, 2.0)))], 0.35)
    assert found == pytest.approx([1.1, 0.0, 2.0, 0.0])
    found = projected([0.4, 0.0, 0.0, 0.0], [(0, Driver(joint="a", polynomial=(0.0, 2.0)))], 0.35)
    assert found == pytest.approx([0.4 + 0.3, -0.2, 6 / 7, -4 / 7])


def test_states_that_are_not_finite_or_not_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(Failed):
        projected([math.nan, 0.0, 0.0, 0.0], t=0.5)
    monkeypatch.setattr(projection, "ITERATIONS", 1)
    with pytest.raises(Failed, match=r"the closures could not be met at 0\.5 s") as failed:
        projected([0.0, 0.0, 0.0, 0.0], t=0.5)
    assert failed.value.outcome is Outcome.NOT_CONVERGED and failed.value.t == 0.5
    monkeypatch.setattr(projection, "CLOSED_ENOUGH", 0.5)
    assert projected([0.0, 0.0, 0.0, 0.0]) == pytest.approx([1.2 / 7, -0.8 / 7, 0.0, 0.0])
