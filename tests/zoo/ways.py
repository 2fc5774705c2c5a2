"""Linear solvers that make the example engine a fake engine with alternatives."""

import numpy as np
from scipy.linalg import solve_triangular
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from crosscheck.engine import Alternatives, Engine, Setting

RANK = 1e-11  # relative to the largest singular value
SHIFT, REFINED = 1e-9, 5  # proximal term on rows of unit length, and its iterations
NOTHING = 1e-13  # smaller entries are rounding
WAYS = ("least_squares", "by_islands", "factored", "corrected")


class Solver:
    """Solve for multipliers in one of four ways."""

    def begin(self, way: str) -> None:
        self.way, self.last = way, None

    def __call__(self, matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
        return getattr(self, self.way)(matrix, right)

    def least_squares(self, matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
        return np.linalg.lstsq(matrix, right, rcond=RANK)[0]

    def by_islands(self, matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
        count, label = connected_components(csr_array(np.abs(matrix) > NOTHING), directed=False)
        found = np.zeros(len(right))
        for k in range(count):
            own = np.flatnonzero(label == k)
            found[own] = self.least_squares(matrix[np.ix_(own, own)], right[own])
        return found

    def factored(self, matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
        left, found = matrix + SHIFT * np.eye(len(right)), np.zeros(len(right))
        for k in range(len(left)):
            left[k:, k] /= np.sqrt(left[k, k])
            below = k + 1 + np.flatnonzero(left[k + 1 :, k])
            front = np.ix_(below, below)
            left[front] -= np.outer(left[below, k], left[below, k])
        for _ in range(REFINED):
            half = solve_triangular(left, right - matrix @ found, lower=True)
            found = found + solve_triangular(left, half, lower=True, trans="T")
        return found

    def corrected(self, matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
        """Correct the solution before."""
        before = np.zeros(len(right)) if self.last is None else self.last
        self.last = before + self.least_squares(matrix, right - matrix @ before)
        return self.last


def several_ways(example: type[Engine], solver: Solver) -> Engine:
    """Return an engine like the example with alternatives, whose equations call the solver."""

    class SeveralWays(example):
        name = "several ways"
        alternatives = (
            Alternatives({way: Setting("dop853", {"rtol": 1e-9, "way": way}) for way in WAYS}, 1e-8),
        )

        def run(self, scene, times, setting):
            solver.begin(setting.options.get("way", WAYS[0]))
            return super().run(scene, times, setting)

    return SeveralWays()
