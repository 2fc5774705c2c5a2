"""Pivots of steps that may cross a singular position, with interpreted kernels / numbers worked out by hand.

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

from mbref.kernels.layout import CHANGED, NOT_CONVERGED, OK, SINGULAR, SINGULAR_AHEAD
from mbref.stabilisation import partitioning
from mbref.stepping import singular_crossing as crossing
from mbref.taylor import step_start


# --- pivots at both ends of a step ------------------------------------------------------------------------
def two_ends(pivots: list[float], squared: list[float], product: list[float]) -> Any:
    """Memory with pivots at the start, squared ones at the end, and those of the product; reference 2."""
    return SimpleNamespace(
        loop=SimpleNamespace(
            ends=SimpleNamespace(
                gradient="gradient", squared_pivots=np.array(squared), pivots=np.array(product)
            )
        ),
        factor="factor",
        pivots=np.array(pivots),
        watch=SimpleNamespace(reference_pivot=2.0),
    )


def passed(monkeypatch: pytest.MonkeyPatch, memory: Any, at_pose: dict[int, float]) -> tuple[bool, list[Any]]:
    """Whether the rank drops where pivots k change their signs, with the least pivots at these poses."""
    calls: list[Any] = []
    looked: list[int] = []

    def product(*given: Any) -> None:
        ends = memory.loop.ends
        assert given == ("factor", "gradient", crossing.PRODUCT_ALPHA, ends)
        calls.append("product")

    def zero(k: int, h: float, given: Any) -> float:
        assert h == 0.5 and given is memory
        looked.append(k)
        calls.append(k)
        return 0.25

    def noted(name: str) -> Any:
        return lambda part, h, given: given is memory and calls.append((name, part, h))

    monkeypatch.setattr(crossing, "factorise_product", product)
    monkeypatch.setattr(crossing, "put_rates", lambda given: given is memory and calls.append("rates"))
    monkeypatch.setattr(crossing, "zero_of_pivot", zero)
    monkeypatch.setattr(crossing, "pivot_at_pose", lambda given: at_pose[looked[-1]])
    monkeypatch.setattr(crossing, "keep_position", noted("kept"))
    monkeypatch.setattr(crossing, "expand_product_at", noted("back"))
    return bool(crossing.passes_singular_position(0.5, memory)), calls


def test_pivots_that_change_their_signs_and_vanish(monkeypatch):
    reached, vanished = crossing.REACHED * 2.0, crossing.VANISHED * 2.0
    memory = two_ends([2 * reached, 2 * reached, 0.0], [0.0, 0.0, 0.0], [-1.0, -1.0, 1.0])
    found, calls = passed(monkeypatch, memory, {0: vanished, 1: 0.99 * vanished})
    assert found and calls == ["product", "rates", 0, ("back", 1.0, 0.5), 1, ("kept", 0.25, 0.5)]
    found, calls = passed(monkeypatch, memory, {0: vanished, 1: vanished})
    assert not found and calls[-1] == ("back", 1.0, 0.5) and calls.count("rates") == 1
    small = two_ends([reached, 0.0], [0.0, reached**2], [-1.0, -1.0])
    assert passed(monkeypatch, small, {}) == (False, ["product"]), "redundant rows"
    grown = two_ends([0.0, 0.0], [0.0, (1.01 * reached) ** 2], [1.0, -1.0])
    assert passed(monkeypatch, grown, {1: 0.0})[0]
    assert not passed(monkeypatch, two_ends([1.0], [1.0], [0.0]), {})[0]


def test_the_pose_inside_a_step_is_a_cubic(monkeypatch):
    """x(t) = 3 + 2 t - t² + 3 t³ over 0.5 s, from its values and rates at both ends."""
    normalised: list[Any] = []
    monkeypatch.setattr(crossing, "normalise", normalised.append)
    x = np.polynomial.Polynomial([3.0, 2.0, -1.0, 3.0])
    rate, h = x.deriv(), 0.5
    ends = SimpleNamespace(rates=np.array([[rate(0.0)], [rate(h)]]), pose=np.zeros(1))
    memory = SimpleNamespace(
        loop=SimpleNamespace(ends=ends),
        previous=SimpleNamespace(coordinates=np.array([x(0.0)])),
        state=SimpleNamespace(coordinates=np.array([x(h)])),
    )
    for part in (0.0, 0.2, 0.7, 1.0):
        crossing.put_pose(part, h, memory)
        assert ends.pose[0] == pytest.approx(x(part * h))
    assert len(normalised) == 4 and all(q is ends.pose for q in normalised)


def test_rates_at_both_ends_of_a_step(monkeypatch):
    monkeypatch.setattr(
        crossing, "coordinate_rates", lambda q, v, rates: rates.__setitem__(slice(None), q + v)
    )
    memory = SimpleNamespace(
        loop=SimpleNamespace(ends=SimpleNamespace(rates=np.zeros((2, 1)))),
        previous=SimpleNamespace(coordinates=np.array([1.0]), velocities=np.array([0.5])),
        state=SimpleNamespace(coordinates=np.array([2.0]), velocities=np.array([0.25])),
    )
    crossing.put_rates(memory)
    assert memory.loop.ends.rates.tolist() == [[1.5], [2.25]]


@pytest.mark.parametrize(
    ("function", "zero"),
    [
        (lambda s: 1.0 - 4.0 * s, 0.25),
        (lambda s: 1.0 - (s / 0.8) ** 5, 0.8),
        (lambda s: (0.1 - s) / (0.2 + s), 0.1),
        (lambda s: math.exp(-5.0 * s) - math.exp(-3.0), 0.6),
    ],
)
def test_the_place_where_a_pivot_vanishes(monkeypatch, function, zero):
    asked: list[float] = []
    ends = SimpleNamespace(
        pivots=np.array([9.0, function(1.0)]), squared_pivots=np.array([9.0, function(0.0)])
    )
    memory = SimpleNamespace(loop=SimpleNamespace(ends=ends))

    def expand(part: float, h: float, memory: Any) -> None:
        asked.append(part)
        ends.pivots[1] = function(part)

    monkeypatch.setattr(crossing, "expand_product_at", expand)
    found = crossing.zero_of_pivot(1, 0.5, memory)
    assert found == pytest.approx(zero, abs=2 * crossing.PLACE_ERROR) and asked[-1] == found
    first = function(0.0) / (function(0.0) - function(1.0))
    assert asked[0] == pytest.approx(first) and len(asked) <= 12


@pytest.mark.parametrize(
    ("error", "most", "found", "asked"),
    [
        (1e-9, 9, [0.5, 0.25, 0.0], [0.5, 5 / 9, 187 / 315]),
        (0.5, 9, [-1.0, 0.5], [0.5, 8 / 21]),  # the first interval has the length 0.5
        (0.51, 9, [-1.0], [0.5]),
        (1e-9, 2, [-1.0, 0.5, 0.5], [0.5, 8 / 21]),
        (1e-9, 9, [0.0], [0.5]),
    ],
)
def test_evaluations_that_locate_a_pivot(monkeypatch, error, most, found, asked):
    """From 4 and -4 at both ends; the value that stays is multiplied by f₁ / (f₁ + f₂) for equal signs."""
    monkeypatch.setattr(crossing, "PLACE_ERROR", error)
    monkeypatch.setattr(crossing, "SEARCH", most)
    ends = SimpleNamespace(pivots=np.array([9.0, -4.0]), squared_pivots=np.array([9.0, 4.0]))
    memory, parts, left = SimpleNamespace(loop=SimpleNamespace(ends=ends)), [], list(found)

    def expand(part: float, h: float, given: Any) -> None:
        assert h == 0.25 and given is memory
        parts.append(part)
        ends.pivots[1] = left.pop(0)

    monkeypatch.setattr(crossing, "expand_product_at", expand)
    assert crossing.zero_of_pivot(1, 0.25, memory) == parts[-1] and parts == pytest.approx(asked)


@pytest.mark.parametrize(
    ("loops", "reference", "pivot", "past", "passes", "meets", "kept"),
    [
        (1.0, 2.0, 1e-3, 1.0, False, True, True),
        (1.0, 2.0, 3e-3, 1.0, False, False, False),
        (1.0, 2.0, 3e-3, 1.0, True, True, False),
        (1.0, 2.0, 1e-3, 1e-3, False, False, False),
        (2.0, 2.0, 1e-3, 1e-3, True, True, False),
        (0.0, 2.0, 1e-3, 1.0, True, False, False),
        (1.0, 0.0, 1e-3, 1.0, True, False, False),
        (1.0, 1.0, 5e-4, 1.0, False, True, True),
    ],
)
def test_steps_that_reach_or_pass_a_singular_position(
    monkeypatch, loops, reference, pivot, past, passes, meets, kept
):
    """A pivot that falls to a thousandth of the reference ends the run; rows without loops never do."""
    watch = SimpleNamespace(reference_pivot=reference, smallest_pivot=pivot, past_pivot=past)
    memory, calls = SimpleNamespace(watch=watch, control=SimpleNamespace(closed_loops=loops)), []
    monkeypatch.setattr(crossing, "keep_position", lambda *given: calls.append(given))
    monkeypatch.setattr(
        crossing, "passes_singular_position", lambda h, given: h == 0.25 and given is memory and passes
    )
    assert crossing.meets_singular_position(0.25, memory) is meets
    assert calls == [(1.0, 0.25, memory)] * kept


def test_the_place_and_the_pose_of_a_singular_position_are_kept(monkeypatch):
    calls: list[Any] = []
    monkeypatch.setattr(crossing, "put_pose", lambda *given: calls.append(given))
    memory = SimpleNamespace(watch=SimpleNamespace(singular_part=9.0))
    crossing.keep_position(0.75, 0.5, memory)
    assert memory.watch.singular_part == 0.75 and calls == [(0.75, 0.5, memory)]


def test_the_least_pivot_of_the_independent_rows(monkeypatch):
    """Squares of 9, 4, 1 and 0.25: with three independent rows the least pivot is 1."""
    factor = SimpleNamespace(squared_pivots=np.zeros(4))

    def find(given: Any) -> None:
        given.squared_pivots[:] = [9.0, 0.25, 4.0, 1.0]

    monkeypatch.setattr(crossing, "find_squared_pivots", find)
    monkeypatch.setattr(crossing, "sort", lambda squares: squares.sort())
    memory = SimpleNamespace(factor=factor, watch=SimpleNamespace(generic_rank=3))
    assert crossing.pivot_at_pose(memory) == 1.0
    memory.watch.generic_rank = 4
    assert crossing.pivot_at_pose(memory) == 0.5
    memory.watch.generic_rank = 0
    assert crossing.pivot_at_pose(memory) == 1.0


def test_an_accepted_step_is_remembered(monkeypatch):
    kept: list[Any] = []
    monkeypatch.setattr(crossing, "keep_end", kept.append)
    for near, nearest in ((0.5, 0.4), (0.3, 0.3)):
        monkeypatch.setattr(crossing, "relative_pivot", lambda watch, near=near: near)
        watch = SimpleNamespace(past_pivot=9.0, smallest_pivot=0.125, nearest=0.4)
        memory = SimpleNamespace(watch=watch)
        crossing.remember_watch(memory)
        assert (watch.past_pivot, watch.nearest) == (0.125, nearest) and kept[-1] is memory


def test_the_product_inside_of_a_step(monkeypatch):
    calls: list[Any] = []
    for name in ("put_pose", "evaluate", "factorise_constraints", "factorise_product"):
        monkeypatch.setattr(crossing, name, lambda *given, name=name: calls.append((name, *given)))
    ends = SimpleNamespace(pose="pose", gradient="gradient")
    memory = SimpleNamespace(
        loop=SimpleNamespace(ends=ends, clock=SimpleNamespace(time=2.0)),
        state=SimpleNamespace(velocities="v"),
        equations="equations",
        factor="factor",
    )
    crossing.expand_product_at(0.25, 0.5, memory)
    assert calls == [
        ("put_pose", 0.25, 0.5, memory),
        ("evaluate", 2.125, "pose", "v", "equations"),
        ("factorise_constraints", memory),
        ("factorise_product", "factor", "gradient", crossing.PRODUCT_ALPHA, ends),
    ]


# --- coordinate partitioning ------------------------------------------------------------------------------
def part_memory(**changes: Any) -> Any:
    """Four coordinates, of which 2 and 0 depend on 3 and 1."""
    counts = SimpleNamespace(newton=0, factorisations=0)
    chart = SimpleNamespace(
        column_order=np.array([2, 0, 3, 1]),
        row_order=np.array([1, 2, 0]),
        partition=SimpleNamespace(rank=2, pivot=0.5, chosen_pivot=1.0),
        residual=np.array([0.5, 0.25, 9.0]),
        dependent=np.zeros((2, 2)),
        exchanges="exchanges",
        jacobian=np.arange(12.0).reshape(3, 4),
    )
    memory = SimpleNamespace(
        chart=chart,
        state=SimpleNamespace(coordinates=np.zeros(4), velocities="v", coordinate_rates=np.zeros(4)),
        previous="previous",
        equations=SimpleNamespace(
            rows=SimpleNamespace(nu=np.array([5.0, 7.0])),
            system=SimpleNamespace(counts=counts, settings=SimpleNamespace(newton_tolerance=1e-6)),
        ),
        watch=SimpleNamespace(accepted_time=0.0),
        chart_options=SimpleNamespace(kept=0.6),
    )
    vars(chart.partition).update(changes)
    return memory


@pytest.fixture
def parts(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Open the parts of memory as they are."""
    monkeypatch.setattr(partitioning, "scratch_of", lambda chart: chart)
    monkeypatch.setattr(partitioning, "options_of", lambda options: options)
    return monkeypatch


