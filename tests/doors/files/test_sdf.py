"""SDF files against the scenes that they were written from, with links and joints in frames of their own."""

import numpy as np
import pytest

from crosscheck.conformance.mechanisms.random_mechanisms import random_mechanism
from crosscheck.engines.sdf.reading import FORMAT
from crosscheck.judge.constraints import closure, inertia_matrices, initial_poses
from crosscheck.judge.gauss_principle import gauss, rank
from mbref import rotations
from mbref.formats import ImportOptions
from mbref.scene import GROUND, SceneError

NAMES = {kind: kind for kind in ("revolute", "universal", "fixed")}  # of a scene's joints in SDF
NAMES |= {"spherical": "ball", "translational": "prismatic"}
ROUNDED = 1e-12  # m: some roundings of frames within 1 m


def roll_pitch_yaw(turn) -> list[float]:
    roll, yaw = np.arctan2(turn[2, 1], turn[2, 2]), np.arctan2(turn[1, 0], turn[0, 0])
    return [roll, np.arcsin(np.clip(-turn[2, 0], -1, 1)), yaw]


def pose_text(base, inner, more: str = "") -> str:
    """The pose of a frame in another one, both (position, turn) in the world."""
    place, turn = base[1].T @ (inner[0] - base[0]), base[1].T @ inner[1]
    values = " ".join(repr(float(v)) for v in (*place, *roll_pitch_yaw(turn)))
    return f"<pose{more}>{values}</pose>"


def random_frame(random):
    q = random.normal(size=4)
    return random.normal(size=3) * 0.3, rotations.to_matrix(q / np.linalg.norm(q))


def written(scene, random, nested: bool = False) -> str:
    """A scene as SDF: random frames of the model, of links, of joints, of inertias and of an outer model."""
    model, world = random_frame(random), (np.zeros(3), np.eye(3))
    outer = random_frame(random) if nested else world
    frame, text = {}, ""
    for body in scene.body:
        frame[body.name] = random_frame(random)
        text += f'<frame name="of {body.name}">{pose_text(model, frame[body.name])}</frame>'
    for body, inertia in zip(scene.body, inertia_matrices(scene), strict=True):
        link, centre = frame[body.name], (np.array(body.position), random_frame(random)[1])
        turn = centre[1].T @ rotations.to_matrix(np.array(body.orientation))
        own = turn @ inertia @ turn.T
        named = {"xyz"[i] + "xyz"[j]: float(own[i, j]) for i in range(3) for j in range(i, 3)}
        entries = "".join(f"<i{axes}>{number!r}</i{axes}>" for axes, number in named.items())
        place = pose_text(frame[body.name], link, f' relative_to="of {body.name}"')
        text += (
            f'<link name="{body.name}">{place}<inertial>{pose_text(link, centre)}<mass>{body.mass!r}</mass>'
            f"<inertia>{entries}</inertia></inertial></link>"
        )
    for joint in scene.joint:
        first, second = (name.replace(GROUND, "world") for name in joint.bodies)
        at = np.array(joint.anchor_pair[0]), random_frame(random)[1]
        child = world if second == "world" else frame[second]
        others = [("", child), (' relative_to="__model__"', model)]
        others += [(f' relative_to="{first}"', frame[first])] if first in frame else []
        more, base = others[int(random.integers(len(others)))]
        axes = ""
        for tag, axis in zip(("axis", "axis2"), joint.directions, strict=False):
            expressed, turn = [("", at[1]), (' expressed_in="__model__"', model[1])][int(random.integers(2))]
            xyz = " ".join(repr(float(v)) for v in turn.T @ np.array(axis))
            axes += f"<{tag}><xyz{expressed}>{xyz}</xyz></{tag}>"
        text += (
            f'<joint name="{joint.name}" type="{NAMES[joint.type]}"><parent>{first}</parent>'
            f"<child>{second}</child>{pose_text(base, at, more)}{axes}</joint>"
        )
    gravity = " ".join(map(repr, scene.gravity))
    text = f'<model name="m">{pose_text(outer, model)}{text}</model>'
    if nested:
        text = f'<model name="outer">{pose_text(world, outer)}{text}</model>'
    return f'<sdf version="1.9"><world name="w"><gravity>{gravity}</gravity>{text}</world></sdf>'


def at_rest(scene):
    still = {"velocity": None, "angular_velocity": None}
    return scene.with_(body=[body.model_copy(update=still) for body in scene.body])


def read(tmp_path, text: str, **options):
    path = tmp_path / "model.sdf"
    path.write_text(text)
    return FORMAT.read(path, ImportOptions(**options))


