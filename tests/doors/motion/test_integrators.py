"""Integrators against closed forms, the judge's truth and SciPy's coefficients."""

import numpy as np
import pytest
import scipy.integrate
from scipy.special import ellipj, ellipk

from crosscheck.study import stability
from mbref.integrators.dop853_tableau import ERROR3, ERROR5, STAGES, A, B, C
from mbref.scene import Body, Revolute, Scene, Spring, Translational
from mbref.scenes import SCENES
from mbref.simulation.simulate import Limits, simulate
from tests.helpers.measured import relative_error

ROD = {"mass": 2.0, "inertia": (0.1, 0.7, 0.7)}
OSCILLATOR = Scene(
    name="oscillator",
    body=(Body(name="b", position=(1.0, 0.0, 0.0), **ROD),),
    joint=(Translational(name="S", bodies=("ground", "b"), anchor=(0, 0, 0), axis=(1, 0, 0)),),
    load=(Spring(bodies=("ground", "b"), points=((0, 0, 0), (1, 0, 0)), stiffness=8, natural_length=0.7),),
)  # x'' = -4 (x - 0.7)
PENDULUM = Scene(
    name="pendulum",
    gravity=(0.0, -9.81, 0.0),
    body=(Body(name="b", position=(1.0, 0.0, 0.0), **ROD),),
    joint=(Revolute(name="H", bodies=("ground", "b"), anchor=(0, 0, 0), axis=(0, 0, 1)),),
)  # released level: 2.7 φ'' = -2 · 9.81 sin φ, φ from the vertical


def ran(scene, method, times, **limits):
    trajectory = simulate(scene, method, times, Limits(**limits))
    assert trajectory.outcome.name == "COMPLETED", f"{method}: {trajectory.message}"
    return trajectory


def oscillator_error(method, times, **limits):
    trajectory = ran(OSCILLATOR, method, times, **limits)
    return np.max(np.abs(trajectory.position[:, 0, 0] - 0.7 - 0.3 * np.cos(2 * times))), trajectory.cost


def pendulum_error(method, times, **limits):
    """By the angle φ from the vertical, released at π/2: sin(φ/2) = k sn(K - ω t), k² = ½."""
    exact = 2 * np.arcsin(np.sqrt(0.5) * ellipj(ellipk(0.5) - np.sqrt(2 * 9.81 / 2.7) * times, 0.5)[0])
    trajectory = ran(PENDULUM, method, times, **limits)
    angle = np.arctan2(trajectory.position[:, 0, 0], -trajectory.position[:, 0, 1])
    return np.max(np.abs(angle - exact)), trajectory.cost


def slope(sizes, errors):
    """Exponent of the power law error ~ size^p, by least squares."""
    return np.polyfit(np.log(sizes), np.log(errors), 1)[0]


@pytest.mark.parametrize(("error", "longest"), [(oscillator_error, 0.25), (pendulum_error, 0.125)])
def test_dop853_converges_with_order_eight(error, longest):
    """Loose limits make each step the largest one; the slope of log error, by the closed form of an
    oscillator and of a pendulum, over log step is 8 to 0.8."""
    steps = longest * np.array([1.0, 0.5, 0.25])
    loose = {"rtol": 0.5, "atol": 1e3, "largest_turn": 9.0}  # the largest step is what is taken
    found = [error("lm1+none/dop853", np.linspace(0, 4, 3), largest_step=h, **loose)[0] for h in steps]
    assert slope(steps, found) == pytest.approx(8, abs=0.8), f"errors {found} at steps {steps}"


@pytest.mark.parametrize("order", [1, 2, 4, 6, 8])
@pytest.mark.parametrize("error", [oscillator_error, pendulum_error])
def test_adams_of_a_largest_order_converges_with_one_order_more(error, order):
    """With local extrapolation, order k converges like order k + 1 in the number of steps, to a fifth of
    this: the order varies in the first steps of a run."""
    method, times = f"lm1+none/adams[max_order={order}]", np.array([0.0, 5.0])
    runs = [error(method, times, rtol=10.0**-k) for k in np.arange(4, 7 + min(order, 4), 0.5)]
    errors, steps = [e for e, _ in runs], [cost.steps for _, cost in runs]
    assert -slope(steps, errors) == pytest.approx(order + 1, rel=1 / 5), f"errors {errors} in {steps} steps"


@pytest.mark.parametrize("order", [0, 2.5, 13])
def test_order_of_adams_outside_1_to_12_is_refused(order):
    """Orders are whole numbers from 1 to 12; these are below, between and above them."""
    with pytest.raises(ValueError, match=r"max_order must be 1 to 12"):
        simulate(OSCILLATOR, f"lm1+none/adams[max_order={order}]", [1.0])


def test_coefficients_of_dop853_equal_scipy_s_to_the_bit():
    """SciPy has A, B and C of the stages, and the weights of both error estimates, of order 3 and 5."""
    theirs = scipy.integrate.DOP853
    assert np.array_equal([[*row, *[0.0] * (STAGES - len(row))] for row in A], theirs.A[:STAGES, :STAGES])
    assert np.array_equal((B, C), (theirs.B, theirs.C[:STAGES]))
    assert np.array_equal((ERROR3, ERROR5), (theirs.E3[:STAGES], theirs.E5[:STAGES]))


@pytest.mark.parametrize("method", ["alf-dual+projection", "taylor"])
@pytest.mark.parametrize("end", [10.0, 100.0])
def test_error_of_a_long_run_stays_below_a_thousand_tolerances(end, method):
    """A crank swings at rtol 1e-9; the judge's truth shows errors of its frequency, which add up."""
    scene = next(scene for scene in stability.scenes() if scene.name == f"duration[{end:g}]")
    run = simulate(scene, method, np.linspace(0.0, end, 11), Limits(rtol=1e-9))
    assert relative_error(run, scene) < 1000 * 1e-9


def test_run_at_ten_million_radians_a_second_completes_in_at_most_2000_steps_and_meets_the_truth():
    """The truth is the judge's, met to 1000 rtol. Long runs divide the tolerance by their number of steps;
    the first step, 1e-10 of this run, must not lead to a tolerance below rounding."""
    scene = next(scene for scene in stability.scenes() if scene.name == "speed[1e+07]")
    end = 0.1 * scene.duration  # before its first singular position
    run = simulate(scene, "alf-dual+projection", [end], Limits(rtol=1e-9, most_steps=2000))
    assert relative_error(run, scene) < 1000 * 1e-9


def test_fewer_than_a_tenth_of_the_steps_of_an_accelerating_crank_are_rejected():
    """A stable control of the step length does not alternate between long, rejected steps and short ones."""
    scene, times = SCENES["planar_slider_crank"](), [0.2]
    run = ran(scene, "alf-dual+projection", times, rtol=1e-7)
    assert run.cost.rejected < run.cost.steps / 10, (run.cost.rejected, run.cost.steps)
