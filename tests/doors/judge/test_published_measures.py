"""Measures of published problems, on motions of a block and of two hinges that are off by known amounts."""

from dataclasses import replace

import numpy as np
import pytest

from crosscheck.judge import published_measures as measures
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import Body, Revolute, Scene

ARM = Body(name="arm", mass=2.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 0.0, 0.0))
FAR = Body(name="far", mass=3.0, inertia=(1.0, 1.0, 1.0), position=(3.0, 4.0, 0.0))
HINGES = tuple(
    Revolute(name=name, bodies=("ground", body), anchor=anchor, axis=(0.0, 0.0, 1.0))
    for name, body, anchor in (("A", "arm", (0.0, 0.0, 0.0)), ("B", "far", (3.0, 4.0, 0.0)))
)
SCENE = Scene(name="two", gravity=(0.0, 0.0, -10.0), body=(ARM, FAR), joint=HINGES, duration=1.0)
TIMES = np.array([0.0, 0.5, 1.0])


def at_rest(k: int = 3) -> Trajectory:
    """Return k samples, 0.5 s apart, of "arm" at (1, 0, 0) m and "far" at (3, 4, 0) m."""
    still = np.zeros((k, 2, 3))
    places = np.tile([ARM.position, FAR.position], (k, 1, 1))
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (k, 2, 1))
    return Trajectory("two", "e", "1", "m", {}, TIMES[:k], ("arm", "far"), places, turns, still, still.copy())


def moved(sample: int, body: int, by: tuple[float, float, float]) -> Trajectory:
    run = at_rest()
    run.position[sample, body] += by
    return run


def test_energy_measure_is_the_largest_change_in_joule():
    """2 kg at 3 m/s have 9 J; 3 kg higher by 0.1 m, at g = 10 m/s², have 3 J."""
    fast = at_rest()
    fast.velocity[2, 0] = (0.0, 3.0, 0.0)
    assert measures.energy(SCENE, fast, None) == pytest.approx(9.0)
    assert measures.energy(SCENE, moved(1, 1, (0.0, 0.0, 0.1)), None) == pytest.approx(3.0)


def test_distance_measures_compare_a_centre_with_the_truth():
    """Body "far" is 5 m from the origin, and off by 0.5 m at one of three samples. The largest distance is
    0.5 m, relative to 5 m it is 0.1, and the root mean square of three samples is 0.5 m / √3."""
    off, true = moved(1, 1, (0.3, 0.0, 0.4)), at_rest()
    assert measures.distance("far")(SCENE, off, true) == pytest.approx(0.5)
    assert measures.distance("arm")(SCENE, off, true) == 0.0
    assert measures.relative_distance("far")(SCENE, off, true) == pytest.approx(0.1)
    assert measures.mean_square_distance("far")(SCENE, off, true) == pytest.approx(0.5 / np.sqrt(3))


def end(scene: Scene, motion: Trajectory) -> dict[str, float]:
    """Return x of the arm and y of "far" (m) at the last sample."""
    return {"x": float(motion.position[-1, 0, 0]), "y": float(motion.position[-1, 1, 1])}


OF_ALL = (measures.distance("far"), measures.relative_distance("far"), measures.mean_square_distance("far"))
OF_ALL += (measures.relative_to_each(lambda motion: motion.position[:, :, 0]),)
AT_THE_END = measures.relative_at_the_end(end, ("x", "y"))


def test_truth_that_ends_earlier_judges_only_its_own_samples():
    """The third sample is off by 9 m; the truth has two samples. A measure of the end is None."""
    for measure in OF_ALL:
        assert measure(SCENE, moved(2, 1, (9.0, 0.0, 0.0)), at_rest(2)) == 0.0
    assert AT_THE_END(SCENE, at_rest(), at_rest(2)) is None


