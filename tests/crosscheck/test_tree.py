"""Formulation B of the reference: its panels, singular positions, and features its tree treats apart."""

import itertools

import numpy as np
import pytest

from crosscheck.judge.arithmetic import DOUBLE, EXTENDED, doubles
from crosscheck.judge.reference.crossing import bridged, singular_ahead, singular_time
from crosscheck.judge.reference.panels import Panels
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.reference.tree import tree_motion
from crosscheck.judge.reference.tree_joints import spanning_tree
from crosscheck.judge.truth import closed_form
from mbref.scene import Body, Driver, Revolute, Scene, TorsionSpring
from mbref.scenes import SCENES

SECONDS = 100.0
Z = (0.0, 0.0, 1.0)


class Oscillator:
    """x'' = -x as a state (x, x'); never singular."""

    light = 1

    def light_rates(self, y):
        return y[:, 1:]

    def other_rates(self, t, y):
        return -1 * y[:, :1], np.ones(len(y))

    def nearer(self, t, y):
        return y


@pytest.mark.parametrize("numbers", [DOUBLE, EXTENDED], ids=lambda numbers: numbers.name)
def test_panel_of_an_oscillator_is_the_cosine(numbers):
    """Over 2 s from x = 1 at rest: x = cos t, x' = -sin t, x'' = -cos t, to the panel's tolerance."""
    panels = Panels(numbers, 34)
    guess = np.repeat(numbers.array([[1.0, 0.0]]), panels.count, axis=0)
    panel = panels.panel(Oscillator(), numbers.number(0.0), numbers.number(2.0), guess)
    assert panel.settled and panel.crossing is None
    t = numbers.array([0.3, 1.1, 2.0])
    states, rates = panels.sampled(panel, t)
    exact = np.stack([np.cos(t), -np.sin(t)], axis=1)
    assert np.abs(doubles(states - exact)).max() <= panels.tolerance
    assert np.abs(doubles(rates[:, 0] + np.cos(t))).max() <= panels.tolerance


def test_panel_that_is_too_long_does_not_converge_and_asks_for_a_shorter_one():
    """30 rad of an oscillator on 34 nodes; a factor below 1 is the next length over this one."""
    panels = Panels(EXTENDED, 34)
    guess = np.repeat(EXTENDED.array([[1.0, 0.0]]), panels.count, axis=0)
    panel = panels.panel(Oscillator(), EXTENDED.number(0.0), EXTENDED.number(30.0), guess)
    assert not panel.settled and panel.factor < 1


def test_continued_panel_is_within_its_stated_loss_of_digits():
    """A panel to 2 s is continued by a factor of 1.3; the cosine at 2.6 s is within the stated loss."""
    panels = Panels(EXTENDED, 34)
    guess = np.repeat(EXTENDED.array([[1.0, 0.0]]), panels.count, axis=0)
    panel = panels.panel(Oscillator(), EXTENDED.number(0.0), EXTENDED.number(2.0), guess)
    longer, lost = panels.continued(panel, 1.3, 2.3)
    states, _ = panels.sampled(longer, EXTENDED.array([1.0, 2.6]))
    off = np.abs(doubles(states[:, 0] - np.cos(EXTENDED.array([1.0, 2.6])))).max()
    assert off < lost < 1e-10
    assert longer.time(longer.crossing) == pytest.approx(2.3)


def test_zero_of_a_signed_distance_is_a_singular_time():
    """On 40 Chebyshev nodes of (-1, 1): |distances| with a zero at 0.2, one that comes near 0.2 only, and one
    whose zero, 1.5, lies beyond the panel."""
    nodes = -np.cos(np.pi * np.arange(40) / 39)
    signed = np.sin(nodes - 0.2) + 0.1 * nodes**2 - 0.004
    assert abs(singular_time(nodes, np.abs(signed)) - 0.2) < 1e-6
    assert singular_time(nodes, np.sqrt((nodes - 0.2) ** 2 + 0.02**2)) is None
    assert singular_ahead(nodes, 1.5 - nodes) == pytest.approx(1.5)
    assert singular_ahead(nodes, 1.5 + nodes) is None


def test_bridged_rates_replace_wrong_ones_near_a_singular_time():
    """Rates exp(x), wrong within 0.1 of a singular position at 0.1, follow from the polynomial of the
    others."""
    nodes = -np.cos(np.pi * np.arange(40) / 39)
    exact = np.exp(nodes)[:, None]
    distance = np.abs(nodes - 0.1)
    spoilt = np.where(distance[:, None] < 0.1, 7.0, exact)
    assert np.abs(bridged(nodes, spoilt, distance) - exact).max() < 1e-12


