"""Coordinates q = (r, p) and velocities v = (r', ω') of every body: rates q' from v, displacements q ⊕ δ, and
the entries of y."""

from __future__ import annotations

from numpy import sqrt

from mbref.kernels.compilation import INT, MATRIX, VECTOR, entry, inlined, kernel
from mbref.linear_algebra.vectors import copy


@inlined
def coordinate_rates(q, v, rates):
    """Compute q' (7 nb,) from v (6 nb,): r' and p' = ½ Lᵀ ω'."""
    for b in range(q.shape[0] // 7):
        i, j = 7 * b, 6 * b
        for k in range(3):
            rates[i + k] = v[j + k]
        w, x, y, z = q[i + 3], q[i + 4], q[i + 5], q[i + 6]
        a, b_, c = 0.5 * v[j + 3], 0.5 * v[j + 4], 0.5 * v[j + 5]
        rates[i + 3] = -x * a - y * b_ - z * c
        rates[i + 4] = w * a - z * b_ + y * c
        rates[i + 5] = z * a + w * b_ - x * c
        rates[i + 6] = -y * a + x * b_ + w * c


@inlined
def normalise(q):
    """Normalise the Euler parameters of every body to unit length."""
    for b in range(q.shape[0] // 7):
        square = 0.0
        for k in range(3, 7):
            square += q[7 * b + k] * q[7 * b + k]
        inverse = 1.0 / sqrt(square)
        for k in range(3, 7):
            q[7 * b + k] *= inverse


@inlined
def displace(q, x, change):
    """Replace q by q ⊕ x with x (6 nb,) = (δr, δπ') for each body: p + ½ Lᵀ δπ', normalised.

    ``change`` (7 nb,) is working memory.
    """
    coordinate_rates(q, x, change)
    for k in range(q.shape[0]):
        q[k] += change[k]
    normalise(q)


@entry(INT(MATRIX, MATRIX, VECTOR))
def displace_all(q, x, change):
    """Displace every row of q (k, 7 nb) by the row of x (k, 6 nb) with equal index, both contiguous; return
    k."""
    for k in range(q.shape[0]):
        displace(q[k], x[k], change)
    return q.shape[0]


@inlined
def expand(y, active, state):
    """Copy y into the state; entries of the state that y does not contain are unchanged."""
    coordinates, velocities = active.coordinates, active.velocities
    nq = coordinates.shape[0]
    for k in range(nq):
        state.coordinates[coordinates[k]] = y[k]
    for k in range(velocities.shape[0]):
        state.velocities[velocities[k]] = y[nq + k]


@inlined
def contract(q, v, active, y):
    """Copy the active entries of all coordinates and velocities, or of their rates, into y."""
    coordinates, velocities = active.coordinates, active.velocities
    nq = coordinates.shape[0]
    for k in range(nq):
        y[k] = q[coordinates[k]]
    for k in range(velocities.shape[0]):
        y[nq + k] = v[velocities[k]]


@kernel
def fastest_turn(v):
    """Return the largest angular velocity of a body (rad/s)."""
    square = 0.0
    for b in range(v.shape[0] // 6):
        x, y, z = v[6 * b + 3], v[6 * b + 4], v[6 * b + 5]
        square = max(square, x * x + y * y + z * z)
    return sqrt(square)


@kernel
def copy_state(source, target):
    """Copy the state ``source`` to ``target``."""
    copy(source.coordinates, target.coordinates)
    copy(source.velocities, target.velocities)
    copy(source.coordinate_rates, target.coordinate_rates)
    copy(source.coordinate_second, target.coordinate_second)
