"""The bound of a reference against tighter runs and closed forms: hard and awkward mechanisms, and starts
that magnify rounding."""

import numpy as np
import pytest

from crosscheck.conformance.mechanisms.awkward import AWKWARD, awkward
from crosscheck.conformance.mechanisms.hard import HARD
from crosscheck.conformance.mechanisms.random_mechanisms import random_mechanism
from crosscheck.judge.arithmetic import EXTENDED
from crosscheck.judge.metrics import error_series
from crosscheck.judge.reference.bound import bounds, differences
from crosscheck.judge.reference.reference import judged, runs
from crosscheck.judge.reference.start_velocities import least_squares, start_velocities
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.reference.tree import tree_motion
from crosscheck.judge.truth import closed_form
from crosscheck.judge.truth.reference_truth import trajectory
from mbref.scene import Scene, TorsionSpring
from tests.helpers.measured import in_many_digits

SECONDS = 200.0
QUICK = ("stiff_spring", "rounded_redundancy", "planes", "rccc", "rounded_platform", "pushed_dead_centre")
SHORTER = {  # s; duration of the test
    **{"near_singular": 0.5, "whip": 0.25, "point_masses": 0.5},
    **{"stiff_chain": 0.3, "stiff_dampers": 0.2, "rounded_door": 0.5},
}
CROSSING = ("two_crossings",)  # over two singular positions, where more digits move another mechanism
ENDING = ("locking", "phased_crank")  # their motion ends before the scene's duration, in a dead centre
LARGE = ("chain_of_twenty", "tumbling_chain")  # a run in thirty digits takes minutes


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.slow] * (name not in QUICK))
        for name in sorted(set(HARD) - {*CROSSING})
    ],
)
def test_reference_of_a_hard_mechanism_is_within_its_bound_of_thirty_digits(name):
    """The truth is the same motion computed with thirty digits. HARD are mechanisms such as stiff springs and
    rows that are redundant up to rounding. Bounds are at most 1e-12."""
    scene = HARD[name]()
    times = np.linspace(0.0, SHORTER.get(name, scene.duration), 5)
    a, second, b = runs(scene, times, SECONDS)
    found, reason = judged(scene, times, a, second, b)
    assert not reason
    place = in_many_digits(scene, times, SECONDS).position
    off = np.abs(a.position - place).max(axis=(1, 2))
    assert (off <= found.bound).all() and found.bound.max() <= 1e-12


@pytest.mark.parametrize(
    ("kind", "seed"),
    [
        pytest.param(kind, seed, marks=[pytest.mark.slow] * (kind not in QUICK or seed > 0))
        for kind in sorted(set(AWKWARD) - set(LARGE))
        for seed in (0, 1, 2)
    ],
)
def test_reference_of_an_awkward_mechanism_is_within_its_bound(kind, seed):
    """The judge states a bound of its reference's error, also with stiff dampers, rounded joints or dead
    centres. The error is the difference from a closed form or from a run in thirty digits, at five times."""
    scene = awkward(kind, seed)
    times = np.linspace(0.0, SHORTER.get(kind, scene.duration), 5)
    motions = runs(scene, times, SECONDS)
    found, reason = judged(scene, times, *motions)
    assert not reason or kind in ENDING, reason
    if closed_form(scene):
        off = error_series(scene, trajectory(scene, found), closed_form(scene).poses(found.times))
    else:
        off = differences(scene, motions[0], in_many_digits(scene, found.times, SECONDS))
    assert float((off / found.bound).max()) <= 1


def test_bound_does_not_fall_after_a_sample_at_which_two_motions_differed():
    """The bound is ten times the largest difference so far, and at least 1e-14, some roundings of doubles."""
    assert bounds(np.array([0.0, 1e-12, 1e-13])) == pytest.approx([1e-14, 1e-11, 1e-11])


@pytest.mark.parametrize("move", [natural_motion, tree_motion])
def test_given_rate_near_a_singular_position_is_kept_to_1e_17(move):
    """The crank is given 1e-3 rad/s near its singular position, which magnifies errors of the start. In
    double precision they would be off by 1e-16 rad/s, in extended by up to 1e-18."""
    motion = move(HARD["start_near_singular"](), [0.0], EXTENDED, seconds=SECONDS)
    assert np.abs(motion.angular_velocity[0, 0] - EXTENDED.array([0.0, 0.0, 1e-3])).max() < 1e-17


