"""Crossings are placed and listed with their branches, any of which can be taken."""

import math

import numpy as np
import pytest

from crosscheck.conformance.mechanisms.parts import linkage
from mbref.cli import main
from mbref.design.along_motion import along_motion
from mbref.motions.motion import Motion
from mbref.scenes.five_bar import five_bar
from mbref.scenes.four_bar import four_bar, four_bar_gravity
from mbref.scenes.four_bar_chain import four_bar_chain
from mbref.scenes.planar_slider_crank import slider_crank
from mbref.simulation.simulate import Limits, simulate
from tests.helpers.statics import hinge, rod

RATE = 124.8  # rad/s, of the driven crank
ROUNDING = 1e-12  # m, of poses of about 0.5 m after some steps of 1e-15
RATES = 1e-8  # rad/s, rounding of rates of about 100 rad/s, magnified at singular positions
LOST = 1e-8  # J, of a motion with about 5 J and rtol 1e-9


def test_flat_rhombus_lists_its_smooth_and_its_folding_branch():
    """The rates of crank, coupler and rocker are known in closed form. At θ = π the coupler may fold on the
    crank, and the rocker rests: (ω, ω, 0). On the smooth branch the coupler stays parallel: (ω, 0, ω). At θ =
    0 the fold would need a crank at rest. Limits are rounding."""
    first, second = simulate(four_bar(), "taylor", [0.05]).crossings
    assert first.sentence == "one branch" and second.sentence == "2 branches" and second.taken == 1
    expected = np.array([[-RATE, 0.0, -RATE], [-RATE, -RATE, 0.0]])
    assert np.abs(second.angular_velocity[:, :, 2] - expected).max() < RATES
    assert np.abs(second.position[:, 1]).max() < ROUNDING, "all bodies lie on the x axis there"


def test_flat_five_bar_has_one_branch_at_every_crossing():
    """The fifth bar keeps the coupler parallel: it cannot fold. In 0.05 s the crank is flat at 0 and -π."""
    crossings = simulate(five_bar(), "taylor", [0.05]).crossings
    assert len(crossings) == 2 and {c.sentence for c in crossings} == {"one branch"}


def test_folding_branch_of_a_driven_rhombus_lays_the_coupler_on_the_crank():
    """Behind the crossing the middles of crank and coupler are both at L/2 (cos θ, sin θ), L = 0.5 m, and the
    rocker rests. Samples before it do not depend on the branch, to rounding."""
    times = np.linspace(0.0, 0.06, 241)
    smooth = simulate(four_bar(), "taylor", times)
    fold = simulate(four_bar(), "taylor", times, Limits(branches={2: 2}))
    assert fold.outcome.label == "COMPLETED" and [c.taken for c in fold.crossings] == [1, 2]
    behind = times > fold.crossings[1].time
    assert np.abs(fold.position[~behind] - smooth.position[~behind]).max() < ROUNDING
    angle = math.pi / 2 - RATE * times[behind]
    tip = 0.25 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    assert np.abs(fold["crank"].position[behind] - tip).max() < ROUNDING
    assert np.abs(fold["coupler"].position[behind] - tip).max() < ROUNDING
    assert np.abs(fold["rocker"].angular_velocity[behind]).max() < RATES


def test_second_branch_of_a_swinging_rhombus_keeps_the_energy_and_leaves_the_smooth_motion():
    """Gravity and rigid joints lose no energy, to 2 rtol. Up to the crossing the poses are those of the
    smooth branch, to rounding; from the second sample after it they differ by more than 1 mm."""
    scene, times = four_bar_gravity(0.3), np.linspace(0.0, 1.0, 41)
    run = simulate(scene, "taylor", times, Limits(branches={1: 2}))
    assert run.outcome.label == "COMPLETED" and run.crossings[0].taken == 2
    assert np.ptp(run.energy) < LOST
    off = np.abs(run.position - simulate(scene, "taylor", times).position).max(axis=(1, 2))
    behind = times > run.crossings[0].time
    assert off[~behind].max() < ROUNDING and off[behind][1:].min() > 1e-3  # m


@pytest.mark.parametrize("loops", [2, 3])
def test_chain_flat_in_all_loops_lists_the_smooth_branch_and_the_fold_of_its_first_loop(loops):
    """All links lie on one line. On the smooth branch all uprights turn; where the first loop folds, its
    first upright alone rests, to rounding. The sentence says that there are further branches."""
    run = simulate(four_bar_chain(loops), "taylor", [1.0])
    (crossing,) = run.crossings
    assert np.abs(crossing.position[:, 1]).max() < ROUNDING
    assert crossing.sentence == "2 branches and others that second order does not determine"
    resting = np.abs(crossing.angular_velocity[:, : loops + 1, 2]) < RATES
    assert not resting[0].any() and resting[1].tolist() == [True] + [False] * loops


