"""The series of a small system, with interpreted kernels / its equations solved densely, and by convolutions.

Three variables x, y, z have the rows ½ (x² + y² - 1) + ¼ z and x y + z² / 2 - z / 3 - ⅙, a mass matrix
without zeros, a constant force and a force that is linear in the variables.
``test_thresholds.py`` runs this file in a process whose kernels are interpreted, so that nothing is compiled.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref.kernels.compilation import PLAIN

if not PLAIN:
    pytest.skip("kernels are interpreted by test_thresholds.py", allow_module_level=True)

from mbref.kernels.layout import NOT_CONVERGED, OK, SINGULAR
from mbref.taylor import correction, partition, polynomials, series, simd, solver, step_start
from mbref.taylor.crossing import determinants, uniqueness
from mbref.taylor.expressions import ONE
from mbref.taylor.numbers import OneScene
from mbref.taylor.polynomial_layout import Inertia

NZ, LANES, LAST = 3, 8, 5
CIRCLE = {(ONE, ONE): -0.5, (0, 0): 0.5, (1, 1): 0.5, (ONE, 2): 0.25}
SADDLE = {(ONE, ONE): -1 / 6, (0, 1): 1.0, (2, 2): 0.5, (ONE, 2): -1 / 3}
PLANE = {(ONE, ONE): -1.0, (ONE, 0): 2.0, (ONE, 2): -1.0}
MASS = np.array([[2.0, 0.3, 0.1], [0.3, 1.5, -0.2], [0.1, -0.2, 1.0]])
FORCE, LINEAR = np.array([0.4, -0.7, 0.2]), np.array([[0.1, 0.0, 0.3], [0.0, -0.2, 0.0], [0.5, 0.6, 0.0]])
PLACE, RATE = np.array([0.6, 0.7, 0.5]), np.array([0.3, -0.4, 0.8])


def system(
    rows: list[Any],
    given: Any = (),
    driven: bool = False,
    mass: np.ndarray = MASS,
    place: np.ndarray = PLACE,
    linear_force: np.ndarray = LINEAR,
    **more: Any,
) -> Any:
    """Memory of a system with the variables 0, 1, 2 …; prescribed functions have the next numbers."""
    nr, nz = len(rows), place.size
    lanes = simd.padded_size(nz + nr + len(given))
    of = SimpleNamespace(
        rows=rows, kept=range(nz), given={v: (0, 0) for v in given}, driven=driven, numbers=OneScene()
    )
    lane = {v: v for v in range(nz)} | {v: nz + nr + g for g, v in enumerate(given)}
    table, products = polynomials._rows(of, lane, lanes), polynomials._products(of, lane, lanes)
    linear, places = polynomials._tableau(table, nz, nr, lanes)
    terms: Any = [[(j, nz * i + j) for j in range(nz) if linear_force[i, j]] for i in range(nz)]
    slots, start = polynomials._slots(terms + [[]] * (lanes - nz), (0, nz * nz))
    weights = np.append(linear_force.ravel(), 0.0)
    coupled = np.nonzero(mass)
    inertia = Inertia(
        np.pad(mass, ((0, 0), (0, lanes - nz))),
        coupled[1],
        np.searchsorted(coupled[0], np.arange(nz + 1)),
        np.pad(np.resize(FORCE, nz), (0, lanes - nz)),
        np.array([j for j, _ in slots]),
        weights[[k for _, k in slots]],
        start,
    )
    grown = np.arange(1.0, LAST + 2) * np.arange(2.0, LAST + 3)
    scale, growth = np.zeros((LAST + 1, lanes)), np.ones((LAST + 1, lanes))
    scale[:, :nz], scale[:, nz : nz + nr], growth[:, nz : nz + nr] = -1 / grown[:, None], -1.0, grown[:, None]
    variable = np.array([1.0] * nz + [0.0] * (lanes - nz))
    size = (LAST + 3, lanes)
    memory = SimpleNamespace(
        polynomials=SimpleNamespace(
            rows=table,
            products=products,
            inertia=inertia,
            given=SimpleNamespace(driver=np.zeros(len(of.given), int)),
            torsions=SimpleNamespace(row=np.zeros(0, int), form=np.zeros((0, nz))),
        ),
        series=SimpleNamespace(
            terms=np.zeros(size),
            past=np.zeros(size),
            left=np.zeros((LAST + 3, products.left.size)),
            right=np.zeros((LAST + 3, products.left.size)),
            sums=np.full((LAST + 1, lanes), 9.0),
            scale=scale,
            growth=growth,
            variable=variable,
        ),
        solver=SimpleNamespace(
            pivot_rows=np.arange(nr),
            pivot_columns=np.arange(nz),
            work=np.full((nr, nz), 9.0),
            left=np.zeros(lanes),
            row_max=np.zeros(nr),
            first=np.zeros(nz),
            last=np.zeros(nz),
            past=np.zeros(nz),
            past_motion=np.zeros(nz),
            place=places,
            linear=linear,
            tableau=np.full((nr + 1, lanes), 9.0),
            null_space=np.zeros((nz, lanes)),
            **{name: np.full((nz, lanes), 9.0) for name in ("particular", "momentum", "forces")},
            reduced=np.full((nz, nz), 9.0),
            response=np.zeros((lanes, lanes)),
            **{name: np.zeros(lanes) for name in ("rhs", "phi", "change")},
        ),
        partition=SimpleNamespace(rank=0, partition_id=4, parity=7, replaced_pivot=0.0),
        step=SimpleNamespace(
            start_partition_id=5, start_parity=0, start_pivot=0.0, violation=9.0, correction=9.0
        ),
        progress=SimpleNamespace(largest_pivot=0.1),
        mode=SimpleNamespace(order=LAST + 2, tolerance=1e-10),
        code=SimpleNamespace(violation=0, close=0, close_rate=0, factorise=0, rank=-1),
        run=SimpleNamespace(
            equations=SimpleNamespace(
                system=SimpleNamespace(
                    counts=SimpleNamespace(factorisations=0), settings=SimpleNamespace(rank_tolerance=1e-9)
                )
            )
        ),
        kernels=SimpleNamespace(choose=step_start.choose.function, respond=solver.respond_in_loops.function),
    )
    memory.series.terms[0, :nz], memory.series.terms[1, :nz] = place, np.resize(RATE, nz)
    for name, value in more.items():
        setattr(memory.code, name, value)
    return memory


def values(rows: list[Any], place: np.ndarray) -> np.ndarray:
    """Φ of the rows, by their polynomials."""
    at = {ONE: 1.0, **dict(enumerate(place))}
    return np.array([sum(c * at[i] * at[j] for (i, j), c in row.items()) for row in rows])


def gradient(rows: list[Any], place: np.ndarray, count: int = NZ) -> np.ndarray:
    """G of the rows, by differences of polynomials of second degree, which have no error but rounding."""
    steps = np.eye(place.size)[:count]
    return np.array([(values(rows, place + e) - values(rows, place - e)) / 2 for e in steps]).T


def dense(rows: np.ndarray, mass: np.ndarray = MASS) -> np.ndarray:
    """The inverse of [[M, Gᵀ], [G, 0]]."""
    corner = np.zeros((len(rows), len(rows)))
    return np.linalg.inv(np.block([[mass, rows.T], [rows, corner]]))


def respond(memory: Any) -> np.ndarray:
    assert step_start.choose_partition.function(memory) == memory.partition.rank
    return memory.solver.response


@pytest.mark.parametrize("rows", [[CIRCLE], [CIRCLE, SADDLE], [SADDLE, CIRCLE], [PLANE, SADDLE]])
def test_the_response_is_the_inverse_of_the_equations(rows):
    memory, count = system(rows), NZ + len(rows)
    memory.solver.response[:], memory.solver.null_space[:, :NZ] = 9.0, 9.0
    response = respond(memory)
    assert memory.partition.rank == len(rows) and memory.partition.partition_id == 5
    assert response[:count, :count] == pytest.approx(dense(gradient(rows, PLACE)), abs=1e-11)
    assert not response[:count, count:].any()
    assert (memory.solver.first > 0).all() and (memory.solver.first == abs(memory.solver.last)).all()


def test_the_response_with_a_dependent_row():
    """The second row is twice the first: it has no multiplier."""
    twice = {key: 2.0 * c for key, c in SADDLE.items()}
    memory = system([SADDLE, CIRCLE, twice])
    response = respond(memory)
    assert memory.partition.rank == 2 and sorted(memory.solver.pivot_rows[:2]) == [1, 2]
    lanes = [0, 1, 2, 4, 5]
    expected = dense(gradient([CIRCLE, twice], PLACE))
    assert response[np.ix_(lanes, lanes)] == pytest.approx(expected, abs=1e-11)
    assert not response[3].any() and not response[:, 3].any()


def test_the_response_without_freedom_is_the_inverse_of_the_gradient():
    rows = [CIRCLE, SADDLE, PLANE]
    memory = system(rows)
    memory.solver.response[:] = 9.0
    response = respond(memory)
    inverse = response[NZ:6, :NZ].T
    assert inverse == pytest.approx(np.linalg.inv(gradient(rows, PLACE)), abs=1e-13)
    assert not response[:NZ].any() and not response[:6, NZ:].any() and (response[6:] == 9.0).all()


def test_prescribed_functions_move_their_rows():
    """Lane 5 is a function that enters one row linearly, the other in a product with x."""
    driven = {**SADDLE, (0, 3): -2.0}
    rows = [{**PLANE, (ONE, 3): 0.5}, driven]
    memory = system(rows, given=(3,))
    memory.series.terms[0, 5] = 0.9
    respond(memory)
    memory.run.equations.system.counts.factorisations = 2
    assert solver.factorise_equations(memory) == OK and memory.run.equations.system.counts.factorisations == 3
    found, place = memory.solver.response, np.append(PLACE, 0.9)
    inverse, along = dense(gradient(rows, place)), gradient(rows, place, 4)[:, 3]
    assert found[:5, :5] == pytest.approx(inverse, abs=1e-13) and not found[:5, 5:].any()
    assert found[5, :5] == pytest.approx(-along @ inverse[NZ:], abs=1e-13)
    assert found[5, 5:].tolist() == [1.0, 0.0, 0.0]


def test_pivots_are_chosen_by_the_largest_entries():
    """G is [[0, 0, ¼], [2, 0, -1]] at the origin: 2 first, then ¼; rows are exchanged, and two columns."""
    memory = system([CIRCLE, PLANE])
    memory.series.terms[:] = 0.0
    assert respond(memory) is memory.solver.response and memory.partition.rank == 2
    assert memory.solver.pivot_rows.tolist() == [1, 0] and memory.solver.pivot_columns.tolist() == [0, 2, 1]
    assert memory.solver.last[:2].tolist() == [2.0, 0.25] and memory.partition.parity == 0
    memory.run.equations.system.settings.rank_tolerance = 0.25
    assert step_start.choose.function(memory) == 1 and memory.partition.parity == 1
    memory.series.terms[0, :NZ] = [0.0, 4.0, 0.0]
    assert step_start.choose.function(memory) == 2
    assert memory.solver.pivot_rows.tolist() == [0, 1] and memory.solver.pivot_columns.tolist() == [1, 0, 2]
    assert memory.partition.parity == 1 and memory.partition.partition_id == 7


@pytest.mark.parametrize("change", [0.0, 0.49, 0.51])
def test_small_pivots_choose_rows_and_variables_anew(change):
    """Pivots below half of the first ones; the partition's number counts the choices."""
    memory = system([CIRCLE, SADDLE])
    respond(memory)
    memory.solver.past[:] = memory.solver.last
    smallest, first = np.abs(memory.solver.last[:2]).min(), memory.solver.first.copy()
    memory.solver.first[:] = abs(memory.solver.last) * (1.0 if change == 0.0 else 1.0 / change)
    assert solver.factorise_equations(memory) == OK
    assert memory.partition.partition_id == (6 if change == 0.49 else 5)
    assert memory.partition.replaced_pivot == (smallest if change == 0.49 else 0.0)
    if change == 0.49:
        assert memory.solver.first == pytest.approx(first, rel=1e-14)


