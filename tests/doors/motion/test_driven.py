"""Driven motions by Taylor series: closed forms, over many singular positions and near some."""

import math

import numpy as np
import pytest

from mbref.scene import Cylindrical, Driver, Revolute
from mbref.scenes import SCENES
from mbref.scenes.four_bar import four_bar
from mbref.scenes.links import CRANK_RATE
from mbref.scenes.planar_slider_crank import slider_crank
from mbref.simulation.simulate import Limits, simulate
from tests.helpers.measured import relative_error

ROUNDING = 1e-12  # of positions over the scene's length, after up to 40 singular positions
Z = (0.0, 0.0, 1.0)


def flat_times(end):
    """Return the times (s) at which a parallelogram driven from π/2 is flat: every half turn of its crank."""
    return [(k + 0.5) * math.pi / CRANK_RATE for k in range(int(end * CRANK_RATE / math.pi + 0.5))]


@pytest.mark.parametrize(
    "limits", [{"code": "generic"}, {"code": "generated"}, {"rtol": 1e-4}, {"rtol": 1e-10}], ids=str
)
@pytest.mark.parametrize("name", ["four_bar", "five_bar"])
def test_every_flat_position_of_a_driven_parallelogram_is_recorded_at_its_time(name, limits):
    """Poses meet the parallelogram's closed form to rounding. From a quarter turn, at 124.8 rad/s, the crank
    passes 40 half turns in 1 s. At each recorded time it is within 1e-9 rad of a half turn."""
    scene = SCENES[name]()
    run = simulate(scene, "taylor", np.linspace(0.0, 1.0, 9), Limits(**limits))
    assert relative_error(run, scene) < ROUNDING
    times = [crossing.time for crossing in run.crossings]
    assert len(times) == len(flat_times(1.0)) == 40
    turn = CRANK_RATE * (np.array(times) - flat_times(1.0))  # rad, of the crank
    assert np.abs(turn).max() < 1e-9


@pytest.mark.parametrize("code", ["generic", "generated"])
def test_accelerations_of_a_driven_crank_and_rod_of_equal_length_are_the_closed_form(code):
    """With a crank rate ω every centre swings by cos ωt and sin ωt about a fixed point r₀: acceleration -ω²
    (r - r₀), here to 1000 rtol. Masses off the axes and parallel hinges make a redundant row look
    independent, so that all poses seem to be near a singular one."""
    base, rate, shift = slider_crank(0.308, 0.308, 0.3, "off_axes"), -5.8, (0.09, -0.12, 0.3)
    a, b, c, d = base.joint
    joints = (
        a,
        b,
        Revolute(name="C", bodies=c.bodies, anchor=c.anchor, axis=Z),
        Cylindrical(name="D", bodies=d.bodies, anchor=d.anchor, axis=d.axis),
    )
    places = [{"position": tuple(np.add(body.position, shift).tolist())} for body in base.body]
    bodies = [body.model_copy(update=at) for body, at in zip(base.body, places, strict=True)]
    scene = base.with_(body=tuple(bodies), joint=joints, driver=(Driver(joint="A", polynomial=(0.0, rate)),))
    rtol = 1e-12
    run = simulate(scene, "taylor", np.linspace(0.0, 2.5, 41), Limits(rtol=rtol, code=code))
    assert run.outcome.name == "COMPLETED", run.message
    # r - r₀: shifts of crank and rod turn with them except along z, and the slider keeps its shift
    swinging = run.position - [(0.0, 0.0, 0.3), (0.0, 0.0, 0.3), shift]
    largest = np.abs(run.acceleration).max()  # m/s²
    assert np.abs(run.acceleration + rate**2 * swinging).max() < 1000 * rtol * largest


def test_prescribed_motion_does_not_depend_on_the_tolerance():
    """Runs with rtol 1e-3 and 1e-11 agree to the bit, and have the judge's closed form, to rounding."""
    scene, times = SCENES["spatial_slider_crank_driven"](), np.linspace(0.0, 0.2, 5)
    rough, fine = (simulate(scene, "taylor", times, Limits(rtol=rtol)) for rtol in (1e-3, 1e-11))
    assert np.array_equal(rough.position, fine.position) and rough.cost.steps == fine.cost.steps
    assert relative_error(rough, scene) < ROUNDING


@pytest.mark.parametrize("gap", [0.1, 1e-2, 1e-3, 1e-5, 1e-7])
def test_driven_slider_crank_with_a_longer_rod_stays_on_its_branch_and_crosses_nothing(gap):
    """The rod is longer than the crank, 0.5 m, by the gap (m). Where the crank is upright, branches are apart
    by about √gap, so that rounding is magnified by 1/√gap. The closed form is the judge's."""
    driver = Driver(joint="A", polynomial=(0.0, CRANK_RATE))
    scene = slider_crank(0.5, 0.5 + gap, 0.3, "gap").with_(driver=(driver,))
    run = simulate(scene, "taylor", np.linspace(0.0, 0.1, 23))
    assert relative_error(run, scene) < ROUNDING / math.sqrt(gap) and not run.crossings


@pytest.mark.parametrize("distance", [1e-2, 1e-3, 1e-4])
def test_run_of_zero_seconds_near_a_flat_position_has_accelerations_by_the_closed_form(distance):
    """A rhombus driven at ω starts at a distance (rad) from flat. Its coupler's centre moves on a circle
    about (0.25, 0) m: a = -ω² (r - (0.25, 0)), to 1e-4 ω², as the singular position magnifies rounding."""
    start = simulate(four_bar(math.pi + distance), "taylor", [0.0])
    assert start.times.tolist() == [0.0]
    exact = -(CRANK_RATE**2) * (start["coupler"].position[0] - [0.25, 0.0, 0.0])
    assert np.abs(start["coupler"].acceleration[0] - exact).max() < 1e-4 * CRANK_RATE**2
