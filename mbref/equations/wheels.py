"""Rows of a wheel that rolls without slip: its contact with a plane, and the directions in which it does not
slip.

A wheel of radius R with the centre c and the unit axis d rolls on a plane of body i with the normal n.  The
lowest point of its rim is k = c - R e, with e = (n - (n·d) d) / |n - (n·d) d|.  With the velocity u of the
point of the wheel that is at k, relative to the point of body i there, and with p on the plane,

    contact    n·(k - p) = 0, whose rate is n·u
    no slip    a·u = 0 for a direction a in the plane: a row between velocities, which has no Φ

The Jacobian, ν and γ are as in ``equations.primitives``.
"""

from __future__ import annotations

from numpy import nan, sqrt

from mbref.kernels.compilation import kernel
from mbref.kernels.scene_layout import CONTACT
from mbref.linear_algebra.vectors import add, cross, dot, put, scale, subtract, to_body, to_world, vector

LYING = 1e-9  # sine of the angle between axis and normal, below which a wheel has no lowest point


@kernel
def upwards(n, n_rate, d, d_rate):
    """Return the unit vector from the lowest point of a wheel to its centre, and its rate; not a number where
    the wheel lies flat."""
    part, part_rate = dot(n, d), dot(n_rate, d) + dot(n, d_rate)
    across = subtract(n, scale(part, d))
    sine = sqrt(dot(across, across))
    inverse = 1.0 / sine if sine > LYING else nan
    up = scale(inverse, across)
    rate = subtract(n_rate, add(scale(part_rate, d), scale(part, d_rate)))
    return up, scale(inverse, subtract(rate, scale(dot(rate, up), up)))


@kernel
def wheel(p, equations):
    """Evaluate the contact of a wheel with its plane, or a direction in which it does not slip."""
    primitives, frames = equations.scene.primitives, equations.frames
    rows, blocks, rotation = equations.rows, equations.system.blocks, frames.rotation
    i, j, row = primitives.first[p], primitives.second[p], primitives.row[p]
    a = to_world(rotation, i, vector(primitives.direction_first, p))
    n = to_world(rotation, i, vector(primitives.turning_first, p))
    d = to_world(rotation, j, vector(primitives.direction_second, p))
    w_i = to_world(rotation, i, vector(frames.angular_velocity, i))
    w_j = to_world(rotation, j, vector(frames.angular_velocity, j))
    v_i, v_j, radius = vector(frames.velocity, i), vector(frames.velocity, j), primitives.length[p]
    up, up_rate = upwards(n, cross(w_i, n), d, cross(w_j, d))
    centre = to_world(rotation, j, vector(primitives.point_second, p))
    arm_j = subtract(centre, scale(radius, up))  # from each centre of mass to the lowest point
    arm_rate_j = subtract(cross(w_j, centre), scale(radius, up_rate))
    arm_i = add(subtract(vector(frames.position, j), vector(frames.position, i)), arm_j)
    arm_rate_i = add(subtract(v_j, v_i), arm_rate_j)
    slip = subtract(add(v_j, cross(w_j, arm_j)), add(v_i, cross(w_i, arm_i)))
    slip_rate = subtract(cross(w_j, arm_rate_j), cross(w_i, arm_rate_i))
    rows.phi[row], rows.nu[row] = 0.0, 0.0
    if primitives.kind[p] == CONTACT:
        rows.phi[row] = dot(n, subtract(arm_i, to_world(rotation, i, vector(primitives.point_first, p))))
    rows.gamma[row] = -(dot(a, slip_rate) + dot(cross(w_i, a), slip))
    put(blocks, row, 0, scale(-1.0, a))
    put(blocks, row, 3, to_body(rotation, i, cross(a, arm_i)))
    put(blocks, row, 6, a)
    put(blocks, row, 9, to_body(rotation, j, cross(arm_j, a)))
