"""Motion: bodies and joints by name, energies, tables, plots and files."""

import csv
import dataclasses
import json
import sys

import numpy as np
import pytest

from mbref import Motion, Trajectory, find_scene, simulate
from mbref.motions.drawing.plot import grouped

TIMES = np.linspace(0.0, 0.1, 21)
ROUNDING = 1e-11  # rad, m: of angles of 12 rad


@pytest.fixture(scope="module")
def driven() -> Motion:
    """The four-bar, its crank driven at -124.8 rad/s: two full turns, six samples each."""
    return simulate("four_bar", times=np.linspace(0.0, 0.1, 13))


@pytest.fixture(scope="module")
def crank() -> Motion:
    return simulate("planar_slider_crank", times=TIMES)


def test_angle_of_a_joint_does_not_depend_on_the_sign_of_quaternions(driven):
    """p and -p are one orientation. Signs of all bodies are changed, then of the crank alone at samples 1, 2,
    4, 5 …: the angle of joint A stays, to rounding."""
    other = Motion.of(driven.mechanism, dataclasses.replace(driven, orientation=-driven.orientation))
    crank_alone = driven.orientation.copy()
    crank_alone[np.arange(len(driven.times)) % 3 > 0, 0] *= -1.0
    one = Motion.of(driven.mechanism, dataclasses.replace(driven, orientation=crank_alone))
    for motion in (other, one):
        assert np.abs(motion.joint("A").angle - driven.joint("A").angle).max() < ROUNDING


def test_displacement_of_a_guide_is_how_far_its_slider_moved(crank):
    """The guide D is along x: the slider's x changes by the displacement; it has no angle."""
    joint, slider = crank.joint("D"), crank["slider"]
    assert joint.displacement == pytest.approx(slider.position[:, 0] - slider.position[0, 0], abs=ROUNDING)
    assert joint.angle is None and joint.displacement[-1] != 0


def test_rotation_vector_of_a_universal_joint_is_the_relative_rotation(driven):
    """B joins the crank and the coupler, which stays parallel: its angle is 124.8 rad/s · t, modulo 2π."""
    vector = driven.joint("B").rotation
    turned = np.arctan2(np.sin(124.8 * driven.times), np.cos(124.8 * driven.times))
    assert np.abs(vector[:, 2] - turned).max() < ROUNDING and np.abs(vector[:, :2]).max() < ROUNDING


def test_unknown_body_or_joint_is_refused_with_the_known_ones(crank):
    """The motion has the bodies crank, rod and slider."""
    with pytest.raises(KeyError, match="no body 'lid'; bodies: crank, rod, slider"):
        crank["lid"]
    with pytest.raises(KeyError, match="no joint 'Z'; joints: A, B"):
        crank.joint("Z")


def test_energy_of_a_motion_without_masses_is_refused_with_the_body_and_is_no_column():
    """The driven four-bar moves also without masses."""
    scene = find_scene("four_bar")
    bare = scene.with_(body=tuple(b.model_copy(update={"mass": None, "inertia": None}) for b in scene.body))
    motion = simulate(bare, "taylor", [0.0, 0.01])
    with pytest.raises(ValueError, match="body 'crank' has no mass"):
        motion.energy  # noqa: B018
    assert "energy" not in motion.columns()


def test_saved_motion_is_read_back_equal(crank, tmp_path):
    """Equal are scene, outcome, cost, the record with all numbers, and the names of columns."""
    crank.save(tmp_path / "run.json")
    again = Motion.load(tmp_path / "run.json")
    assert again.mechanism == crank.mechanism and again.outcome is crank.outcome and again.cost == crank.cost
    assert again.to_record() == crank.to_record()
    assert list(again.columns()) == list(crank.columns())


def test_motion_is_saved_as_json_only(crank, tmp_path):
    """The suffix may have capitals; with another one no file is written."""
    with pytest.raises(ValueError, match=r"run.mp4: a motion is saved as .json"):
        crank.save(tmp_path / "run.mp4")
    crank.save(tmp_path / "run.JSON")
    assert [path.name for path in tmp_path.iterdir()] == ["run.JSON"]


FAULTS = {"t_end": "soon", "angles": {"A": [0.0]}, "cost": {"steps": "3"}, "bodies": {}, "times": [10**400]}


