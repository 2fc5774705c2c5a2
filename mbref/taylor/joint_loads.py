"""Loads along joint coordinates, and coupled joint coordinates, as Taylor series.

The row of a coupling contains f(q) = c₁ q + c₂ q² + … of a coordinate q. The series of f' follows from the
series of f'', k f'_k = Σ i q_i f''_{k-i}, and the multiplier λ acts on the coordinate by f'(q) λ.
"""

from __future__ import annotations

from mbref.equations.primitives import unwrapped_angle
from mbref.kernels.compilation import inlined, kernel
from mbref.taylor.loads import applied_order, grow_forms, product_order

E1, E2, F, COS, SIN, TORSION, TORQUE, TORQUE_COS, TORQUE_SIN, TORSION_SERIES = 0, 3, 6, *range(9, 16)
SLIDE_AXIS, SLIDE_VECTOR, SLID, PUSH, SLIDE_SERIES = 0, 3, 6, 7, 8


@kernel
def grow_torsions(k, memory):
    """Compute order k of directions, cosine and sine; of the angle, whose rate is C S' - S C'."""
    torsions, variables = memory.polynomials.torsions, memory.series.terms
    for s in range(torsions.stiffness.shape[0]):
        of = memory.series.torsions[TORSION_SERIES * s : TORSION_SERIES * (s + 1)]
        grow_forms(torsions.constant[s], torsions.form[9 * s : 9 * s + 9], k, variables, of)
        cosine, sine = 0.0, 0.0
        for c in range(3):
            cosine += product_order(of[E1 + c], of[F + c], k)
            sine += product_order(of[E2 + c], of[F + c], k)
        of[COS, k], of[SIN, k] = cosine, sine
        if k == 0:
            near = memory.run.equations.angles[torsions.slot[s]]
            of[TORSION, 0] = unwrapped_angle(sine, cosine, near)
        else:
            value = 0.0
            for i in range(1, k + 1):
                value += i * (of[COS, k - i] * of[SIN, i] - of[SIN, k - i] * of[COS, i])
            of[TORSION, k] = value / k
        if torsions.row[s] >= 0:
            powers = torsions.law.shape[1]
            grow_slopes(k, torsions.law[s], of[TORSION], memory.series.slopes[powers * s : powers * (s + 1)])


@kernel
def grow_slopes(k, law, q, slopes):
    """Compute order k of the derivatives of f(q) = law[0] q + law[1] q² + … of a series q, the first one in
    row 0: k f_k = Σ i q_i f'_{k-i}."""
    powers = law.shape[0]
    for j in range(powers - 1, -1, -1):
        value = 0.0
        if k == 0:
            for m in range(powers - 1, j - 1, -1):
                factor = 1.0
                for n in range(m - j + 1, m + 2):
                    factor *= n
                value = value * q[0] + factor * law[m]
        elif j + 1 < powers:
            for i in range(1, k + 1):
                value += i * q[i] * slopes[j + 1, k - i]
            value /= k
        slopes[j, k] = value


@inlined
def rest_of_polynomial(order, q, rest, slopes):
    """Return the part of an order of f(q) that does not contain this order of the variables; ``rest`` is that
    part of q."""
    value = 0.0
    for i in range(1, order):
        value += i * q[i] * slopes[0, order - i]
    return slopes[0, 0] * rest + value / order


@inlined
def applied_multiplier(k, lane, slopes, terms):
    """Return orders k - 1 and k of f'(q) λ; order k without order k of the multiplier λ, which is not
    known."""
    before, now = 0.0, 0.0
    for i in range(k):
        before += slopes[0, i] * terms[k + 1 - i, lane]
        now += slopes[0, i + 1] * terms[k + 1 - i, lane]
    return before, now


@inlined
def resistance(k, s, q, loads, factors):
    """Return order k of stiffness (q - natural) + damping q' - force of load s along a joint coordinate q."""
    moved = q[k] - loads.natural[s] if k == 0 else q[k]
    resisting = loads.stiffness[s] * moved + loads.damping[s] * (k + 1) * q[k + 1]
    return resisting - applied_order(loads.amount[s], loads.function[s], k, factors)


@kernel
def add_torsions(k, memory):
    """Compute order k of the forces of loads about axes: (torque - stiffness (θ - natural) - damping θ') (C
    δS - S δC)."""
    torsions, sums, nz = memory.polynomials.torsions, memory.series.sums, memory.solver.pivot_columns.shape[0]
    for s in range(torsions.stiffness.shape[0]):
        of = memory.series.torsions[TORSION_SERIES * s : TORSION_SERIES * (s + 1)]
        of[TORQUE, k] = resistance(k, s, of[TORSION], torsions, memory.series.factors)
        if torsions.row[s] >= 0:
            add_coupled_angle(s, k, of, memory)
        of[TORQUE_COS, k] = product_order(of[TORQUE], of[COS], k)
        of[TORQUE_SIN, k] = product_order(of[TORQUE], of[SIN], k)
        for c in range(3):
            on_e2, on_e1 = (
                product_order(of[TORQUE_COS], of[F + c], k),
                product_order(of[TORQUE_SIN], of[F + c], k),
            )
            on_f = product_order(of[TORQUE_COS], of[E2 + c], k) - product_order(of[TORQUE_SIN], of[E1 + c], k)
            e1, e2 = torsions.form[9 * s + E1 + c], torsions.form[9 * s + E2 + c]
            f = torsions.form[9 * s + F + c]
            for i in range(nz):
                sums[k, i] += on_e2 * e2[i] - on_e1 * e1[i] + on_f * f[i]


