"""Drivers that come to a dead position: its time in closed form, and a comparison that ends before it."""

import numpy as np
import pytest

import crosscheck
from crosscheck.judge.constraints import initial_poses
from crosscheck.judge.dead_position import Pose, dead_position
from crosscheck.study.dead_positions import followed
from mbref.scene import Scene
from mbref.scenes import SCENES
from tests.helpers.dead_positions import pushed, turned

SECONDS = 20.0  # CPU seconds of a reference
ACCURACY = 1e-4  # relative; the judge's steps end at 2⁻¹⁷ of a duration of up to four dead times, 3e-5


def end_of(scene: Scene, end: float | None = None) -> float | None:
    """Return the time of the dead position of a scene, from its start."""
    return dead_position(scene, Pose(*initial_poses(scene)), 0.0, end or scene.duration)


# crank, rod (units of the size), start angle of the crank (rad), speed, size (m); and the closed form's time
MADE = {"pushed": pushed(0.2, 0.5, 1.0, 0.7, 1.0), "turned": turned(0.5, 0.4, 0.3, 4.0)}
SIZED = {"pushed, 1 mm": pushed(0.4, 0.3, 0.5, 0.7, 1e-3), "pushed, 1 km": pushed(0.1, 1.0, -1.4, 0.7, 1e3)}


@pytest.mark.parametrize(("scene", "time"), [*MADE.values(), *SIZED.values()], ids=[*MADE, *SIZED])
def test_reference_ends_at_the_dead_position_of_a_driven_slider_crank(scene, time):
    """Closed forms (``pushed`` and ``turned``): a pushed slider is at its greatest distance from the shaft,
    crank + rod; a driven crank that is longer than its rod cannot turn on once the rod stands upright."""
    assert end_of(scene) == pytest.approx(time, rel=ACCURACY)


PASSING = (SCENES["four_bar"](), 1.05 * 2 * np.pi / 124.8)  # s, at 124.8 rad/s


@pytest.mark.parametrize(
    ("scene", "end"),
    [*((scene, 0.95 * time) for scene, time in MADE.values()), PASSING],
    ids=[*MADE, "four-bar"],
)
def test_motion_before_its_dead_position_or_over_singular_positions_has_none(scene, end):
    """A motion ends at 0.95 of the closed form's time. The driven four-bar passes two singular positions in
    1.05 turns: links of equal lengths are flat at each half turn."""
    assert end_of(scene, end) is None


@pytest.mark.slow  # each a reference of 2 CPU s; references end at dead positions in the tests below
@pytest.mark.parametrize("name", ["turned", "pushed"])
def test_comparison_with_even_samples_is_shortened_to_end_just_before_the_dead_position(name):
    """The comparison keeps 41 even samples. "Just before" is the last 5 % of the closed form's time."""
    scene, time = MADE[name]
    shorter = followed(scene, np.linspace(0.0, scene.duration, 41), SECONDS)
    assert shorter.dead == pytest.approx(time, rel=ACCURACY)
    assert 0.95 * time < shorter.scene.duration == shorter.times[-1] < time and len(shorter.times) == 41


@pytest.mark.slow
def test_comparison_with_uneven_samples_keeps_the_samples_before_the_dead_position_if_any():
    """If no sample is before it, all requested samples are compared and no dead position is reported."""
    scene, time = MADE["pushed"]
    uneven = followed(scene, np.array([0.1 * time, 0.5 * time, 2.0 * time]), SECONDS)
    assert np.array_equal(uneven.times, [0.1 * time, 0.5 * time])
    late = np.array([2.0 * time, 3.0 * time])
    assert followed(scene, late, SECONDS).dead is None


@pytest.mark.slow  # runs of an engine and a reference: 5 CPU s
def test_engine_is_judged_up_to_the_dead_position_and_the_verdict_states_its_time():
    """OndselSolver is right up to the closed form's time; the headline has four digits of it."""
    scene, time = MADE["pushed"]
    found = crosscheck.compare(scene, "ondsel", reference_time=SECONDS)
    assert found.difference is None and found.judged.differences == {}
    assert "right at its best settings" in found.verdict.headline, found.verdict
    assert f"dead position of the drivers at t = {time:.4g} s" in found.verdict.headline
    assert "come to a dead position" in found.verdict.truth
    assert found.document()["truth"]["dead"] == pytest.approx(time, rel=ACCURACY)
