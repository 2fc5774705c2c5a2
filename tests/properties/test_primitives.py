"""Φ_q, ν and γ of every joint and driver against differences of Φ and of Φ_q v along exact motions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mbref.equations.model import Model, displaced
from mbref.scene import JOINT_TYPES
from tests.helpers.joint_strategies import DRIVABLE, one_joint_scenes, states

KINDS = list(JOINT_TYPES.values())
CASES = [(kind, False) for kind in KINDS] + [(kind, True) for kind in DRIVABLE]
STEP = 0.005
STENCIL = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280]) / STEP  # order 8: truncation below 1e-15 here
TOLERANCE = 2e-11  # rounding of 1e-16 over STEP, times the size of the terms, with a hundredfold margin


def derivative(function):
    """Return d/ds at s = 0 by the central difference of order 8."""
    pairs = [(function(k * STEP) - function(-k * STEP)) for k in (1, 2, 3, 4)]
    return np.tensordot(STENCIL, np.array(pairs), axes=1)


def difference(one, other):
    """Return the largest difference of two arrays over the size of the second, if above 1."""
    scale = max(1.0, np.max(np.abs(other), initial=0.0))
    return np.max(np.abs(one - other), initial=0.0) / scale


@pytest.mark.parametrize(("kind", "driven"), CASES)
@given(data=st.data())
def test_jacobian_is_the_derivative_of_phi(kind, driven, data):
    """Φ_q v is the rate of Φ(q(s)) with q' = v at one time t."""
    model = Model(data.draw(one_joint_scenes(kind, driven), label="scene"))
    t, q, v = data.draw(states(model.nb), label="state")
    rate = derivative(lambda s: model.terms(t, displaced(q, s * v), v).phi)
    assert difference(model.terms(t, q, v).jacobian @ v, rate) < TOLERANCE


@pytest.mark.parametrize(("kind", "driven"), CASES)
@given(data=st.data())
def test_jacobian_times_velocity_less_nu_is_the_rate_of_phi(kind, driven, data):
    """Φ_q v - ν = dΦ/dt, also of drivers, which depend on the time."""
    model = Model(data.draw(one_joint_scenes(kind, driven), label="scene"))
    t, q, v = data.draw(states(model.nb), label="state")
    terms = model.terms(t, q, v)
    rate = derivative(lambda s: model.terms(t + s, displaced(q, s * v), v).phi)
    assert difference(terms.jacobian @ v - terms.nu, rate) < TOLERANCE


@pytest.mark.parametrize(("kind", "driven"), CASES)
@given(data=st.data())
def test_gamma_is_the_negative_rate_of_the_velocity_equations(kind, driven, data):
    """γ = -d/dt (Φ_q v - ν) along a motion of constant velocities v."""
    model = Model(data.draw(one_joint_scenes(kind, driven), label="scene"))
    t, q, v = data.draw(states(model.nb), label="state")

    def velocity_equations(s):
        terms = model.terms(t + s, displaced(q, s * v), v)  # constant r' and body-fixed ω': q̈ = 0
        return terms.jacobian @ v - terms.nu

    assert difference(model.terms(t, q, v).gamma, -derivative(velocity_equations)) < TOLERANCE
