"""MJCF: limits that act at the start, couplings and armature, and loops of any size."""

import re

import numpy as np
import pytest

import mbref

LIMITED = """<mujoco><compiler angle="radian"/><worldbody>
<body name="bob" pos="0 0 1"><joint name="s" type="slide" axis="0 0 1" {joint}/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><site name="eye"/></body>
<site name="hook" pos="0 0 1.5"/></worldbody>
<tendon><spatial name="rope" {tendon}><site site="hook"/><site site="eye"/></spatial></tendon>
<keyframe><key name="up" qvel="1"/><key name="down" qvel="-1"/></keyframe></mujoco>"""


@pytest.mark.parametrize(
    ("joint", "tendon", "key", "name"),
    [
        ("", "range='0 0.5'", "", "tendon 'rope'"),
        ("", "range='0 0.5'", "down", "tendon 'rope'"),
        ("", "range='0 0.4'", "up", "tendon 'rope'"),
        ("range='0 1'", "", "", "joint 's'"),
        ("range='-1 0'", "", "up", "joint 's'"),
        ("range='0.1 1'", "", "up", "joint 's'"),
        ("range='-0.1 1' margin='0.2'", "", "up", "joint 's'"),
    ],
    ids=[
        *("gravity lengthens the rope", "speed lengthens the rope", "rope too long, speed shortens it"),
        *("gravity lowers the slide", "speed raises the slide", "slide too low, speed raises it"),
        "slide within the margin, in which MuJoCo's limit pushes",
    ],
)
def test_a_limit_that_acts_at_the_start_is_refused_or_left_out_on_request(files, joint, tendon, key, name):
    """The slide is at 0 m and the rope 0.5 m long. Gravity from rest, or the keyframe "down", lowers the
    slide and lengthens the rope; the keyframe "up" does the opposite. A limit acts if the start is at it and
    the motion goes beyond it, or if the start is beyond it, whatever the motion. ``name`` is its part."""
    text, words = LIMITED.format(joint=joint, tendon=tendon), ("--keyframe", key) if key else ()
    said = files.refusal(text, "a.xml", *words)
    assert f"limit of {name}, which acts at the start" in said and "--without limits" in said
    assert "(--without limits)" in files.scene(text, "a.xml", *words, "--without", "limits")[1]


@pytest.mark.parametrize(("flag", "left"), [("spring", (0.0, 3.0)), ("damper", (2.0, 0.0))])
def test_a_switch_of_a_file_turns_off_springs_or_dampers_of_tendons(files, flag, left):
    """By MuJoCo's reference <flag> disables springs (2 N/m) or dampers (3 N s/m), also of tendons."""
    text = LIMITED.format(joint="", tendon="stiffness='2' damping='3'")
    text = text.replace("<worldbody>", f"<option><flag {flag}='disable'/></option><worldbody>")
    [load] = files.scene(text, "a.xml")[0].load
    assert (load.stiffness, load.damping) == left


def test_a_tendon_spring_between_sites_of_one_body_is_left_out_with_a_note(files):
    """Its forces on the body cancel."""
    text = LIMITED.format(joint="", tendon="stiffness='2'").replace('site="hook"', 'site="nose"')
    text = text.replace("</body>", "<site name='nose' pos='1 0 0'/></body>")
    scene, out = files.scene(text, "a.xml")
    assert not scene.load and "tendon 'rope': both sites are on 'bob'" in out


def test_a_body_that_begins_asleep_is_refused_unless_its_sleep_is_left_out(files):
    """MuJoCo does not move it. The speed of the keyframe "up" wakes it."""
    text = LIMITED.format(joint="", tendon="").replace('name="bob"', 'name="bob" sleep="init"')
    text = text.replace("<worldbody>", "<option><flag sleep='enable'/></option><worldbody>")
    assert "sleep of bob: it changes the motion; --without sleep" in files.refusal(text, "a.xml")
    assert "(--without sleep)" in files.scene(text, "a.xml", "--without", "sleep")[1]
    assert "(--without sleep)" not in files.scene(text, "a.xml", "--keyframe", "up")[1]


