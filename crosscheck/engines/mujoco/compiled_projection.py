"""MuJoCo's states projected onto its closures in compiled code, as C functions.

Newton's method uses the rows of the equalities (efc_pos, efc_J) and the least change of the velocities.
Redundant rows are left out by pivoting.
"""

from __future__ import annotations

import math

from numba import carray
from numba.extending import register_jitable

from crosscheck.engines.mujoco.context import (
    CENTRES,
    CLOSURES,
    COUNT,
    DATA,
    DRIVE,
    DRIVE_WIDTH,
    DRIVES,
    FULL_MASS,
    INTEGRATE,
    JACOBIAN,
    KINEMATICS,
    MODEL,
    MOST_ROWS,
    NQ,
    NV,
    POSITION_STAGE,
    QPOS,
    QVEL,
    RESIDUALS,
    VELOCITY,
    WEIGHTED,
    WIDTH,
    WORK,
)
from crosscheck.engines.mujoco.rates import SIGNATURE, put
from crosscheck.engines.shared.compiled.calls import (
    c_function,
    call_with_three,
    call_with_three_and_real,
    call_with_two,
    integers,
    reals,
    small_integers,
)

ITERATIONS = 10  # largest number of Newton iterations; usually two suffice
CLOSED = 1e-13  # m and rad; residual at which Newton's method ends
CLOSED_ENOUGH = 1e-8  # m and rad; largest residual of a result
REDUNDANT = 1e-7  # remainder of a row after elimination / largest row; smaller remainders are redundant rows
MET, NOT_MET = 0, 1
TOLERANCE, EVALUATIONS, TIME = range(3)  # indices of the numbers of a followed motion


@register_jitable
def root_of(mass, n):
    """Replace a matrix (n, n) by its lower Cholesky factor."""
    for i in range(n):
        for j in range(i + 1):
            total = mass[i, j]
            for k in range(j):
                total -= mass[i, k] * mass[j, k]
            mass[i, j] = math.sqrt(total) if i == j else total / mass[j, j]


@register_jitable
def spread(root, row, n):
    """Replace a row by L⁻¹ times the row."""
    for i in range(n):
        total = row[i]
        for k in range(i):
            total -= root[i, k] * row[k]
        row[i] = total / root[i, i]


@register_jitable
def gather(root, change, n):
    """Replace a change by L⁻ᵀ times the change."""
    for i in range(n - 1, -1, -1):
        total = change[i]
        for k in range(i + 1, n):
            total -= root[k, i] * change[k]
        change[i] = total / root[i, i]


@register_jitable
def largest(rows, left, count, n):
    """Return the index and the square of the largest row among the rows that are left."""
    best, most = -1, 0.0
    for i in range(left, count):
        size = 0.0
        for j in range(n):
            size += rows[i, j] * rows[i, j]
        if size > most:
            best, most = i, size
    return best, most


@register_jitable
def least(rows, wanted, change, count, n):
    """Compute the change of least norm with rows · change = wanted; rows that depend on other rows count
    once.

    Rows are made orthonormal one by one, the largest remaining row first.
    """
    change[:n] = 0.0
    enough = 0.0
    for k in range(min(count, n)):
        best, square = largest(rows, k, count, n)
        enough = REDUNDANT * REDUNDANT * square if k == 0 else enough
        if square <= enough:
            break
        for j in range(n):
            rows[k, j], rows[best, j] = rows[best, j], rows[k, j]
        wanted[k], wanted[best] = wanted[best], wanted[k]
        subtract(rows, wanted, k, count, n, 1.0 / math.sqrt(square))
        for j in range(n):
            change[j] += wanted[k] * rows[k, j]


@register_jitable
def subtract(rows, wanted, k, count, n, scale):
    """Normalise row k, and subtract its component from later rows and their wanted values."""
    wanted[k] *= scale
    for j in range(n):
        rows[k, j] *= scale
    for i in range(k + 1, count):
        along = 0.0
        for j in range(n):
            along += rows[i, j] * rows[k, j]
        wanted[i] -= along * wanted[k]
        for j in range(n):
            rows[i, j] -= along * rows[k, j]


@register_jitable
def parts(c):
    """Return memory for the rows of closures, their values, the root of the mass matrix, and a change.

    The last number is the size of a Jacobian entry that counts as rounding.
    """
    n, most = c[NV], c[MOST_ROWS]
    work = carray(reals(c[WORK]), (most * (n + 1) + n * (n + 2) + 1,))
    rows, rest = work[: most * n].reshape((most, n)), work[most * n :]
    return rows, rest[:most], rest[most : most + n * n].reshape((n, n)), rest[most + n * n : most + n * n + n]


@register_jitable
def smallest(c):
    """Return the size of a Jacobian entry that counts as rounding."""
    n, most = c[NV], c[MOST_ROWS]
    size = most * (n + 1) + n * (n + 2) + 1
    return carray(reals(c[WORK]), (size,))[size - 1]


@register_jitable
def moves(row, nothing):
    """Return whether any coordinate moves a row."""
    largest_entry = 0.0
    for x in row:
        largest_entry = max(largest_entry, abs(x))
    return largest_entry > nothing


