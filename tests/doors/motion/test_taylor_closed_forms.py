"""The method taylor against closed forms: springs, drivers, full turns, phases, tolerances."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from crosscheck.conformance.mechanisms.closed_forms import CLOSED_FORMS, pendulum, torsion
from crosscheck.judge.truth import truth_for
from mbref import rotations
from mbref.scene import Body, Scene
from mbref.scenes import SCENES
from mbref.simulation.simulate import Limits, simulate
from tests.helpers.parts import hinge, spring

FINE = Limits(rtol=1e-12)


@pytest.mark.parametrize("form", CLOSED_FORMS, ids=lambda form: form.__name__)
def test_motion_by_series_is_the_closed_form(form):
    """CLOSED_FORMS have a scene and its positions (m) and orientations (rad), met to 100 rtol."""
    scene, exact = form()
    times = np.linspace(0.0, scene.duration, 9)
    run = simulate(scene, "taylor", times, FINE)
    position, orientation = exact(times)
    assert run.outcome.name == "COMPLETED", run.message
    off = np.abs(run.position - position).max()
    turned = rotations.angle_between(run.orientation, orientation).max()
    assert max(off, turned) < 100 * FINE.rtol, f"{scene.name}: off by {off:.1e} m, {turned:.1e} rad"


@pytest.mark.parametrize("rtol", [1e-6, 1e-8])
@pytest.mark.parametrize("form", [pendulum, torsion], ids=lambda form: form.__name__)
def test_error_by_series_is_a_fiftieth_to_a_ten_thousandth_of_the_tolerance(form, rtol):
    """The error (rad) is below rtol / 50, and above rtol / 10 000: steps are not much too short."""
    scene, exact = form()
    times = np.linspace(0.0, scene.duration, 3)
    turned = simulate(scene, "taylor", times, Limits(rtol=rtol)).orientation
    error = rotations.angle_between(turned, exact(times)[1]).max()
    assert rtol / 10_000 < error < rtol / 50, f"{scene.name}: {error:.1e} rad for {rtol:g}"


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
def test_quaternion_of_a_spinning_body_is_continuous_over_full_turns(axis):
    """A body spins about a principal axis by φ = 4 π: its quaternion is (cos φ/2, sin φ/2 of the axis), sign
    included. Errors of the steps add up to at most 100 rtol."""
    spin, times = 10.0, np.linspace(0.0, 0.4 * np.pi, 41)
    pose = {"position": (0.0, 0.0, 0.0), "angular_velocity": tuple(spin * a for a in axis)}
    body = Body(name="b", mass=2.0, inertia=(0.1, 0.2, 0.25), **pose)
    run = simulate(Scene(name="spinning", body=(body,)), "taylor", times, FINE)
    half = 0.5 * spin * times
    exact = np.column_stack([np.cos(half), np.outer(np.sin(half), axis)])
    off = np.abs(run.orientation[:, 0] - exact).max()
    assert off < 100 * FINE.rtol, f"off by {off:.1e}"


@pytest.mark.slow
def test_phase_of_a_fast_top_is_exact_after_600_radians():
    """The top spins at 150 rad/s for 4 s. The judge's reference is met to 100 rtol (rad): rounding of the
    fast spin is not magnified."""
    scene = SCENES["heavy_top"]().with_(duration=4.0)
    times = np.linspace(0.0, scene.duration, 5)
    rtol = 1e-11
    run = simulate(scene, "taylor", times, Limits(rtol=rtol))
    exact = truth_for(scene, reference_time=600.0).poses(times)
    assert rotations.angle_between(run.orientation, exact.orientation).max() < 100 * rtol


def angle_of_bar(beside: float, duration: float) -> float:
    """Return the angle (rad) of a bar of 0.4 m on a hinge by its equation J θ'' = torque of a spring. J =
    0.0133 + 0.2² kg m², from 5 rad/s; the spring of 20 N/m and 0.3 m is between the bar's tip and a point at
    ``beside`` - 0.4 m, where the integration stops and begins again."""

    def rates(t, y):
        tip = 0.4 * np.array([np.cos(y[0]), np.sin(y[0])])
        turned = np.array([-tip[1], tip[0]])
        vector = tip - [beside - 0.4, 0.0]
        length = np.sqrt(vector @ vector)
        return y[1], -20.0 * (1.0 - 0.3 / length) * (vector @ turned) / (0.0133 + 0.04)

    def meets(t, y):
        return y[0] - np.pi

    meets.terminal = True
    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
    first = solve_ivp(rates, (0.0, duration), (0.0, 5.0), events=meets, **options)
    behind = first.y[:, -1] + [1e-15, 0.0]
    return solve_ivp(rates, (first.t[-1], duration), behind, **options).y[0, -1]


def sprung_bar(speed: float, place: float, natural_length: float, damping: float = 0.0) -> Scene:
    """Return a bar that turns at a speed (rad/s), with a spring from a place (m) on the x axis to its tip."""
    twist = {"velocity": (0.0, 0.2 * speed, 0.0), "angular_velocity": (0.0, 0.0, speed)}
    bar = Body(name="bar", mass=1.0, inertia=(0.001, 0.0133, 0.0133), position=(0.2, 0.0, 0.0), **twist)
    pull = spring("ground", (place, 0.0, 0.0), "bar", (0.4, 0.0, 0.0), 20.0, natural_length, damping)
    pin = hinge("A", "ground", "bar", (0.0, 0.0, 0.0))
    return Scene(name="meeting", body=(bar,), duration=0.7, joint=(pin,), load=(pull,))


@pytest.mark.parametrize("rtol", [1e-6, 1e-9])
@pytest.mark.parametrize("beside", [0.0, 1e-9, 1e-4])
def test_spring_whose_ends_meet_pulls_back_as_the_bar_s_own_equation(beside, rtol):
    """Where the ends meet, or are apart by ``beside`` (m), the force changes its direction, which magnifies
    errors. The truth is the bar's equation of one degree of freedom, solved by SciPy with a stop where they
    meet. The angle's error (rad) is below 30 rtol, five times the largest found."""
    scene = sprung_bar(5.0, beside - 0.4, natural_length=0.3)
    run = simulate(scene, "taylor", [0.0, 0.7], Limits(rtol=rtol))
    assert run.outcome.name == "COMPLETED", run.message
    assert abs(run.joint("A").angle[-1] - angle_of_bar(beside, 0.7)) < 30.0 * rtol