def test_pivots_at_half_of_the_first_ones_are_not_sharp():
    numbers = SimpleNamespace(first=np.array([1.0, 2.0]), last=np.array([-0.5001, 1.0001]))
    assert solver.is_sharp(numbers)
    numbers.last[1] = 1.0
    assert not solver.is_sharp(numbers)
    numbers.last[:] = np.nan, 2.0
    assert not solver.is_sharp(numbers)


def test_a_rank_that_changes_is_singular():
    memory = system([CIRCLE, SADDLE])
    respond(memory)
    memory.series.terms[:] = 0.0
    memory.series.terms[0, 2] = 1 / 3
    assert solver.factorise_equations(memory) == SINGULAR


@pytest.mark.parametrize(
    ("part", "status"), [(0.99, SINGULAR), (0.9999, SINGULAR), (1.01, OK), (-5.0, SINGULAR)]
)
@pytest.mark.parametrize("kg", [1.0, 1e-3])
def test_motions_without_inertia(part, status, kg):
    memory = system([CIRCLE], mass=np.diag([kg, 4.0 * kg, 2.0 * kg]))
    memory.partition.rank = 1
    memory.solver.first[:] = 0.0, part * 4e-13 * kg, kg
    assert solver.inertia_left(memory) == status
    memory.solver.first[:] = 0.0, kg, part * 4e-13 * kg
    assert solver.inertia_left(memory) == status


