"""Integrators by name, and the Taylor series, which is a method of its own."""

from mbref.integrators.adams import ADAMS
from mbref.integrators.base import Integrator
from mbref.integrators.dop853 import DOP853
from mbref.integrators.rk4 import RK4
from mbref.integrators.taylor import TAYLOR

__all__ = ["INTEGRATORS", "TAYLOR", "Integrator"]

INTEGRATORS: dict[str, Integrator] = {i.name: i for i in (DOP853, RK4, ADAMS)}
