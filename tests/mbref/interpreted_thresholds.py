"""Decisions at singular positions just on both sides of each threshold; run by ``test_thresholds.py``,
interpreted.

Kernels are plain functions here, and memory is a namespace with the numbers that a decision reads.  Each
check has its numbers written out: a threshold that moves by 10 % (a count: by one) fails its check.
"""

import itertools
import math
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from mbref.kernels.compilation import PLAIN
from mbref.kernels.layout import OK
from mbref.stepping.loop import STEP_TOO_SMALL, UNDECIDED
from mbref.taylor import stepping
from mbref.taylor.crossing import (
    acceptance,
    departure,
    detection,
    location,
    long_crossing,
    rounding_pole,
    short_crossing,
    start,
    thresholds,
    uniqueness,
)
from mbref.taylor.mode import HIGH_ACCURACY, REGULAR
from tests.mbref.threshold_checks import KERNELS, flips, memory

CHECKS = {}


def check(name):
    """Decorate the check of a threshold."""

    def put(function):
        CHECKS[name] = function
        return function

    return put


def of_determinant(monkeypatch, value):
    """Have the determinant be a function of time: its sign and logarithm."""
    at = SimpleNamespace(h=0.0)

    def signed(number):
        return number < 0.0, math.log(max(abs(number), 1e-300))

    monkeypatch.setattr(location, "evaluate_series", lambda h, _: setattr(at, "h", h))
    monkeypatch.setattr(detection, "evaluate_series", lambda h, _: setattr(at, "h", h))
    monkeypatch.setattr(KERNELS, "determinant", lambda *_: signed(value(at.h)))
    for module in (location, detection):
        monkeypatch.setattr(module, "save_start_determinant", lambda _: None)
        monkeypatch.setattr(module, "gradient_determinant_at_end", lambda _: signed(value(1.0)))
        monkeypatch.setattr(module, "log_determinant_at_start", lambda _: math.log(abs(value(0.0))))


def counted(monkeypatch, value):
    """The times at which a determinant is evaluated from now on."""
    times = []

    def evaluated(h):
        times.append(h)
        return value(h)

    of_determinant(monkeypatch, evaluated)
    return times


# --- detection ------------------------------------------------------------------------------------------
@check("PIVOT_NEAR")
def _(_):
    return flips(lambda pivot: detection.is_near_singular(pivot, memory()), 0.29, 0.31)


@check("PIVOT_AHEAD")
def _(_):
    return flips(lambda pivot: detection.ends_near_singular(pivot, memory()), 0.029, 0.031)


@check("PIVOT_SLOPE")
def _(monkeypatch):
    monkeypatch.setattr(detection, "determinant_changes_sign", lambda *_: True)
    decide = lambda h: detection.contains_singular_position.function(h, 1.0, memory(kind=REGULAR))  # noqa: E731
    return flips(lambda h: not decide(h), 1.32, 1.35)


def parts(monkeypatch, h):
    """The parts in which a step is judged that moves by h."""
    found = []
    monkeypatch.setattr(detection, "determinant_changes_sign", lambda _, parts, __: not found.append(parts))
    detection.contains_singular_position.function(h, 0.0, memory(pivot=0.0))
    return found


@check("PART_LENGTH")
def _(monkeypatch):
    return parts(monkeypatch, 1.49) == [3] and parts(monkeypatch, 1.51) == [4]


@check("MAX_PARTS")
def _(monkeypatch):
    return parts(monkeypatch, 3.9) == [8] == parts(monkeypatch, 100.0)


@check("MONOTONE_PARTS")
def _(monkeypatch):
    def by_rates(count):
        monkeypatch.setattr(detection, "rates_oppose", lambda _: True)
        of_determinant(monkeypatch, lambda _: 1.0)
        monkeypatch.setattr(KERNELS, "determinant", lambda *_: (False, 0.0))
        monkeypatch.setattr(detection, "save_gradient", lambda _: None)
        return detection.determinant_changes_sign(1.0, count, memory())

    return flips(by_rates, 4, 5)


@check("LOG_LEVEL")
def _(monkeypatch):
    def level(value):
        of_determinant(monkeypatch, lambda _: value)
        return detection.stays_level(1.0, 0.0, memory())

    return flips(lambda value: not level(value), 0.49, 0.51)


@check("LOG_DIP")
def _(monkeypatch):
    def dips(value):
        of_determinant(monkeypatch, lambda h: value if 0.0 < h < 1.0 else 1.0)
        return detection.dips_to_zero(1.0, 1.0, memory(kind=REGULAR))

    return flips(dips, 0.19, 0.21)


