"""Decisions of kernels at their limits themselves, and one rounding beyond, with interpreted kernels.

Limits are replaced by powers of two, so that products with them have no rounding. ``test_thresholds.py`` runs
this file.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace as Record
from typing import Any

import numpy as np
import pytest

from mbref.kernels.compilation import PLAIN

if not PLAIN:
    pytest.skip("kernels are interpreted by test_thresholds.py", allow_module_level=True)

from mbref import rotations
from mbref.integrators import one_step
from mbref.kernels.layout import NOT_CONVERGED, OK, SINGULAR
from mbref.linear_algebra import elimination
from mbref.stabilisation import projection
from mbref.stepping import loop, singular_crossing
from mbref.stepping.loop import STEP_TOO_SMALL, UNDECIDED
from mbref.taylor import correction, driven, samples, solver, stepping
from mbref.taylor.crossing import acceptance, detection, start, uniqueness
from tests.mbref.threshold_checks import memory

UP, DOWN = math.inf, -math.inf
Patch = pytest.MonkeyPatch
Decision = Callable[[Any, float], Any]


def changes(patch: Patch, decide: Decision, limit: float, at: Any, beyond: Any, way: float = UP) -> None:
    """Check the answer at a limit, and the answer at the next number beyond."""
    assert decide(patch, limit) == at
    assert decide(patch, math.nextafter(limit, way)) == beyond


def put(patch: Patch, module: Any, **values: Any) -> None:
    """Replace limits and functions of a module."""
    for name, value in values.items():
        patch.setattr(module, name, value)


# --- projection -------------------------------------------------------------------------------------------
def rank_of(patch: Patch, square: float) -> int:
    put(patch, projection, INDEPENDENT=0.25)
    record = Record(generic_rank=0, reference_pivot=0.0, smallest_pivot=0.0)
    projection.watch(np.array([square]), np.zeros(1), record)
    return record.generic_rank


def depends(patch: Patch, *pivots: float) -> bool:
    put(patch, projection, DEPENDENT=0.25, CLEAR=0.5)
    watched = Record(regular=1, generic_rank=1)
    return projection.depend_on_others(Record(pivots=np.array(pivots), watch=watched))


def rows(pivot: float) -> Any:
    """Memory of one row with a pivot, whose block is ones and whose saved block is twos."""
    system = Record(blocks=np.ones((1, 12)), rhs=np.ones(1), jacobian=np.zeros((0, 6)))
    return Record(
        pivots=np.array([pivot]),
        factor=Record(symbolic=Record(row=np.array([0]))),
        equations=Record(system=system),
        chart=Record(blocks=np.full((1, 12), 2.0)),
    )


def left_out(patch: Patch, pivot: float) -> tuple[float, float, float]:
    put(patch, projection, DEPENDENT=0.25, scratch_of=lambda chart: chart)
    made = rows(pivot)
    projection.leave_out_dependent_rows(made)
    return made.equations.system.rhs[0], made.equations.system.blocks[0, 11], made.chart.blocks[0, 11]


def put_back(patch: Patch, pivot: float) -> float:
    put(patch, projection, DEPENDENT=0.25, scratch_of=lambda chart: chart)
    made = rows(pivot)
    projection.put_back_dependent_rows(made)
    return made.equations.system.blocks[0, 11]


def newton(patch: Patch, **numbers: float) -> list[str]:
    """A step of Newton's method factorises, corrects, or does both."""
    numbers = {"before": 0.125, "violation": 0.0, "moved": 0.0, "tolerance": 8.0, "rounding": 8.0, **numbers}
    done: list[str] = []
    put(
        patch,
        projection,
        SMALL=0.25,
        GOOD_REDUCTION=0.5,
        BENT=2.0,
        evaluate=lambda *given: None,
        factorise_constraints=lambda given: done.append("factor") or True,
        correct_positions=lambda given: done.append("correction"),
        scratch_of=lambda chart: chart,
    )
    settings = Record(newton_tolerance=numbers["tolerance"], rounding=numbers["rounding"])
    made = Record(
        state=Record(coordinates=None, velocities=None),
        equations=Record(
            rows=Record(phi=np.array([-numbers["violation"]])), system=Record(settings=settings)
        ),
        chart=Record(correction=np.array([numbers["moved"]])),
    )
    assert projection.newton_step(0.0, numbers["before"], made) == numbers["violation"]
    return done


