"""Projection, partition and charts of ``mbref.stabilisation``, part by part / numbers worked out by hand.

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

from mbref.kernels.layout import NOT_CONVERGED, OK, SINGULAR
from mbref.stabilisation import STABILISATIONS, all_coordinates, partitioning, projection

SIZE = projection.INDEPENDENT  # squared pivot


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Replace functions of a module by others with these results, and return the list of their calls."""
    made: list[Any] = []

    def replace(module: Any, **results: Any) -> list[Any]:
        for name, result in results.items():
            monkeypatch.setattr(
                module, name, lambda *given, name=name, result=result: made.append((name, *given)) or result
            )
        return made

    return replace


# --- pivots -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("squares", "generic", "reference", "expected"),
    [
        ([1.0, 0.04, 1e-5], 0, 0.9, (2, 0.2, 0.2)),
        ([0.04, 1.0, 1e-5], 2, 0.9, (2, 0.2, 0.9)),
        ([0.04, 1.0, 1e-5], 2, 0.1, (2, 0.2, 0.2)),
        ([1.0, 0.04, 1e-6], 3, 0.9, (3, 1e-3, 0.9)),
        ([1e-6, 0.04, 1e-4], 2, 0.9, (2, 1e-2, 0.9)),
        ([1e-5], 0, 0.0, (0, 0.0, 0.05)),
        ([1e-5], 0, 0.3, (0, 0.0, 0.3)),
        ([0.0009], 1, 0.0, (1, 0.03, 0.05)),
        ([4.0, 9.0], 0, 0.0, (2, 1.0, 1.0)),
        ([1.0, SIZE], 0, 0.0, (1, 1.0, 1.0)),
        ([], 0, 0.0, (0, 0.0, 0.05)),
    ],
)
def test_pivots_that_are_watched(squares, generic, reference, expected):
    """Rank so far, the smallest pivot of as many rows, and its largest value since the rank grew."""
    pivots, record = (
        np.full(len(squares), 7.0),
        SimpleNamespace(generic_rank=generic, reference_pivot=reference),
    )
    projection.watch(np.array(squares), pivots, record)
    assert pivots == pytest.approx(np.sqrt(squares))
    found = record.generic_rank, record.smallest_pivot, record.reference_pivot
    assert found == pytest.approx(expected)


def test_watched_pivots_belong_to_the_factor(calls):
    factor = SimpleNamespace(squared_pivots="squares")
    memory = SimpleNamespace(factor=factor, pivots="pivots", watch="watch")
    made = calls(projection, find_squared_pivots=None, watch=None)
    projection.watch_pivots(memory)
    assert made == [("find_squared_pivots", factor), ("watch", "squares", "pivots", "watch")]


def test_gradient_and_pivots_of_the_end_of_a_step():
    ends = SimpleNamespace(gradient=np.zeros(3), squared_pivots=np.zeros(2))
    factor = SimpleNamespace(d=np.array([1.0, 2.0, 3.0]))
    projection.keep_end(
        SimpleNamespace(loop=SimpleNamespace(ends=ends), factor=factor, pivots=np.array([0.5, 3.0]))
    )
    assert ends.gradient.tolist() == [1.0, 2.0, 3.0] and ends.squared_pivots.tolist() == [0.25, 9.0]


def test_the_factor_of_the_constraints(calls):
    blocks = np.arange(6.0).reshape(2, 3)
    system = SimpleNamespace(counts=SimpleNamespace(factorisations=2), blocks=blocks)
    scene = SimpleNamespace(metric_root="root")
    memory = SimpleNamespace(equations=SimpleNamespace(system=system, scene=scene), factor="factor")
    made = calls(projection, regularised_factor="made")
    assert projection.factorise_constraints(memory) == "made" and system.counts.factorisations == 3
    [(_, factor, numbers, root, alpha)] = made
    assert (factor, root, alpha) == ("factor", "root", 1e10) and numbers.tolist() == blocks.ravel().tolist()


