"""The primitive constraint equations: Φ, their Jacobian blocks, ν and γ.

Every joint is a list of primitive constraint equations (Nikravesh, Computer-Aided Analysis of Mechanical
Systems, 1988; Haug, Computer Aided Kinematics and Dynamics, 1989).  With body-fixed vectors a, b, s and A the
rotation matrix of a body, the constraint equations Φ = 0 are

    point      r_i + A_i s_i - r_j - A_j s_j = 0                       three rows
    dot-1      (A_i a)·(A_j b) = 0
    dot-2      (A_i a)·d = 0,   d = r_j + A_j s_j - r_i - A_i s_i
    distance   (d·d - l²) / (2 l) = 0

A driver is a dot-1 constraint whose vector a turns in body i by the prescribed angle, or a dot-2 constraint
minus the prescribed displacement; of an orientation it is three dot-1 constraints (``equations.turns``).  A
coupling is one row, the sum of polynomials f(q) = c₁ q + c₂ q² + … of joint coordinates q:

    angle      arctan2(s, c),  s = (A_j u)·(A_i y),  c = (A_j u)·(A_i x)
    slide      (A_i a)·d

Its rate is f'(q) q', and its γ contains -f''(q) q'².

Rows of rolling wheels are in ``equations.wheels``.

Jacobian columns multiply (δr, δπ') with δπ' the rotation in body axes; ν = -∂Φ/∂t and
γ is what Φ_q q̈ must equal (Eqs. 2 and 3 of the paper).
"""

from __future__ import annotations

from numpy import arctan2, cos, floor, pi, sin

from mbref.equations.functions import function_value
from mbref.equations.turns import oriented_direction
from mbref.equations.wheels import wheel
from mbref.kernels.compilation import inlined, kernel
from mbref.kernels.scene_layout import CONTACT, COUPLED_ANGLE, DISTANCE, DOT1, DOT2, POINT, TURN_1
from mbref.linear_algebra.vectors import (
    accumulate,
    add,
    cross,
    dot,
    put,
    scale,
    subtract,
    to_body,
    to_world,
    vector,
)

NOTHING = (0.0, 0.0, 0.0)


@kernel
def point(p, equations):
    """Evaluate the constraint that two body-fixed points coincide: three rows, whose ν stays zero.

    Constant entries of Φ_q are written at the first evaluation only, into zeros.
    """
    primitives, rows, blocks = equations.scene.primitives, equations.rows, equations.system.blocks
    row = primitives.row[p]
    if blocks[row, 0] != 1.0:
        put_translations(row, blocks)
    s_i, s_j = vector(primitives.point_first, p), vector(primitives.point_second, p)
    place_i, turning_i = place_of(primitives.first[p], s_i, 1.0, row, 3, equations)
    place_j, turning_j = place_of(primitives.second[p], s_j, -1.0, row, 9, equations)
    gap, turning = subtract(place_i, place_j), subtract(turning_j, turning_i)
    for k in range(3):
        rows.phi[row + k] = gap[k]
        rows.gamma[row + k] = turning[k]


@kernel
def place_of(b, s, sign, row, column, equations):
    """Return the world position of a body-fixed point and its acceleration for q̈ = 0; write ± s × Aᵀ into
    three rows of Φ_q.

    Entries of the fixed frame are never read, and are left out.
    """
    frames, blocks = equations.frames, equations.system.blocks
    if b == frames.position.shape[0] - 1:
        return s, NOTHING
    a, w = frames.rotation, vector(frames.angular_velocity, b)
    for k in range(3):
        along = a[b, 3 * k], a[b, 3 * k + 1], a[b, 3 * k + 2]  # a world axis in the body's frame
        put(blocks, row + k, column, scale(sign, cross(s, along)))
    return add(vector(frames.position, b), to_world(a, b, s)), to_world(a, b, cross(w, cross(w, s)))