def projected(patch: Patch, *violations: float, most: int = 5) -> tuple[int, int]:
    """The status of corrections with these violations, the last of them repeated, and their number."""
    found = iter([*violations, *[violations[-1]] * most])
    put(patch, projection, STUCK=4.0, MOST_CORRECTIONS=most, newton_step=lambda *given: next(found))
    system = Record(settings=Record(newton_tolerance=0.25), counts=Record(newton=0))
    status = projection.project_positions(0.0, Record(equations=Record(system=system)))
    return status, system.counts.newton


def follows(patch: Patch, moved: float) -> int:
    asked: list[Any] = []
    put(
        patch,
        projection,
        MOVED=2.0,
        scratch_of=lambda chart: chart,
        evaluate=lambda *given: asked.append(given),
        factorise_constraints=lambda given: False,
    )
    made = Record(
        equations=Record(system=Record(settings=Record(rounding=0.25))),
        state=Record(coordinates=None, velocities=None),
        chart=Record(correction=np.array([-moved])),
    )
    assert projection.follow_last_correction(0.0, made) is not bool(asked)
    return len(asked)


def test_limits_of_projection(monkeypatch):
    changes(monkeypatch, rank_of, 0.25, 0, 1)
    changes(monkeypatch, lambda patch, x: depends(patch, x, 1.0), 0.25, True, False)
    changes(monkeypatch, lambda patch, x: depends(patch, x, 0.125), 0.5, True, False, DOWN)
    changes(monkeypatch, left_out, 0.25, (0.0, 0.0, 1.0), (1.0, 1.0, 2.0))
    changes(monkeypatch, put_back, 0.25, 2.0, 1.0)
    changes(monkeypatch, lambda patch, x: newton(patch, before=x), 0.25, [], ["factor"])
    by_violation = lambda patch, x: newton(patch, violation=x, tolerance=0.0)  # noqa: E731
    changes(monkeypatch, by_violation, 0.0625, [], ["factor"])
    by_tolerance = lambda patch, x: newton(patch, violation=x, tolerance=0.5)  # noqa: E731
    changes(monkeypatch, by_tolerance, 0.5, [], ["factor"])
    changes(monkeypatch, lambda patch, x: newton(patch, moved=x), 0.5, [], ["factor"])
    corrects = lambda patch, x: newton(patch, violation=x, rounding=0.25)  # noqa: E731
    changes(monkeypatch, corrects, 0.25, [], ["correction"])
    changes(monkeypatch, projected, 0.25, (OK, 1), (OK, 2))
    changes(monkeypatch, projected, 1.0, (OK, 2), (NOT_CONVERGED, 5))
    changes(monkeypatch, lambda patch, x: projected(patch, 0.5, x, 0.125), 0.5, (OK, 2), (OK, 3), DOWN)
    changes(monkeypatch, projected, 0.0, (OK, 1), (SINGULAR, 1), DOWN)
    changes(monkeypatch, lambda patch, x: projected(patch, x, most=1), 1.0, (OK, 1), (NOT_CONVERGED, 1))
    changes(monkeypatch, follows, 0.5, 0, 1)


# --- integrators and the loop -----------------------------------------------------------------------------
def first_step(patch: Patch, size: float) -> float:
    control = Record(atol=1.0, rtol=0.0, largest_step=8.0)
    return one_step.first_step(np.array([0.0, -size]), np.array([0.5, 0.0]), control)


def next_step(patch: Patch, ratio: float, suggested: float = 4.0) -> float:
    put(patch, one_step, SAFETY=0.5, SHRINK=0.125, GROW=64.0, RETRY=0.25)
    return one_step.next_step(4.0, suggested, ratio, 0.5, Record(order=1.0))


def trend_at(patch: Patch, share: float) -> float:
    """Steps of 1 s whose error has doubled, of order 1, so that the next step is half as long."""
    put(patch, one_step, ROUNDED_ERROR=0.25, SHRINK=0.125)
    clock = Record(restart=3, share=share, past_ratio=0.5, past_length=1.0)
    counts = Record(steps=5)
    made = Record(
        loop=Record(clock=clock),
        equations=Record(system=Record(counts=counts)),
        control=Record(order=1.0),
    )
    found = one_step.trend(1.0, 1.0, made)
    counts.steps = 4
    assert one_step.trend(1.0, 1.0, made) == 1.0, "one step has no trend"
    return found