@check("LOG_DIP_COARSE")
def _(monkeypatch):
    def searches_on(value):
        times = counted(monkeypatch, lambda h: value if 0.0 < h < 1.0 else 1.0)
        detection.vanishes_inside(1.0, memory())
        return len(times) > 40

    return flips(searches_on, 0.130, 0.140)


@check("LOG_ZERO")
def _(monkeypatch):
    def vanishes(logarithm):
        of_determinant(monkeypatch, lambda h: math.exp(logarithm) if 0.0 < h < 1.0 else 1.0)
        return detection.vanishes_inside(1.0, memory())

    return flips(vanishes, -30.1, -29.9)


# --- location -------------------------------------------------------------------------------------------
def minimum_search(monkeypatch):
    times = counted(monkeypatch, lambda h: 1e-3 + abs(h - 0.3) if 0.0 < h < 1.0 else 1.0)
    detection.vanishes_inside(1.0, memory())
    return len(times)


@check("SECTIONS_COARSE")
def _(monkeypatch):
    monkeypatch.setattr(detection, "LOG_ZERO", -1e9)
    monkeypatch.setattr(detection, "LOG_DIP_COARSE", -1e9)  # the coarse search ends it
    return minimum_search(monkeypatch) == 2 + 2 + 2 + 12 + 1


@check("SECTIONS")
def _(monkeypatch):
    return minimum_search(monkeypatch) == 2 + 2 + 2 + 12 + 1 + 2 + 70 + 1


@check("INTERPOLATIONS")
def _(monkeypatch):
    """A multiple root: so many interpolations, which are slow, then bisections."""
    monkeypatch.setattr(location, "BISECTIONS", 0)
    times = counted(monkeypatch, lambda h: math.copysign(abs(h - 0.3) ** 9, 0.3 - h))
    location.sign_change(1.0, memory())
    return len(times) - 2 == 12


@check("BISECTIONS")
def _(monkeypatch):
    times = counted(monkeypatch, lambda h: h - 0.3)
    location.bisect(1.0, 0.0, 0.0, memory())
    return len(times) == 45


@check("LOCATION_ERROR")
def _(monkeypatch):
    def evaluations(tolerance):
        monkeypatch.setattr(location, "LOCATION_ERROR", tolerance)
        times = counted(monkeypatch, lambda h: math.exp(-8.0 * h) - math.exp(-2.4))
        return abs(location.sign_change(1.0, memory()) - 0.3), len(times)

    error, _ = evaluations(location.LOCATION_ERROR)
    return thresholds.LOCATION_ERROR == 1e-13 and error < 1e-13 < evaluations(1e-4)[0]


@check("POLE_BRACKET")
def _(monkeypatch):
    """A root within the bracket of the pole is found from there; one outside is not."""

    def starts_there(root):
        times = counted(monkeypatch, lambda h: root - h)
        location.sign_change(1.0, memory(time_to_pole=0.5))
        return min(times[2:]) > 0.4 and times[2:4] == pytest.approx([0.5, 0.5], rel=2e-6)

    inside = 0.5 * (1.0 + 0.9e-6)
    times = counted(monkeypatch, lambda h: inside - h)
    location.sign_change(1.0, memory(time_to_pole=0.5))
    return starts_there(inside) and abs(times[3] / 0.5 - 1.0 - 1e-6) < 1e-8


@check("PAIR_OFFSET")
def _(monkeypatch):
    """Two roots that are further apart than twice the offset enclose the time that is tried."""

    def found(apart):
        of_determinant(
            monkeypatch, lambda h: 1e3 * ((h - 0.5) ** 2 - apart**2) if abs(h - 0.5) > 1e-9 else 1e-20
        )
        monkeypatch.setattr(location, "time_of_minimum", lambda *_: 0.5)
        return location.find_pair(1.0, memory())[1] < 0.0

    return flips(found, 0.97e-5, 1.03e-5)


@check("PAIR_DEPTH")
def _(monkeypatch):
    def single(depth):
        of_determinant(monkeypatch, lambda h: -depth if 0.4 < h < 0.6 else 1.0)
        monkeypatch.setattr(location, "time_of_minimum", lambda *_: 0.5)
        return location.find_pair(1.0, memory())[1] < 0.0

    return flips(single, 0.95e-11, 1.05e-11)


# --- steps that cross -----------------------------------------------------------------------------------
@check("CROSSING_START")
def _(_):
    def is_looser(distance):
        step = memory(start_pivot=distance)
        return acceptance.crossing_tolerance(step) > acceptance.step_tolerance(step)

    return flips(is_looser, 0.59, 0.61)


