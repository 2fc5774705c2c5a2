"""Combinations of numbers that residuals do not determine, by singular values of their Jacobian."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

# singular value of the scaled Jacobian / largest one, below which a combination is not determined
INDETERMINATE = 1e-6
PART_OF_COMBINATION = 1e-3  # weight of a number in such a unit combination from which it takes part


class SingularDirections(NamedTuple):
    """Singular values (p,) of a Jacobian (r, p), its right vectors (p, p) as rows, and which are determined
    (p,)."""

    values: np.ndarray
    right: np.ndarray
    known: np.ndarray

    @staticmethod
    def of(jacobian: np.ndarray, rounding: float) -> SingularDirections:
        """Return the directions of a Jacobian in numbers over their sizes; singular values below ``rounding``
        are zero."""
        p = jacobian.shape[1]
        _, found, right = np.linalg.svd(jacobian, full_matrices=True)
        values = np.zeros(p)
        values[: len(found)] = found
        return SingularDirections(
            values, right, values > max(INDETERMINATE * values.max(initial=0.0), rounding)
        )

    def undetermined(self, names: Sequence[str]) -> tuple[dict[str, float], ...]:
        """Return the unit combinations that are not determined, by the names of their parts."""
        return tuple(
            {name: x for name, x in zip(names, row.tolist(), strict=True) if abs(x) > PART_OF_COMBINATION}
            for row in self.right[~self.known]
        )
