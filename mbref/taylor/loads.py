"""Loads and functions of time as Taylor series, by the recurrences of quotients and square roots."""

from __future__ import annotations

from typing import Any

from numpy import cos, inf, sin, sqrt

from mbref.equations.functions import expand_function
from mbref.kernels.compilation import inlined, kernel

VALUE, COSINE, SINE = range(3)  # functions of a driver's value
SPRING_VECTOR, SPRING_LENGTH, SPRING_INVERSE, SPRING_RATE, SPRING_PULL, SPRING_SERIES = 0, 3, 4, 5, 6, 7


@inlined
def product_order(a, b, k):
    """Return order k of the product of two series."""
    value = 0.0
    for i in range(k + 1):
        value += a[i] * b[k - i]
    return value


@kernel
def grow_forms(constant, form, k, variables, target):
    """Compute order k of affine forms of the variables, one in each row of ``form``."""
    for c in range(form.shape[0]):
        value = constant[c] if k == 0 else 0.0
        for i in range(form.shape[1]):
            value += form[c, i] * variables[k, i]
        target[c, k] = value


def varies(polynomials: Any) -> bool:
    """Return whether a scene has loads other than constant forces and moments, or couplings of angles or of
    powers."""
    loads = polynomials.springs.damping.shape[0] + polynomials.torsions.damping.shape[0]
    return loads + polynomials.slides.damping.shape[0] + polynomials.timed.function.shape[0] > 0


@inlined
def applied_order(amount, function, k, factors):
    """Return order k of a force or torque that a function of time multiplies, or that is constant."""
    if function >= 0:
        return amount * factors[function, k]
    return amount if k == 0 else 0.0


@inlined
def has_direction(s, springs):
    """Return whether the force of a spring depends on its direction; otherwise it is linear in the
    variables."""
    return springs.natural[s] > 0.0 or springs.damping[s] > 0.0


@kernel
def grow_springs(k, memory):
    """Compute order k of the springs' vectors, lengths and inverses; order k - 1 of their rates."""
    springs, variables = memory.polynomials.springs, memory.series.terms
    for s in range(springs.stiffness.shape[0]):
        of = memory.series.springs[SPRING_SERIES * s : SPRING_SERIES * (s + 1)]
        grow_forms(springs.constant[s], springs.form[3 * s : 3 * s + 3], k, variables, of)
        square = 0.0
        for c in range(3):
            square += product_order(of[c], of[c], k)
        length, inverse = of[SPRING_LENGTH], of[SPRING_INVERSE]
        if k == 0:
            length[0] = sqrt(square)
            inverse[0] = 1.0 / length[0] if has_direction(s, springs) else 0.0
        else:
            for i in range(1, k):
                square -= length[i] * length[k - i]
            length[k] = 0.5 * square * inverse[0]
            value = 0.0
            for i in range(1, k + 1):
                value -= length[i] * inverse[k - i]
            inverse[k] = value * inverse[0]
            of[SPRING_RATE, k - 1] = k * length[k]


@kernel
def add_springs(k, memory):
    """Compute order k of the forces of springs: -(stiffness (1 - natural / l) + damping l' / l) times the
    vector."""
    springs, sums, nz = memory.polynomials.springs, memory.series.sums, memory.solver.pivot_columns.shape[0]
    for s in range(springs.stiffness.shape[0]):
        of = memory.series.springs[SPRING_SERIES * s : SPRING_SERIES * (s + 1)]
        pull = springs.damping[s] * product_order(of[SPRING_RATE], of[SPRING_INVERSE], k)
        pull -= springs.stiffness[s] * springs.natural[s] * of[SPRING_INVERSE, k]
        of[SPRING_PULL, k] = pull + springs.stiffness[s] if k == 0 else pull
        for c in range(3):
            value, form = product_order(of[SPRING_PULL], of[c], k), springs.form[3 * s + c]
            for i in range(nz):
                sums[k, i] += value * form[i]


