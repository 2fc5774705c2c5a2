"""First-order changes of body-fixed vectors by changes of a state, and of products of such vectors.

A direction d moves the poses by x = (δr, δπ') and the velocities by w = (δr', δω') of each body. The
accelerations and multipliers stay. The first 2 f directions change the state alone. Each further direction
also changes the body-fixed vectors and other data of the scene. A vector u = A s of a body has the rates

    u' = A (ω' × s + s'),   u'' = A (ω' × (ω' × s + 2 s') + α' × s + s''),

where a driver turns s at the rates s' and s''. With θ = A δπ' and ψ = A δω', they change by

    δu = θ × u + A δs,   δu' = θ × u' + ψ × u + …,   δu'' = θ × u'' + ψ × (u' + A s') + ω × (ψ × u) + …

The constraint equations are products of such vectors. ``level`` 0 is δΦ, 1 is δΦ' and 2 is δΦ''. At level 2
the wrenches Φ_qᵀ λ - g change as well, in world axes about the centres of mass.
"""

from __future__ import annotations

from mbref.equations.primitives import NOTHING
from mbref.kernels.compilation import kernel
from mbref.linear_algebra.vectors import accumulate, add, cross, dot, scale, subtract, to_world, vector


@kernel
def entry_vector(table, row, place):
    """Return the vector (3,) with an index in a row of a table (k, 3 l) as a tuple."""
    return table[row, 3 * place], table[row, 3 * place + 1], table[row, 3 * place + 2]


@kernel
def set_world_motion(varied, equations):
    """Compute ω of all bodies in world axes, and clear the torques."""
    frames, spin = equations.frames, varied.spin
    varied.torque[:] = 0.0
    for b in range(spin.shape[0]):
        w = to_world(frames.rotation, b, vector(frames.angular_velocity, b))
        for k in range(3):
            spin[b, k] = w[k]


@kernel
def set_world_changes(varied, equations):
    """Compute θ and ψ of all bodies and directions."""
    rotation = equations.frames.rotation
    for d in range(varied.x.shape[0]):
        for b in range(varied.spin.shape[0] - 1):
            turn = to_world(rotation, b, entry_vector(varied.x, d, 2 * b + 1))
            twist = to_world(rotation, b, entry_vector(varied.w, d, 2 * b + 1))
            for k in range(3):
                varied.turn[d, 3 * b + k] = turn[k]
                varied.twist[d, 3 * b + k] = twist[k]


@kernel
def vector_motion(b, s, rate, second, varied, equations):
    """Return the body-fixed vector s, which its driver turns at a rate and an acceleration, and both its
    rates, in world axes."""
    rotation, w = equations.frames.rotation, vector(equations.frames.angular_velocity, b)
    turning = cross(w, s)
    first = add(turning, rate)
    last = add(cross(w, add(first, rate)), second)
    last = add(last, cross(entry_vector(varied.acceleration, 0, 2 * b + 1), s))
    return to_world(rotation, b, s), to_world(rotation, b, first), to_world(rotation, b, last)


@kernel
def fixed_vector(b, s, varied, equations):
    """Return a body-fixed vector and both its rates, in world axes."""
    return vector_motion(b, s, NOTHING, NOTHING, varied, equations)


@kernel
def turned_vector(b, d, level, u, varied):
    """Return the changes up to a level of a body-fixed vector and its rates u = (u, u', u''), which the
    body carries along direction d."""
    turn, twist = entry_vector(varied.turn, d, b), entry_vector(varied.twist, d, b)
    own, first, second = cross(turn, u[0]), NOTHING, NOTHING
    if level > 0:
        moved = cross(twist, u[0])
        first = add(cross(turn, u[1]), moved)
        if level > 1:
            second = add(cross(turn, u[2]), cross(twist, u[1]))
            second = add(second, cross(vector(varied.spin, b), moved))
    return own, first, second


@kernel
def sum_of_motions(u, v):
    """Return the sum of two vectors with their rates."""
    return add(u[0], v[0]), add(u[1], v[1]), add(u[2], v[2])


@kernel
def difference_of_motions(u, v):
    """Return the difference of two vectors with their rates."""
    return subtract(u[0], v[0]), subtract(u[1], v[1]), subtract(u[2], v[2])


