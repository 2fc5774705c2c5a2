"""Checks of thresholds of the stepping loop, outcomes, error estimates, and of `taylor` outside crossings."""

import math
from types import SimpleNamespace

import numpy as np

from mbref import error_estimate
from mbref.kernels.layout import OK
from mbref.simulation import comparison, dead_position, singular_position
from mbref.stabilisation import projection
from mbref.stepping import control, loop, pace, ranks, singular_crossing, singular_start
from mbref.stepping.loop import CREEPING, PAUSED
from mbref.taylor import correction, driven, expressions, series, solver, stepper, stepping
from mbref.taylor.mode import HIGH_ACCURACY
from tests.mbref.threshold_checks import check, flips, memory, near


# --- stepping -------------------------------------------------------------------------------------------
def factor_of_tolerance(steps, reached, rtol=1e-6, suggested=1.0, end=1.0):
    run = SimpleNamespace(
        loop=SimpleNamespace(clock=SimpleNamespace(time=reached), times=np.array([0.0, end])),
        equations=SimpleNamespace(system=SimpleNamespace(counts=SimpleNamespace(steps=steps))),
        control=SimpleNamespace(rtol=rtol),
    )
    return loop.share(suggested, run)


@check("stepping.loop MANY")
def _(_):
    return near(factor_of_tolerance(200, 0.1), 0.25)


@check("stepping.loop LEAST_TOLERANCE")
def _(_):
    return near(factor_of_tolerance(10_000, 1e-5, rtol=1e-9), 1e-4)


@check("stepping.loop EARLY")
def _(_):
    return near(factor_of_tolerance(1, 1e-9, suggested=1e-9), 1e-2)


@check("stepping.loop PACE")
def _(_):
    is_early = lambda steps: factor_of_tolerance(steps, 1e-9, suggested=1e-9) > 0.9e-2  # noqa: E731
    return is_early(49) and not is_early(50)


def judged(steps, share_of_end):
    counts = SimpleNamespace(steps=steps)
    clock = SimpleNamespace(time=share_of_end)
    run = SimpleNamespace(
        memory=SimpleNamespace(
            loop=SimpleNamespace(clock=clock),
            equations=SimpleNamespace(system=SimpleNamespace(counts=counts)),
        ),
        limits=SimpleNamespace(most_steps=1_000_000),
        times=np.array([0.0, 1.0]),
    )
    return pace.Pace(run).judge(PAUSED)


@check("stepping.pace OUT_OF_REACH")
def _(_):
    """20 000 steps in a time t need 20 000 / t steps to the end: 1e8 are the limit."""
    return flips(lambda t: judged(20_000, t) == CREEPING, 1.96e-4, 2.04e-4)


@check("stepping.pace PACE_STEPS")
def _(_):
    return judged(19_999, 1e-9) == PAUSED and judged(20_000, 1e-9) == CREEPING


@check("stepping.singular_crossing REACHED")
def _(monkeypatch):
    monkeypatch.setattr(singular_crossing, "keep_position", lambda *_: None)
    monkeypatch.setattr(singular_crossing, "passes_singular_position", lambda *_: False)

    def meets(pivot):
        watch = SimpleNamespace(reference_pivot=1.0, smallest_pivot=pivot, past_pivot=1.0)
        run = SimpleNamespace(watch=watch, control=SimpleNamespace(closed_loops=1.0))
        return singular_crossing.meets_singular_position(1.0, run)

    return flips(meets, 0.98e-3, 1.02e-3)


@check("stepping.singular_crossing VANISHED")
def _(monkeypatch):
    for name in ("factorise_product", "put_rates", "keep_position", "expand_product_at"):
        monkeypatch.setattr(singular_crossing, name, lambda *_: None)
    monkeypatch.setattr(singular_crossing, "zero_of_pivot", lambda *_: 0.5)

    def passes(pivot):
        monkeypatch.setattr(singular_crossing, "pivot_at_pose", lambda _: pivot)
        ends = SimpleNamespace(gradient=None, squared_pivots=np.ones(1), pivots=-np.ones(1))
        run = SimpleNamespace(
            loop=SimpleNamespace(ends=ends),
            factor=None,
            watch=SimpleNamespace(reference_pivot=1.0),
            pivots=np.ones(1),
        )
        return singular_crossing.passes_singular_position(1.0, run)

    return flips(passes, 0.98e-2, 1.02e-2)


