"""One evaluation of a scene: frames, constraints, forces, and the right-hand side of Φ_q q̈ = γ."""

from __future__ import annotations

from mbref.equations.functions import select_pieces
from mbref.equations.loads import forces
from mbref.equations.primitives import constraints
from mbref.kernels.compilation import INT, MATRIX, VECTOR, entry, inlined, kernel
from mbref.kernels.layout import EQUATIONS
from mbref.linear_algebra.vectors import copy


@inlined
def set_poses(q, frames):
    """Compute positions and rotation matrices from coordinates q; the matrix of p / |p| is used, so that the
    length of p has no influence."""
    position, a = frames.position, frames.rotation
    for b in range(q.shape[0] // 7):
        for k in range(3):
            position[b, k] = q[7 * b + k]
        w, x, y, z = q[7 * b + 3], q[7 * b + 4], q[7 * b + 5], q[7 * b + 6]
        s = 2.0 / (w * w + x * x + y * y + z * z)
        a[b, 0] = 1.0 - s * (y * y + z * z)
        a[b, 1] = s * (x * y - w * z)
        a[b, 2] = s * (x * z + w * y)
        a[b, 3] = s * (x * y + w * z)
        a[b, 4] = 1.0 - s * (x * x + z * z)
        a[b, 5] = s * (y * z - w * x)
        a[b, 6] = s * (x * z - w * y)
        a[b, 7] = s * (y * z + w * x)
        a[b, 8] = 1.0 - s * (x * x + y * y)


@inlined
def set_velocities(v, frames):
    """Compute velocities r' and body-fixed ω' from the velocity vector v."""
    velocity, angular_velocity = frames.velocity, frames.angular_velocity
    for b in range(v.shape[0] // 6):
        for k in range(3):
            velocity[b, k] = v[6 * b + k]
            angular_velocity[b, k] = v[6 * b + 3 + k]


@kernel
def rate_of_row(row, v, equations):
    """Return Φ' = Φ_q v - ν of one row, and the sum of the sizes of its terms."""
    bodies, blocks = equations.scene.row_bodies, equations.system.blocks
    value = -equations.rows.nu[row]
    size = abs(value)
    for side in range(bodies.shape[1]):
        start = 6 * bodies[row, side]
        if start < v.shape[0]:
            for k in range(6):
                value += blocks[row, 6 * side + k] * v[start + k]
                size += abs(blocks[row, 6 * side + k] * v[start + k])
    return value, size


@inlined
def violation_rate(v, equations):
    """Compute Φ' = Φ_q v - ν of every row."""
    bodies, blocks, rows = equations.scene.row_bodies, equations.system.blocks, equations.rows
    for row in range(bodies.shape[0]):
        value = -rows.nu[row]
        for side in range(bodies.shape[1]):
            start = 6 * bodies[row, side]
            if start < v.shape[0]:
                for k in range(6):
                    value += blocks[row, 6 * side + k] * v[start + k]
        rows.phi_rate[row] = value


@kernel
def assemble_jacobian(equations, dense):
    """Write the blocks of Φ_q into the matrix ``dense`` (m, n); a matrix without rows is unchanged."""
    bodies, blocks = equations.scene.row_bodies, equations.system.blocks
    dense[:] = 0.0
    for row in range(dense.shape[0]):
        for side in range(bodies.shape[1]):
            start = 6 * bodies[row, side]
            if start < dense.shape[1]:
                for k in range(6):
                    dense[row, start + k] = blocks[row, 6 * side + k]


@inlined
def evaluate(t, q, v, equations):
    """Compute Φ, Φ_q (blocks), ν, γ and g at (t, q, v)."""
    set_poses(q, equations.frames)
    set_velocities(v, equations.frames)
    constraints(t, equations)
    forces(t, equations)


@entry(INT(VECTOR, MATRIX, MATRIX, MATRIX, MATRIX, MATRIX, MATRIX, EQUATIONS))
def evaluate_along(times, q, v, angles, blocks, rows, forces, equations):
    """Call ``evaluate`` at k states from Python: Φ_q as blocks (k, width m), (Φ, ν, γ) (k, 3 m), g (k, n).

    Arguments are times (k,), coordinates q (k, 7 nb) and velocities v (k, n); angles of joints are the
    nearest ones to those in a row of ``angles`` (k, a), or in memory without rows. Returns k.
    """
    count, m = times.shape[0], equations.rows.phi.shape[0]
    for k in range(count):
        if angles.shape[0] > 0:
            copy(angles[k], equations.angles)
        select_pieces(times[k], equations)
        evaluate(times[k], q[k], v[k], equations)
        found = equations.system.blocks.reshape(-1)
        copy(found, blocks[k])
        copy(equations.rows.phi, rows[k, :m])
        copy(equations.rows.nu, rows[k, m : 2 * m])
        copy(equations.rows.gamma, rows[k, 2 * m :])
        copy(equations.system.force, forces[k])
    return count


@inlined
def right_hand_side(v, equations):
    """Compute the right-hand side of Φ_q q̈ = γ, minus the feedback of Eq. 9 if a stabilisation requires
    it."""
    rows, rhs, settings = equations.rows, equations.system.rhs, equations.system.settings
    velocity_gain, position_gain = settings.velocity_gain, settings.position_gain
    for row in range(rhs.shape[0]):
        rhs[row] = rows.gamma[row]
    if velocity_gain != 0.0 or position_gain != 0.0:
        violation_rate(v, equations)
        for row in range(rhs.shape[0]):
            rhs[row] -= velocity_gain * rows.phi_rate[row]
            rhs[row] -= position_gain * rows.phi[row]


@inlined
def assemble_system(t, q, v, equations):
    """Compute the system M q̈ + Φ_qᵀ λ = g, Φ_q q̈ = rhs at (t, q, v), which the formulation then solves."""
    equations.system.counts.evaluations += 1
    evaluate(t, q, v, equations)
    assemble_jacobian(equations, equations.system.jacobian)
    right_hand_side(v, equations)
