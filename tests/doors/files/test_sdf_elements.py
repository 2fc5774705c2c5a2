"""SDF files of one link and joint against bodies, joints and sentences worked out by hand."""

from pathlib import Path
from typing import Any

import pytest

from crosscheck.engines.loaders.loader import SDF
from crosscheck.engines.sdf import reading
from crosscheck.files.meaning import meant
from mbref.formats import Imported, ImportOptions
from mbref.scene import SceneError

MOMENTS = "<ixx>1</ixx><iyy>2</iyy><izz>2.5</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz>"
MASS = f"<inertial><mass>2</mass><inertia>{MOMENTS}</inertia></inertial>"
LINK = f'<link name="b"><pose>1 2 3 0 0 0</pose>{MASS}</link>'
GRAVITY = "<gravity>0 0 -9</gravity>"


def read(tmp_path: Path, inside: str, gravity: str = GRAVITY, **options: Any) -> Imported:
    text = f'<sdf version="1.11"><world name="w">{gravity}<model name="m">{inside}</model></world></sdf>'
    (tmp_path / "m.sdf").write_text(text)
    return reading.read(tmp_path / "m.sdf", ImportOptions(**options))


def joint(kind: str, more: str) -> str:
    ends, axis = "<parent>world</parent><child>b</child>", f"<axis><xyz>0 0 1</xyz>{more}</axis>"
    return f'<joint name="j" type="{kind}">{ends}{axis}</joint>'


def test_links_without_inertial_and_worlds_without_gravity_get_sdf_s_defaults(tmp_path: Path) -> None:
    """The format's defaults: 1 kg and 1 kg m² about each axis; 9.8 m/s² downwards. Notes state gravity, and a
    link without the element ``inertial``."""
    bare = '<link name="b"/><link name="c"><inertial/></link>'
    bare += '<link name="d"><inertial><inertia/></inertial></link>'
    found = read(tmp_path, bare, gravity="")
    assert [(body.mass, body.inertia) for body in found.scene.body] == [(1.0, (1.0, 1.0, 1.0))] * 3
    mass = "link 'b' has no inertial: 1 kg and 1 kg m², the defaults of SDF"
    assert found.notes == (mass, "gravity is 9.8 m/s² downwards, the default of SDF")
    assert found.scene.gravity == (0.0, 0.0, -9.8) and not read(tmp_path, LINK).notes


@pytest.mark.parametrize(("version", "gravity"), [("1.4", -1.6), ("1.5", -1.6), ("1.6", -9.8)])
def test_gravity_of_the_physics_counts_before_sdf_1_6_in_the_import_and_in_every_reader(
    version: str, gravity: float, tmp_path: Path
) -> None:
    """Version 1.6 moved the element to the world, whose default is 9.8 m/s² downwards."""
    text = f"<physics><gravity>0 0 -1.6</gravity></physics><model name='m'>{LINK}</model>"
    path = tmp_path / "moon.sdf"
    path.write_text(f"<sdf version='{version}'><world name='w'>{text}</world></sdf>")
    found = reading.read(path, ImportOptions())
    assert found.scene.gravity == meant(path, SDF).gravity == (0.0, 0.0, gravity)
    assert any("of a physics: is not read" in said for said in found.left_out) == (gravity == -9.8)


@pytest.mark.parametrize(
    ("old", "new", "kind", "sentence"),
    [
        ("</inertial>", "<fluid_added_mass/></inertial>", "fluid", "the added mass of link 'b' in a fluid"),
        ("</link>", "<gravity>false</gravity></link>", "gravity-compensation", "link 'b' without weight"),
        ("</link>", "<gravity>0</gravity></link>", "gravity-compensation", "link 'b' without weight"),
        ("</link>", "<velocity_decay/></link>", "damping", "velocity_decay of link 'b'"),
        ("</link>", "<kinematic>1</kinematic></link>", "kinematic-links", "kinematic link 'b'"),
    ],
)
def test_link_element_that_changes_the_motion_is_refused_or_left_out(old, new, kind, sentence, tmp_path):
    """The error and the list of what is left out name the element, the link and the option ``--without``."""
    says = f"{sentence}: it changes the motion; --without {kind} leaves it out"
    with pytest.raises(SceneError, match=says):
        read(tmp_path, LINK.replace(old, new))
    found = read(tmp_path, LINK.replace(old, new), without=[kind])
    assert found.left_out == (f"{sentence} (--without {kind})",)


DYNAMICS = (
    "<dynamics><damping>0.5</damping><friction>0</friction><spring_reference>0.25</spring_reference>"
    "<spring_stiffness>3</spring_stiffness></dynamics>"
)


def test_friction_of_a_hinge_is_refused_or_left_out_and_its_spring_stays(tmp_path: Path) -> None:
    """The hinge has dry friction 7 N m and a spring of 3 N m/rad."""
    rough = DYNAMICS.replace("<friction>0", "<friction>7")
    with pytest.raises(SceneError, match="dry friction of joint 'j': it changes the motion"):
        read(tmp_path, LINK + joint("revolute", rough))
    found = read(tmp_path, LINK + joint("revolute", rough), without=["friction"])
    assert found.left_out == ("dry friction of joint 'j' (--without friction)",)
    assert [(load.type, load.stiffness) for load in found.scene.load] == [("torsion_spring", 3.0)]


def test_damping_of_a_ball_joint_is_read_and_its_spring_is_refused_by_name(tmp_path: Path) -> None:
    """A scene has dampers of ball joints, here 0.5 N m s/rad, but no springs."""
    with pytest.raises(SceneError) as refused:
        read(tmp_path, LINK + joint("ball", DYNAMICS))
    assert [fault.partition(":")[0] for fault in refused.value.faults] == ["springs of joint 'j'"]
    [load] = read(tmp_path, LINK + joint("ball", DYNAMICS), without=["springs"]).scene.load
    assert (load.type, load.bodies, load.damping) == ("rotational_damper", ("ground", "b"), 0.5)


def test_export_of_sdf_is_refused_with_a_format_that_works(tmp_path: Path) -> None:
    """Scenes are read from SDF but not written; MJCF (.xml) is named instead."""
    with pytest.raises(SceneError, match=r"SDF: is read only; export as \.xml"):
        reading.FORMAT.write(read(tmp_path, LINK).scene)