def zero_search(monkeypatch, pivot):
    """Fraction of the step at which a pivot is zero, and the number of evaluations."""
    ends = SimpleNamespace(pivots=np.array([pivot(1.0)]), squared_pivots=np.array([pivot(0.0)]))
    tried = []

    def expand(part, *_):
        tried.append(part)
        ends.pivots[0] = pivot(part)

    monkeypatch.setattr(singular_crossing, "expand_product_at", expand)
    singular_crossing.zero_of_pivot(0, 1.0, SimpleNamespace(loop=SimpleNamespace(ends=ends)))
    return tried


@check("stepping.singular_crossing SEARCH")
def _(monkeypatch):
    monkeypatch.setattr(singular_crossing, "PLACE_ERROR", 0.0)
    return len(zero_search(monkeypatch, lambda part: math.copysign(abs(part - 0.3) ** 9, 0.3 - part))) == 30


@check("stepping.singular_crossing PLACE_ERROR")
def _(monkeypatch):
    """A pivot that is nearly zero at the end of the step: the first place found is as far from the end."""

    def ends_at_once(size):
        return len(zero_search(monkeypatch, lambda part: -size if part == 1.0 else 1.0)) == 1

    return flips(ends_at_once, 0.98e-9, 1.02e-9)


@check("stepping.singular_start NEAR_SINGULAR")
def _(monkeypatch):
    monkeypatch.setattr(singular_start, "rate_violation", lambda *_: 0.0)

    def is_near(least):
        run = SimpleNamespace(ranks=SimpleNamespace(least=least), model=None)
        run.start = SimpleNamespace(q=None, v=np.ones(1))
        return singular_start.begins_near_singular(run)

    return flips(is_near, 0.98e-6, 1.02e-6)


@check("stepping.singular_start NO_FORCE")
def _(monkeypatch):
    def along(share):
        """A branch along which a share of the largest force acts."""
        found = np.array([[share, 1.0], [0.0, 1.0]])
        monkeypatch.setattr(singular_start, "tangents", lambda *_: found)
        terms = SimpleNamespace(force=np.array([1.0, 0.0]))
        model = SimpleNamespace(terms=lambda *_: terms, mass=np.ones(2))
        run = SimpleNamespace(model=model, start=SimpleNamespace(q=None, v=None))
        return singular_start.leaving_acceleration(run) is None

    return flips(along, 0.98e-12, 1.02e-12)


@check("stepping.control UNWRAPPED")
def _(_):
    return near(control_with_angles().largest_turn, 1.0)


@check("stepping.control STEPS_PER_CALL")
def _(_):
    return control_with_angles().steps_per_call == 500


def control_with_angles():
    from mbref.method import Method
    from mbref.stepping.limits import Limits

    model = SimpleNamespace(has_angles=True, length=1.0, closed_loops=1)
    return control.control_of(model, Method.parse("alf-dual+projection"), np.array([1.0]), Limits())


@check("stabilisation.projection LARGEST_TURN")
def _(_):
    return near(projection.PROJECTION.largest_turn, 0.75) and projection.LARGEST_TURN == 0.75


# --- simulation -----------------------------------------------------------------------------------------
def compared(rtol=1e-9, nearest=1.0, drops=1e-12, adaptive=True, projects=True):
    memory_of_run = SimpleNamespace(
        control=SimpleNamespace(rtol=rtol), watch=SimpleNamespace(nearest=nearest)
    )
    method = SimpleNamespace(
        is_series=False,
        integrator=SimpleNamespace(adaptive=adaptive),
        stabilisation=SimpleNamespace(projects=projects),
    )
    return SimpleNamespace(
        memory=memory_of_run,
        method=method,
        limits=SimpleNamespace(rank_tolerance=drops),
        model=SimpleNamespace(closed_loops=1),
    )


@check("simulation.comparison OFF")
def _(_):
    return near(comparison._allowed(compared(1e-6)), 1e-3) and near(
        comparison._allowed(compared(1e-12)), 1e-6
    )


@check("simulation.comparison COARSE")
def _(_):
    return near(comparison._allowed(compared(adaptive=False)), 0.1)


@check("simulation.comparison NEAR")
def _(_):
    return flips(lambda pivot: comparison.may_leave(compared(nearest=pivot)), 0.099, 0.101)


@check("simulation.comparison DROPS")
def _(_):
    return flips(lambda drops: not comparison.may_leave(compared(drops=drops)), 0.98e-10, 1.02e-10)


