"""Accelerations and multipliers by ``mbref.formulations`` / by hand, or by dense algebra of small systems.

``test_thresholds.py`` runs this file in a process whose kernels are interpreted, so that nothing is compiled.
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref.kernels.compilation import PLAIN

if not PLAIN:
    pytest.skip("kernels are interpreted by test_thresholds.py", allow_module_level=True)

from mbref.formulations import (
    FORMULATIONS,
    alf,
    alf_dual,
    lm1,
    lm2,
    moore_penrose,
    mpi_gs,
    mpi_gs_literal,
    mpi_qr,
    mpi_svd,
)
from mbref.kernels.layout import NOT_CONVERGED, NOT_FINITE, OK, SINGULAR
from mbref.kernels.named_memory import allocate
from mbref.linear_algebra.symbolic_factorisation import sparse_factor, symbolic_factorisation

MASS, FORCE = np.array([2.0, 0.5, 8.0, 1.0]), np.array([1.0, -3.0, 4.0, 0.5])
ROWS, GAMMA = np.array([[3.0, 1.0, 0.0, -2.0], [0.0, 2.0, 5.0, 1.0]]), np.array([4.0, -1.5])
REDUNDANT, BOTH = np.vstack([ROWS, ROWS[0] - ROWS[1]]), np.array([4.0, -1.5, 5.5])
MODULES = {
    "lm1": lm1,
    "lm2": lm2,
    "alf": alf,
    "alf-dual": alf_dual,
    "mpi-svd": mpi_svd,
    "mpi-gs": mpi_gs,
    "mpi-gs-literal": mpi_gs_literal,
    "mpi-qr": mpi_qr,
}


def exact(mass: np.ndarray, rows: np.ndarray, gamma: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Accelerations and multipliers of least norm: M q̈ + Φ_qᵀ λ = g, Φ_q q̈ = γ."""
    m, n = rows.shape
    full = np.block([[np.diag(mass), rows.T], [rows, np.zeros((m, m))]])
    found = np.linalg.pinv(full, rcond=1e-12) @ np.concatenate([FORCE[:n], gamma])
    return found[:n], found[n:]


def sparse(rows: np.ndarray) -> Any:
    """Memory of the sparse factor of rows, filled with old numbers."""
    row, column = np.nonzero(rows)
    entry = row * rows.shape[1] + column
    made = sparse_factor(symbolic_factorisation(row, column, entry, np.ones(rows.shape[1], dtype=bool)))
    for name in ("d", "root", "l", "step", "total", "residual", "change", "diagonal", "direction"):
        getattr(made, name)[:] = 7.0
    return made


def system(name: str, mass: Any = MASS, rows: np.ndarray = ROWS, gamma: Any = GAMMA, **options: float) -> Any:
    """A system for a formulation, whose memory has old numbers."""
    formulation, (m, n) = FORMULATIONS[name], rows.shape
    scratch = sparse(rows)
    if formulation.scratch:
        scratch = allocate(formulation.scratch, {"m": m, "n": n})
        for array in scratch:
            array[:] = 7
    given = np.array(mass, dtype=float)
    return SimpleNamespace(
        mass=given,
        inverse_root=1 / np.sqrt(np.where(given > 0, given, 1.0)),
        force=FORCE[:n].copy(),
        acceleration=np.full(n, 7.0),
        blocks=rows.copy(),
        jacobian=rows.copy(),
        rhs=np.array(gamma, dtype=float),
        multipliers=np.full(m, 7.0),
        scratch=scratch,
        counts=SimpleNamespace(factorisations=3),
        settings=SimpleNamespace(rank_tolerance=1e-9, independent=0, nearly_dependent=0),
        options=SimpleNamespace(**{**formulation.options, **options}),
    )


SOME = [name for name in FORMULATIONS if name != "mpi-gs-literal"]


