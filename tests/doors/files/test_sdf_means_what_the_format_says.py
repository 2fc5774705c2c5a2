"""SDF files mean what their format says: frames of equal names, threads, mimic joints, limits, defaults."""

import math
import re

import numpy as np
import pytest

import mbref
from crosscheck.engines.loaders.loader import SDF
from crosscheck.engines.sdf.reading import FORMAT
from crosscheck.files.meaning import meant
from mbref.scene import SceneError

MOMENTS = "<inertia><ixx>0.02</ixx><iyy>0.03</iyy><izz>0.04</izz></inertia>"
INERTIA = f"<inertial><mass>2</mass>{MOMENTS}</inertial>"


def link(name: str, pose: str = "0 0 0 0 0 0", inertia: str = INERTIA) -> str:
    return f"<link name='{name}'><pose>{pose}</pose>{inertia}</link>"


def joint(name, kind, parent, child, axis="0 0 1", more="", inside=""):
    axis = f"<axis><xyz>{axis}</xyz>{inside}</axis>"
    ends = f"<parent>{parent}</parent><child>{child}</child>"
    return f"<joint name='{name}' type='{kind}'>{ends}{more}{axis}</joint>"


def mimics(name: str, ratio: float, offset: float, reference: float) -> str:
    parts = (("multiplier", ratio), ("offset", offset), ("reference", reference))
    return f"<mimic joint='{name}'>{''.join(f'<{tag}>{v}</{tag}>' for tag, v in parts)}</mimic>"


def sdf(*parts: str, version: str = "1.6") -> str:
    return f"<sdf version='{version}'><model name='m'>{''.join(parts)}</model></sdf>"


@pytest.mark.parametrize("name", ["world", "arm", "hand", "__model__"])
def test_a_joint_without_a_pose_is_at_its_child_link_whatever_its_name(files, name):
    """The format places such a joint at its child, here the hand at (0.9, 0.2, 0) m. The joint's name must
    not be taken for a frame ("world", "__model__") or a link ("arm", "hand") of the same name."""
    text = sdf(
        link("arm", "0.5 0 0 0 0 0"),
        link("hand", "0.9 0.2 0 0 0 0"),
        joint("shoulder", "revolute", "world", "arm"),
        joint(name, "revolute", "arm", "hand"),
    )
    scene, _ = files.scene(text, "arm.sdf")
    assert scene.joint_named(name).anchor == (0.9, 0.2, 0.0)
    assert [body.position for body in scene.body] == [(0.5, 0.0, 0.0), (0.9, 0.2, 0.0)]


@pytest.mark.parametrize(
    ("version", "given", "axis"),
    [
        ("1.4", "", (1.0, 0.0, 0.0)),
        ("1.6", "", (0.0, 1.0, 0.0)),
        ("1.6", "<use_parent_model_frame>1</use_parent_model_frame>", (1.0, 0.0, 0.0)),
        ("1.9", "<use_parent_model_frame>1</use_parent_model_frame>", (0.0, 1.0, 0.0)),
    ],
)
def test_an_axis_is_in_the_frame_of_the_model_by_the_rule_of_its_version(files, version, given, axis):
    """Up to version 1.4 an axis is in the model's frame, since then in the joint's, which is here turned by
    π/2 about z. In versions 1.5 and 1.6 use_parent_model_frame selects the model's; later versions have no
    such element, and a note says that it is not read."""
    arm = link("arm", f"0.5 0 0 0 0 {math.pi / 2!r}")
    shoulder = joint("shoulder", "revolute", "world", "arm", "1 0 0", inside=given)
    scene, notes = files.scene(sdf(arm, shoulder, version=version), "arm.sdf")
    assert scene.joint_named("shoulder").axis == pytest.approx(axis, abs=1e-14)  # π/2 is rounded
    assert ("<use_parent_model_frame> of an axis: is not read" in notes) == (version == "1.9")


@pytest.mark.parametrize(
    ("more", "metres_a_turn"),
    [
        ("<thread_pitch>50</thread_pitch>", -2 * math.pi / 50),
        ("<screw_thread_pitch>0.03</screw_thread_pitch>", 0.03),
        ("<thread_pitch>50</thread_pitch><screw_thread_pitch>-0.03</screw_thread_pitch>", -0.03),
        ("", 1.0),
    ],
)
def test_a_screw_moves_by_its_pitch_a_turn(files, more, metres_a_turn):
    """libsdformat: thread_pitch p moves by -2π / p m a turn, screw_thread_pitch prevails; 1 m by default."""
    scene, _ = files.scene(sdf(link("nut"), joint("s", "screw", "world", "nut", more=more)), "screw.sdf")
    motion = mbref.simulate(scene.with_(gravity=(0.0, 0.0, -9.81)), times=[0.0, 0.3])
    turned, moved = motion.joint("s").angle[-1], motion["nut"].position[-1][2]
    assert abs(turned) > 1e-2
    assert moved == pytest.approx(metres_a_turn * turned / (2 * math.pi), rel=1e-9)  # rtol of the run


