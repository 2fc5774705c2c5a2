"""Generalised forces g: gravity, gyroscopic terms, moments, forces at points, springs, loads of joints.

g has 6 entries per body: force in the world frame, moment about the centre of mass in the body frame
(Eq. 4 of the paper); the gyroscopic term is -ω' × J ω'.
"""

from __future__ import annotations

from numpy import sqrt

from mbref.equations.functions import function_value
from mbref.equations.primitives import unwrapped_angle
from mbref.kernels.compilation import inlined, kernel
from mbref.kernels.scene_layout import ABOUT_AXIS, ALONG_AXIS, FORCE, MOMENT, SPRING, TURN_DAMPER
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


@inlined
def forces(t, equations):
    """Compute g at the state in ``equations.frames`` into ``equations.system.force``."""
    scene, frames, g = equations.scene, equations.frames, equations.system.force
    mass, inertia, gravity = scene.bodies.mass, scene.bodies.inertia, scene.gravity
    for b in range(mass.shape[0]):
        w = vector(frames.angular_velocity, b)
        gyroscopic = cross((inertia[b, 0] * w[0], inertia[b, 1] * w[1], inertia[b, 2] * w[2]), w)
        for k in range(3):
            g[6 * b + k] = mass[b] * gravity[b, k]
            g[6 * b + 3 + k] = gyroscopic[k]
    loads = scene.loads
    for k in range(loads.kind.shape[0]):
        kind, body = loads.kind[k], loads.first[k]
        factor = 1.0
        if loads.function[k] >= 0:
            factor = function_value(loads.function[k], t, equations)[0]
        force = scale(factor, vector(loads.force, k))
        if kind == MOMENT:
            accumulate(g, 6 * body + 3, to_body(frames.rotation, body, force))
        elif kind == FORCE:
            push(body, vector(loads.point_first, k), force, frames, g)
        elif kind == SPRING:
            spring(k, loads, frames, g)
        elif kind == ABOUT_AXIS:
            act_about_axis(k, force[0], equations)
        elif kind == ALONG_AXIS:
            act_along_axis(k, force[0], loads, frames, g)
        elif kind == TURN_DAMPER:
            damp_rotation(k, loads, frames, g)
        else:
            damp_point(k, loads, frames, g)


@kernel
def push(b, point, force, frames, g):
    """Add a world force at a body-fixed point; a force on the fixed frame has no effect."""
    if 6 * b < g.shape[0]:
        accumulate(g, 6 * b, force)
        accumulate(g, 6 * b + 3, cross(point, to_body(frames.rotation, b, force)))


@kernel
def point_motion(b, s, frames):
    """Return world position and velocity of a body-fixed point."""
    w = vector(frames.angular_velocity, b)
    position = add(vector(frames.position, b), to_world(frames.rotation, b, s))
    return position, add(vector(frames.velocity, b), to_world(frames.rotation, b, cross(w, s)))


@kernel
def spin_between(k, loads, frames):
    """Return ω₂ - ω₁ of the bodies of load k, world."""
    i, j, w = loads.first[k], loads.second[k], frames.angular_velocity
    return subtract(to_world(frames.rotation, j, vector(w, j)), to_world(frames.rotation, i, vector(w, i)))


@kernel
def turn_apart(i, j, moment, frames, g):
    """Add a world moment on body j and the opposite moment on body i, except on the fixed frame."""
    if 6 * j < g.shape[0]:
        accumulate(g, 6 * j + 3, to_body(frames.rotation, j, moment))
    if 6 * i < g.shape[0]:
        accumulate(g, 6 * i + 3, to_body(frames.rotation, i, scale(-1.0, moment)))


@kernel
def damp_rotation(k, loads, frames, g):
    """Add the moment -damping (ω₂ - ω₁) on the second body, and the opposite moment on the first body."""
    moment = scale(-loads.damping[k], spin_between(k, loads, frames))
    turn_apart(loads.first[k], loads.second[k], moment, frames, g)


@kernel
def damp_point(k, loads, frames, g):
    """Add -damping (v_j - v_i - ω_i × d) at a point of the second body, where d leads to it from a point of
    the first body, and the opposite force at an equal place on the first body."""
    i, j, rotation = loads.first[k], loads.second[k], frames.rotation
    s_i, s_j = vector(loads.point_first, k), vector(loads.point_second, k)
    p_i, v_i = point_motion(i, s_i, frames)
    p_j, v_j = point_motion(j, s_j, frames)
    d, w_i = subtract(p_j, p_i), to_world(rotation, i, vector(frames.angular_velocity, i))
    force = scale(-loads.damping[k], subtract(subtract(v_j, v_i), cross(w_i, d)))
    push(j, s_j, force, frames, g)
    push(i, add(s_i, to_body(rotation, i, d)), scale(-1.0, force), frames, g)