@kernel
def put_translations(row, blocks):
    """Write the constant entries in the three rows of a point: the derivatives by both bodies' positions."""
    for k in range(3):
        blocks[row + k, k] = 1.0
        blocks[row + k, 6 + k] = -1.0


@kernel
def turned_direction(p, t, equations):
    """Return the direction on the first body, rotated by its driver, if any, with its first and second
    rate."""
    primitives = equations.scene.primitives
    x, d = vector(primitives.direction_first, p), primitives.driver[p]
    if d < 0:
        return x, NOTHING, NOTHING
    if primitives.kind[p] >= TURN_1:
        return oriented_direction(p, t, equations)
    y = vector(primitives.turning_first, p)
    value, rate, acceleration = function_value(d, t, equations)
    along = add(scale(cos(value), x), scale(sin(value), y))
    direction = subtract(scale(cos(value), y), scale(sin(value), x))
    second = subtract(scale(-acceleration, along), scale(rate * rate, direction))
    return direction, scale(-rate, along), second


@kernel
def dot1(p, t, equations):
    """Evaluate a dot-1 constraint: vectors of both bodies stay perpendicular; a driver rotates the vector of
    the first body."""
    primitives, frames = equations.scene.primitives, equations.frames
    rows, blocks, rotation = equations.rows, equations.system.blocks, frames.rotation
    i, j, row = primitives.first[p], primitives.second[p], primitives.row[p]
    a, a_rate, a_second = turned_direction(p, t, equations)
    b = vector(primitives.direction_second, p)
    w_i, w_j = vector(frames.angular_velocity, i), vector(frames.angular_velocity, j)
    a_world, b_world = to_world(rotation, i, a), to_world(rotation, j, b)
    turn_i, turn_j = add(cross(w_i, a), a_rate), cross(w_j, b)
    second_i = add(cross(w_i, add(cross(w_i, a), scale(2.0, a_rate))), a_second)
    second_j = cross(w_j, turn_j)
    rows.phi[row] = dot(a_world, b_world)
    rows.nu[row] = -dot(to_world(rotation, i, a_rate), b_world)
    rows.gamma[row] = -(
        dot(to_world(rotation, i, second_i), b_world)
        + 2.0 * dot(to_world(rotation, i, turn_i), to_world(rotation, j, turn_j))
        + dot(a_world, to_world(rotation, j, second_j))
    )
    put(blocks, row, 0, NOTHING)
    put(blocks, row, 3, cross(a, to_body(rotation, i, b_world)))
    put(blocks, row, 6, NOTHING)
    put(blocks, row, 9, cross(b, to_body(rotation, j, a_world)))


@kernel
def between(p, primitives, frames):
    """Return the vector d between the points of both bodies, its rate, and d'' for q̈ = 0 (world)."""
    i, j, a = primitives.first[p], primitives.second[p], frames.rotation
    s_i, s_j = vector(primitives.point_first, p), vector(primitives.point_second, p)
    w_i, w_j = vector(frames.angular_velocity, i), vector(frames.angular_velocity, j)
    turn_i, turn_j = cross(w_i, s_i), cross(w_j, s_j)
    d = subtract(
        add(vector(frames.position, j), to_world(a, j, s_j)),
        add(vector(frames.position, i), to_world(a, i, s_i)),
    )
    rate = subtract(
        add(vector(frames.velocity, j), to_world(a, j, turn_j)),
        add(vector(frames.velocity, i), to_world(a, i, turn_i)),
    )
    return d, rate, subtract(to_world(a, j, cross(w_j, turn_j)), to_world(a, i, cross(w_i, turn_i)))