def test_the_inverse_of_a_pivot():
    assert [solver.inverse_or_zero(p) for p in (4.0, -0.5, 0.0)] == [0.25, -2.0, 0.0]


def test_the_solution_adds_every_row_of_the_response():
    memory = system([CIRCLE])
    memory.solver.response[:] = np.cos(np.arange(64.0)).reshape(8, 8)
    memory.solver.rhs[:] = np.sin(1 + np.arange(8.0))
    assert solver.solution(memory.solver, 0) == pytest.approx(memory.solver.rhs @ memory.solver.response)
    wide = SimpleNamespace(response=np.cos(np.arange(256.0)).reshape(16, 16), rhs=np.sin(2 + np.arange(16.0)))
    assert solver.solution(wide, 8) == pytest.approx((wide.rhs @ wide.response)[8:])


# --- violations and corrections -----------------------------------------------------------------------------
def test_violations_of_rows_and_of_their_rates():
    rows = [CIRCLE, {**SADDLE, (0, 3): -2.0, (ONE, 3): 0.75}]
    memory = system(rows, given=(3,))
    memory.series.terms[0, 5], memory.series.terms[1, 5] = 0.9, -0.2
    expected = values(rows, np.append(PLACE, 0.9))
    assert correction.violation(memory) == pytest.approx(abs(expected).max(), rel=1e-14)
    assert memory.solver.phi[NZ:5] == pytest.approx(expected, abs=1e-15)
    correction.violation_rate_in_loops(memory)
    rate = gradient(rows, np.append(PLACE, 0.9), 4) @ [*RATE, -0.2]
    assert memory.solver.phi[NZ:5] == pytest.approx(rate, abs=1e-15)
    assert not memory.solver.phi[:NZ].any() and not memory.solver.phi[5:].any()


@pytest.mark.parametrize("order", [0, 1])
def test_the_least_change_that_removes_a_violation(order):
    memory = system([CIRCLE, SADDLE])
    respond(memory)
    memory.solver.phi[NZ:5] = 0.02, -0.03
    before = memory.series.terms.copy()
    correction.subtract_violation(order, memory)
    expected = -dense(gradient([CIRCLE, SADDLE], PLACE))[:NZ, NZ:] @ [0.02, -0.03]
    assert memory.solver.change[:NZ] == pytest.approx(expected, abs=1e-15)
    assert (memory.series.terms - before)[order, :NZ] == pytest.approx(expected, abs=1e-15)
    assert not (memory.series.terms - before)[1 - order].any() and not memory.solver.change[NZ:].any()
    assert correction.largest_change(memory) == pytest.approx(abs(expected).max(), rel=1e-14)