@pytest.mark.parametrize(
    ("place", "damping"), [(0.4, 0.0), (-0.4, 0.5)], ids=["coincide at the start", "meet, with a damper"]
)
def test_spring_without_natural_length_turns_a_bar_as_its_equation(place, damping):
    """The spring is between (p, 0) on the ground and the bar's tip at the radius a = 0.4 m, p = ±a. The truth
    is J θ'' = -k a p sin θ - ½ c (a² + a p cos θ) θ', solved by SciPy."""
    scene, rtol = sprung_bar(12.0, place, natural_length=0.0, damping=damping), 1e-9
    run = simulate(scene, "taylor", [0.0, 0.7], Limits(rtol=rtol))
    inertia, tip, stiffness = 0.0133 + 0.2**2, 0.4, 20.0

    def rates(t, y):
        damped = 0.5 * damping * (tip**2 + tip * place * np.cos(y[0])) * y[1]
        return y[1], -(stiffness * tip * place * np.sin(y[0]) + damped) / inertia

    exact = solve_ivp(rates, (0.0, 0.7), (0.0, 12.0), method="DOP853", rtol=1e-12, atol=1e-13).y[0, -1]
    assert run.outcome.name == "COMPLETED", run.message
    assert abs(run.joint("A").angle[-1] - exact) < 10 * rtol  # rad