@pytest.mark.parametrize(
    ("violations", "factors", "status", "newton"),
    [
        ([1e-6], [True], OK, 0),
        ([1e-3, 1e-7], [True, True], OK, 1),
        ([2e-6, 2e-6], [True, True], OK, 1),
        ([0.5, 0.5, 1e-7], [True] * 3, OK, 2),
        ([1e-3], [False], NOT_CONVERGED, 0),
        ([1e-3, 1e-4], [True, False], NOT_CONVERGED, 1),
        ([0.5] * 99, [True] * 99, NOT_CONVERGED, partitioning.MOST_DEPENDENT_STEPS),
    ],
)
def test_newton_steps_of_the_dependent_coordinates(parts, violations, factors, status, newton):
    """A residual of (0.5, 0.25) is subtracted from coordinates 2 and 0; one that stays is rounding."""
    memory, left, good = part_memory(), list(violations), list(factors)
    evaluated: list[Any] = []
    chart, solved = memory.chart, []

    def predict(t: float, given: Any) -> None:
        assert t == 0.5 and given is memory
        evaluated.append("predicted")

    def evaluate(t: float, q: np.ndarray, *others: Any) -> None:
        assert t == 0.5 and others == ("v", memory.equations)
        evaluated.append(q.tolist())

    parts.setattr(partitioning, "predict_dependent", predict)
    parts.setattr(partitioning, "evaluate", evaluate)
    parts.setattr(partitioning, "find_violation", lambda given: given is memory and left.pop(0))
    parts.setattr(partitioning, "factorise_dependent", lambda given: given is memory and good.pop(0))
    parts.setattr(partitioning, "lu_solve", lambda *given: solved.append(given))
    y = np.array([8.0, 9.0, 1.0, 1.0])
    assert partitioning.solve_dependent_coordinates(0.5, y, memory) == status
    assert memory.equations.system.counts.newton == newton
    assert memory.state.coordinates.tolist() == [-0.25 * newton, 9.0, -0.5 * newton, 8.0]
    assert evaluated[:2] == ["predicted", [0.0, 9.0, 0.0, 8.0]]
    assert len(solved) == newton
    for given in solved:
        assert given[0] is chart.dependent and given[1:3] == (2, "exchanges") and given[3] is chart.residual