def test_a_corrected_state_satisfies_rows_and_rates():
    rows = [CIRCLE, SADDLE]
    memory = system(rows)
    respond(memory)
    first = abs(values(rows, PLACE)).max()
    assert correction.correct_state.function(memory) == OK and memory.step.violation == pytest.approx(first)
    place, rate = memory.series.terms[:2, :NZ]
    assert abs(values(rows, place)).max() < 1e-12 and abs(gradient(rows, place) @ rate).max() < 1e-9
    assert 0.0 < memory.step.correction < 1e-6
    along = np.linalg.solve(MASS, gradient(rows, place).T)
    assert rate - RATE == pytest.approx(along @ np.linalg.lstsq(along, rate - RATE, rcond=None)[0], abs=1e-9)


def test_corrections_that_never_meet():
    """x² + y² = -1 has no solution; eight corrections, or as many factorisations, are made."""
    memory = system([{(ONE, ONE): 0.5, (0, 0): 0.5, (1, 1): 0.5}])
    respond(memory)
    assert correction.correct_state.function(memory) == NOT_CONVERGED
    assert memory.run.equations.system.counts.factorisations == correction.MAX_CORRECTIONS == 8


@pytest.mark.parametrize(
    ("left", "change", "pivot", "changes"),
    [
        (0.99e-4, 0.0, -0.1, False),
        (1.01e-4, 0.0, 0.1, True),
        (1e-4, 0.99e-3, 0.2, False),
        (1e-4, 1.01e-3, 0.2, True),
        (3.99e-4, 0.0, 0.2, False),
        (4.01e-4, 0.0, -0.2, True),
    ],
)
def test_corrections_that_change_the_factor(left, change, pivot, changes):
    """A tolerance of 0.01: Φ over 0.01 pivot², or the square of the change over 0.01 Φ."""
    memory = system([CIRCLE])
    memory.mode.tolerance, memory.step.correction, memory.partition.rank = 1e-2, change, 1
    memory.solver.last[0] = pivot
    assert bool(correction.changes_factor(left, memory)) is changes


# --- orders -------------------------------------------------------------------------------------------------
def consistent(rows: list[Any], **more: Any) -> Any:
    memory = system(rows, **more)
    respond(memory)
    for _ in range(3):
        assert correction.correct_state.function(memory) == OK
    return memory


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.convolve(a, b)[: a.size]


@pytest.mark.parametrize("rows", [[CIRCLE], [CIRCLE, SADDLE], [SADDLE, PLANE]])
def test_orders_of_a_motion_satisfy_its_equations(rows):
    """Φ(z(t)) = 0 and M z'' + Gᵀ λ = f + L z, order by order; multipliers stand two orders later."""
    memory = consistent(rows)
    series.start_sums(memory)
    series.expand_without_loads(LAST, memory)
    z, multipliers = memory.series.terms[:, :NZ].T, memory.series.terms[2:, NZ : NZ + len(rows)].T
    one = np.eye(1, z.shape[1])[0]
    at = {ONE: one, **dict(enumerate(z))}
    off = [sum(c * product(at[i], at[j]) for (i, j), c in row.items()) for row in rows]
    assert np.abs(off).max() < 1e-11
    orders = np.arange(LAST + 1)
    force = FORCE[:, None] * one[: LAST + 1] + LINEAR @ z[:, : LAST + 1]
    inertia = MASS @ (z[:, 2:] * (orders + 1) * (orders + 2))
    for row, of_row in zip(rows, multipliers, strict=True):
        for (i, j), c in row.items():
            for one_factor, other in ((i, j), (j, i)):
                if one_factor != ONE:
                    inertia[one_factor] += c * product(at[other][: LAST + 1], of_row)
    assert inertia == pytest.approx(force, abs=1e-9) and np.abs(multipliers).min() > 1e-6
    assert not memory.series.terms[:, NZ + len(rows) :].any()


@pytest.mark.parametrize("rows", [[CIRCLE], [SADDLE, CIRCLE]])
def test_the_right_hand_side_of_the_first_order(rows):
    """``put_sums`` finds forces over -2 at the place, and minus the products of the rates in rows."""
    memory = system(rows)
    series.start_sums(memory)
    assert memory.series.sums[0, :NZ].tolist() == (-FORCE).tolist() and not memory.series.sums[1:].any()
    memory.solver.rhs[:] = 9.0
    series.put_sums(0, memory)
    products = [sum(c * RATE[i] * RATE[j] for (i, j), c in row.items() if i != ONE) for row in rows]
    assert memory.solver.rhs[:NZ] == pytest.approx(0.5 * (FORCE + LINEAR @ PLACE), abs=1e-15)
    assert memory.solver.rhs[NZ : NZ + len(rows)] == pytest.approx([-p for p in products], abs=1e-15)
    assert not memory.solver.rhs[NZ + len(rows) :].any()


def test_products_of_later_orders():
    """After ``solve_order`` of 0 to 2, ``add_to_later_sums`` fills orders 3 and 4, up to the last one."""
    for last, filled in ((LAST, (3, 4)), (3, (3,)), (2, ())):
        memory = consistent([SADDLE])
        series.start_sums(memory)
        for k in range(3):
            series.solve_order(k, last, memory)
        z = memory.series.terms[:, :NZ]
        rates = [z[1], z[2], z[3]]  # factors one order later than the sums

        def row(a: np.ndarray, b: np.ndarray) -> float:
            return float(sum(c * (a[i] * b[j] + a[j] * b[i]) / 2 for (i, j), c in SADDLE.items() if i != ONE))

        expected = {3: 2.0 * row(rates[1], rates[2]), 4: row(rates[2], rates[2])}
        found = memory.series.sums[:, NZ]
        for order in (3, 4, 5):
            assert found[order] == pytest.approx(expected[order] if order in filled else 0.0, abs=1e-12)


