"""The Taylor method against truths, its options, and scenes without a motion to follow."""

import numpy as np
import pytest

from mbref.method import Method, MethodError
from mbref.scene import Body, Driver, Revolute, Scene, Translational
from mbref.scenes import SCENES
from mbref.simulation.simulate import Limits, simulate


def test_taylor_named_as_the_integrator_of_alf_dual_in_old_records_is_the_method_taylor():
    """Options are kept; the name of the method is printed without formulation and stabilisation."""
    assert str(Method.parse("taylor[order=14]")) == "taylor[order=14]"
    assert Method.parse("alf-dual+projection/taylor[order=14]") == Method.parse("taylor[order=14]")


def test_taylor_with_a_formulation_and_orders_above_30_are_refused():
    """The first refusal names the right method, the second the interval of orders."""
    with pytest.raises(MethodError, match=r"taylor has no formulation .* use taylor\[order=8\]"):
        Method.parse("lm1+none/taylor[order=8]")
    with pytest.raises(ValueError, match="order must be 4 to 30, got 31"):
        simulate(SCENES["point_pendulum"](), "taylor[order=31]", [0.1])


@pytest.mark.parametrize("length", [0.05, 1.0, 30.0])
@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (1.0, 2.0, 3.0)])
def test_pendulum_on_a_driven_cart_swings_in_a_constant_field(axis, length):
    """The cart is at (0.2 t + 0.7 t²) L along its axis, u. Seen from it, the pendulum of moment J about its
    hinge swings in the constant field g - 1.4 L u: ½ J ω² - m (g - 1.4 L u) · r is constant, to ten rtol,
    while the kinetic energy changes by more than a millionth. The cart's place and the arm's length are kept
    to rounding."""
    cart = Body(name="cart", mass=0.3, inertia=(1e-3, 1e-3, 1e-3), position=(0, 0, 0))
    place = (0.2 * length, 0.1 * length, -0.2 * length)
    bob = Body(name="bob", mass=2.5, inertia=tuple(np.array([0.02, 0.04, 0.04]) * length**2), position=place)
    scene = Scene(
        name="driven_cart",
        gravity=(0, 0, -9.81),
        body=(cart, bob),
        joint=(
            Translational(name="S", bodies=("ground", "cart"), anchor=(0, 0, 0), axis=axis),
            Revolute(name="R", bodies=("cart", "bob"), anchor=(0, 0, 0), axis=(0, 1, 0)),
        ),
        driver=(Driver(joint="S", polynomial=(0.0, 0.2 * length, 0.7 * length)),),
    )
    times, along = np.linspace(0.0, 0.1, 5), np.array(axis) / np.linalg.norm(axis)
    rtol, rounding = 1e-10, 1e-12
    run = simulate(scene, "taylor", times, Limits(rtol=rtol))
    assert run.outcome.label == "COMPLETED", run.message
    travel = (0.2 * times + 0.7 * times**2)[:, None] * length * along
    assert np.allclose(run["cart"].position, travel, rtol=0, atol=rounding * length)
    arm, field = run["bob"].position - travel, np.array([0.0, 0.0, -9.81]) - 1.4 * length * along
    moment, mass = 0.04 * length**2 + 2.5 * (place[0] ** 2 + place[2] ** 2), 2.5
    kinetic = 0.5 * moment * run["bob"].angular_velocity[:, 1] ** 2
    energy = kinetic - mass * arm @ field
    assert np.ptp(energy) < 10 * rtol * np.abs(energy).max() and np.ptp(kinetic) > 1e-6 * kinetic.max()
    assert np.linalg.norm(arm, axis=1) == pytest.approx(np.linalg.norm(place), rel=rounding)