def assert_is_the_same_mechanism(scene, found) -> None:
    """Types of joints and rank are equal; centres, anchors (m) and accelerations by Gauss's principle (of the
    largest) are equal to rounding, and joints are closed (m)."""
    assert [joint.type for joint in found.joint] == [joint.type for joint in scene.joint]
    assert rank(found) == rank(scene)
    places = [
        np.array([*(b.position for b in each.body), *(x for j in each.joint for x in j.anchor_pair)])
        for each in (scene, found)
    ]
    open_by = max(np.abs(rows).max() for rows in closure(found, 0.0, *initial_poses(found)).values())
    assert max(np.abs(places[0] - places[1]).max(), open_by) < ROUNDED
    assert np.abs(gauss(found) - gauss(scene)).max() / np.abs(gauss(scene)).max() < 1000 * ROUNDED


def random_scene(seed: int):
    """A random mechanism of the joints of SDF, without loads."""
    scene = at_rest(random_mechanism(seed))
    kept, none = [joint for joint in scene.joint if joint.type in NAMES], {"armature": 0.0}
    joints = [j.model_copy(update=none if getattr(j, "armature", 0.0) else {}) for j in kept]
    return scene.with_(joint=joints, load=(), driver=(), coupling=(), gravity=(0.5, 1.0, -9.0))


@pytest.mark.parametrize(
    "seeds", [range(5), pytest.param(range(5, 105), marks=pytest.mark.slow)], ids=["few", "many"]
)
def test_random_mechanisms_return_from_sdf_in_random_frames(seeds, tmp_path):
    """Read again, alone and nested in another model, random mechanisms, most of them with three joints or
    more, have the same joints and rank, places to 1e-12 m and accelerations to 1e-9 of the largest."""
    scenes = [random_scene(seed) for seed in seeds]
    assert sum(len(scene.joint) > 2 for scene in scenes) > len(scenes) / 2
    for seed, scene in zip(seeds, scenes, strict=True):
        random = np.random.default_rng(seed)
        for nested in (False, True):
            assert_is_the_same_mechanism(scene, read(tmp_path, written(scene, random, nested)).scene)


LINK = """<link name="{name}"><pose>{pose}</pose><inertial><pose>{centre} 0 0 0</pose><mass>0.5</mass>
<inertia><ixx>0.002</ixx><iyy>0.003</iyy><izz>0.004</izz></inertia></inertial></link>"""
HINGE = """<joint name="{name}" type="{kind}"><parent>{parent}</parent><child>{child}</child>
<axis><xyz>0 1 0</xyz>{more}</axis></joint>"""


def pair(joint: str = "") -> str:
    """Return a file of two links, a on hinge A of the world and b on hinge B of a, and a further element."""
    links = LINK.format(name="a", pose="0 0 1 0 0 0", centre="0.1 0 0")
    links += LINK.format(name="b", pose="0.3 0 1 0 0 0", centre="0.1 0 0")
    first = HINGE.format(name="A", kind="revolute", parent="world", child="a", more="")
    second = HINGE.format(name="B", kind="revolute", parent="a", child="b", more="")
    return f'<sdf version="1.7"><model name="m">{links}{first}{second}{joint}</model></sdf>'


A_AT, A_TO_B = "<pose>0 0 1 0 0 0<", "<parent>a</parent><child>b</child>"  # link a; ends of joint B
B_IS, B_AXIS = 'name="B" type="revolute">', "<child>b</child>\n<axis><xyz>0 1 0</xyz>"
FAULTS = [  # text of `pair`, the text in its place, the error's words
    ("</sdf>", "", "is no XML"),
    (B_IS, 'name="B" type="gear">', "joint 'B': type 'gear' is none of"),
    (B_IS, 'name="B" type="gearbox">', "joint 'B': a gearbox needs gearbox_reference_body"),
    (B_IS, 'name="B" type="screw"><thread_pitch>0</thread_pitch>', "thread_pitch must not be 0"),
    (
        B_AXIS,
        f'{B_AXIS}<mimic joint="A"><multiplier>0</multiplier></mimic>',
        "mimic multiplier must not be 0",
    ),
    (A_TO_B, A_TO_B.replace(">a<", ">c<"), "joint 'B': the file has no link or frame 'c'"),
    (A_AT, A_AT.replace("<pose", '<pose relative_to="q"'), "frame 'q': the model has"),
    (A_AT, A_AT.replace("<pose", '<pose relative_to="a"'), "relative to itself, by a → a"),
    (A_AT, A_AT.replace("<pose", '<pose rotation_format="axis"'), "rotation_format 'axis' is none"),
    (A_AT, "<pose>0 0 1<", "link 'a': pose: must be 6 numbers, got '0 0 1'"),
    (
        "</model>",
        "<include><uri>model://x</uri></include></model>",
        "include 'model://x': is none of .*/x, .*/x",
    ),
    ("</model>", "<include><uri>https://x.org/y</uri></include></model>", "download the model first"),
    ("</model>", "<include><uri>model.sdf</uri></include></model>", "model.sdf includes itself"),
    (
        "</model>",
        "<include merge='1'><uri>x</uri></include></model>",
        "include 'x': merge='true' is not read",
    ),
    ("</model>", "<include><uri>x</uri><x:params/></include></model>", "'x': experimental:params"),
    (A_TO_B, "<child>b</child>", "joint 'B': names no parent"),
    (A_TO_B, A_TO_B.replace(">b<", ">a<"), "joint 'B': both sides are on link 'a'"),
    ("<mass>0.5<", "<mass>0<", "link 'a': mass must be positive, got 0"),
    ("<inertial>", '<inertial auto="true">', "link 'a': inertial auto='true' is not read"),
    ('name="m"', 'name="m" placement_frame="a"', "model 'm': has a placement_frame"),
    ("1.7", "new", "version 'new': is no version of SDF"),
    (A_AT, A_AT.replace("<pose", '<pose frame="b"'), "link 'a': pose frame='b' has no meaning in SDF 1.5"),
]