@kernel
def time_to_no_length(memory):
    """Return the shortest time (s) in which the ends of a spring could meet at their speed; infinite without
    springs.

    Beyond that time the series of the spring's force is dominated by rounding, because it is divided by a
    small length.
    """
    springs, shortest = memory.polynomials.springs, inf
    for s in range(springs.stiffness.shape[0]):
        of, speed = memory.series.springs[SPRING_SERIES * s : SPRING_SERIES * (s + 1)], 0.0
        for c in range(3):
            speed += of[SPRING_VECTOR + c, 1] * of[SPRING_VECTOR + c, 1]
        if has_direction(s, springs) and speed > 0.0:
            shortest = min(shortest, of[SPRING_LENGTH, 0] / sqrt(speed))
    return shortest


@kernel
def part_behind_no_length(memory):
    """Return the fraction of a step after a position at which a spring has zero length and its force
    reverses; 0 without such a spring.

    Such a spring has turned by more than a right angle. The series of its length continues with negative
    values.
    """
    springs, series, largest = memory.polynomials.springs, memory.series, 0.0
    for s in range(springs.stiffness.shape[0]):
        before, behind, along = 0.0, 0.0, 0.0
        for c in range(3):
            form, there, here = springs.form[3 * s + c], springs.constant[s, c], springs.constant[s, c]
            for i in range(form.shape[0]):
                there += form[i] * series.past[0, i]
                here += form[i] * series.terms[0, i]
            before, behind, along = before + there * there, behind + here * here, along + there * here
        if springs.natural[s] > 0.0 and along < 0.0:
            largest = max(largest, sqrt(behind) / (sqrt(before) + sqrt(behind)))
    return largest


@kernel
def add_timed_forces(k, memory):
    """Compute order k of forces and moments that functions of time multiply."""
    timed, sums, terms = memory.polynomials.timed, memory.series.sums, memory.series.terms
    nz = memory.solver.pivot_columns.shape[0]
    for s in range(timed.function.shape[0]):
        factor = memory.series.factors[timed.function[s]]
        for i in range(nz):
            value, linear = factor[k] * timed.constant[s, i], timed.linear[nz * s + i]
            for j in range(nz):
                if linear[j] != 0.0:
                    for order in range(k + 1):
                        value += factor[order] * linear[j] * terms[k - order, j]
            sums[k, i] -= value


@kernel
def expand_functions(t, memory):
    """Compute the factors of loads, and the functions that drivers prescribe, as series about time t."""
    equations, loads = memory.run.equations, memory.run.equations.scene.loads
    for l in range(loads.function.shape[0]):
        if loads.function[l] >= 0:
            expand_function(t, loads.function[l], equations, memory.series.factors[loads.function[l]])
    given, functions, n = (
        memory.polynomials.given,
        memory.series.terms,
        memory.solver.pivot_columns.shape[0] + memory.solver.pivot_rows.shape[0],
    )
    driven = memory.series.driven
    for g in range(given.driver.shape[0]):
        expand_function(t, given.driver[g], equations, driven)
        if given.function[g] == VALUE:
            for k in range(driven.shape[0]):
                functions[k, n + g] = driven[k] / given.unit[g]
        elif given.function[g] == COSINE:
            expand_angle(driven, functions, n + g)


@kernel
def expand_angle(driven, functions, g):
    """Compute the cosine and the sine of a series, into lanes g and g + 1."""
    functions[0, g], functions[0, g + 1] = cos(driven[0]), sin(driven[0])
    last = driven.shape[0] - 1
    while last > 1 and driven[last] == 0.0:
        last -= 1
    for k in range(1, driven.shape[0]):
        cosine, sine, inverse = 0.0, 0.0, 1.0 / k  # divide once, outside the recursion
        for i in range(1, min(k, last) + 1):
            cosine -= i * driven[i] * functions[k - i, g + 1]
            sine += i * driven[i] * functions[k - i, g]
        functions[k, g], functions[k, g + 1] = inverse * cosine, inverse * sine
