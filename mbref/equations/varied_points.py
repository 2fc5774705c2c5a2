"""First-order changes of the rows of points and of dot-1 constraints, see ``varied_vectors``."""

from __future__ import annotations

from numpy import cos, sin

from mbref.equations.functions import function_value
from mbref.equations.primitives import NOTHING, turned_direction
from mbref.equations.varied_functions import function_change
from mbref.equations.varied_vectors import (
    add_moment,
    add_moment_change,
    between_changes,
    changed_vector,
    entry_vector,
    fixed_vector,
    product_change,
    sum_of_motions,
    turned_vector,
    vector_motion,
)
from mbref.kernels.compilation import kernel
from mbref.linear_algebra.vectors import accumulate, add, cross, scale, subtract, to_world, vector


@kernel
def is_moved(d, freedoms, numbers):
    """Return whether direction d changes constraints."""
    return d < 2 * freedoms or numbers.moves[d - 2 * freedoms] == 1


@kernel
def vary_point(p, level, freedoms, varied, numbers, equations):
    """Add the changes of a point's three rows, and of its wrenches."""
    primitives, changes = equations.scene.primitives, numbers.primitives
    i, j, row = primitives.first[p], primitives.second[p], primitives.row[p]
    u = fixed_vector(i, vector(primitives.point_first, p), varied, equations)
    v = fixed_vector(j, vector(primitives.point_second, p), varied, equations)
    force = varied.multipliers[row], varied.multipliers[row + 1], varied.multipliers[row + 2]
    if level == 2:
        of_i, of_j = cross(u[0], force), cross(force, v[0])
        for k in range(3):
            varied.torque[i, k] += of_i[k]
            varied.torque[j, k] += of_j[k]
    for d in range(varied.x.shape[0]):
        if is_moved(d, freedoms, numbers):
            n = d - 2 * freedoms
            du = changed_vector(i, d, level, u, changes.point_first, p, n, varied, equations)
            dv = changed_vector(j, d, level, v, changes.point_second, p, n, varied, equations)
            gap = between_changes(j, i, d, dv, du, varied)
            change = gap[0] if level == 0 else gap[1] if level == 1 else gap[2]
            accumulate(varied.rows[d], row, change)
            if level == 2:
                accumulate(varied.wrench[d], 6 * i + 3, cross(du[0], force))
                accumulate(varied.wrench[d], 6 * j + 3, cross(force, dv[0]))


@kernel
def turned_direction_change(p, t, n, numbers, equations):
    """Return the changes by number n of the driven direction on the first body and of both its rates."""
    primitives, changes = equations.scene.primitives, numbers.primitives
    dx, f = entry_vector(changes.direction_first, n, p), primitives.driver[p]
    if f < 0:
        return dx, NOTHING, NOTHING
    x, y = vector(primitives.direction_first, p), vector(primitives.turning_first, p)
    dy = entry_vector(changes.turning_first, n, p)
    value, rate, second = function_value(f, t, equations)
    more, faster, sooner = function_change(f, t, n, numbers, equations)
    c, s = cos(value), sin(value)
    along, across = add(scale(c, x), scale(s, y)), subtract(scale(c, y), scale(s, x))
    d_along = add(add(scale(c, dx), scale(s, dy)), scale(more, across))
    d_across = subtract(subtract(scale(c, dy), scale(s, dx)), scale(more, along))
    first = add(scale(-rate, d_along), scale(-faster, along))
    last = add(scale(-second, d_along), scale(-sooner, along))
    last = subtract(last, add(scale(rate * rate, d_across), scale(2.0 * rate * faster, across)))
    return d_across, first, last


@kernel
def vary_dot1(p, t, level, freedoms, varied, numbers, equations):
    """Add the changes of a dot-1 row, and of its moments."""
    primitives, rotation = equations.scene.primitives, equations.frames.rotation
    i, j, row = primitives.first[p], primitives.second[p], primitives.row[p]
    a, a_rate, a_second = turned_direction(p, t, equations)
    u = vector_motion(i, a, a_rate, a_second, varied, equations)
    v = fixed_vector(j, vector(primitives.direction_second, p), varied, equations)
    driven, multiplier = to_world(rotation, i, a_rate), varied.multipliers[row]
    if level == 2:
        add_moment(i, j, scale(multiplier, cross(v[0], u[0])), varied)
    for d in range(varied.x.shape[0]):
        if is_moved(d, freedoms, numbers):
            n = d - 2 * freedoms
            du = turned_vector(i, d, level, u, varied)
            if primitives.driver[p] >= 0:
                du = du[0], du[1], add(du[2], cross(entry_vector(varied.twist, d, i), driven))
            if n >= 0:
                s, s_rate, s_second = turned_direction_change(p, t, n, numbers, equations)
                du = sum_of_motions(du, vector_motion(i, s, s_rate, s_second, varied, equations))
            dv = changed_vector(j, d, level, v, numbers.primitives.direction_second, p, n, varied, equations)
            varied.rows[d, row] += product_change(level, u, v, du, dv)
            if level == 2:
                moment = add(cross(dv[0], u[0]), cross(v[0], du[0]))
                add_moment_change(i, j, d, scale(multiplier, moment), varied)
