"""Solutions of the equations and steps of the loop, with interpreted kernels / numbers worked out by hand.

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

from mbref.formulations import alf_dual, mpi_svd
from mbref.kernels.layout import CHANGED, NOT_CONVERGED, NOT_FINITE, OK, SINGULAR, SINGULAR_AHEAD
from mbref.linear_algebra import minimum_norm
from mbref.linear_algebra.minimum_norm import ALPHA
from mbref.linear_algebra.orthogonal_factorisations import gram_schmidt_pivoted
from mbref.linear_algebra.symbolic_factorisation import sparse_factor, symbolic_factorisation
from mbref.stepping import loop
from mbref.stepping.loop import DONE, PAUSED, STEP_TOO_SMALL, TOO_MANY_STEPS, UNDECIDED, VIOLATED
from mbref.taylor import stepping
from mbref.taylor.crossing import acceptance


# --- nearly dependent rows --------------------------------------------------------------------------------
@pytest.mark.parametrize("angle", [1.0, 1e-2, 1e-4])
def test_solution_by_conjugate_directions(angle):
    """Unit rows at an angle: x is the solution of least norm, and x = -Dᵀ λ."""
    rows = np.array([[1.0, 0.0, 0.0], [math.cos(angle), math.sin(angle), 0.0]])
    row, column = np.nonzero(np.ones_like(rows))
    symbolic = symbolic_factorisation(row, column, np.arange(rows.size), np.ones(3, dtype=bool))
    factor = sparse_factor(symbolic)
    assert minimum_norm.regularised_factor(factor, rows.reshape(-1), np.ones(3), ALPHA)
    b, target, multipliers = np.array([0.3, 0.7]), np.zeros(3), np.zeros(2)
    factor.residual[:] = b[symbolic.row.astype(int)]
    factor.change[:] = factor.total[:] = 0.0
    factor.direction[:] = 5.0
    assert minimum_norm.go_on_by_conjugate_directions(factor, 1e12, target, multipliers) == OK
    expected = np.linalg.lstsq(rows, b, rcond=None)[0]
    assert target == pytest.approx(expected, rel=1e-6) and rows @ target == pytest.approx(b, rel=1e-9)
    assert -rows.T @ multipliers == pytest.approx(target, rel=1e-6)


@pytest.mark.parametrize(
    ("nearly", "independent", "statuses", "craig", "alphas", "expected"),
    [
        (0, 1, [OK], OK, [1e10], OK),
        (0, 1, [NOT_CONVERGED, OK], OK, [1e10, 1e13], OK),
        (0, 0, [NOT_CONVERGED], OK, [1e10], NOT_CONVERGED),
        (0, 1, [NOT_CONVERGED, SINGULAR, OK], OK, [1e10, 1e13, 1e15], OK),
        (0, 1, [SINGULAR], OK, [1e10], SINGULAR),
        (1, 1, [NOT_CONVERGED], OK, [1e10], OK),
        (1, 0, [OK], NOT_CONVERGED, [1e10], NOT_CONVERGED),
    ],
)
def test_penalties_until_the_equations_are_solved(
    monkeypatch, nearly, independent, statuses, craig, alphas, expected
):
    tried, left, asked = [], list(statuses), []
    monkeypatch.setattr(alf_dual, "iterate_with", lambda alpha, system: tried.append(alpha) or left.pop(0))
    monkeypatch.setattr(alf_dual, "options_of", lambda options: SimpleNamespace(alpha=options))
    monkeypatch.setattr(alf_dual, "factor_of", lambda scratch: scratch)
    monkeypatch.setattr(
        alf_dual, "go_on_by_conjugate_directions", lambda *given: asked.append(given) or craig
    )
    system = SimpleNamespace(
        options=1e10,
        scratch="factor",
        settings=SimpleNamespace(nearly_dependent=nearly, independent=independent),
        acceleration="acceleration",
        multipliers="multipliers",
    )
    assert alf_dual.iterate_until_solved(system) == expected and tried == pytest.approx(alphas)
    assert asked == [("factor", 1e10, "acceleration", "multipliers")] * nearly


def test_status_of_singular_values(monkeypatch):
    counts, asked = SimpleNamespace(factorisations=3), []
    scratch = SimpleNamespace(d="d", b="b", x="x", dual="dual")
    system = SimpleNamespace(scratch=scratch, counts=counts, settings=SimpleNamespace(rank_tolerance=1e-7))
    monkeypatch.setattr(mpi_svd, "scratch_of", lambda scratch: scratch)
    monkeypatch.setattr(mpi_svd, "recover_solution", lambda *given: asked.append(given))
    solved: list[Any] = []
    for scaled, rank, status in ((True, 0, OK), (True, 4, OK), (True, -1, NOT_FINITE), (False, 4, SINGULAR)):
        monkeypatch.setattr(mpi_svd, "scaled_residual", lambda *given, scaled=scaled: scaled)
        monkeypatch.setattr(mpi_svd, "svd_solve", lambda *given, rank=rank: solved.append(given) or rank)
        assert mpi_svd.accelerate.function(system) == status
    assert solved == [("d", "b", 1e-7, "x", "dual")] * 3 and counts.factorisations == 6
    assert asked == [("x", "dual", system)] * 2


# --- the loop ---------------------------------------------------------------------------------------------
def test_the_worst_row_and_the_state_of_a_step():
    phi = np.array([0.1, -0.4, 0.4, 0.2])
    assert loop.worst_row(phi) == 1 and loop.worst_row(np.zeros(0)) == -1
    assert loop.worst_row(np.array([1.0, 2.0, -3.0])) == 2 and loop.worst_row(np.zeros(2)) == 0
    clock = SimpleNamespace(violated_row=9)
    memory = SimpleNamespace(
        equations=SimpleNamespace(rows=SimpleNamespace(phi=phi)),
        loop=SimpleNamespace(clock=clock),
        control=SimpleNamespace(violation=0.4),
    )
    good, bad = np.array([1.0, 2.0]), np.array([1.0, math.nan])
    assert loop.check_state(good, good, memory) == OK and clock.violated_row == 1
    memory.control.violation = 0.39
    assert loop.check_state(good, good, memory) == VIOLATED
    assert loop.check_state(bad, good, memory) == loop.check_state(good, bad, memory) == NOT_FINITE
    memory.equations.rows.phi = np.array([-0.5, 0.1])
    assert loop.check_state(good, good, memory) == VIOLATED and clock.violated_row == 0
    memory.equations.rows.phi = np.zeros(0)
    assert loop.check_state(good, good, memory) == OK and clock.violated_row == -1


def test_a_sample_has_all_numbers_of_the_last_evaluation():
    """The second of three samples; vectors of different lengths."""
    names = {"coordinates": 7, "velocities": 6, "accelerations": 6, "multipliers": 2}
    given = {name: 10.0 * k + np.arange(n) for k, (name, n) in enumerate(names.items())}
    samples = SimpleNamespace(**{name: np.full((3, n), -1.0) for name, n in names.items()})
    memory = SimpleNamespace(
        loop=SimpleNamespace(samples=samples, clock=SimpleNamespace(sample=1)),
        state=SimpleNamespace(coordinates=given["coordinates"], velocities=given["velocities"]),
        equations=SimpleNamespace(
            system=SimpleNamespace(
                acceleration=given["accelerations"].copy(), multipliers=given["multipliers"].copy()
            )
        ),
    )
    loop.take_sample(memory)
    for name, n in names.items():
        rows = getattr(samples, name)
        assert rows[1].tolist() == given[name].tolist() and (rows[[0, 2]] == -1.0).all(), (name, n)
    assert memory.loop.clock.sample == 2
    system = memory.equations.system
    assert system.acceleration.tolist() == given["accelerations"].tolist()
    assert system.multipliers.tolist() == given["multipliers"].tolist()


def test_an_accepted_state_is_kept_with_its_time_and_angles(monkeypatch):
    calls: list[Any] = []
    for name in ("copy_state", "remember_angles"):
        monkeypatch.setattr(loop, name, lambda *given, name=name: calls.append((name, *given)))
    memory = SimpleNamespace(
        state="state", previous="previous", watch=SimpleNamespace(accepted_time=0.0), equations="equations"
    )
    loop.remember_accepted_state(0.75, memory)
    assert calls == [("copy_state", "state", "previous"), ("remember_angles", "equations")]
    assert memory.watch.accepted_time == 0.75


@pytest.mark.parametrize(
    ("fastest", "turn", "h"), [(0.0, 1.0, 0.5), (1.0, 1.0, 0.5), (4.0, 1.0, 0.25), (0.5, 0.125, 0.25)]
)
def test_steps_are_limited_by_the_user_and_by_the_fastest_body(monkeypatch, fastest, turn, h):
    monkeypatch.setattr(loop, "fastest_turn", lambda v: fastest if v == "v" else None)
    memory = SimpleNamespace(
        control=SimpleNamespace(largest_step=0.5, largest_turn=turn), state=SimpleNamespace(velocities="v")
    )
    assert loop.largest_step(memory) == h


def test_samples_and_the_ends_of_a_call(monkeypatch):
    """Steps of 0.4 s to samples at 0, 0.5 and 1 s; at most 2 steps a call and 9 in all."""
    clock = SimpleNamespace(y_size=2, sample=0, time=0.0)
    counts = SimpleNamespace(steps=0)
    memory = SimpleNamespace(
        loop=SimpleNamespace(clock=clock, times=np.array([0.0, 0.5, 1.0]), y=np.zeros(4), y_rate=np.zeros(4)),
        equations=SimpleNamespace(system=SimpleNamespace(counts=counts)),
        control=SimpleNamespace(most_steps=9, steps_per_call=2),
    )
    events: list[Any] = []

    def sample(memory: Any) -> None:
        events.append(round(clock.time, 9))
        clock.sample += 1

    def step(target: float, y: np.ndarray, y_rate: np.ndarray, memory: Any) -> int:
        assert y.size == y_rate.size == 2
        assert y.base is memory.loop.y and y_rate.base is memory.loop.y_rate
        clock.time, counts.steps = min(clock.time + 0.4, target), counts.steps + 1
        events.append((target, round(clock.time, 9)))
        return OK

    def evaluate(y: np.ndarray, y_rate: np.ndarray, given: Any) -> int:
        assert given is memory and y.base is memory.loop.y and y_rate.base is memory.loop.y_rate
        return OK

    monkeypatch.setattr(loop, "evaluate_state", evaluate)
    monkeypatch.setattr(loop, "take_sample", sample)
    monkeypatch.setattr(loop, "advance", step)
    advance = loop.advance_to_end.function
    assert advance(memory) == PAUSED and events == [0.0, (0.5, 0.4), (0.5, 0.5), 0.5]
    assert advance(memory) == DONE and events[4:] == [(1.0, 0.9), (1.0, 1.0), 1.0]
    clock.sample = 2
    clock.time, memory.control.most_steps = 0.5, 5
    assert advance(memory) == TOO_MANY_STEPS and counts.steps == 5
    monkeypatch.setattr(loop, "evaluate_state", lambda *_: NOT_FINITE)
    assert advance(memory) == NOT_FINITE
    monkeypatch.setattr(loop, "evaluate_state", lambda *_: OK)
    monkeypatch.setattr(loop, "advance", lambda *_: STEP_TOO_SMALL)
    memory.control.most_steps = 9
    assert advance(memory) == STEP_TOO_SMALL
    clock.sample = 2

    def last(*_: Any) -> int:
        clock.sample = 3
        return OK

    monkeypatch.setattr(loop, "advance", last)
    assert advance(memory) == DONE


@pytest.mark.parametrize(
    ("time", "rates", "checked", "called", "status", "kept"),
    [
        (0.5, OK, OK, "outputs", OK, [0.5]),
        (0.75, OK, OK, "outputs", OK, [0.75]),
        (0.25, OK, OK, "rates", OK, [0.25]),
        (0.25, SINGULAR, OK, "rates", SINGULAR, []),
        (0.25, OK, VIOLATED, "rates", VIOLATED, []),
    ],
)
def test_a_state_is_evaluated_with_outputs_at_a_sample(
    monkeypatch, time, rates, checked, called, status, kept
):
    asked, remembered, selected = [], [], []
    clock = SimpleNamespace(time=time, sample=1)
    kernels = SimpleNamespace(
        rates=lambda *given: asked.append(("rates", *given)) or rates,
        rates_with_outputs=lambda *given: asked.append(("outputs", *given)) or rates,
    )
    memory = SimpleNamespace(
        loop=SimpleNamespace(clock=clock, times=np.array([0.0, 0.5])), kernels=kernels, equations="equations"
    )
    monkeypatch.setattr(loop, "select_pieces", lambda *given: selected.append(given))
    monkeypatch.setattr(loop, "check_state", lambda *given: given == ("y", "y'", memory) and checked)
    monkeypatch.setattr(loop, "remember_accepted_state", lambda t, memory: remembered.append(t))
    assert loop.evaluate_state("y", "y'", memory) == status and remembered == kept
    assert asked == [(called, time, "y", "y'", memory)] and selected == [(time, "equations")]


@pytest.mark.parametrize(
    ("accepted", "meets", "status", "watched", "places"),
    [
        (OK, False, OK, 1, []),
        (CHANGED, False, CHANGED, 0, []),
        (SINGULAR_AHEAD, False, SINGULAR_AHEAD, 0, [(1.0, 0.5)]),
        (OK, True, SINGULAR_AHEAD, 0, []),
        (NOT_CONVERGED, False, NOT_CONVERGED, 0, []),
        (CHANGED, True, CHANGED, 0, []),
    ],
)
def test_what_is_kept_of_a_step(monkeypatch, accepted, meets, status, watched, places):
    """A step from 2 s to 2.5 s."""
    clock = SimpleNamespace(time=2.0, length=0.3, ratio=0.7, suggested=0.4, attempt_end=9.0, restart=1)
    counts, kept, seen = SimpleNamespace(steps=4), [], []
    memory = SimpleNamespace(
        loop=SimpleNamespace(clock=clock, y=np.zeros(2), y_new=np.array([3.0, 4.0])),
        equations=SimpleNamespace(system=SimpleNamespace(counts=counts)),
    )

    def accept(now: float, y: np.ndarray, given: Any) -> int:
        assert now == 2.5 and y is memory.loop.y_new and given is memory
        return accepted

    def meeting(length: float, given: Any) -> bool:
        assert given is memory
        seen.append(length)
        return meets

    memory.kernels = SimpleNamespace(accept=accept)
    monkeypatch.setattr(
        loop, "keep_position", lambda share, length, given: kept.append((share, length)) or given.kernels
    )
    monkeypatch.setattr(loop, "meets_singular_position", meeting)
    monkeypatch.setattr(loop, "remember_watch", lambda given: kept.append("watch") or given.kernels)
    assert loop.accept_step(2.5, 0.5, 0.6, 0.8, memory) == status
    is_kept = status in (OK, CHANGED)
    assert kept == [*places, *["watch"] * watched] and seen == [0.5] * (accepted == OK)
    assert clock.attempt_end == (2.5 if status == SINGULAR_AHEAD else 9.0)
    assert memory.loop.y.tolist() == ([3.0, 4.0] if is_kept else [0.0, 0.0])
    assert counts.steps == 4 + is_kept and clock.restart == (5 if status == CHANGED else 1)
    after = (2.5, 0.5, 0.6, 0.8) if is_kept else (2.0, 0.3, 0.4, 0.7)
    assert (clock.time, clock.length, clock.suggested, clock.ratio) == after
    if is_kept:
        assert (clock.past_length, clock.past_ratio) == (0.3, 0.7)


def stepping_memory(**changes: Any) -> Any:
    """Memory at 2 s whose integrator proposes steps of 0.4 s."""
    control = {"first_step": 0.0, "forced_step": 0.0, "fixed_step": 0.0, "smallest_step": 1e-6, **changes}
    return SimpleNamespace(
        loop=SimpleNamespace(
            clock=SimpleNamespace(
                time=2.0, length=0.3, suggested=0.35, ratio=0.7, share=0.0, y_size=2, restart=1
            ),
            y_new=np.zeros(4),
        ),
        control=SimpleNamespace(**control),
        equations=SimpleNamespace(
            system=SimpleNamespace(counts=SimpleNamespace(steps=3, rejected=0)), end=math.inf
        ),
        kernels=SimpleNamespace(propose=None, step=None, rates="rates"),
        largest=1.0,
    )


@pytest.fixture
def advanced(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return status, lengths of attempts, accepted steps and proposals of an advance."""

    def advance(memory: Any, ratios: list[float], accepted: int = OK, target: float = 3.0) -> Any:
        tried: list[float] = []
        proposals: list[Any] = []
        ends: list[Any] = []
        left = list(ratios)

        def step(rates: Any, t: float, h: float, y: Any, y_rate: Any, y_new: Any, given: Any) -> float:
            assert (rates, t, y, y_rate) == ("rates", 2.0, "y", "y'") and y_new.size == 2 and given is memory
            tried.append(round(h, 12))
            return left.pop(0) if left else 0.5

        def propose(length: float, suggested: float, ratio: float, *others: Any) -> float:
            assert others == ("y", "y'", memory)
            proposals.append((round(length, 12), round(suggested, 12), ratio))
            return 0.4 if len(proposals) == 1 else 0.5 * suggested

        def accept(now: float, h: float, suggested: float, ratio: float, given: Any) -> int:
            assert given is memory
            ends.append((round(now, 12), round(h, 12), round(suggested, 12), ratio))
            memory.loop.clock.time = now
            return accepted

        memory.kernels.propose, memory.kernels.step = propose, step
        monkeypatch.setattr(loop, "end_of_pieces", lambda equations: equations.end)
        monkeypatch.setattr(loop, "share", lambda suggested, memory: 10.0 * suggested)
        monkeypatch.setattr(loop, "largest_step", lambda memory: memory.largest)
        monkeypatch.setattr(loop, "accept_step", accept)
        return loop.advance(target, "y", "y'", memory), tried, ends, proposals

    return advance