@pytest.mark.parametrize("name", SOME)
def test_independent_rows_have_one_solution(name):
    made = system(name)
    assert MODULES[name].accelerate.function(made) == OK and made.counts.factorisations == 4
    acceleration, multipliers = exact(MASS, ROWS, GAMMA)
    assert made.acceleration == pytest.approx(acceleration, rel=1e-6)
    assert made.multipliers == pytest.approx(multipliers, rel=1e-6)


def test_the_printed_equations_need_as_many_rows_as_coordinates():
    rows, gamma = np.array([[3.0, 1.0], [0.0, 2.0], [1.0, -1.0]]), np.array([4.0, -2.0, 2.5])
    gamma = rows @ [1.5, -0.5]
    made = system("mpi-gs-literal", MASS[:2], rows, gamma)
    assert mpi_gs_literal.accelerate.function(made) == OK and made.counts.factorisations == 4
    assert made.acceleration == pytest.approx([1.5, -0.5])
    assert MASS[:2] * made.acceleration + rows.T @ made.multipliers == pytest.approx(FORCE[:2])
    lengths = np.sqrt((rows**2 / MASS[:2]).sum(axis=1))
    unit = rows / lengths[:, None]
    least = np.linalg.pinv(unit.T) @ (FORCE[:2] - MASS[:2] * [1.5, -0.5])
    assert made.multipliers == pytest.approx(least / lengths), "least in unit rows"
    assert mpi_gs_literal.accelerate.function(system("mpi-gs-literal")) == SINGULAR


@pytest.mark.parametrize("name", [name for name in SOME if FORMULATIONS[name].handles_redundancy])
def test_redundant_rows(name):
    made = system(name, rows=REDUNDANT, gamma=BOTH)
    assert MODULES[name].accelerate.function(made) == OK
    acceleration, _ = exact(MASS, ROWS, GAMMA)
    assert made.acceleration == pytest.approx(acceleration, rel=1e-6)
    assert MASS * acceleration + REDUNDANT.T @ made.multipliers == pytest.approx(FORCE, rel=1e-5, abs=1e-5)
    lengths = np.sqrt((REDUNDANT**2 / MASS).sum(axis=1))
    unit = REDUNDANT / lengths[:, None]
    least = np.linalg.pinv(unit.T) @ (FORCE - MASS * acceleration) / lengths
    if name == "mpi-qr":
        assert np.count_nonzero(made.multipliers) == 2
    else:
        assert made.multipliers == pytest.approx(least, rel=1e-4), "least in unit rows"


@pytest.mark.parametrize("name", ["lm1", "lm2"])
def test_redundant_rows_that_are_refused(name):
    made = system(name, rows=REDUNDANT, gamma=BOTH)
    assert MODULES[name].accelerate.function(made) == SINGULAR and made.counts.factorisations == 4


@pytest.mark.parametrize("name", SOME)
def test_bodies_without_mass(name):
    """The third coordinate has no mass; its row determines its acceleration."""
    mass = np.array([2.0, 0.5, 0.0, 1.0])
    made = system(name, mass)
    if not FORMULATIONS[name].handles_singular_mass:
        assert MODULES[name].accelerate.function(made) == SINGULAR
        return
    assert MODULES[name].accelerate.function(made) == OK
    acceleration, multipliers = exact(mass, ROWS, GAMMA)
    assert made.acceleration == pytest.approx(acceleration, rel=1e-5)
    assert made.multipliers == pytest.approx(multipliers, rel=1e-5)


def test_a_jacobian_that_is_no_number():
    assert mpi_svd.accelerate.function(system("mpi-svd", rows=ROWS * math.nan)) == NOT_FINITE