@check("CROSSING_NOISE")
def _(_):
    return acceptance.crossing_tolerance(memory(start_pivot=1e-2)) == pytest.approx(4e-13, rel=1e-3, abs=0.0)


def lengths(monkeypatch, longest, **numbers):
    """First lengths of a step of which the tolerance allows so much."""
    monkeypatch.setattr(stepping, "longest_step", lambda *_: longest)
    return stepping.first_lengths(1e3, memory(**numbers))


@check("CROSSING_MARGIN")
def _(monkeypatch):
    return flips(
        lambda longest: lengths(monkeypatch, longest, time_to_crossing=1.0)[1] != longest, 1.04, 1.06
    )


@check("OVERSHOOT")
def _(_):
    return stepping.next_length(2.0, 1.0, memory(crossed=1)) == pytest.approx(1.25)


@check("LOOSER_RATES")
def _(_):
    """A last term whose rate is larger than the tolerance by the factor shortens the step."""

    def longest(kind):
        step = memory(kind=kind, tolerance=1e-10)
        step.series.past[21, 0] = step.series.past[22, 0] = 1e20
        return stepping.longest_step(1e-10, step)

    of_rates = (1e-10 * 1e4 / (22 * 1e20)) ** (1 / 21)
    of_terms = (1e-10 / 1e20) ** (1 / 21)
    return (
        longest(HIGH_ACCURACY) == pytest.approx(min(of_rates, of_terms), rel=5e-3)
        and thresholds.LOOSER_RATES == 1e4
    )


@check("LONG_CROSSING_ORDER")
def _(monkeypatch):
    monkeypatch.setattr(long_crossing, "save_state", lambda *_: None)
    step = memory()
    step.crossing_start = None
    long_crossing.start_crossing(step)
    return step.mode.order == 16


@check("PIVOT_CLEAR")
def _(_):
    def is_clear(pivot):
        step = memory(pivot=pivot)
        long_crossing.judge_clearance(step)
        return step.progress.is_clear

    return flips(lambda pivot: not is_clear(pivot), 0.089, 0.091)


# --- acceptance -----------------------------------------------------------------------------------------
@check("VIOLATION_FLOOR")
def _(_):
    return acceptance.violation_by_rounding(memory(start_pivot=1e-9)) == 1e-15


@check("VIOLATION_NEAR")
def _(_):
    return acceptance.violation_by_rounding(memory()) == 1e-14


@check("VIOLATION_ACROSS")
def _(_):
    return acceptance.violation_by_rounding(memory(crossed=1)) == 1e-13


@check("VIOLATION_LEFT")
def _(_):
    return acceptance.violation_by_rounding(memory(start_violation=1e-9)) == 2e-9


@check("TIME_ROUNDING")
def _(_):
    found = acceptance.violation_by_rounding(memory(drivers=1, time=100.0, speed=5.0))
    return found == pytest.approx(1.5e-13, rel=1e-3, abs=0.0)


def approach(pivot, turned=False, last=False, **numbers):
    step = memory(pivot=pivot, **numbers)
    return acceptance.judge_approach(1.0, pivot, turned, last, step)


def across(pivot, **numbers):
    return acceptance.judge_crossing(pivot, False, False, memory(pivot=pivot, crossed=1, **numbers))


@check("MIN_PIVOT_RATIO")
def _(_):
    return flips(lambda pivot: approach(pivot) == STEP_TOO_SMALL, 0.19, 0.21)


@check("MIN_PIVOT_RATIO_ACROSS")
def _(_):
    return flips(lambda pivot: across(pivot) == STEP_TOO_SMALL, 0.049, 0.051)


@check("MAX_SHIFT")
def _(_):
    return flips(lambda shift: across(1.0, correction=shift) == OK, 0.049, 0.051)


@check("MIN_PIVOT")
def _(_):
    """Where the limit of unit rows does not count, because the steps began nearer."""
    return flips(
        lambda pivot: approach(pivot, start_pivot=2.0 * pivot, entry_pivot=1e-12) == UNDECIDED,
        0.95e-9,
        1.05e-9,
    )


@check("MIN_PIVOT_ACROSS")
def _(_):
    return flips(lambda pivot: across(pivot, start_pivot=pivot) == UNDECIDED, 0.95e-6, 1.05e-6)


@check("MIN_PIVOT_FREE")
def _(_):
    return flips(lambda pivot: approach(pivot, start_pivot=2.0 * pivot) == UNDECIDED, 2.4e-8, 2.6e-8)


