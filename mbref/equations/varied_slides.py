"""First-order changes of the rows of dot-2 constraints, distances and coupled displacements, see
``varied_vectors``."""

from __future__ import annotations

from mbref.equations.primitives import polynomial
from mbref.equations.varied_functions import function_change
from mbref.equations.varied_points import is_moved
from mbref.equations.varied_vectors import (
    add_change_of_forces,
    add_opposite_forces,
    between_changes,
    between_points,
    changed_vector,
    fixed_vector,
    product_change,
    product_changes,
    product_motion,
)
from mbref.kernels.compilation import kernel
from mbref.kernels.scene_layout import COUPLED_SLIDE
from mbref.linear_algebra.vectors import add, scale, subtract, vector


@kernel
def slope_change(higher, q):
    """Return the third derivative of ``polynomial`` at q."""
    found, power = 0.0, 1.0
    for k in range(1, higher.shape[0]):
        found += (k + 2.0) * (k + 1.0) * k * higher[k] * power
        power *= q
    return found


@kernel
def polynomial_change(level, length, higher, q, change):
    """Return the change of f(q), or of its rate of order ``level``; q and its change have two rates each."""
    _, slope, bend = polynomial(length, higher, q[0])
    if level == 0:
        return slope * change[0]
    if level == 1:
        return bend * change[0] * q[1] + slope * change[1]
    found = bend * change[0] * q[2] + slope * change[2] + 2.0 * bend * q[1] * change[1]
    return found + slope_change(higher, q[0]) * change[0] * q[1] * q[1]


@kernel
def polynomial_motion(level, length, higher, q):
    """Return f(q), or its rate of order ``level``; q has two rates."""
    value, slope, bend = polynomial(length, higher, q[0])
    if level == 0:
        return value
    return slope * q[1] if level == 1 else slope * q[2] + bend * q[1] * q[1]


@kernel
def vary_slide(p, t, level, freedoms, varied, numbers, equations):
    """Add the changes of a dot-2 row, or of a displacement's polynomial in a coupling, and of its
    wrenches."""
    primitives, changes = equations.scene.primitives, numbers.primitives
    i, j, row, is_coupled = primitives.first[p], primitives.second[p], primitives.row[p], False
    u = fixed_vector(i, vector(primitives.point_first, p), varied, equations)
    v = fixed_vector(j, vector(primitives.point_second, p), varied, equations)
    a = fixed_vector(i, vector(primitives.direction_first, p), varied, equations)
    between, multiplier, length = between_points(i, j, u, v, varied, equations), varied.multipliers[row], 1.0
    q, slope, bend = product_motion(a, between), 1.0, 0.0
    if primitives.kind[p] == COUPLED_SLIDE:
        is_coupled, length = True, primitives.length[p]
        _, slope, bend = polynomial(length, primitives.higher[p], q[0])
    force, arms = scale(multiplier * slope, a[0]), (add(u[0], between[0]), v[0])
    if level == 2:
        add_opposite_forces(i, j, u[0], v[0], between[0], force, varied)
    for d in range(varied.x.shape[0]):
        if is_moved(d, freedoms, numbers):
            n, own = d - 2 * freedoms, 0.0
            du = changed_vector(i, d, level, u, changes.point_first, p, n, varied, equations)
            dv = changed_vector(j, d, level, v, changes.point_second, p, n, varied, equations)
            da = changed_vector(i, d, level, a, changes.direction_first, p, n, varied, equations)
            gap = between_changes(i, j, d, du, dv, varied)
            if is_coupled:
                change = product_changes(a, between, da, gap)
                found = polynomial_change(level, length, primitives.higher[p], q, change)
                own = bend * change[0]
                if n >= 0:
                    place = n * primitives.kind.shape[0] + p
                    found += polynomial_motion(level, changes.length[n, p], changes.higher[place], q)
                    own += polynomial(changes.length[n, p], changes.higher[place], q[0])[1]
            else:
                found = product_change(level, a, between, da, gap)
                if n >= 0 and primitives.driver[p] >= 0:
                    driven = function_change(primitives.driver[p], t, n, numbers, equations)
                    found -= driven[0] if level == 0 else driven[1] if level == 1 else driven[2]
            varied.rows[d, row] += found
            if level == 2:
                change_of_force = scale(multiplier, add(scale(slope, da[0]), scale(own, a[0])))
                moved = add(du[0], gap[0]), dv[0]
                add_change_of_forces(i, j, d, arms, moved, force, change_of_force, varied)


@kernel
def vary_distance(p, level, freedoms, varied, numbers, equations):
    """Add the changes of a distance's row, and of its wrenches."""
    primitives, changes = equations.scene.primitives, numbers.primitives
    i, j, row, length = primitives.first[p], primitives.second[p], primitives.row[p], primitives.length[p]
    u = fixed_vector(i, vector(primitives.point_first, p), varied, equations)
    v = fixed_vector(j, vector(primitives.point_second, p), varied, equations)
    between, multiplier = between_points(i, j, u, v, varied, equations), varied.multipliers[row]
    square = product_motion(between, between)
    force, arms = scale(multiplier / length, between[0]), (add(u[0], between[0]), v[0])
    if level == 2:
        add_opposite_forces(i, j, u[0], v[0], between[0], force, varied)
    for d in range(varied.x.shape[0]):
        if is_moved(d, freedoms, numbers):
            n = d - 2 * freedoms
            du = changed_vector(i, d, level, u, changes.point_first, p, n, varied, equations)
            dv = changed_vector(j, d, level, v, changes.point_second, p, n, varied, equations)
            gap = between_changes(i, j, d, du, dv, varied)
            longer = changes.length[n, p] / length if n >= 0 else 0.0
            own = square[0] if level == 0 else square[1] if level == 1 else square[2]
            found = (product_change(level, between, between, gap, gap) - longer * own) / (2.0 * length)
            if level == 0:
                found -= 0.5 * longer * length
            varied.rows[d, row] += found
            if level == 2:
                change = subtract(scale(multiplier / length, gap[0]), scale(longer, force))
                add_change_of_forces(i, j, d, arms, (add(du[0], gap[0]), dv[0]), force, change, varied)
