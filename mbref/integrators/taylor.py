"""Taylor: power series of the motion in natural coordinates, of orders 4 to 30, with their own step control.

``mbref.taylor`` computes steps and samples. Accelerations and multipliers follow from the series, too, so
that the formulation is not used. A series continues across singular positions. Order 0 selects the order of
least cost at the tolerance.
"""

from __future__ import annotations

from mbref.integrators.base import Integrator
from mbref.kernels.records import NoNumbers

TAYLOR = Integrator(
    "taylor", 30, None, None, NoNumbers, adaptive=True, options={"order": 0.0}, crosses="by series"
)
