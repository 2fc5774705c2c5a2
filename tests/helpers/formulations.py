"""Solution of one system of equations of motion by a formulation."""

from typing import Any

import numpy as np

from mbref.formulations.base import Formulation
from mbref.kernels.compilation import entry, pointer_to
from mbref.kernels.layout import ACCELERATE, OperationCounts, Settings, SparseFactor, System
from mbref.kernels.named_memory import allocate, packed
from mbref.kernels.records import record
from mbref.linear_algebra.symbolic_factorisation import sparse_factor, symbolic_factorisation


@entry(ACCELERATE.return_type(pointer_to(ACCELERATE), *ACCELERATE.args))
def solved(accelerate, system):
    """Call a formulation's kernel, which need not be compiled again for Python."""
    return accelerate(system)


def solve(
    formulation: Formulation, mass: np.ndarray, jacobian: np.ndarray, force: np.ndarray, gamma: np.ndarray,
    rank_tolerance: float = 1e-10, **options: float,
) -> tuple[int, np.ndarray, np.ndarray]:  # fmt: skip
    """Return (status, q̈ (n,), λ (m,)); mass (n,) is the diagonal of M, jacobian (m, n). Status is one of
    ``layout.OK``, ``SINGULAR``, ``NOT_CONVERGED``."""
    m, n = jacobian.shape
    numbers = np.ascontiguousarray(jacobian, dtype=float)
    scratch = allocate(formulation.scratch, {"m": m, "n": n}) if formulation.scratch else _factor(numbers)
    mass = np.ascontiguousarray(mass, dtype=float)
    chosen = {**formulation.options, **options}
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
        counts=record(OperationCounts()),
        options=packed(record(formulation.numbers(**chosen))) if chosen else None,
        scratch=packed(scratch),
    )
    status: Any = solved(formulation.accelerate.pointer, packed(system).argument)
    return status, system.acceleration, system.multipliers


def _factor(jacobian: np.ndarray) -> SparseFactor:
    """Return memory of the sparse factor of a dense Jacobian (m, n)."""
    row, column = np.nonzero(jacobian)
    entry = row * jacobian.shape[1] + column
    return sparse_factor(symbolic_factorisation(row, column, entry, np.ones(jacobian.shape[1], dtype=bool)))