def test_orders_of_a_driven_motion():
    """The third row drives x with -0.3 + 0.3 t + 0.2 t² - 0.1 t³; the rows determine all orders."""
    rows = [CIRCLE, SADDLE, {(ONE, 0): 1.0, (ONE, 3): -1.0}]
    memory = system(rows, given=(3,), driven=True)
    memory.series.terms[0, :NZ], memory.series.terms[:4, 6] = (-0.3, 0.55, 1.2), (-0.3, 0.3, 0.2, -0.1)
    respond(memory)
    for _ in range(3):
        assert correction.correct_state.function(memory) == OK
    series.start_sums(memory)
    series.expand_without_loads(LAST, memory)
    at = {
        ONE: np.eye(1, LAST + 3)[0],
        **dict(enumerate(memory.series.terms[:, :NZ].T)),
        3: memory.series.terms[:, 6],
    }
    off = [sum(c * product(at[i], at[j]) for (i, j), c in row.items()) for row in rows]
    assert np.abs(off).max() < 1e-10 and memory.series.terms[:, 0] == pytest.approx(
        [-0.3, 0.3, 0.2, -0.1, 0, 0, 0, 0], abs=1e-12
    )


def test_slowest_motions_and_starts_at_rest():
    memory = SimpleNamespace(
        step=SimpleNamespace(deceleration=4.0),
        run=SimpleNamespace(loop=SimpleNamespace(clock=SimpleNamespace(length=0.0))),
        series=SimpleNamespace(terms=np.zeros((2, 8))),
        solver=SimpleNamespace(pivot_columns=np.zeros(2)),
    )
    assert not series.turns_back_in(0.5, memory) and series.turns_back_in(0.51, memory)
    memory.step.deceleration = np.nan
    assert series.turns_back_in(0.1, memory)
    memory.series.terms[1, 2] = memory.series.terms[0, 0] = 1.0
    assert series.starts_at_rest(memory)
    memory.series.terms[1, 1] = -1e-9
    assert not series.starts_at_rest(memory)
    memory.series.terms[1, 1], memory.run.loop.clock.length = 0.0, 0.1
    assert not series.starts_at_rest(memory)


# --- gradients ----------------------------------------------------------------------------------------------
def test_gradients_at_other_variables(monkeypatch):
    """The function of lane 5 is no variable: its column is left out; angles are added at the end."""
    rows = [{**CIRCLE, (ONE, 3): 0.5}, {**SADDLE, (1, 3): -2.0}]
    memory, added = system(rows, given=(3,)), []
    monkeypatch.setattr(determinants, "add_angle_gradients", lambda *found: added.append(found))
    at = np.zeros((1, LANES))
    at[0, :NZ], at[0, 5] = PLACE[::-1], 0.8
    assert determinants.evaluate_gradient.function(at, memory) == OK
    assert memory.solver.work == pytest.approx(gradient(rows, np.append(PLACE[::-1], 0.8)), abs=1e-15)
    assert [found[1] is memory.solver.work for found in added] == [True]


def test_the_tableau_has_ones_for_the_multipliers():
    rows = [CIRCLE, {**SADDLE, (1, 3): -2.0}]
    memory = system(rows, given=(3,))
    memory.series.terms[0, 5] = 0.8
    partition.put_rows(memory)
    expected = np.hstack([gradient(rows, np.append(PLACE, 0.8)), np.eye(2), np.zeros((2, 3))])
    assert memory.solver.tableau[:2] == pytest.approx(expected, abs=1e-15)


def test_pivots_at_the_start_of_a_step():
    memory = system([CIRCLE, SADDLE])
    memory.partition.rank, memory.partition.parity = 2, 1
    memory.solver.last[:] = -0.3, 0.2, 0.05
    memory.solver.null_space[0, :NZ] = 1.0, -2.0, 3.0
    partition.save_start_pivots(memory)
    assert memory.solver.past.tolist() == [-0.3, 0.2, 0.05]
    assert memory.solver.past_motion.tolist() == [1.0, -2.0, 3.0]
    assert (
        vars(memory.step).items() >= {"start_partition_id": 4, "start_parity": 1, "start_pivot": 0.2}.items()
    )
    assert memory.progress.largest_pivot == 0.2 and partition.freedoms(memory) == 1
    memory.progress.largest_pivot = 0.7
    partition.save_start_pivots(memory)
    assert memory.progress.largest_pivot == 0.7
    memory.solver.last[:] = -0.3, -0.2, 0.05
    partition.save_replaced_pivot(memory)
    assert memory.partition.replaced_pivot == -np.inf
    memory.solver.last[:] = -0.1, 0.15, -9.0
    partition.save_replaced_pivot(memory)
    assert memory.partition.replaced_pivot == 0.1
    assert partition.replaced_pivot(memory) == -np.inf
    memory.partition.partition_id = 5
    assert partition.replaced_pivot(memory) == 0.1
    memory.partition.partition_id = 6
    assert partition.replaced_pivot(memory) == -np.inf


def test_rows_below_a_pivot_are_eliminated():
    work = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [0.0, 8.0, 9.0], [2.0, 0.0, 1.0]])
    partition.eliminate_below(work, np.array([2, 1, 3, 0]), np.array([1, 2, 0]), 1)
    assert work[[2, 1]].tolist() == [[0.0, 8.0, 9.0], [4.0, 5.0, 6.0]]
    assert work[3].tolist() == pytest.approx([2 - 4 / 6, 0.0, 0.0])
    assert work[0].tolist() == pytest.approx([1 - 4 * 0.5, 2.0, 0.0])


