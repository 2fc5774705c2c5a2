"""First-order changes of all constraint rows and of Φ_qᵀ λ, also of coupled angles, see
``varied_vectors``."""

from __future__ import annotations

from mbref.equations.primitives import polynomial, unwrapped_angle
from mbref.equations.varied_points import is_moved, vary_dot1, vary_point
from mbref.equations.varied_slides import polynomial_change, polynomial_motion, vary_distance, vary_slide
from mbref.equations.varied_vectors import (
    add_moment,
    add_moment_change,
    changed_vector,
    fixed_vector,
    product_changes,
    product_motion,
)
from mbref.kernels.compilation import kernel
from mbref.kernels.scene_layout import COUPLED_ANGLE, COUPLED_SLIDE, DISTANCE, DOT1, DOT2, POINT
from mbref.linear_algebra.vectors import add, cross, scale, subtract, vector


@kernel
def angle_motion(c, s, angle):
    """Return an angle and both its rates, from multiples c and s of its cosine and sine with their rates."""
    square = c[0] * c[0] + s[0] * s[0]
    rate = (c[0] * s[1] - s[0] * c[1]) / square
    second = (c[0] * s[2] - s[0] * c[2] - 2.0 * rate * (c[0] * c[1] + s[0] * s[1])) / square
    return angle, rate, second


@kernel
def angle_change(c, s, angle, dc, ds):
    """Return the changes of ``angle_motion``."""
    square = c[0] * c[0] + s[0] * s[0]
    grown = 2.0 * (c[0] * dc[0] + s[0] * ds[0])
    found = (c[0] * ds[0] - s[0] * dc[0]) / square
    rate = dc[0] * s[1] + c[0] * ds[1] - ds[0] * c[1] - s[0] * dc[1]
    rate = (rate - angle[1] * grown) / square
    half, more = c[0] * c[1] + s[0] * s[1], dc[0] * c[1] + c[0] * dc[1] + ds[0] * s[1] + s[0] * ds[1]
    second = dc[0] * s[2] + c[0] * ds[2] - ds[0] * c[2] - s[0] * dc[2]
    second = (second - 2.0 * (rate * half + angle[1] * more) - angle[2] * grown) / square
    return found, rate, second


@kernel
def vary_angle(p, level, freedoms, varied, numbers, equations):
    """Add the changes of the polynomial of an angle in the row of a coupling, and of its moments."""
    primitives, changes = equations.scene.primitives, numbers.primitives
    i, j, row, length = primitives.first[p], primitives.second[p], primitives.row[p], primitives.length[p]
    x = fixed_vector(i, vector(primitives.direction_first, p), varied, equations)
    y = fixed_vector(i, vector(primitives.turning_first, p), varied, equations)
    u = fixed_vector(j, vector(primitives.direction_second, p), varied, equations)
    c, s, multiplier = product_motion(u, x), product_motion(u, y), varied.multipliers[row]
    q = angle_motion(c, s, unwrapped_angle(s[0], c[0], equations.angles[primitives.angle[p]]))
    _, slope, bend = polynomial(length, primitives.higher[p], q[0])
    square = c[0] * c[0] + s[0] * s[0]
    across = subtract(scale(c[0], y[0]), scale(s[0], x[0]))
    axis = scale(1.0 / square, cross(u[0], across))
    if level == 2:
        add_moment(i, j, scale(multiplier * slope, axis), varied)
    for d in range(varied.x.shape[0]):
        if is_moved(d, freedoms, numbers):
            n = d - 2 * freedoms
            dx = changed_vector(i, d, 2, x, changes.direction_first, p, n, varied, equations)
            dy = changed_vector(i, d, 2, y, changes.turning_first, p, n, varied, equations)
            du = changed_vector(j, d, 2, u, changes.direction_second, p, n, varied, equations)
            dc, ds = product_changes(u, x, du, dx), product_changes(u, y, du, dy)
            change = angle_change(c, s, q, dc, ds)
            found = polynomial_change(level, length, primitives.higher[p], q, change)
            own = bend * change[0]
            if n >= 0:
                place = n * primitives.kind.shape[0] + p
                found += polynomial_motion(level, changes.length[n, p], changes.higher[place], q)
                own += polynomial(changes.length[n, p], changes.higher[place], q[0])[1]
            varied.rows[d, row] += found
            if level == 2:
                turned = add(scale(dc[0], y[0]), scale(c[0], dy[0]))
                turned = subtract(turned, add(scale(ds[0], x[0]), scale(s[0], dx[0])))
                moved = add(cross(du[0], across), cross(u[0], turned))
                grown = 2.0 * (c[0] * dc[0] + s[0] * ds[0])
                moved = scale(1.0 / square, subtract(moved, scale(grown, axis)))
                moment = add(scale(own, axis), scale(slope, moved))
                add_moment_change(i, j, d, scale(multiplier, moment), varied)


@kernel
def vary_constraints(t, level, freedoms, varied, numbers, equations):
    """Compute the changes of all rows at a level, 0 for δΦ, 1 for δΦ' and 2 for δΦ'' with the wrenches of
    Φ_qᵀ λ, along all directions."""
    kinds = equations.scene.primitives.kind
    varied.rows[:] = 0.0
    for p in range(kinds.shape[0]):
        kind = kinds[p]
        if kind == POINT:
            vary_point(p, level, freedoms, varied, numbers, equations)
        elif kind == DOT1:
            vary_dot1(p, t, level, freedoms, varied, numbers, equations)
        elif kind in (DOT2, COUPLED_SLIDE):
            vary_slide(p, t, level, freedoms, varied, numbers, equations)
        elif kind == DISTANCE:
            vary_distance(p, level, freedoms, varied, numbers, equations)
        elif kind == COUPLED_ANGLE:
            vary_angle(p, level, freedoms, varied, numbers, equations)