def test_an_accepted_step(advanced):
    """1 s is left: a step of 0.4 s; of 0.7 s half of the time is taken."""
    memory = stepping_memory()
    status, tried, ends, proposals = advanced(memory, [0.5])
    assert (status, tried, ends) == (OK, [0.4], [(2.4, 0.4, 0.4, 0.5)])
    assert proposals == [(0.3, 0.35, 0.7)] and memory.loop.clock.share == 4.0
    assert memory.equations.system.counts.rejected == 0 and memory.loop.clock.restart == 1
    assert advanced(stepping_memory(), [0.5], target=2.7)[1] == [0.35]
    assert advanced(stepping_memory(), [0.5], target=2.4)[2][0][0] == 2.4
    memory = stepping_memory()
    memory.largest = 0.1
    assert advanced(memory, [0.5])[1] == [0.1]


def test_a_step_ends_at_the_end_of_a_piece(advanced):
    memory = stepping_memory()
    memory.equations.end = 2.3
    status, tried, ends, _ = advanced(memory, [0.5])
    assert (status, tried, ends[0][0]) == (OK, [0.3], 2.3) and memory.loop.clock.restart == 3
    assert advanced(stepping_memory(), [1.0])[0] == OK, "a ratio of 1 is accepted"


def test_rejected_steps_are_tried_again_until_they_are_too_small(advanced):
    memory = stepping_memory()
    status, tried, _, proposals = advanced(memory, [3.0, 2.0, 1.0])
    assert status == OK and tried == [0.4, 0.2, 0.1]
    assert proposals[1:] == [(0.4, 0.4, 3.0), (0.2, 0.2, 2.0)]
    assert memory.equations.system.counts.rejected == 2
    status, tried, _, _ = advanced(stepping_memory(smallest_step=0.2), [3.0] * 9)
    assert status == STEP_TOO_SMALL and tried == [0.4, 0.2]
    failed = -float(NOT_CONVERGED)
    status, tried, _, proposals = advanced(stepping_memory(smallest_step=0.2), [failed] * 9)
    assert status == NOT_CONVERGED and proposals[1] == (0.4, 0.4, failed)
    assert advanced(stepping_memory(smallest_step=0.3), [math.nan])[0] == NOT_FINITE