def test_start_velocities_fit_given_ones_and_minimise_the_kinetic_energy():
    """Row z₀ + 2 z₁ = 3 and given z₀ = 0, z₁ = 1, which contradict it: the least squares are (1/5, 7/5). The
    other three velocities minimise the kinetic energy: their momenta (M z)₂₋₄ are zero."""
    rows, rates = EXTENDED.array([[1.0, 2.0, 0.0, 0.0, 0.0]]), EXTENDED.array([3.0])
    fit, wanted = EXTENDED.array(np.eye(5)[:2]), EXTENDED.array([0.0, 1.0])
    root = np.random.default_rng(4).normal(size=(5, 5))
    mass = EXTENDED.array(root @ root.T)
    z = start_velocities(EXTENDED, rows, rates, fit, wanted, mass)
    tiny = 50 * EXTENDED.eps
    assert np.abs(z[:2] - EXTENDED.array([1, 7]) / EXTENDED.array([5, 5])).max() < tiny
    assert np.abs((mass @ z)[2:]).max() < tiny * np.abs(mass).max() * np.abs(z).max()


def test_least_squares_of_nearly_parallel_columns_lose_six_digits_alone():
    """Columns are parallel up to 2⁻²⁰ = 1e-6: of extended precision's 1e-19, 1e-13 is left for the solution
    (1, 3); normal equations would square the loss. Ten times this is allowed."""
    eps = EXTENDED.number(2.0**-20)
    matrix = EXTENDED.array([[1.0, 1.0], [1.0, 1.0], [1.0, 0.0]])
    matrix[:, 1] = matrix[:, 0] + EXTENDED.array([1.0, -1.0, 0.5]) * eps
    exact = EXTENDED.array([1.0, 3.0])
    found = least_squares(EXTENDED, matrix, matrix @ exact)
    assert np.abs(found - exact).max() < 1e-12


def drawn(seed: int, joint: str) -> Scene:
    """Return a random mechanism with a torsion spring in a joint."""
    scene = random_mechanism(seed)
    spring = TorsionSpring(joint=joint, stiffness=5.0, damping=0.1, natural_angle=0.3)
    return scene.with_(load=(*scene.load, spring))


@pytest.mark.parametrize(
    ("scene", "times", "steps", "off"),  # measured for the first two: 5e-17 and 1e-16
    [
        pytest.param(awkward("gimbal", 0), np.linspace(0.0, 0.12, 4), 100, 1e-15, id="gimbal"),
        pytest.param(
            awkward("chain_of_twenty", 0), np.linspace(0.0, 0.03, 4), 10, 1e-14, id="chain_of_twenty"
        ),
        pytest.param(drawn(83, "J0"), np.linspace(0.0, 0.5, 3), np.inf, 1e-16, id="dependent_rows"),
    ],
)
def test_formulations_of_the_reference_agree_and_differ_by_rounding(scene, times, steps, off):
    """Natural coordinates and a tree of joints share no equations; poses differ by less than ``off`` (of the
    length, or rad), and B, the tree, takes fewer than ``steps`` steps: steps that are rejected for rounding
    would become ever shorter. The mass matrix of the chain of twenty bodies has the condition 1e6. The rows
    that each formulation retains of redundant ones become dependent at 0.407 s in the last mechanism, which
    is not singular: a step across this time would lose five digits."""
    a, b = (move(scene, times, EXTENDED, seconds=SECONDS) for move in (natural_motion, tree_motion))
    assert not a.reason and not b.reason and b.steps < steps
    assert not a.crossings and not b.crossings
    assert 0 < differences(scene, a, b).max() < off


@pytest.mark.slow
def test_both_formulations_cross_a_singular_position_at_the_same_time():
    """The mechanism has no redundant rows. Each formulation finds one crossing by its own equations; behind
    it the motions differ by less than 1e-12 of the length."""
    scene, times = drawn(100, "J2"), np.linspace(0.0, 0.5, 3)
    a, b = (move(scene, times, EXTENDED, seconds=SECONDS) for move in (natural_motion, tree_motion))
    assert not b.reason and len(a.crossings) == 1 and 0.0 < a.crossings[0] < 0.5
    assert b.crossings == pytest.approx(a.crossings, abs=1e-8)  # s
    assert 0 < differences(scene, a, b).max() < 1e-12
