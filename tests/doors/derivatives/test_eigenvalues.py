"""Derivatives of the eigenvalues of small motions by numbers of their scenes, against closed forms."""

import numpy as np
import pytest

import mbref
from crosscheck.conformance.mechanisms.random_mechanisms import random_mechanism
from crosscheck.judge.small_motions.equilibria import steady_poses
from mbref.scene import Scene
from tests.doors.derivatives.test_sensitivities import (
    CENTRAL,
    GRAVITY,
    MOST_ERRORS,
    assert_close,
    pendulum,
    slope,
)
from tests.doors.statics.test_random_equilibria import at_rest
from tests.helpers.coupled_mechanisms import body
from tests.helpers.parts import slide, spring

ACCURATE = 1e-10  # relative error that is allowed against closed forms; rounding leaves 1e-12


def carts(masses: list[float], springs: list[tuple], damping: float = 0.0) -> Scene:
    """Return carts on slides along x, 1 m apart. Each spring (names of two bodies, stiffness) has its natural
    length of 1 m; one on the ground ends there 1 m before its cart."""
    bodies = [body(f"c{k}", mass, [0.1] * 3, (float(k), 0.0, 0.0)) for k, mass in enumerate(masses)]
    joints = [slide(f"S{k}", "ground", f"c{k}", bodies[k]["position"]) for k in range(len(masses))]
    place = {f"c{k}": float(k) for k in range(len(masses))}
    loads = []
    for first, second, stiffness in springs:
        ends = (place.get(first, place[second] - 1), 0.0, 0.0), (place[second], 0.0, 0.0)
        loads.append(spring(first, ends[0], second, ends[1], stiffness, 1.0, damping))
    return Scene(name="carts", body=bodies, joint=joints, load=loads)


def test_eigenvalue_of_a_pendulum_depends_on_its_numbers_as_in_closed_form():
    """s = ± i √(m g l/(I + m l²)). If the pivot (px, py) moves, the given centre of mass (0, -0.5) stays, so
    that py, and not px, changes the length l of 0.5 m to first order."""
    rest = pendulum().with_(body=[body("bob", 1.3, [0.05, 0.06, 0.07], (0.0, -0.5, 0.0))])

    def rate(mass, inertia, gravity, px, py):
        length = np.sqrt(px**2 + (0.5 + py) ** 2)
        return np.sqrt(-mass * gravity * length / (inertia + mass * length**2))

    numbers = {"mass": 1.3, "inertia": 0.07, "gravity": -GRAVITY, "px": 0.0, "py": 0.0}
    paths = ["body[bob].mass", "body[bob].inertia[2]", "gravity.y", "joint[A].anchor.x", "joint[A].anchor.y"]
    found = mbref.eigenvalue_sensitivities(rest, paths)
    assert_close(found.eigenvalues, np.array([1j, -1j]) * rate(**numbers), ACCURATE)
    true = np.array([slope(rate, numbers, name) for name in numbers])
    assert_close(found.values, np.array([1j * true, -1j * true]), ACCURATE)
    rounded = 1e-14 * np.abs(true).max()
    assert (np.abs(found.values - [1j * true, -1j * true]) <= MOST_ERRORS * found.errors + rounded).all()


def test_eigenvalues_of_two_carts_depend_on_masses_and_springs_as_in_closed_form():
    """Their equation, m₁ m₂ s⁴ + ((k + c) m₂ + c m₁) s² + k c = 0, is differentiated by a complex step."""
    scene = carts([2.0, 3.0], [("ground", "c0", 50.0), ("c0", "c1", 20.0)])

    def rates(m1, m2, k, c):
        middle, root = (k + c) * m2 + c * m1, ((k + c) * m2 + c * m1) ** 2 - 4 * m1 * m2 * k * c
        return np.sqrt((middle + np.array([-1, -1, 1, 1]) * np.sqrt(root)) / (2 * m1 * m2)) * [1, -1, 1, -1]

    numbers = {"m1": 2.0, "m2": 3.0, "k": 50.0, "c": 20.0}
    paths = ["body[c0].mass", "body[c1].mass", "load[0].stiffness", "load[1].stiffness"]
    found = mbref.eigenvalue_sensitivities(scene, paths)
    assert_close(found.values, np.array([1j * slope(rates, numbers, name) for name in numbers]).T, ACCURATE)
    assert found.units[0] == "(1/s)/(kg)"