def test_rates_of_the_dependent_coordinates(parts):
    """Rows 1 and 2, the latter of Euler parameters; independent rates 10 and 20 of coordinates 3 and 1."""
    memory = part_memory()
    found: list[Any] = []

    def solve(a: np.ndarray, rank: int, exchanges: Any, b: np.ndarray) -> None:
        assert a is memory.chart.dependent and (rank, exchanges) == (2, "exchanges")
        found.append(b[:2].tolist())

    parts.setattr(partitioning, "lu_solve", solve)
    parts.setattr(
        partitioning,
        "velocities_of_rates",
        lambda state: found.append("velocities" * (state is memory.state)),
    )
    partitioning.solve_dependent_rates(np.array([8.0, 9.0, 10.0, 20.0]), memory)
    residual = [7.0 - (7.0 * 10 + 5.0 * 20), 0.0 - (11.0 * 10 + 9.0 * 20)]
    assert found == [residual, "velocities"]
    assert memory.state.coordinate_rates.tolist() == [residual[1], 20.0, residual[0], 10.0]


def test_the_factor_of_the_dependent_coordinates(parts):
    """Rows 1 and 2 of columns 2 and 0; pivots 4 and -0.5 have the ratio 0.125."""
    memory = part_memory()
    seen: list[Any] = []

    def jacobian(q: np.ndarray, equations: Any, a: np.ndarray) -> None:
        assert q is memory.state.coordinates and equations is memory.equations and a is memory.chart.jacobian

    parts.setattr(partitioning, "jacobian_by_euler_parameters", jacobian)
    pivots: list[tuple[float, float]] = []

    def factor(lu: np.ndarray, rank: int, exchanges: Any, least: float) -> bool:
        assert lu is memory.chart.dependent
        assert (rank, exchanges, least) == (2, "exchanges", partitioning.SINGULAR_DEPENDENT)
        seen.append(lu.copy().tolist())
        lu[0, 0], lu[1, 1] = pivots[-1]
        return bool(lu[0, 0] != 4.0 or lu[1, 1] < 0.0)

    parts.setattr(partitioning, "lu_factor", factor)
    for first, second, regular in ((4.0, -0.5, True), (-0.5, 4.0, True), (4.0, 0.5, False)):
        pivots.append((first, second))
        assert partitioning.factorise_dependent(memory) is regular
        assert memory.chart.partition.pivot == 0.125
    assert seen[0] == [[6.0, 4.0], [10.0, 8.0]]
    assert memory.equations.system.counts.factorisations == 3