def test_twice_the_kinetic_energy():
    memory = system([CIRCLE])
    assert uniqueness.kinetic_energy(memory.series.terms, memory) == pytest.approx(RATE @ MASS @ RATE)


def test_determinants_at_both_ends_by_pivots_or_by_gradients(monkeypatch):
    """Without freedom the pivots suffice; with two freedoms the gradient is evaluated."""
    memory, asked = system([CIRCLE, SADDLE, PLANE]), []
    memory.partition.rank, memory.step.start_negative, memory.step.start_logarithm = 3, 1, 0.25
    memory.solver.last[:] = -2.0, 0.5, 3.0
    memory.kernels.determinant = lambda y, _: asked.append(y) or (True, 7.0)
    negative, size = determinants.gradient_determinant_at_end(memory)
    assert not negative and size == pytest.approx(np.log(3.0) + 0.25)
    assert determinants.log_determinant_at_start(memory) == 0.5 and not asked
    memory.partition.rank = 1
    assert determinants.gradient_determinant_at_end(memory) == (True, 7.0)
    assert determinants.log_determinant_at_start(memory) == 7.0
    assert asked[0] is memory.series.terms and asked[1] is memory.series.past


def test_the_determinant_at_the_start_is_saved_by_the_pivots_of_an_unchanged_partition():
    memory, asked = system([CIRCLE, SADDLE, PLANE]), []
    memory.solver.product, memory.solver.past_gradient = np.zeros((3, 3)), np.zeros((3, 3))
    memory.kernels.gradient = lambda y, m: (
        asked.append(y) or m.solver.work.__setitem__(slice(None), 2 * np.eye(3))
    )
    memory.partition.rank, memory.partition.partition_id, memory.step.start_partition_id = 3, 5, 5
    memory.solver.past[:] = -2.0, 0.5, 3.0
    determinants.save_start_determinant(memory)
    assert (
        memory.step.start_negative and memory.step.start_logarithm == pytest.approx(np.log(3.0)) and not asked
    )
    memory.partition.partition_id = 6
    determinants.save_start_determinant(memory)
    assert not memory.step.start_negative and memory.step.start_logarithm == pytest.approx(np.log(8.0))
    memory.partition.rank = 2
    determinants.save_start_determinant(memory)
    assert memory.solver.past_gradient[:, :2].tolist() == [[2.0, 0.0], [0.0, 2.0], [0.0, 0.0]]
    assert all(y is memory.series.past for y in asked) and len(asked) == 2


@pytest.mark.parametrize("rows", [[SADDLE], [CIRCLE, SADDLE], [PLANE, CIRCLE, SADDLE]])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_determinant_of_gradients_at_two_times(rows, sign):
    """det(G G₀ᵀ) of a random G₀ in pivot order, or det G of a square gradient times its sign at the start."""
    memory, count = system(rows), len(rows)
    respond(memory)
    order, columns = memory.solver.pivot_rows, memory.solver.pivot_columns
    there = np.zeros((1, LANES))
    there[0, :NZ] = PLACE[::-1]
    memory.kernels.gradient = determinants.evaluate_gradient.function
    memory.solver.product, before = (
        np.full((3, 3), 9.0),
        sign * np.cos(np.arange(3.0 * count)).reshape(count, 3),
    )
    memory.solver.past_gradient = before.T.copy()
    memory.step.start_negative, memory.step.start_logarithm = sign < 0, 0.75
    found = gradient(rows, PLACE[::-1])[order]
    square = np.linalg.det(found[:, columns]) if count == NZ else np.linalg.det(found @ before.T)
    expected = sign * square * np.exp(0.75) if count == NZ else square
    negative, size = determinants.gradient_determinant.function(there, memory)
    assert bool(negative) is bool(expected < 0.0) and size == pytest.approx(np.log(abs(expected)))


def test_gradients_of_angles_are_added_to_the_tableau(monkeypatch):
    memory, added = system([CIRCLE]), []
    monkeypatch.setattr(partition, "add_angle_gradients", lambda *given: added.append(given))
    partition.put_rows(memory)
    assert not added
    memory.polynomials.torsions.row = np.array([-1])
    partition.put_rows(memory)
    [(terms, tableau, given)] = added
    assert terms is memory.series.terms and tableau is memory.solver.tableau and given is memory


# --- which code computes the orders -------------------------------------------------------------------------
def expanding(patch: pytest.MonkeyPatch, deceleration: float = 0.0, length: float = 0.0, **code: Any) -> Any:
    """A series of rates up to 4 /s, whose code by power finds that its speed changes at a rate (1/s)."""
    memory, calls = system([CIRCLE]), []
    memory.series.terms[1, :NZ], memory.partition.rank = (1.0, -4.0, 2.0), 1
    memory.run.loop = SimpleNamespace(clock=SimpleNamespace(length=length))
    memory.code = SimpleNamespace(**{"expand": 0, "expand_by_power": 7, "rank": 1, **code})

    def by_power(
        address: int, terms: Any, response: Any, left: Any, right: Any, sums: Any, last: int
    ) -> None:
        calls.append(("power", address, last))
        sums[0] = -deceleration

    def by_code(address: int, *given: Any) -> None:
        calls.append(("code", address, given[-1]))

    patch.setattr(series, "expand_by_power", by_power)
    patch.setattr(series, "expand_by_code", by_code)
    patch.setattr(series, "start_sums", lambda _: calls.append("sums"))
    patch.setattr(series, "expand_without_loads", lambda last, _: calls.append(("loops", last)))
    memory.kernels.multipliers = lambda _: calls.append("multipliers") or 44
    memory.kernels.respond = lambda _: calls.append("respond")
    memory.kernels.loads = lambda _: calls.append("loads") or 55
    memory.calls = calls
    return memory