def test_limits_of_one_step_methods(monkeypatch):
    assert first_step(monkeypatch, 1e-5) == 8e-6
    assert first_step(monkeypatch, math.nextafter(1e-5, 1.0)) == pytest.approx(2e-7)
    changes(monkeypatch, next_step, 1.0, 1.0, pytest.approx(2.0))
    changes(monkeypatch, next_step, 0.0, 256.0, 1.0, DOWN)
    changes(monkeypatch, lambda patch, x: next_step(patch, 1.0, x), 4.0, 1.0, pytest.approx(4.0))
    changes(monkeypatch, trend_at, 0.25, 0.5, 1.0, DOWN)


def test_limits_of_steps_towards_a_time():
    """A step that is a billionth too short is lengthened; half an interval is taken for more than a half."""
    assert loop.step_within(2.0, 1.0) == 1.0
    assert loop.step_within(2.0, math.nextafter(1.0, 2.0)) == 1.0
    assert loop.step_within(3.0, 1.5) == 1.5 and loop.step_within(3.0, 1.75) == 1.5
    limit = 1.0 + 1e-9
    assert loop.step_within(limit, 1.0) == limit and loop.step_within(limit + 1e-12, 1.0) == limit / 2 + 5e-13


def test_limits_of_elimination(monkeypatch):
    def factored(_: Patch, pivot: float) -> bool:
        return elimination.lu_factor(np.array([[-pivot]]), 1, np.zeros(1, int), 0.25)

    def rank(_: Patch, pivot: float) -> int:
        order = np.zeros(2, int), np.zeros(2, int)
        return elimination.full_pivot(np.diag([-2.0, pivot]), 2, 2, *order, 0.25)

    changes(monkeypatch, factored, 0.25, False, True)
    changes(monkeypatch, rank, 0.5, 1, 2)
    assert not elimination.cholesky_factor(np.zeros((1, 1)), 1)
    assert elimination.multiplied(0.0, 1.0, 1e150) == (math.log(1e150), 1.0)
    assert elimination.multiplied(0.0, 1.0, 1e-150) == (math.log(1e-150), 1.0)
    below, above = math.nextafter(1e150, 0.0), math.nextafter(1e-150, 1.0)
    assert elimination.multiplied(7.0, 1.0, -below) == (7.0, below)
    assert elimination.multiplied(7.0, 1.0, above) == (7.0, above)
    assert not elimination.product_of_pivots(np.array([0.0, 1.0]), 2)[0]


# --- singular positions of explicit runs ------------------------------------------------------------------
def meets(patch: Patch, pivot: float, past: float = 1.0) -> bool:
    put(
        patch,
        singular_crossing,
        REACHED=0.25,
        keep_position=lambda *given: None,
        passes_singular_position=lambda *given: False,
    )
    watch = Record(reference_pivot=2.0, smallest_pivot=pivot, past_pivot=past)
    return singular_crossing.meets_singular_position(1.0, Record(watch=watch, control=Record(closed_loops=1)))


def passes(patch: Patch, pivot: float, of_product: float = -1.0, size: float = 1.0) -> bool:
    put(
        patch,
        singular_crossing,
        REACHED=0.25,
        VANISHED=0.5,
        pivot_at_pose=lambda given: pivot,
        zero_of_pivot=lambda *given: 0.5,
        **dict.fromkeys(
            ("factorise_product", "put_rates", "keep_position", "expand_product_at"), lambda *given: None
        ),
    )
    ends = Record(gradient=None, squared_pivots=np.zeros(1), pivots=np.array([of_product]))
    made = Record(
        loop=Record(ends=ends), factor=None, watch=Record(reference_pivot=2.0), pivots=np.array([size])
    )
    return singular_crossing.passes_singular_position(1.0, made)


