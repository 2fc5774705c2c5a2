"""Included files and gearboxes of SDF."""

import numpy as np
import pytest

from crosscheck.judge.gauss_principle import gauss
from mbref.scene import SceneError
from tests.doors.files.test_sdf import HINGE, LINK, pair, read

GEARBOX = """<joint name="G" type="gearbox"><parent>{parent}</parent><child>{child}</child>
<gearbox_ratio>3</gearbox_ratio><gearbox_reference_body>frame</gearbox_reference_body>
<axis><xyz>0 1 0</xyz></axis><axis2><xyz>0 {sense} 0</xyz></axis2></joint>"""


def finger(version: str) -> str:
    """Return a model whose link is turned about x, with a hinge along y; 1.4 means y of the model."""
    link = LINK.format(name="tip", pose="0 0 0 1.5707963267948966 0 0", centre="0.1 0 0")
    hinge = HINGE.format(name="knuckle", kind="revolute", parent="world", child="tip", more="")
    model = f'<model name="finger"><pose>0 7 0 0 0 0</pose>{link}{hinge}</model>'
    return f'<sdf version="{version}">{model}</sdf>'


@pytest.mark.parametrize(("version", "axis"), [("1.4", (0, 1, 0)), ("1.10", (0, 0, 1))])
@pytest.mark.parametrize("uri", ["model://finger", "finger", "file://finger/old.sdf"])
def test_included_model_has_the_axes_of_its_own_version(uri, version, axis, tmp_path):
    """The finger's axis is y, in the model's frame before SDF 1.5, later in its link's, whose y is the
    world's z. The include gives name and pose."""
    (tmp_path / "finger").mkdir()
    (tmp_path / "finger" / "old.sdf").write_text(finger(version))
    config = '<model><sdf version="1.2">older.sdf</sdf><sdf version="1.4">old.sdf</sdf></model>'
    (tmp_path / "finger" / "model.config").write_text(config)
    include = f"<include><uri>{uri}</uri><name>thumb</name><pose>0 0 2 0 0 0</pose></include>"
    scene = read(tmp_path, pair(joint=include)).scene
    assert [body.name for body in scene.body] == ["a", "b", "thumb::tip"]
    assert np.allclose(scene.body[2].position, (0.1, 0, 2))
    assert np.allclose(scene.joint_named("thumb::knuckle").axis, axis)


def test_sdf_path_finds_an_included_model_with_its_own_pose(tmp_path, monkeypatch):
    """Environment variable SDF_PATH names the folder of models; the include has no pose, and the model's own
    is 7 m along y, so that the link's centre of mass is at (0.1, 7, 0)."""
    (tmp_path / "models" / "finger").mkdir(parents=True)
    (tmp_path / "models" / "finger" / "model.sdf").write_text(finger("1.7"))
    monkeypatch.setenv("SDF_PATH", str(tmp_path / "models"))
    scene = read(tmp_path, pair(joint="<include><uri>model://finger</uri></include>")).scene
    assert np.allclose(scene.body[2].position, (0.1, 7, 0))


def test_included_sun_and_ground_plane_are_left_out(tmp_path):
    """Both models, of Gazebo's library, have no moving link and need not be on the disk."""
    still = "".join(f"<include><uri>{uri}</uri></include>" for uri in ("model://sun", "model://ground_plane"))
    text = pair().replace("<model", f'<world name="w">{still}<model').replace("</sdf>", "</world></sdf>")
    assert [body.name for body in read(tmp_path, text).scene.body] == ["a", "b"]


def gears(parent: str = "one", child: str = "two", sense: int = 1, swapped: bool = False) -> str:
    """Return two wheels on a frame that turns, and a gearbox between them."""
    names = ("frame", "one", "two")
    centres = ("0.05 0 0", "0.1 0 0.02", "-0.08 0 0.1")
    placed = zip(names, centres, strict=True)
    links = "".join(LINK.format(name=n, pose="0 0 1 0 0 0", centre=c) for n, c in placed)
    ends = [("world", "frame"), ("frame", "one"), ("two", "frame") if swapped else ("frame", "two")]
    hinges = "".join(
        HINGE.format(name=f"of {n}", kind="revolute", parent=first, child=second, more="")
        for n, (first, second) in zip(names, ends, strict=True)
    )
    box = GEARBOX.format(parent=parent, child=child, sense=sense)
    return f'<sdf version="1.7"><model name="m">{links}{hinges}{box}</model></sdf>'


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("sense", [1, -1])
def test_gearbox_turns_its_child_by_minus_ratio_times_the_parent(sense, swapped, tmp_path):
    """SDF defines θ₂ = -ratio · θ₁: θ₁ is the angle from the reference body to the parent about ``axis``, and
    θ₂ to the child about ``axis2``, whatever the senses of the hinges are. From rest angular accelerations by
    Gauss's principle have this ratio, here -3, to 1e-9."""
    scene = read(tmp_path, gears(sense=sense, swapped=swapped)).scene
    spins = gauss(scene)[len(scene.body) :, 1]  # about y, of the frame and both wheels
    of_parent, of_child = spins[1] - spins[0], sense * (spins[2] - spins[0])
    assert abs(of_parent) > 1 and of_child == pytest.approx(-3 * of_parent, rel=1e-9)


def test_gearbox_without_hinges_on_its_reference_body_is_refused(tmp_path):
    """The gearbox's parent is its reference body itself, so that no hinge between both exists."""
    with pytest.raises(SceneError, match="joint 'G': a gearbox needs a hinge along its axis between 'frame'"):
        read(tmp_path, gears(parent="frame", child="one"))
