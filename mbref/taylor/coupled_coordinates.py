"""Joint coordinates in the rows of couplings: values, rates and gradients at given variables.

With C = e₁ · f and S = e₂ · f of the directions e of the first body and f of the second, an angle is
arctan2(S, C), unwrapped, and its gradient is (C δS - S δC) / (C² + S²). A displacement is a · d. A row
contains a polynomial of the coordinate.
"""

from __future__ import annotations

from mbref.equations.primitives import polynomial, unwrapped_angle
from mbref.kernels.compilation import inlined, kernel
from mbref.linear_algebra.vectors import dot


@inlined
def has_coordinates(polynomials):
    """Return whether a scene has loads along joint coordinates, or coordinates in rows of couplings."""
    return polynomials.torsions.row.shape[0] + polynomials.slides.row.shape[0] > 0


@inlined
def components(at, share, row, table):
    """Return the three components of a vector, from the component with number ``at`` on, at variables
    ``row``; ``share`` is 1.0, or 0.0 for the rate of a vector at rates of the variables."""
    constant, form = table.constant.reshape(-1), table.form
    x, y, z = share * constant[at], share * constant[at + 1], share * constant[at + 2]
    for i in range(form.shape[1]):
        value = row[i]
        x += form[at, i] * value
        y += form[at + 1, i] * value
        z += form[at + 2, i] * value
    return x, y, z


@inlined
def angle_at(s, y, memory):
    """Return the angle of a torsion at variables y, nearest to the previous angle, its cosine and sine, times
    one factor."""
    torsions = memory.polynomials.torsions
    f, near = components(9 * s + 6, 1.0, y, torsions), memory.run.equations.angles[torsions.slot[s]]
    cosine = dot(components(9 * s, 1.0, y, torsions), f)
    sine = dot(components(9 * s + 3, 1.0, y, torsions), f)
    return unwrapped_angle(sine, cosine, near), cosine, sine


@inlined
def displacement_at(s, y, memory):
    """Return the displacement of a slide at variables y."""
    slides = memory.polynomials.slides
    return dot(components(6 * s, 1.0, y, slides), components(6 * s + 3, 1.0, y, slides))


@kernel
def add_coordinates(memory):
    """Add the polynomials of coordinates at the first coefficients to Φ of their rows."""
    torsions, slides = memory.polynomials.torsions, memory.polynomials.slides
    nz, y, phi = memory.solver.pivot_columns.shape[0], memory.series.terms[0], memory.solver.phi
    for s in range(torsions.row.shape[0]):
        if torsions.row[s] >= 0:
            angle, _, _ = angle_at(s, y, memory)
            phi[nz + torsions.row[s]] += polynomial(torsions.law[s, 0], torsions.law[s, 1:], angle)[0]
    for s in range(slides.row.shape[0]):
        if slides.row[s] >= 0:
            moved = displacement_at(s, y, memory)
            phi[nz + slides.row[s]] += polynomial(slides.law[s, 0], slides.law[s, 1:], moved)[0]


@kernel
def add_rates(memory):
    """Add the rates of the polynomials at the first two coefficients to Φ' of their rows."""
    torsions, slides, terms = memory.polynomials.torsions, memory.polynomials.slides, memory.series.terms
    nz, y, v, phi = memory.solver.pivot_columns.shape[0], terms[0], terms[1], memory.solver.phi
    for s in range(torsions.row.shape[0]):
        if torsions.row[s] >= 0:
            e1, e2 = components(9 * s, 1.0, y, torsions), components(9 * s + 3, 1.0, y, torsions)
            e1_rate, e2_rate = components(9 * s, 0.0, v, torsions), components(9 * s + 3, 0.0, v, torsions)
            f, f_rate = components(9 * s + 6, 1.0, y, torsions), components(9 * s + 6, 0.0, v, torsions)
            angle, cosine, sine = angle_at(s, y, memory)
            cosine_rate = dot(e1_rate, f) + dot(e1, f_rate)
            sine_rate = dot(e2_rate, f) + dot(e2, f_rate)
            rate = (cosine * sine_rate - sine * cosine_rate) / (cosine * cosine + sine * sine)
            phi[nz + torsions.row[s]] += polynomial(torsions.law[s, 0], torsions.law[s, 1:], angle)[1] * rate
    for s in range(slides.row.shape[0]):
        if slides.row[s] >= 0:
            axis, apart = components(6 * s, 1.0, y, slides), components(6 * s + 3, 1.0, y, slides)
            axis_rate, apart_rate = components(6 * s, 0.0, v, slides), components(6 * s + 3, 0.0, v, slides)
            rate = dot(axis_rate, apart) + dot(axis, apart_rate)
            slope = polynomial(slides.law[s, 0], slides.law[s, 1:], dot(axis, apart))[1]
            phi[nz + slides.row[s]] += slope * rate


@kernel
def add_gradients(variables, matrix, memory):
    """Add the gradients of the polynomials at variables[0] to the rows of a matrix."""
    torsions, slides, y = memory.polynomials.torsions, memory.polynomials.slides, variables[0]
    for s in range(torsions.row.shape[0]):
        if torsions.row[s] >= 0:
            at, form = 9 * s, torsions.form
            e1, e2 = components(at, 1.0, y, torsions), components(at + 3, 1.0, y, torsions)
            f = components(at + 6, 1.0, y, torsions)
            angle, cosine, sine = angle_at(s, y, memory)
            slope = polynomial(torsions.law[s, 0], torsions.law[s, 1:], angle)[1]
            factor = slope / (cosine * cosine + sine * sine)
            for i in range(form.shape[1]):
                value = 0.0
                for c in range(3):
                    value += (cosine * e2[c] - sine * e1[c]) * form[at + 6 + c, i]
                    value += f[c] * (cosine * form[at + 3 + c, i] - sine * form[at + c, i])
                matrix[torsions.row[s], i] += factor * value
    for s in range(slides.row.shape[0]):
        if slides.row[s] >= 0:
            at, form = 6 * s, slides.form
            axis, apart = components(at, 1.0, y, slides), components(at + 3, 1.0, y, slides)
            slope = polynomial(slides.law[s, 0], slides.law[s, 1:], dot(axis, apart))[1]
            for i in range(form.shape[1]):
                value = 0.0
                for c in range(3):
                    value += axis[c] * form[at + 3 + c, i] + apart[c] * form[at + c, i]
                matrix[slides.row[s], i] += slope * value