@pytest.mark.parametrize(
    ("deceleration", "length", "by_power"),
    [(7.9, 0.0, True), (8.1, 0.0, False), (3.9, 0.5, True), (-4.1, 0.5, False), (np.nan, 0.5, False)],
)
def test_orders_by_power_unless_the_motion_may_turn_back(monkeypatch, deceleration, length, by_power):
    """Twice the time of stopping must be longer than the last step, at first the time to move by one."""
    memory = expanding(monkeypatch, deceleration, length)
    assert series.expand_series.function(memory) == (OK if by_power else 44)
    assert memory.calls == [("power", 7, LAST), *["multipliers"] * (not by_power)]
    assert memory.step.deceleration == pytest.approx(abs(deceleration), nan_ok=True)


@pytest.mark.parametrize("code", [{"expand_by_power": 0}, {"rank": 2}, {"rates": 0.0}])
def test_orders_with_multipliers(monkeypatch, code):
    """Without code by power, at another rank, and at rest before the first step."""
    rates = code.pop("rates", 4.0) if "rates" in code else 4.0
    memory = expanding(monkeypatch, 1.0, **code)
    memory.series.terms[1] *= rates
    memory.step.deceleration = 9.0
    assert series.expand_series.function(memory) == 44 and memory.calls == ["multipliers"]
    assert memory.step.deceleration == 0.0


@pytest.mark.parametrize(
    ("code", "varies", "status", "calls"),
    [
        ({"expand": 5}, False, OK, ["respond", ("code", 5, LAST)]),
        ({"expand": 5, "rank": 2}, False, OK, ["respond", "sums", ("loops", LAST)]),
        ({"expand_by_power": 0}, True, 55, ["sums", "loads"]),
        ({"expand_by_power": 0, "expand": 5}, True, OK, [("code", 5, LAST)]),
    ],
)
def test_multipliers_by_code_or_by_loops(monkeypatch, code, varies, status, calls):
    """After orders by power the response to all equations is missing."""
    memory = expanding(monkeypatch, **code)
    monkeypatch.setattr(series, "has_varying_loads", lambda polynomials: varies)
    memory.step.deceleration = 9.0
    assert series.expand_with_multipliers.function(memory) == status and memory.calls == calls
    assert memory.step.deceleration == 0.0


# --- systems of several vectors -----------------------------------------------------------------------------
WIDE = 10
WIDE_PLACE = np.sin(1.0 + 1.7 * np.arange(WIDE))
WIDE_LINEAR = np.where(np.cos(2.3 * np.arange(100.0)) > 0.4, np.cos(1.9 * np.arange(100.0)), 0.0).reshape(
    WIDE, WIDE
)
COUPLING = np.sin(1.3 * np.arange(100.0)).reshape(WIDE, WIDE)
WIDE_MASS = 3.0 * np.eye(WIDE) + np.where(
    abs(COUPLING + COUPLING.T) > 0.5, 0.2 * (COUPLING + COUPLING.T), 0.0
)


def wide_rows(count: int, functions: Any = ()) -> list[Any]:
    """Rows of second degree that are zero at the place, with terms of functions of value 0.9 and 1.3."""
    random, rows = np.random.default_rng(count), []
    at = {**dict(enumerate(WIDE_PLACE)), **dict(zip(functions, (0.9, 1.3), strict=False)), ONE: 1.0}
    for r in range(count):
        row = {(ONE, int(v)): float(random.normal()) for v in random.permutation(WIDE)[:5]}
        row |= {(min(p), max(p)): float(random.normal()) for p in random.integers(0, WIDE, (4, 2)).tolist()}
        row |= {(ONE, v): 0.5 + r for v in functions} | {(r, v): 0.25 for v in functions}
        rows.append({**row, (ONE, ONE): -sum(c * at[i] * at[j] for (i, j), c in row.items())})
    return rows


def wide(count: int, functions: Any = ()) -> tuple[list[Any], Any]:
    """Memory of ten variables in two or three vectors, with other numbers where results are put."""
    rows = wide_rows(count, functions)
    memory = system(rows, functions, mass=WIDE_MASS, place=WIDE_PLACE, linear_force=WIDE_LINEAR)
    memory.series.terms[0, WIDE + count : WIDE + count + len(functions)] = (0.9, 1.3)[: len(functions)]
    memory.solver.response[:] = memory.solver.change[:] = memory.solver.rhs[:] = 9.0
    memory.solver.null_space[:, :WIDE] = 9.0
    return rows, memory


@pytest.mark.parametrize("count", [1, 3, 7, 9])
def test_the_response_of_several_vectors(count):
    rows, memory = wide(count)
    response = respond(memory)
    expected = dense(gradient(rows, WIDE_PLACE, WIDE), WIDE_MASS)
    assert memory.partition.rank == count and response.shape[0] > WIDE + count
    assert response[: WIDE + count, : WIDE + count] == pytest.approx(expected, rel=1e-8, abs=1e-9)
    assert not response[: WIDE + count, WIDE + count :].any()