FOLDING = """<mujoco><worldbody><body name="crank"><joint name="A" axis="0 1 0"/>
<inertial pos="0.5 0 0" mass="1" diaginertia="1 1 1"/>
<body name="rod" pos="1 0 0"><joint name="B" axis="0 1 0"/>
<inertial pos="0 0 0.5" mass="1" diaginertia="1 1 1"/></body></body></worldbody>
<equality><connect name="C" body1="rod" body2="world" anchor="0 0 1"/></equality>
<keyframe><key name="turning" qvel="2 0"/><key name="still"/></keyframe></mujoco>"""


def test_velocities_of_a_keyframe_that_violate_a_loop_are_changed_with_a_note(files):
    """Crank, rod and ground are a triangle, which is rigid: 2 rad/s of its hinge become 0."""
    scene, out = files.scene(FOLDING, "a.xml", "--keyframe", "turning")
    assert np.allclose([[*body.velocity, *body.angular_velocity] for body in scene.body], 0.0, atol=1e-12)
    assert "velocities of keyframe 'turning' violate the loops" in out and "differ by up to 2 m/s" in out
    assert "violate the loops" not in files.scene(FOLDING, "b.xml", "--keyframe", "still")[1]


@pytest.mark.parametrize(
    ("joint", "tendon", "key"),
    [
        ("", "range='0 0.5'", "up"),
        ("", "range='0 0.6'", ""),
        ("range='0 1'", "", "up"),
        ("range='-1 0'", "", ""),
        ("range='0 1' limited='false'", "", ""),
    ],
    ids=["rope shortens", "rope within", "slide rises", "slide falls", "switched off"],
)
def test_a_file_whose_limits_do_not_act_at_the_start_is_imported(files, joint, tendon, key):
    """The start is at the limit and the motion leaves it, the start is within it, or it is switched off."""
    text, words = LIMITED.format(joint=joint, tendon=tendon), ("--keyframe", key) if key else ()
    scene, out = files.scene(text, "a.xml", *words)
    assert [body.name for body in scene.body] == ["bob"] and "(--without limits)" not in out


COUPLED = """<mujoco><compiler angle="radian"/><worldbody>
<body name="a"><joint name="ja" axis="0 1 0" armature="0.2"/><geom size=".1" mass="1" pos=".3 0 0"/></body>
<body name="b" pos="1 0 0"><joint name="jb" axis="0 1 0"/><geom size=".1" mass="2" pos=".3 0 0"/></body>
<body name="c" pos="2 0 0"><joint name="jc" axis="0 1 0"/><geom size=".1" mass="1" pos=".3 0 0"/>
<body name="d" pos="1 0 0"><joint name="jd" type="ball" armature="0.3" stiffness="2" damping="0.5"/>
<geom size=".1" mass="1" pos=".3 0 0"/></body></body>
</worldbody><equality><joint name="line" joint1="jb" joint2="ja" polycoef="0 -3 0 0 0"/>
<tendon name="curve" tendon1="tc" tendon2="ta" polycoef="0 1 2 0 0"/></equality>
<tendon><fixed name="tc"><joint joint="jc" coef="1"/></fixed>
<fixed name="ta"><joint joint="ja" coef="1"/></fixed></tendon></mujoco>"""


@pytest.mark.parametrize("kinds", ["couplings,armature,springs,damping", "everything"])
def test_without_leaves_out_and_names_only_parts_that_a_scene_cannot_have(files, kinds):
    """A scene can have the coupling "line" of joints and the armature of the hinge ja: they stay, although
    --without names their kinds, as does the damping of the ball joint jd. It cannot have the quadratic
    coupling "curve" of tendons, nor armature and stiffness of jd: they are left out and listed. If --without
    names couplings and armature alone, the file is refused for stiffness."""
    said = files.refusal(COUPLED, "a.xml", "--without", "couplings,armature")
    assert re.findall(r"^(\w+) of joint 'jd'", said, re.M) == ["stiffness"] and "curve" not in said
    scene, out = files.scene(COUPLED, "a.xml", "--without", kinds)
    assert [(c.name, c.ratio) for c in scene.coupling] == [("line", -3.0)]
    assert {joint.name: joint.reflected_inertia for joint in scene.joint}["ja"] == 0.2
    left = re.findall(r"left out: (\w+) .*?'(\w+)'.* \(--without", out)
    assert sorted(left) == [("armature", "jd"), ("equality", "curve"), ("stiffness", "jd")]
    assert [(load.type, load.damping) for load in scene.load] == [("rotational_damper", 0.5)]