@kernel
def spring(k, loads, frames, g):
    """Add the tension stiffness (l - natural length) + damping l' between two points."""
    i, j = loads.first[k], loads.second[k]
    s_i, s_j = vector(loads.point_first, k), vector(loads.point_second, k)
    p_i, v_i = point_motion(i, s_i, frames)
    p_j, v_j = point_motion(j, s_j, frames)
    d, v = subtract(p_j, p_i), subtract(v_j, v_i)
    length = sqrt(dot(d, d))
    if length > 0.0:
        rate = dot(d, v) / length
        tension = loads.stiffness[k] * (length - loads.natural[k]) + loads.damping[k] * rate
        force = scale(tension / length, d)
        push(i, s_i, force, frames, g)
        push(j, s_j, scale(-1.0, force), frames, g)
    else:  # the ends part along their relative velocity
        force = scale(loads.damping[k], v)
        push(i, s_i, force, frames, g)
        push(j, s_j, scale(-1.0, force), frames, g)


@kernel
def joint_angle(s, reference, equations):
    """Return the angle (rad) of the joint with index s in ``TurningJoints``, nearest to ``reference``."""
    turning, rotation = equations.scene.turning, equations.frames.rotation
    x = to_world(rotation, turning.first[s], vector(turning.x_first, s))
    y = to_world(rotation, turning.first[s], vector(turning.y_first, s))
    u = to_world(rotation, turning.second[s], vector(turning.x_second, s))
    return unwrapped_angle(dot(u, y), dot(u, x), reference)


@kernel
def act_about_axis(k, torque, equations):
    """Add the moment torque - stiffness (φ - natural angle) - damping φ' on the second body, and the opposite
    moment on the first body."""
    loads, frames, g = equations.scene.loads, equations.frames, equations.system.force
    i, j, rotation = loads.first[k], loads.second[k], frames.rotation
    axis = to_world(rotation, i, vector(loads.axis, k))
    angle = joint_angle(loads.angle[k], equations.angles[loads.angle[k]], equations)
    rate = dot(spin_between(k, loads, frames), axis)
    resistance = loads.stiffness[k] * (angle - loads.natural[k]) + loads.damping[k] * rate
    turn_apart(i, j, scale(torque - resistance, axis), frames, g)


@kernel
def act_along_axis(k, force, loads, frames, g):
    """Add ``force`` - stiffness (x - natural displacement) - damping x' on the second body along the axis a
    of the first body, with x = a · d, and the opposite force at an equal place on the first body."""
    i, j, rotation = loads.first[k], loads.second[k], frames.rotation
    s_i, s_j = vector(loads.point_first, k), vector(loads.point_second, k)
    p_i, v_i = point_motion(i, s_i, frames)
    p_j, v_j = point_motion(j, s_j, frames)
    axis, d = to_world(rotation, i, vector(loads.axis, k)), subtract(p_j, p_i)
    turning = cross(to_world(rotation, i, vector(frames.angular_velocity, i)), axis)
    rate = dot(axis, subtract(v_j, v_i)) + dot(turning, d)
    resistance = loads.stiffness[k] * (dot(axis, d) - loads.natural[k]) + loads.damping[k] * rate
    size = force - resistance
    push(j, s_j, scale(size, axis), frames, g)
    push(i, add(s_i, to_body(rotation, i, d)), scale(-size, axis), frames, g)


@kernel
def remember_angles(equations):
    """Save the angles of joints at the state in ``equations.frames``; bodies have turned by less than a right
    angle since the last call."""
    angles = equations.angles
    for s in range(angles.shape[0]):
        angles[s] = joint_angle(s, angles[s], equations)


@kernel
def advance_angles(interval, equations):
    """Save the angles of joints and their rates at the accepted state, a time ``interval`` (s) after the last
    one. The mean rate predicts each angle, so that a steady step may have full turns."""
    turning, frames = equations.scene.turning, equations.frames
    angles, rates, rotation = equations.angles, equations.angle_rates, equations.frames.rotation
    for s in range(angles.shape[0]):
        i, j = turning.first[s], turning.second[s]
        axis = to_world(rotation, i, cross(vector(turning.x_first, s), vector(turning.y_first, s)))
        spin_i = to_world(rotation, i, vector(frames.angular_velocity, i))
        spin_j = to_world(rotation, j, vector(frames.angular_velocity, j))
        rate = dot(subtract(spin_j, spin_i), axis)
        angles[s] = joint_angle(s, angles[s] + 0.5 * interval * (rates[s] + rate), equations)
        rates[s] = rate
