"""Angles of joints in the rows of couplings: values, rates and gradients at given variables.

With C = e₁ · f and S = e₂ · f of the directions e of the first body and f of the second, the angle is
arctan2(S, C), unwrapped, and its gradient is (C δS - S δC) / (C² + S²).
"""

from __future__ import annotations

from mbref.equations.primitives import unwrapped_angle
from mbref.kernels.compilation import inlined, kernel
from mbref.linear_algebra.vectors import dot


@inlined
def components(at, share, row, torsions):
    """Return the three components of a direction, from the component with number ``at`` on, at variables
    ``row``; ``share`` is 1.0, or 0.0 for the rate of a direction at rates of the variables."""
    constant, form = torsions.constant.reshape(-1), torsions.form
    x, y, z = share * constant[at], share * constant[at + 1], share * constant[at + 2]
    for i in range(form.shape[1]):
        value = row[i]
        x += form[at, i] * value
        y += form[at + 1, i] * value
        z += form[at + 2, i] * value
    return x, y, z


@kernel
def add_angles(memory):
    """Add the angles at the first coefficients, nearest to the previous angles, to Φ of their rows."""
    torsions, terms, phi = memory.polynomials.torsions, memory.series.terms, memory.solver.phi
    nz, y = memory.solver.pivot_columns.shape[0], terms[0]
    for s in range(torsions.row.shape[0]):
        if torsions.row[s] >= 0:
            f, near = components(9 * s + 6, 1.0, y, torsions), memory.run.equations.angles[torsions.slot[s]]
            cosine = dot(components(9 * s, 1.0, y, torsions), f)
            sine = dot(components(9 * s + 3, 1.0, y, torsions), f)
            phi[nz + torsions.row[s]] += torsions.factor[s] * unwrapped_angle(sine, cosine, near)


@kernel
def add_angle_rates(memory):
    """Add the rates of the angles at the first two coefficients to Φ' of their rows."""
    torsions, terms, phi = memory.polynomials.torsions, memory.series.terms, memory.solver.phi
    nz, y, v = memory.solver.pivot_columns.shape[0], terms[0], terms[1]
    for s in range(torsions.row.shape[0]):
        if torsions.row[s] >= 0:
            e1, e2 = components(9 * s, 1.0, y, torsions), components(9 * s + 3, 1.0, y, torsions)
            e1_rate, e2_rate = components(9 * s, 0.0, v, torsions), components(9 * s + 3, 0.0, v, torsions)
            f, f_rate = components(9 * s + 6, 1.0, y, torsions), components(9 * s + 6, 0.0, v, torsions)
            cosine, sine = dot(e1, f), dot(e2, f)
            cosine_rate = dot(e1_rate, f) + dot(e1, f_rate)
            sine_rate = dot(e2_rate, f) + dot(e2, f_rate)
            rate = (cosine * sine_rate - sine * cosine_rate) / (cosine * cosine + sine * sine)
            phi[nz + torsions.row[s]] += torsions.factor[s] * rate


@kernel
def add_angle_gradients(variables, matrix, memory):
    """Add the gradients of the angles at variables[0] to the rows of a matrix, times their factors."""
    torsions = memory.polynomials.torsions
    form, y = torsions.form, variables[0]
    for s in range(torsions.row.shape[0]):
        if torsions.row[s] >= 0:
            at = 9 * s
            e1, e2 = components(at, 1.0, y, torsions), components(at + 3, 1.0, y, torsions)
            f = components(at + 6, 1.0, y, torsions)
            cosine, sine = dot(e1, f), dot(e2, f)
            factor = torsions.factor[s] / (cosine * cosine + sine * sine)
            for i in range(form.shape[1]):
                value = 0.0
                for c in range(3):
                    value += (cosine * e2[c] - sine * e1[c]) * form[at + 6 + c, i]
                    value += f[c] * (cosine * form[at + 3 + c, i] - sine * form[at + c, i])
                matrix[torsions.row[s], i] += factor * value