def test_the_response_of_several_vectors_without_freedom():
    rows, memory = wide(WIDE)
    response = respond(memory)
    inverse = response[WIDE:20, :WIDE].T
    assert inverse == pytest.approx(np.linalg.inv(gradient(rows, WIDE_PLACE, WIDE)), rel=1e-8, abs=1e-9)
    assert response.shape[0] == 24
    assert not response[:WIDE].any() and not response[:20, WIDE:].any() and (response[20:] == 9.0).all()


@pytest.mark.parametrize("count", [2, 6])
def test_functions_of_several_vectors(count):
    """Functions stand in lanes 12 and 13, or 16 and 17."""
    functions, n = (WIDE, WIDE + 1), WIDE + count
    rows, memory = wide(count, functions)
    respond(memory)
    assert solver.factorise_equations(memory) == OK
    found, at = memory.solver.response, np.append(WIDE_PLACE, (0.9, 1.3))
    inverse, along = dense(gradient(rows, at, WIDE), WIDE_MASS), gradient(rows, at, WIDE + 2)[:, WIDE:]
    assert found[:n, :n] == pytest.approx(inverse, rel=1e-8, abs=1e-9) and not found[:n, n:].any()
    assert found[n : n + 2, :n] == pytest.approx(-along.T @ inverse[WIDE:], rel=1e-8, abs=1e-9)
    assert found[n : n + 2, n:].tolist() == np.eye(2, found.shape[1] - n).tolist()


@pytest.mark.parametrize("count", [3, 7])
def test_corrections_of_several_vectors(count):
    rows, memory = wide(count)
    respond(memory)
    memory.series.terms[0, :WIDE] += 0.01 * np.cos(np.arange(WIDE))
    place = memory.series.terms[0, :WIDE].copy()
    expected = values(rows, place)
    assert correction.violation(memory) == pytest.approx(abs(expected).max(), rel=1e-12)
    assert memory.solver.phi[WIDE : WIDE + count] == pytest.approx(expected, abs=1e-13)
    inverse = dense(gradient(rows, WIDE_PLACE, WIDE), WIDE_MASS)
    correction.subtract_violation(0, memory)
    change = -inverse[:WIDE, WIDE:] @ expected
    assert memory.solver.change[:WIDE] == pytest.approx(change, abs=1e-10)
    assert not memory.solver.change[WIDE:].any()
    assert memory.series.terms[0, :WIDE] - place == pytest.approx(change, abs=1e-10)
    correction.violation_rate_in_loops(memory)
    moved, rate = memory.series.terms[:2, :WIDE].copy()
    expected = gradient(rows, moved, WIDE) @ rate
    assert memory.solver.phi[WIDE : WIDE + count] == pytest.approx(expected, abs=1e-12)
    correction.subtract_violation(1, memory)
    change = -inverse[:WIDE, WIDE:] @ expected
    assert memory.series.terms[1, :WIDE] - rate == pytest.approx(change, abs=1e-10)
    assert correction.largest_change(memory) == pytest.approx(abs(change).max(), rel=1e-9)
    assert memory.series.terms[0, :WIDE].tolist() == moved.tolist()


@pytest.mark.parametrize("count", [3, 7])
def test_orders_of_several_vectors(count):
    rows, memory = wide(count)
    respond(memory)
    for _ in range(4):
        assert correction.correct_state.function(memory) == OK
    series.start_sums(memory)
    series.expand_without_loads(LAST, memory)
    z, multipliers = memory.series.terms[:, :WIDE].T, memory.series.terms[2:, WIDE : WIDE + count].T
    one = np.eye(1, z.shape[1])[0]
    at = {ONE: one, **dict(enumerate(z))}
    for row in rows:
        parts = np.array([c * product(at[i], at[j]) for (i, j), c in row.items()])
        assert (np.abs(parts.sum(axis=0)) < 1e-7 * np.abs(parts).max(axis=0)).all()
    orders, force = np.arange(LAST + 1), np.resize(FORCE, WIDE)
    outside = force[:, None] * one[: LAST + 1] + WIDE_LINEAR @ z[:, : LAST + 1]
    inertia = WIDE_MASS @ (z[:, 2:] * (orders + 1) * (orders + 2))
    size = np.abs(inertia).max(axis=0)
    for row, of_row in zip(rows, multipliers, strict=True):
        for (i, j), c in row.items():
            for one_factor, other in ((i, j), (j, i)):
                if one_factor != ONE:
                    inertia[one_factor] += c * product(at[other][: LAST + 1], of_row)
    assert (np.abs(inertia - outside).max(axis=0) < 1e-7 * size).all()
    assert not memory.series.terms[:, WIDE + count :].any()


# --- loads that vary ----------------------------------------------------------------------------------------
def test_loads_are_expanded_before_each_order(monkeypatch):
    """Vectors of order k + 1, then forces of order k, and the order itself; the last order is two lower."""
    calls: list[Any] = []
    grow, add = (
        ("grow_springs", "grow_torsions", "grow_slides"),
        ("springs", "torsions", "slides", "timed_forces"),
    )
    for name in (*grow, *(f"add_{each}" for each in add)):
        monkeypatch.setattr(series, name, lambda k, memory, name=name: calls.append((name, k)))
    monkeypatch.setattr(series, "solve_order", lambda k, last, memory: calls.append(("solve", k, last)))
    assert series.expand_with_loads.function(SimpleNamespace(mode=SimpleNamespace(order=3))) == OK
    expected: list[Any] = [(name, 0) for name in grow]
    for k in range(2):
        expected += (
            [(name, k + 1) for name in grow] + [(f"add_{each}", k) for each in add] + [("solve", k, 1)]
        )
    assert calls == expected