@check("MIN_PIVOT_RESOLVED")
def _(_):
    driven = flips(
        lambda pivot: approach(pivot, start_pivot=2.0 * pivot, variables=1) == UNDECIDED, 0.95e-7, 1.05e-7
    )
    return driven and flips(lambda pivot: start.hides_rank(memory(pivot=pivot)), 0.95e-7, 1.05e-7)


@check("ENTRY_RATIO")
def _(_):
    return flips(
        lambda pivot: approach(pivot, start_pivot=2.0 * pivot, entry_pivot=4e-8) == UNDECIDED, 1.9e-8, 2.1e-8
    )


# --- uniqueness -----------------------------------------------------------------------------------------
@check("MIN_ENERGY")
def _(_):
    return flips(lambda least: not uniqueness.keeps_moving(least, 1.0, memory()), 0.019, 0.021)


@check("BOUND_MARGIN")
def _(_):
    """0.5 times STRICTER times MAX_GAIN: a delay of 5 s at a speed of 1."""
    return flips(lambda delay: uniqueness.is_bounded(delay, memory()), 4.9, 5.1)


@check("MAX_SHORT_STEPS")
def _(monkeypatch):
    step, taken = memory(), []
    step.kernels = SimpleNamespace(step=lambda _: taken.append(1) or OK)
    monkeypatch.setattr(short_crossing, "energy_in_middle", lambda _: 1.0)
    return not short_crossing.take_crossing_steps(step) and len(taken) == 6


def agrees(monkeypatch, rtol, apart, rates=0.0, counted_otherwise=False):
    """Whether a perturbed run that ends apart by so much agrees."""
    step = memory()
    step.crossing_end = np.zeros((2, 8))

    def run(change, *_):
        step.series.terms[0, 0] += apart
        step.series.terms[1, 0] += rates
        step.run.equations.system.counts.crossings += counted_otherwise
        step.change = change
        return True

    monkeypatch.setattr(uniqueness, "run_perturbed", run)
    return uniqueness.perturbed_run_agrees(rtol, step), step.change


@check("MIN_CHANGE")
def _(monkeypatch):
    return agrees(monkeypatch, 1e-14, 0.0)[1] == 1e-9


@check("MAX_GAIN")
def _(monkeypatch):
    return flips(lambda apart: agrees(monkeypatch, 1e-6, apart)[0], 0.99e-4, 1.01e-4)


@check("MAX_APART")
def _(monkeypatch):
    return flips(lambda apart: agrees(monkeypatch, 1e-3, apart)[0], 0.99e-2, 1.01e-2)


@check("STRICTER")
def _(monkeypatch):
    return flips(lambda apart: agrees(monkeypatch, 1e-6, apart, counted_otherwise=True)[0], 0.99e-5, 1.01e-5)


@check("RATE_FACTOR")
def _(monkeypatch):
    return flips(lambda rates: agrees(monkeypatch, 1e-6, 0.0, rates)[0], 0.99e-3, 1.01e-3)


# --- rounding pole --------------------------------------------------------------------------------------
def with_pole(gap=1e-16, distance=0.01, off=0.0, order=22):
    """A memory whose last terms are a pole of a gap at a distance (s), the last but one off by a ratio."""
    step = memory(start_pivot=distance)
    step.mode.order = order
    step.series.past[:, 0] = gap / distance / distance ** np.arange(31.0)
    step.series.past[order - 1, 0] *= 1.0 + off
    return step


@check("MIN_SERIES_ORDER")
def _(_):
    return flips(lambda order: rounding_pole.time_of_pole(with_pole(order=order)) == 0.0, 9, 10)


@check("PURE_POLE")
def _(_):
    """Twice the relative error of the middle one of three terms."""
    return flips(lambda off: rounding_pole.time_of_pole(with_pole(off=off)) != 0.0, 4.9e-4, 5.1e-4)


@check("MAX_GAP")
def _(_):
    return flips(lambda gap: rounding_pole.time_of_pole(with_pole(gap)) != 0.0, 2.9e-16, 3.1e-16)


def last_order(growth):
    """The last order of a series whose terms grow by a ratio each order, over that of the pole's squared."""
    step = memory()
    step.series.past[:, 0] = (math.sqrt(growth) / 0.01) ** np.arange(31.0)
    return rounding_pole.last_order(0.01, step)


@check("POLE_GROWTH")
def _(_):
    return flips(lambda growth: last_order(growth) == 19, 0.24, 0.26)


@check("POLE_ORDERS")
def _(_):
    return last_order(0.1) == 22 - 3


@check("MIN_ORDER_LEFT")
def _(_):
    return last_order(0.5) == 4


