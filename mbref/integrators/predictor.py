"""Predictor: no integration; Hermite extrapolation, for mechanisms whose motion the drivers prescribe.

The projection solves Φ(q, t) = 0 and Φ_q q' = ν from the predicted state, which is all there is to know
where no freedom is left: the kinematic analysis of Eqs. 1 to 3, in steps as long as the prediction is near
(Eq. 16 is its second order).  The polynomial goes through the last NODES states and their rates; how far it
is off is judged by the one through a state fewer, so that Newton's method stays with the branch.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from mbref.integrators.base import Integrator
from mbref.integrators.one_step import propose
from mbref.kernels.compilation import exchangeable, kernel
from mbref.kernels.layout import STEP
from mbref.kernels.named_memory import Vector, opener
from mbref.linear_algebra.hermite import extrapolate
from mbref.linear_algebra.vectors import larger

NODES = 3
NEARNESS = 2e-2  # difference of both polynomials / step; the prediction is much more accurate
ROUNDING = 1e-9  # m or rad: a coordinate that moves less is at rest
LARGEST_TURN = 0.4  # rad: longest step without an evaluation of pivots inside
ORDER = 3  # order of the error estimate


class Scratch(NamedTuple):
    """The prediction by a state fewer."""

    other: Annotated[Vector, "14*nb"]


scratch_of = opener(Scratch)


@kernel
def last_nodes(memory):
    """Make the last states, up to NODES of the same smooth piece, the nodes; their number."""
    history, taken = memory.loop.history, memory.equations.system.counts.steps
    found = min(NODES, taken - memory.loop.clock.restart + 1)
    for k in range(found):
        history.nodes[k] = (taken - k) % history.time.shape[0]
    return found


@exchangeable(STEP)
def step(rates, t, h, y, y_rate, y_new, memory):
    history, found = memory.loop.history, last_nodes(memory)
    other = scratch_of(memory.integrator).other[: y.shape[0]]
    extrapolate(history, found, t + h, y_new)
    if found == 1:
        return 0.0
    extrapolate(history, found - 1, t + h, other)
    off, moved = 0.0, 0.0
    for i in range(memory.active.coordinates.shape[0]):
        off, moved = larger(off, y_new[i] - other[i]), larger(moved, y_new[i] - y[i])
    return off / (NEARNESS * max(moved, ROUNDING))


PREDICTOR = Integrator(
    "predictor", ORDER, step, propose, Scratch, adaptive=True, integrates=False, largest_turn=LARGEST_TURN
)
