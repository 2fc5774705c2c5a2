"""Formulation B of the reference, by a spanning tree, against closed forms and formulation A."""

import re

import numpy as np
import pytest

from crosscheck.conformance.mechanisms.parts import linkage
from crosscheck.judge.arithmetic import EXTENDED, doubles
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.reference.tree import tree_motion
from crosscheck.judge.reference.tree_joints import spanning_tree
from crosscheck.judge.truth import closed_form
from mbref.scene import Driver, Scene, TorsionSpring
from mbref.scenes import SCENES

SECONDS = 100.0


@pytest.mark.parametrize(
    ("formulation", "name", "end", "close"),  # s; m: crossings magnify rounding
    [
        (tree_motion, "four_bar", 0.1, 1e-11),
        (tree_motion, "four_bar_quarter", 0.1, 1e-11),
        pytest.param(tree_motion, "four_bar_gravity", 1.0, 1e-11, marks=pytest.mark.slow),
        (natural_motion, "four_bar_gravity", 0.7, 1e-13),
    ],
)
def test_formulation_crosses_singular_positions_on_the_smooth_branch(formulation, name, end, close):
    """The closed form is met to ``close``, and at least two steps cross a singular position."""
    scene, times = SCENES[name](), np.linspace(0.0, end, 6)
    motion, exact = formulation(scene, times, EXTENDED, seconds=SECONDS), closed_form(scene).poses(times)
    assert not motion.reason
    assert len(motion.crossings) >= 2
    assert np.abs(doubles(motion.position) - exact.position).max() < close


def test_tree_formulation_crosses_the_dead_positions_of_equal_crank_and_rod():
    """Crank and rod of 0.308 m lie on each other where the crank is upright. In 0.14 s it turns to θ = π/2
    and on to 3π/2: at both times that formulation B reports, the closed form has the crank's centre 0.154 m
    above and below its pivot, to 2e-5 m, since a polynomial of degree 8 locates them; at 30 rad/s this is
    4 µs. The motion is the closed form to 1e-12 m."""
    scene, times = SCENES["planar_slider_crank_equal"](), np.linspace(0.0, 0.14, 8)
    motion, truth = tree_motion(scene, times, EXTENDED, seconds=SECONDS), closed_form(scene)
    assert not motion.reason
    centres = truth.poses(np.array(motion.crossings)).position[:, 0]
    assert centres == pytest.approx(np.array([[0.0, 0.154, 0.0], [0.0, -0.154, 0.0]]), abs=2e-5)
    assert np.abs(doubles(motion.position) - truth.poses(times).position).max() < 1e-12


@pytest.mark.parametrize(
    ("formulation", "times", "says"),  # s; natural coordinates end within their first step
    [
        (tree_motion, np.linspace(0.0, 0.1, 5), "the start is a singular position"),
        (natural_motion, np.linspace(0.0, 1e-4, 3), "starts in a singular position.*later time"),
    ],
)
def test_formulation_refuses_a_singular_start(formulation, times, says):
    """The straight four-bar has two motions from its start; the reason says so, and no sample is given."""
    motion = formulation(SCENES["four_bar_straight"](), times, EXTENDED, seconds=SECONDS)
    assert re.search(says, motion.reason) and not len(motion.times)


def ring(**changes) -> Scene:
    """Three bars hinged to each other and to the ground in joints P0 to P3."""
    places = [(0.0, 0.0, 0.0), (0.3, 0.2, 0.0), (0.7, 0.1, 0.0), (0.9, 0.0, 0.0)]
    return linkage("ring", places).with_(**changes)


def test_spring_acts_in_a_joint_outside_the_tree():
    """Springs act in all four joints of a ring, of which one is outside the tree. Formulation A has no tree:
    both motions are equal to 1e-15 m, and move a body by over 1 mm."""
    given = {"damping": 0.1, "natural_angle": 0.2}
    springs = [TorsionSpring(joint=f"P{k}", stiffness=3.0 + k, **given) for k in range(4)]
    scene = ring(load=springs)
    assert len(spanning_tree(scene)) == 3
    times = np.linspace(0.0, 0.3, 4)
    a, b = (move(scene, times, EXTENDED, seconds=SECONDS) for move in (natural_motion, tree_motion))
    assert not a.reason and not b.reason
    assert np.abs(doubles(a.position - b.position)).max() < 1e-15
    assert np.abs(doubles(b.position[-1] - b.position[0])).max() > 1e-3


@pytest.mark.parametrize("driven", ["P0", "P1", "P2", "P3"])
def test_driven_joint_is_in_the_tree(driven):
    """Formulation B prescribes coordinates of its tree, which leaves out one of the ring's four joints."""
    tree = spanning_tree(ring(driver=(Driver(joint=driven, polynomial=(0.0, 0.5)),)))
    assert driven in {link.joint.name for link in tree if link.joint is not None}


def test_tree_formulation_states_missing_masses_or_spent_time():
    """The reason of a motion without samples: bodies have no mass, or no CPU time is given."""
    bare = ring().with_(body=[b.model_copy(update={"mass": None, "inertia": None}) for b in ring().body])
    assert "without mass" in tree_motion(bare, np.linspace(0, 1, 3), EXTENDED, seconds=SECONDS).reason
    spent = tree_motion(ring(), np.linspace(0, 1, 3), EXTENDED, seconds=0.0)
    assert "time" in spent.reason and not len(spent.times)
