"""Three-vectors as tuples, for the kernels: compiled they cost nothing and allocate nothing.

And what kernels do with whole vectors: copies, for which numba's slices allocate, order, and ``larger``.
"""

from __future__ import annotations

from numpy import isnan

from mbref.kernels.compilation import kernel
from mbref.kernels.layout import ROTATION


@kernel
def vector(table, row, column):
    """Three consecutive entries of a row."""
    return table[row, column], table[row, column + 1], table[row, column + 2]


@kernel
def larger(size, value):
    """The larger of a size and a value's magnitude; undefined where either is."""
    magnitude = abs(value)
    return magnitude if magnitude > size or isnan(magnitude) else size


@kernel
def copy(source, target):
    """``target`` := ``source``, two vectors of one length."""
    for k in range(target.shape[0]):
        target[k] = source[k]


@kernel
def copy_rows(source, target):
    """``target`` := ``source``, two matrices of one shape."""
    for k in range(source.shape[0]):
        copy(source[k], target[k])


@kernel
def sort(values):
    """Put values in increasing order, in place, by insertion."""
    for k in range(1, values.shape[0]):
        value, place = values[k], k
        while place > 0 and values[place - 1] > value:
            values[place] = values[place - 1]
            place -= 1
        values[place] = value


@kernel
def add(a, b):
    """a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@kernel
def subtract(a, b):
    """a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def scale(s, a):
    """s a."""
    return s * a[0], s * a[1], s * a[2]


@kernel
def dot(a, b):
    """a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a, b):
    """a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def to_world(frames, body, a):
    """A vector of the body's frame in the world."""
    r = ROTATION
    return (
        frames[body, r] * a[0] + frames[body, r + 1] * a[1] + frames[body, r + 2] * a[2],
        frames[body, r + 3] * a[0] + frames[body, r + 4] * a[1] + frames[body, r + 5] * a[2],
        frames[body, r + 6] * a[0] + frames[body, r + 7] * a[1] + frames[body, r + 8] * a[2],
    )


@kernel
def to_body(frames, body, a):
    """A vector of the world in the body's frame."""
    r = ROTATION
    return (
        frames[body, r] * a[0] + frames[body, r + 3] * a[1] + frames[body, r + 6] * a[2],
        frames[body, r + 1] * a[0] + frames[body, r + 4] * a[1] + frames[body, r + 7] * a[2],
        frames[body, r + 2] * a[0] + frames[body, r + 5] * a[1] + frames[body, r + 8] * a[2],
    )


@kernel
def put(table, row, column, a):
    """Write a three-vector into a row."""
    table[row, column] = a[0]
    table[row, column + 1] = a[1]
    table[row, column + 2] = a[2]


@kernel
def put_negative(table, row, column, a):
    """Write minus a three-vector into a row."""
    table[row, column] = -a[0]
    table[row, column + 1] = -a[1]
    table[row, column + 2] = -a[2]


@kernel
def accumulate(values, start, a):
    """Add a three-vector to three consecutive entries of a vector."""
    values[start] += a[0]
    values[start + 1] += a[1]
    values[start + 2] += a[2]