@pytest.mark.parametrize(
    ("changes", "rank", "status", "chosen"),
    [
        ({"pivot": 0.6, "chosen_pivot": 1.0}, 2, OK, False),
        ({"pivot": 0.59, "chosen_pivot": 1.0}, 2, CHANGED, True),
        ({"pivot": 0.59, "chosen_pivot": 1.0}, 1, SINGULAR_AHEAD, True),
        ({"pivot": 0.01, "chosen_pivot": 0.0}, 2, OK, False),
    ],
)
def test_when_the_partition_is_chosen_anew(parts, changes, rank, status, chosen):
    memory, calls = part_memory(**changes), []

    def choose(memory: Any) -> None:
        calls.append("chosen")
        memory.chart.partition.rank = rank

    def noted(name: str, result: Any = None) -> Any:
        return lambda *given: calls.append((name, *given)) or result

    for name in ("solve_dependent_rates", "copy_state", "gather_independent"):
        parts.setattr(partitioning, name, noted(name))
    parts.setattr(partitioning, "solve_dependent_coordinates", noted("coordinates", OK))
    parts.setattr(partitioning, "choose_coordinates", choose)
    assert partitioning.accept.function(0.75, "y", memory) == status
    assert calls == [
        ("coordinates", 0.75, "y", memory),
        ("solve_dependent_rates", "y", memory),
        ("copy_state", memory.state, "previous"),
        *["chosen"] * chosen,
        *[("gather_independent", "y", memory)] * (status == CHANGED),
    ]
    assert memory.watch.accepted_time == 0.75
    if changes["chosen_pivot"] == 0.0:
        assert memory.chart.partition.chosen_pivot == 0.01
    parts.setattr(partitioning, "solve_dependent_coordinates", lambda *_: NOT_CONVERGED)
    assert partitioning.accept.function(0.75, "y", memory) == NOT_CONVERGED