def two_cranks(size: float, tilt: float = 0.0, rod: float = 1.1) -> str:
    """Return two cranks of a length ``size`` (m) with pivots as far apart, and a rod of ``rod`` lengths
    between them. All hinges are about z, except for a tilt (rad) of the rod's hinge."""
    s, inertia = size, size * size * 0.01
    mass = f"mass='1' diaginertia='{inertia} {inertia} {inertia}'"
    return f"""<mujoco><compiler angle="radian"/><worldbody>
<body name="a"><joint name="ja" axis="0 0 1"/><inertial pos="0 {s / 2} 0" {mass}/>
<body name="c" pos="0 {s} 0" euler="{tilt} 0 0"><joint name="jc" axis="0 0 1"/>
<inertial pos="{s / 2} 0 0" {mass}/>
<site name="ec" pos="{rod * s} 0 0"/></body></body>
<body name="b" pos="{s} 0 0"><joint name="jb" axis="0 0 1"/><inertial pos="0 {s / 2} 0" {mass}/>
<site name="eb" pos="0 {s} 0"/></body></worldbody>
<equality><connect name="tie" site1="ec" site2="eb"/></equality></mujoco>"""


def test_an_open_loop_is_closed_alike_at_every_size(files):
    """The first crank, of length s, keeps the given angle of 0.6 rad: its middle is at s / 2 (-sin, cos). The
    search ends at errors of 1e-9 of the length s. All places over s are equal at every size, to ten times
    this error. One degree of freedom remains."""
    found = []
    for size in (1e-4, 1e-2, 1.0, 1e2, 1e6):
        scene, out = files.scene(two_cranks(size), "a.xml", "--pose", "ja=0.6")
        assert "closure 'tie' was open by" in out
        found.append([np.array(body.position) / size for body in scene.body])
        assert mbref.counts(scene).degrees_of_freedom == 1
        assert found[-1][0] == pytest.approx([-np.sin(0.6) / 2, np.cos(0.6) / 2, 0], abs=1e-9)
    assert np.abs(np.array(found) - found[2]).max() < 1e-8


def tilted(files, tilt: float) -> mbref.Scene:
    """Return a square of links whose hinges are about z, except one that is tilted (rad)."""
    return files.scene(two_cranks(0.3, tilt, rod=1.0), "a.xml")[0]


@pytest.mark.parametrize("tilt", [0.0, *(10.0**k for k in range(-16, -11))])
def test_tilt_of_an_axis_of_at_most_1e_12_rad_is_rounding_and_the_loop_moves(files, tilt):
    """Parallel axes leave one degree of freedom. Singular values are far below the rank tolerance, 1e-10."""
    assert mbref.counts(tilted(files, tilt)).degrees_of_freedom == 1


@pytest.mark.parametrize("tilt", [1e-11, 1e-10, 1e-8, 1e-7])
def test_tilt_that_may_be_rounding_is_read_alike_by_counts_and_motion_and_named(files, tilt):
    """Crank a begins at 1 rad/s. With one degree of freedom it turns by 0.1 rad in 0.1 s; with none, nothing
    moves. The message has the reason. A tilt of 1e-9 rad is left out: its singular value is the rank
    tolerance 1e-10 itself, and motions scale rows with masses too, counts with lengths alone."""
    scene = tilted(files, tilt).with_("body[a].angular_velocity", (0.0, 0.0, 1.0))
    motion = mbref.simulate(scene, times=[0.0, 0.1])
    if mbref.counts(scene).degrees_of_freedom == 1:
        assert motion.joint("ja").angle[-1] == pytest.approx(0.1, abs=1e-9)  # rad
        assert "count as redundant" in motion.message
    else:
        assert len(motion.times) == 0 and "their rank is uncertain" in motion.message


@pytest.mark.parametrize("tilt", [1e-7, 1e-6, 1e-5, 1e-4])
def test_tilt_of_an_axis_of_at_least_1e_7_rad_locks_the_loop(files, tilt):
    """Axes in different directions leave none. All singular values are far above the rank tolerance."""
    assert mbref.counts(tilted(files, tilt)).degrees_of_freedom == 0
