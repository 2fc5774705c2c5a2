"""Kinds of steps of a Taylor method (regular, high-accuracy, predictor), with tolerance and order of the
series."""

from __future__ import annotations

from mbref.kernels.compilation import inlined, kernel

REGULAR, HIGH_ACCURACY, PREDICTOR = range(3)
NEWTON_TOLERANCE = 1e-4  # violation below which a predictor step keeps the factorised Jacobian


@kernel
def set_mode(kind, tolerance, order, memory):
    """Set the kind of the next steps, their tolerance and the order of their series."""
    memory.mode.kind, memory.mode.tolerance, memory.mode.order = kind, tolerance, order


@kernel
def set_regular(memory):
    """Take regular steps, which end before singular positions."""
    options = memory.options
    set_mode(REGULAR, options.regular_tolerance, options.regular_order, memory)


@kernel
def set_high_accuracy(memory):
    """Take high-accuracy steps, which cross singular positions."""
    options = memory.options
    set_mode(HIGH_ACCURACY, options.accurate_tolerance, options.accurate_order, memory)


@kernel
def set_predictor(memory):
    """Take predictor steps, which drivers correct at their ends."""
    set_mode(PREDICTOR, NEWTON_TOLERANCE, memory.options.regular_order, memory)


@inlined
def is_accurate(memory):
    """Return whether steps are high-accuracy steps."""
    return memory.mode.kind == HIGH_ACCURACY
