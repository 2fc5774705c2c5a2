"""Factorisations on matrices of known rank: Penrose identities, ranks, and the formulations' agreement."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mbref.formulations import FORMULATIONS
from mbref.linalg import cholesky_factor, cholesky_solve, full_pivot, lu_factor, lu_solve
from mbref.orthogonal import minimum_norm, pinv_gram_schmidt, pinv_svd, qr_pivoted
from mbref.tables import OK

RATIO = 30.0  # LAPACK's customary bound for ‖residual‖ / (ε n ‖…‖) of a stable algorithm
PSEUDO_INVERSES = {"svd": pinv_svd, "gram_schmidt": pinv_gram_schmidt}


@st.composite
def matrices(draw, most=40, condition=1e12):
    """(matrix m x n, its rank): random orthogonal factors, singular values from 1 to 1/condition, then 0."""
    m, n = draw(st.integers(1, most)), draw(st.integers(1, most))
    rank = draw(st.integers(1, min(m, n)))
    exponents = draw(st.floats(0, np.log10(condition)))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    u = np.linalg.qr(rng.normal(size=(m, m)))[0][:, :rank]
    v = np.linalg.qr(rng.normal(size=(n, n)))[0][:, :rank]
    values = 10 ** -np.linspace(0, exponents, rank) if rank > 1 else np.ones(1)
    return (u * values) @ v.T, rank, values


def norm(a):
    return np.linalg.norm(a, 2)


@pytest.mark.parametrize("name", PSEUDO_INVERSES)
@given(case=matrices(condition=1e8))
def test_penrose_identities(name, case):
    d, rank, _ = case
    inverse, found = PSEUDO_INVERSES[name](d, 1e-11)
    assert found == rank, f"{name}: rank {found}, made with {rank}"
    unit = np.finfo(float).eps * max(d.shape)
    scale = norm(d) * norm(inverse)  # the condition number enters each identity once
    ratios = {
        "D D⁺ D = D": norm(d @ inverse @ d - d) / (unit * norm(d) * scale),
        "D⁺ D D⁺ = D⁺": norm(inverse @ d @ inverse - inverse) / (unit * norm(inverse) * scale),
        "D D⁺ symmetric": norm(d @ inverse - (d @ inverse).T) / (unit * scale),
        "D⁺ D symmetric": norm(inverse @ d - (inverse @ d).T) / (unit * scale),
    }
    worst = max(ratios, key=ratios.get)
    assert ratios[worst] < RATIO, f"{name}, {worst}: {ratios[worst]:.1f}, condition {scale:.1e}"


@given(case=matrices(condition=1e12))
def test_penrose_identities_up_to_condition_1e12_by_svd(case):
    d, rank, _ = case
    inverse, found = pinv_svd(d, 1e-14)
    assert found == rank
    unit = np.finfo(float).eps * max(d.shape) * norm(d) * norm(inverse)
    assert norm(d @ inverse @ d - d) < RATIO * unit * norm(d)
    assert norm(inverse @ d @ inverse - inverse) < RATIO * unit * norm(inverse)


@given(case=matrices(condition=1e4), noise=st.floats(0, 1e-13))
def test_nearly_deficient_rank_and_full_pivoting(case, noise):
    d, rank, _ = case
    rng = np.random.default_rng(7)
    a = np.ascontiguousarray(d + noise * rng.normal(size=d.shape))
    m, n = a.shape
    rows, columns = np.zeros(m, dtype=np.int64), np.zeros(n, dtype=np.int64)
    found = full_pivot(a.copy(), m, n, rows, columns, 1e-9)
    assert found == rank, f"full pivoting found rank {found}, made with {rank}"
    block = d[np.ix_(rows[:rank], columns[:rank])]
    smallest = np.linalg.svd(block, compute_uv=False)[-1]
    assert smallest > 1e-9, f"the rows and columns chosen are dependent: {smallest:.1e}"


@given(case=matrices(condition=1e6))
def test_least_norm_by_qr_and_by_svd(case):
    d, rank, _ = case
    m, n = d.shape
    rhs = d @ np.random.default_rng(3).normal(size=n)
    b, order = d.T.copy(), np.zeros(m, dtype=np.int64)
    tau, norms, work, x = np.zeros(m), np.zeros((2, m)), np.zeros(m), np.zeros(n)
    found = qr_pivoted(b, n, m, order, tau, norms, work, 1e-10)
    assert found == rank
    minimum_norm(b, n, found, order, tau, rhs, x)
    exact = np.linalg.lstsq(d, rhs, rcond=1e-10)[0]
    error = norm_of(x - exact) / max(1e-300, norm_of(exact))
    allowed = 1e-13 * np.linalg.cond(d) if rank == min(m, n) else 1e-13 * 1e6 * 30
    assert error < max(allowed, 1e-12), f"relative difference {error:.1e}"


def norm_of(v):
    return np.linalg.norm(v)


@given(n=st.integers(1, 30), seed=st.integers(0, 2**32 - 1))
def test_lu_and_cholesky_solve(n, seed):
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(n, n)) + n * np.eye(n)
    x = rng.normal(size=n)
    b, lu, pivots = a @ x, a.copy(), np.zeros(n, dtype=np.int64)
    assert lu_factor(lu, n, pivots, 0.0)
    lu_solve(lu, n, pivots, b)
    assert norm_of(b - x) < 1e-12 * np.linalg.cond(a) * norm_of(x)
    spd = a @ a.T
    b, factor = spd @ x, spd.copy()
    assert cholesky_factor(factor, n, 0.0)
    cholesky_solve(factor, n, b)
    assert norm_of(b - x) < 1e-12 * np.linalg.cond(spd) * norm_of(x)


@given(seed=st.integers(0, 2**32 - 1), m=st.integers(1, 20), freedoms=st.integers(0, 20))
def test_formulations_agree_where_all_apply(seed, m, freedoms):
    rng = np.random.default_rng(seed)
    n = m + freedoms
    jacobian = rng.normal(size=(m, n)) + np.eye(m, n) * 3
    mass, force, gamma = rng.uniform(0.1, 10, n), rng.normal(size=n), rng.normal(size=m)
    found = {}
    for name, formulation in FORMULATIONS.items():
        if formulation.needs_independent_columns and freedoms:
            continue
        status, acceleration, _ = formulation.solve(mass, jacobian, force, gamma)
        if status == OK:
            found[name] = acceleration
    assert {"lm1", "lm2", "alf-dual", "mpi-svd", "mpi-gs", "mpi-qr"} <= set(found), sorted(found)
    scale = max(1.0, norm_of(found["mpi-svd"]))
    for name, acceleration in found.items():
        error = norm_of(acceleration - found["mpi-svd"]) / scale
        assert error < 1e-9, f"{name} and mpi-svd differ by {error:.1e}"
