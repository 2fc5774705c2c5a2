"""Error bounds of eigenvalues of small motions, from differences of two computations of their matrices."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import eig
from scipy.optimize import linear_sum_assignment

from crosscheck.judge.small_motions.equations import Small

ROUNDING = 1e-15  # relative error of the entries of the matrices, which are rounded to doubles
SAFETY = 4.0  # factor on the difference of two computations


def error_bounds(small: Small, others: Sequence[Small]) -> np.ndarray:
    """Return the largest error (2f,), 1/s, of each of the eigenvalues of small motions.

    With left and right eigenvectors w, v and errors F of the entries, the error is at most |w| F |v| / |w v|
    to first order, and at most its root where two eigenvalues meet.
    """
    values = small.eigenvalues()
    rate = float(np.abs(values).max(initial=0.0)) or 1.0
    matrix = small.matrix(rate)
    errors = ROUNDING * np.abs(matrix)
    for other in others:
        if len(other.mass) == len(small.mass):
            errors = errors + SAFETY * np.abs(other.matrix(rate) - matrix)
    found, left, right = eig(matrix, left=True, right=True)
    change = (np.abs(left) * (errors @ np.abs(right))).sum(axis=0)
    condition = np.abs((left.conj() * right).sum(axis=0))
    bounds = change / np.maximum(condition, np.sqrt(change / rate))
    rows, columns = linear_sum_assignment(np.abs(values[:, None] - found[None]))
    return np.asarray(bounds[columns[np.argsort(rows)]])