@kernel
def add_coupled_angle(s, k, of, memory):
    """Add to the row of a coupling the part of order k + 2 of an angle's polynomial that does not contain
    that order of the variables.

    Also compute the moment of the known orders of the multiplier. The multiplier of order k acts by the
    gradient at the time of expansion.
    """
    torsions, terms, sums = memory.polynomials.torsions, memory.series.terms, memory.series.sums
    lane, powers = memory.solver.pivot_columns.shape[0] + torsions.row[s], torsions.law.shape[1]
    slopes = memory.series.slopes[powers * s : powers * (s + 1)]
    before, of[TORQUE, k] = applied_multiplier(k, lane, slopes, terms)
    if k > 0:
        of[TORQUE, k - 1] = before
        of[TORQUE_COS, k - 1] = product_order(of[TORQUE], of[COS], k - 1)
        of[TORQUE_SIN, k - 1] = product_order(of[TORQUE], of[SIN], k - 1)
    order, cosine, sine = k + 2, 0.0, 0.0
    for c in range(3):
        for i in range(1, order):
            cosine += of[E1 + c, i] * of[F + c, order - i]
            sine += of[E2 + c, i] * of[F + c, order - i]
    value = order * (of[COS, 0] * sine - of[SIN, 0] * cosine)
    for i in range(1, order):
        value += i * (of[COS, order - i] * of[SIN, i] - of[SIN, order - i] * of[COS, i])
    sums[k, lane] += rest_of_polynomial(order, of[TORSION], value / order, slopes)


@kernel
def grow_slides(k, memory):
    """Compute order k of axes, of vectors between the anchors, and of displacements a · d."""
    slides, variables = memory.polynomials.slides, memory.series.terms
    for s in range(slides.stiffness.shape[0]):
        of = memory.series.slides[SLIDE_SERIES * s : SLIDE_SERIES * (s + 1)]
        grow_forms(slides.constant[s], slides.form[6 * s : 6 * s + 6], k, variables, of)
        along = 0.0
        for c in range(3):
            along += product_order(of[SLIDE_AXIS + c], of[SLIDE_VECTOR + c], k)
        of[SLID, k] = along
        if slides.row[s] >= 0:
            first, powers = first_slope(s, memory), slides.law.shape[1]
            grow_slopes(k, slides.law[s], of[SLID], memory.series.slopes[first : first + powers])


@inlined
def first_slope(s, memory):
    """Return the row of the first derivative of a displacement's polynomial."""
    return memory.polynomials.slides.law.shape[1] * (memory.polynomials.torsions.row.shape[0] + s)


@kernel
def add_slides(k, memory):
    """Compute order k of the forces of loads along axes: (force - stiffness (x - natural) - damping x') (a δd
    + d δa)."""
    slides, sums, nz = memory.polynomials.slides, memory.series.sums, memory.solver.pivot_columns.shape[0]
    for s in range(slides.stiffness.shape[0]):
        of = memory.series.slides[SLIDE_SERIES * s : SLIDE_SERIES * (s + 1)]
        of[PUSH, k] = resistance(k, s, of[SLID], slides, memory.series.factors)
        if slides.row[s] >= 0:
            add_coupled_displacement(s, k, of, memory)
        for c in range(3):
            on_vector = product_order(of[PUSH], of[SLIDE_AXIS + c], k)
            on_axis = product_order(of[PUSH], of[SLIDE_VECTOR + c], k)
            axis, between = slides.form[6 * s + SLIDE_AXIS + c], slides.form[6 * s + SLIDE_VECTOR + c]
            for i in range(nz):
                sums[k, i] += on_vector * between[i] + on_axis * axis[i]


@kernel
def add_coupled_displacement(s, k, of, memory):
    """Add to the row of a coupling the part of order k + 2 of a displacement's polynomial that does not
    contain that order of the variables; compute the force of the known orders of the multiplier."""
    lane, order = memory.solver.pivot_columns.shape[0] + memory.polynomials.slides.row[s], k + 2
    first, rest = first_slope(s, memory), 0.0
    slopes = memory.series.slopes[first : first + memory.polynomials.slides.law.shape[1]]
    before, of[PUSH, k] = applied_multiplier(k, lane, slopes, memory.series.terms)
    if k > 0:
        of[PUSH, k - 1] = before
    for c in range(3):
        for i in range(1, order):
            rest += of[SLIDE_AXIS + c, i] * of[SLIDE_VECTOR + c, order - i]
    memory.series.sums[k, lane] += rest_of_polynomial(order, of[SLID], rest, slopes)
