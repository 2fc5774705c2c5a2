"""Derivatives of accelerations at a state, of mbref and of the judge, against closed forms and each other."""

import numpy as np
import pytest

import mbref
from crosscheck.judge.state_derivatives import NotSmooth, bounded_derivatives
from mbref.scene import Scene
from tests.doors.derivatives.test_sensitivities import (
    ACCURATE,
    GRAVITY,
    SLIDER,
    TURN_RATE,
    assert_close,
    crank_linkage,
    pendulum,
    slope,
)
from tests.helpers.coupled_mechanisms import body
from tests.helpers.parts import hinge, slide
from tests.helpers.powered_mechanisms import powered_mechanism
from tests.helpers.statics import parallelogram

BOUND = 1e-14  # relative error that the judge's bounds allow against closed forms
HALF, INERTIA, ROD, ALONG, UP = 0.5, 0.07, 1.3, 0.8, 0.6  # m, kg m², kg: of the trammel
START, RATE = 0.7, 3.0  # rad, rad/s


def of(name: str, scene: Scene, numbers: list[str]) -> dict[str, np.ndarray]:
    """Return derivatives of the last body's angular acceleration about z, by its angle, its rate, moments
    about z on it, and numbers; by mbref or by the judge."""
    row = 6 * len(scene.body) - 1
    if name == "mbref":
        found = mbref.state_derivatives(scene, to=numbers)
        errors = found.errors
    else:
        found, errors = bounded_derivatives(scene, numbers)
    turn = found.basis[row, 0] if found.basis.size else 1.0
    parts = ("by_position", "by_velocity", "by_force", "by_number")
    values = {part: getattr(found, part)[row] for part in parts}
    for part in parts:
        assert (getattr(errors, part)[row] <= 1e-9 * max(1.0, np.abs(values[part]).max(initial=0.0))).all()
    return values | {key: values[key] / turn for key in ("by_position", "by_velocity")}


def trammel(along: float = ALONG) -> Scene:
    """Return a rod whose ends slide on two perpendicular rails: its loop has redundant rows. The scene's last
    body is the rod, at the angle START with the rate RATE."""
    x, y = 2 * HALF * np.cos(START), 2 * HALF * np.sin(START)
    bodies = [
        {**body("along", along, [0.1] * 3, (x, 0.0, 0.0)), "velocity": (-RATE * y, 0.0, 0.0)},
        {**body("up", UP, [0.1] * 3, (0.0, y, 0.0)), "velocity": (0.0, RATE * x, 0.0)},
        {**body("rod", ROD, [0.05, 0.06, INERTIA], (x / 2, y / 2, 0.0)), "angular_velocity": (0, 0, -RATE)},
    ]
    rail = {**slide("Y", "ground", "up", (0.0, y, 0.0)), "axis": (0.0, 1.0, 0.0)}
    joints = [slide("X", "ground", "along", (x, 0.0, 0.0)), rail]
    joints += [hinge("P", "along", "rod", (x, 0.0, 0.0)), hinge("Q", "up", "rod", (0.0, y, 0.0))]
    for each in bodies[:2]:
        each.pop("angular_velocity", None)
    return Scene(name="trammel", gravity=(0.0, -GRAVITY, 0.0), duration=1.0, body=bodies, joint=joints)


def angular_acceleration(angle, rate, moment, along):
    """Return α of A α + A' ω²/2 = M - (m + 2 m_y) g l cos φ, with A = I + m l² + 4 l² (m_x s² + m_y c²)."""
    s, c = np.sin(angle), np.cos(angle)
    inertia = INERTIA + ROD * HALF**2 + 4 * HALF**2 * (along * s * s + UP * c * c)
    slope_ = 8 * HALF**2 * (along - UP) * s * c
    weight = (ROD + 2 * UP) * GRAVITY * HALF * c
    return (moment - weight - slope_ * rate * rate / 2) / inertia


@pytest.mark.parametrize(("name", "accuracy"), [("mbref", ACCURATE), ("judge", BOUND)])
def test_derivatives_of_a_trammel_equal_those_of_its_closed_form(name, accuracy):
    """The rod's angular velocity is -φ', φ being its angle from the x rail. A derivative by position includes
    the least δv, in the metric of the masses: δφ' = -φ' A'/(2 A) δφ, since A φ'² = vᵀ M v."""
    numbers = {"angle": START, "rate": RATE, "moment": 0.0, "along": ALONG}
    true = {key: slope(angular_acceleration, numbers, key) for key in numbers}
    s, c = np.sin(START), np.cos(START)
    inertia = INERTIA + ROD * HALF**2 + 4 * HALF**2 * (ALONG * s * s + UP * c * c)
    change = 4 * HALF**2 * (ALONG - UP) * s * c / inertia
    found = of(name, trammel(), ["body[along].mass"])
    by_position = true["angle"] - true["rate"] * RATE * change
    assert_close(found["by_position"], np.array([by_position]), accuracy)
    assert_close(found["by_velocity"], np.array([true["rate"]]), accuracy)
    assert_close(found["by_force"][-1:], np.array([true["moment"]]), accuracy)
    assert_close(-found["by_number"], np.array([true["along"]]), accuracy)