@pytest.mark.parametrize("good", [True, False])
def test_entry_of_a_run(calls, good):
    watch = SimpleNamespace(smallest_pivot=0.25, past_pivot=9.0)
    active = SimpleNamespace(coordinates=np.zeros(3), velocities=np.zeros(2))
    state = SimpleNamespace(coordinates="q", velocities="v")
    memory = SimpleNamespace(watch=watch, active=active, state=state, equations="equations")
    made = calls(
        projection, evaluate=None, factorise_constraints=good, watch_pivots=None, keep_end=None, contract=None
    )
    assert projection.enter.function(0.5, "y", memory) == 5
    between = [("watch_pivots", memory), ("keep_end", memory)] if good else []
    assert made == [
        ("evaluate", 0.5, "q", "v", "equations"),
        ("factorise_constraints", memory),
        *between,
        ("contract", "q", "v", active, "y"),
    ]
    assert watch.past_pivot == (0.25 if good else 9.0)


# --- corrections ------------------------------------------------------------------------------------------
def test_a_violation_is_removed_in_the_order_of_the_factor(calls):
    factor = SimpleNamespace(symbolic=SimpleNamespace(row=np.array([2, 0])), residual=np.full(2, 7.0))
    made = calls(projection, solve_fixed_iterations=None)
    projection.remove_violation(np.array([0.5, 99.0, -0.25]), 3, factor, "target")
    assert made == [("solve_fixed_iterations", factor, 3, "target")] and factor.residual.tolist() == [
        0.25,
        -0.5,
    ]


def correcting(phi: Any = (0.0,), correction: Any = (0.0,), **settings: float) -> Any:
    """Memory of a run whose Newton tolerance is 1e-13 and whose rounding is 1e-15."""
    numbers = SimpleNamespace(newton_tolerance=1e-13, rounding=1e-15, **settings)
    system = SimpleNamespace(settings=numbers, counts=SimpleNamespace(newton=0))
    rows = SimpleNamespace(phi=np.array(phi), phi_rate="phi'")
    return SimpleNamespace(
        state=SimpleNamespace(coordinates="q", velocities="v"),
        chart=SimpleNamespace(correction=np.array(correction)),
        equations=SimpleNamespace(rows=rows, system=system),
        factor="factor",
        active="active",
    )


@pytest.mark.parametrize(
    ("violation", "before", "correction", "good", "factors", "corrects", "result"),
    [
        (1e-3, math.inf, 0.0, True, 1, 1, 1e-3),
        (1e-3, math.inf, 0.0, False, 1, 0, -1.0),
        (1e-14, 1e-9, 0.0, False, 0, 1, 1e-14),
        (1e-11, 1e-9, 0.0, False, 0, 1, 1e-11),
        (2e-11, 1e-9, 0.0, True, 1, 1, 2e-11),
        (2e-11, 1e-9, 0.0, False, 1, 0, -1.0),
        (1e-14, 1e-9, 0.0317e-6, False, 1, 0, -1.0),
        (1e-14, 1e-9, 0.0315e-6, False, 0, 1, 1e-14),
        (1e-15, 1e-9, 0.0, True, 0, 0, 1e-15),
        (-2e-15, 1e-9, 0.0, True, 0, 1, 2e-15),
        (1e-13, 1e-12, 0.0, True, 0, 1, 1e-13),
    ],
)
def test_a_newton_step_of_positions(calls, violation, before, correction, good, factors, corrects, result):
    memory = correcting([0.0, violation], [0.0, -correction])
    made = calls(projection, evaluate=None, factorise_constraints=good, correct_positions=None)
    assert projection.newton_step(0.5, before, memory) == result
    assert made[0] == ("evaluate", 0.5, "q", "v", memory.equations)
    assert [name for name, *_ in made[1:]] == ["factorise_constraints"] * factors + [
        "correct_positions"
    ] * corrects
    assert memory.chart.correction.tolist() == ([0.0, -correction] if result < 0 else [0.0, 0.0])


def test_a_violation_that_is_no_number_is_corrected(calls):
    made = calls(projection, evaluate=None, factorise_constraints=True, correct_positions=None)
    assert math.isnan(projection.newton_step(0.5, 1e-9, correcting([math.nan])))
    assert made[-1][0] == "correct_positions"