@pytest.mark.parametrize(("old", "new", "says"), FAULTS, ids=[says for *_, says in FAULTS])
def test_faulty_sdf_is_refused_with_the_element_s_name(old, new, says, tmp_path):
    """A file of links a, b on hinges A, B with one faulty text; the error names element and fault."""
    assert old in pair()
    with pytest.raises(SceneError, match=says.replace("(", r"\(")):
        read(tmp_path, pair().replace(old, new))


STATIC = "<model name='f'><static>1</static><link name='p'/></model>"


@pytest.mark.parametrize(("model", "says"), [("", "has no model"), (STATIC, "has no body that moves")])
def test_sdf_without_a_moving_body_is_refused(model, says, tmp_path):
    """A world without a model, or with a static one."""
    with pytest.raises(SceneError, match=says):
        read(tmp_path, f"<sdf version='1.7'><world name='w'>{model}</world></sdf>")


@pytest.mark.parametrize(
    ("beside", "says"),
    [
        ("<world name='v'><gravity>0 0 -1</gravity><model name='n'/></world>", "world 'v' beside world 'w'"),
        ("<model name='n'><link name='c'/></model>", "has model 'n' beside world 'w'"),
    ],
)
def test_sdf_with_parts_beside_its_world_is_refused_with_their_names(beside, says, tmp_path):
    """One of two worlds would be left out, with its gravity."""
    world = "<world name='w'><model name='m'><link name='a'/></model></world>"
    for text in (world + beside, beside + world):
        with pytest.raises(SceneError, match="beside world") as caught:
            read(tmp_path, f"<sdf version='1.7'>{text}</sdf>")
        assert says in str(caught.value) or "has world 'w' beside world 'v'" in str(caught.value)


def test_keyframe_of_an_sdf_file_is_refused(tmp_path):
    """SDF has no keyframes: option ``--keyframe`` is an error that says where poses are."""
    with pytest.raises(SceneError, match="an SDF file gives the poses"):
        read(tmp_path, pair(), keyframe="home")


def test_joint_of_the_world_connects_two_models_in_a_world_frame(tmp_path):
    """Frame f is 5 m along y; models p and q are 1 m and 2 m from it along x. Each has a link a, 1 m above
    the model, with its centre 0.1 m along x. The hinge joins both links at the link of q."""
    link = LINK.format(name="a", pose="0 0 1 0 0 0", centre="0.1 0 0")
    poses = {name: f'<pose relative_to="f">{x} 0 0 0 0 0</pose>' for name, x in (("p", 1), ("q", 2))}
    models = [f'<model name="{name}">{pose}{link}</model>' for name, pose in poses.items()]
    frame = '<frame name="f"><pose>0 5 0 0 0 0</pose></frame>'
    joint = HINGE.format(name="J", kind="revolute", parent="p::a", child="q::a", more="")
    text = f'<sdf version="1.10"><world name="w">{frame}{"".join(models)}{joint}</world></sdf>'
    scene = read(tmp_path, text).scene
    assert scene.joint[0].bodies == ("p::a", "q::a") and np.allclose(scene.joint[0].anchor, (2, 5, 1))
    assert np.allclose(scene.body[0].position, (1.1, 5, 1))


def test_link_named_ground_is_renamed(tmp_path):
    """ "ground" is the fixed body of every scene; the link becomes "link ground", also in its joints."""
    scene = read(tmp_path, pair().replace('"a"', '"ground"').replace(">a<", ">ground<")).scene
    assert [body.name for body in scene.body] == ["link ground", "b"]
    assert scene.joint_named("B").bodies == ("link ground", "b")
