"""Adams: predictor–corrector of orders 1 to 12 and steps of any length, as in Shampine & Gordon's STEP.

L. F. Shampine and M. K. Gordon, Computer Solution of Ordinary Differential Equations, Freeman, 1975. PECE
with local extrapolation: predict with order k, evaluate, correct with order k + 1, evaluate.  Modified
divided differences φ_i of y' are stored, and ψ_i, the time since the state i + 1 steps ago. These differences
and times give the coefficients of a next step of any length.  Order and step are chosen from the errors
estimated at orders k - 2 to k + 1; a run starts at order 1, then increases the order and doubles the step
until the error estimates forbid it.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from numpy import sqrt

from mbref.integrators.base import Integrator
from mbref.kernels.compilation import exchangeable, kernel
from mbref.kernels.layout import OK, PROPOSE, STEP
from mbref.kernels.named_memory import Matrix, Vector, opener
from mbref.linear_algebra.vectors import copy

HIGHEST = 12  # largest order of the method
AIM = 0.5  # error / tolerance for which step lengths are chosen


class OrderControl(NamedTuple):
    """Numbers of the order and step control."""

    restart: int = -1  # ``clock.restart`` of the stored past
    order: int = 0
    next_order: int = 0  # order of the next attempt
    error_below: float = 0.0  # estimated error at the order below
    error: float = 0.0
    last_order: int = 0
    last_step: float = 0.0  # s
    equal_steps: float = 0.0  # number of successive steps of that length
    settled: int = 0  # 1 after the start phase
    failed: int = 0  # successive failed attempts


class Past(NamedTuple):
    """Modified divided differences φ_i of y' (row i), and numbers indexed from 1."""

    differences: Annotated[Matrix, HIGHEST + 3, "14*nb"]
    implied: Annotated[Vector, "14*nb"]  # y' of the predicting polynomial
    change: Annotated[Vector, "14*nb"]  # evaluated y' minus the y' of the predicting polynomial
    past_psi: Annotated[Vector, HIGHEST + 3]  # s, time since the state i steps ago
    psi: Annotated[Vector, HIGHEST + 3]  # s, time since the state i steps ago, at the attempt
    beta: Annotated[Vector, HIGHEST + 3]
    g: Annotated[Vector, HIGHEST + 3]
    sigma: Annotated[Vector, HIGHEST + 3]
    integrals: Annotated[Vector, HIGHEST + 3]
    progress: OrderControl


past_of = opener(Past)


def _gamma_star() -> np.ndarray:
    """Return |γ*_k|, the corrector's error constants for equal steps, from Σ_j γ*_(k-j) / (j + 1) = 0."""
    gamma = np.zeros(HIGHEST + 2)
    gamma[0] = 1.0
    for k in range(1, gamma.size):
        gamma[k] = -sum(gamma[k - j] / (j + 1) for j in range(1, k + 1))
    return np.abs(gamma)


GAMMA_STAR = _gamma_star()


@kernel
def norm(vector, y, control):
    """Return the Euclidean norm of a vector in tolerances of y, as in STEP."""
    total = 0.0
    for i in range(y.shape[0]):
        ratio = vector[i] / (control.atol + control.rtol * abs(y[i]))
        total += ratio * ratio
    return sqrt(total)


@kernel
def find_coefficients(h, k, memory):
    """Compute ψ, β, g and σ of a step of length h at order k, from the past ψ."""
    past, psi, beta = memory.past_psi, memory.psi, memory.beta
    g, sigma, integrals = memory.g, memory.sigma, memory.integrals
    psi[1], beta[1], sigma[1] = h, 1.0, 1.0
    for i in range(2, HIGHEST + 2):
        known = past[i - 1] > 0.0  # otherwise the run has fewer steps
        psi[i] = past[i - 1] + h if known else 0.0
        beta[i] = beta[i - 1] * psi[i - 1] / past[i - 1] if known else 0.0
    for i in range(1, k + 1):
        sigma[i + 1] = sigma[i] * i * h / psi[i]
    for q in range(1, k + 2):
        integrals[q] = 1.0 / q
    g[1] = 1.0
    for i in range(2, k + 2):
        for q in range(1, k + 3 - i):
            integrals[q] -= h / psi[i - 1] * integrals[q + 1]
        g[i] = integrals[1]


@kernel
def predict(h, k, y, y_new, past):
    """Compute y of order k after a step h, and y' of its polynomial there."""
    for i in range(y.shape[0]):
        slope, rate = 0.0, 0.0
        for j in range(k, 0, -1):
            difference = past.beta[j] * past.differences[j, i]
            slope += past.g[j] * difference
            rate += difference
        y_new[i] = y[i] + h * slope
        past.implied[i] = rate