def test_a_correction_of_positions(calls):
    memory = correcting()
    memory.chart.change = "change"
    made = calls(projection, remove_violation=None, displace=None)
    projection.correct_positions(memory)
    assert made == [
        ("remove_violation", memory.equations.rows.phi, 1, "factor", memory.chart.correction),
        ("displace", "q", memory.chart.correction, "change"),
    ]


@pytest.mark.parametrize(
    ("violations", "status"),
    [
        ([1e-13], OK),
        ([1e-3, 1e-13], OK),
        ([1e-3, 5e-11, 5e-11], OK),
        ([1e-3, 5e-11, 6e-11], OK),
        ([5e-11, 4e-11, 1e-13], OK),
        ([1e-3, 1e-3, 2e-10, 3e-10, 1e-14], OK),
        ([-1.0], SINGULAR),
        ([1e-3, -1.0], SINGULAR),
        ([1.0 / (k + 1) for k in range(10)], NOT_CONVERGED),
        ([1e-9 - k * 1e-10 for k in range(10)], NOT_CONVERGED),
        ([9.9e-11 - k * 1e-12 for k in range(10)], OK),
        ([math.nan] * 10, NOT_CONVERGED),
    ],
)
def test_positions_are_corrected_until_the_violation_is_rounding(monkeypatch, violations, status):
    """Tolerance 1e-13; up to 1e-10 a violation that does not fall any more is rounding."""
    memory, left, given = correcting(), list(violations), []
    monkeypatch.setattr(
        projection, "newton_step", lambda t, before, memory: given.append((t, before)) or left.pop(0)
    )
    assert projection.project_positions(0.5, memory) == status and not left
    assert memory.equations.system.counts.newton == len(violations)
    if not math.isnan(violations[0]):
        assert given == [(0.5, before) for before in (math.inf, *violations[:-1])]


@pytest.mark.parametrize(
    ("projected", "followed", "status"),
    [
        (OK, True, OK),
        (OK, False, SINGULAR),
        (NOT_CONVERGED, True, NOT_CONVERGED),
        (SINGULAR, False, SINGULAR),
    ],
)
def test_an_accepted_step_is_projected(calls, projected, followed, status):
    memory = correcting()
    made = calls(
        projection,
        expand=None,
        project_positions=projected,
        follow_last_correction=followed,
        watch_pivots=None,
        project_velocities=None,
        contract=None,
        flush_denormals=None,
    )
    assert projection.accept.function(0.5, "y", memory) == status
    first = [("expand", "y", "active", memory.state), ("project_positions", 0.5, memory)]
    second = [("follow_last_correction", 0.5, memory)] if projected == OK else []
    last = [
        ("watch_pivots", memory),
        ("project_velocities", memory),
        ("contract", "q", "v", "active", "y"),
        ("flush_denormals", "y"),
    ]
    assert made == first + second + (last if status == OK else [])


@pytest.mark.parametrize(
    ("correction", "good", "result", "follows"),
    [(3.1e-14, True, True, 1), (-3.1e-14, False, False, 1), (2.9e-14, False, True, 0), (0.0, False, True, 0)],
)
def test_rows_follow_a_last_correction_of_more_than_rounding(calls, correction, good, result, follows):
    memory = correcting(correction=[0.0, correction])
    made = calls(projection, evaluate=None, factorise_constraints=good)
    assert projection.follow_last_correction(0.5, memory) is result
    wanted = [("evaluate", 0.5, "q", "v", memory.equations), ("factorise_constraints", memory)]
    assert made == (wanted if follows else [])


def test_the_projection_of_velocities(calls):
    memory = correcting()
    made = calls(projection, violation_rate=None, remove_violation=None)
    projection.project_velocities(memory)
    assert made == [("violation_rate", "v", memory.equations), ("remove_violation", "phi'", 2, "factor", "v")]


