"""Preparation: the kernels that a run by a method calls, compiled or loaded before its clock runs."""

from __future__ import annotations

from mbref.equations.coordinates import displace_all
from mbref.equations.evaluation import evaluate_along
from mbref.kernels.compilation import Exchangeable, prepare_all
from mbref.method import Method
from mbref.stepping.loop import advance_to_end


def prepare(method: Method) -> None:
    """Compile the kernels of the method, or load them from the cache of this machine."""
    prepare_all(kernels_of(method), str(method))


def kernels_of(method: Method) -> list[Exchangeable]:
    """Return the kernels that a run by the method calls."""
    if method.is_series:
        return [evaluate_along, displace_all]
    integrator, chart = method.integrator, method.stabilisation
    kernels = (
        integrator.step, integrator.propose, chart.rates, chart.accept, method.formulation.accelerate,
        advance_to_end, evaluate_along, displace_all, chart.enter.callable,
    )  # fmt: skip
    return [kernel for kernel in kernels if kernel is not None]
