"""Adams: predictor–corrector of orders 1 to 12 and steps of any length, as in Shampine & Gordon's STEP.

L. F. Shampine and M. K. Gordon, Computer Solution of Ordinary Differential Equations, Freeman, 1975.
PECE with local extrapolation: predict with order k, evaluate, correct with order k + 1, evaluate.  Kept of
the past are modified divided differences φ_i of y' and ψ_i, the time since the last state but i; from them
follow the coefficients of a next step of any length.  Order and step are chosen from the errors estimated
at orders k - 2 to k + 1; a run starts at order 1, then raises the order and doubles the step until the
estimates object.
"""

from __future__ import annotations

import numpy as np
from numpy import sqrt

from mbref.integrators.base import Integrator
from mbref.kernels.compilation import exchangeable, kernel
from mbref.kernels.layout import LARGEST_STEP, OK, ORDER, PROPOSE, STEP
from mbref.linear_algebra.vectors import copy

HIGHEST = 12
# rows of memory: STATE, φ_1 to φ_(HIGHEST + 2), then
STATE = 0
# y' that the prediction implies, y' evaluated there less that; then numbers indexed from 1: ψ of the past,
# and of the attempt ψ, β, g, σ and the integrals that g follows from
IMPLIED, CHANGE, PAST_PSI, PSI, BETA, G, SIGMA, INTEGRALS = range(HIGHEST + 3, HIGHEST + 11)
# entries of memory[STATE]: order (0: nothing is known yet); the next order, as the attempt has it; errors
# estimated at orders k - 1 and k; order and length of the last step; steps in a row of that length;
# whether the start is over; failed attempts in a row
K, NEXT_K, ERROR_BELOW, ERROR, LAST_K, LAST_H, EQUAL, SETTLED, FAILED = range(9)
AIM = 0.5  # the error, in tolerances, that steps are chosen for


def _gamma_star() -> np.ndarray:
    """|γ*_k|, the corrector's error constants at equal steps, from Σ_j γ*_(k-j) / (j + 1) = 0."""
    gamma = np.zeros(HIGHEST + 2)
    gamma[0] = 1.0
    for k in range(1, gamma.size):
        gamma[k] = -sum(gamma[k - j] / (j + 1) for j in range(1, k + 1))
    return np.abs(gamma)


GAMMA_STAR = _gamma_star()


@kernel
def norm(vector, y, tolerances):
    """Euclidean norm of a vector in tolerances of y, as in STEP."""
    total = 0.0
    for i in range(y.shape[0]):
        ratio = vector[i] / (tolerances[1] + tolerances[0] * abs(y[i]))
        total += ratio * ratio
    return sqrt(total)


@kernel
def coefficients(h, k, memory):
    """ψ, β, g and σ of a step of length h at order k, from the past ψ."""
    past, psi, beta = memory[PAST_PSI], memory[PSI], memory[BETA]
    g, sigma, integrals = memory[G], memory[SIGMA], memory[INTEGRALS]
    psi[1], beta[1], sigma[1] = h, 1.0, 1.0
    for i in range(2, HIGHEST + 2):
        known = past[i - 1] > 0.0  # otherwise the run is younger than that
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
def predict(h, k, y, y_new, memory):
    """y of order k after a step h, and y' that its polynomial has there."""
    for i in range(y.shape[0]):
        slope, rate = 0.0, 0.0
        for j in range(k, 0, -1):
            difference = memory[BETA, j] * memory[j, i]
            slope += memory[G, j] * difference
            rate += difference
        y_new[i] = y[i] + h * slope
        memory[IMPLIED, i] = rate


@kernel
def estimate(h, k, y, memory, tolerances):
    """Errors at orders k and below, and the order they speak for; returns the error ratio of the step."""
    state, change, sigma, g = memory[STATE], memory[CHANGE], memory[SIGMA], memory[G]
    size, error = h * norm(change, y, tolerances), 0.0
    state[ERROR] = size * sigma[k + 1] * GAMMA_STAR[k]
    state[NEXT_K] = k
    for order in range(k - 1, max(0, k - 3), -1):
        for i in range(y.shape[0]):
            change[i] += memory[BETA, order + 1] * memory[order + 1, i]
        error = h * norm(change, y, tolerances) * sigma[order + 1] * GAMMA_STAR[order]
        if order == k - 1:
            state[ERROR_BELOW] = error
    allowed = state[ERROR] if k > 2 else 0.5 * state[ERROR]
    if k > 1 and max(error, state[ERROR_BELOW]) <= allowed:
        state[NEXT_K] = k - 1
    return size * (g[k] - g[k + 1])


