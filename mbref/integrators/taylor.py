"""Taylor: series of the motion in natural coordinates, of orders 4 to 30, in steps of their own.

``mbref.taylor`` computes steps and samples: accelerations and multipliers follow from the series too, so
that the formulation has no part in them.  A series continues over singular positions.  Order 0 stands for the
order that costs least at the tolerance.
"""

from __future__ import annotations

from typing import NamedTuple

from mbref.integrators.base import Integrator


class NoScratch(NamedTuple):
    """The series have memory of their own."""


TAYLOR = Integrator(
    "taylor", 30, None, None, NoScratch, adaptive=True, options={"order": 0.0}, crosses="by series"
)