@kernel
def slide_of_joint(p, equations):
    """Return a·d and its γ, its derivatives (by the position of the second body, by both rotations), and its
    rate."""
    primitives, frames, rotation = equations.scene.primitives, equations.frames, equations.frames.rotation
    i, j = primitives.first[p], primitives.second[p]
    a, w_i = vector(primitives.direction_first, p), vector(frames.angular_velocity, i)
    s_i, s_j = vector(primitives.point_first, p), vector(primitives.point_second, p)
    d, d_rate, d_second = between(p, primitives, frames)
    a_world, a_rate = to_world(rotation, i, a), to_world(rotation, i, cross(w_i, a))
    a_second = to_world(rotation, i, cross(w_i, cross(w_i, a)))
    gamma = -(dot(a_second, d) + 2.0 * dot(a_rate, d_rate) + dot(a_world, d_second))
    turn_i, turn_j = cross(a, add(to_body(rotation, i, d), s_i)), cross(s_j, to_body(rotation, j, a_world))
    return dot(a_world, d), gamma, a_world, turn_i, turn_j, dot(a_rate, d) + dot(a_world, d_rate)


@kernel
def dot2(p, t, equations):
    """Evaluate a dot-2 constraint: a vector on the first body stays perpendicular to d; a driver prescribes d
    along it."""
    primitives, rows, blocks = equations.scene.primitives, equations.rows, equations.system.blocks
    row = primitives.row[p]
    rows.phi[row], rows.gamma[row], along, turn_i, turn_j, _ = slide_of_joint(p, equations)
    rows.nu[row] = 0.0
    if primitives.driver[p] >= 0:
        value, rate, acceleration = function_value(primitives.driver[p], t, equations)
        rows.phi[row] -= value
        rows.nu[row] = rate
        rows.gamma[row] += acceleration
    put(blocks, row, 0, scale(-1.0, along))
    put(blocks, row, 3, turn_i)
    put(blocks, row, 6, along)
    put(blocks, row, 9, turn_j)


@kernel
def distance(p, equations):
    """Evaluate the constraint that two body-fixed points keep their distance."""
    primitives, frames = equations.scene.primitives, equations.frames
    rows, blocks, rotation = equations.rows, equations.system.blocks, frames.rotation
    i, j, row = primitives.first[p], primitives.second[p], primitives.row[p]
    s_i, s_j = vector(primitives.point_first, p), vector(primitives.point_second, p)
    length = primitives.length[p]
    d, rate, second = between(p, primitives, frames)
    along = scale(1.0 / length, d)
    rows.phi[row] = (dot(d, d) - length * length) / (2.0 * length)
    rows.nu[row] = 0.0
    rows.gamma[row] = -(dot(rate, rate) + dot(d, second)) / length
    put(blocks, row, 0, scale(-1.0, along))
    put(blocks, row, 3, scale(-1.0, cross(s_i, to_body(rotation, i, along))))
    put(blocks, row, 6, along)
    put(blocks, row, 9, cross(s_j, to_body(rotation, j, along)))


@kernel
def joint_coordinate(p, equations):
    """Add a polynomial of a joint coordinate to the row of a coupling; its first coordinate resets the
    row."""
    primitives, rows, blocks = equations.scene.primitives, equations.rows, equations.system.blocks
    row = primitives.row[p]
    if primitives.begins[p]:
        rows.phi[row], rows.nu[row], rows.gamma[row] = 0.0, 0.0, 0.0
        for k in range(blocks.shape[1]):
            blocks[row, k] = 0.0
    if primitives.kind[p] == COUPLED_ANGLE:
        add_angle(p, equations)
    else:
        add_displacement(p, equations)


@kernel
def unwrapped_angle(sine, cosine, reference):
    """Return the angle of these multiples of its sine and cosine (rad) that is nearest to ``reference``."""
    angle = arctan2(sine, cosine)
    return angle + 2.0 * pi * floor((reference - angle) / (2.0 * pi) + 0.5)


@inlined
def polynomial(length, higher, q):
    """Return f(q) = length q + higher[0] q² + …, f'(q) and f''(q)."""
    over, slope, bend = 0.0, 0.0, 0.0  # f(q) / q, and its derivatives, by Horner's scheme
    for k in range(higher.shape[0] - 1, -2, -1):
        bend = bend * q + 2.0 * slope
        slope = slope * q + over
        over = over * q + (higher[k] if k >= 0 else length)
    return over * q, over + slope * q, 2.0 * slope + bend * q


