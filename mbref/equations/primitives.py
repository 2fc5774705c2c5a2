"""The primitive constraint equations: Φ, their Jacobian blocks, ν and γ.

Every joint is a list of these (Nikravesh, Computer-Aided Analysis of Mechanical Systems, 1988; Haug,
Computer Aided Kinematics and Dynamics, 1989).  With body-fixed vectors a, b, s and A the rotation
matrix of a body, the equations are

    point      r_i + A_i s_i - r_j - A_j s_j = 0                       three rows
    dot-1      (A_i a)·(A_j b) = 0
    dot-2      (A_i a)·d = 0,   d = r_j + A_j s_j - r_i - A_i s_i
    distance   (d·d - l²) / (2 l) = 0

A driver is a dot-1 whose a turns in body i by the prescribed angle, or a dot-2 less the prescribed
displacement.  Jacobian columns multiply (δr, δπ') with δπ' the rotation in body axes; ν = -∂Φ/∂t and
γ is what Φ_q q̈ must equal (Eqs. 2 and 3 of the paper).
"""

from __future__ import annotations

from numpy import cos, sin

from mbref.kernels.compilation import inlined, kernel
from mbref.kernels.layout import (
    DOT1,
    DOT2,
    DRIVERS,
    FRAMES,
    GAMMA,
    GEOMETRY,
    JACOBIAN,
    LENGTH,
    NU,
    OMEGA,
    PHI,
    POINT,
    POINT_I,
    POINT_J,
    POSITION,
    PRIMITIVES,
    ROWS,
    U_I,
    U_J,
    VELOCITY,
    W_I,
)
from mbref.linear_algebra.vectors import (
    add,
    cross,
    dot,
    put,
    put_negative,
    scale,
    subtract,
    to_body,
    to_world,
    vector,
)


@kernel
def driver_value(drivers, d, t):
    """Value, rate and acceleration at time t of driver d: polynomial plus sine."""
    amplitude, frequency, phase = drivers[d, 0], drivers[d, 1], drivers[d, 2]
    value, rate, acceleration = 0.0, 0.0, 0.0
    for k in range(drivers.shape[1] - 1, 2, -1):  # Horner, with both derivatives
        acceleration = acceleration * t + 2.0 * rate
        rate = rate * t + value
        value = value * t + drivers[d, k]
    argument = frequency * t + phase
    value += amplitude * sin(argument)
    rate += amplitude * frequency * cos(argument)
    acceleration -= amplitude * frequency * frequency * sin(argument)
    return value, rate, acceleration


@kernel
def point(p, row, i, j, frames, geometry, jacobian, rows):
    """Two body-fixed points coincide: three rows."""
    s_i, s_j = vector(geometry, p, POINT_I), vector(geometry, p, POINT_J)
    w_i, w_j = vector(frames, i, OMEGA), vector(frames, j, OMEGA)
    gap = subtract(
        add(vector(frames, i, POSITION), to_world(frames, i, s_i)),
        add(vector(frames, j, POSITION), to_world(frames, j, s_j)),
    )
    turning = subtract(
        to_world(frames, j, cross(w_j, cross(w_j, s_j))),
        to_world(frames, i, cross(w_i, cross(w_i, s_i))),
    )
    for k in range(3):
        world = (1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0)
        rows[PHI, row + k] = gap[k]
        rows[NU, row + k] = 0.0
        rows[GAMMA, row + k] = turning[k]
        put(jacobian, row + k, 0, world)
        put(jacobian, row + k, 3, cross(s_i, to_body(frames, i, world)))
        put_negative(jacobian, row + k, 6, world)
        put_negative(jacobian, row + k, 9, cross(s_j, to_body(frames, j, world)))


@kernel
def dot1(p, row, i, j, d, t, frames, geometry, drivers, jacobian, rows):
    """A vector on each body stay perpendicular; with a driver, the first turns by its angle."""
    a, a_rate, a_second = vector(geometry, p, U_I), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if d >= 0:
        value, rate, acceleration = driver_value(drivers, d, t)
        x, y = a, vector(geometry, p, W_I)
        along = add(scale(cos(value), x), scale(sin(value), y))
        a = subtract(scale(cos(value), y), scale(sin(value), x))
        a_rate = scale(-rate, along)
        a_second = subtract(scale(-acceleration, along), scale(rate * rate, a))
    b = vector(geometry, p, U_J)
    w_i, w_j = vector(frames, i, OMEGA), vector(frames, j, OMEGA)
    a_world, b_world = to_world(frames, i, a), to_world(frames, j, b)
    turn_i, turn_j = add(cross(w_i, a), a_rate), cross(w_j, b)
    second_i = add(cross(w_i, add(cross(w_i, a), scale(2.0, a_rate))), a_second)
    second_j = cross(w_j, turn_j)
    rows[PHI, row] = dot(a_world, b_world)
    rows[NU, row] = -dot(to_world(frames, i, a_rate), b_world)
    rows[GAMMA, row] = -(
        dot(to_world(frames, i, second_i), b_world)
        + 2.0 * dot(to_world(frames, i, turn_i), to_world(frames, j, turn_j))
        + dot(a_world, to_world(frames, j, second_j))
    )
    put(jacobian, row, 0, (0.0, 0.0, 0.0))
    put(jacobian, row, 3, cross(a, to_body(frames, i, b_world)))
    put(jacobian, row, 6, (0.0, 0.0, 0.0))
    put(jacobian, row, 9, cross(b, to_body(frames, j, a_world)))