@kernel
def changed_vector(b, d, level, u, table, place, number, varied, equations):
    """Return the changes of a body-fixed vector u with its rates along direction d, whose number changes it
    by an entry of a table."""
    found = turned_vector(b, d, level, u, varied)
    if number >= 0:
        change = entry_vector(table, number, place)
        if change[0] != 0.0 or change[1] != 0.0 or change[2] != 0.0:
            found = sum_of_motions(found, fixed_vector(b, change, varied, equations))
    return found


@kernel
def product_motion(u, v):
    """Return u · v and both its rates."""
    first = dot(u[1], v[0]) + dot(u[0], v[1])
    return dot(u[0], v[0]), first, dot(u[2], v[0]) + 2.0 * dot(u[1], v[1]) + dot(u[0], v[2])


@kernel
def product_change(level, u, v, du, dv):
    """Return the change of u · v, or of its rate of order ``level``."""
    if level == 0:
        return dot(du[0], v[0]) + dot(u[0], dv[0])
    if level == 1:
        return dot(du[1], v[0]) + dot(du[0], v[1]) + dot(u[1], dv[0]) + dot(u[0], dv[1])
    found = dot(du[2], v[0]) + dot(du[0], v[2]) + dot(u[2], dv[0]) + dot(u[0], dv[2])
    return found + 2.0 * (dot(du[1], v[1]) + dot(u[1], dv[1]))


@kernel
def product_changes(u, v, du, dv):
    """Return the changes of u · v and of both its rates."""
    return product_change(0, u, v, du, dv), product_change(1, u, v, du, dv), product_change(2, u, v, du, dv)


@kernel
def body_motion(b, varied, equations):
    """Return position, velocity and acceleration of a body's centre of mass."""
    frames = equations.frames
    second = entry_vector(varied.acceleration, 0, 2 * b)
    return vector(frames.position, b), vector(frames.velocity, b), second


@kernel
def body_changes(b, d, varied):
    """Return the changes of position and velocity of a body's centre of mass."""
    return entry_vector(varied.x, d, 2 * b), entry_vector(varied.w, d, 2 * b), NOTHING


@kernel
def between_points(i, j, u, v, varied, equations):
    """Return d between points at u of body i and at v of body j, with its rates."""
    ahead = sum_of_motions(body_motion(j, varied, equations), v)
    return difference_of_motions(ahead, sum_of_motions(body_motion(i, varied, equations), u))


@kernel
def between_changes(i, j, d, du, dv, varied):
    """Return the changes of ``between_points`` along direction d."""
    return difference_of_motions(
        sum_of_motions(body_changes(j, d, varied), dv), sum_of_motions(body_changes(i, d, varied), du)
    )


@kernel
def add_moment(i, j, moment, varied):
    """Add a moment on body j, and the opposite on body i, to the torques."""
    for k in range(3):
        varied.torque[j, k] += moment[k]
        varied.torque[i, k] -= moment[k]


@kernel
def add_moment_change(i, j, d, moment, varied):
    """Add the change of a moment on body j, and the opposite on body i."""
    accumulate(varied.wrench[d], 6 * j + 3, moment)
    accumulate(varied.wrench[d], 6 * i + 3, scale(-1.0, moment))


@kernel
def add_opposite_forces(i, j, u, v, between, force, varied):
    """Add a force at v on body j, and the opposite force at the same place on body i, to the torques."""
    here, there = cross(v, force), cross(add(u, between), force)
    for k in range(3):
        varied.torque[j, k] += here[k]
        varied.torque[i, k] -= there[k]


@kernel
def add_change_of_forces(i, j, d, arms, changes, force, change, varied):
    """Add the changes of the wrenches of ``add_opposite_forces``; ``arms`` u + d and v have ``changes``."""
    wrench = varied.wrench[d]
    accumulate(wrench, 6 * j, change)
    accumulate(wrench, 6 * i, scale(-1.0, change))
    accumulate(wrench, 6 * j + 3, add(cross(changes[1], force), cross(arms[1], change)))
    accumulate(wrench, 6 * i + 3, subtract(cross(force, changes[0]), cross(arms[0], change)))
