"""Mechanisms of the report and the README are drawn as the trajectories that they were made of."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from crosscheck.cli.moving_picture import singular_instants
from crosscheck.judge.truth import truth_for
from crosscheck.study.truths import truth_record
from mbref.motions.drawing.shapes import shapes
from mbref.motions.joint_motion import carried
from mbref.scenes import SCENES
from reports import mechanisms
from reports.figures import colour
from reports.runs import Run
from tests.reports.drawn import BACKGROUND, SVG, bars
from tests.reports.synthetic import exact, motion, record, scene, truths


def test_exact_run_is_drawn_on_the_exact_motion():
    """Frames of both are equal, one a sample. The crank keeps its length to 0.3 px, as ends are rounded."""
    crank = scene("planar_slider_crank")
    true = exact(crank)
    picture = mechanisms.over_truth(crank, true, true, "mujoco")
    behind, before = bars(picture, BACKGROUND), bars(picture)
    assert len(before) == 2 and colour("mujoco") in picture
    for a, b in zip(behind, before, strict=True):
        assert (a == b).all() and len(a) == len(true.times)
    lengths = np.hypot(*(before[0][:, 1] - before[0][:, 0]).T)
    assert np.ptp(lengths) < 0.3, lengths


def test_compared_runs_are_drawn_with_title_error_and_singular_positions():
    """Two runs with an error of 0.5 are side by side, with a singular position at 0.01 s. Titles have the
    settings step and rtol, and no others such as a margin. No script is needed."""
    shown = Run(record("mujoco", "defaults", 0.5, 0.1, step=0.1, margin=3))
    picture = mechanisms.compared(scene(), exact(scene()), [shown, shown], [0.01])
    texts = [node.text for node in ET.fromstring(picture).iter(f"{SVG}text")]
    assert texts.count("mujoco defaults, step 0.1") == texts.count("largest error 5.0e-01") == 2, texts
    assert "singular positions" in texts and "<script" not in picture


def test_still_picture_shows_the_largest_difference_of_a_run():
    """Without animation the picture is the frame at which a body is farthest from the truth."""
    true, run = (mechanisms.motion_of(scene(), r) for r in (truths()[0]["motion"], motion()))
    picture = mechanisms.over_truth(scene(), true, run, "mujoco")
    stands = ET.fromstring(picture).findall(f"{SVG}g")[1]
    drawn = [n.get("points") for n in stands.iter(f"{SVG}polyline")]
    assert not list(stands.iter(f"{SVG}animate")) and "nan" not in picture
    apart = int(np.linalg.norm(true.position - run.position, axis=-1).max(axis=1).argmax())
    frames = bars(picture)
    middle = [" ".join(f"{x:.1f},{y:.1f}" for x, y in frame[apart]) for frame in frames]
    assert len(middle) == 2 and set(middle) <= set(drawn), (middle, drawn)


def test_crank_turns_by_less_than_two_thirds_of_a_radian_between_drawn_frames():
    """A body turns by about 1/3 rad between frames; twice that looks broken. At most 91 frames are drawn."""
    planar = SCENES["planar_slider_crank"]().with_(duration=0.05)
    true = mechanisms.motion_of(planar, truth_record(planar, np.linspace(0, 0.05, 3), 20.0)["motion"])
    crank, *_ = bars(mechanisms.over_truth(planar, true, None, ""), BACKGROUND)
    along = crank[:, 1] - crank[:, 0]
    angles = np.unwrap(np.arctan2(along[:, 1], along[:, 0]))
    assert len(angles) <= 91 and max(abs(np.diff(angles))) < 2 / 3, angles


@pytest.mark.parametrize("name", ["spatial_slider_crank", "planar_slider_crank", "four_bar", "five_bar"])
def test_both_bodies_of_a_joint_are_drawn_through_a_common_point(name):
    """Some drawn point of one body is, in each frame, at a drawn point of the other to rounding, 1e-9 m."""
    a_scene = SCENES[name]().with_(duration=0.02)
    trajectory = exact(a_scene)
    parts = {s.name: carried(s.points, trajectory, b) for b, s in enumerate(shapes(a_scene))}
    for joint in a_scene.joint:
        if "ground" in joint.bodies:
            continue
        first, second = (parts[body] for body in joint.bodies)
        gap = np.linalg.norm(first[:, :, None] - second[:, None], axis=-1).min(axis=(1, 2)).max()
        assert gap < 1e-9, f"{name} {joint.name}: {gap} m between the bodies"


def test_marked_instants_are_the_singular_positions_of_a_slider_crank_of_equal_lengths():
    """The crank's angle, by its closed form, is π/2, 3π/2, …, up to the end: within 0.01 rad, by which it
    turns in half an interval of 0.2 ms between the instants searched."""
    crank = SCENES["planar_slider_crank_equal"]()
    found, truth = singular_instants(crank), truth_for(crank)
    last = truth.coordinate(np.array([crank.duration]))[0, 0]
    expected = np.arange(np.pi / 2, last, np.pi)
    assert len(expected) == 4 and truth.coordinate(np.array(found))[:, 0] == pytest.approx(expected, abs=0.01)


@pytest.mark.slow
def test_no_instant_is_marked_on_a_slider_crank_of_unequal_lengths():
    """The rod is longer than the crank, so that no position is singular."""
    assert singular_instants(SCENES["planar_slider_crank"]()) == []
