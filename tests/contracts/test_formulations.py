"""Formulations solve the systems that they claim to solve, to rounding and whatever the rows' lengths."""

from typing import Any

import numpy as np
import pytest

from crosscheck.judge.truth import closed_form
from mbref.formulations import FORMULATIONS
from mbref.formulations.base import Formulation
from mbref.kernels.compilation import entry, pointer_to
from mbref.kernels.layout import (
    ACCELERATE,
    NOT_CONVERGED,
    OK,
    OperationCounts,
    Settings,
    SparseFactor,
    System,
)
from mbref.kernels.named_memory import allocate, packed
from mbref.kernels.records import record
from mbref.linear_algebra.symbolic_factorisation import sparse_factor, symbolic_factorisation
from mbref.scenes import find_scene
from mbref.simulation.simulate import simulate


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


def system(m, n, redundant, seed=20031):
    """Return random M, Φ_q (m, n) of rank m - redundant, g, a consistent γ, and q̈ by the KKT system."""
    rng = np.random.default_rng([m, n, redundant, seed])
    mass = rng.uniform(0.1, 10, n)
    jacobian = rng.normal(size=(m, n))
    if redundant:
        mix = rng.normal(size=(redundant, m - redundant))
        jacobian[m - redundant :] = mix @ jacobian[: m - redundant]
    force, wanted = rng.normal(size=n), rng.normal(size=n)
    gamma = jacobian @ wanted
    independent = jacobian[: m - redundant]
    k = len(independent)
    kkt = np.block([[np.diag(mass), independent.T], [independent, np.zeros((k, k))]])
    exact = np.linalg.solve(kkt, np.concatenate([force, gamma[:k]]))[:n]
    return mass, jacobian, force, gamma, exact


def tolerance(formulation):
    """Ten times what 40 random systems of each kind measured: alf 2e-9, the others rounding, 6e-14."""
    return 2e-8 if formulation.name == "alf" else 6e-13


@pytest.mark.parametrize(
    "formulation",
    [each for each in FORMULATIONS.values() if not each.needs_independent_columns],
    ids=lambda each: each.name,
)
@pytest.mark.parametrize("factor", [1e-6, 1.0, 1e6])
def test_acceleration_and_reactions_do_not_depend_on_the_length_or_repetition_of_a_row(formulation, factor):
    """The truth is the dense KKT system of the rows as they were: q̈, and reactions Φ_qᵀ λ = g - M q̈. A row
    is repeated if the formulation claims to solve redundant rows."""
    mass, jacobian, force, gamma, exact = system(8, 15, 0)
    jacobian, gamma = jacobian.copy(), gamma.copy()
    jacobian[2] *= factor
    gamma[2] *= factor
    if formulation.handles_redundancy:
        jacobian, gamma = np.vstack([jacobian, jacobian[3]]), np.append(gamma, gamma[3])
    status, acceleration, multipliers = solve(formulation, mass, jacobian, force, gamma)
    assert status == OK
    assert np.max(np.abs(acceleration - exact)) < tolerance(formulation), formulation.name
    reaction = force - mass * exact
    assert np.max(np.abs(jacobian.T @ multipliers - reaction)) < tolerance(formulation), formulation.name


def test_five_iterations_of_a_small_penalty_are_too_few_for_alf_and_enough_for_alf_dual():
    """A penalty of 1e-3 converges slowly. `alf-dual` goes on by conjugate directions, to rounding; the truth
    is the dense KKT system of the independent rows."""
    mass, jacobian, force, gamma, exact = system(12, 18, 1)
    status, _, _ = solve(FORMULATIONS["alf"], mass, jacobian, force, gamma, alpha=1e-3, iterations=5.0)
    assert status == NOT_CONVERGED
    dual = FORMULATIONS["alf-dual"]
    status, found, _ = solve(dual, mass, jacobian, force, gamma, alpha=1e-3, iterations=5.0)
    assert status == OK and np.abs(found - exact).max() < tolerance(dual)


def test_accelerations_of_a_long_chain_by_alf_dual_are_exact_to_rounding():
    """A chain of ten loops has a closed form; its condition may magnify the rounding 1e-16 by 1e4."""
    rounding = 1e-16 * 1e4  # of the largest acceleration
    scene = find_scene("four_bar_chain[10]")
    found = simulate(scene, "alf-dual+none", [0.0]).acceleration
    exact = closed_form(scene).poses(np.zeros(1)).acceleration
    assert np.abs(found - exact).max() < rounding * np.abs(exact).max()