@pytest.mark.parametrize(
    ("solved", "accelerated", "status"), [(OK, OK, OK), (SINGULAR, OK, SINGULAR), (OK, SINGULAR, SINGULAR)]
)
def test_rates_of_the_independent_coordinates(parts, solved, accelerated, status):
    memory = part_memory()
    memory.state.coordinate_second = np.array([1.0, 2.0, 3.0, 4.0])
    memory.equations.system.acceleration = "acceleration"
    calls: list[Any] = []

    def noted(name: str, result: Any = None) -> Any:
        return lambda *given: calls.append((name, *given)) or result

    system = memory.equations.system
    memory.kernels = SimpleNamespace(accelerate=noted("accelerate", accelerated))
    for name in ("solve_dependent_rates", "assemble_system", "second_rates"):
        parts.setattr(partitioning, name, noted(name))
    parts.setattr(partitioning, "solve_dependent_coordinates", noted("coordinates", solved))
    rates, y = np.zeros(4), np.array([8.0, 9.0, 10.0, 20.0])
    memory.state.coordinates = "q"
    assert partitioning.rates.function(0.5, y, rates, memory) == status
    expected = [
        ("coordinates", 0.5, y, memory),
        ("solve_dependent_rates", y, memory),
        ("assemble_system", 0.5, "q", "v", memory.equations),
        ("accelerate", system),
        ("second_rates", "acceleration", memory.state),
    ]
    assert calls == (expected if solved == OK else expected[:1])
    assert rates.tolist() == ([10.0, 20.0, 4.0, 2.0] if solved == OK else [0.0] * 4)