def test_limits_of_singular_positions_in_explicit_runs(monkeypatch):
    changes(monkeypatch, meets, 0.5, True, False)
    changes(monkeypatch, lambda patch, x: meets(patch, 0.5, x), 0.5, False, True)
    for reference, relative in ((0.0, 1.0), (0.5, 0.25), (2.0, 0.0625)):
        watch = Record(reference_pivot=reference, smallest_pivot=0.125)
        assert singular_crossing.relative_pivot(watch) == relative


@pytest.mark.parametrize(
    ("steps", "reached", "rtol", "expected"),
    [
        (1000, 1.0, 1e-6, 1.0),
        (1001, 1.0, 1e-6, (1000 / 1001) ** 2),
        (2000, 1.0, 1e-6, 0.25),
        (2000, 0.5, 1e-6, 0.0625),
        (2000, 1e-9, 1e-12, 0.1),
        (2000, 0.5, 1e-14, 1.0),  # the least tolerance is larger than rtol
        (49, 1e-9, 1e-6, 0.01),
        (50, 1e-9, 1e-6, 1e-7),
        (49, 0.0, 1e-14, 1.0),
        (0, 0.0, 1e-6, 1.0),
    ],
)
def test_tolerances_of_runs_of_many_steps(steps, reached, rtol, expected):
    """A run of 1 s; of its first steps each is suggested to be 1e-9 s long."""
    made = Record(
        loop=Record(clock=Record(time=reached), times=np.array([0.0, 0.25, 1.0])),
        equations=Record(system=Record(counts=Record(steps=steps))),
        control=Record(rtol=rtol),
    )
    assert loop.share(1e-9, made) == pytest.approx(expected, rel=1e-12)


def test_limits_of_singular_positions_inside_a_step(monkeypatch):
    """The pivot must vanish to less than half of 2; rows with a pivot up to a quarter of 2 are redundant."""
    changes(monkeypatch, passes, 1.0, False, True, DOWN)
    changes(monkeypatch, lambda patch, x: passes(patch, 0.0, x), 0.0, False, True, DOWN)
    changes(monkeypatch, lambda patch, x: passes(patch, 0.0, size=x), 0.5, False, True)


# --- high-accuracy steps ----------------------------------------------------------------------------------
def crossing(patch: Patch, pivot: float = 1.0, last: bool = False, entry: float = 1.0, **step: float) -> int:
    """The judgement of a step that crosses, whose violation may be 0.25 and whose shift 0.5 of its pivot."""
    put(
        patch,
        acceptance,
        MIN_PIVOT_ACROSS=0.25,
        MIN_PIVOT_RATIO_ACROSS=0.25,
        MAX_SHIFT=0.5,
        violation_by_rounding=lambda given: 0.25,
    )
    made = memory(**step)
    made.progress.entry_pivot, made.progress.largest_pivot = entry, 2.0
    return acceptance.judge_crossing(pivot, False, last, made)


def approach(
    patch: Patch, pivot: float = 1.0, turning: float = 8.0, last: bool = False, **step: float
) -> int:
    put(
        patch,
        acceptance,
        MIN_PIVOT_RATIO=0.25,
        MAX_SHIFT=0.5,
        MIN_PIVOT=0.25,
        MIN_PIVOT_FREE=0.125,
        MIN_PIVOT_RESOLVED=4.0,
        ENTRY_RATIO=0.5,
        violation_by_rounding=lambda given: 0.25,
    )
    made = memory(**step)
    made.kernels = Record(turning_pivot=lambda *given: turning)
    made.progress.largest_pivot = 2.0
    return acceptance.judge_approach(1.0, pivot, turning < 8.0, last, made)


def test_limits_of_steps_that_cross(monkeypatch):
    by = lambda name: lambda patch, x: crossing(patch, **{name: x})  # noqa: E731
    changes(monkeypatch, by("start_pivot"), 0.5, OK, UNDECIDED, DOWN)
    entry = lambda patch, x: crossing(patch, entry=0.25, start_pivot=x)  # noqa: E731
    changes(monkeypatch, entry, 0.25, OK, UNDECIDED, DOWN)
    changes(monkeypatch, by("pivot"), 0.25, OK, STEP_TOO_SMALL, DOWN)
    assert crossing(monkeypatch, math.nextafter(0.25, 0.0), last=True) == OK
    changes(monkeypatch, by("violation"), 0.25, OK, STEP_TOO_SMALL)
    changes(monkeypatch, by("correction"), 0.5, OK, STEP_TOO_SMALL)