@exchangeable(STEP)
def step(
    rates, accelerate, t, h, y, y_rate, y_new, memory, tolerances,
    problem,
):  # fmt: skip
    n, k = y.shape[0], int(memory[STATE, K])
    memory[STATE, NEXT_K] = k
    coefficients(h, k, memory)
    predict(h, k, y, y_new, memory)
    change = memory[CHANGE, :n]
    status = rates(accelerate, t + h, y_new, change, problem)
    if status != OK:
        return -float(status)
    for i in range(n):
        change[i] -= memory[IMPLIED, i]
        y_new[i] += h * memory[G, k + 1] * change[i]
    return estimate(h, k, y, memory, tolerances)


@kernel
def start(y, y_rate, memory, control, tolerances):
    """Forget the past; a first step of order 1, its error guessed from the sizes of y and y'."""
    memory[STATE, K] = 1.0
    copy(y_rate, memory[1, : y.shape[0]])
    rate, least = norm(y_rate, y, tolerances), 1e-6 * control[LARGEST_STEP]
    return max(least, 0.25 * sqrt(max(1.0, norm(y, y, tolerances))) / rate) if rate > 0.0 else least


@kernel
def remember(h, k, y_rate, memory):
    """Differences and ψ after a step of length h at order k that ended with rates y'."""
    state, beta = memory[STATE], memory[BETA]
    for i in range(y_rate.shape[0]):
        difference = y_rate[i] - memory[IMPLIED, i]
        memory[k + 2, i] = difference - beta[k + 1] * memory[k + 1, i]
        memory[k + 1, i] = difference
        for j in range(k, 0, -1):
            difference += beta[j] * memory[j, i]
            memory[j, i] = difference
    copy(memory[PSI, 1 : HIGHEST + 2], memory[PAST_PSI, 1 : HIGHEST + 2])
    equal = state[EQUAL] if h == state[LAST_H] else 0.0
    state[EQUAL] = min(equal, state[LAST_K]) + 1.0
    state[LAST_K], state[LAST_H], state[FAILED] = k, h, 0.0


@kernel
def choose_order(h, k, highest, y, memory, tolerances):
    """The order of the next step, with ``ERROR`` its error; sets ``SETTLED`` when the start is over."""
    state = memory[STATE]
    if state[NEXT_K] < k or k == highest:
        state[SETTLED] = 1.0
    if state[NEXT_K] < k:
        state[ERROR] = state[ERROR_BELOW]
        return k - 1
    if state[SETTLED] == 0.0:
        return k + 1
    if k + 1 > state[EQUAL]:
        return k  # the estimate at order k + 1 needs equal steps
    above = h * norm(memory[k + 2], y, tolerances) * GAMMA_STAR[k + 1]
    if k > 1 and state[ERROR_BELOW] <= min(state[ERROR], above):
        state[ERROR] = state[ERROR_BELOW]
        return k - 1
    if k == highest or above >= (state[ERROR] if k > 1 else 0.5 * state[ERROR]):
        return k
    state[ERROR] = above
    return k + 1


@exchangeable(PROPOSE)
def propose(h, suggested, ratio, y, y_rate, memory, control, tolerances):
    state = memory[STATE]
    if state[K] == 0.0:
        return start(y, y_rate, memory, control, tolerances)
    if 0.0 <= ratio <= 1.0:
        remember(h, int(state[K]), y_rate, memory)
        k = choose_order(h, int(state[K]), int(control[ORDER]), y, memory, tolerances)
        state[K] = k
        if state[SETTLED] == 0.0 or state[ERROR] * 2.0 ** (k + 1) <= AIM:
            return 2.0 * h
        if state[ERROR] <= AIM:
            return h
        return h * max(0.5, min(0.9, (AIM / state[ERROR]) ** (1.0 / (k + 1))))
    state[SETTLED] = 1.0
    state[FAILED] += 1.0
    state[K] = 1.0 if state[FAILED] >= 3.0 else state[NEXT_K]
    if state[FAILED] > 3.0 and ratio > 1.0 and 0.25 * state[ERROR] > AIM:
        return h * sqrt(AIM / state[ERROR])
    return 0.5 * h


ADAMS = Integrator(
    "adams", HIGHEST, step, propose, HIGHEST + 11, adaptive=True, options={"max_order": HIGHEST}
)
