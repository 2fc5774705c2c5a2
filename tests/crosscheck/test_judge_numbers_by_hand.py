"""Numbers of the judge on a block / precision, noise and differences of runs, and the published problems."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from crosscheck.judge import precision, push_difference
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.published import BY_SCENE, OURS, PUBLISHED, problem_of
from mbref.scene import Body, Revolute, Scene
from mbref.scenes import SCENES
from mbref.trajectory import Trajectory

HINGE = Revolute(name="A", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
BLOCK = Body(name="b", mass=2.0, inertia=(1.0, 1.0, 1.0), position=(4.0, 0.0, 0.0))
SCENE = Scene(name="block", gravity=(0.0, 0.0, -3.0), body=(BLOCK,), joint=(HINGE,), duration=0.5)
LENGTH = 4.0
PROBLEMS = {  # scene, end (s), samples, accepted error
    "A01": ("point_pendulum", 10.0, 401, 5e-5),
    "A02": ("four_bar_chain", 10.0, 401, 1e-3),
    "A03": ("andrews_squeezer", 0.03, 301, OURS),
    "A04": ("bricard", 10.0, 401, OURS),
    "A04, thin rods": ("bricard_thin", 10.0, 401, OURS),
    "A05": ("flyball_governor", 10.0, 401, OURS),
    "rigid slider-crank": ("rigid_slider_crank", 5.0, 401, OURS),
    "rigid slider-crank, middle": ("rigid_slider_crank_middle", 5.0, 401, OURS),
    "heavy top": ("heavy_top", 2.0, 401, OURS),
    "Bennett": ("bennett", 1.0, 401, OURS),
    "Sarrus": ("sarrus", 0.3, 401, OURS),
    "H-frame": ("h_frame", 1.0, 401, OURS),
}


def motion(k: int = 9) -> Trajectory:
    """The block at rest, with accelerations and reactions of zero."""
    still, turn = np.zeros((k, 1, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (k, 1, 1))
    made = Trajectory(
        "block",
        "e",
        "1",
        "m",
        {},
        np.linspace(0.0, 0.5, k),
        ("b",),
        still + np.array([4.0, 0.0, 0.0]),
        turn,
        still.copy(),
        still.copy(),
    )
    zero = {"acceleration": still.copy(), "angular_acceleration": still.copy()}
    return replace(made, **zero, reactions={"A": np.zeros((k, 6))})


def test_sizes_of_published_problems():
    found = {name: (p.scene, p.time, p.samples, p.acceptance) for name, p in PUBLISHED.items()}
    assert found == PROBLEMS and OURS == 1e-6
    assert {scene: name for scene, (name, _) in BY_SCENE.items()} == {p[0]: n for n, p in PROBLEMS.items()}
    for problem in PUBLISHED.values():
        times = problem.times()
        assert (times[0], times[-1], len(times)) == (0.0, problem.time, problem.samples)
        assert problem.words and problem.source
    assert PUBLISHED["A02"].level == "0.001"
    assert PUBLISHED["A03"].level == "1e-06 (level of this project; none is published)"


def test_a_scene_belongs_to_its_problem_for_any_duration():
    frame = SCENES["h_frame"]()
    assert problem_of(frame) is problem_of(frame.with_(duration=0.1)) is PUBLISHED["H-frame"]
    assert problem_of(SCENES["four_bar"]()) is None
    assert problem_of(frame.with_(gravity=(0.0, 0.0, -1.62))) is None


@pytest.mark.parametrize(
    ("name", "seen"),
    [
        ("A01", {}),
        ("A02", {"x": 2.0, "y": 1.0, "x'": 3.0, "y'": -1.0}),
        ("A05", {"s": 0.75, "s'": -0.25}),
    ],
)
def test_observed_numbers_of_a_motion(name, seen):
    """The top of the first upright is twice as far as its centre; the slider is the second body."""
    problem = PUBLISHED[name]
    scene = SCENES[problem.scene]()
    nb = len(scene.body)
    place, rate = np.zeros((3, nb, 3)), np.zeros((3, nb, 3))
    turn = np.tile([1.0, 0.0, 0.0, 0.0], (3, nb, 1))
    names = tuple(body.name for body in scene.body)
    place[-1, 0], rate[-1, 0] = (1.0, 0.5, 9.0), (1.5, -0.5, 9.0)
    if name == "A05":
        place[-1, 1, 2], rate[-1, 1, 2] = 0.75, -0.25
    run = Trajectory(scene.name, "e", "1", "m", {}, np.array([0.0, 1.0, 2.0]), names, place, turn, rate, rate)
    assert problem.observe(scene, run) == seen
    off = problem.deviations(run)
    assert off == {key: problem.values[key] - seen[key] for key in problem.values}


def test_rate_of_a_motion():
    """At least one over 0.5 s; a speed of 12 m/s over 4 m is 3/s."""
    assert scene_length(SCENE) == LENGTH
    assert precision.motion_rate(SCENE, motion()) == 2.0
    fast = motion()
    fast.velocity[3, 0] = (0.0, 12.0, 0.0)
    assert precision.motion_rate(SCENE, fast) == 3.0
    fast.angular_velocity[5, 0] = (0.0, 3.0, 4.0)
    assert precision.motion_rate(SCENE, fast) == 5.0


def test_largest_acceleration():
    """Gravity has 3 m/s², 4 m at (2/s)² 16 m/s²."""
    run = motion()
    assert precision._acceleration(SCENE, run) == 16.0
    assert precision._acceleration(SCENE.with_(gravity=(0.0, 0.0, -20.0)), run) == 20.0
    run.acceleration[2, 0, 1] = -30.0
    assert precision._acceleration(SCENE, run) == 30.0
    assert precision._acceleration(SCENE, replace(run, acceleration=None)) == 16.0


@pytest.mark.parametrize(
    ("name", "item"),
    [
        ("position", "position of b"),
        ("velocity", "velocity of b"),
        ("angular_velocity", "angular velocity of b"),
        ("acceleration", "acceleration of b"),
        ("angular_acceleration", "angular acceleration of b"),
    ],
)
def test_an_item_of_single_precision_is_named(name, item):
    noise = 1.0 + np.random.default_rng(3).random((9, 1, 3))
    doubles = replace(motion(), **{name: noise})
    singles = replace(motion(), **{name: noise.astype(np.float32).astype(float)})
    assert precision.single_precision(SCENE, doubles) == []
    assert precision.single_precision(SCENE, singles) == [item]


def test_numbers_that_show_no_precision():
    """Constant, simple and small numbers, and fewer than four."""
    rough = (1.0 + np.random.default_rng(3).random((9, 3))).astype(np.float32).astype(float)
    unit = np.ones(3)
    assert precision._is_single(rough / unit, rough)
    assert not precision._is_single(rough[:1] / unit, rough[:1]), "a single sample does not vary"
    assert not precision._is_single(1e-4 * rough, rough), "below 2**-12 of the scale"
    halves = np.round(2 * rough) / 2
    assert not precision._is_single(halves, halves)
    one = np.tile(rough[:1], (9, 1))
    one[:, 0] = rough[:, 0]
    assert precision._is_single(one, one), "one column that varies has nine numbers"
    assert not precision._is_single(one[:3], one[:3]) and precision._is_single(one[:4], one[:4])


def test_reactions_of_single_precision_and_their_scale():
    run = motion()
    wrench = (5.0 + np.random.default_rng(4).random((9, 6))).astype(np.float32).astype(float)
    run.reactions["A"][:] = wrench
    assert precision.single_precision(SCENE, run) == ["reaction in A"]
    [(name, series, scale)] = precision._of_joints(SCENE, run)
    assert name == "reaction in A" and series is run.reactions["A"]
    assert scale == pytest.approx([32.0] * 3 + [128.0] * 3), "2 kg at 16 m/s², and times 4 m"
    run.reactions["A"][0, 0] = -64.0
    [(_, _, scale)] = precision._of_joints(SCENE, run)
    assert scale == pytest.approx([64.0] * 3 + [256.0] * 3), "the largest reaction is twice that"


def test_arrays_that_are_not_finite():
    run = motion()
    assert precision.not_finite(run) == []
    run.acceleration[0, 0, 0] = np.nan
    run.reactions["A"][1, 1] = np.inf
    assert precision.not_finite(run) == ["acceleration", "reaction in A"]
    assert precision.not_finite(replace(run, acceleration=None, reactions=None)) == []


def test_noise_of_a_motion():
    """A lone step of one has sixth differences up to 20 of √924; signs of quaternions do not matter."""
    run = motion(13)
    run.position[6, 0, 1] += 4e-6
    expected = 20e-6 / np.sqrt(924)
    assert precision.grain(SCENE, run) == (pytest.approx(expected), "positions")
    run.orientation[::2] *= -1
    assert precision.grain(SCENE, run)[0] == pytest.approx(expected)
    run.velocity[6, 0, 1] += 4e-5
    assert precision.grain(SCENE, run) == (pytest.approx(20 * 5e-6 / np.sqrt(924), rel=1e-3), "velocities")
    run.angular_velocity[6, 0, 1] += 2e-4
    assert precision.grain(SCENE, run)[1] == "angular velocities"
    smooth = motion(13)
    smooth.position[:, 0, 0] += smooth.times**5
    assert precision.grain(SCENE, smooth)[0] < 1e-14, "sixth differences of t⁵ vanish"


def test_accelerations_of_two_runs():
    """The scale is 4 m / (0.5 s)² = 16 m/s², or the largest expected acceleration; angular ones times 4 m."""
    first, second = motion(), motion()
    second.acceleration[3, 0, 0] = 0.8
    assert push_difference.accelerations_apart(SCENE, first, second) == pytest.approx(0.05)
    second.angular_acceleration[3, 0, 2] = -0.4
    assert push_difference.accelerations_apart(SCENE, first, second) == pytest.approx(0.1)
    first.acceleration[0, 0, 1] = second.acceleration[0, 0, 1] = -32.0
    assert push_difference.accelerations_apart(SCENE, first, second) == pytest.approx(0.05)
    first.angular_acceleration[0, 0, 1] = second.angular_acceleration[0, 0, 1] = 16.0
    assert push_difference.accelerations_apart(SCENE, first, second) == pytest.approx(0.025)
    missing = replace(second, acceleration=None)
    assert push_difference.accelerations_apart(SCENE, first, missing) == pytest.approx(0.025)
    none = replace(missing, angular_acceleration=None)
    assert push_difference.accelerations_apart(SCENE, first, none) == 0.0


def test_reactions_of_two_runs_at_their_last_sample():
    """A force of 10 N is expected; 0.5 N, or 2 N m over 4 m, are 0.05 of it."""
    first, second = motion(), motion()
    first.reactions["A"][-1, 0] = second.reactions["A"][-1, 0] = 10.0
    second.reactions["A"][0] = 99.0
    assert push_difference.pushes_apart(SCENE, first, second) == (0.0, "reactions")
    second.reactions["A"][-1, 1] = 0.5
    assert push_difference.pushes_apart(SCENE, first, second) == (pytest.approx(0.05), "reactions")
    second.reactions["A"][-1, 1] = 0.0
    second.reactions["A"][-1, 3] = 2.0
    assert push_difference.pushes_apart(SCENE, first, second) == (pytest.approx(0.05), "reactions")
    second.acceleration[0, 0, 0] = 1.6
    assert push_difference.pushes_apart(SCENE, first, second) == (pytest.approx(0.1), "accelerations")
    for run in (replace(second, reactions=None), replace(second, reactions={"B": second.reactions["A"]})):
        assert push_difference._reactions(SCENE, first, run, 1e-9) == (0.0, "reactions")
