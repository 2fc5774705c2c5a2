"""Formulation: how accelerations and multipliers follow from M, Φ_q, g and γ."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from mbref.kernels.compilation import Exchangeable
from mbref.kernels.layout import FORMULATION_OPTIONS, NEWTON_TOLERANCE, RANK_TOLERANCE


@dataclass(frozen=True)
class Formulation:
    """A method of solving M q̈ + Φ_qᵀ λ = g, Φ_q q̈ = γ (Eqs. 3 and 4), with its claims as data.

    ``accelerate(mass (n,), inverse_root (n,), jacobian (m, n), force (n,), rhs (m,), settings,
    scratch, pivots, counts, acceleration (n,), multipliers (m,)) -> status`` is a kernel that writes its
    last two arguments; it sees the terms only, never the scene.
    """

    name: str
    equations: str  # of the paper
    accelerate: Exchangeable
    scratch: Callable[[int, int], int]  # numbers of working memory for m rows, n columns
    handles_redundancy: bool
    handles_singular_mass: bool
    needs_independent_columns: bool = False  # works only where no freedom is left
    iterative: bool = False
    sparse: bool = False  # runs go through the kernels of mbref.sparse, the same iteration
    pivots_by_size: bool = False  # its operations depend on the state and cannot be laid down beforehand
    options: Mapping[str, float] = field(default_factory=dict)  # the method's numbers and their defaults
    feedback: Callable[[Mapping[str, float]], tuple[float, float]] | None = None  # gains of Φ' and Φ in γ

    def settings(self, options: Mapping[str, float], rank_tolerance: float) -> np.ndarray:
        """The settings vector of the kernels, without stabilisation."""
        values = np.zeros(FORMULATION_OPTIONS + len(self.options))
        values[RANK_TOLERANCE], values[NEWTON_TOLERANCE] = rank_tolerance, 1e-13
        values[FORMULATION_OPTIONS:] = [options.get(k, default) for k, default in self.options.items()]
        return values

    def solve(
        self, mass: np.ndarray, jacobian: np.ndarray, force: np.ndarray, gamma: np.ndarray,
        rank_tolerance: float = 1e-10, **options: float,
    ) -> tuple[int, np.ndarray, np.ndarray]:  # fmt: skip
        """(status, q̈ (n,), λ (m,)) of one system; mass (n,) is the diagonal of M, jacobian (m, n).

        Status is one of ``tables.OK``, ``SINGULAR``, ``NOT_CONVERGED``.
        """
        m, n = jacobian.shape
        mass = np.ascontiguousarray(mass, dtype=float)
        inverse_root = 1 / np.sqrt(np.where(mass > 0, mass, 1.0))
        acceleration, multipliers = np.zeros(n), np.zeros(m)
        status = self.accelerate.callable(
            mass, inverse_root, np.ascontiguousarray(jacobian, dtype=float),
            np.ascontiguousarray(force, dtype=float), np.ascontiguousarray(gamma, dtype=float),
            self.settings(options, rank_tolerance), np.zeros(self.scratch(m, n)),
            np.zeros(2 * (m + n), dtype=np.int64), np.zeros(6, dtype=np.int64), acceleration, multipliers,
        )  # fmt: skip
        return status, acceleration, multipliers