@pytest.mark.parametrize("measure", (*OF_ALL, AT_THE_END), ids=["distance", "relative", "rms", "each", "end"])
def test_without_a_truth_there_is_no_measure(measure):
    """None stands for no measure; with a truth the motion at rest has one."""
    assert measure(SCENE, at_rest(), at_rest()) == 0.0
    assert measure(SCENE, at_rest(), None) is None


def test_relative_measure_is_the_largest_over_all_observed_numbers():
    """2 m is off by 0.02 m: 0.01. 1e-5 m is off by 3e-5 m: 0.03, over the least denominator 1e-3 m."""

    def first(motion: Trajectory) -> np.ndarray:
        return motion.position[:, :, 0]

    measure, true = measures.relative_to_each(first), at_rest()
    true.position[:, 0, 0], true.position[:, 1, 0] = 2.0, 1e-5
    run = replace(true, position=true.position.copy())
    run.position[1, 0, 0] += 0.02
    assert measure(SCENE, run, true) == pytest.approx(0.01)
    run.position[2, 1, 0] -= 3e-5
    assert measure(SCENE, run, true) == pytest.approx(0.03)


def test_end_measure_is_the_largest_relative_error_of_the_last_sample():
    """At the end x is off by 0.25 of 1 m, y by 2 of 4 m, or x by 1.75 of -1 m; only the end counts."""
    run = moved(2, 0, (-0.25, 0.0, 0.0))
    run.position[2, 1, 1] += 2.0
    run.position[1] += 100.0
    assert AT_THE_END(SCENE, run, at_rest()) == pytest.approx(0.5)
    assert measures.relative_at_the_end(end, ("x",))(SCENE, run, at_rest()) == pytest.approx(0.25)
    negative = at_rest()
    negative.position[2, 0, 0] = -1.0
    assert measures.relative_at_the_end(end, ("x",))(SCENE, run, negative) == pytest.approx(1.75)


def turning(angles: tuple[tuple[float, float], ...]) -> Trajectory:
    """Both bodies turned about z by angles (rad) at each sample, with rates that pass them."""
    run = at_rest(len(angles))
    for k, pair in enumerate(angles):
        for b, angle in enumerate(pair):
            run.orientation[k, b] = rotations.from_vector(np.array([0.0, 0.0, angle]))
    rates = np.gradient(np.array(angles), TIMES[: len(angles)], axis=0)
    run.angular_velocity[:, :, 2] = rates
    run.position[:, 0, :2] = [(np.cos(a), np.sin(a)) for a, _ in angles]
    return run


def test_opposite_hinges_measure_is_the_largest_sum_of_both_angles():
    """Angles of A and B at three samples; the published sum stays zero, exact to a rounding, 1e-15 rad."""
    pair = measures.opposite_hinges([("A", "B")])
    assert pair(SCENE, turning(((0.0, 0.0), (0.2, -0.2), (0.5, -0.5))), None) == pytest.approx(0.0, abs=1e-15)
    assert pair(SCENE, turning(((0.0, 0.0), (0.2, -0.3), (0.5, -0.44))), None) == pytest.approx(0.1)
    assert pair(SCENE, turning(((0.0, 0.0), (0.2, -0.3), (0.5, -0.9))), None) == pytest.approx(0.4)
    assert measures.opposite_hinges([])(SCENE, at_rest(), None) == 0.0


def test_guided_measure_is_the_distance_off_the_line_or_the_tilt():
    """The larger counts: the distance (m) from the first sample's vertical line, or the tilt (rad)."""
    guided = measures.guided("far")
    assert guided(SCENE, moved(1, 1, (0.03, 0.04, 7.0)), None) == pytest.approx(0.05)
    tilted = at_rest()
    tilted.orientation[2, 1] = rotations.from_vector(np.array([0.0, 0.2, 0.0]))
    assert guided(SCENE, tilted, None) == pytest.approx(0.2)
    tilted.position[0, 1, 0] += 0.3
    assert guided(SCENE, tilted, None) == pytest.approx(0.3)
    assert measures.guided("arm")(SCENE, tilted, None) == 0.0
