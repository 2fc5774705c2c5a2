"""First-order changes of forces: of gravity, gyroscopic terms and loads, see ``varied_vectors``."""

from __future__ import annotations

from numpy import sqrt

from mbref.equations.functions import function_value
from mbref.equations.primitives import NOTHING, unwrapped_angle
from mbref.equations.varied_functions import function_change
from mbref.equations.varied_vectors import (
    add_change_of_forces,
    add_moment,
    add_moment_change,
    add_opposite_forces,
    between_changes,
    between_points,
    changed_vector,
    entry_vector,
    fixed_vector,
    product_change,
    product_motion,
)
from mbref.kernels.compilation import kernel
from mbref.kernels.scene_layout import ABOUT_AXIS, FORCE, MOMENT, POINT_DAMPER, SPRING, TURN_DAMPER
from mbref.linear_algebra.vectors import accumulate, add, cross, dot, scale, subtract, to_body, vector


@kernel
def load_change(k, n, t, numbers, equations):
    """Return the force or moment of load k and its change by number n."""
    loads, factor, change = equations.scene.loads, 1.0, 0.0
    own = vector(loads.force, k)
    if loads.function[k] >= 0:
        factor = function_value(loads.function[k], t, equations)[0]
    found = NOTHING
    if n >= 0:
        found = scale(factor, entry_vector(numbers.loads.force, n, k))
        if loads.function[k] >= 0:
            change = function_change(loads.function[k], t, n, numbers, equations)[0]
            found = add(found, scale(change, own))
    return scale(factor, own), found


@kernel
def vary_force(k, t, freedoms, varied, numbers, equations):
    """Add the changes of minus a moment on a body, or minus a force at a point."""
    loads = equations.scene.loads
    b, is_force = loads.first[k], loads.kind[k] == FORCE
    u = fixed_vector(b, vector(loads.point_first, k), varied, equations)
    force, _ = load_change(k, -1, t, numbers, equations)
    moment = cross(u[0], force) if is_force else force
    for e in range(3):
        varied.torque[b, e] -= moment[e]
    for d in range(varied.x.shape[0]):
        n = d - 2 * freedoms
        _, change = load_change(k, n, t, numbers, equations)
        moved = change
        if is_force:
            du = changed_vector(b, d, 0, u, numbers.loads.point_first, k, n, varied, equations)
            accumulate(varied.wrench[d], 6 * b, scale(-1.0, change))
            moved = add(cross(du[0], force), cross(u[0], change))
        accumulate(varied.wrench[d], 6 * b + 3, scale(-1.0, moved))


@kernel
def vary_meeting_ends(k, u, v, between, freedoms, varied, numbers, equations):
    """Add the changes of minus the forces of a spring whose ends, at u and v, meet. They are stiffness times
    the distance d, and damping times its rate, which holds for ends that part along one line."""
    loads, changes = equations.scene.loads, numbers.loads
    i, j, stiffness, damping = loads.first[k], loads.second[k], loads.stiffness[k], loads.damping[k]
    force = scale(damping, between[1])
    add_opposite_forces(i, j, u[0], v[0], between[0], force, varied)
    for d in range(varied.x.shape[0]):
        n = d - 2 * freedoms
        du = changed_vector(i, d, 1, u, changes.point_first, k, n, varied, equations)
        dv = changed_vector(j, d, 1, v, changes.point_second, k, n, varied, equations)
        gap = between_changes(i, j, d, du, dv, varied)
        moved = add(scale(stiffness, gap[0]), scale(damping, gap[1]))
        if n >= 0:
            moved = add(moved, scale(changes.damping[n, k], between[1]))
        add_change_of_forces(i, j, d, (u[0], v[0]), (add(du[0], gap[0]), dv[0]), force, moved, varied)