# --- dependent rows ---------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("pivots", "rank", "regular", "found"),
    [
        ([1.0, 0.003, 0.5], 2, 1, True),
        ([1.0, 0.003, 0.5], 2, 0, False),
        ([1.0, 0.003, 0.5], 3, 1, False),
        ([1.0, 0.0031, 0.5], 2, 1, False),
        ([1.0, 0.05, 0.0], 2, 1, True),
        ([1.0, 0.049, 0.0], 2, 1, False),
        ([1.0, 0.5], 2, 1, False),
        ([0.0, 0.0], 0, 1, True),
        ([], 0, 1, False),
    ],
)
def test_rows_that_depend_on_others(pivots, rank, regular, found):
    watch = SimpleNamespace(regular=regular, generic_rank=rank)
    assert projection.depend_on_others(SimpleNamespace(pivots=np.array(pivots), watch=watch)) == found


@pytest.mark.parametrize("dense", [0, 4])
def test_dependent_rows_are_left_out_and_put_back(dense):
    """The pivots of rows 3 and 1; that of row 1 is at the limit."""
    blocks, jacobian = np.arange(1.0, 9.0).reshape(4, 2), np.ones((dense, 5))
    system = SimpleNamespace(blocks=blocks.copy(), rhs=np.arange(1.0, 5.0), jacobian=jacobian)
    chart = SimpleNamespace(blocks=np.full((4, 2), 7.0))
    memory = SimpleNamespace(
        pivots=np.array([0.5, 3e-3]),
        factor=SimpleNamespace(symbolic=SimpleNamespace(row=np.array([3, 1]))),
        equations=SimpleNamespace(system=system),
        chart=chart,
    )
    projection.leave_out_dependent_rows(memory)
    assert system.blocks.tolist() == [[1.0, 2.0], [0.0, 0.0], [5.0, 6.0], [7.0, 8.0]]
    assert system.rhs.tolist() == [1.0, 0.0, 3.0, 4.0]
    assert jacobian.tolist() == [[1.0 - (row == 1)] * 5 for row in range(dense)]
    assert chart.blocks.tolist() == [[7.0, 7.0], [3.0, 4.0], [7.0, 7.0], [7.0, 7.0]]
    system.blocks[3] = 9.0
    projection.put_back_dependent_rows(memory)
    assert system.blocks.tolist() == [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0], [9.0, 9.0]]


@pytest.mark.parametrize("some", [True, False])
def test_rates_without_dependent_rows(calls, some):
    memory = correcting()
    made = calls(
        projection,
        expand=None,
        assemble_system=None,
        depend_on_others=some,
        leave_out_dependent_rows=None,
        put_back_dependent_rows=None,
        write_rates=None,
    )
    memory.kernels = SimpleNamespace(
        accelerate=lambda system: made.append(("accelerate", system)) or SINGULAR
    )
    assert projection.rates.function(0.5, "y", "y'", memory) == SINGULAR
    assert made == [
        ("expand", "y", "active", memory.state),
        ("assemble_system", 0.5, "q", "v", memory.equations),
        ("depend_on_others", memory),
        *[("leave_out_dependent_rows", memory)] * some,
        ("accelerate", memory.equations.system),
        *[("put_back_dependent_rows", memory)] * some,
        ("write_rates", "y'", memory),
    ]


# --- all coordinates --------------------------------------------------------------------------------------
def charted() -> Any:
    """A body that moves along x and turns about z: coordinates 0, 3 and 6, velocities 0 and 5."""
    active = SimpleNamespace(coordinates=np.array([0, 3, 6]), velocities=np.array([0, 5]))
    state = SimpleNamespace(
        coordinates=np.array([1.0, 2.0, 3.0, 0.8, 0.0, 0.0, 0.6]),
        velocities=np.array([4.0, 0, 0, 0, 0, 5.0]),
        coordinate_rates=np.zeros(7),
    )
    system = SimpleNamespace(acceleration=np.array([6.0, 9.0, 9.0, 9.0, 9.0, 7.0]))
    return SimpleNamespace(active=active, state=state, equations=SimpleNamespace(system=system))