def test_limits_of_steps_that_approach(monkeypatch):
    by = lambda name: lambda patch, x: approach(patch, **{name: x})  # noqa: E731
    changes(monkeypatch, by("violation"), 0.25, OK, STEP_TOO_SMALL)
    changes(monkeypatch, by("correction"), 0.5, OK, UNDECIDED)
    last = lambda patch, x: approach(patch, correction=x, last=True)  # noqa: E731
    changes(monkeypatch, last, 0.5, OK, STEP_TOO_SMALL)
    changes(monkeypatch, lambda patch, x: approach(patch, x, start_pivot=4.0), 1.0, OK, STEP_TOO_SMALL, DOWN)
    changes(monkeypatch, lambda patch, x: approach(patch, x, start_pivot=1.0), 0.5, OK, UNDECIDED, DOWN)
    changes(monkeypatch, lambda patch, x: approach(patch, x, start_pivot=0.375), 0.375, OK, UNDECIDED, DOWN)
    changes(monkeypatch, lambda patch, x: approach(patch, turning=x), 0.125, OK, UNDECIDED, DOWN)


def test_limits_of_tolerances_and_of_near_positions(monkeypatch):
    put(monkeypatch, acceptance, CROSSING_START=0.25, CROSSING_NOISE=0.0625)
    put(monkeypatch, detection, PIVOT_NEAR=0.25, PIVOT_AHEAD=0.25)

    def tolerance(_: Patch, pivot: float) -> float:
        return acceptance.crossing_tolerance(memory(start_pivot=pivot, tolerance=2.0**-20))

    def near(_: Patch, end: float) -> bool:
        return bool(detection.is_near_singular(end, memory()))

    def ends_near(_: Patch, end: float) -> bool:
        return bool(detection.ends_near_singular(end, memory()))

    def leaves(_: Patch, begin: float) -> bool:
        made = memory(start_pivot=begin)
        made.progress.leaving = 1
        return bool(detection.ends_near_singular(0.125, made))

    changes(monkeypatch, tolerance, 0.25, 2.0**-22, pytest.approx(0.25), DOWN)
    changes(monkeypatch, near, 0.25, False, True, DOWN)
    changes(monkeypatch, ends_near, 0.25, False, True, DOWN)
    changes(monkeypatch, leaves, 0.125, True, False, DOWN)


def test_limits_of_a_determinant(monkeypatch):
    put(monkeypatch, detection, LOG_LEVEL=-2.0, LOG_DIP_COARSE=-1.0, LOG_ZERO=-8.0, SECTIONS=9)
    put(monkeypatch, detection, evaluate_series=lambda *given: None, stays_level=lambda *given: False)
    put(monkeypatch, detection, end_logarithms=lambda given: (1.0, 2.0), SECTIONS_COARSE=3)
    put(monkeypatch, detection, time_of_minimum=lambda h, sections, given: float(sections))

    def vanishes(coarse: float, fine: float) -> bool:
        monkeypatch.setattr(detection, "logarithm_at", lambda t, given: coarse if t == 3.0 else fine)
        return detection.vanishes_inside(1.0, None)

    changes(monkeypatch, lambda _, x: vanishes(x, -99.0), 0.0, False, True, DOWN)
    changes(monkeypatch, lambda _, x: vanishes(-99.0, x), -7.0, False, True, DOWN)


def test_level_determinants_at_the_limit(monkeypatch):
    put(monkeypatch, detection, LOG_LEVEL=-2.0)

    def level(one: float, other: float) -> bool:
        monkeypatch.setattr(detection, "logarithm_at", lambda t, given: one if t < 0.5 else other)
        return detection.stays_level(1.0, 3.0, None)

    changes(monkeypatch, lambda _, x: level(x, 9.0), 1.0, False, True)
    changes(monkeypatch, lambda _, x: level(9.0, x), 1.0, False, True)