@pytest.mark.parametrize("name", ["four_bar", "four_bar_quarter", "four_bar_gravity"])
def test_tree_formulation_crosses_singular_positions_on_the_smooth_branch(name):
    """The truth is the closed form; at least three singular positions are crossed."""
    scene = SCENES[name]()
    times = np.linspace(0.0, scene.duration, 6)
    motion, exact = tree_motion(scene, times, EXTENDED, seconds=SECONDS), closed_form(scene).poses(times)
    assert not motion.reason
    assert len(motion.crossings) >= 3
    off = np.abs(doubles(motion.position) - exact.position).max()
    assert off < 1e-11, f"{name}: off by {off:.1e} m after {len(motion.crossings)} singular positions"


def test_tree_formulation_crosses_the_dead_positions_of_equal_crank_and_rod():
    """Picard's iteration converges on no panel across these positions; the truth is the closed form, whose
    crank is upright at 0.061192 s and 0.120704 s."""
    scene, times = SCENES["planar_slider_crank_equal"](), np.linspace(0.0, 0.14, 8)
    motion, exact = tree_motion(scene, times, EXTENDED, seconds=SECONDS), closed_form(scene).poses(times)
    assert not motion.reason
    assert motion.crossings == pytest.approx((0.061192, 0.120704), abs=3e-6)
    off = np.abs(doubles(motion.position) - exact.position).max()
    assert 0 < off < 1e-12, f"off by {off:.1e} m"


def test_tree_formulation_refuses_a_singular_start():
    motion = tree_motion(SCENES["four_bar_straight"](), np.linspace(0, 0.1, 5), EXTENDED, seconds=SECONDS)
    assert "singular position" in motion.reason
    assert not len(motion.times)


def ring(**changes) -> Scene:
    """Two links on each other and on the ground, each joint of which is driven or has a spring."""
    places = ((0.0, 0.0), (0.3, 0.2), (0.7, 0.1), (0.9, 0.0))
    bodies = [
        Body(
            name=f"b{k}",
            mass=1.0,
            inertia=(0.01, 0.01, 0.02),
            position=((p[0] + q[0]) / 2, (p[1] + q[1]) / 2, 0.0),
        )
        for k, (p, q) in enumerate(itertools.pairwise(places))
    ]
    chain = ["ground", "b0", "b1", "b2", "ground"]
    joints = [
        Revolute(name=f"J{k}", bodies=(chain[k], chain[k + 1]), anchor=(*place, 0.0), axis=Z)
        for k, place in enumerate(places)
    ]
    return Scene(name="ring", gravity=(0.0, -9.81, 0.0), body=bodies, joint=joints, **changes)


def test_spring_of_a_joint_outside_the_tree_has_its_angle():
    """Springs act in all four joints of a ring, of which one is outside the tree: both formulations agree."""
    springs = [
        TorsionSpring(joint=f"J{k}", stiffness=3.0 + k, damping=0.1, natural_angle=0.2) for k in range(4)
    ]
    scene = ring(load=springs)
    assert len(spanning_tree(scene)) == 3
    times = np.linspace(0.0, 0.3, 4)
    a, b = (move(scene, times, EXTENDED, seconds=SECONDS) for move in (natural_motion, tree_motion))
    assert not a.reason and not b.reason
    apart = np.abs(doubles(a.position - b.position)).max()
    assert apart < 1e-15, f"formulations differ by {apart:.1e} m"
    assert np.abs(doubles(b.position[-1] - b.position[0])).max() > 1e-3


def test_driven_joint_is_in_the_tree():
    """Formulation B prescribes tree coordinates; its motion is formulation A's."""
    driver = Driver(joint="J3", polynomial=(0.0, 0.5))
    scene = ring(driver=(driver,))
    assert any(link.joint is not None and link.joint.name == "J3" for link in spanning_tree(scene))
    times = np.linspace(0.0, 0.2, 3)
    a, b = (move(scene, times, EXTENDED, seconds=SECONDS) for move in (natural_motion, tree_motion))
    assert not a.reason and not b.reason
    assert np.abs(doubles(a.position - b.position)).max() < 1e-15


def test_tree_formulation_states_missing_masses_or_spent_time():
    bare = ring().with_(body=[b.model_copy(update={"mass": None, "inertia": None}) for b in ring().body])
    assert "without mass" in tree_motion(bare, np.linspace(0, 1, 3), EXTENDED, seconds=SECONDS).reason
    spent = tree_motion(ring(), np.linspace(0, 1, 3), EXTENDED, seconds=0.0)
    assert "time" in spent.reason and not len(spent.times)
