"""Functions of time: values and derivatives of the piece that is selected, and the times where pieces end.

A piece is analytic.  Steps end where pieces do, and within a step every evaluation is of the piece at the
start of the step, so that no integrator sees a jump.
"""

from __future__ import annotations

import itertools

from numpy import cos, inf, sin

from mbref.kernels.compilation import kernel
from mbref.scene import Scene, Sine, TimeFunction
from mbref.scene.scene import functions_of

AT_REST = Sine(amplitude=0.0, frequency=0.0, phase=0.0)


def numbers_of(function: TimeFunction, terms: int) -> tuple[float, ...]:
    """Return amplitude, frequency, phase and polynomial of a function of time."""
    sine, coefficients = function.sine or AT_REST, function.coefficients
    return sine.amplitude, sine.frequency, sine.phase, *coefficients, *(0.0,) * (terms - len(coefficients))


def pieces_of(function: TimeFunction) -> list[tuple[float, ...]]:
    """Return begin, part and cubic of each piece of a function."""
    return [(piece.begin, piece.part, *piece.cubic) for piece in function.pieces()]


def functions_of_drivers(scene: Scene) -> dict[str, tuple[int, ...]]:
    """Return by joint the indices, in ``functions_of``, of the functions of its driver."""
    further = itertools.count(len(functions_of(scene)) - sum(d.rows - 1 for d in scene.driver))
    return {
        driver.joint: (k, *(next(further) for _ in driver.functions[1:]))
        for k, driver in enumerate(scene.driver)
    }


@kernel
def function_value(f, t, equations):
    """Compute value, rate and acceleration at time t of function f: polynomial, sine, and the cubic of a
    table."""
    functions, p = equations.scene.functions, equations.piece[f]
    amplitude, frequency, polynomial = functions.amplitude[f], functions.frequency[f], functions.polynomial
    value, rate, acceleration = 0.0, 0.0, 0.0
    for k in range(polynomial.shape[1] - 1, -1, -1):  # Horner, with both derivatives
        acceleration = acceleration * t + 2.0 * rate
        rate = rate * t + value
        value = value * t + polynomial[f, k]
    argument = frequency * t + functions.phase[f]
    value += amplitude * sin(argument)
    rate += amplitude * frequency * cos(argument)
    acceleration -= amplitude * frequency * frequency * sin(argument)
    part, s, cubic = functions.part[p], t - functions.begin[p], functions.cubic
    value = part * value + cubic[p, 0] + s * (cubic[p, 1] + s * (cubic[p, 2] + s * cubic[p, 3]))
    rate = part * rate + cubic[p, 1] + s * (2.0 * cubic[p, 2] + 3.0 * s * cubic[p, 3])
    acceleration = part * acceleration + 2.0 * cubic[p, 2] + 6.0 * s * cubic[p, 3]
    return value, rate, acceleration


@kernel
def select_pieces(t, equations):
    """Select the piece of every function that begins at time t (s) or before."""
    functions, piece = equations.scene.functions, equations.piece
    for f in range(piece.shape[0]):
        piece[f] = functions.first[f]
        for p in range(functions.first[f] + 1, functions.first[f + 1]):
            if functions.begin[p] > t:
                break
            piece[f] = p


@kernel
def end_of_pieces(equations):
    """Return the time (s) at which the first of the selected pieces ends; infinite without an end."""
    functions, piece, end = equations.scene.functions, equations.piece, inf
    for f in range(piece.shape[0]):
        p = piece[f] + 1
        if p < functions.first[f + 1]:
            end = min(end, functions.begin[p])
    return end


@kernel
def expand_function(t, f, equations, series):
    """Compute function f as a series about time t: polynomial and sine of its piece, and the cubic."""
    functions, p, size = equations.scene.functions, equations.piece[f], series.shape[0]
    series[:] = 0.0
    for k in range(min(functions.polynomial.shape[1], size)):
        series[k] = functions.part[p] * shifted(functions.polynomial[f], k, t)
    s, c = t - functions.begin[p], functions.cubic
    series[0] += c[p, 0] + s * (c[p, 1] + s * (c[p, 2] + s * c[p, 3]))
    series[1] += c[p, 1] + s * (2.0 * c[p, 2] + 3.0 * s * c[p, 3])
    series[2] += c[p, 2] + 3.0 * s * c[p, 3]
    series[3] += c[p, 3]
    if functions.amplitude[f] == 0.0 or functions.part[p] == 0.0:
        return
    frequency, argument = functions.frequency[f], functions.frequency[f] * t + functions.phase[f]
    sine, cosine = functions.amplitude[f] * sin(argument), functions.amplitude[f] * cos(argument)
    for k in range(size):
        series[k] += sine
        sine, cosine = cosine * frequency / (k + 1), -sine * frequency / (k + 1)


@kernel
def shifted(coefficients, k, t):
    """Return order k of the polynomial about t: Σ_i c_i binom(i, k) t^(i - k)."""
    value, binomial, power = 0.0, 1.0, 1.0
    for i in range(k, coefficients.shape[0]):
        value += coefficients[i] * binomial * power
        power *= t
        binomial *= (i + 1.0) / (i + 1.0 - k)
    return value
