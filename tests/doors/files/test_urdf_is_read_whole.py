"""URDF: elements that close loops, elements that are not read, and impossible inertias."""

import numpy as np
import pytest

import mbref

MASS = '<inertial><origin xyz="0.15 0 0"/><mass value="0.3"/><inertia {}/></inertial>'
MOMENTS = 'ixx="1e-4" ixy="0" ixz="0" iyy="2e-3" iyz="0" izz="2e-3"'


def hinge(name: str, parent: str, child: str, at: str, turn: float = 0.0, more: str = "") -> str:
    return (
        f'<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{at}" rpy="0 {turn} 0"/><axis xyz="0 1 0"/>{more}</joint>'
    )


def robot(*parts: str) -> str:
    links = "".join(f'<link name="{name}">{MASS.format(MOMENTS)}</link>' for name in "abc")
    return f'<robot name="r"><link name="base"/>{links}{"".join(parts)}</robot>'


PINNED = hinge("ja", "base", "a", "0 0 0", -1.2), hinge("jb", "a", "b", "0.3 0 0", 1.2)
CRANKS = (*PINNED, hinge("jc", "base", "c", "0.3 0 0", -1.2))
PLACES = """<parent link="b"/><parent_origin xyz="0.3 0 0"/><child link="c"/><child_origin xyz="0.3 0 0"/>"""
UNKNOWN = PLACES.replace('child link="c"', 'child link="q"')


def test_a_massless_link_that_a_joint_carries_on_the_base_has_no_effect(files):
    """MuJoCo stores the mass matrix of such a link, with the mass that it needs to read the file."""
    end = '<link name="end"/>', hinge("je", "base", "end", "0 1 0")
    scene, out = files.scene(robot(*CRANKS, *end), "r.urdf")
    assert len(scene.body) == 3 and "body 'end' has no mass and carries none" in out


@pytest.mark.parametrize("tag", ["constraint", "loop_joint"])
@pytest.mark.parametrize(
    ("kind", "axes", "freedoms"),
    [
        ("revolute", '<parent_axis xyz="0 1 0"/><child_axis xyz="0 1 0"/>', 1),
        ("revolute", '<axis xyz="0 1 0"/>', 1),
        ("spherical", "", 1),
        ("fixed", "", 0),
    ],
)
def test_an_element_that_closes_a_loop_is_a_joint_of_the_scene(files, tag, kind, axes, freedoms):
    """A parallelogram of links of 0.3 m with the crank at 1.2 rad above x: the tip, at which the element
    joins b and c, is at 0.3 (1 + cos, 0, sin) m. The mechanism has one freedom, with a fixed joint none. The
    loop is closed to 1e-9 m."""
    turn = ' rpy="0 -1.2 0"' if kind == "fixed" else ""
    places = PLACES.replace('<parent_origin xyz="0.3 0 0"', f'<parent_origin xyz="0.3 0 0"{turn}')
    loop = f'<{tag} name="tip" type="{kind}">{places}{axes}</{tag}>'
    scene, out = files.scene(robot(*CRANKS, loop), "r.urdf")
    assert scene.joint_named("tip").bodies == ("b", "c")
    assert mbref.counts(scene).degrees_of_freedom == freedoms
    assert "is not read" not in out
    tip = scene.joint_named("tip").anchor
    expected = [0.3 + 0.3 * np.cos(1.2), 0.0, 0.3 * np.sin(1.2)]
    assert tip == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("loop", "says"),
    [
        (f'<constraint name="t" type="gear">{PLACES}</constraint>', "constraint 't': type 'gear' is none of"),
        ('<constraint name="t" type="fixed"><parent link="b"/></constraint>', "'t': names no child link"),
        (f'<constraint name="t" type="fixed">{PLACES.replace("0.3", "x")}</constraint>', "must be 3 numbers"),
        (f'<constraint name="t" type="fixed">{UNKNOWN}</constraint>', "'q'"),
    ],
)
def test_a_fault_of_an_element_that_closes_a_loop_is_named(files, loop, says):
    """An unknown type, no child link, a word for a number, and an unknown link q."""
    assert says in files.refusal(robot(*CRANKS, loop), "r.urdf")


def test_elements_that_are_not_read_are_listed_with_their_part(files):
    """Elements of one name are listed together; <springy> is no element of the format."""
    parts = (
        hinge("ja", "base", "a", "0 0 0", more="<safety_controller k_velocity='1'/>"),
        hinge("jb", "a", "b", "0.3 0 0", more="<springy/>"),
        hinge("jc", "base", "c", "0.3 0 0", more="<springy/>"),
        "<gazebo reference='a'><mu1>1</mu1></gazebo><sensor name='s'/>",
    )
    _, out = files.scene(robot(*parts), "r.urdf")
    assert "left out: <springy> of joint 'jb', joint 'jc': is not read" in out
    for tag in ("safety_controller", "gazebo", "sensor"):
        assert f"left out: <{tag}> of " in out


