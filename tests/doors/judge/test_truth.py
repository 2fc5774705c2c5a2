"""The judge's truths against textbook formulas, quadrature and conserved quantities."""

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import quad

from crosscheck.judge.truth import NoSolution, truth_for
from mbref import rotations
from mbref.scene import Body, Driver, Scene
from mbref.scenes import SCENES
from tests.helpers.parts import Z, hinge, spring

ROUNDED = 1e-14  # m or rad: some roundings of numbers up to 1

ROCKER_DRIVEN = SCENES["four_bar_gravity"]().with_(driver=(Driver(joint="D", polynomial=(0.0, 3.0)),))


@pytest.mark.parametrize(
    ("scene", "start", "rate"),  # rad, rad/s
    [
        (SCENES["four_bar"](), math.pi / 2, -124.8),
        (SCENES["four_bar_straight"](), math.pi, -124.8),
        (ROCKER_DRIVEN, 0.3, 3.0),
    ],
    ids=["crank driven from upright", "crank driven from the straight position", "rocker driven"],
)
def test_coupler_of_a_driven_rhombus_moves_on_a_circle_without_turning(scene, start, rate):
    """All bars are 0.5 m, the ground along x: the coupler stays parallel to it, and its centre is at (0.25 +
    0.5 cos φ, 0.5 sin φ) m with the crank's angle φ = start + rate · t, to 1e-14 m and rad."""
    t = np.linspace(0, scene.duration, 30)
    angle = start + rate * t
    coupler = np.stack([0.25 + 0.5 * np.cos(angle), 0.5 * np.sin(angle), 0 * t], axis=1)
    motion = truth_for(scene).poses(t)
    assert np.abs(motion.position[:, 1] - coupler).max() < ROUNDED
    assert rotations.angle_between(motion.orientation[:, 1], np.array([1.0, 0, 0, 0])).max() < ROUNDED


def test_driven_spatial_slider_follows_the_paper_s_formula():
    """The rod of 0.4 m leads from the crank's end, 0.1 m (cos θ, sin θ) across y, to the slider's line at
    0.15 m: y² = 0.4² - (0.1 cos θ - 0.15)² - (0.1 sin θ)² with θ = 124.8 t (m, rad, s), to 1e-14 m."""
    scene = SCENES["spatial_slider_crank_driven"]()
    t = np.linspace(0, 0.2, 57)
    angle = 124.8 * t
    wanted = np.sqrt(0.4**2 - (0.1 * np.cos(angle) - 0.15) ** 2 - (0.1 * np.sin(angle)) ** 2)
    assert np.abs(truth_for(scene).poses(t).position[:, 2, 1] - wanted).max() < ROUNDED


@pytest.mark.parametrize("name", ["planar_slider_crank_equal", "planar_slider_crank_heavy"])
def test_equal_slider_crank_turns_by_the_energy_quadrature(name):
    """From rest under a constant moment τ = 100 N m, θ'² = 2 τ θ / I(θ), so t = ∫ √(I / 2 τ θ) dθ, with θ =
    u², and the slider is at 2 a cos θ. Times agree to 5e-13, rates and places to 1e-13: rounding, over more
    than three singular positions (at π/2 + kπ)."""
    scene = SCENES[name]()
    a, crank, rod = 0.308, scene.body[0], scene.body[1]

    def inertia(theta):
        s, c = math.sin(theta) ** 2, math.cos(theta) ** 2
        fixed = crank.inertia[2] + crank.mass * a**2 / 4 + rod.inertia[2]
        return fixed + rod.mass * a**2 * (2.25 * s + 0.25 * c) + 4 * scene.body[2].mass * a**2 * s

    end = scene.duration
    motion = truth_for(scene)
    (theta, rate) = motion.coordinate(np.array([end]))[0]
    top = math.sqrt(theta)
    edges = np.linspace(0, top, 200)
    slowness, tight = lambda u: math.sqrt(2 * inertia(u * u) / 100.0), {"epsabs": 0, "epsrel": 1e-13}
    pieces = [quad(slowness, low, high, **tight)[0] for low, high in itertools.pairwise(edges)]
    assert abs(math.fsum(pieces) - end) < 50 * ROUNDED * end
    speed = math.sqrt(200.0 * theta / inertia(theta))
    assert abs(rate - speed) < 10 * ROUNDED * speed, f"rate {rate}, energy gives {speed}"
    slider = motion.poses(np.array([end])).position[0, 2, 0]
    assert abs(slider - 2 * a * math.cos(theta)) < 10 * ROUNDED, f"slider at {slider}"
    assert theta > 3.5 * math.pi


def test_truth_ends_where_a_spring_has_no_length():
    """A bar turned by half a turn brings a spring to length zero, where its force jumps. At the time that the
    error states, the angle is π to 1e-6 rad, and the energy of spring and spin (0.0533 kg m² about the pivot)
    equals the start's to 1e-10."""
    twist = {"velocity": (0.0, 1.0, 0.0), "angular_velocity": (0.0, 0.0, 5.0)}
    bar = Body(name="bar", mass=1.0, inertia=(0.001, 0.0133, 0.0133), position=(0.2, 0, 0), **twist)
    pull = spring("ground", (-0.4, 0, 0), "bar", (0.4, 0, 0), 20.0, 0.3)
    pin = hinge("A", "ground", "bar", (0.0, 0.0, 0.0))
    truth = truth_for(Scene(name="bar", duration=2.0, body=(bar,), joint=(pin,), load=(pull,)))
    with pytest.raises(NoSolution) as caught:
        truth.poses(np.linspace(0, 2, 21))
    until = caught.value.until
    angle, rate = truth.coordinate(np.array([0.0, until])).T
    energy = 0.5 * 0.0533 * rate**2 + 10.0 * (0.8 * np.cos(angle / 2) - 0.3) ** 2
    assert abs(angle[1] - math.pi) < 1e-6 and abs(energy[1] / energy[0] - 1) < 1e-10, (angle, energy)


def test_symmetric_top_precesses_about_its_angular_momentum():
    """The top precesses at |L| / I₁ about L and spins at ω₃ - L₃ / I₁ about its axis, to 1e-13 rad."""
    body = Body(name="top", mass=1, inertia=(0.2, 0.2, 0.3), position=(0, 0, 0), angular_velocity=(1, 0, 4))
    t = np.linspace(0, 3.0, 40)
    motion = truth_for(Scene(name="top", body=(body,), duration=3.0)).poses(t)
    momentum = np.array([0.2 * 1.0, 0.0, 0.3 * 4.0])
    rate = np.linalg.norm(momentum) / 0.2
    precession = rotations.from_vector(rate * t[:, None] * momentum / np.linalg.norm(momentum))
    relative = rotations.from_vector((4.0 - 0.3 * 4.0 / 0.2) * t[:, None] * np.array(Z))
    wanted = rotations.multiply(precession, relative)
    assert rotations.angle_between(motion.orientation[:, 0], wanted).max() < 10 * ROUNDED