# --- the start of a step ----------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("tolerance", "rank", "parity"), [(0.13, 3, True), (0.15, 2, True), (1.6, 1, False), (4.1, 0, False)]
)
def test_the_partition_by_complete_pivoting(monkeypatch, tolerance, rank, parity):
    """Pivots -4, then 1.5 of the first row, then -0.14 of the last row; each exchange changes the parity."""
    gradient = np.zeros((3, 8))
    gradient[:, :4] = [[1.0, 2.0, 0.0, 0.5], [0.1, -4.0, 3.0, 1.0], [0.0, 0.0, 0.2, 0.1]]
    gradient[:, 5] = 99.0  # no variable
    solver = SimpleNamespace(
        pivot_rows=np.array([7, 7, 7]),
        pivot_columns=np.array([7, 7, 7, 7]),
        tableau=gradient,
        row_max=np.zeros(3),
        left=np.zeros(8),
    )
    put: list[int] = []
    monkeypatch.setattr(step_start, "put_rows", lambda memory: put.append(1))
    settings = SimpleNamespace(rank_tolerance=tolerance)
    memory = SimpleNamespace(
        solver=solver,
        series=SimpleNamespace(variable=np.array([1.0] * 4 + [0.0] * 4)),
        partition=SimpleNamespace(partition_id=6, parity=None),
        run=SimpleNamespace(equations=SimpleNamespace(system=SimpleNamespace(settings=settings))),
    )
    assert step_start.choose.function(memory) == rank and memory.partition.parity is parity
    assert memory.partition.partition_id == 7 and put == [1]
    free = np.array([1.0] * 4 + [0.0] * 4)
    free[solver.pivot_columns[:rank]] = 0.0
    assert solver.left.tolist() == free.tolist()
    if rank >= 2:
        assert solver.pivot_rows.tolist() == [1, 0, 2] and solver.pivot_columns.tolist() == [1, 2, 0, 3]
    if rank == 3:
        assert solver.row_max[2] == pytest.approx(0.14) and solver.row_max[0] == pytest.approx(1.5)


@pytest.mark.parametrize(("first", "place"), [(0, 1), (1, 1), (2, 2), (3, 3)])
def test_the_first_of_equal_rows_is_chosen(first, place):
    """Entries 3, 5, 5 and 4 of rows 2, 0, 3 and 1."""
    sizes, rows = np.array([5.0, 4.0, 3.0, 5.0]), np.array([2, 0, 3, 1])
    assert step_start.place_of_largest_row(sizes, rows, first) == place


def test_the_series_at_the_start_of_a_step_is_saved():
    terms = np.arange(40.0).reshape(5, 8)
    size = step_start.TORSION_SERIES
    torsions = np.arange(2.0 * size * 5).reshape(2 * size, 5)
    series = SimpleNamespace(
        terms=terms, past=np.zeros((5, 8)), past_angles=np.full((2, 5), 7.0), torsions=torsions
    )
    step = SimpleNamespace(last_order=0, used_order=0, time_to_pole=9.0)
    step_start.save_series(SimpleNamespace(series=series, step=step, mode=SimpleNamespace(order=3)))
    assert series.past.tolist() == [*terms[:4].tolist(), [0.0] * 8]
    for s in range(2):
        angles = torsions[size * s + step_start.TORSION]
        assert series.past_angles[s].tolist() == [*angles[:3], 0.0, 7.0]
    assert (step.last_order, step.used_order, step.time_to_pole) == (3, 3, 0.0)


@pytest.mark.parametrize(("chosen", "calls"), [(4, []), (5, ["partition", "pivots"])])
def test_a_failed_attempt_returns_to_the_start_of_the_step(monkeypatch, chosen, calls):
    past, terms, found = np.arange(24.0).reshape(3, 8), np.zeros((3, 8)), []
    memory = SimpleNamespace(
        series=SimpleNamespace(past=past, terms=terms),
        step=SimpleNamespace(start_violation=0.0, start_partition_id=4),
        partition=SimpleNamespace(partition_id=chosen, rank=0),
        kernels=SimpleNamespace(partition=lambda memory: found.append("partition"), choose=lambda memory: 5),
    )
    monkeypatch.setattr(step_start, "violation", lambda memory: 0.25)
    monkeypatch.setattr(step_start, "save_start_pivots", lambda memory: found.append("pivots"))
    assert step_start.return_to_start.function(memory) == OK and found == calls
    assert terms.tolist() == [*past[:2].tolist(), [0.0] * 8] and memory.step.start_violation == 0.25
    monkeypatch.setattr(step_start, "factorise_anew", lambda memory: found.append("factor"))
    assert step_start.choose_partition.function(memory) == 5 == memory.partition.rank
    assert found[-1] == "factor"