@kernel
def estimate(h, k, y, past, control):
    """Estimate errors at orders k and below, and the order that they suggest; return the error ratio of the
    step."""
    progress, sigma, g = past.progress, past.sigma, past.g
    change = past.change[: y.shape[0]]
    size, error = h * norm(change, y, control), 0.0
    progress.error = size * sigma[k + 1] * GAMMA_STAR[k]
    progress.next_order = k
    for order in range(k - 1, max(0, k - 3), -1):
        for i in range(y.shape[0]):
            change[i] += past.beta[order + 1] * past.differences[order + 1, i]
        error = h * norm(change, y, control) * sigma[order + 1] * GAMMA_STAR[order]
        if order == k - 1:
            progress.error_below = error
    allowed = progress.error if k > 2 else 0.5 * progress.error
    if k > 1 and max(error, progress.error_below) <= allowed:
        progress.next_order = k - 1
    return size * (g[k] - g[k + 1])


@exchangeable(STEP)
def step(rates, t, h, y, y_rate, y_new, memory):
    past = past_of(memory.integrator)
    n, k = y.shape[0], past.progress.order
    past.progress.next_order = k
    find_coefficients(h, k, past)
    predict(h, k, y, y_new, past)
    change = past.change[:n]
    status = rates(t + h, y_new, change, memory)
    if status != OK:
        return -float(status)
    for i in range(n):
        change[i] -= past.implied[i]
        y_new[i] += h * past.g[k + 1] * change[i]
    return estimate(h, k, y, past, memory.control)


@kernel
def forget(past, restart):
    """Begin a new smooth piece."""
    past.differences[:] = 0.0
    past.past_psi[:] = 0.0
    progress = past.progress
    progress.restart, progress.order, progress.last_order, progress.last_step = restart, 1, 0, 0.0
    progress.equal_steps, progress.settled, progress.failed = 0.0, 0, 0


@kernel
def first_step(y, y_rate, control):
    """Return STEP's initial step, of order 1, whose error is estimated from the sizes of y and y'.

    ``one_step.first_step`` is not used, because a step of order 1 must be shorter than one of order 8.
    """
    rate, least = norm(y_rate, y, control), 1e-6 * control.largest_step
    return max(least, 0.25 * sqrt(max(1.0, norm(y, y, control))) / rate) if rate > 0.0 else least


@kernel
def remember(h, k, y_rate, past):
    """Update differences and ψ after a step of length h at order k that ended with rates y'."""
    progress, beta, differences = past.progress, past.beta, past.differences
    for i in range(y_rate.shape[0]):
        difference = y_rate[i] - past.implied[i]
        differences[k + 2, i] = difference - beta[k + 1] * differences[k + 1, i]
        differences[k + 1, i] = difference
        for j in range(k, 0, -1):
            difference += beta[j] * differences[j, i]
            differences[j, i] = difference
    copy(past.psi[1 : HIGHEST + 2], past.past_psi[1 : HIGHEST + 2])
    equal = progress.equal_steps if h == progress.last_step else 0.0
    progress.equal_steps = min(equal, float(progress.last_order)) + 1.0
    progress.last_order, progress.last_step, progress.failed = k, h, 0


@kernel
def choose_order(h, y, past, control):
    """Return the order of the next step, and its error in ``error``; sets ``settled`` after the start
    phase."""
    progress, highest = past.progress, int(control.order)
    k = progress.order
    if progress.next_order < k or k == highest:
        progress.settled = 1
    if progress.next_order < k:
        progress.error = progress.error_below
        return k - 1
    if progress.settled == 0:
        return k + 1
    if k + 1 > progress.equal_steps:
        return k  # the estimate at order k + 1 needs equal steps
    above = h * norm(past.differences[k + 2], y, control) * GAMMA_STAR[k + 1]
    if k > 1 and progress.error_below <= min(progress.error, above):
        progress.error = progress.error_below
        return k - 1
    if k == highest or above >= (progress.error if k > 1 else 0.5 * progress.error):
        return k
    progress.error = above
    return k + 1


@exchangeable(PROPOSE)
def propose(h, suggested, ratio, y, y_rate, memory):
    past, control = past_of(memory.integrator), memory.control
    progress = past.progress
    if progress.restart != memory.loop.clock.restart:
        forget(past, memory.loop.clock.restart)
        copy(y_rate, past.differences[1, : y.shape[0]])
        return first_step(y, y_rate, control)
    if 0.0 <= ratio <= 1.0:
        remember(h, progress.order, y_rate, past)
        k = choose_order(h, y, past, control)
        progress.order = k
        if progress.settled == 0 or progress.error * 2.0 ** (k + 1) <= AIM:
            return 2.0 * h
        if progress.error <= AIM:
            return h
        return h * max(0.5, min(0.9, (AIM / progress.error) ** (1.0 / (k + 1))))
    progress.settled = 1
    progress.failed += 1
    progress.order = 1 if progress.failed >= 3 else progress.next_order
    if progress.failed > 3 and ratio > 1.0 and 0.25 * progress.error > AIM:
        return h * sqrt(AIM / progress.error)
    return 0.5 * h


ADAMS = Integrator("adams", HIGHEST, step, propose, Past, adaptive=True, options={"max_order": HIGHEST})