@kernel
def vary_spring(k, t, freedoms, varied, numbers, equations):
    """Add the changes of minus the forces along a line of two points, or along the axis of a joint."""
    loads, changes = equations.scene.loads, numbers.loads
    i, j, is_spring = loads.first[k], loads.second[k], loads.kind[k] == SPRING
    stiffness, damping = loads.stiffness[k], loads.damping[k]
    u = fixed_vector(i, vector(loads.point_first, k), varied, equations)
    v = fixed_vector(j, vector(loads.point_second, k), varied, equations)
    a = fixed_vector(i, vector(loads.axis, k), varied, equations)
    between, given = (
        between_points(i, j, u, v, varied, equations),
        load_change(k, -1, t, numbers, equations)[0],
    )
    length, rate, push_of_load = 0.0, 0.0, 0.0
    if is_spring:
        length = sqrt(dot(between[0], between[0]))
        if not length > 0.0:
            vary_meeting_ends(k, u, v, between, freedoms, varied, numbers, equations)
            return
        a = scale(1.0 / length, between[0]), NOTHING, NOTHING
        rate = dot(a[0], between[1])
    else:
        length, rate, _ = product_motion(a, between)
        push_of_load = given[0]
    # on the second body along a
    size = push_of_load - stiffness * (length - loads.natural[k]) - damping * rate
    force, arms = scale(-size, a[0]), (add(u[0], between[0]), v[0])
    add_opposite_forces(i, j, u[0], v[0], between[0], force, varied)
    for d in range(varied.x.shape[0]):
        n = d - 2 * freedoms
        du = changed_vector(i, d, 1, u, changes.point_first, k, n, varied, equations)
        dv = changed_vector(j, d, 1, v, changes.point_second, k, n, varied, equations)
        da = changed_vector(i, d, 1, a, changes.axis, k, n, varied, equations)
        gap, change = between_changes(i, j, d, du, dv, varied), 0.0
        if is_spring:
            longer = dot(a[0], gap[0])
            da = scale(1.0 / length, subtract(gap[0], scale(longer, a[0]))), NOTHING, NOTHING
            faster = dot(da[0], between[1]) + dot(a[0], gap[1])
        else:
            longer, faster = product_change(0, a, between, da, gap), product_change(1, a, between, da, gap)
        if n >= 0:
            change -= changes.stiffness[n, k] * (length - loads.natural[k])
            change += stiffness * changes.natural[n, k] - changes.damping[n, k] * rate
            if not is_spring:
                change += load_change(k, n, t, numbers, equations)[1][0]
        change -= stiffness * longer + damping * faster
        moved = scale(-1.0, add(scale(change, a[0]), scale(size, da[0])))
        add_change_of_forces(i, j, d, arms, (add(du[0], gap[0]), dv[0]), force, moved, varied)


@kernel
def spin_change(b, d, varied):
    """Return the change of the angular velocity of body b along direction d."""
    turned = cross(entry_vector(varied.turn, d, b), vector(varied.spin, b))
    return add(turned, entry_vector(varied.twist, d, b))


@kernel
def vary_turn_damper(k, freedoms, varied, numbers, equations):
    """Add the changes of damping (ω₂ - ω₁), minus the moment on the second body."""
    loads = equations.scene.loads
    i, j = loads.first[k], loads.second[k]
    apart = subtract(vector(varied.spin, j), vector(varied.spin, i))
    add_moment(i, j, scale(loads.damping[k], apart), varied)
    for d in range(varied.x.shape[0]):
        n = d - 2 * freedoms
        change = scale(loads.damping[k], subtract(spin_change(j, d, varied), spin_change(i, d, varied)))
        if n >= 0:
            change = add(change, scale(numbers.loads.damping[n, k], apart))
        add_moment_change(i, j, d, change, varied)


@kernel
def vary_point_damper(k, freedoms, varied, numbers, equations):
    """Add the changes of damping times the velocity of a point as seen from the first body, minus the force
    on the second body."""
    loads, changes = equations.scene.loads, numbers.loads
    i, j, damping = loads.first[k], loads.second[k], loads.damping[k]
    u = fixed_vector(i, vector(loads.point_first, k), varied, equations)
    v = fixed_vector(j, vector(loads.point_second, k), varied, equations)
    between, spin = between_points(i, j, u, v, varied, equations), vector(varied.spin, i)
    seen = subtract(between[1], cross(spin, between[0]))
    force, arms = scale(damping, seen), (add(u[0], between[0]), v[0])
    add_opposite_forces(i, j, u[0], v[0], between[0], force, varied)
    for d in range(varied.x.shape[0]):
        n = d - 2 * freedoms
        du = changed_vector(i, d, 1, u, changes.point_first, k, n, varied, equations)
        dv = changed_vector(j, d, 1, v, changes.point_second, k, n, varied, equations)
        gap = between_changes(i, j, d, du, dv, varied)
        carried = add(cross(spin_change(i, d, varied), between[0]), cross(spin, gap[0]))
        moved = scale(damping, subtract(gap[1], carried))
        if n >= 0:
            moved = add(moved, scale(changes.damping[n, k], seen))
        add_change_of_forces(i, j, d, arms, (add(du[0], gap[0]), dv[0]), force, moved, varied)


