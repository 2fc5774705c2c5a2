"""References of awkward mechanisms are within their bound of a closed form or of a run in thirty digits."""

import numpy as np
import pytest

from crosscheck.conformance.mechanisms.awkward import AWKWARD, awkward
from crosscheck.judge.arithmetic import EXTENDED
from crosscheck.judge.metrics import error_series
from crosscheck.judge.reference.bound import differences
from crosscheck.judge.reference.reference import judged, runs
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.reference.tree import tree_motion
from crosscheck.judge.truth import closed_form
from crosscheck.judge.truth.reference_truth import trajectory
from tests.helpers.measured import in_many_digits

SECONDS = 200.0
QUICK = ("rccc", "rounded_platform", "pushed_dead_centre")
ENDING = ("locking", "phased_crank")  # their motion ends before the scene's duration, in a dead centre
LARGE = ("chain_of_twenty", "tumbling_chain")  # a run in thirty digits takes minutes
SHORTER = {"stiff_chain": 0.3, "stiff_dampers": 0.2, "rounded_door": 0.5}  # s; duration of the test


def error_over_bound(kind: str, seed: int) -> float:
    """Return the largest ratio of the reference's error to its bound, at five times. The error is the
    difference from a closed form or from a run in thirty digits."""
    scene = awkward(kind, seed)
    times = np.linspace(0.0, SHORTER.get(kind, scene.duration), 5)
    motions = runs(scene, times, SECONDS)
    found, reason = judged(scene, times, *motions)
    assert not reason or kind in ENDING, reason
    if closed_form(scene):
        off = error_series(scene, trajectory(scene, found), closed_form(scene).poses(found.times))
    else:
        off = differences(scene, motions[0], in_many_digits(scene, found.times, SECONDS))
    return float((off / found.bound).max())


CASES = [
    pytest.param(kind, seed, marks=[pytest.mark.slow] * (kind not in QUICK or seed > 0))
    for kind in sorted(set(AWKWARD) - set(LARGE))
    for seed in (0, 1, 2)
]


@pytest.mark.parametrize(("kind", "seed"), CASES)
def test_reference_of_an_awkward_mechanism_is_within_its_bound(kind, seed):
    """The judge states a bound of its reference's error, also with stiff dampers, rounded joints or dead
    centres. The error is the difference from a closed form or from a run in thirty digits."""
    assert error_over_bound(kind, seed) <= 1


@pytest.mark.parametrize(
    ("kind", "end", "steps", "off"),
    [("gimbal", 0.12, 100, 1e-15), ("chain_of_twenty", 0.03, 10, 1e-14)],  # measured: 5e-17 and 1e-16 m
)
def test_formulations_of_the_reference_agree_on_a_gimbal_and_an_ill_conditioned_chain(kind, end, steps, off):
    """Natural coordinates and a tree of joints share no equations; poses differ by less than ``off`` (m,
    rad), and B, the tree, takes fewer than ``steps`` steps: steps that are rejected for rounding would become
    ever shorter. The chain's mass matrix has the condition 1e6."""
    scene, times = awkward(kind, 0), np.linspace(0.0, end, 4)
    a, b = (move(scene, times, EXTENDED, seconds=SECONDS) for move in (natural_motion, tree_motion))
    assert not a.reason and not b.reason and b.steps < steps
    assert differences(scene, a, b).max() < off