def test_first_forced_and_fixed_steps(advanced):
    memory = stepping_memory(first_step=0.02)
    assert advanced(memory, [])[1] == [0.4], "it is not the first step"
    memory = stepping_memory(first_step=0.02)
    memory.equations.system.counts.steps = 0
    assert advanced(memory, [])[1] == [0.02]
    memory = stepping_memory(forced_step=0.45)
    status, tried, ends, _ = advanced(memory, [7.0])
    assert (status, tried) == (OK, [0.45]) and ends[0][3] == 1.0
    status, tried, _, _ = advanced(stepping_memory(forced_step=0.15), [7.0, 7.0, 7.0])
    assert status == OK and tried == [0.4, 0.2, 0.15]
    assert advanced(stepping_memory(fixed_step=0.3), [0.5])[1] == [0.25], "four equal steps in 1 s"
    for more, h in ((0.5e-6, 0.25), (1.5e-6, 0.2)):  # steps of a millionth too many are rounding
        assert advanced(stepping_memory(fixed_step=1.0 / (4.0 + more)), [0.5])[1] == [h]
    assert advanced(stepping_memory(fixed_step=5.0), [0.5])[1] == [1.0]
    memory = stepping_memory(forced_step=0.45, smallest_step=0.3)
    assert advanced(memory, [-float(NOT_CONVERGED)] * 9)[:2] == (NOT_CONVERGED, [0.45])
    assert advanced(stepping_memory(fixed_step=0.5), [0.5])[1] == [0.5]
    assert advanced(stepping_memory(fixed_step=7.0), [0.5])[1] == [1.0]
    status, tried, _, _ = advanced(stepping_memory(fixed_step=0.5), [-float(SINGULAR)])
    assert (status, tried) == (SINGULAR, [0.5])