@kernel
def between(p, i, j, frames, geometry):
    """d from the point of i to that of j, its rate, and the part of its second rate without q̈ (world)."""
    s_i, s_j = vector(geometry, p, POINT_I), vector(geometry, p, POINT_J)
    w_i, w_j = vector(frames, i, OMEGA), vector(frames, j, OMEGA)
    turn_i, turn_j = cross(w_i, s_i), cross(w_j, s_j)
    d = subtract(
        add(vector(frames, j, POSITION), to_world(frames, j, s_j)),
        add(vector(frames, i, POSITION), to_world(frames, i, s_i)),
    )
    rate = subtract(
        add(vector(frames, j, VELOCITY), to_world(frames, j, turn_j)),
        add(vector(frames, i, VELOCITY), to_world(frames, i, turn_i)),
    )
    second = subtract(to_world(frames, j, cross(w_j, turn_j)), to_world(frames, i, cross(w_i, turn_i)))
    return d, rate, second


@kernel
def dot2(p, row, i, j, driver, t, frames, geometry, drivers, jacobian, rows):
    """A vector on the first body stays perpendicular to d; with a driver, d advances along it."""
    a, s_i, s_j = vector(geometry, p, U_I), vector(geometry, p, POINT_I), vector(geometry, p, POINT_J)
    w_i = vector(frames, i, OMEGA)
    d, d_rate, d_second = between(p, i, j, frames, geometry)
    a_world, a_rate = to_world(frames, i, a), to_world(frames, i, cross(w_i, a))
    a_second = to_world(frames, i, cross(w_i, cross(w_i, a)))
    rows[PHI, row] = dot(a_world, d)
    rows[NU, row] = 0.0
    rows[GAMMA, row] = -(dot(a_second, d) + 2.0 * dot(a_rate, d_rate) + dot(a_world, d_second))
    if driver >= 0:
        value, rate, acceleration = driver_value(drivers, driver, t)
        rows[PHI, row] -= value
        rows[NU, row] = rate
        rows[GAMMA, row] += acceleration
    put_negative(jacobian, row, 0, a_world)
    put(jacobian, row, 3, cross(a, add(to_body(frames, i, d), s_i)))
    put(jacobian, row, 6, a_world)
    put(jacobian, row, 9, cross(s_j, to_body(frames, j, a_world)))


@kernel
def distance(p, row, i, j, frames, geometry, jacobian, rows):
    """Two body-fixed points keep their distance."""
    s_i, s_j, length = vector(geometry, p, POINT_I), vector(geometry, p, POINT_J), geometry[p, LENGTH]
    d, rate, second = between(p, i, j, frames, geometry)
    along = scale(1.0 / length, d)
    rows[PHI, row] = (dot(d, d) - length * length) / (2.0 * length)
    rows[NU, row] = 0.0
    rows[GAMMA, row] = -(dot(rate, rate) + dot(d, second)) / length
    put_negative(jacobian, row, 0, along)
    put_negative(jacobian, row, 3, cross(s_i, to_body(frames, i, along)))
    put(jacobian, row, 6, along)
    put(jacobian, row, 9, cross(s_j, to_body(frames, j, along)))


@inlined
def constraints(t, ints, floats, work):
    """Φ, Φ_q, ν and γ of every row at the state in ``work[FRAMES]``."""
    primitives, geometry, drivers = ints[PRIMITIVES], floats[GEOMETRY], floats[DRIVERS]
    frames, jacobian, rows = work[FRAMES], work[JACOBIAN], work[ROWS]
    for p in range(primitives.shape[0]):
        kind, i, j = primitives[p, 0], primitives[p, 1], primitives[p, 2]
        d, row = primitives[p, 3], primitives[p, 4]
        if kind == POINT:
            point(p, row, i, j, frames, geometry, jacobian, rows)
        elif kind == DOT1:
            dot1(p, row, i, j, d, t, frames, geometry, drivers, jacobian, rows)
        elif kind == DOT2:
            dot2(p, row, i, j, d, t, frames, geometry, drivers, jacobian, rows)
        else:
            distance(p, row, i, j, frames, geometry, jacobian, rows)