# --- LM1 and LM2 ------------------------------------------------------------------------------------------
def test_the_factor_of_the_schur_complement():
    """Columns of M^(-1/2) Φ_qᵀ: rows (3, 0) and (4, 5); the third has no place."""
    s, diagonal = np.full((2, 2), 7.0), np.full(2, 7.0)
    assert lm2.factor_schur_complement(2, np.array([[3.0, 4.0], [0.0, 5.0]]), s, diagonal)
    assert diagonal.tolist() == [9.0, 41.0]
    assert s[0, 0] == pytest.approx(1 / 9) and s[0, 1] == pytest.approx(12 / 9)
    assert s[1, 1] == pytest.approx(1 / 25)
    for part, good in ((0.9, False), (1.1, True)):
        side = math.sqrt(part * 1e-11)
        dt = np.array([[1.0, 1.0], [0.0, side]])
        assert lm2.factor_schur_complement(2, dt, s, diagonal) is good, part
    assert not lm2.factor_schur_complement(2, np.array([[1.0, 0.0], [0.0, 0.0]]), s, diagonal)


# --- ALF --------------------------------------------------------------------------------------------------
def test_change_of_accelerations():
    """3-4-5 relative to 1, and to a norm of 10."""
    assert alf.changed(np.array([0.1, 0.0]), np.array([0.4, 0.4])) == pytest.approx(0.5)
    assert alf.changed(np.array([6.0 - 3.0, 4.0]), np.array([6.0, 8.0])) == pytest.approx(0.5)


def test_the_augmented_matrix():
    a, d = np.full((3, 3), 7.0), np.array([[1.0, 0.0, 2.0], [3.0, 4.0, 0.0]])
    mass, root = np.array([4.0, 0.0, 9.0]), np.array([0.5, 1.0, 0.5])
    alf.augmented(mass, root, d, 10.0, a)
    full = np.diag([1.0, 0.0, 2.25]) + 10 * d.T @ d
    assert (
        np.triu(a) == pytest.approx(np.triu(full))
        and (np.tril(a, -1) == np.tril(7.0 * np.ones((3, 3)), -1)).all()
    )


def test_an_iteration_of_the_penalty():
    """x = (M + α DᵀD)⁻¹ (load + α Dᵀ γ) and λ += α (D x - γ), of one row (0.6, 0.8) and α = 3."""
    d, load, gamma = np.array([[0.6, 0.8]]), np.array([1.0, 2.0]), np.array([0.5])
    matrix = np.eye(2) + 3 * d.T @ d
    made = SimpleNamespace(
        d=d, matrix=np.triu(matrix), load=load, x=np.zeros(2), scaled=gamma, total=np.ones(1)
    )
    assert alf.cholesky_factor(made.matrix, 2)
    alf.iterate(3.0, made)
    x = np.linalg.solve(matrix, load + 3 * d[0] * 0.5)
    assert made.x == pytest.approx(x) and made.total == pytest.approx(1 + 3 * (d @ x - gamma))
    assert load.tolist() == [1.0, 2.0]


@pytest.mark.parametrize(
    ("epsilon", "iterations", "status", "count"),
    [(0.5, 9.0, OK, 2), (0.49, 9.0, OK, 3), (0.49, 2.0, NOT_CONVERGED, 2), (9.0, 9.0, OK, 1)],
)
def test_iterations_of_the_penalty(monkeypatch, epsilon, iterations, status, count):
    """Solutions 2, 4 and 5 of a body of 4 kg: x is divided by its root, the next load is x itself."""
    answers, loads = iter((2.0, 4.0, 5.0)), []

    def iterate(alpha: float, scratch: Any) -> None:
        loads.append((alpha, scratch.load[0], scratch.scaled[0], scratch.total[0]))
        scratch.x[0] = next(answers)
        scratch.total[0] += 1.0

    monkeypatch.setattr(alf, "iterate", iterate)
    made = system("alf", [4.0], np.array([[3.0]]), [6.0], alpha=7.0, epsilon=epsilon, iterations=iterations)
    assert alf.accelerate.function(made) == status and len(loads) == count
    assert loads == [(7.0, *rest) for rest in ((0.5, 4.0, 0.0), (2.0, 4.0, 1.0), (4.0, 4.0, 2.0))[:count]]
    assert made.acceleration.tolist() == [(1.0, 2.0, 2.5)[count - 1]]
    assert made.multipliers == pytest.approx([count / 1.5])