def pair(mimic: str, inertia: str = INERTIA) -> str:
    """Return a file of two links on hinges, lead and follow, of which the second has a mimic element."""
    joints = joint("lead", "revolute", "world", "a"), joint("follow", "revolute", "world", "b", inside=mimic)
    return sdf(link("a", inertia=inertia), link("b", "1 0 0 0 0 0", inertia), *joints)


def test_joints_of_a_mimic_with_an_offset_start_at_angles_that_obey_it(files):
    """The format: follower = multiplier (leader - reference) + offset, here -1.5 (q + 0.4) + 0.2, in rad."""
    arm = "<inertial><pose>0.2 0 0 0 0 0</pose><mass>1</mass></inertial>"
    scene, out = files.scene(pair(mimics("lead", -1.5, 0.2, -0.4), arm), "pair.sdf")
    assert "follow mimics lead with an offset of -0.4" in out
    start = mbref.assembled(scene)
    angles = [2 * math.atan2(body.orientation[3], body.orientation[0]) for body in start.body]
    assert angles[1] == pytest.approx(-1.5 * (angles[0] + 0.4) + 0.2, abs=1e-12)  # rad
    assert max(map(abs, angles)) > 0.1


@pytest.mark.parametrize(
    ("ratio", "reference", "offset"), [(3, 0.1, 0.3), (0.1, 0.7, 0.07), (-1.1, 1.1, -1.21)]
)
def test_an_offset_of_a_mimic_joint_that_is_only_rounding_is_exactly_zero(files, ratio, reference, offset):
    """offset - ratio · reference is zero in decimals, as 0.3 - 3 · 0.1 is, and a rounding in binary."""
    scene, _ = files.scene(pair(mimics("lead", ratio, offset, reference)), "pair.sdf")
    assert scene.coupling[0].offset == 0.0


def test_a_mimic_of_an_axis_without_xyz_names_a_joint_of_its_model(files):
    """The axis has the format's default, z, here in the frame of the model up to version 1.4. The world has
    two models, so that names begin with the model's."""
    follow = "<mimic joint='lead'><multiplier>3</multiplier></mimic>"
    joints = [
        f"<joint name='{name}' type='revolute'><parent>world</parent><child>{child}</child>{axis}</joint>"
        for name, child, axis in (("lead", "a", ""), ("follow", "b", f"<axis>{follow}</axis>"))
    ]
    links = link("a"), link("b", f"1 0 0 {math.pi / 2!r} 0 0")
    models = f"<model name='m'>{''.join((*links, *joints))}</model><model name='n'>{link('c')}</model>"
    text = f"<sdf version='1.4'><world name='w'>{models}</world></sdf>"
    scene, _ = files.scene(text, "two.sdf")
    assert scene.coupling[0].joints == ("m::lead", "m::follow") and scene.coupling[0].ratio == 3.0
    assert scene.joint_named("m::follow").axis == pytest.approx((0.0, 0.0, 1.0), abs=1e-14)


def test_a_model_may_stand_in_a_frame_of_the_world_with_the_name_of_its_link(files):
    """Frames of the world and links of a model are different scopes of names."""
    frame = "<frame name='base'><pose>1 2 3 0 0 0</pose></frame>"
    inside = link("base") + joint("pivot", "revolute", "world", "base")
    model = f"<model name='m'><pose relative_to='base'>0 0 1 0 0 0</pose>{inside}</model>"
    text = f"<sdf version='1.9'><world name='w'>{frame}{model}</world></sdf>"
    scene, _ = files.scene(text, "placed.sdf")
    assert [body.position for body in scene.body] == [(1.0, 2.0, 4.0)]


def hanging(limit: str, kind: str = "revolute") -> str:
    """A body that gravity turns about y towards larger angles, or that falls along -z."""
    axis, at = ("0 1 0", "0.3 0 0 0 0 0") if kind == "revolute" else ("0 0 1", "0 0 0 0 0 0")
    body = f"<inertial><pose>{at}</pose><mass>1</mass></inertial>"
    held = joint("j", kind, "world", "a", axis, inside=f"<limit>{limit}</limit>")
    return sdf(link("a", inertia=body), held)