@pytest.mark.parametrize(("count", "ends"), [(6, "joint 'j5': is not"), (8, "joint 'j5' and 2 more: is not")])
def test_six_parts_with_an_element_that_is_not_read_are_named_and_further_ones_counted(files, count, ends):
    """Links in a row, whose joints j0, j1, … have the element <springy>."""
    row = [f'<link name="k{k}">{MASS.format(MOMENTS)}</link>' for k in range(count)]
    names = ["base", *(f"k{k}" for k in range(count))]
    row += [hinge(f"j{k}", names[k], names[k + 1], "0.3 0 0", more="<springy/>") for k in range(count)]
    _, out = files.scene(f'<robot name="r"><link name="base"/>{"".join(row)}</robot>', "r.urdf")
    listed = ", ".join(f"joint 'j{k}'" for k in range(5))
    assert f"left out: <springy> of {listed}, {ends} read" in out


@pytest.mark.parametrize("value", ["${2 * m}", "$(arg m)"])
def test_an_expression_of_xacro_is_refused_with_its_element_and_value(files, value):
    said = files.refusal(robot(*CRANKS).replace('value="0.3"', f'value="{value}"'), "r.urdf")
    assert f"<mass value='{value}'>: is an expression of xacro" in said


@pytest.mark.parametrize("excess", [0.0, 1e-16, 1e-13, 1e-10])
def test_inertia_of_a_flat_link_is_read_though_rounding_makes_it_impossible(files, excess):
    """A flat link has 0.3 = 0.1 + 0.2 kg m². A file may have a largest moment that is greater by a relative
    ``excess``, which no body has; it is read as a flat link, to 1e-9."""
    moments = f'ixx="0.1" ixy="0" ixz="0" iyy="{0.3 * (1 + excess)!r}" iyz="0" izz="0.2"'
    scene, _ = files.scene(robot(*CRANKS).replace(MOMENTS, moments, 1), "r.urdf")
    assert np.diag(scene.body[0].inertia) == pytest.approx(np.diag([0.1, 0.3, 0.2]), abs=3e-10)


def test_prefix_without_a_declaration_is_read_as_by_parsers_without_namespaces(files):
    """Elements and attributes of tools, such as ``drake:``, do not change the scene; nor do comments."""
    limit = '<limit tool:acceleration="2" effort="1" velocity="1"/>'
    bare = limit.replace('tool:acceleration="2" ', "")
    plain = robot(hinge("ja", "base", "a", "0 0 0", more=bare), *CRANKS[1:])
    text = robot(hinge("ja", "base", "a", "0 0 0", more=limit), *CRANKS[1:], '<tool:group name="g"/>')
    scene, _ = files.scene(f"<!-- a <tool:note> -->{text}", "r.urdf")
    assert scene == files.scene(plain, "r.urdf")[0]


@pytest.mark.parametrize("limits", ["", '<limit effort="1" velocity="1"/>'])
def test_limits_without_a_range_are_named(files, limits):
    """The format's default of both ends is 0, which would lock the joint; engines read it as no limit."""
    free = hinge("ja", "base", "a", "0 0 0", more=limits).replace("continuous", "revolute")
    _, out = files.scene(robot(free, *CRANKS[1:]), "r.urdf")
    assert "limits of joints 'ja': lower and upper are 0 or missing; the joints are free" in out


def limited(lower: str, upper: str) -> str:
    """A robot whose crank begins 1.2 rad above x, and falls to larger angles about y, with a limit."""
    limit = f'<limit {lower} {upper} effort="1" velocity="1"/>'
    first = hinge("ja", "base", "a", "0 0 0", -1.2, more=limit).replace("continuous", "revolute")
    return robot(first, *CRANKS[1:])


@pytest.mark.parametrize(
    ("lower", "upper", "says"),
    [
        ('lower="0.3"', 'upper="0.3"', "limit of joint 'ja', whose ends are both 0.3"),
        ('lower="1"', 'upper="-1"', "limit of joint 'ja', whose lower end 1 is above its upper end -1"),
        ('lower="0.5"', "", "limit of joint 'ja', whose lower end 0.5 is above its upper end 0"),
        ('lower="-1"', "", "limit of joint 'ja', which acts at the start"),
    ],
)
def test_limits_that_the_file_s_motion_cannot_keep_are_refused_or_left_out(files, lower, upper, says):
    """A missing end is 0, the format's default. The joint is at 0, and falls to larger angles: against an
    upper end 0. MuJoCo reads none of these limits."""
    assert says in files.refusal(limited(lower, upper), "r.urdf")
    _, out = files.scene(limited(lower, upper), "r.urdf", "--without", "limits")
    assert says in out


def test_a_limit_with_one_end_that_does_not_act_is_left_out_with_a_remark(files):
    """The crank falls away from 0, the lower end."""
    assert "1 limit of a joint" in files.scene(limited("", 'upper="1"'), "r.urdf")[1]


def test_a_planar_joint_keeps_its_name(files):
    """MuJoCo makes three joints of it, whose names have ends of their own."""
    first = hinge("ja", "base", "a", "0 0 0").replace("continuous", "planar")
    scene, _ = files.scene(robot(first, *CRANKS[1:]), "r.urdf")
    assert scene.joint_named("ja").type == "planar"
