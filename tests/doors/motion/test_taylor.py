"""Names and orders of the Taylor method that are read, and those that are refused."""

import pytest

from mbref.method import Method, MethodError
from mbref.scenes import SCENES
from mbref.simulation.simulate import simulate


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
