"""Interface of formulations, which compute accelerations and multipliers from M, Φ_q, g and γ."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np

from mbref.kernels.compilation import Exchangeable
from mbref.kernels.layout import Counts, Settings, SparseFactor, System
from mbref.kernels.named_memory import Packed, allocate, packed
from mbref.kernels.records import record
from mbref.linear_algebra.symbolic_factorisation import sparse_factor, symbolic_factorisation


class NoOptions(NamedTuple):
    """A formulation without numbers of its own."""


class About(NamedTuple):
    """Texts on a formulation, for `mbref list` and the pages of the documentation."""

    title: str
    meaning: str  # one line for `mbref list methods`
    formula: str  # LaTeX
    text: str  # equations of the source, in a sentence
    use: str  # situations that the formulation suits
    fails: str


class LinearAlgebra(ABC):
    """Interface: which Jacobian a formulation reads, and the memory that its kernel needs."""

    sparse: bool

    @abstractmethod
    def rows(self, m: int) -> int:
        """Return the number of rows of the dense Jacobian that the kernel reads: m or 0."""

    @abstractmethod
    def scratch(self, m: int, n: int, factor: SparseFactor | None) -> Any:
        """Return the kernel's memory for m rows, n velocities and a sparse factor if one is used."""

    @abstractmethod
    def factor_of(self, jacobian: np.ndarray) -> SparseFactor | None:
        """Return memory of the sparse factor of one dense Jacobian (m, n), if one is used."""


@dataclass(frozen=True)
class Dense(LinearAlgebra):
    """The kernel reads the dense Jacobian; ``memory`` is the schema of its working memory."""

    memory: type
    sparse = False

    def rows(self, m: int) -> int:
        return m

    def scratch(self, m: int, n: int, factor: SparseFactor | None) -> Any:
        return allocate(self.memory, {"m": m, "n": n})

    def factor_of(self, jacobian: np.ndarray) -> SparseFactor | None:
        return None


@dataclass(frozen=True)
class Sparse(LinearAlgebra):
    """The kernel reads the nonzero numbers of the Jacobian, whose positions a sparse factor has.

    The cost is proportional to the number of joints.
    """

    sparse = True

    def rows(self, m: int) -> int:
        return 0

    def scratch(self, m: int, n: int, factor: SparseFactor | None) -> Any:
        return factor

    def factor_of(self, jacobian: np.ndarray) -> SparseFactor | None:
        row, column = np.nonzero(jacobian)
        entry = row * jacobian.shape[1] + column
        everything = np.ones(jacobian.shape[1], dtype=bool)
        return sparse_factor(symbolic_factorisation(row, column, entry, everything))


@dataclass(frozen=True)
class Formulation:
    """A method of solving M q̈ + Φ_qᵀ λ = g, Φ_q q̈ = γ (Eqs. 3 and 4), with its claims as data.

    ``accelerate(system) -> status`` is a kernel that reads a ``layout.System`` and writes its acceleration
    and multipliers; the kernel reads the terms only, never the scene.
    """

    name: str
    about: About
    equations: str  # equation numbers of the paper
    accelerate: Exchangeable
    linear_algebra: LinearAlgebra
    handles_redundancy: bool
    handles_singular_mass: bool
    crosses: Literal["no", "by regularisation"] = (
        "no"  # how the formulation crosses a singular position if no stabilisation ends the run
    )
    # True if the formulation needs as many independent rows as coordinates, so no degree of freedom
    needs_independent_columns: bool = False
    # True if dependent rows must not be left out, because the formulation selects or weights rows itself
    needs_all_rows: bool = False
    numbers: type = NoOptions  # record of the method's own numbers with their defaults
    feedback: Callable[[Mapping[str, float]], tuple[float, float]] | None = None  # gains of Φ' and Φ in γ

    @cached_property
    def options(self) -> Mapping[str, float]:
        """Names and defaults of the method's numbers."""
        return self.numbers()._asdict()

    def packed_options(self, options: Mapping[str, float]) -> Packed | None:
        """Return the method's numbers for its kernel."""
        if not self.options:
            return None
        return packed(record(self.numbers(**{**self.options, **options})))

    def solve(
        self, mass: np.ndarray, jacobian: np.ndarray, force: np.ndarray, gamma: np.ndarray,
        rank_tolerance: float = 1e-10, **options: float,
    ) -> tuple[int, np.ndarray, np.ndarray]:  # fmt: skip
        """Return (status, q̈ (n,), λ (m,)) of one system; mass (n,) is the diagonal of M, jacobian (m, n).

        Status is one of ``layout.OK``, ``SINGULAR``, ``NOT_CONVERGED``.
        """
        m, n = jacobian.shape
        numbers, factor = np.ascontiguousarray(jacobian, dtype=float), self.linear_algebra.factor_of(jacobian)
        mass = np.ascontiguousarray(mass, dtype=float)
        system = System(
            mass=mass,
            inverse_root=1 / np.sqrt(np.where(mass > 0, mass, 1.0)),
            force=np.ascontiguousarray(force, dtype=float),
            acceleration=np.zeros(n),
            blocks=numbers,
            jacobian=numbers,
            rhs=np.ascontiguousarray(gamma, dtype=float),
            multipliers=np.zeros(m),
            settings=record(Settings(rank_tolerance=rank_tolerance)),
            counts=record(Counts()),
            options=self.packed_options(options),
            scratch=packed(self.linear_algebra.scratch(m, n, factor)),
        )
        status: Any = self.accelerate.callable(packed(system).argument)
        return status, system.acceleration, system.multipliers