@register_jitable
def weigh(c, root):
    """Compute the lower Cholesky factor of the mass matrix at the data's position."""
    if c[WEIGHTED] != 0:
        call_with_three(c[FULL_MASS], c[MODEL], c[DATA], root.ctypes.data)
        root_of(root, c[NV])


@register_jitable
def fetch(c, rows, root):
    """Fetch the Jacobian's rows, multiplied by the inverse root of the mass matrix or without driven
    coordinates; returns their number."""
    n, count = c[NV], carray(small_integers(c[COUNT]), (1,))[0]
    jacobian = carray(reals(carray(integers(c[JACOBIAN]), (1,))[0]), (count, n))
    drives = carray(reals(c[DRIVE]), (c[DRIVES], c[DRIVE_WIDTH]))
    nothing = smallest(c)
    for i in range(count):
        rows[i] = jacobian[i]
        if not moves(jacobian[i], nothing):
            rows[i] = 0.0
        if c[WEIGHTED] != 0:
            spread(root, rows[i], n)
            continue
        for k in range(c[DRIVES]):
            rows[i, int(drives[k, VELOCITY])] = 0.0
    return count


@register_jitable
def residuals(c):
    """Return the closure errors (m, rad) at the data's position."""
    count = carray(small_integers(c[COUNT]), (1,))[0]
    return carray(reals(carray(integers(c[RESIDUALS]), (1,))[0]), (count,))


@register_jitable
def place(c):
    """Compute MuJoCo's closures at the data's position."""
    call_with_two(c[KINEMATICS], c[MODEL], c[DATA])
    call_with_two(c[CENTRES], c[MODEL], c[DATA])
    call_with_two(c[CLOSURES], c[MODEL], c[DATA])


@register_jitable
def change_by(c, rows, wanted, root, change, count):
    """Compute the least change of the velocities for which the rows have the wanted values."""
    least(rows, wanted, change, count, c[NV])
    if c[WEIGHTED] != 0:
        gather(root, change, c[NV])


@register_jitable
def meet(c, tolerance):
    """Move the data's position onto the closures; returns the number of evaluations, negative on failure."""
    rows, wanted, root, change = parts(c)
    worst = math.inf
    for k in range(ITERATIONS):
        if k == 0 and c[WEIGHTED] != 0:
            call_with_two(c[POSITION_STAGE], c[MODEL], c[DATA])
            weigh(c, root)
        else:
            place(c)
        errors = residuals(c)
        worst = 0.0
        for i in range(errors.shape[0]):
            worst = max(worst, abs(errors[i]))
            wanted[i] = -errors[i]
        if not worst > tolerance:
            return k + 1
        change_by(c, rows, wanted, root, change, fetch(c, rows, root))
        call_with_three_and_real(c[INTEGRATE], c[MODEL], c[QPOS], change.ctypes.data, 1.0)
    return ITERATIONS if worst < CLOSED_ENOUGH else -ITERATIONS


@register_jitable
def meet_rates(c, qvel):
    """Change the data's velocities to the nearest velocities that the closures allow."""
    rows, wanted, root, change = parts(c)
    count = carray(small_integers(c[COUNT]), (1,))[0]
    jacobian = carray(reals(carray(integers(c[JACOBIAN]), (1,))[0]), (count, c[NV]))
    for i in range(count):
        wanted[i] = 0.0
        for j in range(c[NV]):
            wanted[i] -= jacobian[i, j] * qvel[j]
    change_by(c, rows, wanted, root, change, fetch(c, rows, root))
    for j in range(c[NV]):
        qvel[j] += change[j]


@register_jitable
def take(c, y, qpos, qvel):
    """Copy the data's state into y."""
    state = carray(y, (c[NQ] + c[NV],))
    state[: c[NQ]], state[c[NQ] :] = qpos, qvel


@c_function(SIGNATURE)
def settle(context, t, y, out):
    """Project the state y at time t (s) onto the closures by the least kinetic energy; returns MET or
    NOT_MET."""
    c = carray(context, (WIDTH,))
    qpos, qvel = put(c, t, y)
    if c[MOST_ROWS] == 0:
        return MET
    if meet(c, CLOSED) < 0:
        return NOT_MET
    meet_rates(c, qvel)
    take(c, y, qpos, qvel)
    return MET


@c_function(SIGNATURE)
def follow(context, t, y, numbers):
    """Move the state y from time TIME to time t by Newton's method on the closures; returns MET or
    NOT_MET."""
    c, n = carray(context, (WIDTH,)), carray(numbers, (3,))
    state = carray(y, (c[NQ] + c[NV],))
    qpos, qvel = carray(reals(c[QPOS]), (c[NQ],)), carray(reals(c[QVEL]), (c[NV],))
    qpos[:], qvel[:] = state[: c[NQ]], state[c[NQ] :]
    call_with_three_and_real(c[INTEGRATE], c[MODEL], c[QPOS], c[QVEL], t - n[TIME])
    take(c, y, qpos, qvel)
    put(c, t, y)
    evaluations = meet(c, n[TOLERANCE])
    n[EVALUATIONS] += abs(evaluations)
    if evaluations < 0:
        return NOT_MET
    meet_rates(c, qvel)
    take(c, y, qpos, qvel)
    n[TIME] = t
    return MET