@pytest.mark.parametrize("field", [None, *FAULTS])
def test_file_that_is_no_saved_motion_is_refused(field, crank, tmp_path):
    """The file has no record (None), or a field of another kind or length in its record (FAULTS)."""
    whole = {"scene": crank.mechanism.to_dict(), "record": {**crank.to_record(), field: FAULTS.get(field)}}
    (tmp_path / "other.json").write_text(json.dumps(whole if field else {"scene": 1}))
    with pytest.raises(ValueError, match=r"other\.json: is not a file that Motion\.save wrote"):
        Motion.load(tmp_path / "other.json")


def test_csv_file_and_data_frame_hold_the_arrays_of_the_motion(crank, tmp_path):
    """Columns are named by part, field and axis; their numbers are equal to the bit."""
    crank.to_csv(tmp_path / "run.csv")
    with open(tmp_path / "run.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(TIMES)
    assert float(rows[-1]["slider.position.x"]) == crank["slider"].position[-1, 0]
    frame = crank.to_dataframe()
    assert (frame.index == TIMES).all()
    assert (frame["A.force.y"] == crank.joint("A").force[:, 1]).all()
    for k, part in enumerate("wxyz"):
        assert (frame[f"rod.orientation.{part}"] == crank["rod"].orientation[:, k]).all()
    for field in ("position", "velocity", "angular_velocity", "acceleration", "angular_acceleration"):
        for k, axis in enumerate("xyz"):
            assert (frame[f"rod.{field}.{axis}"] == getattr(crank["rod"], field)[:, k]).all(), field


def test_data_frame_without_pandas_names_the_package_to_install(crank, monkeypatch):
    """None in ``sys.modules`` makes Python's import of pandas fail."""
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match="pip install pandas"):
        crank.to_dataframe()


def test_plot_has_a_panel_for_each_quantity(crank):
    """A coordinate and a position give four curves with a legend in one panel, an angle one in another."""
    axes = crank.plot("slider.position.x", "rod.position", "A.angle").axes
    assert [a.get_ylabel() for a in axes] == ["position, m", "angle, rad"]
    names = [text.get_text() for text in axes[0].get_legend().get_texts()]
    assert names == ["slider.position.x", "rod.position.x", "rod.position.y", "rod.position.z"]
    assert (axes[1].lines[0].get_ydata() == crank.joint("A").angle).all()


def test_plot_without_columns_shows_joint_coordinates_and_energy(crank):
    """``grouped`` returns the columns of each panel, by its quantity."""
    groups = grouped(list(crank.columns())[1:], ())
    assert set(groups) == {"angle", "displacement", "energy"}
    assert groups["angle"] == ["A.angle", "B.angle"]


def test_repr_of_a_motion_is_one_line_and_its_html_an_animation(crank):
    """Bodies and joints are shown in fewer than 80 characters. HTML has quotation marks as entities."""
    line = "<Motion of 'planar_slider_crank' by mbref taylor: COMPLETED, 21 samples to t = 0.1 s>"
    assert repr(crank) == line
    assert len(repr(crank["rod"])) < 80 and len(repr(crank.joint("A"))) < 80
    assert "<animate" in crank._repr_html_() and "&#x27;planar_slider_crank&#x27;" in crank._repr_html_()


def test_trajectory_with_its_scene_has_the_columns_of_the_motion_for_any_order_of_bodies(crank):
    """A trajectory has samples without the scene; they are read from a record whose bodies are reversed."""
    record = crank.to_record() | {"bodies": dict(reversed(crank.to_record()["bodies"].items()))}
    found = Motion.of(crank.mechanism, Trajectory.from_record(crank.scene, record)).columns()
    assert all(np.allclose(found[k], x, 1e-12, ROUNDING) for k, x in crank.columns("B", "energy").items())


def test_path_changes_one_value_of_a_scene():
    """``with_`` takes the path of a number of a body, a field of the scene, or one component of a vector."""
    scene = find_scene("planar_slider_crank")
    heavy = scene.with_("body[slider].mass", 2.0)
    assert heavy.body[2].mass == 2.0 and heavy.body[:2] == scene.body[:2] and heavy.joint == scene.joint
    assert scene.with_("gravity", [0.0, -1.0, 0.0], duration=3.0).gravity == (0.0, -1.0, 0.0)
    assert scene.with_("joint[A].axis[2]", 2.0).joint[0].axis == (0.0, 0.0, 2.0)