@check("MIN_GAIN")
def _(monkeypatch):
    def keeps_pole(longest):
        found = itertools.cycle([1.0, longest])
        saved = []
        monkeypatch.setattr(stepping, "save_series", lambda _: saved.append(1))
        monkeypatch.setattr(stepping, "time_of_pole", lambda _: 1.0)
        monkeypatch.setattr(stepping, "remove_pole", lambda *_: None)
        monkeypatch.setattr(stepping, "longest_step", lambda *_: next(found))
        stepping.save_series_without_pole.function(memory())
        return len(saved) == 2

    return flips(keeps_pole, 0.49, 0.51)


# --- start ----------------------------------------------------------------------------------------------
def misses(monkeypatch, changed, **numbers):
    """Whether a series misses a start of velocity 1 by a change of it."""
    step = memory(**numbers)
    state = SimpleNamespace(coordinates=np.zeros(1), velocities=np.ones(1))
    before = SimpleNamespace(coordinates=np.zeros(1), velocities=np.ones(1))
    step.run.state, step.run.previous = state, before
    monkeypatch.setattr(start, "copy_state", lambda *_: None)
    monkeypatch.setattr(start, "put_terms", lambda *_: state.velocities.__setitem__(0, 1.0 + changed))
    return start.misses_state(step)


@check("START_ERROR")
def _(monkeypatch):
    return flips(lambda changed: not misses(monkeypatch, changed), 1.9e-7, 2.1e-7)


@check("START_ERROR_DRIVEN")
def _(monkeypatch):
    return flips(lambda changed: not misses(monkeypatch, changed, variables=1), 0.049, 0.051)


@check("REST_PIVOT")
def _(_):
    return flips(lambda pivot: start.rests_near(memory(pivot=pivot, velocity=0.0)), 4.9e-6, 5.1e-6)


@check("REST_TURN")
def _(_):
    return flips(
        lambda correction: not start.is_turned(memory(pivot=1e-6, correction=correction)), 2.9e-11, 3.1e-11
    )


# --- departure ------------------------------------------------------------------------------------------
def departing(**numbers):
    run = SimpleNamespace(
        model=SimpleNamespace(data=SimpleNamespace(lengths=np.ones(1))),
        memory=SimpleNamespace(
            equations=SimpleNamespace(system=SimpleNamespace(settings=SimpleNamespace(rank_tolerance=1e-10))),
            state=SimpleNamespace(coordinates=np.zeros(7), velocities=np.zeros(6)),
        ),
    )
    return departure.Departure(run, None, numbers.get("expand"), numbers.get("state_at"))


@check("DEPARTURE")
def _(_):
    return departing()._time_in_which(np.array([2.0, 0, 0, 0, 0, 0])) == pytest.approx(1.5e-3)


@check("DEPARTURE_CORRECTIONS")
def _(_):
    calls, state = [], (np.array([0.0, 0, 0, 1, 0, 0, 0]), np.zeros(6))
    leaving = departing(expand=lambda: calls.append(1) or OK, state_at=lambda _: state)
    leaving._corrected(SimpleNamespace(coordinates=state[0]), np.zeros(6), 1.0, state)
    return len(calls) == 6


@check("DEPARTURE_PIVOT")
def _(_):
    q = np.array([0.1, 0, 0, 1, 0, 0, 0])
    return departing()._least_pivot_at(q, np.array([0.0, 0, 0, 1, 0, 0, 0])) == pytest.approx(2e-3)


@pytest.mark.skipif(not PLAIN, reason="kernels are interpreted by test_thresholds.py")
@pytest.mark.parametrize("name", [name for name in vars(thresholds) if name.isupper()])
def test_a_decision_changes_at_its_threshold(name, monkeypatch):
    assert CHECKS[name](monkeypatch), name


@pytest.mark.skipif(not PLAIN, reason="kernels are interpreted by test_thresholds.py")
@pytest.mark.parametrize("up", [False, True], ids=["smaller", "larger"])
@pytest.mark.parametrize("name", [name for name in vars(thresholds) if name.isupper()])
def test_the_check_fails_when_its_threshold_moves(name, up, monkeypatch):
    """A number moves by a tenth, a count by one, in each module that reads it."""
    usual = getattr(thresholds, name)
    is_count = isinstance(usual, int)
    moved = usual + (1 if up else -1) if is_count else usual * (1.1 if up else 1 / 1.1)
    for key, module in list(sys.modules.items()):
        if key.startswith("mbref.taylor") and hasattr(module, name):
            monkeypatch.setattr(module, name, moved)
    assert not CHECKS[name](monkeypatch), f"{name} = {moved:g} passes the check of {usual:g}"