def test_a_penalty_without_a_factor():
    made = system("alf", [0.0, 1.0], np.array([[0.0, 1.0]]), [1.0])
    assert alf.accelerate.function(made) == SINGULAR and made.counts.factorisations == 4


@pytest.mark.parametrize(
    ("omega", "mu", "gains"), [(3.0, 0.5, (3.0, 9.0)), (2.0, 2.0, (8.0, 4.0)), (0.0, 1.0, (0.0, 0.0))]
)
def test_gains_of_the_penalty(omega, mu, gains):
    assert alf.feedback({"omega": omega, "mu": mu}) == gains


# --- ALF-dual ---------------------------------------------------------------------------------------------
def dual(rows: np.ndarray = ROWS, gamma: Any = GAMMA, mass: Any = MASS, **options: float) -> Any:
    made = system("alf-dual", mass, rows, gamma, **options)
    made.settings.independent = 1
    return made


def test_start_of_the_iteration_on_the_multipliers():
    """M^(-1/2) g, the residual γ - Φ_q M⁻¹ g, and L⁻¹ of it."""
    made = dual()
    assert alf_dual.start(1e12, made) and made.counts.factorisations == 4
    factor, free = made.scratch, FORCE / MASS
    order = factor.symbolic.row.astype(int)
    assert factor.change == pytest.approx(FORCE / np.sqrt(MASS)) and made.acceleration == pytest.approx(free)
    left = (GAMMA - ROWS @ free)[order]
    assert factor.residual == pytest.approx(left)
    s = (ROWS / MASS) @ ROWS.T
    below = s[order[1], order[0]] / s[order[0], order[0]]
    assert factor.step == pytest.approx([left[0], left[1] - below * left[0]])
    assert alf_dual.square_of_forces(made) == pytest.approx((FORCE**2 / MASS).sum())
    factor.change[:] = [1.0, 2.0, 3.0, 4.0]
    assert alf_dual.put_accelerations(made) == 30.0
    assert made.acceleration == pytest.approx(np.array([1.0, 2.0, 3.0, 4.0]) / np.sqrt(MASS))
    assert not alf_dual.start(1e12, dual(mass=[2.0, 0.5, 0.0, 1.0]))


def rows_at(sine: float) -> np.ndarray:
    """Two unit rows at an angle of this sine."""
    return np.array([[1.0, 0.0, 0.0], [math.sqrt(1 - sine**2), sine, 0.0]])


@pytest.mark.parametrize(
    ("square", "solved", "substitutions"),
    [(0.9e-4, False, 0), (1.1e-4, True, 2), (0.079, True, 2), (0.081, True, 1)],
)
def test_independent_rows_are_solved_at_once(monkeypatch, square, solved, substitutions):
    """A squared pivot up to 1e-4 is not clear; up to 0.08 the residual is solved for, too."""
    back, calls = alf_dual.substitute_back, []
    monkeypatch.setattr(alf_dual, "substitute_back", lambda *given: [calls.append(1), back(*given)])
    monkeypatch.setattr(alf_dual, "substitute_forward", lambda *_: math.inf)
    rows = rows_at(math.sqrt(square))
    made = dual(rows, GAMMA, np.ones(3))
    assert alf_dual.solve_exactly(made) is solved and len(calls) == substitutions
    if solved:
        acceleration, multipliers = exact(np.ones(3), rows, GAMMA)
        assert made.acceleration == pytest.approx(acceleration) and made.multipliers == pytest.approx(
            multipliers
        )