@kernel
def add_angle(p, equations):
    """Add the polynomial of an angle to its row: the angle's rate is (ω_j - ω_i)·h with h = u × (c y - s x) /
    (c² + s²)."""
    primitives, frames, rotation = equations.scene.primitives, equations.frames, equations.frames.rotation
    rows, blocks = equations.rows, equations.system.blocks
    i, j, row = primitives.first[p], primitives.second[p], primitives.row[p]
    x = to_world(rotation, i, vector(primitives.direction_first, p))
    y = to_world(rotation, i, vector(primitives.turning_first, p))
    u = to_world(rotation, j, vector(primitives.direction_second, p))
    w_i = to_world(rotation, i, vector(frames.angular_velocity, i))
    w_j = to_world(rotation, j, vector(frames.angular_velocity, j))
    x_rate, y_rate, u_rate = cross(w_i, x), cross(w_i, y), cross(w_j, u)
    c, s = dot(u, x), dot(u, y)
    c_rate, s_rate = dot(u_rate, x) + dot(u, x_rate), dot(u_rate, y) + dot(u, y_rate)
    square, square_rate = c * c + s * s, 2.0 * (c * c_rate + s * s_rate)
    across = subtract(scale(c, y), scale(s, x))
    across_rate = subtract(add(scale(c_rate, y), scale(c, y_rate)), add(scale(s_rate, x), scale(s, x_rate)))
    normal, normal_rate = cross(u, across), add(cross(u_rate, across), cross(u, across_rate))
    h = scale(1.0 / square, normal)
    h_rate = scale(1.0 / square, subtract(normal_rate, scale(square_rate, h)))
    angle, turning = unwrapped_angle(s, c, equations.angles[primitives.angle[p]]), subtract(w_j, w_i)
    value, factor, bend = polynomial(primitives.length[p], primitives.higher[p], angle)
    rows.phi[row] += value
    rows.gamma[row] -= factor * dot(turning, h_rate) + bend * dot(turning, h) * dot(turning, h)
    accumulate(blocks[row], primitives.column_first[p] + 3, scale(-factor, to_body(rotation, i, h)))
    accumulate(blocks[row], primitives.column_second[p] + 3, scale(factor, to_body(rotation, j, h)))


@kernel
def add_displacement(p, equations):
    """Add the polynomial of a displacement to the row of its coupling."""
    primitives, rows, blocks = equations.scene.primitives, equations.rows, equations.system.blocks
    row = primitives.row[p]
    moved, gamma, along, turn_i, turn_j, rate = slide_of_joint(p, equations)
    value, factor, bend = polynomial(primitives.length[p], primitives.higher[p], moved)
    rows.phi[row] += value
    rows.gamma[row] += factor * gamma - bend * rate * rate
    accumulate(blocks[row], primitives.column_first[p], scale(-factor, along))
    accumulate(blocks[row], primitives.column_first[p] + 3, scale(factor, turn_i))
    accumulate(blocks[row], primitives.column_second[p], scale(factor, along))
    accumulate(blocks[row], primitives.column_second[p] + 3, scale(factor, turn_j))


@inlined
def constraints(t, equations):
    """Evaluate Φ, Φ_q, ν and γ of the rows of all primitives at the state in ``equations.frames``."""
    kinds = equations.scene.primitives.kind
    for p in range(kinds.shape[0]):
        if kinds[p] == POINT:
            point(p, equations)
        elif kinds[p] == DOT1 or kinds[p] >= TURN_1:
            dot1(p, t, equations)
        elif kinds[p] == DOT2:
            dot2(p, t, equations)
        elif kinds[p] == DISTANCE:
            distance(p, equations)
        elif kinds[p] >= CONTACT:
            wheel(p, equations)
        else:
            joint_coordinate(p, equations)