# --- starts and perturbed runs ----------------------------------------------------------------------------
@pytest.mark.parametrize(("velocity", "limit"), [(1.0, 0.25), (0.0, 0.5)])
def test_limits_of_starts(monkeypatch, velocity, limit):
    """A motion needs a pivot of 0.25, a start at rest one of 0.5; from rest a turn of 2 √p is allowed."""
    put(monkeypatch, start, MIN_PIVOT_RESOLVED=0.25, MIN_PIVOT_FREE=0.5, REST_PIVOT=0.25, REST_TURN=2.0)

    def hides(_: Patch, pivot: float) -> bool:
        return bool(start.hides_rank(memory(pivot=pivot, velocity=velocity)))

    def rests(_: Patch, pivot: float) -> bool:
        return bool(start.rests_near(memory(pivot=pivot, velocity=0.0)))

    def turned(_: Patch, moved: float, pivot: float = 0.0625) -> bool:
        return bool(start.is_turned(memory(pivot=pivot, correction=moved)))

    changes(monkeypatch, hides, limit, False, True, DOWN)
    changes(monkeypatch, rests, 0.25, False, True, DOWN)
    assert not start.rests_near(memory(pivot=0.125, velocity=velocity or 1.0))
    changes(monkeypatch, turned, 0.5, False, True)
    changes(monkeypatch, lambda patch, x: turned(patch, 9.0, x), 0.25, False, True, DOWN)


def test_limits_of_energy_and_of_its_bound(monkeypatch):
    put(monkeypatch, uniqueness, MIN_ENERGY=0.25, BOUND_MARGIN=0.5, STRICTER=0.5, MAX_GAIN=4.0, MAX_APART=8.0)
    put(monkeypatch, uniqueness, turns_back=lambda *given: False)
    changes(monkeypatch, lambda _, x: uniqueness.keeps_moving(x, 2.0, memory()), 0.5, True, False, DOWN)
    assert not uniqueness.keeps_moving(0.0, 0.0, memory())
    bounded = lambda _, x: uniqueness.is_bounded(x, memory(velocity_change=0.125, speed=2.0))  # noqa: E731
    changes(monkeypatch, bounded, 0.5, True, False)


# --- series -----------------------------------------------------------------------------------------------
def test_limits_of_corrections_and_pivots(monkeypatch):
    put(monkeypatch, solver, MIN_PIVOT_KEPT=0.5, WITHOUT_INERTIA=0.25)

    def changed(left: float, moved: float) -> bool:
        made = memory(pivot=0.5, correction=moved, tolerance=0.25)
        return bool(correction.changes_factor(left, made))

    def sharp(_: Patch, pivot: float) -> bool:
        return bool(solver.is_sharp(Record(first=np.array([2.0]), last=np.array([-pivot]))))

    def inertia(_: Patch, pivot: float) -> int:
        made = Record(
            solver=Record(first=np.array([0.0, pivot])),
            polynomials=Record(inertia=Record(mass=np.diag([1.0, 4.0]))),
            partition=Record(rank=1),
        )
        return solver.inertia_left(made)

    changes(monkeypatch, lambda _, x: changed(x, 0.0), 0.0625, False, True)
    changes(monkeypatch, lambda _, x: changed(0.0625, x), 0.125, False, True)
    changes(monkeypatch, sharp, 1.0, False, True)
    changes(monkeypatch, inertia, 1.0, SINGULAR, OK)


def judged(
    patch: Patch, off: float = 0.0, size: float = 1.0, violation: float = 0.0, part: float = 0.0
) -> int:
    put(patch, stepping, LOST_ROWS=2.0, ROW_ROUNDING=0.25, LOST_MOTION=2.0, MOTION_ROUNDING=0.5)
    put(patch, stepping, judge_branch=lambda *given: OK, error_of_motion=lambda *given: (off, size))
    put(patch, stepping, part_behind_no_length=lambda given: part, largest_used=lambda *given: 2.0)
    put(patch, stepping, crossing_tolerance=lambda given: 0.125)
    made = memory(violation=violation, tolerance=0.125)
    made.progress.rests_near, made.mode.order = 0, 2
    return stepping.judge_step(4.0, False, made)