@pytest.mark.parametrize(
    ("limit", "kind"),
    [
        ("<lower>0</lower><upper>1</upper>", "revolute"),
        ("<lower>-1</lower><upper>0</upper>", "prismatic"),
        ("<lower>-inf</lower><upper>inf</upper>", "revolute"),
        ("<lower>-1e16</lower><upper>1e16</upper>", "prismatic"),
    ],
    ids=["turns away from the lower", "falls away from the upper", "infinite", "default"],
)
def test_a_limit_that_does_not_act_at_the_start_is_left_out_with_a_remark(files, limit, kind):
    """Joints start at 0, and the body falls to larger angles or smaller displacements, away from a limit at
    0. Infinite limits and ±1e16, SDF's default, never act."""
    assert "1 limit of a joint" in files.scene(hanging(limit, kind), "a.sdf")[1]


@pytest.mark.parametrize(
    ("limit", "kind"),
    [
        ("<lower>-1</lower><upper>0</upper>", "revolute"),
        ("<lower>0</lower><upper>1</upper>", "prismatic"),
        ("<lower>0.1</lower><upper>1</upper>", "revolute"),
        ("<lower>0</lower><upper>0</upper>", "revolute"),
    ],
    ids=["falls beyond the upper", "falls beyond the lower", "starts beyond the lower", "no range"],
)
def test_a_limit_that_acts_at_the_start_is_refused_or_left_out_on_request(files, limit, kind):
    """A joint starts at 0, and gravity turns the revolute one to larger values and moves the prismatic one to
    smaller ones: against a limit at 0. A start beyond a limit violates it, whatever the motion."""
    text = hanging(limit, kind)
    assert "limit of joint 'j', which acts at the start" in files.refusal(text, "a.sdf")
    assert "(--without limits)" in files.scene(text, "a.sdf", "--without", "limits")[1]


def test_elements_that_are_not_read_are_listed_with_their_part(files):
    """<hovers> is no element of the format; <physics> has options of another solver."""
    solver = "<physics><ode><cfm_damping>1</cfm_damping></ode></physics>"
    arm = link("a").replace("<inertial>", "<hovers>1</hovers><inertial>")
    _, out = files.scene(sdf(arm, joint("j", "revolute", "world", "a", more=solver)), "a.sdf")
    assert "left out: <hovers> of link 'a': is not read" in out
    assert "left out: <physics> of joint 'j': is not read" in out


def test_a_chain_of_2000_frames_is_followed_to_its_end(files):
    """Each frame is 1 mm from the next one: the link is at 2 m."""
    frame = "<frame name='f{}'><pose relative_to='f{}'>0.001 0 0 0 0 0</pose></frame>"
    frames = ["<frame name='f2000'/>", *(frame.format(k, k + 1) for k in range(2000))]
    arm = "<link name='a'><pose relative_to='f0'/></link>"
    text = sdf(*frames, arm, joint("j", "revolute", "world", "a"), version="1.9")
    scene, _ = files.scene(text, "far.sdf")
    rounding = 2000 * 2.2e-16 * 2.0  # m: 2000 sums of up to 2 m
    assert np.allclose(scene.body[0].position, [2.0, 0.0, 0.0], rtol=0, atol=rounding)


def test_links_without_inertial_and_worlds_without_gravity_get_sdf_s_defaults(files):
    """The format's defaults: 1 kg and 1 kg m² about each axis; 9.8 m/s² downwards. Notes state gravity, and a
    link without the element ``inertial``."""
    links = link("b", inertia=""), link("c", inertia="<inertial/>")
    bare = sdf(*links, link("d", inertia="<inertial><inertia/></inertial>"))
    scene, said = files.scene(bare, "bare.sdf")
    assert [(body.mass, body.inertia) for body in scene.body] == [(1.0, (1.0, 1.0, 1.0))] * 3
    assert re.findall("link '.' has no inertial", said) == ["link 'b' has no inertial"]
    assert "link 'b' has no inertial: 1 kg and 1 kg m², the defaults of SDF" in said
    assert "gravity is 9.8 m/s² downwards, the default of SDF" in said and scene.gravity == (0.0, 0.0, -9.8)


