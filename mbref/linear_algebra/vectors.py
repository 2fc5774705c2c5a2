"""Three-vectors as tuples, for the kernels: compiled code allocates no memory for them. Further functions
operate on whole vectors: copies (NumPy's slices would allocate), sorting, maximum (``larger``).
"""

from __future__ import annotations

from numpy import isfinite, isnan

from mbref.kernels.compilation import inlined, kernel

TINY = 1e-100  # its cube is still a normal number


@kernel
def vector(table, row):
    """Return a row (3,) of a table (k, 3) as a tuple."""
    return table[row, 0], table[row, 1], table[row, 2]


@kernel
def larger(size, value):
    """Return the larger of a size and a value's magnitude; NaN if either is NaN."""
    magnitude = abs(value)
    return magnitude if magnitude > size or isnan(magnitude) else size


@inlined
def largest(values):
    """Return the largest magnitude of a vector; NaN if an entry is NaN."""
    size = 0.0
    for value in values:
        size = larger(size, value)
    return size


@kernel
def all_finite(values):
    """Return whether no entry is infinite or NaN."""
    for value in values:  # noqa: SIM110 - numba compiles no generator expression
        if not isfinite(value):
            return False
    return True


@kernel
def copy(source, target):
    """Copy ``source`` to ``target``, two vectors of one length."""
    for k in range(target.shape[0]):
        target[k] = source[k]


@inlined
def flush_denormals(y):
    """Replace entries below TINY by zero: with denormal numbers arithmetic is a hundred times slower."""
    for k in range(y.shape[0]):
        if abs(y[k]) < TINY:
            y[k] = 0.0


@kernel
def sort(values):
    """Sort values in increasing order, in place, by insertion."""
    for k in range(1, values.shape[0]):
        value, place = values[k], k
        for before in range(k - 1, -1, -1):
            if not values[before] > value:
                break
            values[place], place = values[before], before
        values[place] = value


@kernel
def add(a, b):
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@kernel
def subtract(a, b):
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def scale(s, a):
    """Return s a."""
    return s * a[0], s * a[1], s * a[2]


@kernel
def dot(a, b):
    """Return a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a, b):
    """Return a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def to_world(rotation, body, a):
    """Return a vector of the body's frame in world axes; ``rotation`` (nb + 1, 9) has rotation matrices by
    rows."""
    return (
        rotation[body, 0] * a[0] + rotation[body, 1] * a[1] + rotation[body, 2] * a[2],
        rotation[body, 3] * a[0] + rotation[body, 4] * a[1] + rotation[body, 5] * a[2],
        rotation[body, 6] * a[0] + rotation[body, 7] * a[1] + rotation[body, 8] * a[2],
    )


@kernel
def to_body(rotation, body, a):
    """Return a world vector in the body's frame."""
    return (
        rotation[body, 0] * a[0] + rotation[body, 3] * a[1] + rotation[body, 6] * a[2],
        rotation[body, 1] * a[0] + rotation[body, 4] * a[1] + rotation[body, 7] * a[2],
        rotation[body, 2] * a[0] + rotation[body, 5] * a[1] + rotation[body, 8] * a[2],
    )


@kernel
def put(table, row, column, a):
    """Write a three-vector into a row of a table (k, 3)."""
    table[row, column] = a[0]
    table[row, column + 1] = a[1]
    table[row, column + 2] = a[2]


@kernel
def accumulate(values, start, a):
    """Add a three-vector to three consecutive entries of a vector."""
    values[start] += a[0]
    values[start + 1] += a[1]
    values[start + 2] += a[2]
