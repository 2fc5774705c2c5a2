"""Formulations: what they claim works, what they do not claim fails with the right status."""

import numpy as np
import pytest

from crosscheck.judge.truth import closed_form
from mbref.formulations import FORMULATIONS
from mbref.kernels.layout import NOT_CONVERGED, OK, SINGULAR
from mbref.scenes import find_scene
from mbref.simulation.simulate import simulate
from tests.helpers.formulations import solve


def system(m, n, redundant, seed=20031):
    """Random M, Φ_q of rank m - redundant, g, consistent γ; and the exact solution by the KKT system.

    The same for the same arguments, whichever tests ran before.
    """
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
    """Ten times what 40 random systems of each kind measured: alf stops at a change of 1e-9 (2e-9), the
    others are off by rounding (6e-14)."""
    return 2e-8 if formulation.name == "alf" else 6e-13


@pytest.mark.parametrize("formulation", FORMULATIONS.values(), ids=FORMULATIONS)
@pytest.mark.parametrize("redundant", [0, 1, 4])
def test_formulation_solves_redundant_rows_exactly_if_it_claims_to_and_is_singular_otherwise(
    formulation, redundant
):
    """The truth is the dense KKT system of the independent rows, and the balance M q̈ + Φ_qᵀ λ = g."""
    mass, jacobian, force, gamma, exact = system(12, 18, redundant)
    status, acceleration, multipliers = solve(formulation, mass, jacobian, force, gamma)
    if formulation.needs_independent_columns or (redundant and not formulation.handles_redundancy):
        assert status == SINGULAR, f"{formulation.name} must refuse, status {status}"
        return
    assert status == OK
    error = np.max(np.abs(acceleration - exact))
    assert error < tolerance(formulation), f"{formulation.name}: acceleration differs by {error:.2e}"
    balance = np.max(np.abs(mass * acceleration + jacobian.T @ multipliers - force))
    assert balance < tolerance(formulation), f"{formulation.name}: M q̈ + Φ_qᵀ λ - g = {balance:.2e}"


@pytest.mark.parametrize("formulation", FORMULATIONS.values(), ids=FORMULATIONS)
@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_rescaled_or_repeated_row_of_a_random_system_changes_nothing(formulation, factor):
    mass, jacobian, force, gamma, exact = system(8, 15, 0)
    jacobian, gamma = jacobian.copy(), gamma.copy()
    jacobian[2] *= factor
    gamma[2] *= factor
    if formulation.handles_redundancy:
        jacobian, gamma = np.vstack([jacobian, jacobian[3]]), np.append(gamma, gamma[3])
    status, acceleration, multipliers = solve(formulation, mass, jacobian, force, gamma)
    if formulation.needs_independent_columns:
        assert status == SINGULAR
        return
    assert status == OK
    assert np.max(np.abs(acceleration - exact)) < tolerance(formulation), formulation.name
    reaction = force - mass * exact
    assert np.max(np.abs(jacobian.T @ multipliers - reaction)) < tolerance(formulation), formulation.name


@pytest.mark.parametrize("formulation", FORMULATIONS.values(), ids=FORMULATIONS)
def test_formulation_solves_a_singular_mass_matrix_if_it_claims_to_and_is_singular_otherwise(formulation):
    """The truth is the dense KKT system."""
    mass, jacobian, force, gamma, _ = system(10, 15, 0)
    mass[4] = 0.0
    kkt = np.block([[np.diag(mass), jacobian.T], [jacobian, np.zeros((10, 10))]])
    exact = np.linalg.solve(kkt, np.concatenate([force, gamma]))[:15]
    status, acceleration, _ = solve(formulation, mass, jacobian, force, gamma)
    if not formulation.handles_singular_mass:
        assert status == SINGULAR, f"{formulation.name} must refuse a singular M, status {status}"
        return
    error = np.max(np.abs(acceleration - exact))
    assert status == OK
    assert error < 1e-8, f"{formulation.name}: acceleration differs by {error:.2e}"


def test_literal_gram_schmidt_solves_a_system_of_independent_columns():
    """16 rows of rank 12 and 12 columns, as of a mechanism that drivers prescribe."""
    formulation = FORMULATIONS["mpi-gs-literal"]
    mass, jacobian, force, gamma, exact = system(16, 12, 4)
    status, acceleration, multipliers = solve(formulation, mass, jacobian, force, gamma)
    assert status == OK
    assert np.max(np.abs(acceleration - exact)) < 1e-9
    assert np.max(np.abs(mass * acceleration + jacobian.T @ multipliers - force)) < 1e-9


def test_five_iterations_of_a_small_penalty_are_too_few_for_alf_and_enough_for_alf_dual():
    """A penalty of 1e-3 converges slowly. `alf-dual` goes on by conjugate directions; the truth is by SVD."""
    mass, jacobian, force, gamma, _ = system(12, 18, 1)
    status, _, _ = solve(FORMULATIONS["alf"], mass, jacobian, force, gamma, alpha=1e-3, iterations=5.0)
    assert status == NOT_CONVERGED
    exact = solve(FORMULATIONS["mpi-svd"], mass, jacobian, force, gamma)
    found = solve(FORMULATIONS["alf-dual"], mass, jacobian, force, gamma, alpha=1e-3, iterations=5.0)
    assert found[0] == OK
    assert np.abs(found[1] - exact[1]).max() < 1e-9 * np.abs(exact[1]).max()


def test_accelerations_of_a_long_chain_by_alf_dual_are_exact_to_rounding():
    """The start of a chain of ten loops against the judge's closed form; long chains are ill-conditioned."""
    scene = find_scene("four_bar_chain[10]")
    found = simulate(scene, "alf-dual+none", [0.0]).acceleration
    exact = closed_form(scene).poses(np.zeros(1)).acceleration
    assert np.abs(found - exact).max() < 1e-12 * np.abs(exact).max()
