"""Generalised forces g: gravity, gyroscopic terms, moments, forces at points, springs, torsion springs.

g has 6 entries per body: force in the world frame, moment about the centre of mass in the body frame
(Eq. 4 of the paper); the gyroscopic term is -ω' × J ω'.
"""

from __future__ import annotations

from math import pi

from numpy import arctan2, floor, sqrt

from mbref.kernels.compilation import inlined, kernel
from mbref.kernels.layout import (
    ANGLES,
    BODIES,
    COLUMNS,
    FORCE,
    FORCE_AT_POINT,
    FRAMES,
    GRAVITY,
    LOAD_DATA,
    LOADS,
    MOMENT,
    OMEGA,
    POSITION,
    SPRING,
    VELOCITY,
)
from mbref.linear_algebra.vectors import (
    accumulate,
    add,
    cross,
    dot,
    scale,
    subtract,
    to_body,
    to_world,
    vector,
)

# columns of LOAD_DATA
FIRST, SECOND, THIRD, FOURTH, CONSTANTS = 0, 3, 6, 9, 12  # four vectors, then stiffness, damping, natural


@inlined
def forces(ints, floats, work):
    """g at the state in ``work[FRAMES]``, into ``work[COLUMNS][FORCE]``."""
    bodies, gravity, frames, g = floats[BODIES], floats[GRAVITY], work[FRAMES], work[COLUMNS][FORCE]
    for b in range(bodies.shape[0]):
        w = vector(frames, b, OMEGA)
        jw = (bodies[b, 1] * w[0], bodies[b, 2] * w[1], bodies[b, 3] * w[2])
        gyroscopic = cross(jw, w)
        for k in range(3):
            g[6 * b + k] = bodies[b, 0] * gravity[0, k]
            g[6 * b + 3 + k] = gyroscopic[k]
    loads, data = ints[LOADS], floats[LOAD_DATA]
    for k in range(loads.shape[0]):
        kind, i, j = loads[k, 0], loads[k, 1], loads[k, 2]
        if kind == MOMENT:
            accumulate(g, 6 * i + 3, to_body(frames, i, vector(data, k, FIRST)))
        elif kind == FORCE_AT_POINT:
            push(i, vector(data, k, FIRST), vector(data, k, SECOND), frames, g)
        elif kind == SPRING:
            spring(k, i, j, frames, data, g)
        else:
            torsion_spring(k, i, j, loads[k, 3], frames, data, work[ANGLES], g)


@kernel
def push(b, point, force, frames, g):
    """A world force at a body-fixed point; nothing happens to the fixed frame."""
    if 6 * b < g.shape[0]:
        accumulate(g, 6 * b, force)
        accumulate(g, 6 * b + 3, cross(point, to_body(frames, b, force)))


@kernel
def point_motion(b, s, frames):
    """World position and velocity of a body-fixed point."""
    w = vector(frames, b, OMEGA)
    position = add(vector(frames, b, POSITION), to_world(frames, b, s))
    return position, add(vector(frames, b, VELOCITY), to_world(frames, b, cross(w, s)))


@kernel
def spring(k, i, j, frames, data, g):
    """Tension stiffness (l - natural length) + damping l' between two points."""
    s_i, s_j = vector(data, k, FIRST), vector(data, k, SECOND)
    p_i, v_i = point_motion(i, s_i, frames)
    p_j, v_j = point_motion(j, s_j, frames)
    d, v = subtract(p_j, p_i), subtract(v_j, v_i)
    length = sqrt(dot(d, d))
    if length > 0.0:
        rate = dot(d, v) / length
        tension = data[k, CONSTANTS] * (length - data[k, CONSTANTS + 2]) + data[k, CONSTANTS + 1] * rate
        force = scale(tension / length, d)
        push(i, s_i, force, frames, g)
        push(j, s_j, scale(-1.0, force), frames, g)


@kernel
def relative_angle(k, i, j, reference, frames, data):
    """Angle of body j against i about the joint axis (rad), the turn nearest to ``reference``."""
    x, y = to_world(frames, i, vector(data, k, SECOND)), to_world(frames, i, vector(data, k, THIRD))
    u = to_world(frames, j, vector(data, k, FOURTH))
    angle = arctan2(dot(u, y), dot(u, x))
    return angle + 2.0 * pi * floor((reference - angle) / (2.0 * pi) + 0.5)


@kernel
def torsion_spring(k, i, j, slot, frames, data, angles, g):
    """Moment -stiffness (φ - natural angle) - damping φ' on j about the joint axis, the opposite on i."""
    axis = to_world(frames, i, vector(data, k, FIRST))
    angle = relative_angle(k, i, j, angles[0, slot], frames, data)
    w_i = to_world(frames, i, vector(frames, i, OMEGA))
    w_j = to_world(frames, j, vector(frames, j, OMEGA))
    rate = dot(subtract(w_j, w_i), axis)
    size = data[k, CONSTANTS] * (angle - data[k, CONSTANTS + 2]) + data[k, CONSTANTS + 1] * rate
    moment = scale(-size, axis)
    if 6 * j < g.shape[0]:
        accumulate(g, 6 * j + 3, to_body(frames, j, moment))
    if 6 * i < g.shape[0]:
        accumulate(g, 6 * i + 3, to_body(frames, i, scale(-1.0, moment)))


@kernel
def has_angles(loads):
    """Whether there is a torsion spring, whose angle unwraps."""
    for k in range(loads.shape[0]):  # noqa: SIM110 - numba compiles no generator expression
        if loads[k, 3] >= 0:
            return True
    return False


@kernel
def remember_angles(ints, floats, work):
    """Keep the torsion springs' angles of the accepted state, so that they unwrap over many turns."""
    loads, frames, angles = ints[LOADS], work[FRAMES], work[ANGLES]
    for k in range(loads.shape[0]):
        if loads[k, 3] >= 0:
            i, j, slot = loads[k, 1], loads[k, 2], loads[k, 3]
            angles[0, slot] = relative_angle(k, i, j, angles[0, slot], frames, floats[LOAD_DATA])