@kernel
def vary_torque(k, t, freedoms, varied, numbers, equations):
    """Add the changes of minus the moments about the axis of a joint."""
    loads, turning, changes = equations.scene.loads, equations.scene.turning, numbers.loads
    i, j, s = loads.first[k], loads.second[k], loads.angle[k]
    first, second = turning.first[s], turning.second[s]
    x = fixed_vector(first, vector(turning.x_first, s), varied, equations)
    y = fixed_vector(first, vector(turning.y_first, s), varied, equations)
    u = fixed_vector(second, vector(turning.x_second, s), varied, equations)
    a = fixed_vector(i, vector(loads.axis, k), varied, equations)
    cosine, sine = dot(u[0], x[0]), dot(u[0], y[0])
    angle, square = unwrapped_angle(sine, cosine, equations.angles[s]), cosine * cosine + sine * sine
    apart = subtract(vector(varied.spin, j), vector(varied.spin, i))
    rate, given = dot(apart, a[0]), load_change(k, -1, t, numbers, equations)[0][0]
    size = given - loads.stiffness[k] * (angle - loads.natural[k]) - loads.damping[k] * rate
    add_moment(i, j, scale(-size, a[0]), varied)
    for d in range(varied.x.shape[0]):
        n, change = d - 2 * freedoms, 0.0
        dx = changed_vector(first, d, 0, x, numbers.turning.x_first, s, n, varied, equations)[0]
        dy = changed_vector(first, d, 0, y, numbers.turning.y_first, s, n, varied, equations)[0]
        du = changed_vector(second, d, 0, u, numbers.turning.x_second, s, n, varied, equations)[0]
        da = changed_vector(i, d, 0, a, changes.axis, k, n, varied, equations)[0]
        more = cosine * (dot(du, y[0]) + dot(u[0], dy)) - sine * (dot(du, x[0]) + dot(u[0], dx))
        faster = dot(subtract(spin_change(j, d, varied), spin_change(i, d, varied)), a[0]) + dot(apart, da)
        if n >= 0:
            change = load_change(k, n, t, numbers, equations)[1][0]
            change -= changes.stiffness[n, k] * (angle - loads.natural[k])
            change += loads.stiffness[k] * changes.natural[n, k] - changes.damping[n, k] * rate
        change -= loads.stiffness[k] * more / square + loads.damping[k] * faster
        add_moment_change(i, j, d, scale(-1.0, add(scale(change, a[0]), scale(size, da))), varied)


@kernel
def vary_load(k, t, freedoms, varied, numbers, equations):
    """Add the changes of minus the forces and moments of load k."""
    kind = equations.scene.loads.kind[k]
    if kind in (MOMENT, FORCE):
        vary_force(k, t, freedoms, varied, numbers, equations)
    elif kind == ABOUT_AXIS:
        vary_torque(k, t, freedoms, varied, numbers, equations)
    elif kind == TURN_DAMPER:
        vary_turn_damper(k, freedoms, varied, numbers, equations)
    elif kind == POINT_DAMPER:
        vary_point_damper(k, freedoms, varied, numbers, equations)
    else:
        vary_spring(k, t, freedoms, varied, numbers, equations)


@kernel
def vary_forces(t, freedoms, varied, numbers, equations):
    """Add the changes of -g to the wrenches, and turn the moments of all wrenches to the bodies' axes.

    The mass matrix changes by the numbers, too: M a is included.
    """
    scene, frames = equations.scene, equations.frames
    loads, mass, inertia = scene.loads, scene.bodies.mass, scene.bodies.inertia
    for k in range(loads.kind.shape[0]):
        vary_load(k, t, freedoms, varied, numbers, equations)
    for d in range(varied.x.shape[0]):
        n, wrench = d - 2 * freedoms, varied.wrench[d]
        for b in range(mass.shape[0]):
            turned = cross(entry_vector(varied.turn, d, b), vector(varied.torque, b))
            moment = (
                wrench[6 * b + 3] - turned[0],
                wrench[6 * b + 4] - turned[1],
                wrench[6 * b + 5] - turned[2],
            )
            moment = to_body(frames.rotation, b, moment)
            w, dw = vector(frames.angular_velocity, b), entry_vector(varied.w, d, 2 * b + 1)
            j = vector(inertia, b)
            moment = add(moment, cross(w, (j[0] * dw[0], j[1] * dw[1], j[2] * dw[2])))
            moment = add(moment, cross(dw, (j[0] * w[0], j[1] * w[1], j[2] * w[2])))
            if n >= 0:
                e = entry_vector(numbers.inertia, n, b)
                moment = add(moment, cross(w, (e[0] * w[0], e[1] * w[1], e[2] * w[2])))
                for k in range(3):
                    wrench[6 * b + k] -= numbers.mass[n, b] * scene.gravity[b, k]
                    wrench[6 * b + k] -= mass[b] * numbers.gravity[n, 3 * b + k]
            for k in range(3):
                wrench[6 * b + 3 + k] = moment[k]
            if n >= 0:
                for k in range(6):
                    wrench[6 * b + k] += numbers.diagonal[n, 6 * b + k] * varied.acceleration[0, 6 * b + k]