@pytest.mark.parametrize("loops", [2, 3])
def test_second_branch_of_a_chain_folds_its_first_loop_and_keeps_the_energy(loops):
    """In the folded loop middles of bar and upright coincide, to rounding; the energy stays, to 2 rtol."""
    scene, times = four_bar_chain(loops), np.linspace(0.0, 1.0, 21)
    run = simulate(scene, "taylor", times, Limits(branches={1: 2}))
    assert run.outcome.label == "COMPLETED" and np.ptp(run.energy) < LOST
    behind = times > run.crossings[0].time
    folded = run["bar1"].position[behind] - run["upright1"].position[behind]
    assert behind.any() and np.abs(folded).max() < ROUNDING, "the first bar lies on the second upright"


@pytest.mark.parametrize("wrong", [{1: 0}, {1: "x"}, 3, [(1,)], {1: 1.5}], ids=str)
def test_branches_that_are_not_positive_whole_numbers_are_refused(wrong):
    """``branches`` maps the number of a crossing to the number of the branch that is taken there."""
    with pytest.raises(ValueError, match="branches: must be"):
        Limits(branches=wrong)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("0.1 --branch 2=3", "--branch: the motion passes 0 singular positions up to t = 0.1 s, and no"),
        ("0.5 --branch 2=3", "--branch: the motion passes 1 singular position up to t = 0.5 s, and no"),
        ("0.5 --branch 1=3", "--branch: the crossing at t = 0.162337 s has no branch 3: 2 branches"),
        ("0.5 --branch 1=2 --method lm1", "--branch: lm1"),
        ("0.5 --branch 1=1 --branch 1=2", "--branch: 1 is given twice; give it once"),
        ("0.5 --code generated --method lm1", "--code: lm1"),
    ],
)
def test_command_names_the_option_that_asks_for_an_impossible_branch_or_code(words, message, capsys):
    """The words begin with the duration (s). By the judge's closed form the swinging rhombus is flat first at
    0.162337 s, where it has two branches, and next after 0.5 s. The method `lm1` crosses no singular position
    and has no generated code."""
    assert main(["run", "four_bar_gravity", "--duration", *words.split()]) == 2
    said = capsys.readouterr().err
    assert said.startswith(message) and said.count("\n") == 1, said


def test_crossing_read_from_a_record_file_equals_the_saved_one(tmp_path):
    """A rhombus released at 0.3 rad is flat once in 0.5 s; numbers are read back to the bit."""
    run = simulate(four_bar_gravity(0.3), "taylor", [0.5])
    run.save(tmp_path / "run.json")
    (read,) = Motion.load(tmp_path / "run.json").crossings
    (crossing,) = run.crossings
    assert (read.time, read.taken, read.sentence) == (crossing.time, crossing.taken, crossing.sentence)
    assert np.array_equal(read.angular_velocity, crossing.angular_velocity)


def test_crossings_are_none_without_detection_and_empty_if_no_position_is_passed():
    """Partitioning detects none; with a crank of 0.1 m and a rod of 0.3 m there is none to pass."""
    assert simulate(four_bar_gravity(0.3), "mpi-svd+partitioning", [0.1]).crossings is None
    assert simulate(slider_crank(0.1, 0.3, 0.3, "crank"), "taylor", [0.1]).crossings == ()


def test_undetermined_reactions_are_counted_and_one_more_at_a_singular_position():
    """``open_reactions`` counts the components of a reaction that equilibrium does not determine. The driven
    rhombus has 19 rows of rank 18: one redundant row, in which all four joints take part, leaves one
    component of each open. At its flat position, the second sample, one more row depends on the others and
    leaves one more open, also the driver's torque; 10 µs later it does not."""
    flat = simulate(four_bar(), "taylor", [0.05]).crossings[0].time
    run = simulate(four_bar(), "taylor", [0.001, flat, flat + 1e-5])
    found = {part: tuple(row) for part, row in run.open_reactions.items()}
    assert found == {**dict.fromkeys("ABCD", (1, 2, 1)), "driver(A)": (0, 1, 0)}


def test_counts_of_undetermined_reactions_are_read_back_from_a_record_file(tmp_path):
    """Equilibrium leaves one component in each of the driven rhombus's four joints open, at each sample."""
    simulate(four_bar(), "taylor", [0.001, 0.002]).save(tmp_path / "run.json")
    read = Motion.load(tmp_path / "run.json")
    assert read.joint("A").open.tolist() == read.columns()["D.open"].tolist() == [1, 1]


def test_diagnosis_calls_a_straight_arch_shaky():
    """Shaky: the constraints at first order allow a velocity of the arch, those at second order forbid it. A
    pendulum beside it moves, so that there is a motion to diagnose; the pendulum alone is not shaky."""
    bob, pin = rod("bob", (3.5, 0.0, 0.0), 1.0, 0.1), hinge("D", ("ground", "bob"), (3.0, 0.0, 0.0))
    arch = linkage("arch", [(-1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)], (1.0, 1.0))
    beside = arch.with_(body=(*arch.body, bob), joint=(*arch.joint, pin))
    assert along_motion(beside).shaky
    assert not along_motion(beside.with_(body=(bob,), joint=(pin,))).shaky