def test_steps_whose_correction_fails(advanced):
    assert advanced(stepping_memory(), [0.5], SINGULAR_AHEAD)[0] == SINGULAR_AHEAD
    assert advanced(stepping_memory(), [0.5], CHANGED)[0] == OK
    status, tried, _, proposals = advanced(stepping_memory(smallest_step=0.15), [0.5] * 9, NOT_CONVERGED)
    assert status == NOT_CONVERGED and tried == [0.4, 0.2]
    assert proposals[1][2] == -float(NOT_CONVERGED)


# --- judgement of crossings -------------------------------------------------------------------------------
def judged(**changes: Any) -> Any:
    step = {"start_pivot": 0.5, "violation": 1e-16, "correction": 0.0, **changes}
    progress = {"largest_pivot": 1.0, "entry_pivot": 0.5}
    progress |= {name: step.pop(name) for name in [*step] if name in progress}
    return SimpleNamespace(step=SimpleNamespace(**step), progress=SimpleNamespace(**progress))


@pytest.fixture
def rounding(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(acceptance, "violation_by_rounding", lambda memory: 1e-15)


@pytest.mark.usefixtures("rounding")
@pytest.mark.parametrize(
    ("pivot", "turned", "last", "changes", "status"),
    [
        (0.4, False, 0, {}, OK),
        (0.4, True, 0, {}, STEP_TOO_SMALL),
        (0.4, False, 0, {"violation": 1e-15}, OK),
        (0.4, False, 0, {"violation": 2e-15}, STEP_TOO_SMALL),
        (0.4, False, 0, {"violation": math.nan}, STEP_TOO_SMALL),
        (0.4, False, 0, {"correction": 0.41 * acceptance.MAX_SHIFT}, STEP_TOO_SMALL),
        (0.4, False, 0, {"correction": 0.4 * acceptance.MAX_SHIFT}, OK),
        (0.49 * acceptance.MIN_PIVOT_RATIO_ACROSS, False, 0, {}, STEP_TOO_SMALL),
        (0.49 * acceptance.MIN_PIVOT_RATIO_ACROSS, False, 1, {}, OK),
        (0.5 * acceptance.MIN_PIVOT_RATIO_ACROSS, False, 0, {}, OK),
        (0.4, False, 1, {"start_pivot": acceptance.MIN_PIVOT_ACROSS}, OK),
        (0.4, False, 0, {"start_pivot": 0.9 * acceptance.MIN_PIVOT_ACROSS}, UNDECIDED),
        (0.4, False, 0, {"start_pivot": 0.9 * acceptance.MIN_PIVOT_ACROSS, "entry_pivot": 0.0}, OK),
        (0.4, False, 0, {"start_pivot": 1.5 * acceptance.MIN_PIVOT_ACROSS, "largest_pivot": 2.0}, UNDECIDED),
    ],
)
def test_steps_across_a_singular_position(pivot, turned, last, changes, status):
    assert acceptance.judge_crossing(pivot, turned, last, judged(**changes)) == status


@pytest.mark.usefixtures("rounding")
@pytest.mark.parametrize(
    ("pivot", "turned", "last", "changes", "status"),
    [
        (0.6, False, 0, {}, OK),
        (0.49 * acceptance.MIN_PIVOT_RATIO, False, 0, {}, STEP_TOO_SMALL),
        (0.5 * acceptance.MIN_PIVOT_RATIO, False, 0, {}, OK),
        (0.6, False, 0, {"violation": 1e-15}, OK),
        (0.6, False, 0, {"violation": 2e-15}, STEP_TOO_SMALL),
        (0.6, False, 0, {"violation": math.nan}, STEP_TOO_SMALL),
        (0.6, False, 0, {"correction": 0.61 * acceptance.MAX_SHIFT}, UNDECIDED),
        (0.6, False, 1, {"correction": 0.61 * acceptance.MAX_SHIFT}, STEP_TOO_SMALL),
        (0.6, False, 1, {"correction": 0.6 * acceptance.MAX_SHIFT}, OK),
    ],
)
def test_steps_near_a_singular_position(monkeypatch, pivot, turned, last, changes, status):
    monkeypatch.setattr(acceptance, "freedoms", lambda memory: 1)
    assert acceptance.judge_approach(0.25, pivot, turned, last, judged(**changes)) == status


@pytest.mark.usefixtures("rounding")
def test_pivots_that_are_resolved(monkeypatch):
    """A motion with a degree of freedom resolves smaller pivots; the entry's pivot counts, too."""
    for free, least in ((1, acceptance.MIN_PIVOT_FREE), (0, acceptance.MIN_PIVOT_RESOLVED)):
        monkeypatch.setattr(acceptance, "freedoms", lambda memory, free=free: free)
        for entry in (1e9, 0.5 * least / acceptance.ENTRY_RATIO):
            resolved = min(least, acceptance.ENTRY_RATIO * entry)
            for part, status in ((0.99, UNDECIDED), (1.0, OK)):
                memory = judged(start_pivot=1.0, entry_pivot=entry, largest_pivot=0.0)
                assert acceptance.judge_approach(0.25, part * resolved, False, 1, memory) == status
                asked: list[Any] = []
                memory.kernels = SimpleNamespace(turning_pivot=lambda h, memory: asked.append(h) or turn)  # noqa: B023
                turn = part * resolved
                assert acceptance.judge_approach(0.25, 2.0, True, 1, memory) == status and asked == [0.25]
    memory = judged(start_pivot=1.0, entry_pivot=1e9, largest_pivot=0.5 / acceptance.MIN_PIVOT)
    assert acceptance.judge_approach(0.25, 0.49, False, 1, memory) == UNDECIDED
    assert acceptance.judge_approach(0.25, 0.5, False, 1, memory) == OK
    assert acceptance.judge_approach(0.25, 1.0, False, 1, judged(start_pivot=1.0, largest_pivot=1e9)) == OK


# --- judgement of a step of a series ----------------------------------------------------------------------
@pytest.mark.parametrize(
    ("changes", "status"),
    [
        ({}, OK),
        ({"violation": 1.0}, STEP_TOO_SMALL),
        ({"violation": math.nan}, STEP_TOO_SMALL),
        ({"branch": UNDECIDED}, UNDECIDED),
        ({"turned": True}, OK),
        ({"turned": True, "rests": 1}, UNDECIDED),
        ({"rests": 1}, OK),
        ({"off": math.inf}, NOT_FINITE),
        ({"off": math.nan}, NOT_FINITE),
        ({"off": 1.0}, STEP_TOO_SMALL),
        ({"part": 0.5, "off": 2 * (1e-8 * 1.6 * 0.25)}, OK),
        ({"part": 0.5, "off": 8.1e-9}, STEP_TOO_SMALL),
        ({"part": 0.0, "off": 8.1e-9}, OK),
    ],
)
def test_what_is_accepted_at_the_end_of_a_step(monkeypatch, changes, status):
    """A spring without a length acts for half of a step of 0.25 s: off / 2 up to 1e-8 · 1.6 · 0.25."""
    given = {"violation": 0.0, "branch": OK, "turned": False, "rests": 0, "off": 0.0, "part": 0.0, **changes}
    monkeypatch.setattr(stepping, "judge_branch", lambda h, last, memory: given["branch"])
    monkeypatch.setattr(stepping, "is_turned", lambda memory: given["turned"])
    monkeypatch.setattr(stepping, "error_of_motion", lambda h, memory: (given["off"], 1.0))
    monkeypatch.setattr(stepping, "part_behind_no_length", lambda memory: given["part"])
    monkeypatch.setattr(stepping, "crossing_tolerance", lambda memory: 1e-8)
    monkeypatch.setattr(stepping, "largest_used", lambda order, memory: 1.6 * (order == 1))
    memory = SimpleNamespace(
        step=SimpleNamespace(violation=given["violation"]),
        mode=SimpleNamespace(order=20, tolerance=1e-9),
        progress=SimpleNamespace(rests_near=given["rests"]),
    )
    assert stepping.judge_step(0.25, 0, memory) == status


def test_the_error_that_a_step_may_have(monkeypatch):
    """LOST_MOTION · order² · tolerance, and rounding of the accelerations."""
    for name, value in (("judge_branch", OK), ("part_behind_no_length", 0.0), ("crossing_tolerance", 1e-8)):
        monkeypatch.setattr(stepping, name, lambda *_, value=value: value)
    memory = SimpleNamespace(
        step=SimpleNamespace(violation=0.0),
        mode=SimpleNamespace(order=6, tolerance=1e-9),
        progress=SimpleNamespace(rests_near=0),
    )
    for size in (0.0, 3.0):
        most = stepping.LOST_MOTION * 36 * 1e-8 + stepping.MOTION_ROUNDING * size
        for part, status in ((1.0, OK), (1.001, STEP_TOO_SMALL)):
            monkeypatch.setattr(stepping, "error_of_motion", lambda *_, off=part * most: (off, size))  # noqa: B023
            assert stepping.judge_step(0.25, 0, memory) == status
    lost = stepping.LOST_ROWS * 1e-9 + stepping.ROW_ROUNDING
    monkeypatch.setattr(stepping, "error_of_motion", lambda *_: (0.0, 0.0))
    for part, status in ((1.0, OK), (1.001, STEP_TOO_SMALL)):
        memory.step.violation = part * lost
        assert stepping.judge_step(0.25, 0, memory) == status


# --- orthogonalisation ------------------------------------------------------------------------------------
def test_nearly_parallel_rows_become_orthogonal_to_rounding():
    """Rows (1, e, 0, 0), (1, 0, e, 0) and (1, 0, 0, e) of Läuchli: one subtraction leaves 1e-8."""
    small = 1e-8
    rows = np.hstack([np.ones((3, 1)), small * np.diag([1.0, 1.0, 1.0])])
    a, order, r = rows.copy(), np.zeros(3, dtype=np.int64), np.ones((3, 3))
    assert gram_schmidt_pivoted(a, 3, order, r, 1e-12) == 3
    assert np.abs(a @ a.T - np.eye(3)).max() < 1e-14
    assert np.abs(r.T @ a - rows[order]).max() < 1e-15 and sorted(order) == [0, 1, 2]


def test_the_largest_remaining_row_comes_first():
    """Lengths 5, 13 and 3, of which 0 remains of the third row."""
    rows = np.array([[3.0, 4.0, 0.0], [5.0, 12.0, 0.0], [0.0, 3.0, 0.0]])
    a, order, r = rows.copy(), np.zeros(3, dtype=np.int64), np.ones((3, 3))
    assert gram_schmidt_pivoted(a, 3, order, r, 1e-9) == 2
    left = np.abs(rows[[0, 2]] @ np.array([12.0, -5.0, 0.0]) / 13.0)
    assert order[0] == 1 and order[1] == (0 if left[0] > left[1] else 2)
    assert a[0] == pytest.approx([5 / 13, 12 / 13, 0.0]) and r[0, 0] == pytest.approx(13.0)
    assert abs(a[1]) == pytest.approx([12 / 13, 5 / 13, 0.0]) and r[1, 1] == pytest.approx(left.max())
    assert r[:2].T @ a[:2] == pytest.approx(rows[order], abs=1e-14)
    assert gram_schmidt_pivoted(np.zeros((2, 3)), 2, order[:2].copy(), np.ones((2, 2)), 1e-9) == 0