def dead(monkeypatch, velocity, reached=1.0):
    trial = SimpleNamespace(completed=False, reached=reached)
    monkeypatch.setattr(dead_position, "trial_of", lambda _: trial)
    terms = SimpleNamespace(
        jacobian=np.array([[1.0 / velocity, 0.0, 0.0, 0.0, 0.0, 0.0]]), nu=np.array([1.0])
    )
    model = SimpleNamespace(m=1, n=6, nb=1, length=1.0, terms=lambda *_: terms)
    run = SimpleNamespace(scene=SimpleNamespace(driver=("A",)), model=model)
    run.memory = SimpleNamespace(
        state=SimpleNamespace(coordinates=np.zeros(7)),
        loop=SimpleNamespace(clock=SimpleNamespace(time=1.0)),
    )
    return dead_position.is_at_dead_position(run)


@check("simulation.dead_position TRANSMISSION")
def _(monkeypatch):
    return flips(lambda velocity: not dead(monkeypatch, velocity), 98.0, 102.0)


@check("simulation.dead_position BEYOND")
def _(monkeypatch):
    return flips(lambda reached: dead(monkeypatch, 1e4, reached), 1.005, 1.015)


@check("simulation.singular_position NEAR_PIVOT")
def _(_):
    def is_near(pivot):
        run = SimpleNamespace(model=SimpleNamespace(closed_loops=1))
        run.memory = SimpleNamespace(watch=SimpleNamespace(reference_pivot=1.0, smallest_pivot=pivot))
        return singular_position.is_near(run)

    return flips(is_near, 0.0295, 0.0305)