@pytest.mark.parametrize(
    ("forces", "accelerations", "part", "count"),
    [(4.0, 9.0, 0.99, 1), (4.0, 9.0, 1.01, 2), (9.0, 4.0, 0.99, 1), (9.0, 4.0, 1.01, 2), (4.0, 4.0, 1.0, 1)],
)
def test_a_second_solution_unless_its_change_is_rounding(monkeypatch, forces, accelerations, part, count):
    """√(rᵀ S⁻¹ r) against 1e-14 times the smaller of M^(1/2) q̈ and M^(1/2) q̈_0, here 2."""
    put, sizes = alf_dual.put_accelerations, []
    monkeypatch.setattr(
        alf_dual, "put_accelerations", lambda given: [put(given), sizes.append(1)] and accelerations
    )
    monkeypatch.setattr(alf_dual, "square_of_forces", lambda given: forces)
    monkeypatch.setattr(alf_dual, "substitute_forward", lambda *_: part * 1e-14 * 1e-14 * 4.0)
    assert alf_dual.solve_exactly(dual(rows_at(0.1), GAMMA, np.ones(3))) and len(sizes) == count


def test_a_second_solution_removes_what_the_first_left(monkeypatch):
    """The first solution is spoilt by 1 %."""
    back = alf_dual.substitute_back

    def rough(factor: Any, b: np.ndarray) -> None:
        back(factor, b)
        b *= 1.01

    monkeypatch.setattr(alf_dual, "substitute_back", rough)
    rows = rows_at(0.2)
    made = dual(rows, GAMMA, np.ones(3))
    assert alf_dual.solve_exactly(made)
    acceleration, multipliers = exact(np.ones(3), rows, GAMMA)
    assert made.acceleration == pytest.approx(acceleration, rel=5e-4)
    assert made.multipliers == pytest.approx(multipliers, rel=2e-4)


def test_no_solution_at_once_without_a_factor():
    assert not alf_dual.solve_exactly(dual(mass=[2.0, 0.5, 0.0, 1.0]))


@pytest.mark.parametrize(
    ("independent", "nearly", "exactly", "calls"),
    [
        (1, 0, True, ["exactly"]),
        (1, 0, False, ["exactly", "iterated"]),
        (0, 0, True, ["iterated"]),
        (1, 1, True, ["iterated"]),
        (0, 1, True, ["iterated"]),
    ],
)
def test_which_rows_are_solved_at_once(monkeypatch, independent, nearly, exactly, calls):
    made, seen = dual(), []
    made.settings.independent, made.settings.nearly_dependent = independent, nearly
    monkeypatch.setattr(
        alf_dual, "solve_exactly", lambda given: seen.append("exactly") or (given is made and exactly)
    )
    monkeypatch.setattr(alf_dual, "iterate_until_solved", lambda given: seen.append("iterated") or SINGULAR)
    status = alf_dual.accelerate.function(made)
    assert seen == calls and status == (SINGULAR if "iterated" in calls else OK)


def test_numbers_of_an_iteration(monkeypatch):
    asked: list[Any] = []
    monkeypatch.setattr(alf_dual, "solve_to_tolerance", lambda *given: asked.append(given) or NOT_CONVERGED)
    made = dual(epsilon=0.25, iterations=6.0)
    assert alf_dual.iterate_with(1e11, made) == NOT_CONVERGED
    assert asked == [(made.scratch, 0.25, 6, made.acceleration, made.multipliers)]
    assert made.scratch.diagonal.min() > 0
    assert alf_dual.iterate_with(1e11, dual(mass=[0.0, 1.0, 1.0, 1.0])) == SINGULAR and len(asked) == 1


def test_conjugate_directions_for_rows_that_are_nearly_dependent(monkeypatch):
    asked: list[Any] = []
    monkeypatch.setattr(alf_dual, "go_on_by_conjugate_directions", lambda *given: asked.append(given) or OK)
    tried: list[Any] = []
    monkeypatch.setattr(alf_dual, "iterate_with", lambda *given: tried.append(given) or NOT_CONVERGED)
    made = dual(alpha=1e9)
    made.settings.nearly_dependent = 1
    assert alf_dual.iterate_until_solved(made) == OK
    assert asked == [(made.scratch, 1e9, made.acceleration, made.multipliers)] and tried == [(1e9, made)]