@pytest.mark.parametrize(("version", "gravity"), [("1.4", -1.6), ("1.5", -1.6), ("1.6", -9.8)])
def test_gravity_of_the_physics_counts_before_sdf_1_6_in_the_import_and_in_every_reader(
    files, version, gravity
):
    """Version 1.6 moved the element to the world, whose default is 9.8 m/s² downwards."""
    text = f"<physics><gravity>0 0 -1.6</gravity></physics><model name='m'>{link('b')}</model>"
    scene, said = files.scene(f"<sdf version='{version}'><world name='w'>{text}</world></sdf>", "moon.sdf")
    assert scene.gravity == meant(files.folder / "moon.sdf", SDF).gravity == (0.0, 0.0, gravity)
    assert ("of a physics: is not read" in said) == (gravity == -9.8)


@pytest.mark.parametrize(
    ("old", "new", "kind", "sentence"),
    [
        ("</inertial>", "<fluid_added_mass/></inertial>", "fluid", "the added mass of link 'b' in a fluid"),
        ("</link>", "<gravity>false</gravity></link>", "gravity-compensation", "link 'b' without weight"),
        ("</link>", "<gravity>0</gravity></link>", "gravity-compensation", "link 'b' without weight"),
        ("</link>", "<velocity_decay/></link>", "damping", "velocity_decay of link 'b'"),
        ("</link>", "<kinematic>1</kinematic></link>", "kinematic-links", "kinematic link 'b'"),
        (
            "</axis>",
            "<initial_position>1</initial_position></axis>",
            "start",
            "initial position of joint 'j'",
        ),
    ],
)
def test_link_element_that_changes_the_motion_is_refused_or_left_out(files, old, new, kind, sentence):
    """The error and the list of what is left out name the element, the link and the option ``--without``."""
    text = sdf(link("b"), joint("j", "revolute", "world", "b")).replace(old, new)
    says = f"{sentence}: it changes the motion; --without {kind} leaves it out"
    assert says in files.refusal(text, "b.sdf")
    assert f"left out: {sentence} (--without {kind})" in files.scene(text, "b.sdf", "--without", kind)[1]


STATE = '<state world_name="w"/>'


@pytest.mark.parametrize("blown", [0, 1])
def test_state_and_wind_of_a_world_are_refused_if_they_change_the_motion(files, blown):
    """Wind blows on links with ``enable_wind``; the state has poses and velocities of the models."""
    parts = f"<wind><linear_velocity>0 3 0</linear_velocity></wind>{STATE * blown}"
    model = f"<model name='m'><enable_wind>{blown}</enable_wind>{link('b')}</model>"
    text = f"<sdf version='1.9'><world name='w'>{parts}{model}</world></sdf>"
    said = files.scene(text, "w.sdf", *("--without", "fluid,start")[: 2 * blown])[1]
    assert ("state of world 'w'" in said, "wind at link 'b'" in said) == (blown, blown)
    assert not blown or "wind at link 'b'" in files.refusal(text, "w.sdf", "--without", "start")


SPRUNG = (
    "<dynamics><damping>0.5</damping><friction>0</friction><spring_reference>0.25</spring_reference>"
    "<spring_stiffness>3</spring_stiffness></dynamics>"
)


def test_friction_of_a_hinge_is_refused_or_left_out_and_its_spring_stays(files):
    """The hinge has dry friction 7 N m and a spring of 3 N m/rad."""
    rough = SPRUNG.replace("<friction>0", "<friction>7")
    text = sdf(link("b"), joint("j", "revolute", "world", "b", inside=rough))
    assert "dry friction of joint 'j': it changes the motion" in files.refusal(text, "b.sdf")
    scene, said = files.scene(text, "b.sdf", "--without", "friction")
    assert (
        said.count("left out: ")
        == said.count("left out: dry friction of joint 'j' (--without friction)")
        == 1
    )
    assert [(load.type, load.stiffness) for load in scene.load] == [("torsion_spring", 3.0)]


def test_damping_of_a_ball_joint_is_read_and_its_spring_is_refused_by_name(files):
    """A scene has dampers of ball joints, here 0.5 N m s/rad, but no springs."""
    text = sdf(link("b"), joint("j", "ball", "world", "b", inside=SPRUNG))
    assert re.findall("^[^:]* of joint 'j'", files.refusal(text, "b.sdf"), re.M) == ["springs of joint 'j'"]
    [load] = files.scene(text, "b.sdf", "--without", "springs")[0].load
    assert (load.type, load.bodies, load.damping) == ("rotational_damper", ("ground", "b"), 0.5)


def test_export_of_sdf_is_refused_with_a_format_that_works(files):
    """Scenes are read from SDF but not written; MJCF (.xml) is named instead."""
    with pytest.raises(SceneError, match=r"SDF: is read only; export as \.xml"):
        FORMAT.write(files.scene(sdf(link("b")), "b.sdf")[0])