@pytest.mark.parametrize(("name", "accuracy"), [("mbref", ACCURATE), ("judge", BOUND)])
def test_derivatives_of_a_pendulum_equal_those_of_its_closed_form(name, accuracy):
    """α = m g r_x/(I + m r²) with r from the pin to the centre, which stays where it is if the pin moves."""
    numbers = {"mass": 1.3, "inertia": 0.07, "x": 0.0, "y": 0.0, "gravity": -GRAVITY}
    paths = ["body[bob].mass", "body[bob].inertia[2]", "joint[A].anchor.x", "joint[A].anchor.y", "gravity.y"]

    def alpha(mass, inertia, x, y, gravity):
        return mass * gravity * (0.3 - x) / (inertia + mass * ((0.3 - x) ** 2 + (0.4 + y) ** 2))

    found, whole = of(name, pendulum(), paths), 0.07 + 1.3 * 0.25
    assert_close(found["by_number"], np.array([slope(alpha, numbers, key) for key in numbers]), accuracy)
    assert_close(found["by_position"], np.array([-1.3 * GRAVITY * 0.4 / whole]), accuracy)
    assert_close(found["by_force"][-1:], np.array([1 / whole]), accuracy)


def test_derivatives_of_a_driven_slider_equal_those_of_its_closed_form():
    """C is R = x_C - x_B ahead of B and w = y_C - y_B above it; with ẏ = Ω x_B and ÿ = -Ω² y_B the slider has
    the acceleration (w ÿ - ẏ²)/R - (w ẏ)²/R³ - Ω² x_B. The moment at A is as by ``sensitivities``."""
    numbers = {"bx": 0.2, "by": 0.1, "cx": 0.9, "cy": 0.5}
    paths = ["joint[B].anchor.x", "joint[B].anchor.y", "joint[C].anchor.x", "joint[C].anchor.y"]

    def acceleration(bx, by, cx, cy):
        ahead, above, rate = cx - bx, cy - by, TURN_RATE * bx
        bent = -(TURN_RATE**2) * by
        return (above * bent - rate**2) / ahead - (above * rate) ** 2 / ahead**3 - TURN_RATE**2 * bx

    scene = crank_linkage(SLIDER)
    found = mbref.state_derivatives(scene, ["last.acceleration.x", "A.moment.z"], paths)
    true = np.array([slope(acceleration, numbers, key) for key in numbers])
    assert_close(found.by_number[0], true)
    along_motion = mbref.sensitivities(scene, ["A.moment.z"], paths, [0.0]).values[0, 0]
    assert_close(found.by_number[1], along_motion, 1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_derivatives_of_a_random_mechanism_equal_the_judges(seed):
    """The judge's are known to 1e-12 of the largest. mbref's differ by at most 1e-8, and 99 of 100 by at most
    ten times the errors that mbref states."""
    scene = powered_mechanism(seed)
    numbers = [f"body[{scene.body[0].name}].mass", "gravity.y", f"joint[{scene.joint[-1].name}].anchor.x"]
    found, (true, bounds) = mbref.state_derivatives(scene, to=numbers), bounded_derivatives(scene, numbers)
    turned = np.linalg.lstsq(true.basis, found.basis, rcond=None)[0]
    assert_close(true.basis @ turned, found.basis, 1e-12)
    for part in ("by_position", "by_velocity", "by_force", "by_number"):
        judged, bound = getattr(true, part), getattr(bounds, part)
        judged = judged @ turned if part in ("by_position", "by_velocity") else judged
        scale = np.abs(judged).max(initial=0.0)
        assert bound.max(initial=0.0) <= 1e-12 * scale
        assert np.abs(getattr(found, part) - judged).max(initial=0.0) <= 1e-8 * scale
        assert np.mean(np.abs(getattr(found, part) - judged) <= 10 * getattr(found.errors, part)) >= 0.99


def test_derivatives_are_refused_at_a_singular_position_off_the_constraints_and_by_a_start_angle():
    """Two branches meet in the flat pose; q + 0.01 opens the loop; angle(0) is of the start of a motion."""
    flat = parallelogram(sine=0.0, cosine=1.0)
    with pytest.raises(mbref.InputError, match="singular position"):
        mbref.state_derivatives(flat)
    with pytest.raises(NotSmooth, match="singular position"):
        bounded_derivatives(flat)
    at = mbref.terms("four_bar_gravity")
    with pytest.raises(mbref.InputError, match="off the constraints"):
        mbref.state_derivatives("four_bar_gravity", state=(at.q + 0.01, at.v))
    with pytest.raises(mbref.InputError, match="number of the start"):
        mbref.state_derivatives("four_bar_gravity", to=["joint[A].angle(0)"])