def test_limits_of_steps_of_a_series(monkeypatch):
    """Rows may be off by 2 / 8 + 1/4, accelerations by 2 · 2² / 8 and half of their size."""
    changes(monkeypatch, lambda patch, x: judged(patch, violation=x), 0.5, OK, STEP_TOO_SMALL)
    changes(monkeypatch, judged, 1.5, OK, STEP_TOO_SMALL)
    changes(monkeypatch, lambda patch, x: judged(patch, x, 4.0), 3.0, OK, STEP_TOO_SMALL)
    changes(monkeypatch, lambda patch, x: judged(patch, 1.0, part=x), 1.0, OK, STEP_TOO_SMALL)


def predicted(patch: Patch, off: float = 0.0, violation: float = 0.0) -> int:
    put(patch, driven, LOST_ROWS=2.0, LOST_MOTION=2.0, PREDICTOR_TOLERANCE=0.125)
    put(patch, driven, expand_at=lambda *given: OK, error_of_motion=lambda *given: (off, 1.0))
    put(patch, driven, ends_near_singular=lambda *given: False)
    made = memory(violation=violation)
    made.mode.order, made.kernels = 2, Record(detect=lambda *given: 0)
    return driven.attempt_predictor_step(1.0, False, made)


def accurate(patch: Patch, pivot: float, begin: float = 0.25) -> bool:
    """Whether predictor steps follow a high-accuracy step, whose pivot must have reached 0.25 of 2."""
    asked: list[Any] = []
    put(patch, driven, PIVOT_AHEAD=0.25, set_predictor=asked.append)
    made = memory(pivot=pivot, start_pivot=begin)
    made.progress.largest_pivot, made.kernels = 2.0, Record(step=lambda given: OK)
    assert driven.take_accurate_step(made) == OK
    return bool(asked)


def test_limits_of_driven_steps(monkeypatch):
    changes(monkeypatch, predicted, 1.0, OK, STEP_TOO_SMALL)
    changes(monkeypatch, lambda patch, x: predicted(patch, violation=x), 0.25, OK, STEP_TOO_SMALL)
    changes(monkeypatch, accurate, 0.5, True, False, DOWN)
    changes(monkeypatch, lambda patch, x: accurate(patch, 0.75, x), 0.75, True, False)
    put(monkeypatch, driven, ACCURATE_TOLERANCE=0.25, CROSSING_START=0.5, MIN_PREDICTOR_RATIO=0.25)
    put(monkeypatch, driven, longest_step=lambda *given: 4.0)
    before = lambda _, x: driven.length_before(x, memory())  # noqa: E731
    changes(monkeypatch, before, 3.0, 0.0, pytest.approx(1.0))


def lengths(patch: Patch, ahead: float, regular: float = 2.0) -> tuple[float, float]:
    """Regular and crossing steps: 2 s or as asked, and 4 s, before a position at a time ahead."""
    put(patch, stepping, CROSSING_MARGIN=0.5, MIN_PIVOT_RATIO=0.5, CROSSING_START=0.25)
    put(patch, stepping, step_tolerance=lambda given: 1.0, crossing_tolerance=lambda given: 2.0)
    put(patch, stepping, longest_step=lambda tolerance, given: regular if tolerance == 1.0 else 4.0)
    return stepping.first_lengths(99.0, memory(time_to_pole=ahead))


def test_limits_of_first_lengths(monkeypatch):
    """A step that crosses must be longer than half the way, a regular one than half of it."""
    changes(monkeypatch, lambda patch, x: lengths(patch, x, 8.0), 8.0, (8.0, 4.0), pytest.approx((7.0, 7.0)))
    changes(
        monkeypatch, lambda patch, x: lengths(patch, 16.0, x), 8.0, (8.0, 4.0), pytest.approx((15.0, 15.0))
    )


@pytest.mark.parametrize("largest", range(4))
@pytest.mark.parametrize("place", range(4))
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_quaternion_has_the_side_of_the_previous_one(largest, place, side):
    """The previous one has one component only, so that the new component there has its sign."""
    quaternion = np.array([0.1, -0.2, 0.3, -0.15])
    quaternion[largest] = 0.9
    quaternion /= np.linalg.norm(quaternion)
    found = np.zeros(4)
    found[place] = side
    samples.put_quaternion(rotations.to_matrix(quaternion).ravel(), found)
    assert found[place] * side > 0.0
    assert found == pytest.approx(math.copysign(1.0, found[0] * quaternion[0]) * quaternion)