@pytest.mark.parametrize(
    ("independent", "statuses", "first", "others"),
    [
        (1, [OK], 1e10, []),
        (1, [NOT_CONVERGED, OK], 1e10, [1e13]),
        (1, [NOT_CONVERGED] * 3, 1e10, [1e13, 1e16]),
        (0, [NOT_CONVERGED], 1e10, []),
        (1, [NOT_CONVERGED], 1e16, []),
        (1, [NOT_CONVERGED] * 2, 0.99e16, [0.99e19]),
        (1, [SINGULAR], 1e10, []),
        (1, [NOT_CONVERGED, SINGULAR, OK], 1e10, [1e13, 1e15]),
        (1, [NOT_CONVERGED, NOT_CONVERGED, SINGULAR, SINGULAR], 1e10, [1e13, 1e16, 1e15]),
    ],
)
def test_penalties_that_are_tried(monkeypatch, independent, statuses, first, others):
    """Independent rows get a penalty a thousand times as large, up to 1e16; 1e15 after rounding."""
    made, left = dual(alpha=first), list(statuses)
    made.settings.independent = independent
    asked: list[float] = []

    def iterate(alpha: float, given: Any) -> int:
        assert given is made
        asked.append(alpha)
        return left.pop(0)

    monkeypatch.setattr(alf_dual, "iterate_with", iterate)
    assert alf_dual.iterate_until_solved(made) == statuses[-1]
    assert asked == pytest.approx([first, *others], rel=1e-12) and not left


# --- Moore–Penrose ----------------------------------------------------------------------------------------
def test_scaled_rows_and_residual():
    """M = diag(4, 1): D = rows (3/2, 2) over 2.5 and (0, 1); q̈_unc = (2, 3)."""
    made = SimpleNamespace(
        jacobian=np.array([[3.0, 2.0], [0.0, 1.0]]),
        inverse_root=np.array([0.5, 1.0]),
        mass=np.array([4.0, 1.0]),
        force=np.array([8.0, 3.0]),
        rhs=np.array([2.0, 5.0]),
        acceleration=np.full(2, 7.0),
        multipliers=np.full(2, 7.0),
    )
    d, b = np.full((2, 2), 7.0), np.full(2, 7.0)
    assert moore_penrose.scaled_residual(made, d, b)
    assert d == pytest.approx(np.array([[0.6, 0.8], [0.0, 1.0]])) and b == pytest.approx([-10 / 2.5, 2.0])
    assert made.acceleration.tolist() == [2.0, 3.0] and made.multipliers == pytest.approx([0.4, 1.0])
    dt = np.full((2, 2), 7.0)
    moore_penrose.transpose(d, dt)
    assert dt.tolist() == d.T.tolist()
    moore_penrose.recover_solution(np.array([4.0, 1.0]), np.array([10.0, -3.0]), made)
    assert made.acceleration.tolist() == [4.0, 4.0] and made.multipliers == pytest.approx([-4.0, 3.0])
    made.mass[1] = 0.0
    assert not moore_penrose.scaled_residual(made, d, b)


@pytest.mark.parametrize(
    ("name", "sine"), [("mpi-svd", math.sin(2 * math.atan(0.2))), ("mpi-gs", 0.372281), ("mpi-qr", 0.2)]
)
@pytest.mark.parametrize(("tolerance", "rank"), [(0.19, 2), (0.21, 1)])
def test_rank_tolerance_of_the_settings(name, sine, tolerance, rank):
    """Unit rows at an angle whose least singular value, column or row is 0.2 times the largest.

    Columns (1, c) and (0, s): s / √(1 + c²) remains of the second, and the first is √(1 + c²) long.
    """
    made = system(name, np.ones(3), rows_at(sine), np.array([1.0, -1.0]))
    made.settings.rank_tolerance = tolerance
    assert MODULES[name].accelerate.function(made) == OK
    solved = np.abs(rows_at(sine) @ made.acceleration - [1.0, -1.0]).max() < 1e-9
    assert solved == (rank == 2)
