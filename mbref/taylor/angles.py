"""Angles of joints in the rows of couplings: values, rates and gradients at given variables.

With C = e₁ · f and S = e₂ · f of the directions e of the first body and f of the second, the angle is
arctan2(S, C), unwrapped, and its gradient is (C δS - S δC) / (C² + S²).
"""

from __future__ import annotations

from math import pi

from numpy import arctan2, floor

from mbref.kernels.compilation import inlined, kernel


@inlined
def components(s, first, order, variables, torsions):
    """Return the three components, of order 0 or 1, of a direction; ``first`` is the index of the first
    component."""
    x, y, z = 0.0, 0.0, 0.0
    if order == 0:
        constant = torsions.constant
        x, y, z = constant[s, first], constant[s, first + 1], constant[s, first + 2]
    form, at = torsions.form, 9 * s + first
    for i in range(form.shape[1]):
        value = variables[order, i]
        x += form[at, i] * value
        y += form[at + 1, i] * value
        z += form[at + 2, i] * value
    return x, y, z


@inlined
def inner(a, b):
    """Return the product of two triples."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def add_angles(memory):
    """Add the angles at the first coefficients, nearest to the previous angles, to Φ of their rows."""
    torsions, terms, phi = memory.polynomials.torsions, memory.series.terms, memory.solver.phi
    nz = memory.solver.pivot_columns.shape[0]
    for s in range(torsions.row.shape[0]):
        if torsions.row[s] >= 0:
            f, near = components(s, 6, 0, terms, torsions), memory.angles[s]
            cosine = inner(components(s, 0, 0, terms, torsions), f)
            sine = inner(components(s, 3, 0, terms, torsions), f)
            angle = arctan2(sine, cosine)
            angle += 2.0 * pi * floor((near - angle) / (2.0 * pi) + 0.5)
            phi[nz + torsions.row[s]] += torsions.factor[s] * angle


@kernel
def add_angle_rates(memory):
    """Add the rates of the angles at the first two coefficients to Φ' of their rows."""
    torsions, terms, phi = memory.polynomials.torsions, memory.series.terms, memory.solver.phi
    nz = memory.solver.pivot_columns.shape[0]
    for s in range(torsions.row.shape[0]):
        if torsions.row[s] >= 0:
            e1, e1_rate = components(s, 0, 0, terms, torsions), components(s, 0, 1, terms, torsions)
            e2, e2_rate = components(s, 3, 0, terms, torsions), components(s, 3, 1, terms, torsions)
            f, f_rate = components(s, 6, 0, terms, torsions), components(s, 6, 1, terms, torsions)
            cosine, sine = inner(e1, f), inner(e2, f)
            cosine_rate = inner(e1_rate, f) + inner(e1, f_rate)
            sine_rate = inner(e2_rate, f) + inner(e2, f_rate)
            rate = (cosine * sine_rate - sine * cosine_rate) / (cosine * cosine + sine * sine)
            phi[nz + torsions.row[s]] += torsions.factor[s] * rate


@kernel
def add_angle_gradients(variables, matrix, memory):
    """Add the gradients of the angles at variables[0] to the rows of a matrix, times their factors."""
    torsions = memory.polynomials.torsions
    form = torsions.form
    for s in range(torsions.row.shape[0]):
        if torsions.row[s] >= 0:
            e1, e2 = components(s, 0, 0, variables, torsions), components(s, 3, 0, variables, torsions)
            f, at = components(s, 6, 0, variables, torsions), 9 * s
            cosine, sine = inner(e1, f), inner(e2, f)
            factor = torsions.factor[s] / (cosine * cosine + sine * sine)
            for i in range(form.shape[1]):
                value = 0.0
                for c in range(3):
                    value += (cosine * e2[c] - sine * e1[c]) * form[at + 6 + c, i]
                    value += f[c] * (cosine * form[at + 3 + c, i] - sine * form[at + c, i])
                matrix[torsions.row[s], i] += factor * value