def test_the_chart_of_all_coordinates(calls):
    memory, y = charted(), np.full(6, 9.0)
    assert all_coordinates.enter.function(0.5, y, memory) == 5
    assert y.tolist() == [1.0, 0.8, 0.6, 4.0, 5.0, 9.0]
    rate = np.full(6, 9.0)
    made = calls(all_coordinates, assemble_system=None)
    memory.kernels = SimpleNamespace(
        accelerate=lambda system: made.append(("accelerate", system)) or SINGULAR
    )
    assert all_coordinates.rates.function(0.5, np.array([3.0, 0.6, 0.8, 2.0, 1.0]), rate, memory) == SINGULAR
    assert memory.state.coordinates.tolist() == [3.0, 2.0, 3.0, 0.6, 0.0, 0.0, 0.8]
    assert memory.state.velocities.tolist() == [2.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    q, v, system = memory.state.coordinates, memory.state.velocities, memory.equations.system
    assert [name for name, *_ in made] == ["assemble_system", "accelerate"] and made[1][1] is system
    assert made[0][1] == 0.5 and made[0][2] is q and made[0][3] is v and made[0][4] is memory.equations
    assert rate.tolist() == [2.0, -0.4, 0.3, 6.0, 7.0, 9.0], "p' = ½ p (0, ω')"


def test_quaternions_of_an_accepted_step_have_length_one():
    memory, y = charted(), np.array([3.0, 1.2, 1.6, 2.0, 1.0])
    assert all_coordinates.accept.function(0.5, y, memory) == OK
    assert y == pytest.approx([3.0, 0.6, 0.8, 2.0, 1.0]) and memory.state.coordinates[3] == pytest.approx(0.6)


# --- the choice of a partition ----------------------------------------------------------------------------
def test_independent_coordinates_of_a_state(calls):
    """Rank 2 of five coordinates."""
    state = SimpleNamespace(coordinates=np.zeros(5), velocities="v", coordinate_rates="q'")
    chart = SimpleNamespace(
        jacobian=np.zeros((3, 4)),
        row_order="rows",
        column_order="columns",
        partition=SimpleNamespace(rank=9, chosen_pivot=9.0),
    )
    counts, clock = SimpleNamespace(factorisations=4), SimpleNamespace(y_size=9)
    system = SimpleNamespace(counts=counts, settings=SimpleNamespace(rank_tolerance=1e-7))
    memory = SimpleNamespace(
        state=state,
        chart=chart,
        equations=SimpleNamespace(system=system),
        loop=SimpleNamespace(clock=clock),
        previous="previous",
        watch=SimpleNamespace(accepted_time=9.0),
    )
    made = calls(partitioning, jacobian_by_euler_parameters=None, full_pivot=2)
    partitioning.choose_coordinates(memory)
    assert made == [
        ("jacobian_by_euler_parameters", state.coordinates, memory.equations, chart.jacobian),
        ("full_pivot", chart.jacobian, 3, 4, "rows", "columns", 1e-7),
    ]
    assert (chart.partition.rank, chart.partition.chosen_pivot, counts.factorisations) == (2, 0.0, 5)
    assert clock.y_size == 6
    made.clear()
    calls(
        partitioning,
        coordinate_rates=None,
        evaluate=None,
        choose_coordinates=None,
        copy_state=None,
        gather_independent=6,
    )
    assert partitioning.enter.function(0.5, "y", memory) == 6 and memory.watch.accepted_time == 0.5
    assert made == [
        ("coordinate_rates", state.coordinates, "v", "q'"),
        ("evaluate", 0.5, state.coordinates, "v", memory.equations),
        ("choose_coordinates", memory),
        ("copy_state", state, "previous"),
        ("gather_independent", "y", memory),
    ]


@pytest.mark.parametrize("rows", [[1, 3, 0], [3, 2, 1]])
def test_violations_of_rows_and_of_euler_parameters(rows):
    """Φ = (3, -4) and pᵀp - 1 of the second body, 0.25 + 0.04 + 0.09 + 0.16 - 1."""
    q = np.array([9.0, 9, 9, 1, 0, 0, 0, 9, 9, 9, 0.5, -0.2, 0.3, 0.4])
    chart = SimpleNamespace(
        row_order=np.array(rows), partition=SimpleNamespace(rank=2), residual=np.full(3, 7.0)
    )
    memory = SimpleNamespace(
        state=SimpleNamespace(coordinates=q),
        chart=chart,
        equations=SimpleNamespace(rows=SimpleNamespace(phi=np.array([3.0, -4.0]))),
    )
    largest = partitioning.find_violation(memory)
    of_row = {1: -4.0, 2: 0.0, 3: 0.54 - 1.0}
    wanted = [of_row[row] for row in rows[:2]]
    assert chart.residual[:2] == pytest.approx(wanted) and chart.residual[2] == 7.0
    assert largest == pytest.approx(max(map(abs, wanted)))


def test_second_rates_of_two_bodies():
    """p = (1, 0, 0, 0): p'' = (0, ½ ω̇') - ¼ ω² p, with ω² = 14 and 3."""
    state = SimpleNamespace(
        coordinates=np.array([0.0, 0, 0, 1, 0, 0, 0] * 2),
        velocities=np.array([9.0, 9, 9, 1, 2, 3, 9, 9, 9, 1, 1, -1]),
        coordinate_second=np.full(14, 7.0),
    )
    partitioning.second_rates(np.array([1.0, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]), state)
    assert state.coordinate_second == pytest.approx([1, 2, 3, -3.5, 2, 2.5, 3, 7, 8, 9, -0.75, 5, 5.5, 6])


@pytest.mark.parametrize("solved", [OK, NOT_CONVERGED])
def test_rates_of_a_partition_by_the_formulation(calls, solved):
    """Coordinates 1 and 0 are independent; their rates stand behind them in y."""
    state = SimpleNamespace(coordinates="q", velocities="v", coordinate_second=np.array([5.0, 6.0, 7.0]))
    system = SimpleNamespace(acceleration="a")
    chart = SimpleNamespace(column_order=np.array([2, 1, 0]), partition=SimpleNamespace(rank=1))
    memory = SimpleNamespace(state=state, chart=chart, equations=SimpleNamespace(system=system))
    made = calls(
        partitioning,
        solve_dependent_coordinates=solved,
        solve_dependent_rates=None,
        assemble_system=None,
        second_rates=None,
    )
    memory.kernels = SimpleNamespace(
        accelerate=lambda system: made.append(("accelerate", system)) or SINGULAR
    )
    y, rate = np.array([1.0, 2.0, 3.0, 4.0]), np.full(5, 9.0)
    assert partitioning.rates.function(0.5, y, rate, memory) == (SINGULAR if solved == OK else solved)
    wanted = [
        ("solve_dependent_coordinates", 0.5, y, memory),
        ("solve_dependent_rates", y, memory),
        ("assemble_system", 0.5, "q", "v", memory.equations),
        ("accelerate", system),
        ("second_rates", "a", state),
    ]
    assert made == (wanted if solved == OK else wanted[:1])
    assert rate.tolist() == ([3.0, 4.0, 6.0, 5.0, 9.0] if solved == OK else [9.0] * 5)


def test_an_accepted_state_of_a_partition_is_saved(calls):
    partition = SimpleNamespace(pivot=0.5, chosen_pivot=0.5, rank=2)
    memory = SimpleNamespace(
        state="state",
        previous="previous",
        chart=SimpleNamespace(partition=partition),
        chart_options=SimpleNamespace(kept=0.6),
        watch=SimpleNamespace(accepted_time=0.0),
    )
    made = calls(partitioning, solve_dependent_coordinates=OK, solve_dependent_rates=None, copy_state=None)
    assert partitioning.accept.function(0.5, "y", memory) == OK
    assert made == [
        ("solve_dependent_coordinates", 0.5, "y", memory),
        ("solve_dependent_rates", "y", memory),
        ("copy_state", "state", "previous"),
    ]


def test_facts_of_stabilisations():
    facts = {
        name: (each.projects, each.watches_rank, each.largest_turn, dict(each.options), each.memory is None)
        for name, each in STABILISATIONS.items()
    }
    assert facts == {
        "none": (False, False, 1.0, {}, True),
        "baumgarte": (False, False, 1.0, {"alpha": 5.0, "beta": 5.0}, True),
        "partitioning": (False, True, 1.0, {"kept": 0.6}, False),
        "projection": (True, True, 0.75, {}, False),
    }
    assert {name for name, each in STABILISATIONS.items() if each.feedback} == {"baumgarte"}
    assert STABILISATIONS["projection"].rates_with_outputs is all_coordinates.rates