@check("simulation.singular_position TAKES_PART")
def _(monkeypatch):
    def joints(part):
        left = np.array([[0.0, 0.0, part], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
        monkeypatch.setattr(
            singular_position, "_singular_values", lambda *_: (np.array([1.0, 0.5, 0.0]), left)
        )
        run = SimpleNamespace(model=SimpleNamespace(row_joint=("A", "B", "C")))
        return singular_position._joints(run, 0.0, None, 3) == ("B",)

    return flips(joints, 0.049, 0.051)


# --- error estimate -------------------------------------------------------------------------------------
def is_warned(error, rtol):
    estimate = error_estimate.ErrorEstimate(np.zeros(1), np.array([error]), rtol, "")
    return bool(estimate.warning)


@check("error_estimate RATIO")
def _(_):
    return flips(lambda error: not is_warned(error, 1e-6), 0.98e-3, 1.02e-3)


@check("error_estimate LEAST_WARNED")
def _(_):
    return flips(lambda error: not is_warned(error, 1e-12), 0.98e-6, 1.02e-6)


# --- taylor ---------------------------------------------------------------------------------------------
@check("taylor.expressions NEGLIGIBLE")
def _(_):
    return flips(lambda value: len(expressions.cleaned({0: 1.0, 1: value})) == 1, 0.98e-12, 1.02e-12)


@check("taylor.expressions VANISHING")
def _(_):
    def vanishes(value):
        found = expressions.Elimination(lambda *_: True)
        found.add({0: value, expressions.ONE: 0.0})
        return not found.expressed

    return flips(vanishes, 0.98e-9, 1.02e-9)


@check("taylor.expressions DEPENDENT_POLYNOMIAL")
def _(_):
    def depends(value):
        polynomials = [{(0, 1): 1.0}, {(0, 1): 1.0, (1, 1): value}]
        return len(expressions.independent(polynomials)) == 1

    return flips(depends, 0.98e-9, 1.02e-9)


@check("taylor.series SLOWEST")
def _(_):
    rests = lambda rate: series.turns_back_in(1.0, memory(deceleration=rate))  # noqa: E731
    return flips(lambda rate: not rests(rate), 1.95, 2.05)


@check("taylor.solver MIN_PIVOT_KEPT")
def _(_):
    sharp = lambda pivot: solver.is_sharp(  # noqa: E731
        SimpleNamespace(first=np.ones(1), last=np.array([pivot]))
    )
    return flips(lambda pivot: not sharp(pivot), 0.49, 0.51)


@check("taylor.solver WITHOUT_INERTIA")
def _(_):
    def is_singular(pivot):
        state = memory(variables=1, rank=0)
        state.solver.first = np.array([pivot])
        return solver.inertia_left(state) != OK

    return flips(is_singular, 0.98e-13, 1.02e-13)


def corrected(monkeypatch, violations):
    """Status of a correction with these violations, and the number of corrections."""
    left, made = iter(violations), []
    monkeypatch.setattr(correction, "violation", lambda _: next(left))
    monkeypatch.setattr(correction, "factorise_equations", lambda _: OK)
    monkeypatch.setattr(correction, "close", lambda _: made.append(1))
    for name in ("close_rate", "largest_change"):
        monkeypatch.setattr(correction, name, lambda _: 0.0)
    monkeypatch.setattr(correction, "changes_factor", lambda *_: False)
    return correction.correct_state.function(memory()), len(made)


@check("taylor.correction MAX_VIOLATION")
def _(monkeypatch):
    return flips(lambda left: corrected(monkeypatch, [left] * 9)[1] == 1, 0.98e-6, 1.02e-6)


@check("taylor.correction MAX_CORRECTIONS")
def _(monkeypatch):
    return corrected(monkeypatch, [1.0] * 20)[1] == 8


@check("taylor.driven MIN_PREDICTOR_RATIO")
def _(monkeypatch):
    monkeypatch.setattr(driven, "longest_step", lambda *_: 1.0)
    return flips(lambda ahead: driven.length_before(ahead, memory()) == 0.0, 0.6 + 0.245, 0.6 + 0.255)


@check("taylor.stepping SHORTER")
def _(_):
    return near(stepping.next_length(1.0, 1.0, memory()), 0.7)


def judged_step(monkeypatch, violation=0.0, off=0.0, acceleration=0.0, tolerance=1e-10):
    """Whether the end of a step of 1 s is accepted."""
    monkeypatch.setattr(stepping, "judge_branch", lambda *_: OK)
    monkeypatch.setattr(stepping, "is_turned", lambda _: False)
    monkeypatch.setattr(stepping, "part_behind_no_length", lambda _: 0.0)
    monkeypatch.setattr(stepping, "crossing_tolerance", lambda _: tolerance)
    state = memory(violation=violation, tolerance=tolerance, kind=HIGH_ACCURACY)
    state.state[2, 0] = acceleration
    state.series.terms[2, 0] = (acceleration + off) / 2.0
    return stepping.judge_step(1.0, False, state) == OK


@check("taylor.stepping LOST_ROWS")
def _(monkeypatch):
    return flips(lambda left: judged_step(monkeypatch, violation=left), 0.98e-8, 1.02e-8)


@check("taylor.stepping ROW_ROUNDING")
def _(monkeypatch):
    return flips(lambda left: judged_step(monkeypatch, violation=left, tolerance=0.0), 0.98e-12, 1.02e-12)


@check("taylor.stepping LOST_MOTION")
def _(monkeypatch):
    most = 30.0 * 22**2 * 1e-10
    return flips(lambda off: judged_step(monkeypatch, off=off), 0.97 * most, 1.03 * most)


@check("taylor.stepping MOTION_ROUNDING")
def _(monkeypatch):
    ends = lambda off: judged_step(monkeypatch, off=off, acceleration=1e3, tolerance=0.0)  # noqa: E731
    return flips(ends, 0.98e-6, 1.02e-6)


@check("taylor.stepper CHEAPEST")
def _(_):
    orders = [stepper.order_of(10.0**-k, 0, code) for code in ("generic", "generated") for k in range(2, 14)]
    general, generated = (
        [8, 10, 10, 12, 14, 14, 16, 16, 18, 20, 20, 22],
        [10, 12, 14, 16, 16, 18, 20, 22, 24, 24, 26, 28],
    )
    return orders == general + generated


@check("taylor.stepper LEAST_ORDER")
def _(_):
    return stepper.order_of(1e3, 0, "generic") == 4


@check("taylor.stepper MOST_ORDER")
def _(_):
    return stepper.order_of(1e-30, 0, "generic") == 30


@check("stepping.ranks MOST_RANKED_ROWS")
def _(_):
    def are_computed(rows):
        symbolic = SimpleNamespace(row=np.arange(rows), column=np.arange(rows))
        model = SimpleNamespace(structure=SimpleNamespace(dense=lambda _: np.eye(rows)[None]))
        found = ranks.all_ranks(model, np.zeros((1, rows, 12)), np.ones((1, rows)), symbolic, 1e-10)
        return found[0].rank == rows

    return are_computed(120) and not are_computed(121)
