"""The published problems: their scenes' degrees of freedom, printed values, and mbref's motion of each."""

import functools
from dataclasses import replace

import numpy as np
import pytest

import mbref
from crosscheck.judge.arithmetic import EXTENDED, doubles
from crosscheck.judge.published import BY_SCENE, PUBLISHED
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.reference.tree import tree_motion
from crosscheck.judge.truth import closed_form
from mbref import rotations
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scenes import SCENES, find_scene
from mbref.simulation.simulate import simulate
from tests.helpers.measured import MARGIN, ROUNDING

SECONDS = 100.0
PROBLEMS = {  # degrees of freedom, and measured error of mbref (m)
    "point_pendulum": (1, 5.8e-12),
    "andrews_squeezer": (1, 1.3e-13),
    "bricard": (1, 9.2e-14),
    "bricard_thin": (1, 5.4e-13),
    "flyball_governor": (4, ROUNDING),  # turn of the shaft, slide, and two arms on springs
    "rigid_slider_crank": (1, 3.4e-13),
    "rigid_slider_crank_middle": (1, 4.3e-13),
    "heavy_top": (3, 1.2e-11),
    "bennett": (1, 4.7e-13),
    "sarrus": (1, 1.6e-13),
    "h_frame": (1, 8.1e-13),
}
ROWS = {"fixed": 6, "revolute": 5, "translational": 5, "universal": 4, "spherical": 3}  # of a joint
BRIEF = {"andrews_squeezer": 0.01, "flyball_governor": 0.05, "heavy_top": 0.1}  # s


@pytest.mark.parametrize("name", PROBLEMS)
def test_published_problems_have_their_freedoms_and_redundant_rows(name):
    """The linkages of Andrews, Bricard, Bennett and Sarrus have one degree of freedom by their publications;
    freedoms of the others are counted by hand (PROBLEMS). Redundant rows are the freedoms minus Kutzbach's
    count, 6 for each body less the rows of joints: 1 - (6 · 7 - 5 · 10) = 9 for Andrews' squeezer."""
    scene, (freedoms, _) = SCENES[name](), PROBLEMS[name]
    kutzbach = 6 * len(scene.body) - sum(ROWS[joint.type] for joint in scene.joint)
    counts = mbref.counts(scene)
    assert (counts.degrees_of_freedom, counts.redundant) == (freedoms, freedoms - kutzbach)


@pytest.mark.parametrize("name", PROBLEMS)
def test_mbref_moves_as_the_reference(name):
    """Over 0.2 s, or a shorter time (BRIEF), positions differ by at most ten times the measured error in
    PROBLEMS from the judge's reference; a body moves by over 1 mm."""
    run, exact = run_and_reference(name)
    assert np.abs(run.position - exact.position).max() < MARGIN * PROBLEMS[name][1]
    assert np.abs(exact.position[-1] - exact.position[0]).max() > 1e-3


@pytest.mark.parametrize("name", PROBLEMS)
def test_problem_s_own_measure_accepts_the_reference_and_refuses_a_wrong_motion(name):
    """A publication says what is measured and which error is accepted. The wrong motion is moved by 1 mm
    along each axis, turned by some milliradians and 2 % faster."""
    scene, (_, problem) = SCENES[name](), BY_SCENE[name]
    _, exact = run_and_reference(name)
    slight = rotations.from_vector(np.outer(np.arange(1, len(scene.body) + 1), (1e-3, 2e-3, 3e-3)))
    turned = rotations.multiply(slight, exact.orientation)
    faster = {"velocity": 1.02 * exact.velocity, "orientation": turned}
    wrong = replace(exact, position=exact.position + 1e-3, **faster)
    good, bad = (problem.measure(scene, motion, exact) for motion in (exact, wrong))
    assert good <= problem.acceptance < bad


@functools.cache
def run_and_reference(name: str) -> tuple[Trajectory, Trajectory]:
    """mbref's completed run of a scene, and the reference's motion at its samples."""
    scene, times = SCENES[name](), np.linspace(0.0, BRIEF.get(name, 0.2), 4)
    run, motion = simulate(scene, times=times), natural_motion(scene, times, EXTENDED, seconds=SECONDS)
    assert run.outcome is Outcome.COMPLETED and not motion.reason, run.message
    names = ("position", "orientation", "velocity", "angular_velocity")
    return run, replace(run, **{name: doubles(getattr(motion, name)) for name in names})


def test_sarrus_platform_stays_level_and_on_its_line():
    """Sarrus' linkage guides its platform along the vertical z without a tilt: the judge's reference leaves z
    by less than 1e-15 m or rad. The platform falls by over 0.1 m in 0.3 s."""
    motion = natural_motion(SCENES["sarrus"](), np.linspace(0, 0.3, 5), EXTENDED, seconds=SECONDS)
    platform = doubles(motion.position[:, 0])
    assert np.abs(platform[:, :2]).max() < 1e-15
    assert platform[-1, 2] < platform[0, 2] - 0.1
    assert np.abs(doubles(motion.orientation[:, 0, 1:])).max() < 1e-15


@pytest.mark.slow
def test_andrews_reference_of_the_test_set_is_wrong_from_the_eleventh_digit():
    """The printed β at the end, 15.8107711962 rad, is 1.1e-9 to 1.2e-9 rad off the judge's."""
    problem = PUBLISHED["A03"]
    motion = natural_motion(find_scene(problem.scene), problem.times(), EXTENDED, seconds=SECONDS)
    deviation = problem.deviations(motion)
    assert 1.1e-9 < deviation["beta"] < 1.2e-9, f"β printed is {deviation['beta']:.3e} rad off"


def test_numbers_printed_for_the_four_bar_a02_are_within_4e_6_of_its_closed_form():
    """Printed are place (m) and velocity (m/s) of the crank's end at 10 s, twice as far from the ground's
    hinge, the origin, as the crank's centre. A finite-element code of second order printed them, whose step
    of 1.25e-4 s leaves errors of some 1e-6; the position is within 1e-6."""
    problem = PUBLISHED["A02"]
    exact = closed_form(find_scene(problem.scene)).poses(np.array([problem.time]))
    place, velocity = 2 * exact.position[0, 0, :2], 2 * exact.velocity[0, 0, :2]
    assert np.abs((problem.values["x"], problem.values["y"]) - place).max() < 1e-6
    assert np.abs((problem.values["x'"], problem.values["y'"]) - velocity).max() < 4e-6


@pytest.mark.slow
def test_printed_slide_of_the_published_governor_is_off_by_six_micrometres():
    """The printed s, of a method of second order with steps of 0.5 ms, is 6e-6 to 7e-6 m off the judge's
    reference after 10 s, and the printed s' less than 1e-6 m/s."""
    problem = PUBLISHED["A05"]
    motion = tree_motion(find_scene(problem.scene), problem.times(), EXTENDED, seconds=SECONDS)
    deviation = problem.deviations(motion)
    assert 6e-6 < deviation["s"] < 7e-6 and abs(deviation["s'"]) < 1e-6, deviation