def test_eigenvalue_of_a_damped_cart_depends_on_damping_as_in_closed_form_and_has_no_slope_at_critical():
    """s = -δ ± i ω with δ = d/(2 m), ω² = k/m - δ²: ds/dd = -(1 ± i δ/ω)/(2 m). At the critical damping
    d = 2 √(k m) the frequency ω is zero: both eigenvalues are equal, and the derivative is infinite."""
    mass, stiffness, damping = 2.0, 50.0, 4.0
    decay, scene = damping / (2 * mass), carts([mass], [("ground", "c0", stiffness)], damping)
    turn = 1j * np.array([1, -1]) * decay / np.sqrt(stiffness / mass - decay**2)
    found = mbref.eigenvalue_sensitivities(scene, ["load[0].damping"])
    assert_close(found.values[:, 0], -(1 + turn) / (2 * mass), ACCURATE)
    critical = scene.with_("load[0].damping", 2 * np.sqrt(mass * stiffness))
    found = mbref.eigenvalue_sensitivities(critical, ["load[0].damping"])
    assert found.repeated == ((0, 1),)
    assert np.isnan(found.values).all()


def test_repeated_eigenvalue_splits_into_the_slopes_of_its_parts():
    """Two equal carts, each on a spring: the mass of one changes its own ± i √(k/m) by ∓ i √(k/m)/(2 m),
    which is 1.25 1/(s kg) with k = 50 N/m and m = 2 kg, and leaves the other's."""
    scene = carts([2.0, 2.0], [("ground", "c0", 50.0), ("ground", "c1", 50.0)])
    found = mbref.eigenvalue_sensitivities(scene, ["body[c0].mass"])
    assert found.repeated == ((0, 1), (2, 3))
    parts = sorted(np.abs(found.values[:, 0]))
    np.testing.assert_allclose(parts, [0.0, 0.0, 1.25, 1.25], rtol=0, atol=1.25 * ACCURATE)


def test_mechanism_without_a_restoring_force_is_refused_by_name():
    """A cart without a spring rests everywhere: the eigenvalue 0 of its equilibria is double."""
    with pytest.raises(mbref.InputError, match="a neutral equilibrium"):
        mbref.eigenvalue_sensitivities(carts([2.0], []), ["body[c0].mass"])


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 3])
def test_slopes_of_a_random_mechanism_equal_differences_of_the_judges_eigenvalues(seed):
    """Differences of order 8 of eigenvalues at the equilibria that the judge finds from the scene's pose. The
    eigenvalues are right to 1e-13 of the largest one, and so their differences over 1 % of the mass (2.7 kg)
    to 1e-11. Of the slope itself 1e-9 is allowed; 6e-11 is measured."""
    rest = mbref.equilibria(at_rest(random_mechanism(seed)), starts=1)[0].scene
    heavy, step = max(rest.body, key=lambda each: each.mass), 0.01
    path = f"body[{heavy.name}].mass"
    found = mbref.eigenvalue_sensitivities(rest, [path])

    def judged(factor):
        values = steady_poses(rest.with_(path, factor * heavy.mass), starts=1)[0].eigenvalues
        return values[np.abs(found.eigenvalues[:, None] - values).argmin(axis=1)]

    parts = [weight * (judged(1 + k * step) - judged(1 - k * step)) for k, weight in CENTRAL]
    true = sum(parts) / (step * heavy.mass)
    allowed = 1e-9 * np.abs(true).max() + 1e-11 * np.abs(found.eigenvalues).max()
    assert not found.repeated
    assert np.abs(found.values[:, 0] - true).max() <= allowed
