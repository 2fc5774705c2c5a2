"""First-order changes of functions of time by numbers of the scene."""

from __future__ import annotations

from numpy import cos, sin

from mbref.equations.functions import function_value
from mbref.kernels.compilation import kernel


@kernel
def function_change(f, t, n, numbers, equations):
    """Return the changes of value, rate and acceleration at time t of function f by number n."""
    functions, changes, p = equations.scene.functions, numbers.functions, equations.piece[f]
    polynomial_changes, first = changes.polynomial, n * functions.amplitude.shape[0] + f
    part = functions.part[p]
    value, rate, acceleration = function_value(f, t, equations)
    s, c = t - functions.begin[p], functions.cubic
    cubic = c[p, 0] + s * (c[p, 1] + s * (c[p, 2] + s * c[p, 3]))
    own = value - cubic
    own_rate = rate - c[p, 1] - s * (2.0 * c[p, 2] + 3.0 * s * c[p, 3])
    own_second = acceleration - 2.0 * c[p, 2] - 6.0 * s * c[p, 3]
    less = changes.part[n, p] / part if part != 0.0 else 0.0
    value, rate, acceleration = 0.0, 0.0, 0.0
    for k in range(polynomial_changes.shape[1] - 1, -1, -1):
        acceleration = acceleration * t + 2.0 * rate
        rate = rate * t + value
        value = value * t + polynomial_changes[first, k]
    frequency, amplitude = functions.frequency[f], functions.amplitude[f]
    argument = frequency * t + functions.phase[f]
    sine, cosine = sin(argument), cos(argument)
    grown, faster = changes.amplitude[n, f], changes.frequency[n, f]
    turned = amplitude * (faster * t + changes.phase[n, f])
    square, squared = frequency * frequency, 2.0 * frequency * faster * amplitude
    value += grown * sine + turned * cosine
    rate += (grown * frequency + amplitude * faster) * cosine - frequency * turned * sine
    acceleration -= (grown * square + squared) * sine + square * turned * cosine
    e = changes.cubic
    value = part * value + less * own
    rate = part * rate + less * own_rate
    acceleration = part * acceleration + less * own_second
    value += e[n, 4 * p] + s * (e[n, 4 * p + 1] + s * (e[n, 4 * p + 2] + s * e[n, 4 * p + 3]))
    rate += e[n, 4 * p + 1] + s * (2.0 * e[n, 4 * p + 2] + 3.0 * s * e[n, 4 * p + 3])
    acceleration += 2.0 * e[n, 4 * p + 2] + 6.0 * s * e[n, 4 * p + 3]
    return value, rate, acceleration
